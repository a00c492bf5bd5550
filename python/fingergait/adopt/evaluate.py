"""One grasp judged: clearances, stroke and loads, and one number by which two grasps are compared."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.clearance import Clearance
from fingergait.adopt.family import ObjectSpec
from fingergait.adopt.funnel import Funnel
from fingergait.adopt.library import Library
from fingergait.adopt.options import SearchOptions
from fingergait.adopt.statics import Contacts, Load, Pressing, Statics, pressing
from fingergait.adopt.stroke import Poses, Rows, limit_by_links, march, surface
from fingergait.adopt.view import HandView

Array = NDArray[np.float64]

DELIVERED = 1e-3  # of the weight: what the QP's soft wrench leaves of a wrench that can be delivered is far less
_FURTHER = 0.02


@dataclass(frozen=True)
class Touches:
    """N postures of one finger on the object: how far each follows its turn, and how it presses.

    q (N, n_j); reach (N, 2) rad backwards and forwards, `ended` by what; path (N, 2, steps + 1, n_j) on the way;
    pressing: at the start.
    """

    q: Array
    reach: Array
    ended: list[tuple[str, str]]
    path: Array
    pressing: list[Pressing]


@dataclass(frozen=True)
class Judged:
    """One grasp: postures, pose (position, turn), stroke (rad, both ways, of all fingers), reach (n, 2) of each finger,
    what ended them, and merit: positive is the stroke of a grasp that does all that is asked, else what is missing."""

    q: tuple[Array, ...]
    position: Array
    turn: float
    stroke: float
    reach: Array
    ended: tuple[tuple[str, str], ...]
    merit: float


class Judge:
    """Judges grasps of one hand and one object."""

    def __init__(
        self, hand: HandView, spec: ObjectSpec, library: Library, frame: Array, options: SearchOptions
    ) -> None:
        self.hand, self.spec, self.library, self.frame, self.options = hand, spec, library, frame, options
        self.clearance = Clearance(hand, spec, library.chains)
        load = Load(spec.mass, spec.radius, options.friction, options.disturbance)
        self.statics = Statics(hand, load)
        self.n = len(hand.fingers)
        self.sparing = self.n > 3  # two point contacts can't resist a torque about the line through them
        self.order = list(range(self.n))
        self.asked = [options.asked(finger.tip_error) for finger in hand.fingers]
        self.rims = [options.rim * finger.tip_radius for finger in hand.fingers]

    def touches(self, j: int, q: Array, poses: Poses, every: int, most: float = np.inf) -> Touches:
        """Finger j's postures q (N, n_j) on the object at `poses`; links are looked at in every `every`-th step.

        Turns beyond `most`, rad, are not looked at.
        """
        chain, options, angles = self.library.chains[j], self.options, self.options.angles
        angles = angles[angles < most + angles[1] - 1e-9]
        marches = march(self.spec, chain, q, poses, self.rims[j], options.limit_margin, angles)
        limits = [
            limit_by_links(self.clearance, j, way, poses, sign * angles, self.asked[j], every)
            for way, sign in zip(marches, (-1.0, 1.0), strict=True)
        ]
        return Touches(
            q,
            np.column_stack([reach for reach, _ in limits]),
            list(zip(limits[0][1], limits[1][1], strict=True)),
            np.stack([way.path for way in marches], axis=1),
            self.pressing(j, q, poses),
        )

    def pressing(self, j: int, q: Array, poses: Poses, more: float = 0.0) -> list[Pressing]:
        """How finger j presses at postures q (N, n_j), with the object turned on by `more` from `poses`."""
        chain = self.library.chains[j]
        postures = chain.at(q)
        contact = surface(self.spec, chain, postures.centre, poses, self.rims[j], more)
        own = np.array([self.statics.own_torque(j, angles) for angles in q])
        return pressing(contact.place, contact.normal, chain.jacobian(postures, contact.place), own, poses.position)

    def contacts(self, q: tuple[Array, ...], position: Array, turn: float, more: float = 0.0) -> Contacts:
        """Contacts of a grasp whose tips touch the object at this pose, turned on by `more`."""
        pose = Poses(position[None], np.array([turn]), self.frame)
        return self.statics.contacts([self.pressing(j, q[j][None], pose, more)[0] for j in range(self.n)])

    def overload(self, how: list[Pressing], enough: float = np.inf) -> tuple[float, str]:
        """What stays undelivered at the load limit, as shares of the weight, summed over all fingers and each one away.

        Zero where all is delivered. Stops at `enough`. The text says what fails first: "hold", "spare" or nothing.
        """
        contacts = self.statics.contacts(how)
        over, failing = 0.0, ""
        for away in [None, *self.order] if self.sparing else [None]:
            excess = self.statics.excess(contacts, self.options.load_limit, away, max(enough - over, DELIVERED))
            if excess > DELIVERED:
                over += excess
                failing = failing or ("hold" if away is None else "spare")
                if away is not None:
                    self.order.remove(away)  # who could not be spared once often can't
                    self.order.insert(0, away)
            if over > DELIVERED and over >= enough:
                return over, failing
        return over, failing

    def judge(
        self,
        touches: list[Touches],
        rows: Rows,
        poses: Poses,
        funnel: Funnel | None,
        keep: int = 1,
        than: float = -np.inf,
    ) -> list[Judged]:
        """Grasps of which the i-th has finger j as touches[j] says in row rows[i, j], the object at pose i.

        Those that can't be among the best `keep` or better than `than` are given up early: their merit is a bound.
        """
        judged: list[Judged] = []
        best: list[float] = []
        for i, row in enumerate(rows):
            cut = max(than, best[-1] if len(best) == keep else -np.inf)
            one = self._one(touches, row, poses, i, funnel, cut)
            judged.append(one)
            best = sorted([*best, one.merit], reverse=True)[:keep]
        return judged

    def _one(
        self, touches: list[Touches], row: Rows, poses: Poses, i: int, funnel: Funnel | None, cut: float
    ) -> Judged:
        options = self.options
        reach = np.array([touch.reach[r] for touch, r in zip(touches, row, strict=True)])
        ended = tuple(touch.ended[r] for touch, r in zip(touches, row, strict=True))
        q = tuple(touch.q[r] for touch, r in zip(touches, row, strict=True))
        position, turn = poses.position[i], float(poses.turn[i])
        stroke = float(reach.min())

        def verdict(missing: float) -> Judged:
            # Among equal strokes the one whose other fingers go further is better.
            merit = stroke + _FURTHER * float(reach.min(axis=1).mean()) if missing == 0.0 else -missing
            return Judged(q, position, turn, stroke, reach, ended, merit)

        missing = max(0.0, options.reserve - stroke) / options.reserve
        room = self.clearance.palm_to_object(position, poses.turned(i, np.zeros(1))[0])
        missing += max(0.0, options.palm_clearance - room) / options.palm_clearance
        if verdict(missing).merit <= cut:
            return verdict(missing)
        if missing > 0.0:
            worst = np.unravel_index(int(reach.argmin()), reach.shape)
            if stroke < options.reserve:
                self._misses_reserve(funnel, int(worst[0]), stroke, ended[worst[0]][worst[1]])
        how = [touch.pressing[r] for touch, r in zip(touches, row, strict=True)]
        over, failing = self.overload(how, -cut - missing)
        if missing + over > 0.0 and -(missing + over) <= cut:
            self._note(funnel, (q, position, turn), missing, failing, over)
            return verdict(missing + over)
        stroke, touching = self._neighbours(touches, row, stroke)
        short = max(0.0, options.reserve - stroke) / options.reserve
        if short > missing:
            missing = short
            if funnel is not None and touching:
                funnel.passes("reserve")
                found = np.rad2deg(stroke)
                funnel.misses("gap", stroke, f"fingers meet within {found:.0f} degrees of turn: {touching}")
        if missing == 0.0 and over == 0.0 and self.sparing:
            ends = self._at_ends(touches, row, poses, i)
            if ends > DELIVERED:
                over, failing = ends, "stroke hold"
        self._note(funnel, (q, position, turn), missing, failing, over)
        return verdict(missing + over)

    def _neighbours(self, touches: list[Touches], row: Rows, free: float) -> tuple[float, str]:
        """The largest turn, at most `free`, with which any two fingers stay apart, each at either end or at home."""
        angles = self.options.angles
        steps = int(np.searchsorted(angles, free + 1e-9)) - 1
        words = self._touching(touches, row, steps)
        if not words:
            return float(angles[steps]), ""
        low, high = -1, steps
        while high - low > 1:  # apart at `low`, not at `high`
            middle = (low + high) // 2
            found = self._touching(touches, row, middle)
            low, high, words = (low, middle, found) if found else (middle, high, words)
        return (float(angles[low]) if low >= 0 else 0.0), words

    def _touching(self, touches: list[Touches], row: Rows, step: int) -> str:
        """Which two fingers come too near each other with each at -step, 0 or +step; empty where none do."""
        gap = self.options.finger_gap
        frames = []
        for j, (touch, r) in enumerate(zip(touches, row, strict=True)):
            home, ends = touch.q[r][None], touch.path[r, :, step]
            frames.append(self.library.chains[j].frames(np.concatenate([home, ends]) if step else home))
        for j, k in self.hand.between:
            found = self.clearance.between(j, k, frames[j], frames[k], gap)
            if found.distance < gap:
                return f"{found.between[0]} within {1e3 * found.distance:.1f} mm of {found.between[1]}"
        return ""

    def _at_ends(self, touches: list[Touches], row: Rows, poses: Poses, i: int) -> float:
        """The most that stays undelivered, with any one finger away, with all fingers at either end of the reserve."""
        angles = self.options.angles
        step = min(int(np.searchsorted(angles, self.options.reserve - 1e-9)), len(angles) - 1)
        most = 0.0
        for way, sign in enumerate((-1, 1)):
            q = tuple(touch.path[r, way, step] for touch, r in zip(touches, row, strict=True))
            contacts = self.contacts(q, poses.position[i], float(poses.turn[i]), sign * float(angles[step]))
            for j in range(self.n):
                most = max(most, self.statics.excess(contacts, 1.0, j, DELIVERED))
        return most

    def _misses_reserve(self, funnel: Funnel | None, j: int, reach: float, why: str) -> None:
        if funnel is not None:
            funnel.misses("reserve", reach, reserve_words(self.hand.fingers[j].name, reach, self.options.reserve, why))

    def _note(
        self,
        funnel: Funnel | None,
        grasp: tuple[tuple[Array, ...], Array, float],
        missing: float,
        failing: str,
        over: float,
    ) -> None:
        """Counts the stages that the grasp passes; what it misses is noted only where nothing before is missing."""
        if funnel is None or missing > 0.0:
            return
        funnel.passes("reserve")
        funnel.passes("gap")
        if failing == "hold":
            funnel.misses("hold", -over, grasp=grasp)
            return
        funnel.passes("hold")
        if not self.sparing:
            funnel.misses("spare", 0.0, "two point contacts cannot resist a torque about the line through them")
            return
        if failing == "spare":
            funnel.misses("spare", -over, grasp=grasp)
            return
        funnel.passes("spare")
        if failing == "stroke hold":
            words = "where the object has turned by the reserve, no finger can be spared at the full torque limits"
            funnel.misses("stroke hold", -over, words)
            return
        funnel.passes("stroke hold")


def reserve_words(finger: str, reach: float, asked: float, why: str) -> str:
    """That a finger follows the object not far enough, and why."""
    found, wanted = np.rad2deg([reach, asked])
    return f"finger {finger} follows the object for {found:.0f} degrees only, {wanted:.0f} asked: {why}"
