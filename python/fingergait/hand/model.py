"""The hand model that the compiled core reads, as JSON text: kinematics, inertia, motors and tips of a hand."""

import json
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait.hand.importer import Finger, Hand, import_hand

Array = NDArray[np.float64]


def hand_json(path: Path, facts: Path | None = None, pose: tuple[float, ...] | None = None) -> str:
    """JSON text for `HandModel` of the hand in an MJCF or URDF file; the arguments are those of `import_hand`.

    Raises
    ------
    HandError
        With everything that is in the way, each with what to write where.
    ConfigError
        A file that can't be read, or that MuJoCo does not compile.
    """
    return model_json(import_hand(path, facts, pose))


def model_json(hand: Hand) -> str:
    """JSON text for `_core.HandModel` of an imported hand."""
    return json.dumps(hand_spec(hand))


def hand_spec(hand: Hand) -> dict[str, object]:
    """The hand model of ARCHITECTURE.md ("Hand model") as plain lists and numbers, SI units and radians."""
    return {
        "fingers": [_finger_spec(hand, finger) for finger in hand.fingers],
        "gravity": hand.model.opt.gravity.tolist(),
    }


def _finger_spec(hand: Hand, finger: Finger) -> dict[str, object]:
    model = hand.model
    links: list[dict[str, object]] = []
    position, quaternion = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])  # next frame in the link before it
    for body in _chain(model, int(model.geom_bodyid[finger.probe])):
        position, quaternion = _compose(position, quaternion, model.body_pos[body], model.body_quat[body])
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        for joint in range(first, first + count):
            anchor, axis = model.jnt_pos[joint], model.jnt_axis[joint]
            # MuJoCo's poses hold at the joint's reference angle; ours at zero.
            turn = _rotation(axis, -float(model.qpos0[model.jnt_qposadr[joint]]))
            position, quaternion = _compose(position, quaternion, anchor - _rotate(turn, anchor), turn)
            last = joint == first + count - 1
            mass, com, inertia = _welded_body(model, body) if last else (0.0, np.zeros(3), np.zeros((3, 3)))
            links.append(
                {
                    **_joint_spec(hand, finger, joint),
                    "position": position.tolist(),
                    "quaternion": quaternion.tolist(),
                    "anchor": anchor.tolist(),
                    "axis": axis.tolist(),
                    "mass": mass,
                    "com": com.tolist(),
                    "inertia": [float(inertia[i, k]) for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))],
                }
            )
            position, quaternion = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    # `position`, `quaternion`: the tip's body in the last link, where bodies without joints lie between them.
    centre, _ = _compose(position, quaternion, finger.sphere.centre, np.array([1.0, 0.0, 0.0, 0.0]))
    return {"name": finger.name, "joints": links, "tip": {"position": centre.tolist(), "radius": finger.sphere.radius}}


def _joint_spec(hand: Hand, finger: Finger, joint: int) -> dict[str, object]:
    """What there is to say of a joint besides where it is."""
    model, dof = hand.model, int(hand.model.jnt_dofadr[joint])
    lower, upper = model.jnt_range[joint]
    spec: dict[str, object] = {
        "name": str(model.joint(joint).name),
        "lower": float(lower),
        "upper": float(upper),
        "damping": float(model.dof_damping[dof]),
        "armature": float(model.dof_armature[dof]),
        "frictionloss": float(model.dof_frictionloss[dof]),
        "stiffness": float(model.jnt_stiffness[joint]),
        "spring_reference": float(model.qpos_spring[model.jnt_qposadr[joint]]),
    }
    coupling = hand.couplings.get(joint)
    if coupling is not None:
        leader = finger.links.index(coupling.leader)
        return spec | {"follows": {"joint": leader, "ratio": coupling.ratio, "offset": coupling.offset}}
    motor = finger.motors[finger.joints.index(joint)]
    spec |= {"tau_min": motor.low, "tau_max": motor.high}
    reference = hand.references.get(joint)
    return spec | ({"reference": reference} if reference is not None else {})


def last_link(model: mujoco.MjModel, finger: Finger) -> int:
    """Body whose orientation the fingertip frame F has: the one that carries the finger's last joint."""
    return int(model.jnt_bodyid[finger.links[-1]])


def _chain(model: mujoco.MjModel, body: int) -> list[int]:
    bodies: list[int] = []
    while body != 0:
        bodies.insert(0, body)
        body = int(model.body_parentid[body])
    return bodies


def _welded_body(model: mujoco.MjModel, body: int) -> tuple[float, Array, Array]:
    """Mass, centre of mass (3,) and inertia (3, 3) about it of `body` with all that is fixed to it, in its frame."""
    parts = []
    for other in range(model.nbody):
        if model.body_weldid[other] != body:
            continue
        position, quaternion = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        for link in _chain(model, other):
            if model.body_weldid[link] == body and link != body:
                position, quaternion = _compose(position, quaternion, model.body_pos[link], model.body_quat[link])
        com, turn = _compose(position, quaternion, model.body_ipos[other], model.body_iquat[other])
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, turn)
        R = matrix.reshape(3, 3)
        parts.append((float(model.body_mass[other]), com, R @ np.diag(model.body_inertia[other]) @ R.T))
    mass = sum(m for m, _, _ in parts)
    if mass <= 0.0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    middle = sum((m * com for m, com, _ in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for m, com, own in parts:
        arm = com - middle
        inertia += own + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return mass, middle, inertia


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
