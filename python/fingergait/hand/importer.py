"""From a model's file to a hand: fingers, tips, motors, and what was changed and why."""

import os
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait._core import ConfigError
from fingergait.hand.chains import NAMELESS, Chain, find_chains, geom_name
from fingergait.hand.couplings import Coupling, find_couplings
from fingergait.hand.facts import Facts, facts_beside
from fingergait.hand.motors import Motor, gear_at, motor_of
from fingergait.hand.obstacle import Notes
from fingergait.hand.tips import TipSphere, fit_tip

Array = NDArray[np.float64]

OURS = "fingergait"
"""What the names begin with that the importer and the scene give."""


@dataclass(frozen=True)
class Finger:
    """One finger in the compiled model.

    name, tip, probe
        Its name; the geom of its tip; the geom, which touches nothing, that is the tip's `sphere`.
    links
        Joints from the base on, those that follow others among them.
    joints, actuators, motors
        The independent ones, their actuators, and what these can give.
    """

    name: str
    tip: int
    probe: int
    sphere: TipSphere
    links: tuple[int, ...]
    joints: tuple[int, ...]
    actuators: tuple[int, ...]
    motors: tuple[Motor, ...]


@dataclass(frozen=True)
class Hand:
    """A hand as imported: `spec` and `model` have torque motors only; everything else is by ids in `model`."""

    source: str
    spec: mujoco.MjSpec
    model: mujoco.MjModel
    fingers: tuple[Finger, ...]
    couplings: dict[int, Coupling]
    references: dict[int, float]
    changes: tuple[str, ...] = field(default=())
    warnings: tuple[str, ...] = field(default=())


def load_spec(path: Path) -> mujoco.MjSpec:
    """The MJCF or URDF at `path`, parsed; a parse error is one line that names the file."""
    try:
        # As bytes: the path may not be UTF-8.
        return mujoco.MjSpec.from_file(os.fsencode(path))
    except (ValueError, OSError) as error:
        raise ConfigError(
            f"hand.file: expected an MJCF or URDF that MuJoCo can read, found {shown(path)}: {_line(error)}"
        ) from None


def shown(path: Path) -> str:
    """The file's name in letters that every terminal has."""
    return path.name.encode("utf-8", "backslashreplace").decode("ascii", "backslashreplace")


def compile_spec(spec: mujoco.MjSpec, source: str) -> mujoco.MjModel:
    """The compiled model of `spec`; a compile error is one line that names `source`."""
    try:
        return spec.compile()
    except ValueError as error:
        raise ConfigError(f"{source}: expected a model that MuJoCo compiles, found: {_line(error)}") from None


def import_hand(path: Path, facts: Path | None = None, pose: tuple[float, ...] | None = None) -> Hand:
    """The hand in an MJCF or URDF file.

    Parameters
    ----------
    path
        The model.
    facts
        Its facts file; absent: `<stem>.facts.toml` beside it, where there is one.
    pose
        [x, y, z, rx, ry, rz] of the model in the world, m and rotation vector, before that of the facts.

    Raises
    ------
    HandError
        With everything that is in the way, each with what to write where.
    """
    beside = facts if facts is not None else facts_beside(path)
    known = Facts.load(beside) if beside is not None else Facts()
    notes, source = Notes(), shown(path)
    spec = load_spec(path)
    spec.compiler.discardvisual = False  # or the spheres of the tips would go
    _name_everything(spec)
    placed = pose if pose is not None else known.pose
    if placed is not None:
        _place(spec, placed)
    before = compile_spec(spec, source)
    chains, held = find_chains(before, known, notes)
    notes.settle(source)
    _check_joints(before, chains, known, notes)
    couplings = find_couplings(before, chains, notes)
    for name in known.joints:
        if mujoco.mj_name2id(before, mujoco.mjtObj.mjOBJ_JOINT, name) < 0:
            notes.obstacle(f"facts: joints.{name}", "a joint of the model", "none of that name", "correct the name")
    motors = _motors(before, chains, couplings, known, notes)
    notes.settle(source)
    spheres = [fit_tip(before, chain.tip, chain.joints[-1]) for chain in chains]
    spheres = [_stated(before, chain, sphere, known) for chain, sphere in zip(chains, spheres, strict=True)]
    _rewrite(spec, before, chains, held, couplings, motors, spheres, known, notes)
    model = compile_spec(spec, source)
    return _hand(source, spec, model, before, chains, couplings, motors, spheres, known, notes)


