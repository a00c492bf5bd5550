"""Kinematics of one finger at many postures at once: tip centre, Jacobian and the frames of its collision shapes."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.view import FingerView

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Postures:
    """A finger at N postures: q (N, n), the tip's centre (N, 3) in W, axes and anchors (N, m, 3) of the joints."""

    q: Array
    centre: Array
    axes: Array
    anchors: Array


@dataclass(frozen=True)
class Frames:
    """Collision shapes of one finger at N postures: centres (N, L, 3) and rotations (N, L, 3, 3) in W."""

    centre: Array
    rotation: Array


class Chain:
    """A finger's joints from the world to the tip, and the shapes that they move.

    Joints of the chain that belong to no finger stand where the model has them. `ratio` (m, n) and `offset` (m,) give
    the turns of the m joints on the tip's path from the n driven ones: ratio q + offset.
    """

    def __init__(self, model: mujoco.MjModel, finger: FingerView, geoms: tuple[int, ...] = ()) -> None:
        self.finger, self._model, self.geoms = finger, model, geoms
        self._path = _Tree(model, finger, path(model, finger.tip_body))
        self._tip = self._path.bodies.index(finger.tip_body)
        bodies = sorted({link for geom in geoms for link in path(model, int(model.geom_bodyid[geom]))})
        self._tree = _Tree(model, finger, bodies)
        self._carriers = [self._tree.bodies.index(int(model.geom_bodyid[geom])) for geom in geoms]
        self._geom_pos = model.geom_pos[list(geoms)]
        self._geom_rot = np.array([matrix(model.geom_quat[geom]) for geom in geoms]).reshape(-1, 3, 3)
        self.ratio = self._path.ratio

    def joint_name(self, i: int) -> str:
        """Name of the finger's i-th driven joint."""
        return str(self._model.joint(self.finger.joints[i]).name) or f"joint {i + 1}"

    def at(self, q: Array) -> Postures:
        """The finger at postures q (N, n)."""
        R, p, axes, anchors = self._path.at(q)
        return Postures(q, p[self._tip] + R[self._tip] @ self.finger.tip_centre, axes, anchors)

    def frames(self, q: Array) -> Frames:
        """The collision shapes at postures q (N, n)."""
        R, p, _, _ = self._tree.at(q)
        centre = np.empty((len(q), len(self.geoms), 3))
        rotation = np.empty((len(q), len(self.geoms), 3, 3))
        for i, body in enumerate(self._carriers):
            centre[:, i] = p[body] + R[body] @ self._geom_pos[i]
            rotation[:, i] = R[body] @ self._geom_rot[i]
        return Frames(centre, rotation)

    def jacobian(self, postures: Postures, point: Array) -> Array:
        """Velocity Jacobians (N, 3, n) in W of the points (N, 3) of the last link."""
        arm = point[:, None, :] - postures.anchors
        columns = cross(postures.axes, arm)  # (N, m, 3)
        if self._path.slides.any():
            columns = np.where(self._path.slides[:, None], postures.axes, columns)
        J: Array = columns.transpose(0, 2, 1) @ self.ratio
        return J


class _Tree:
    """Bodies, parents before children, and the joints that move them."""

    def __init__(self, model: mujoco.MjModel, finger: FingerView, bodies: list[int]) -> None:
        self.bodies = bodies
        joints: list[int] = []
        self._nodes: list[tuple[int, Array, Array, list[int]]] = []  # parent, place and rotation in it, joints
        for body in bodies:
            first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
            own = list(range(first, first + count)) if count else []
            parent = int(model.body_parentid[body])
            index = bodies.index(parent) if parent in bodies else -1
            rows = list(range(len(joints), len(joints) + len(own)))
            self._nodes.append((index, model.body_pos[body].copy(), matrix(model.body_quat[body]), rows))
            joints += own
        self._axis, self._anchor = model.jnt_axis[joints], model.jnt_pos[joints]
        self.slides = np.asarray(model.jnt_type[joints] == mujoco.mjtJoint.mjJNT_SLIDE)
        zero = model.qpos0[model.jnt_qposadr[joints]] if joints else np.zeros(0)
        self.ratio, self._offset = np.zeros((len(joints), finger.n)), np.zeros(len(joints))
        for row, joint in enumerate(joints):
            if joint in finger.joints:
                self.ratio[row, finger.joints.index(joint)] = 1.0
                self._offset[row] = -zero[row]
        for follower in finger.couplings:
            if follower.joint in joints:
                row = joints.index(follower.joint)
                self.ratio[row, follower.driver] = follower.ratio
                self._offset[row] = follower.offset - zero[row]
        self._cross = np.array([_cross_matrix(axis) for axis in self._axis]).reshape(-1, 3, 3)
        self._cross2 = self._cross @ self._cross

    def at(self, q: Array) -> tuple[list[Array], list[Array], Array, Array]:
        """Rotations (N, 3, 3) and places (N, 3) of the bodies, axes and anchors (N, m, 3) of the joints, in W."""
        count, m = len(q), len(self._axis)
        turn = q @ self.ratio.T + self._offset  # (N, m)
        sine, versine = np.sin(turn)[..., None, None], (1.0 - np.cos(turn))[..., None, None]
        rolled = np.eye(3) + sine * self._cross + versine * self._cross2  # (N, m, 3, 3)
        axes, anchors = np.empty((count, m, 3)), np.empty((count, m, 3))
        R: list[Array] = []
        p: list[Array] = []
        still, origin = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))
        for parent, place, rotation, joints in self._nodes:
            over, at = (R[parent], p[parent]) if parent >= 0 else (still, origin)
            here = at + over @ place if place.any() else at
            own = over @ rotation if not np.array_equal(rotation, _EYE) else over
            for i in joints:
                axes[:, i] = own @ self._axis[i]
                anchors[:, i] = here + own @ self._anchor[i]
                if self.slides[i]:
                    here = here + turn[:, i, None] * axes[:, i]
                    continue
                own = own @ rolled[:, i]
                here = anchors[:, i] - own @ self._anchor[i] if self._anchor[i].any() else here
            R.append(own)
            p.append(here)
        return R, p, axes, anchors


def damped_inverse(J: Array, damping: float = 1e-6) -> Array:
    """J' (J J' + damping)^-1, (N, n, 3) of (N, 3, n); damping in m^2."""
    transposed = J.transpose(0, 2, 1)
    inverse: Array = transposed @ np.linalg.inv(J @ transposed + damping * _EYE)
    return inverse


def cross(a: Array, b: Array) -> Array:
    """a x b along the last axis; numpy's own is several times slower."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def apply(matrices: Array, vectors: Array) -> Array:
    """Matrices (N, a, b) times vectors (N, b)."""
    product: Array = (matrices @ vectors[..., None])[..., 0]
    return product


def apply_all(rotations: Array, points: Array) -> Array:
    """Points (N, L, 3) in the frames whose rotations (N, 3, 3) are given: R' x."""
    turned: Array = points @ rotations
    return turned


def matrix(quaternion: Array) -> Array:
    """Rotation (3, 3) of a wxyz quaternion."""
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, quaternion)
    return out.reshape(3, 3)


def path(model: mujoco.MjModel, body: int) -> list[int]:
    """Bodies from the world's child to `body`."""
    bodies: list[int] = []
    while body != 0:
        bodies.insert(0, body)
        body = int(model.body_parentid[body])
    return bodies


def _cross_matrix(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


_EYE = np.eye(3)
