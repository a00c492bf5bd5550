"""Contacts of all fingers with the object at one place, and the combinations of them that carry its weight best."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.evaluate import DELIVERED, Judge, Judged, reserve_words
from fingergait.adopt.family import ObjectSpec
from fingergait.adopt.funnel import Funnel
from fingergait.adopt.positions import NEAR, widest_gap
from fingergait.adopt.statics import Pressing
from fingergait.adopt.stroke import Poses, Rows, onto_surface, surface

Array = NDArray[np.float64]

HOME_MARGIN = 0.05  # of a joint's range at the grasp
_KEPT = 8  # combinations of a place whose strokes are looked at
_SWEEPS, _TRIED = 2, 6  # exchanges of one finger's contact in the best combinations
_NEARBY = 0.2
_NEARLY = 4  # contacts of a finger that are kept though none has the reserve
_WIDE = 0.75  # of the widest gap that friction allows: gaps up to this are equally good


@dataclass(frozen=True)
class Place:
    """The object at one pose: contacts q[j] (k_j, n_j) of each finger, combinations rows (c, n) of them, best first,
    and what the best leaves undelivered (see `Judge.overload`)."""

    pose: Poses
    q: list[Array]
    rows: Rows
    over: float


def at_place(judge: Judge, pose: Poses, funnel: Funnel, rng: np.random.Generator) -> Place | None:
    """The place with its best combinations of contacts; nothing where a finger can't touch with its links clear."""
    options = judge.options
    q: list[Array] = []
    pressing: list[list[Pressing]] = []
    azimuth = []
    for j, chain in enumerate(judge.library.chains):
        own = _contacts_of(judge, j, pose, funnel)
        if not len(own):
            return None
        poses = repeat(pose, len(own))
        q.append(own)
        pressing.append(judge.pressing(j, own, poses))
        plane = surface(judge.spec, chain, chain.at(own).centre, poses, judge.rims[j]).normal @ judge.frame[:, :2]
        azimuth.append(np.arctan2(plane[:, 1], plane[:, 0]))
    funnel.passes("clear")
    drawn = np.column_stack([rng.integers(0, len(own), options.combinations) for own in q])
    gaps = widest_gap(np.column_stack([azimuth[j][drawn[:, j]] for j in range(judge.n)]))
    wide = np.maximum(gaps / (np.pi + 2.0 * np.arctan(options.friction)), _WIDE)
    scored: dict[tuple[int, ...], float] = {}

    def score(row: Rows) -> float:
        key = tuple(int(r) for r in row)
        if key not in scored:
            bound = sorted(scored.values())[_KEPT - 1] if len(scored) >= _KEPT else np.inf
            scored[key] = judge.overload([pressing[j][key[j]] for j in range(judge.n)], bound)[0]
        return scored[key]

    for row in drawn[np.argsort(wide, kind="stable")[: options.judged]]:
        score(row)
    for _ in range(_SWEEPS):
        for row in sorted(scored, key=scored.__getitem__)[: _KEPT // 2]:
            if scored[row] <= DELIVERED:
                continue
            for j in range(judge.n):
                for other in rng.integers(0, len(q[j]), _TRIED):
                    changed = np.array(row)
                    changed[j] = other
                    score(changed)
    rows = sorted(scored, key=scored.__getitem__)[:_KEPT]
    return Place(pose, q, np.array(rows), scored[rows[0]])


def marched(judge: Judge, place: Place, funnel: Funnel) -> list[Judged]:
    """The place's combinations with their strokes, judged."""
    touches, rows = [], np.empty_like(place.rows)
    for j in range(judge.n):
        used, rows[:, j] = np.unique(place.rows[:, j], return_inverse=True)
        touches.append(judge.touches(j, place.q[j][used], repeat(place.pose, len(used)), 3))
    judged = judge.judge(touches, rows, repeat(place.pose, len(rows)), funnel, keep=3)
    return sorted(judged, key=lambda one: -one.merit)[:3]


def _contacts_of(judge: Judge, j: int, pose: Poses, funnel: Funnel) -> Array:
    """Postures (k, n_j) of finger j that touch the object at one pose with their links clear."""
    options, chain = judge.options, judge.library.chains[j]
    near = surface(judge.spec, chain, judge.library.centre[j], repeat(pose, len(judge.library.q[j])), judge.rims[j])
    rows = np.flatnonzero((np.abs(near.distance) < NEAR) & near.touchable)[: 5 * options.candidates]
    if not len(rows):
        return np.empty((0, chain.finger.n))
    q, touches = onto_surface(
        judge.spec, chain, judge.library.q[j][rows], repeat(pose, len(rows)), judge.rims[j], HOME_MARGIN
    )
    q = q[touches]
    count = len(q)
    poses = repeat(pose, count)
    found = judge.clearance.first_blocked(
        j, chain.frames(q), poses.position, poses.rotation(), [1] * count, judge.asked[j]
    )
    kept = [row for row, (_, problem) in enumerate(found) if not problem][: options.candidates]
    example = next((problem for _, problem in found if problem), "")
    if example:
        funnel.example.setdefault(j, f"finger {chain.finger.name} touches the object only with {example}")
    if not kept:
        return np.empty((0, chain.finger.n))
    funnel.clear.add(j)
    return _lasting(judge, j, q[kept], pose, funnel)


def _lasting(judge: Judge, j: int, q: Array, pose: Poses, funnel: Funnel) -> Array:
    """Those of finger j's touching postures from which it follows the object through the reserve, or nearly."""
    touch = judge.touches(j, q, repeat(pose, len(q)), 3, judge.options.reserve)
    reach = touch.reach.min(axis=1)
    far = int(reach.argmax())
    if reach[far] < judge.options.reserve - 1e-9:
        why = touch.ended[far][int(touch.reach[far].argmin())]
        words = reserve_words(judge.hand.fingers[j].name, float(reach[far]), judge.options.reserve, why)
        funnel.misses("reserve", float(reach[far]), words)
        kept = np.argsort(-reach, kind="stable")[:_NEARLY]
    else:
        kept = np.flatnonzero(reach >= judge.options.reserve - 1e-9)
    nearly: Array = q[kept]
    return nearly


def around(pose: Poses, spec: ObjectSpec, count: int, rng: np.random.Generator) -> Poses:
    """`count` poses near one, within a fifth of the object's radius."""
    shift = rng.uniform(-_NEARBY * spec.radius, _NEARBY * spec.radius, (count, 3))
    turn = 0.0 if spec.symmetric else rng.uniform(-_NEARBY, _NEARBY, count)
    return Poses(pose.position + shift, np.repeat(pose.turn, count) + turn, pose.frame)


def repeat(pose: Poses, count: int) -> Poses:
    """The same pose `count` times."""
    return Poses(np.broadcast_to(pose.position[0], (count, 3)), np.broadcast_to(pose.turn[0], count), pose.frame)
