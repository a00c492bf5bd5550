"""What each addition to the paper is worth: every one taken back alone, under three conditions."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fingergait.reproduce.case import Case, Outcome

VARIANTS: dict[str, tuple[str, Mapping[str, Any]]] = {
    "as shipped": ("", {}),
    "plane of Q_o": ("the paper's, through the contacts", {"gait.plane": "contacts"}),
    "rate box": ("the paper's, round the last velocity", {"gait.project_rate_box": False}),
    "height term": ("none", {"gait.w_z": 0.0}),
    "plane and height": ("the paper's plane, no height term", {"gait.plane": "contacts", "gait.w_z": 0.0}),
    "slack gate": ("a finger is freed without asking", {"gait.slack_force": 1e3, "gait.slack_torque": 1e3}),
    "w2": ("the paper's 0.01", {"gait.w2": 0.01}),
    "surface motion": ("not followed", {"gait.follow_surface": False}),
    "feedforward": ("none", {"robust.feedforward": 0.0}),
    "torque length": ("1 m, as the paper adds N and N m", {"force.torque_length": 1.0}),
    "friction": ("not adapted", {"force.adapt_friction": False}),
}
"""Name, what it is replaced by, and the scenario keys."""

CONDITIONS = {"ideal sensors": "lift-and-rotate", "noise": "noisy", "friction 0.6, noise": "slippery"}
"""Conditions under which each variant runs: the scenario of each."""


@dataclass(frozen=True)
class Cell:
    """One variant under one condition, over its seeds.

    kept, runs
        Runs that kept the object, and all.
    orientation, position
        Worst errors of the kept runs, rad and m; None if there are none.
    height
        Largest deviation of a contact's height, m, in the kept runs.
    raised, resting, above
        Means over the kept runs: share of gaits that raise Q, of time without a gait, and of that with Q above its
        threshold.
    command
        Repeats the first run.
    """

    kept: int
    runs: int
    orientation: float | None
    position: float | None
    height: float | None
    raised: float | None
    resting: float | None
    above: float | None
    command: str


def ablation_cases(quick: bool) -> list[Case]:
    """The runs of every variant, condition and seed."""
    seeds, duration = (1, 24.0) if quick else (4, 60.0)
    return [
        Case(_key(variant, condition, seed), base, {"duration": duration, "seed": seed, **changes})
        for variant, (_, changes) in VARIANTS.items()
        for condition, base in CONDITIONS.items()
        for seed in range(1 if base == "lift-and-rotate" else seeds)
    ]


def ablation_table(outcomes: Mapping[str, Outcome]) -> dict[str, dict[str, Cell]]:
    """The cells by variant and condition."""
    table: dict[str, dict[str, Cell]] = {}
    for variant in VARIANTS:
        table[variant] = {}
        for condition in CONDITIONS:
            prefix = _key(variant, condition, None)
            table[variant][condition] = _cell([o for key, o in outcomes.items() if key.startswith(prefix)])
    return table


def _key(variant: str, condition: str, seed: int | None) -> str:
    return f"{variant} / {condition} / " + ("" if seed is None else str(seed))


def _cell(runs: list[Outcome]) -> Cell:
    kept = [run for run in runs if run.kept]

    def largest(name: str) -> float | None:
        return max((run.metrics[name] for run in kept), default=None)

    def mean(name: str) -> float | None:
        values = [value for run in kept if (value := run.extra["gaits"][name]) is not None]
        return sum(values) / len(values) if values else None

    return Cell(
        kept=len(kept),
        runs=len(runs),
        orientation=largest("max_orientation_error_rad"),
        position=largest("max_position_error_m"),
        height=largest("max_height_deviation_m"),
        raised=mean("raised"),
        resting=mean("resting"),
        above=mean("above"),
        command=runs[0].case.command,
    )
