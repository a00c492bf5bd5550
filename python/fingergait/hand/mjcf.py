"""A hand's kinematics from its MJCF: the JSON text that `_core.HandModel` reads.

A finger is the chain of bodies from the world to a fingertip; a fingertip is a sphere geom whose name ends in "tip".
Any number of fingers and of joints per finger will do, if all fingers have as many. The MJCF is the only place that
states the hand's geometry. What can't be expressed is refused in one sentence.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait._core import ConfigError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Finger:
    """Where one finger is in the compiled model: the tip's geom, its joints from the base on, and their actuators."""

    name: str
    tip: int
    joints: tuple[int, ...]
    actuators: tuple[int, ...]


def load_spec(path: Path) -> mujoco.MjSpec:
    """The MJCF at `path`, parsed; a parse error is one line that names the file."""
    try:
        return mujoco.MjSpec.from_file(str(path))
    except (ValueError, OSError) as error:
        raise ConfigError(
            f"hand.file: expected an MJCF that MuJoCo can read, found {path.name}: {_line(error)}"
        ) from None


def compile_spec(spec: mujoco.MjSpec, source: str) -> mujoco.MjModel:
    """The compiled model of `spec`; a compile error is one line that names `source`."""
    try:
        return spec.compile()
    except ValueError as error:
        raise ConfigError(f"{source}: expected a model that MuJoCo compiles, found: {_line(error)}") from None


def hand_json(path: Path) -> str:
    """JSON text for `_core.HandModel` of the hand in the MJCF file `path`."""
    model = compile_spec(load_spec(path), path.name)
    return json.dumps(hand_spec(model, path.name))


def find_fingers(model: mujoco.MjModel, source: str) -> list[Finger]:
    """Fingers of a compiled hand, in the order of their tips in the file.

    Raises
    ------
    ConfigError
        Where the model has no fingertips, unequal joint counts, a joint that is no limited hinge, a joint that is
        shared or outside the fingers, a tip that is no sphere, or a joint without exactly one motor.
    """
    names = [model.geom(i).name for i in range(model.ngeom)]
    tips = [i for i, name in enumerate(names) if name.endswith("tip")]
    if not tips:
        found = ", ".join(name for name in names if name) or "no named geom"
        raise ConfigError(f"{source}: expected sphere geoms whose names end in 'tip', one a finger, found {found}")
    fingers = [_finger(model, tip, names[tip], source) for tip in tips]
    counts = {finger.name: len(finger.joints) for finger in fingers}
    if len(set(counts.values())) > 1:
        found = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise ConfigError(f"{source}: expected as many joints in each finger, found {found}")
    owners: dict[int, str] = {}
    for finger in fingers:
        for joint in finger.joints:
            if joint in owners:
                both = f"{owners[joint]} and {finger.name}"
                raise ConfigError(
                    f"{source}: expected no joint in two fingers, found {model.joint(joint).name} in {both}"
                )
            owners[joint] = finger.name
    for joint in range(model.njnt):
        if joint not in owners:
            raise ConfigError(f"{source}: expected every joint in a finger, found {_joint_name(model, joint)} in none")
    return fingers


def _finger(model: mujoco.MjModel, tip: int, name: str, source: str) -> Finger:
    if model.geom_type[tip] != mujoco.mjtGeom.mjGEOM_SPHERE:
        kind = mujoco.mjtGeom(int(model.geom_type[tip])).name.removeprefix("mjGEOM_").lower()
        raise ConfigError(f"{source}: expected the fingertip {name} to be a sphere, found a {kind}")
    body, joints = int(model.geom_bodyid[tip]), list[int]()
    while body != 0:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        joints[:0] = range(first, first + count)
        body = int(model.body_parentid[body])
    if not joints:
        raise ConfigError(f"{source}: expected joints between the world and the fingertip {name}, found none")
    actuators = []
    for joint in joints:
        label = _joint_name(model, joint)
        if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
            kind = mujoco.mjtJoint(int(model.jnt_type[joint])).name.removeprefix("mjJNT_").lower()
            raise ConfigError(f"{source}: expected hinge joints only, found {label}, a {kind} joint")
        if not model.jnt_limited[joint]:
            raise ConfigError(f"{source}: expected a range on every joint, found none on {label}")
        driven = (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT) & (model.actuator_trnid[:, 0] == joint)
        motors = np.flatnonzero(driven)
        if len(motors) != 1:
            raise ConfigError(f"{source}: expected one actuator on the joint {label}, found {len(motors)}")
        actuators.append(int(motors[0]))
    label = name.removesuffix("tip").rstrip("_-. ") or name
    return Finger(label, tip, tuple(joints), tuple(actuators))


