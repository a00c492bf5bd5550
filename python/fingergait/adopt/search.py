"""The grasp search for one object: places, contacts of each finger, combinations, and a local search from the best.

Constraints are checked from cheap to dear; what is nearly good enough is improved by small random changes of the
object's place and of every finger's posture, after which the tips are put back on the surface.
"""

import time

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.clearance import FAR
from fingergait.adopt.evaluate import DELIVERED, Judge, Judged
from fingergait.adopt.family import FAMILIES, ObjectSpec
from fingergait.adopt.funnel import Funnel
from fingergait.adopt.grasp import Found, Grasp
from fingergait.adopt.improve import improved, judged_again, moved_grasp, pose_of
from fingergait.adopt.library import Library, draw_library
from fingergait.adopt.options import SearchOptions
from fingergait.adopt.places import Place, around, at_place, marched
from fingergait.adopt.positions import object_positions
from fingergait.adopt.reasons import reason
from fingergait.adopt.stroke import Poses, surface
from fingergait.adopt.view import HandView

Array = NDArray[np.float64]


def search_object(
    hand: HandView,
    spec: ObjectSpec,
    options: SearchOptions | None = None,
    axis: Array | None = None,
    library: Library | None = None,
    near: Grasp | None = None,
) -> Found:
    """Grasps of one object that can turn it about `axis` (in the hand's world; absent: against gravity).

    `near`: a grasp of a like object, from which the local search begins too; the rest of the search is then shorter.
    """
    begin = time.perf_counter()
    options = options or SearchOptions()
    if near is not None:
        options = options.shorter()
    library = library or draw_library(hand, options.samples, options.seed)
    rng = np.random.default_rng([options.seed, FAMILIES.index(spec.family), *(round(1e6 * x) for x in spec.size)])
    judge = Judge(hand, spec, library, task_frame(hand, axis), options)
    funnel = Funnel()
    poses = object_positions(spec, judge.clearance, library, judge.frame, options, rng, funnel)
    places = _places(judge, poses, funnel, rng)
    closer = [around(place.pose, judge.spec, options.nearby, rng) for place in places[: options.places_refined]]
    places = sorted([*places, *(p for own in closer for p in _places(judge, own, funnel, rng))], key=lambda p: p.over)
    starts = [judged for place in places[: options.marched] for judged in marched(judge, place, funnel)]
    if near is not None:
        starts += moved_grasp(judge, near, funnel)
    starts.sort(key=lambda judged: -judged.merit)
    best = [improved(judge, start, funnel, rng) for start in _apart(starts, options.refined)]
    good = sorted((judged for judged in best if judged.merit > 0.0), key=lambda judged: -judged.merit)
    kind = "gait" if judge.sparing else "regrasp"
    if not good and judge.sparing:
        kind = "regrasp"
        good = _all_fingers_only(judge, best + starts)
    grasps = tuple(as_grasp(judge, judged, kind) for judged in good)
    stage, words = "", ""
    if not grasps or kind != "gait":
        stage = funnel.first or "reserve"  # where only a closer look at every step of the stroke found what forbids
        words = reason(judge, funnel, stage) or "links come too near each other or the object within the reserve"
    return Found(spec, grasps, stage, words, time.perf_counter() - begin)


def task_frame(hand: HandView, axis: Array | None) -> Array:
    """Rotation (3, 3) in W of a frame whose z is the task axis and whose x is as near as can be to the world's x."""
    z = hand.up if axis is None else np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    x = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _all_fingers_only(judge: Judge, candidates: list[Judged]) -> list[Judged]:
    """Those candidates that hold with all fingers and have the reserve, though a finger can't be spared."""
    good: list[Judged] = []
    for candidate in sorted(candidates, key=lambda one: -one.stroke):
        if candidate.stroke < judge.options.reserve or len(good) == judge.options.refined:
            break
        judged = judged_again(judge, candidate)
        contacts = judge.contacts(judged.q, judged.position, judged.turn)
        held = judge.statics.excess(contacts, judge.options.load_limit, None, DELIVERED) <= DELIVERED
        if held and judged.stroke >= judge.options.reserve:
            good.append(judged)
    return sorted(good, key=lambda judged: -judged.stroke)


def _places(judge: Judge, poses: Poses, funnel: Funnel, rng: np.random.Generator) -> list[Place]:
    """Those of the poses at which all fingers touch, the best first."""
    found = [at_place(judge, poses.take(np.array([p])), funnel, rng) for p in range(len(poses.position))]
    return sorted((place for place in found if place is not None), key=lambda place: place.over)


def as_grasp(judge: Judge, judged: Judged, kind: str) -> Grasp:
    """The judged grasp with all its figures, loads by the LP included."""
    hand, clearance = judge.hand, judge.clearance
    pose = pose_of(judge, judged)
    rotation = pose.rotation()[0]
    frames = [chain.frames(q[None]) for chain, q in zip(judge.library.chains, judged.q, strict=True)]
    places, normals = np.empty((judge.n, 3)), np.empty((judge.n, 3))
    for j, chain in enumerate(judge.library.chains):
        contact = surface(judge.spec, chain, chain.at(judged.q[j][None]).centre, pose, judge.rims[j])
        places[j], normals[j] = contact.place[0], contact.normal[0]
    contacts = judge.contacts(judged.q, judged.position, judged.turn)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    margins = [
        np.minimum(q - finger.lower, finger.upper - q) / (finger.upper - finger.lower)
        for finger, q in zip(hand.fingers, judged.q, strict=True)
    ]
    return Grasp(
        object=judge.spec,
        kind=kind,
        joints=tuple(tuple(float(x) for x in q) for q in judged.q),
        pose=tuple(float(x) for x in (*judged.position, *quaternion)),
        places=places,
        normals=normals,
        stroke=judged.stroke,
        reach=judged.reach,
        ended=judged.ended,
        load=judge.statics.holding(contacts, None).factor,
        spared=tuple(judge.statics.holding(contacts, j).factor for j in range(judge.n)),
        slack=tuple(judge.statics.slack(contacts, j) for j in range(judge.n)),
        joint_margin=float(min(margin.min() for margin in margins)),
        link_clearance=min(clearance.link_to_object(j, frames[j], judged.position, rotation) for j in range(judge.n)),
        finger_gap=min(clearance.between(j, k, frames[j], frames[k], FAR).distance for j, k in hand.between),
        palm_clearance=clearance.palm_to_object(judged.position, rotation),
    )


def _apart(starts: list[Judged], most: int) -> list[Judged]:
    """The best starts, of each place the best one first."""
    first: dict[tuple[float, ...], Judged] = {}
    for start in starts:
        first.setdefault(tuple(start.position), start)
    chosen = list(first.values())[:most]
    return chosen + [start for start in starts if not any(start is c for c in chosen)][: most - len(chosen)]
