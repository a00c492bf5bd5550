"""What forbids a grasp: of the constraints, in the order in which they are checked, the first that nothing passes."""

from dataclasses import dataclass, field
from typing import Any

STAGES = (
    "room",
    "reach",
    "surround",
    "clear",
    "reserve",
    "gap",
    "hold",
    "spare",
    "stroke hold",
)
"""room: the object off the palm; reach: tips on it; surround: contacts on enough sides; clear: links; reserve: turn
that each finger can follow; gap: between fingers; hold: with all fingers; spare: with any one away; stroke hold:
the same at the ends of the reserve."""


@dataclass
class Funnel:
    """How many candidates passed each stage, and the nearest miss of each: how near (larger is nearer), words, grasp.

    `clear`: fingers that touched the object somewhere with their links clear; `example`: what blocked each finger.
    """

    passed: dict[str, int] = field(default_factory=lambda: dict.fromkeys(STAGES, 0))
    nearest: dict[str, tuple[float, str, Any]] = field(default_factory=dict)
    clear: set[int] = field(default_factory=set)
    example: dict[int, str] = field(default_factory=dict)

    def passes(self, stage: str, count: int = 1) -> None:
        """Counts candidates that pass."""
        self.passed[stage] += count

    def misses(self, stage: str, nearness: float, words: str = "", grasp: Any = None) -> None:
        """Remembers a miss if it is the nearest so far."""
        if stage not in self.nearest or nearness > self.nearest[stage][0]:
            self.nearest[stage] = (nearness, words, grasp)

    @property
    def first(self) -> str:
        """The first stage that nothing passed; empty where all were passed."""
        return next((stage for stage in STAGES if self.passed[stage] == 0), "")