def hand_spec(model: mujoco.MjModel, source: str) -> dict[str, object]:
    """The hand model of ARCHITECTURE.md ("Hand model") as plain lists and numbers, SI units and radians."""
    fingers = [_finger_spec(model, finger) for finger in find_fingers(model, source)]
    return {"fingers": fingers, "gravity": model.opt.gravity.tolist()}


def _finger_spec(model: mujoco.MjModel, finger: Finger) -> dict[str, object]:
    links: list[dict[str, object]] = []
    position, quaternion = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])  # next frame in the link before it
    bodies = _chain(model, int(model.geom_bodyid[finger.tip]))
    for body in bodies:
        position, quaternion = _compose(position, quaternion, model.body_pos[body], model.body_quat[body])
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        for joint in range(first, first + count):
            anchor, axis = model.jnt_pos[joint], model.jnt_axis[joint]
            # MuJoCo's poses hold at the joint's reference angle; ours at zero.
            turn = _rotation(axis, -float(model.qpos0[model.jnt_qposadr[joint]]))
            position, quaternion = _compose(position, quaternion, anchor - _rotate(turn, anchor), turn)
            last = joint == first + count - 1
            mass, com = _welded_mass(model, body) if last else (0.0, np.zeros(3))
            lower, upper = model.jnt_range[joint]
            actuator = finger.actuators[finger.joints.index(joint)]
            links.append(
                {
                    "name": _joint_name(model, joint),
                    "position": position.tolist(),
                    "quaternion": quaternion.tolist(),
                    "anchor": anchor.tolist(),
                    "axis": axis.tolist(),
                    "lower": float(lower),
                    "upper": float(upper),
                    "damping": float(model.dof_damping[model.jnt_dofadr[joint]]),
                    "mass": mass,
                    "com": com.tolist(),
                    **_torque_limits(model, actuator),
                }
            )
            position, quaternion = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    # `position`, `quaternion`: the tip's body in the last link, where bodies without joints lie between them.
    centre, _ = _compose(position, quaternion, model.geom_pos[finger.tip], model.geom_quat[finger.tip])
    tip = {"position": centre.tolist(), "radius": float(model.geom_size[finger.tip, 0])}
    return {"name": finger.name, "joints": links, "tip": tip}


def _torque_limits(model: mujoco.MjModel, actuator: int) -> dict[str, float]:
    """The motor's limits, N m, where the MJCF states them."""
    if not model.actuator_forcelimited[actuator]:
        return {}
    low, high = model.actuator_forcerange[actuator]
    return {"tau_min": float(low), "tau_max": float(high)}


def last_link(model: mujoco.MjModel, finger: Finger) -> int:
    """Body whose orientation the fingertip frame F has: the one that carries the finger's last joint."""
    return int(model.jnt_bodyid[finger.joints[-1]])


def _chain(model: mujoco.MjModel, body: int) -> list[int]:
    bodies: list[int] = []
    while body != 0:
        bodies.insert(0, body)
        body = int(model.body_parentid[body])
    return bodies


def _welded_mass(model: mujoco.MjModel, body: int) -> tuple[float, Array]:
    """Mass and centre of mass, in the frame of `body`, of `body` with all that is fixed to it."""
    mass, moment = 0.0, np.zeros(3)
    for other in range(model.nbody):
        if model.body_weldid[other] != body:
            continue
        position, quaternion = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        for link in _chain(model, other):
            if model.body_weldid[link] == body and link != body:
                position, quaternion = _compose(position, quaternion, model.body_pos[link], model.body_quat[link])
        com, _ = _compose(position, quaternion, model.body_ipos[other], model.body_iquat[other])
        mass += float(model.body_mass[other])
        moment += float(model.body_mass[other]) * com
    return mass, moment / mass if mass > 0.0 else moment


def _compose(p: Array, q: Array, p_next: Array, q_next: Array) -> tuple[Array, Array]:
    """Pose of the second frame's child in the first frame: X = (p, q) * (p_next, q_next), quaternions wxyz."""
    quaternion = np.empty(4)
    mujoco.mju_mulQuat(quaternion, q, q_next)
    return p + _rotate(q, p_next), quaternion


def _rotate(q: Array, v: Array) -> Array:
    out = np.empty(3)
    mujoco.mju_rotVecQuat(out, v, q)
    return out


def _rotation(axis: Array, angle: float) -> Array:
    out = np.empty(4)
    mujoco.mju_axisAngle2Quat(out, axis, angle)
    return out


def _joint_name(model: mujoco.MjModel, joint: int) -> str:
    return str(model.joint(joint).name) or f"joint {joint}"


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
