"""How far each finger follows the object's turn before a joint or a link ends it: the reserve of a contact.

The finger is marched along the twist about the task axis: the contact sticks to the surface and rolls,
dq = J+ (v dt - J x) + x with x a pull to the posture of the first grasp. A march ends at a joint near its limit, at a
posture from which joints would have to jump, where the contact leaves the object's side, or where the finger's links
come too near the object, the palm or each other.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.clearance import Asked, Clearance
from fingergait.adopt.family import ObjectSpec
from fingergait.adopt.kinematics import Chain, apply, cross, damped_inverse

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

_PULL = 0.1  # share of the way back to the first posture that a step takes, where the contact leaves it free
_JUMP = 125.0  # rad/m: joint motion a step may take for each metre that the surface moves
_SLIP = 0.02  # share of the surface's motion that the damping of a nearly singular posture may leave
_STUCK = 2e-4  # m: a tip that is off the surface by more after its correction has lost it


@dataclass(frozen=True)
class Poses:
    """Poses of the object for N postures: position (N, 3) of O in W, turn (N,) about the axis, and the axis's frame.

    `frame` (3, 3): rotation of O in W at turn zero, its z along the task axis.
    """

    position: Array
    turn: Array
    frame: Array

    def rotation(self, more: Array | float = 0.0) -> Array:
        """Rotations (N, 3, 3) of O in W, turned on by `more` (N,) or one angle, rad."""
        return self.frame @ _about_z(self.turn + more)

    def turned(self, row: int, more: Array) -> Array:
        """Rotations (len(more), 3, 3) of O in W of one row, turned on by `more`."""
        return self.frame @ _about_z(self.turn[row] + more)

    def take(self, rows: Rows) -> "Poses":
        """These rows only."""
        return Poses(self.position[rows], self.turn[rows], self.frame)


def _about_z(angle: Array) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    Rz = np.zeros((len(c), 3, 3))
    Rz[:, 0, 0], Rz[:, 0, 1], Rz[:, 1, 0], Rz[:, 1, 1], Rz[:, 2, 2] = c, -s, s, c, 1.0
    return Rz


@dataclass(frozen=True)
class Surface:
    """Tips against the object: distance (N,) of their surface from it, outward normals and places (N, 3) in W."""

    distance: Array
    normal: Array
    place: Array
    touchable: NDArray[np.bool_]


def surface(
    spec: ObjectSpec, chain: Chain, centre: Array, poses: Poses, rim: float, more: Array | float = 0.0
) -> Surface:
    """Where tips with these centres (N, 3) touch or would touch the object, turned on by `more`."""
    R = poses.rotation(more)
    x = apply(R.transpose(0, 2, 1), centre - poses.position)
    distance, normal = spec.distance(x)
    touchable = spec.touchable(x - distance[:, None] * normal, normal, rim)
    normal_W = apply(R, normal)
    return Surface(distance - chain.finger.tip_radius, normal_W, centre - distance[:, None] * normal_W, touchable)


def onto_surface(
    spec: ObjectSpec, chain: Chain, q: Array, poses: Poses, rim: float, margin: float, steps: int = 4
) -> tuple[Array, NDArray[np.bool_]]:
    """Postures (N, n) moved by Newton's steps so that the tip touches the object at rest, and which then do.

    `margin`: share of each joint's range that stays free at either end.
    """
    lower, upper = _limits(chain, margin)
    for step in range(steps + 1):
        postures = chain.at(q)
        contact = surface(spec, chain, postures.centre, poses, rim)
        if step == steps:
            break
        inverse = damped_inverse(chain.jacobian(postures, postures.centre))
        move = apply(inverse, -contact.distance[:, None] * contact.normal)
        q = np.clip(q + np.clip(move, -0.2, 0.2), lower, upper)
    return q, (np.abs(contact.distance) < 1e-5) & contact.touchable


@dataclass(frozen=True)
class March:
    """N marches one way: `reach` (N,) rad each got, by what each `ended`, and the path (N, steps + 1, n) to there."""

    reach: Array
    ended: list[str]
    path: Array


def march(
    spec: ObjectSpec, chain: Chain, q: Array, poses: Poses, rim: float, margin: float, angles: Array
) -> tuple[March, March]:
    """Follows the object's turn from postures `q` (N, n) through `angles` (from 0, rad), backwards and forwards.

    Each step also takes back what the tip is off the surface.
    """
    count = len(q)
    signs = np.repeat([-1.0, 1.0], count)
    poses = Poses(np.concatenate([poses.position] * 2), np.concatenate([poses.turn] * 2), poses.frame)
    lower, upper = _limits(chain, margin)
    q = home = np.concatenate([q, q])
    axis = np.broadcast_to(poses.frame[:, 2], (2 * count, 3))
    path = np.empty((2 * count, len(angles), q.shape[1]))
    path[:, 0] = q
    alive, reach = np.ones(2 * count, dtype=bool), np.zeros(2 * count)
    ended = np.full(2 * count, "", dtype=object)
    postures = chain.at(q)
    contact = surface(spec, chain, postures.centre, poses, rim)
    for step in range(1, len(angles)):
        dt = signs * (angles[step] - angles[step - 1])
        lever = contact.place - poses.position
        J = chain.jacobian(postures, contact.place)
        v = dt[:, None] * cross(axis, lever) - contact.distance[:, None] * contact.normal
        pull = _PULL * (home - q)
        move = apply(damped_inverse(J), v - apply(J, pull)) + pull
        slip = np.linalg.norm(apply(J, move) - v, axis=1) > _SLIP * np.linalg.norm(v, axis=1)
        jump = slip | (np.abs(move).max(axis=1) > _JUMP * np.abs(dt) * np.linalg.norm(lever, axis=1))
        q_new = q + np.clip(move, -0.3, 0.3)
        postures = chain.at(q_new)
        contact = surface(spec, chain, postures.centre, poses, rim, signs * angles[step])
        over = np.maximum(lower - q_new, q_new - upper)
        at_limit = over.max(axis=1) > 0.0
        lost = np.abs(contact.distance) > _STUCK
        stop = alive & (at_limit | jump | ~contact.touchable | lost)
        for row in np.flatnonzero(stop):
            if at_limit[row]:
                ended[row] = f"{chain.joint_name(int(over[row].argmax()))} at its limit"
            elif jump[row] or lost[row]:
                ended[row] = "its joints would have to jump"
            else:
                ended[row] = "the contact leaves the object's side"
        alive &= ~stop
        q = np.where(alive[:, None], q_new, q)
        reach[alive] = angles[step]
        path[:, step] = q
        if not alive.any():
            path[:, step + 1 :] = q[:, None]
            break
    halves = (slice(0, count), slice(count, None))
    back, forth = (March(reach[half], list(ended[half]), path[half]) for half in halves)
    return back, forth


def limit_by_links(
    clearance: Clearance, j: int, way: March, poses: Poses, angles: Array, asked: Asked, every: int
) -> tuple[Array, list[str]]:
    """Reaches (N,) of the marches after the links have been kept from object, palm and each other, and what ended them.

    `angles`: with the sign of the march. Links are looked at in every `every`-th step and at the end.
    """
    reach, ended = np.zeros(len(way.reach)), list(way.ended)
    steps = [_looked_at(angles, turn, every) for turn in way.reach]
    rows = np.repeat(np.arange(len(steps)), [len(own) for own in steps])
    at = np.concatenate(steps)
    frames = clearance.chains[j].frames(way.path[rows, at])
    turned = Poses(poses.position[rows], poses.turn[rows], poses.frame)
    found = clearance.first_blocked(
        j, frames, turned.position, turned.rotation(angles[at]), [len(own) for own in steps], asked
    )
    for row, (first, why) in enumerate(found):
        ended[row] = why or ended[row]
        reach[row] = abs(angles[steps[row][first - 1]]) if first > 0 else 0.0
    return reach, ended


def _looked_at(angles: Array, reach: float, every: int) -> list[int]:
    last = int(np.searchsorted(np.abs(angles), reach + 1e-9)) - 1
    return [*range(0, last, every), last]


def _limits(chain: Chain, margin: float) -> tuple[Array, Array]:
    lower, upper = chain.finger.lower, chain.finger.upper
    return lower + margin * (upper - lower), upper - margin * (upper - lower)
