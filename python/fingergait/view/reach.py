"""How far the hand can move the object without a gait: the bounds of the gizmo."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait.sim.press import independent
from fingergait.sim.scene import OBJECT, SceneModel
from fingergait.sim.start import set_joints

Array = NDArray[np.float64]

_MOST = np.array([0.015, 0.015, 0.015, 0.5, 0.5, 0.5])  # m and rad: what is asked for at most
_PARTS = 10  # steps in which a direction is tried
_SHARE = 0.6  # of what the joints reach: the grasp walks on the object meanwhile
_MARGIN = 0.05  # rad from a joint's limit
_TOLERANCE = 5e-4  # m by which a tip may miss its place


def reach(scene: SceneModel, start: Array, height: float = 0.0) -> tuple[Array, Array]:
    """Smallest and largest offset (6,), m and rad, of the object's pose along and about each axis of W.

    The tips are moved with the object from the start of the run, one axis at a time, until a joint comes near its limit
    or a tip is out of reach; 60 % of that is the bound.

    Parameters
    ----------
    scene
        The model.
    start
        `qpos` of the whole scene with the tips on the object.
    height
        Lift, m, that the offset comes on top of.
    """
    data = mujoco.MjData(scene.model)
    data.qpos[:] = start
    mujoco.mj_kinematics(scene.model, data)
    mujoco.mj_comPos(scene.model, data)
    centre = data.xpos[int(scene.model.body(OBJECT).id)].copy()
    tips = data.geom_xpos[scene.tips].copy()
    bounds = np.zeros((2, 6))
    lifted = _follow(scene, data, tips + [0.0, 0.0, height])
    begin = data.qpos.copy()
    for side, sign in enumerate((-1.0, 1.0)):
        for axis in range(6):
            data.qpos[:] = begin
            good = 0
            while lifted and good < _PARTS:
                offset = np.zeros(6)
                offset[axis] = sign * _MOST[axis] * (good + 1) / _PARTS
                if not _follow(scene, data, _moved(tips, centre, offset) + [0.0, 0.0, height]):
                    break
                good += 1
            bounds[side, axis] = _SHARE * sign * _MOST[axis] * good / _PARTS
    return bounds[0], bounds[1]


def _moved(tips: Array, centre: Array, offset: Array) -> Array:
    """The tips (n, 3) after the object has moved by `offset` about its centre."""
    rotation = np.zeros(9)
    quaternion = np.array([1.0, 0.0, 0.0, 0.0])
    angle = float(np.linalg.norm(offset[3:]))
    if angle > 0.0:
        mujoco.mju_axisAngle2Quat(quaternion, offset[3:] / angle, angle)
    mujoco.mju_quat2Mat(rotation, quaternion)
    return (tips - centre) @ rotation.reshape(3, 3).T + centre + offset[:3]


def _follow(scene: SceneModel, data: mujoco.MjData, targets: Array) -> bool:
    """Moves the fingers in `data` so that their tips are at `targets` (n, 3): whether the joints can."""
    model = scene.model
    jacobian = np.zeros((3, model.nv))
    for index, (finger, own) in enumerate(zip(scene.fingers, scene.joints, strict=True)):
        lower, upper = model.jnt_range[list(finger.joints)].T
        q = data.qpos[scene.q].copy()
        for _ in range(20):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            error = targets[index] - data.geom_xpos[finger.probe]
            if np.linalg.norm(error) < 0.2 * _TOLERANCE:
                break
            mujoco.mj_jac(model, data, jacobian, None, data.geom_xpos[finger.probe], int(scene.links[index]))
            J = independent(scene, jacobian)[:, own]
            q[own] = np.clip(q[own] + J.T @ np.linalg.solve(J @ J.T + 1e-7 * np.eye(3), error), lower, upper)
            set_joints(scene, data, q)
        if np.linalg.norm(error) > _TOLERANCE or (q[own] < lower + _MARGIN).any() or (q[own] > upper - _MARGIN).any():
            return False
    return True
