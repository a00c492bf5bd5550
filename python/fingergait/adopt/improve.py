"""Local search from a grasp that is nearly good enough, or good but could turn further: small random changes, kept where
they make it better. After each change the tips are put back on the surface."""

import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.evaluate import Judge, Judged
from fingergait.adopt.funnel import Funnel
from fingergait.adopt.places import HOME_MARGIN
from fingergait.adopt.stroke import Poses, onto_surface

Array = NDArray[np.float64]

_SHIFT, _ROCK = 0.12, 0.05  # first changes: of the object's place in its radii, of a joint in its range
_PATIENCE = 16  # rounds without help after which no more is expected
_LEAST, _MORE, _LESS = 0.02, 1.6, 0.8  # of the first changes; after a round that helped, and one that did not


def improved(judge: Judge, start: Judged, funnel: Funnel, rng: np.random.Generator) -> Judged:
    """The best grasp that small random changes of `start` lead to."""
    best = _judged(judge, [start.q], pose_of(judge, start), None)[0]
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
    return best


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
    touches = [judge.touches(j, np.stack([q[j] for q in combos]), poses, 2) for j in range(judge.n)]
    rows = np.repeat(np.arange(len(combos))[:, None], judge.n, axis=1)
    return judge.judge(touches, rows, poses, funnel, than=than)