def _name_everything(spec: mujoco.MjSpec) -> None:
    """Gives what has no name one of ours, so that it can be found again after the model has changed."""
    for kind, items in (("joint", spec.joints), ("geom", spec.geoms), ("body", spec.bodies)):
        taken = {item.name for item in items}
        for number, item in enumerate(items):
            if not item.name and not (kind == "body" and item == spec.worldbody):
                name = f"{NAMELESS}{kind}_{number}"
                while name in taken:
                    name += "_"
                taken.add(name)
                item.name = name


def _place(spec: mujoco.MjSpec, pose: tuple[float, ...]) -> None:
    """Moves the whole model to `pose` in the world."""
    turn = np.empty(4)
    angle = float(np.linalg.norm(pose[3:]))
    mujoco.mju_axisAngle2Quat(turn, np.array(pose[3:]) / angle if angle > 0.0 else np.array([0.0, 0.0, 1.0]), angle)
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    mujoco.mj_kinematics(compiled, data)
    for body in spec.bodies:
        if body.parent == spec.worldbody:
            number = compiled.body(body.name).id
            _set_pose(body, *_moved(pose, turn, data.xpos[number], data.xquat[number]))
    for geom in spec.worldbody.geoms:
        number = compiled.geom(geom.name).id
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, data.geom_xmat[number])
        if geom.type != mujoco.mjtGeom.mjGEOM_MESH:
            geom.fromto = np.full(6, np.nan)
            _set_pose(geom, *_moved(pose, turn, data.geom_xpos[number], quaternion))


def _set_pose(element: object, position: Array, quaternion: Array) -> None:
    element.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT  # type: ignore[attr-defined]
    element.pos, element.quat = position, quaternion  # type: ignore[attr-defined]


def _moved(pose: tuple[float, ...], turn: Array, position: Array, quaternion: Array) -> tuple[Array, Array]:
    p, q = np.empty(3), np.empty(4)
    mujoco.mju_rotVecQuat(p, position, turn)
    mujoco.mju_mulQuat(q, turn, quaternion)
    return p + np.array(pose[:3]), q


def _check_joints(model: mujoco.MjModel, chains: list[Chain], facts: Facts, notes: Notes) -> None:
    for chain in chains:
        for joint in chain.joints:
            name = model.joint(joint).name
            where = f"the joint {name}"
            if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
                kind = mujoco.mjtJoint(int(model.jnt_type[joint])).name.removeprefix("mjJNT_").lower()
                remedy = f"hold it: [joints.{name}] held = 0"
                notes.obstacle(where, "a hinge", f"a {kind} joint", remedy)
            elif not model.jnt_limited[joint] and facts.of(name).range is None:
                notes.obstacle(where, "a range", "none", f"[joints.{name}] range = [<lower>, <upper>]  # rad")
            else:
                low, high = facts.of(name).range or model.jnt_range[joint]
                if high - low > 2.0 * np.pi + 1e-9:
                    degrees = ", ".join(f"{np.degrees(x):.0f}" for x in (low, high))
                    notes.warn(
                        f"{where} has a range of more than a turn ({degrees} degrees): "
                        "are its angles degrees in a file that says radian?"
                    )


def _motors(
    model: mujoco.MjModel, chains: list[Chain], couplings: list[Coupling], facts: Facts, notes: Notes
) -> dict[int, Motor]:
    """The motor of each independent joint."""
    followers = {c.follower: c for c in couplings}
    motors: dict[int, Motor] = {}
    for chain in chains:
        for joint in chain.joints:
            if joint in followers:
                if any(
                    gear_at(model, a, joint) and model.actuator_trntype[a] != mujoco.mjtTrn.mjTRN_TENDON
                    for a in range(model.nu)
                ):
                    name = model.joint(joint).name
                    notes.change(f"{name} follows another joint: its own actuator is taken out")
                continue
            # A tendon that drives followers too pulls the leader with all of its shares.
            shares = 1.0
            for c in couplings:
                if c.leader == joint and c.tendon >= 0:
                    shares += c.ratio * c.ratio
            motor = motor_of(model, joint, shares, facts, notes)
            if motor is not None:
                motors[joint] = motor
    return motors


def _stated(model: mujoco.MjModel, chain: Chain, sphere: TipSphere, facts: Facts) -> TipSphere:
    """The sphere that the facts give, where they do."""
    body = model.body(int(model.geom_bodyid[chain.tip])).name
    for name in (chain.name, model.geom(chain.tip).name, body):
        if name in facts.tip:
            stated = facts.tip[name]
            return TipSphere(np.array(stated.centre), stated.radius, sphere.error)
    return sphere


