"""How far each quantity can be taken before the object is lost: bisection with a few seeds."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fingergait._core import FingergaitError
from fingergait.reproduce.case import Case, Outcome, full_turn
from fingergait.reproduce.constraint import explain
from fingergait.reproduce.pool import run_case

_BASE = "noisy"
_SHARE = 0.97  # of the desired rotation that a kept run must reach
_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Limit:
    """A quantity to be taken to its limit.

    key, title, unit
        Its name, in words, and its unit.
    shown
        What the paper or this project's requirements have demonstrated, in words.
    easy, hard
        Values between which the limit is sought; the object is expected to be kept at `easy` and lost at `hard`.
    keys
        Scenario keys at a value.
    duration
        Simulated time of a run at a value, s.
    geometric
        Bisect the logarithm.
    """

    key: str
    title: str
    unit: str
    shown: str
    easy: float
    hard: float
    keys: Callable[[float], Mapping[str, Any]]
    duration: Callable[[float], float]
    geometric: bool = False


@dataclass(frozen=True)
class Trial:
    """One run of a bisection: the value, whether it held, the limit that became active first, and how it ended."""

    value: float
    held: bool
    reason: str
    end: str
    command: str


@dataclass(frozen=True)
class Bisection:
    """The trials of one limit with one seed, and the largest value that held and smallest that did not, if any."""

    key: str
    seed: int
    trials: tuple[Trial, ...]
    held: float | None
    lost: float | None


def all_limits() -> list[Limit]:
    """Every limit of the page."""
    turn = full_turn(0.2)

    def whole(_: float) -> float:
        return turn

    def pulses(_: float) -> float:
        return 17.0

    return [
        Limit(
            "yaw_rate",
            "rotation speed",
            "rad/s",
            "0.2 (paper)",
            0.2,
            1.2,
            lambda v: {"reference.yaw_rate": v},
            full_turn,
        ),
        Limit(
            "force",
            "force pulse of 0.2 s, six directions",
            "N",
            "5 (paper)",
            5.0,
            40.0,
            lambda v: {"disturbance": _pulses("force", v)},
            pulses,
            geometric=True,
        ),
        Limit(
            "torque",
            "torque pulse of 0.2 s, six directions",
            "N m",
            "0.03 (paper)",
            0.03,
            0.6,
            lambda v: {"disturbance": _pulses("torque", v)},
            pulses,
            geometric=True,
        ),
        Limit(
            "heavy",
            "true mass over nominal, upwards",
            "",
            "1.4 (paper)",
            1.0,
            16.0,
            lambda v: {"truth.mass_scale": v},
            whole,
            geometric=True,
        ),
        Limit(
            "light",
            "true mass over nominal, downwards",
            "",
            "0.6 (paper)",
            1.0,
            0.05,
            lambda v: {"truth.mass_scale": v},
            whole,
            geometric=True,
        ),
        Limit("radius", "radius", "mm", "25", 25.0, 60.0, lambda v: {"object.size": [round(1e-3 * v, 9), 0.06]}, whole),
        Limit(
            "friction",
            "true friction, unknown to the controller",
            "",
            "not given (video)",
            1.0,
            0.25,
            lambda v: {"truth.friction": v},
            whole,
        ),
        Limit(
            "swing",
            "amplitude of the swing at 4 rad/s",
            "rad",
            "0.1 (paper)",
            0.1,
            0.7,
            lambda v: {"reference.swing_amplitude": v},
            whole,
        ),
        Limit(
            "noise",
            "pose noise, as many mm as degrees",
            "mm",
            "0 (paper)",
            0.0,
            3.0,
            lambda v: {
                "sensors.position_noise": round(1e-3 * v, 9),
                "sensors.orientation_noise": round(float(np.deg2rad(v)), 6),
            },
            whole,
        ),
        Limit(
            "delay",
            "delay of the pose",
            "ms",
            "0 (paper)",
            0.0,
            240.0,
            lambda v: {"sensors.pose_delay_s": round(1e-3 * v, 9)},
            whole,
        ),
    ]


def _pulses(kind: str, size: float) -> list[dict[str, Any]]:
    signed = [(axis, sign) for axis in _AXES for sign in (1.0, -1.0)]
    return [
        {"at": 5.0 + 2.0 * index, "duration": 0.2, kind: [sign * size * x if x else 0.0 for x in axis]}
        for index, (axis, sign) in enumerate(signed)
    ]


def bisect(limit: Limit, seed: int, halvings: int) -> Bisection:
    """The trials of a bisection: both ends, then the middle of the interval between the last good and bad value."""
    trials = [_trial(limit, limit.easy, seed)]
    if not trials[0].held:
        return Bisection(limit.key, seed, tuple(trials), None, limit.easy)
    trials.append(_trial(limit, limit.hard, seed))
    if trials[1].held:
        return Bisection(limit.key, seed, tuple(trials), limit.hard, None)
    good, bad = limit.easy, limit.hard
    for _ in range(halvings):
        middle = float(np.sqrt(good * bad)) if limit.geometric else 0.5 * (good + bad)
        middle = float(f"{middle:.3g}")
        trials.append(_trial(limit, middle, seed))
        if trials[-1].held:
            good = middle
        else:
            bad = middle
    return Bisection(limit.key, seed, tuple(trials), good, bad)


def bisect_by_key(key: str, seed: int, halvings: int) -> Bisection:
    """`bisect` of the limit called `key`: what a worker process is asked."""
    return bisect(next(limit for limit in all_limits() if limit.key == key), seed, halvings)


def _trial(limit: Limit, value: float, seed: int) -> Trial:
    overrides = {"duration": limit.duration(value), "seed": seed, **limit.keys(value)}
    case = Case(f"{limit.key} {value:g}, seed {seed}", _BASE, overrides)
    try:
        outcome = run_case(case)
    except FingergaitError as error:
        return Trial(value, False, "the hand can't start with it", str(error), case.command)
    if _held(outcome):
        return Trial(value, True, "", "", case.command)
    end = str(outcome.metrics["lost_reason"] or "kept, but turned too little")
    return Trial(value, False, explain(outcome.extra["constraints"]), end, case.command)


def _held(outcome: Outcome) -> bool:
    if not outcome.kept:
        return False
    reference = outcome.case.scenario.reference
    wanted = abs(reference.yaw_rate) * (outcome.case.scenario.duration - reference.motion_start - reference.blend)
    return outcome.turned >= _SHARE * wanted
