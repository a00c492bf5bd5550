"""What is asked of a grasp, and how long it is searched for."""

from dataclasses import dataclass, replace

import numpy as np

from fingergait.adopt.clearance import Asked


@dataclass(frozen=True)
class SearchOptions:
    """Demands and effort of the grasp search; lengths in m, angles in rad.

    friction, disturbance
        Friction assumed at the contacts; the disturbance d, see `statics`.
    load_limit
        The load factor that holding, with all fingers and with any one away, may need.
    reserve
        Turn that every finger must be able to follow from the grasp, both ways.
    stroke_cap
        Turns beyond this are not looked at.
    link_clearance, finger_gap, palm_clearance, own_clearance
        Least distances over the stroke: of links from the object, of fingers from each other, of the object from the
        palm, of a finger's links from each other and from the palm.
    tip_tolerance
        How far more than the tip's sphere may stand in the object.
    limit_margin
        Share of a joint's range that stays free at either end of it, at the ends of the stroke too.
    rim
        Least distance of a contact from an edge of the object, in tip radii.
    samples, positions, places_refined, nearby, candidates
        Effort: postures of each finger; places of the object; how many of them are looked at more closely, and how
        often; contacts of each finger at each place.
    combinations, judged, marched
        Effort: combinations of contacts drawn and judged at each place; places whose strokes are looked at.
    generations, offspring, refined
        Effort: rounds, size and starting grasps of the local search.
    seed
        The same seed gives the same grasps, whatever the number of processes.
    """

    friction: float = 0.65
    disturbance: float = 0.5
    load_limit: float = 0.7
    reserve: float = np.deg2rad(15.0)
    stroke_cap: float = np.deg2rad(60.0)
    link_clearance: float = 2.5e-3
    finger_gap: float = 2e-3
    palm_clearance: float = 3e-3
    own_clearance: float = 5e-4
    tip_tolerance: float = 3e-4
    limit_margin: float = 0.03
    rim: float = 0.25
    samples: int = 8192
    positions: int = 24
    places_refined: int = 4
    nearby: int = 5
    candidates: int = 50
    combinations: int = 2000
    judged: int = 40
    marched: int = 12
    generations: int = 60
    offspring: int = 18
    refined: int = 3
    seed: int = 0

    @property
    def angles(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """Turns at which a stroke is looked at, from 0, about 2.5 degrees apart."""
        return np.linspace(0.0, self.stroke_cap, max(2, round(self.stroke_cap / np.deg2rad(2.5)) + 1))

    def asked(self, tip_error: float) -> Asked:
        """Clearances of a finger whose sphere fits its tip up to `tip_error`, m."""
        return Asked(self.link_clearance, self.own_clearance, self.tip_tolerance + tip_error)

    def quick(self) -> "SearchOptions":
        """The same demands with less effort: for maps."""
        return replace(
            self,
            positions=16,
            places_refined=2,
            nearby=4,
            candidates=32,
            judged=30,
            marched=5,
            generations=30,
            refined=1,
        )

    def shorter(self) -> "SearchOptions":
        """The same demands where a grasp of a like object is known."""
        return replace(self, positions=self.positions // 3, places_refined=1, marched=3, refined=1)
