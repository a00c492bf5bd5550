"""What a grasp can carry: the force QP within the motors' limits, and by how much, as the load factor of an LP.

The load is the object's weight, alone and with a disturbance along each axis: d m g of force or d m g R of torque about
the object's centre. The load factor of a wrench is the least factor on all torque limits with which some contact
forces inside the friction pyramids deliver it while the motors carry the fingers' own weight; it is a convex function
of the wrench, so that its largest value over these corners bounds it over all disturbances between them.
"""

import copy
from dataclasses import dataclass
from math import sqrt

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from fingergait._core import ForceOptimizer
from fingergait.adopt.kinematics import cross
from fingergait.adopt.view import HandView, write_finger

Array = NDArray[np.float64]

_ALPHA = (1e-4, 0.0, 1e3)  # small forces, no memory, the wrench: what is not delivered is what cannot be
SLACK_SHARE = 0.2  # of the weight: the unit of slack


@dataclass(frozen=True)
class Load:
    """What is asked of a grasp.

    mass (kg), radius (m) of the contacts, friction assumed at the contacts, disturbance d, edges of the pyramids.
    """

    mass: float
    radius: float
    friction: float = 0.65
    disturbance: float = 1.0
    edges: int = 8


@dataclass(frozen=True)
class Pressing:
    """One contact: columns G (6, 3) of the grasp map, J (3, n_j) with tau_j = J' f, the finger's own weight (n_j,)."""

    G: Array
    J: Array
    own: Array


def pressing(places: Array, normals: Array, jacobians: Array, own: Array, origins: Array) -> list[Pressing]:
    """Contacts at `places` (N, 3) with outward `normals` (N, 3) in W, Jacobians (N, 3, n_j) there, O at `origins`."""
    R = contact_frames(-normals)
    arm = places - origins
    moments = cross(arm[:, None, :], R.transpose(0, 2, 1)).transpose(0, 2, 1)  # of each of the frame's axes
    G, J = np.concatenate([R, moments], axis=1), R.transpose(0, 2, 1) @ jacobians
    return [Pressing(G[i], J[i], own[i]) for i in range(len(places))]


@dataclass(frozen=True)
class Contacts:
    """Contacts of a grasp in W.

    G (6, 3n): contact forces, z along the inward normal, to the wrench at O. J (3n, total joints): tau = J' f. own
    (total joints,): torques that hold the fingers' own weight.
    """

    G: Array
    J: Array
    own: Array


@dataclass(frozen=True)
class Holding:
    """The largest load factor over all corners, and where: the joint that needs it (finger, its joint) or (-1, -1)."""

    factor: float
    joint: tuple[int, int]


