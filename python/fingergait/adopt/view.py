"""What the grasp search needs to know of a hand: fingers as joints, tips and motors in a compiled model.

Joint limits, torque limits and couplings are data of each joint; the collision shapes are the hand's own.
"""

from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait._core import ConfigError
from fingergait.hand import Finger, Hand, geom_name

Array = NDArray[np.float64]

_PROBES = {
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "ball": mujoco.mjtGeom.mjGEOM_SPHERE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
}


@dataclass(frozen=True)
class Coupling:
    """A joint that follows: q[joint] = offset + ratio * q[driver], `driver` counting the finger's own joints."""

    joint: int
    driver: int
    ratio: float
    offset: float = 0.0


@dataclass(frozen=True)
class FingerView:
    """One finger of a compiled model.

    name
        For people.
    joints
        Ids of its driven joints from the base on, n of them.
    lower, upper, reference
        Limits and reference posture of the driven joints, (n,), rad (m where a joint slides).
    torque_lower, torque_upper
        Motor torque limits, (n,), N m.
    tip_body, tip_centre, tip_radius
        The sphere that touches: its body, its centre in the body's frame (3,), m, and its radius, m.
    tip_geoms
        Collision geoms that may touch the object, because the sphere was fitted to them.
    tip_error
        Largest distance between the sphere and the part of those geoms that can touch, m.
    couplings
        Joints of the chain that follow driven ones.
    """

    name: str
    joints: tuple[int, ...]
    lower: Array
    upper: Array
    reference: Array
    torque_lower: Array
    torque_upper: Array
    tip_body: int
    tip_centre: Array
    tip_radius: float
    tip_geoms: tuple[int, ...]
    tip_error: float = 0.0
    couplings: tuple[Coupling, ...] = ()

    @property
    def n(self) -> int:
        """Number of driven joints."""
        return len(self.joints)


@dataclass(frozen=True)
class HandView:
    """A hand without an object: compiled model, fingers, and what may not touch what.

    `gravity` (3,), m/s^2, in the model's world. `links[j]`: collision geoms that move with finger j, tip included;
    `palm`: those that no finger moves; `own[j]`: pairs of geoms, finger j with itself or with the palm, that the model
    lets collide; `between[j, k]`, j < k: such pairs of two fingers. `probes`: geoms of `with_probes`.
    """

    name: str
    model: mujoco.MjModel
    fingers: tuple[FingerView, ...]
    gravity: Array
    probes: dict[str, int]
    links: tuple[tuple[int, ...], ...] = field(init=False)
    palm: tuple[int, ...] = field(init=False)
    own: tuple[tuple[tuple[int, int], ...], ...] = field(init=False)
    between: dict[tuple[int, int], tuple[tuple[int, int], ...]] = field(init=False)

    def __post_init__(self) -> None:
        model, n = self.model, len(self.fingers)
        moved = [_moved_bodies(model, finger) for finger in self.fingers]
        solid = [g for g in range(model.ngeom) if model.geom_contype[g] or model.geom_conaffinity[g]]
        links = tuple(tuple(g for g in solid if int(model.geom_bodyid[g]) in moved[j]) for j in range(n))
        palm = tuple(g for g in solid if not any(int(model.geom_bodyid[g]) in bodies for bodies in moved))
        pairs = CollisionRule(model)
        own = tuple(
            tuple((a, b) for i, a in enumerate(links[j]) for b in (*links[j][i + 1 :], *palm) if pairs.collide(a, b))
            for j in range(n)
        )
        between = {
            (j, k): tuple((a, b) for a in links[j] for b in links[k] if pairs.collide(a, b))
            for j in range(n)
            for k in range(j + 1, n)
        }
        for name, value in (("links", links), ("palm", palm), ("own", own), ("between", between)):
            object.__setattr__(self, name, value)

    @property
    def up(self) -> Array:
        """Unit vector (3,) against gravity."""
        up: Array = -self.gravity / np.linalg.norm(self.gravity)
        return up

    def qpos(self, q: list[Array] | tuple[Array, ...]) -> Array:
        """Positions (nq,) of the hand with finger j at q[j] (n_j,); other joints stay where the model has them."""
        qpos: Array = self.model.qpos0.copy()
        for finger, angles in zip(self.fingers, q, strict=True):
            write_finger(self.model, finger, angles, qpos)
        return qpos

    def geom_name(self, geom: int) -> str:
        """The geom's name, or what it is and of which body, for people."""
        return geom_name(self.model, geom)


