"""A claim: what is asserted, the figure of the paper, what was measured and whether that holds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from fingergait.reproduce.case import Outcome

Figure = Callable[[Outcome], float | None]


@dataclass(frozen=True)
class Claim:
    """One row of the page.

    name
        Short and unique.
    claim
        The assertion, one sentence.
    paper
        The paper's own figure, as text; empty where it has none.
    measured, limit, unit
        Numbers in `unit`. `measured` is None where there is nothing to measure: the object was lost.
    at_least
        True where `measured` must reach `limit`, False where it must not exceed it.
    scenario, command
        The packaged scenario, and the command that repeats the run that `measured` comes from.
    note
        What else the reader should know, mostly why it was missed.
    """

    name: str
    claim: str
    paper: str
    measured: float | None
    limit: float
    unit: str
    scenario: str
    command: str
    at_least: bool = False
    note: str = ""

    @property
    def held(self) -> bool:
        """Whether the measured figure keeps to the limit."""
        if self.measured is None:
            return False
        return self.measured >= self.limit if self.at_least else self.measured <= self.limit

    def row(self) -> dict[str, Any]:
        """The claim as JSON."""
        return {
            "name": self.name,
            "claim": self.claim,
            "paper": self.paper,
            "measured": self.measured,
            "limit": self.limit,
            "at_least": self.at_least,
            "unit": self.unit,
            "held": self.held,
            "scenario": self.scenario,
            "command": self.command,
            "note": self.note,
        }


def worst(
    name: str,
    claim: str,
    outcomes: Sequence[Outcome],
    figure: Figure,
    limit: float,
    unit: str = "",
    paper: str = "",
    at_least: bool = False,
    note: str = "",
) -> Claim:
    """The claim judged by the worst of several runs; a run without a figure is worse than any.

    Parameters
    ----------
    outcomes
        The runs, at least one.
    figure
        The measured figure of a run in `unit`.
    """

    def badness(outcome: Outcome) -> float:
        value = figure(outcome)
        if value is None:
            return float("inf")
        return -value if at_least else value

    chosen = max(outcomes, key=badness)
    words = [word for word in (note, chosen.metrics["lost_reason"]) if word]
    return Claim(
        name=name,
        claim=claim,
        paper=paper,
        measured=figure(chosen),
        limit=limit,
        unit=unit,
        scenario=chosen.case.base,
        command=chosen.case.command,
        at_least=at_least,
        note="; ".join(words),
    )


def share(
    name: str,
    claim: str,
    outcomes: Sequence[Outcome],
    good: Callable[[Outcome], bool],
    paper: str = "",
) -> Claim:
    """The claim that all of some runs are good; its command repeats the first that is not."""
    bad = [outcome for outcome in outcomes if not good(outcome)]
    shown = bad[0] if bad else outcomes[0]
    return Claim(
        name=name,
        claim=claim,
        paper=paper,
        measured=float(len(outcomes) - len(bad)),
        limit=float(len(outcomes)),
        unit=f"of {len(outcomes)} run{'s' if len(outcomes) > 1 else ''}",
        scenario=shown.case.base,
        command=shown.case.command,
        at_least=True,
        note=f"{shown.case.key}: {_what_happened(shown)}" if bad else "",
    )


def _what_happened(outcome: Outcome) -> str:
    if not outcome.kept:
        return str(outcome.metrics["lost_reason"])
    errors = f"{position(outcome):.2f} mm and {orientation(outcome):.3f} rad"
    return f"kept and turned by {turned(outcome):.0f} degrees with errors up to {errors}"


def position(outcome: Outcome) -> float | None:
    """Largest position error after lift-off, mm."""
    value = outcome.value("max_position_error_m")
    return None if value is None else 1e3 * value


def orientation(outcome: Outcome) -> float | None:
    """Largest orientation error after lift-off, rad."""
    return outcome.value("max_orientation_error_rad")


def turned(outcome: Outcome) -> float | None:
    """Net rotation, degrees, of a run that kept the object."""
    return 57.29577951308232 * outcome.turned if outcome.kept else None
