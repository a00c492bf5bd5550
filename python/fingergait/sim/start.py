"""The start of a run: the object on the palm and the tips just touching its side.

Nothing here is known to the controller. The tips are placed by bisection on MuJoCo's own distance between a sphere and
the object, so every shape is treated alike, and the joints follow by numerical inverse kinematics.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from fingergait._core import ConfigError
from fingergait.hand import geom_name
from fingergait.scenario import Scenario
from fingergait.sim.press import holding_torques, independent
from fingergait.sim.scene import OBJECT, SceneModel, torque_limits

Array = NDArray[np.float64]

_DEPTH = 1e-5  # m: how far a tip stands in the object at the start, so that it touches
_FAR = 0.1  # m: distances beyond are not told apart
_DROP = 0.5  # m: how far below the fingertips the object may come to rest
_TOLERANCE = 1e-6  # m: of the inverse kinematics
_TOUCH_WEIGHT = 1e4  # of touching, against being near the place wished for


@dataclass(frozen=True)
class Start:
    """`qpos` of the whole scene; torques (n_q,), N m, that hold the fingers and press lightly."""

    qpos: Array
    torque: Array


def nominal_start(scene: SceneModel, scenario: Scenario) -> Start:
    """Object pose, joint angles and motor torques that a run of this scenario starts from.

    With `object.pose` and `grasp.joints` these are the start, the object off by `truth.first_grasp`. Otherwise the
    object stands upright amid the fingertips as they are in mid-range, on what is below. Each tip touches its side at
    the azimuth that it has in mid-range, off by `truth.finger_offset_deg`, and at the height `grasp.height` above O,
    off by `truth.finger_height_offset`, all about the object where it really stands. A finger that can't get there
    touches as near to it as it can.

    Raises
    ------
    ConfigError
        Where a finger can't touch the object within its joint limits, a motor can't hold its finger, the object stands
        in a finger's link, or a list has the wrong length.
    """
    model, data = scene.model, mujoco.MjData(scene.model)
    n = len(scene.fingers)
    turns = np.deg2rad(_per_finger(scenario.truth.finger_offset_deg, n, "truth.finger_offset_deg"))
    heights = _per_finger(scenario.truth.finger_height_offset, n, "truth.finger_height_offset")
    set_joints(scene, data, model.jnt_range[_joints(scene)].mean(axis=1))
    mujoco.mj_kinematics(model, data)
    data.qpos[scene.object_q : scene.object_q + 7] = _object_pose(scene, data, scenario)
    mujoco.mj_kinematics(model, data)
    _rest(scene, data, lower=scenario.object.pose is None)
    middle = data.xpos[scene.object_body].copy()
    if scenario.grasp.joints is not None:
        if len(scenario.grasp.joints) != len(scene.q):
            found = len(scenario.grasp.joints)
            raise ConfigError(f"grasp.joints: expected {len(scene.q)} angles, one for each joint, found {found}")
        set_joints(scene, data, np.array(scenario.grasp.joints))
        mujoco.mj_kinematics(model, data)
        _check_clear(scene, data)
        return Start(data.qpos.copy(), _held(scene, data, scenario.grasp.press))
    tips = data.geom_xpos[scene.tips] - data.geom_xpos[scene.tips].mean(axis=0)
    for index in range(n):
        azimuth = np.arctan2(tips[index, 1], tips[index, 0]) + turns[index]
        outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        origin = middle + np.array([0.0, 0.0, scenario.grasp.height + heights[index]])
        target = _touching(scene, data, index, origin, outward)
        _reach(scene, data, index, target)
    mujoco.mj_kinematics(model, data)
    _check_clear(scene, data)
    return Start(data.qpos.copy(), _held(scene, data, scenario.grasp.press))


def _per_finger(values: tuple[float, ...], n: int, field: str) -> Array:
    if values and len(values) != n:
        raise ConfigError(f"{field}: expected {n} numbers, one a finger, or none, found {len(values)}")
    return np.array(values) if values else np.zeros(n)


def _joints(scene: SceneModel) -> list[int]:
    return [joint for finger in scene.fingers for joint in finger.joints]


def set_joints(scene: SceneModel, data: mujoco.MjData, q: Array) -> None:
    """Moves the independent joints to `q`, rad, and those that follow them along."""
    data.qpos[scene.q] = q
    address = scene.model.jnt_qposadr
    for coupling in scene.hand.couplings.values():
        data.qpos[address[coupling.follower]] = coupling.ratio * data.qpos[address[coupling.leader]] + coupling.offset


def _object_pose(scene: SceneModel, data: mujoco.MjData, scenario: Scenario) -> Array:
    """The object's true pose (7,) in W at the start, before it is raised."""
    offset, nominal = np.array(scenario.truth.first_grasp), scenario.object.pose
    pose, turn = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.empty(4)
    if nominal is not None:
        pose[:3] = nominal[:3]
        pose[3:] = _quaternion(np.array(nominal[3:]))
    else:
        pose[:3] = data.geom_xpos[scene.tips].mean(axis=0)
    pose[:3] += offset[:3]
    mujoco.mju_mulQuat(turn, _quaternion(offset[3:]), pose[3:])
    pose[3:] = turn
    return pose


def _quaternion(vector: Array) -> Array:
    """Quaternion wxyz of the rotation vector (3,)."""
    out, angle = np.array([1.0, 0.0, 0.0, 0.0]), float(np.linalg.norm(vector))
    if angle > 0.0:
        mujoco.mju_axisAngle2Quat(out, vector / angle, angle)
    return out


