"""The start of a run: the object on the palm and the tips just touching its side.

Nothing here is known to the controller. The tips are placed by bisection on MuJoCo's own distance between a sphere and
the object, so every shape is treated alike, and the joints follow by numerical inverse kinematics.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait._core import ConfigError
from fingergait.scenario import Scenario
from fingergait.sim.scene import OBJECT, SceneModel

Array = NDArray[np.float64]

_DEPTH = 1e-5  # m: how far a tip stands in the object at the start, so that it touches
_TOLERANCE = 1e-6  # m: of the inverse kinematics


@dataclass(frozen=True)
class Start:
    """`qpos` of the whole scene; torques (n_fingers * n_joints,), N m, that hold the fingers and press lightly."""

    qpos: Array
    torque: Array


def nominal_start(scene: SceneModel, scenario: Scenario) -> Start:
    """Object pose, joint angles and motor torques that a run of this scenario starts from.

    The object stands upright on the palm at the hand's axis, off by `truth.first_grasp`. Each tip touches its side at
    the azimuth of the finger's base, off by `truth.finger_offset_deg`, and at the height `grasp.height` above O, off by
    `truth.finger_height_offset`, all about the object where it really stands.

    Raises
    ------
    ConfigError
        Where a finger can't reach its contact within its joint limits, the object stands in a finger's link, or a list
        has the wrong length.
    """
    model, data = scene.model, mujoco.MjData(scene.model)
    n = len(scene.fingers)
    turns = np.deg2rad(_per_finger(scenario.truth.finger_offset_deg, n, "truth.finger_offset_deg"))
    heights = _per_finger(scenario.truth.finger_height_offset, n, "truth.finger_height_offset")
    data.qpos[scene.q] = model.jnt_range[_joints(scene)].mean(axis=1)
    data.qpos[scene.object_q : scene.object_q + 7] = _object_pose(scenario)
    mujoco.mj_kinematics(model, data)
    _raise_onto_palm(scene, data)
    middle = data.xpos[scene.object_body].copy()
    for index, finger in enumerate(scene.fingers):
        base = data.xanchor[finger.joints[0]]
        azimuth = np.arctan2(base[1], base[0]) + turns[index]
        outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        origin = middle + np.array([0.0, 0.0, scenario.grasp.height + heights[index]])
        target = _touching(scene, data, index, origin, outward)
        _reach(scene, data, index, target)
    mujoco.mj_kinematics(model, data)
    _check_clear(scene, data)
    return Start(data.qpos.copy(), _hold(scene, data, middle, scenario.grasp.press))


def _per_finger(values: tuple[float, ...], n: int, field: str) -> Array:
    if values and len(values) != n:
        raise ConfigError(f"{field}: expected {n} numbers, one a finger, or none, found {len(values)}")
    return np.array(values) if values else np.zeros(n)


def _joints(scene: SceneModel) -> list[int]:
    return [joint for finger in scene.fingers for joint in finger.joints]


def _object_pose(scenario: Scenario) -> Array:
    offset = np.array(scenario.truth.first_grasp)
    pose = np.array([0.0, 0.0, scenario.object.geometry.bottom, 1.0, 0.0, 0.0, 0.0])
    pose[:3] += offset[:3]
    angle = float(np.linalg.norm(offset[3:]))
    if angle > 0.0:
        mujoco.mju_axisAngle2Quat(pose[3:], offset[3:] / angle, angle)
    return pose


def _raise_onto_palm(scene: SceneModel, data: mujoco.MjData) -> None:
    """Lifts the object until it no longer stands in anything but the fingers."""
    model = scene.model
    geom = model.geom(OBJECT).id
    static = [i for i in range(model.ngeom) if model.body_weldid[model.geom_bodyid[i]] == 0 and model.geom_contype[i]]
    for _ in range(20):
        depth = min((_distance(model, data, geom, other) for other in static), default=0.0)
        if depth >= -1e-9:
            return
        data.qpos[scene.object_q + 2] -= depth
        mujoco.mj_kinematics(model, data)


def _distance(model: mujoco.MjModel, data: mujoco.MjData, a: int, b: int) -> float:
    """Signed distance between two geoms, m, at most 0.1."""
    return float(mujoco.mj_geomDistance(model, data, a, b, 0.1, None))


def _touching(scene: SceneModel, data: mujoco.MjData, index: int, origin: Array, outward: Array) -> Array:
    """Centre (3,) in W of finger `index`'s tip on the ray from `origin` along `outward` where it touches the object."""
    tip, geom = int(scene.tips[index]), int(scene.model.geom(OBJECT).id)
    kept = data.geom_xpos[tip].copy()
    near, far = 0.0, 0.3
    for _ in range(50):
        middle = 0.5 * (near + far)
        data.geom_xpos[tip] = origin + middle * outward
        near, far = (middle, far) if _distance(scene.model, data, tip, geom) < -_DEPTH else (near, middle)
    data.geom_xpos[tip] = kept
    return origin + far * outward