class Statics:
    """Loads of grasps of one hand and one object."""

    def __init__(self, hand: HandView, load: Load) -> None:
        self.hand, self.load = hand, load
        n = len(hand.fingers)
        self.n = n
        self.weight = load.mass * float(np.linalg.norm(hand.gravity))  # N
        angles = 2.0 * np.pi * np.arange(load.edges) / load.edges
        edges = np.vstack([load.friction * np.cos(angles), load.friction * np.sin(angles), np.ones(load.edges)])
        self._edges = edges
        self._qp = ForceOptimizer(np.broadcast_to(edges, (n, 3, load.edges)).copy(), np.array(_ALPHA))
        self._lower = np.concatenate([finger.torque_lower for finger in hand.fingers])
        self._upper = np.concatenate([finger.torque_upper for finger in hand.fingers])
        self._size = np.maximum(np.maximum(self._upper, -self._lower), 1e-9)
        starts = np.cumsum([0, *(finger.n for finger in hand.fingers)])
        self.slices = [slice(int(a), int(b)) for a, b in zip(starts[:-1], starts[1:], strict=True)]
        self.wrenches = _corners(hand.up, float(np.linalg.norm(hand.gravity)), load)
        self._scale = np.array([1.0, 1.0, 1.0, *[1.0 / load.radius] * 3])  # torques as forces at the contacts
        self._scaled = [wrench * self._scale for wrench in self.wrenches]
        self._hardest = [list(range(len(self.wrenches))) for _ in range(n + 1)]  # with each finger away, and all
        self._caps = np.where(np.eye(n + 1, n, dtype=bool), 0.0, np.inf)
        self._zero = np.zeros(3 * n)
        self._model = copy.copy(hand.model)
        self._model.opt.gravity = hand.gravity
        self._data = mujoco.MjData(self._model)

    def own_torque(self, j: int, q: Array) -> Array:
        """Torques (n_j,) of finger j's driven joints that hold its own weight at q, springs and gravcomp counted."""
        data, model, finger = self._data, self._model, self.hand.fingers[j]
        write_finger(model, finger, q, data.qpos)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_passive(model, data)
        mujoco.mj_rne(model, data, 0, data.qfrc_bias)
        needed = data.qfrc_bias - data.qfrc_passive
        tau: Array = needed[model.jnt_dofadr[list(finger.joints)]]
        for follower in finger.couplings:
            tau[follower.driver] += follower.ratio * needed[model.jnt_dofadr[follower.joint]]
        return tau

    def contacts(self, fingers: list["Pressing"]) -> Contacts:
        """The grasp whose finger j presses as fingers[j] says."""
        J = np.zeros((3 * self.n, len(self._lower)))
        for j, finger in enumerate(fingers):
            J[3 * j : 3 * j + 3, self.slices[j]] = finger.J
        return Contacts(np.hstack([f.G for f in fingers]), J, np.concatenate([f.own for f in fingers]))

    def excess(self, contacts: Contacts, share: float, away: int | None, enough: float = np.inf) -> float:
        """The most that stays undelivered with `share` of the torque limits, as a share of the weight (torque by R).

        `away`: a finger that may not press. Stops at the first corner where more than `enough` stays undelivered.
        """
        lower, upper = share * self._lower - contacts.own, share * self._upper - contacts.own
        if lower.max() >= 0.0 or upper.min() <= 0.0:
            over = max(float((lower / self._size).max()), float((-upper / self._size).max()))
            return 1.0 + over  # the fingers can't carry themselves
        G, case = contacts.G * self._scale[:, None], self.n if away is None else away
        order, cap, most = self._hardest[case], self._caps[case], 0.0
        for place, index in enumerate(order):
            psi = self._qp.solve(G, contacts.J, self._scaled[index], self._zero, lower, upper, cap).psi
            most = max(most, sqrt(psi @ psi) / self.weight)
            if most > enough:
                order.insert(0, order.pop(place))  # what failed once fails often
                break
        return most

    def slack(self, contacts: Contacts, away: int | None) -> float:
        """The most that stays undelivered at the full torque limits, in fifths of the weight (torque by R)."""
        return self.excess(contacts, 1.0, away) / SLACK_SHARE

    def holding(self, contacts: Contacts, away: int | None) -> Holding:
        """The largest load factor over all corners; infinite where friction alone forbids."""
        found = [self._factor(contacts, wrench, away) for wrench in self.wrenches]
        return max(found, key=lambda holding: holding.factor)

    def _factor(self, contacts: Contacts, wrench: Array, away: int | None) -> Holding:
        pressing = [j for j in range(self.n) if j != away]
        m = self.load.edges
        B = np.zeros((3 * self.n, m * len(pressing)))
        for k, j in enumerate(pressing):
            B[3 * j : 3 * j + 3, m * k : m * k + m] = self._edges
        torque = contacts.J.T @ B  # (joints, edges)
        upper = np.hstack([torque, -self._upper[:, None]])
        lower = np.hstack([-torque, self._lower[:, None]])
        cost = np.zeros(B.shape[1] + 1)
        cost[-1] = 1.0
        result = linprog(
            cost,
            A_ub=np.vstack([upper, lower]),
            b_ub=np.concatenate([-contacts.own, contacts.own]),
            A_eq=np.hstack([contacts.G @ B * self._scale[:, None], np.zeros((6, 1))]),
            b_eq=wrench * self._scale,
            method="highs",
        )
        if result.status != 0:
            return Holding(np.inf, (-1, -1))
        prices = -result.ineqlin.marginals
        joint = int(np.argmax(prices[: len(self._upper)] * self._upper - prices[len(self._upper) :] * self._lower))
        finger = next(j for j, part in enumerate(self.slices) if part.start <= joint < part.stop)
        return Holding(float(result.x[-1]), (finger, joint - self.slices[finger].start))


def contact_frames(inward: Array) -> Array:
    """Rotations (N, 3, 3) of contact frames in W, z along `inward` (N, 3)."""
    other = np.eye(3)[np.abs(inward).argmin(axis=1)]
    x = cross(other, inward)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, cross(inward, x), inward], axis=2)


def _corners(up: Array, g: float, load: Load) -> list[Array]:
    """The wrench at O that carries the weight, alone and against a disturbance along each axis and sense."""
    weight = load.mass * g
    carried = np.concatenate([weight * up, np.zeros(3)])
    reach = load.disturbance * weight * np.array([1.0, 1.0, 1.0, load.radius, load.radius, load.radius])
    corners = [carried + sign * reach[i] * np.eye(6)[i] for i in range(6) for sign in (1.0, -1.0)]
    return [*corners, carried] if load.disturbance > 0.0 else [carried]
