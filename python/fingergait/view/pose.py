"""The hand and the object of one row, in W: what the page draws and what its words are made of."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait.run.regrasping import PHASES as REGRASP
from fingergait.run.verdict import FAULTS, MODES
from fingergait.sim.press import independent
from fingergait.sim.scene import SceneModel, torque_limits
from fingergait.sim.start import set_joints
from fingergait.view.history import Row

Array = NDArray[np.float64]

PHASES = ("hold", "unload", "slide", "press", "load")
"""Names of the core's phases of a gait, in the order of its numbers."""


class Pose:
    """Kinematics of a row, and the contacts as the controller sees them.

    Attributes
    ----------
    data
        MuJoCo's state, with the bodies where the row says.
    tips, normals, places
        Centres of the fingertips, contact normals into the object, and contact points, (n_fingers, 3), in W; a normal
        is zero where nothing is felt.
    forces
        Contact forces that the controller asks for, (n_fingers, 3), N, in W.
    """

    def __init__(self, scene: SceneModel) -> None:
        self.scene = scene
        self.data = mujoco.MjData(scene.model)
        self.radius: Array = scene.model.geom_size[scene.tips, 0].copy()
        self._low, self._high = torque_limits(scene)
        self._jacobian = np.zeros((3, scene.model.nv))

    def update(self, row: Row) -> None:
        """Takes the pose and the contacts of a row."""
        scene, data = self.scene, self.data
        self.row = row
        set_joints(scene, data, row.group("q"))
        data.qpos[scene.object_q : scene.object_q + 7] = row.group("object")
        mujoco.mj_kinematics(scene.model, data)
        mujoco.mj_comPos(scene.model, data)
        n = len(scene.fingers)
        self.tips = data.geom_xpos[scene.tips].copy()
        place = row.group("measured_place").reshape(n, 3)
        length = np.linalg.norm(place, axis=1, keepdims=True)
        felt = (length > 1e-6) & (row.group("measured_force")[:, None] > 0.0)
        outward = np.where(felt, place / np.maximum(length, 1e-9), 0.0)
        links = data.xmat.reshape(-1, 3, 3)[scene.links]  # R_WF
        self.normals = (links @ outward[:, :, None])[:, :, 0]
        self.places = self.tips + self.radius[:, None] * self.normals
        self.touching: NDArray[np.bool_] = felt[:, 0]
        f_C = row.group("f").reshape(n, 3)
        self.frames = np.stack([contact_frame(normal) for normal in self.normals])  # R_WC
        self.forces = np.where(felt, (self.frames @ f_C[:, :, None])[:, :, 0], 0.0)

    @property
    def free(self) -> int | None:
        """The finger whose gait is under way."""
        finger = self.row["free_finger"]
        return int(finger) if finger >= 0.0 else None

    @property
    def phase(self) -> str:
        """Phase of the gait."""
        return PHASES[int(self.row["phase"])]

    @property
    def regrasp(self) -> str:
        """Phase of setting down and taking again; "idle" where that is not how the hand turns."""
        return REGRASP[int(self.row["regrasp"])]

    @property
    def safe_mode(self) -> str:
        """How the hand is driven."""
        return MODES[int(self.row["safe_mode"])]

    @property
    def faults(self) -> list[str]:
        """What the controller says is wrong."""
        bits = int(self.row["faults"])
        return [name for i, name in enumerate(FAULTS) if bits >> i & 1]

    def reserve(self) -> Array:
        """How much harder each finger could press along its normal before a motor is at its limit, (n_fingers,), N.

        The largest r >= 0 with tau_min <= tau_j + J_j^T n_j r <= tau_max; zero where a finger doesn't touch.
        """
        scene, tau = self.scene, self.row.group("tau_des")
        reserve = np.zeros(len(scene.fingers))
        for j, own in enumerate(scene.joints):
            if not self.touching[j]:
                continue
            mujoco.mj_jac(scene.model, self.data, self._jacobian, None, self.places[j], int(scene.links[j]))
            slope = independent(scene, self._jacobian)[:, own].T @ self.normals[j]
            room = np.where(slope > 0.0, self._high[own] - tau[own], tau[own] - self._low[own])
            steps = np.maximum(room, 0.0) / np.maximum(np.abs(slope), 1e-6)
            reserve[j] = steps.min()
        return reserve

    def torque_share(self, tau: Array) -> Array:
        """Largest share of its limit that a motor of each finger gives, (..., n_fingers), for torques (..., n_q)."""
        limit = np.where(tau < 0.0, -self._low, self._high)
        share = np.abs(tau) / np.maximum(limit, 1e-9)
        return np.stack([share[..., own].max(axis=-1) for own in self.scene.joints], axis=-1)


def contact_frame(normal: Array) -> Array:
    """Contact frame R_WC (3, 3) of the unit normal: z along it, x as near to the vertical as can be; as in the core."""
    if not normal.any():
        return np.eye(3)
    up = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.99 else np.array([1.0, 0.0, 0.0])
    x = up - normal * (normal @ up)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(normal, x), normal])
