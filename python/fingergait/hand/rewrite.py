"""The model as the hand that the plant simulates: torque motors, joints that are held, tips that are marked."""

import mujoco
import numpy as np

from fingergait.hand.chains import Chain
from fingergait.hand.chains import joint_name as shown_joint
from fingergait.hand.couplings import Coupling
from fingergait.hand.facts import Facts
from fingergait.hand.motors import Motor, reflected_armature
from fingergait.hand.obstacle import Notes
from fingergait.hand.tips import TipSphere

OURS = "fingergait"
"""What the names begin with that the importer and the scene give."""

_IMPRATIO = 10.0  # friction that does not creep


def rewrite(
    spec: mujoco.MjSpec,
    before: mujoco.MjModel,
    chains: list[Chain],
    held: list[int],
    couplings: list[Coupling],
    motors: dict[int, Motor],
    spheres: list[TipSphere],
    facts: Facts,
    notes: Notes,
) -> None:
    """Makes the model what the hand is: joints held, torque motors, tips marked, nothing that acts unseen."""
    _settings(spec, notes)
    for element in (*spec.actuators, *spec.sensors, *spec.keys, *spec.tuples):
        spec.delete(element)
    names = {before.joint(j).name for j in held}
    for equality in list(spec.equalities):
        if equality.name1 in names or equality.name2 in names:
            notes.change(f"the equality of {equality.name1} is taken out: its joint is held")
            spec.delete(equality)
    for tendon in list(spec.tendons):
        # What they drive is coupled or has a motor of its own now.
        spec.delete(tendon)
    for coupling in couplings:
        if coupling.tendon >= 0 or coupling.stated:
            follower, leader = before.joint(coupling.follower).name, before.joint(coupling.leader).name
            at = before.qpos0[before.jnt_qposadr[[coupling.follower, coupling.leader]]]
            data = np.zeros(mujoco.mjNEQDATA)
            data[0], data[1] = coupling.offset + coupling.ratio * at[1] - at[0], coupling.ratio
            equality = spec.add_equality(
                name=f"{OURS}_{follower}", type=mujoco.mjtEq.mjEQ_JOINT, name1=follower, name2=leader, data=data
            )
            equality.objtype = mujoco.mjtObj.mjOBJ_JOINT
    for joint in reversed(held):  # of the joints of one body the last turns first
        name = before.joint(joint).name
        angle = facts.of(name).held
        why = "moves more than one finger, or none" if angle is None else "is held by the facts"
        where = _hold(spec, before, joint, angle)
        notes.change(f"the joint {shown_joint(before, joint)} {why}: it stays {where}, and its actuator is taken out")
    for body in spec.bodies:
        if body.gravcomp:
            notes.change(f"gravcomp of {body.name} is taken out: the controller holds the fingers' weight")
            body.gravcomp = 0.0
    for joint, motor in motors.items():
        name = before.joint(joint).name
        element = spec.joint(name)
        own = facts.of(name)
        if own.range is not None:
            element.range, element.limited = list(own.range), mujoco.mjtLimited.mjLIMITED_TRUE
        if own.damping is not None:
            element.damping[0] = own.damping
        element.armature = before.dof_armature[before.jnt_dofadr[joint]] + reflected_armature(before, joint)
        element.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
        actuator = spec.add_actuator(name=f"{OURS}_{name}", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_NONE
        actuator.gainprm[0] = 1.0
        actuator.forcelimited, actuator.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, [motor.low, motor.high]
        if motor.lag > 0.0:
            actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
            actuator.dynprm[0] = motor.lag
            actuator.actlimited, actuator.actrange = mujoco.mjtLimited.mjLIMITED_TRUE, [motor.low, motor.high]
    for number, (chain, sphere) in enumerate(zip(chains, spheres, strict=True)):
        body = spec.body(before.body(int(before.geom_bodyid[chain.tip])).name)
        body.add_geom(
            name=f"{OURS}_tip_{number}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            pos=sphere.centre,
            size=[sphere.radius, 0.0, 0.0],
            contype=0,
            conaffinity=0,
            mass=0.0,
            group=5,
        )


def _settings(spec: mujoco.MjSpec, notes: Notes) -> None:
    """Turns on what a file may have switched off, and the contact settings that hold an object by friction."""
    option, bit = spec.option, mujoco.mjtDisableBit
    names = ("CONSTRAINT", "EQUALITY", "FRICTIONLOSS", "LIMIT", "CONTACT", "SPRING", "DAMPER", "ACTUATION")
    for name in (*names, "FILTERPARENT", "SENSOR", "CLAMPCTRL"):
        flag = int(getattr(bit, f"mjDSBL_{name}"))
        if option.disableflags & flag:
            option.disableflags &= ~flag
            notes.change(f"the option that switches {name.lower()} off is taken out")
    if option.disableactuator:
        option.disableactuator = 0
    if option.disableflags & int(bit.mjDSBL_GRAVITY):
        option.gravity = np.zeros(3)
        notes.warn("the model has gravity switched off: neither the fingers nor the object have a weight")
    changed = []
    if option.cone != mujoco.mjtCone.mjCONE_ELLIPTIC:
        option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        changed.append("elliptic friction cones")
    if option.impratio < _IMPRATIO:
        option.impratio = _IMPRATIO
        changed.append(f"impratio {_IMPRATIO:g}")
    if option.integrator != mujoco.mjtIntegrator.mjINT_IMPLICITFAST:
        option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        changed.append("integrator implicitfast")
    if changed:
        notes.change(f"simulated with {', '.join(changed)}, so that friction holds without creeping")
    if option.density or option.viscosity:
        notes.warn("the model has a medium (density, viscosity), whose drag the controller does not know")


def _hold(spec: mujoco.MjSpec, before: mujoco.MjModel, joint: int, stated: float | None) -> str:
    """Takes a joint out, with its body where the joint would be at `stated`, else at its first angle; in words."""
    element, body = spec.joint(before.joint(joint).name), int(before.jnt_bodyid[joint])
    kind, first = int(before.jnt_type[joint]), float(before.qpos0[before.jnt_qposadr[joint]])
    if kind in (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL):
        spec.delete(element)
        return "where it is"
    lower, upper = before.jnt_range[joint] if before.jnt_limited[joint] else (-np.inf, np.inf)
    value = float(np.clip(first, lower, upper)) if stated is None else stated
    if value != first:
        shift, turn = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        axis = before.jnt_axis[joint]
        if kind == mujoco.mjtJoint.mjJNT_SLIDE:
            shift = axis * (value - first)
        else:
            mujoco.mju_axisAngle2Quat(turn, axis, value - first)
            mujoco.mju_rotVecQuat(shift, before.jnt_pos[joint], turn)
            shift = before.jnt_pos[joint] - shift
        _move(spec.body(before.body(body).name), shift, turn)
    spec.delete(element)
    return f"at {value:g} {'m' if kind == mujoco.mjtJoint.mjJNT_SLIDE else 'rad'}"


def _move(body: mujoco.MjsBody, shift: np.ndarray, turn: np.ndarray) -> None:
    """Moves a body by a shift and a turn in its own frame; further moves come on top."""
    # A new frame inside those that the body stands in has the pose that the body had.
    frame = body.parent.add_frame(pos=body.pos, quat=body.quat)
    frame.alt.type, frame.alt.euler = body.alt.type, body.alt.euler
    frame.alt.axisangle, frame.alt.xyaxes, frame.alt.zaxis = body.alt.axisangle, body.alt.xyaxes, body.alt.zaxis
    if body.frame is not None:
        frame.set_frame(body.frame)
    body.set_frame(frame)
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.pos, body.quat = shift, turn