def _reach(scene: SceneModel, data: mujoco.MjData, index: int, target: Array) -> None:
    """Moves finger `index` in `data` so that its tip's centre is at `target`: damped least squares from mid-range."""
    model, finger = scene.model, scene.fingers[index]
    joints = list(finger.joints)
    q, v = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
    lower, upper = model.jnt_range[joints].T
    jacobian = np.zeros((3, model.nv))
    body = int(model.geom_bodyid[finger.tip])
    for _ in range(200):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        error = target - data.geom_xpos[finger.tip]
        if np.linalg.norm(error) < _TOLERANCE:
            return
        mujoco.mj_jac(model, data, jacobian, None, data.geom_xpos[finger.tip], body)
        J = jacobian[:, v]  # (3, n_joints)
        step = J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(3), error)
        data.qpos[q] = np.clip(data.qpos[q] + np.clip(step, -0.3, 0.3), lower, upper)
    place = ", ".join(f"{1e3 * x:.1f}" for x in target)
    found = f"one at ({place}) mm, {1e3 * np.linalg.norm(error):.1f} mm out of reach"
    raise ConfigError(f"object.size: expected an object whose side finger {finger.name} can touch, found {found}")


def _check_clear(scene: SceneModel, data: mujoco.MjData) -> None:
    """Refuses an object that stands in a finger's link."""
    model = scene.model
    geom = model.geom(OBJECT).id
    for finger in scene.fingers:
        links = {int(model.jnt_bodyid[joint]) for joint in finger.joints}
        for other in range(model.ngeom):
            if other in scene.tips or int(model.body_weldid[model.geom_bodyid[other]]) not in links:
                continue
            depth = -_distance(model, data, geom, other)
            if model.geom_contype[other] and depth > 1e-4:
                found = f"{1e3 * depth:.1f} mm of finger {finger.name} inside it"
                raise ConfigError(f"object.size: expected an object that leaves the fingers room, found {found}")


def _hold(scene: SceneModel, data: mujoco.MjData, middle: Array, press: float) -> Array:
    """Torques that hold the fingers' weight and press each tip towards the object's axis with the force `press`, N."""
    model = scene.model
    mujoco.mj_forward(model, data)
    torque = np.asarray(data.qfrc_bias[scene.v])  # at rest: gravity alone
    jacobian = np.zeros((3, model.nv))
    for index, finger in enumerate(scene.fingers):
        centre = data.geom_xpos[finger.tip]
        inward = np.array([middle[0] - centre[0], middle[1] - centre[1], 0.0])
        mujoco.mj_jac(model, data, jacobian, None, centre, int(model.geom_bodyid[finger.tip]))
        own = slice(index * scene.n_joints, (index + 1) * scene.n_joints)
        torque[own] += jacobian[:, scene.v[own]].T @ (press * inward / np.linalg.norm(inward))
    return torque
