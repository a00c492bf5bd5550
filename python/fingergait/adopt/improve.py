"""Local search from a grasp that is nearly good enough, or good but could turn further: small random changes, kept
where they make it better. After each change the tips are put back on the surface."""

import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.evaluate import Judge, Judged
from fingergait.adopt.funnel import Funnel
from fingergait.adopt.grasp import Grasp
from fingergait.adopt.kinematics import matrix
from fingergait.adopt.places import HOME_MARGIN
from fingergait.adopt.stroke import Poses, onto_surface

Array = NDArray[np.float64]

_AHEAD = np.deg2rad(10.0)
_SHIFT, _ROCK = 0.12, 0.05  # first changes: of the object's place in its radii, of a joint in its range
_PATIENCE = 16  # rounds without help after which no more is expected
_LEAST, _MORE, _LESS = 0.02, 1.6, 0.8  # of the first changes; after a round that helped, and one that did not


def improved(judge: Judge, start: Judged, funnel: Funnel, rng: np.random.Generator) -> Judged:
    """The best grasp that small random changes of `start` lead to."""
    best = judged_again(judge, start)
    size, idle = 1.0, 0
    for _ in range(judge.options.generations):
        if idle == _PATIENCE:
            break
        idle += 1
        combos, poses = _offspring(judge, best, size, rng)
        if not combos:
            size = max(_LEAST, _LESS * size)
            continue
        found = max(_judged(judge, combos, poses, funnel, best.merit), key=lambda one: one.merit)
        helped = found.merit > best.merit
        if helped:
            best, idle = found, 0
        size = min(1.0, _MORE * size) if helped else max(_LEAST, _LESS * size)
    return judged_again(judge, best)


def judged_again(judge: Judge, judged: Judged) -> Judged:
    """The same grasp with every step of its stroke looked at, to the last turn."""
    q = tuple(angles[None] for angles in judged.q)
    pose = pose_of(judge, judged)
    touches = [judge.touches(j, q[j], pose, 1) for j in range(judge.n)]
    return judge.judge(touches, np.zeros((1, judge.n), dtype=np.intp), pose, None)[0]


def moved_grasp(judge: Judge, near: Grasp, funnel: Funnel) -> list[Judged]:
    """The grasp of a like object with its tips put on this object, judged; empty where they can't be."""
    rotation = judge.frame.T @ matrix(np.array(near.pose[3:]))
    turn = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
    poses = Poses(np.array(near.pose[:3])[None], np.array([turn]), judge.frame)
    q = []
    for j, chain in enumerate(judge.library.chains):
        angles, touches = onto_surface(
            judge.spec, chain, np.array(near.joints[j])[None], poses, judge.rims[j], HOME_MARGIN, 12
        )
        if not touches.all():
            return []
        q.append(angles[0])
    return _judged(judge, [tuple(q)], poses, funnel)


def pose_of(judge: Judge, judged: Judged) -> Poses:
    """The object's pose in a judged grasp."""
    return Poses(judged.position[None], np.array([judged.turn]), judge.frame)


def _offspring(
    judge: Judge, best: Judged, size: float, rng: np.random.Generator
) -> tuple[list[tuple[Array, ...]], Poses]:
    """Changed grasps whose tips touch and that carry their load no worse than `best`.

    A third moves the object, with some fingers; the others move one or two fingers only.
    """
    count, n = judge.options.offspring, judge.n
    shifts = np.arange(count) % 3 == 0
    step = size * _SHIFT * judge.spec.radius
    turn = 0.0 if judge.spec.symmetric else size * _SHIFT
    poses = Poses(
        best.position + shifts[:, None] * rng.normal(0.0, step, (count, 3)),
        best.turn + shifts * rng.normal(0.0, turn, count),
        judge.frame,
    )
    moved = rng.random((count, n)) < np.where(shifts, 0.3, 1.0 / n)[:, None]
    moved[np.arange(count), rng.integers(0, n, count)] |= ~shifts
    q, good = [], np.ones(count, dtype=bool)
    for j, finger in enumerate(judge.hand.fingers):
        span = finger.upper - finger.lower
        drawn = best.q[j] + moved[:, j, None] * rng.normal(0.0, size * _ROCK, (count, finger.n)) * span
        angles, touches = onto_surface(judge.spec, judge.library.chains[j], drawn, poses, judge.rims[j], HOME_MARGIN, 5)
        q.append(angles)
        good &= touches
    rows = good.nonzero()[0]
    kept = []
    if len(rows):
        part = poses.take(rows)
        pressing = [judge.pressing(j, q[j][rows], part) for j in range(n)]
        enough = max(0.0, -best.merit)
        for i, row in enumerate(rows):
            if judge.overload([pressing[j][i] for j in range(n)], enough)[0] <= enough:
                kept.append(int(row))
    return [tuple(angles[i] for angles in q) for i in kept], poses.take(np.array(kept, dtype=np.intp))


def _judged(
    judge: Judge, combos: list[tuple[Array, ...]], poses: Poses, funnel: Funnel | None, than: float = -np.inf
) -> list[Judged]:
    """Grasps of given postures judged, each with the object at a pose of its own; none of merit below `than` fully."""
    # A stroke can't jump: turns far beyond the one to beat are not looked at.
    most = max(judge.options.reserve, than) + _AHEAD
    touches = [judge.touches(j, np.stack([q[j] for q in combos]), poses, 2, most) for j in range(judge.n)]
    rows = np.repeat(np.arange(len(combos))[:, None], judge.n, axis=1)
    return judge.judge(touches, rows, poses, funnel, than=than)