def _rewrite(
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
    for element in (*spec.actuators, *spec.sensors, *spec.keys):
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
        if coupling.tendon >= 0:
            follower, leader = before.joint(coupling.follower).name, before.joint(coupling.leader).name
            data = np.zeros(mujoco.mjNEQDATA)
            data[1] = coupling.ratio
            equality = spec.add_equality(
                name=f"{OURS}_{follower}", type=mujoco.mjtEq.mjEQ_JOINT, name1=follower, name2=leader, data=data
            )
            equality.objtype = mujoco.mjtObj.mjOBJ_JOINT
    for joint in held:
        name = before.joint(joint).name
        angle = facts.of(name).held
        _hold(spec, before, joint, angle or 0.0)
        why = "is in no finger alone: it " if angle is None else ""
        notes.change(f"the joint {name} {why}is held at {angle or 0.0:g}")
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


def _hold(spec: mujoco.MjSpec, before: mujoco.MjModel, joint: int, angle: float) -> None:
    """Takes a joint out with its body turned to `angle`, rad."""
    element = spec.joint(before.joint(joint).name)
    body = spec.body(before.body(int(before.jnt_bodyid[joint])).name)
    if angle and before.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
        turn, quaternion, offset = np.empty(4), np.empty(4), np.empty(3)
        number = int(before.jnt_bodyid[joint])
        mujoco.mju_axisAngle2Quat(turn, before.jnt_axis[joint], angle - before.qpos0[before.jnt_qposadr[joint]])
        mujoco.mju_rotVecQuat(offset, before.jnt_pos[joint], turn)
        shift = before.jnt_pos[joint] - offset
        mujoco.mju_rotVecQuat(offset, shift, before.body_quat[number])
        mujoco.mju_mulQuat(quaternion, before.body_quat[number], turn)
        _set_pose(body, before.body_pos[number] + offset, quaternion)
    spec.delete(element)


def _hand(
    source: str,
    spec: mujoco.MjSpec,
    model: mujoco.MjModel,
    before: mujoco.MjModel,
    chains: list[Chain],
    couplings: list[Coupling],
    motors: dict[int, Motor],
    spheres: list[TipSphere],
    facts: Facts,
    notes: Notes,
) -> Hand:
    def now(joint: int) -> int:
        return int(model.joint(before.joint(joint).name).id)

    fingers, references = [], {}
    for number, (chain, sphere) in enumerate(zip(chains, spheres, strict=True)):
        own = [joint for joint in chain.joints if joint in motors]
        for joint in own:
            reference = facts.of(before.joint(joint).name).reference
            if reference is not None:
                references[now(joint)] = reference
        fingers.append(
            Finger(
                name=chain.name,
                tip=int(model.geom(before.geom(chain.tip).name).id),
                probe=int(model.geom(f"{OURS}_tip_{number}").id),
                sphere=sphere,
                links=tuple(now(joint) for joint in chain.joints),
                joints=tuple(now(joint) for joint in own),
                actuators=tuple(int(model.actuator(f"{OURS}_{before.joint(j).name}").id) for j in own),
                motors=tuple(motors[joint] for joint in own),
            )
        )
        if sphere.error > 0.2 * sphere.radius:
            notes.warn(
                f"the tip of {chain.name} is no sphere: one of {1e3 * sphere.radius:.1f} mm is off by up to "
                f"{1e3 * sphere.error:.1f} mm; [tip.{geom_name(before, chain.tip)}] centre, radius say better"
            )
    _standing_in_each_other(model, notes)
    renumbered = {
        now(c.follower): Coupling(now(c.follower), now(c.leader), c.ratio, c.offset, c.tendon) for c in couplings
    }
    return Hand(
        source, spec, model, tuple(fingers), renumbered, references, tuple(notes.changes), tuple(notes.warnings)
    )


def _standing_in_each_other(model: mujoco.MjModel, notes: Notes) -> None:
    """Warns of parts that stand in each other with every joint in the middle of its range."""
    data = mujoco.MjData(model)
    for joint in range(model.njnt):
        if model.jnt_limited[joint]:
            data.qpos[model.jnt_qposadr[joint]] = model.jnt_range[joint].mean()
    mujoco.mj_forward(model, data)
    for contact in data.contact[: data.ncon]:
        if contact.dist < -1e-3:
            a, b = (geom_name(model, int(g)) for g in contact.geom)
            notes.warn(f"{a} and {b} stand {-1e3 * contact.dist:.1f} mm in each other with the joints in mid-range")


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


__all__ = ["OURS", "Finger", "Hand", "compile_spec", "import_hand", "load_spec", "shown"]