def _rest(scene: SceneModel, data: mujoco.MjData, lower: bool) -> None:
    """Lifts the object until it stands in nothing but the fingers, or lowers it onto what is below."""
    model = scene.model
    geom = model.geom(OBJECT).id
    static = [i for i in range(model.ngeom) if model.body_weldid[model.geom_bodyid[i]] == 0 and model.geom_contype[i]]
    begin, inside = float(data.qpos[scene.object_q + 2]), False
    for _ in range(60):
        gap = min((_distance(model, data, geom, other) for other in static), default=_FAR)
        if gap >= -1e-9 and (inside or not lower or gap < 1e-7):
            return
        inside = inside or gap < -1e-9
        data.qpos[scene.object_q + 2] -= gap
        mujoco.mj_kinematics(model, data)
        if begin - data.qpos[scene.object_q + 2] > _DROP:  # nothing is below: the fingers hold it where it is
            data.qpos[scene.object_q + 2] = begin
            mujoco.mj_kinematics(model, data)
            return


def _distance(model: mujoco.MjModel, data: mujoco.MjData, a: int, b: int) -> float:
    """Signed distance between two geoms, m, at most `_FAR`."""
    return float(mujoco.mj_geomDistance(model, data, a, b, _FAR, None))


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
    q = model.jnt_qposadr[joints]
    lower, upper = model.jnt_range[joints].T
    jacobian = np.zeros((3, model.nv))
    tip = finger.probe
    body = int(model.geom_bodyid[tip])
    for _ in range(200):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        error = target - data.geom_xpos[tip]
        if np.linalg.norm(error) < _TOLERANCE:
            return
        mujoco.mj_jac(model, data, jacobian, None, data.geom_xpos[tip], body)
        J = independent(scene, jacobian)[:, scene.joints[index]]  # (3, n_joints)
        step = J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(3), error)
        moved = data.qpos[scene.q].copy()
        moved[scene.joints[index]] = np.clip(data.qpos[q] + np.clip(step, -0.3, 0.3), lower, upper)
        set_joints(scene, data, moved)
    _touch_near(scene, data, index, target)


def _touch_near(scene: SceneModel, data: mujoco.MjData, index: int, target: Array) -> None:
    """Moves finger `index` so that its tip touches the object as near to `target` as it can."""
    model, finger, own = scene.model, scene.fingers[index], scene.joints[index]
    tip, geom = int(scene.tips[index]), int(model.geom(OBJECT).id)
    lower, upper = model.jnt_range[list(finger.joints)].T

    def away(q: Array) -> Array:
        moved = data.qpos[scene.q].copy()
        moved[own] = q
        set_joints(scene, data, moved)
        mujoco.mj_kinematics(model, data)
        apart = _distance(model, data, tip, geom) + _DEPTH
        return np.array([_TOUCH_WEIGHT * apart, *(data.geom_xpos[tip] - target)])

    starts = [0.5 * (lower + upper), np.clip(data.qpos[scene.q][own], lower, upper)]
    inset = 1e-6 * (upper - lower)  # the solver starts inside of its bounds
    found = [
        least_squares(away, np.clip(q, lower + inset, upper - inset), bounds=(lower, upper), xtol=1e-12, ftol=1e-12)
        for q in starts
    ]
    best = min(found, key=lambda answer: float(answer.cost))
    apart = float(away(best.x)[0]) / _TOUCH_WEIGHT
    if abs(apart) > _DEPTH / 2.0:
        place = ", ".join(f"{1e3 * x:.1f}" for x in target)
        off = f"one that it misses by {1e3 * abs(apart):.1f} mm on the way to ({place}) mm"
        raise ConfigError(
            f"object: expected an object that finger {finger.name} can touch, found {off}; object.pose, object.size "
            "and grasp.height say where it is, grasp.joints how the fingers stand"
        )


def _check_clear(scene: SceneModel, data: mujoco.MjData) -> None:
    """Refuses an object that stands in a finger's link."""
    model = scene.model
    geom = model.geom(OBJECT).id
    for finger in scene.fingers:
        links = {int(model.jnt_bodyid[joint]) for joint in finger.links}
        for other in range(model.ngeom):
            if other == finger.tip or int(model.body_weldid[model.geom_bodyid[other]]) not in links:
                continue
            depth = -_distance(model, data, geom, other)
            if model.geom_contype[other] and depth > 1e-4:
                found = f"{1e3 * depth:.1f} mm of {geom_name(model, other)} inside it"
                raise ConfigError(f"object.size: expected an object that leaves the fingers room, found {found}")


def _held(scene: SceneModel, data: mujoco.MjData, press: float) -> Array:
    torque = holding_torques(scene, data, press)
    _check_torques(scene, torque)
    return torque


def _check_torques(scene: SceneModel, torque: Array) -> None:
    """Refuses a start that a motor can't hold."""
    low, high = torque_limits(scene)
    names = [scene.model.joint(joint).name for joint in _joints(scene)]
    for name, wanted, least, most in zip(names, torque, low, high, strict=True):
        if not least <= wanted <= most:
            raise ConfigError(
                f"the motor of {name}: expected one that holds its finger at the start, which takes {wanted:.3g} N m "
                f"with the finger's weight, springs and grasp.press, found one of {least:g} to {most:g} N m"
            )