def with_probes(spec: mujoco.MjSpec) -> tuple[mujoco.MjModel, dict[str, int]]:
    """The compiled hand with one geom more for each family of objects, and these geoms.

    Distances are measured between geoms of one model, so each family has a geom that nothing collides with; whoever
    measures gives it the object's size and place. They are in a body behind all others, so that ids stay what they are.
    """
    own = spec.copy()
    body = own.worldbody.add_body()
    probes = [
        body.add_geom(
            type=kind, size=[1e-3, 1e-3, 1e-3], contype=0, conaffinity=0, group=5, rgba=[0.0, 0.0, 0.0, 0.0], mass=0.0
        )
        for kind in _PROBES.values()
    ]
    model = own.compile()
    return model, {family: int(probe.id) for family, probe in zip(_PROBES, probes, strict=True)}


def write_finger(model: mujoco.MjModel, finger: FingerView, q: Array, qpos: Array) -> None:
    """Writes the finger's driven joints and those that follow them into `qpos`."""
    qpos[model.jnt_qposadr[list(finger.joints)]] = q
    for follower in finger.couplings:
        qpos[model.jnt_qposadr[follower.joint]] = follower.offset + follower.ratio * q[follower.driver]


class CollisionRule:
    """Which pairs of geoms MuJoCo would let collide: masks, excluded pairs, and bodies that are parent and child."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        signatures = model.exclude_signature if model.nexclude else ()
        self._excluded = {(int(s) >> 16, int(s) & 0xFFFF) for s in signatures}
        self._explicit = {frozenset((int(a), int(b))) for a, b in zip(model.pair_geom1, model.pair_geom2, strict=True)}

    def collide(self, a: int, b: int) -> bool:
        """Whether geoms a and b may collide."""
        model = self._model
        if frozenset((a, b)) in self._explicit:
            return True
        types, affinities = model.geom_contype, model.geom_conaffinity
        if not (types[a] & affinities[b] or types[b] & affinities[a]):
            return False
        first, second = int(model.geom_bodyid[a]), int(model.geom_bodyid[b])
        if (first, second) in self._excluded or (second, first) in self._excluded:
            return False
        weld_a, weld_b = int(model.body_weldid[first]), int(model.body_weldid[second])
        if weld_a == weld_b:
            return False
        if weld_a == 0 or weld_b == 0:  # MuJoCo exempts the world's own geoms from its rule of parent and child
            return True
        parent_a = int(model.body_weldid[model.body_parentid[weld_a]])
        parent_b = int(model.body_weldid[model.body_parentid[weld_b]])
        return parent_a != weld_b and parent_b != weld_a


def _moved_bodies(model: mujoco.MjModel, finger: FingerView) -> set[int]:
    """Bodies that the finger's first joint moves."""
    base = min(int(model.jnt_bodyid[j]) for j in (*finger.joints, *(c.joint for c in finger.couplings)))
    moved = {base}
    for body in range(base + 1, model.nbody):  # parents come first
        if int(model.body_parentid[body]) in moved:
            moved.add(body)
    return moved


def view_of(hand: Hand, gravity: Array | None = None) -> HandView:
    """The view of an imported hand.

    Parameters
    ----------
    hand
        What `import_hand` gives.
    gravity
        In the model's world, (3,), m/s^2; absent: the model's own.
    """
    model, probes = with_probes(hand.spec)
    down = np.asarray(model.opt.gravity if gravity is None else gravity, dtype=np.float64)
    if not np.any(down):
        raise ConfigError(f"{hand.source}: expected gravity, found none; the search needs a weight to carry")
    return HandView(hand.source, model, tuple(_finger(hand, model, finger) for finger in hand.fingers), down, probes)


def _finger(hand: Hand, model: mujoco.MjModel, finger: Finger) -> FingerView:
    joints = list(finger.joints)
    lower, upper = model.jnt_range[joints].T
    middle = 0.5 * (lower + upper)
    couplings = []
    for joint in finger.links:
        leader, ratio, offset = joint, 1.0, 0.0
        while leader in hand.couplings:  # a follower may lead another
            link = hand.couplings[leader]
            leader, ratio, offset = link.leader, ratio * link.ratio, offset + ratio * link.offset
        if leader != joint:
            couplings.append(Coupling(joint, joints.index(leader), ratio, offset))
    return FingerView(
        name=finger.name,
        joints=finger.joints,
        lower=lower.copy(),
        upper=upper.copy(),
        reference=np.array([hand.references.get(j, m) for j, m in zip(joints, middle, strict=True)]),
        torque_lower=np.array([motor.low for motor in finger.motors]),
        torque_upper=np.array([motor.high for motor in finger.motors]),
        tip_body=int(model.geom_bodyid[finger.probe]),
        tip_centre=finger.sphere.centre.copy(),
        tip_radius=finger.sphere.radius,
        tip_geoms=(finger.tip,),
        tip_error=finger.sphere.error,
        couplings=tuple(couplings),
    )
