"""From a model's file to a hand: fingers, tips, motors, and what was changed and why."""

import os
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait._core import ConfigError
from fingergait.hand.chains import Chain, find_chains, geom_name
from fingergait.hand.couplings import Coupling, find_couplings
from fingergait.hand.facts import Facts, facts_beside
from fingergait.hand.motors import Motor, gear_at, motor_of, refuse_transmissions, tendon_share
from fingergait.hand.obstacle import Notes
from fingergait.hand.placing import name_everything, place
from fingergait.hand.rewrite import OURS, rewrite
from fingergait.hand.standing import part_what_stands_in_each_other
from fingergait.hand.tips import TipSphere, fit_tip
from fingergait.hand.urdf import urdf_spec

Array = NDArray[np.float64]


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
        if path.suffix.lower() == ".urdf":
            return urdf_spec(path, shown(path))
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
    name_everything(spec)
    placed = pose if pose is not None else known.pose
    if placed is not None:
        place(spec, placed)
    before = compile_spec(spec, source)
    chains, held = find_chains(before, known, notes)
    notes.settle(source)
    _check_joints(before, chains, known, notes)
    couplings = find_couplings(before, chains, known, notes)
    for name in known.joints:
        if mujoco.mj_name2id(before, mujoco.mjtObj.mjOBJ_JOINT, name) < 0:
            notes.obstacle(f"facts: joints.{name}", "a joint of the model", "none of that name", "correct the name")
    refuse_transmissions(before, chains, notes)
    motors = _motors(before, chains, couplings, known, notes)
    _check_springs(before, couplings, motors, known, notes)
    notes.settle(source)
    spheres = [fit_tip(before, chain.tip, chain.joints[-1]) for chain in chains]
    spheres = [_stated(before, chain, sphere, known) for chain, sphere in zip(chains, spheres, strict=True)]
    rewrite(spec, before, chains, held, couplings, motors, spheres, known, notes)
    part_what_stands_in_each_other(spec, compile_spec(spec, source), notes)
    model = compile_spec(spec, source)
    return _hand(source, spec, model, before, chains, couplings, motors, spheres, known, notes)


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
            # A tendon that drives followers too pulls at the leader with all its shares.
            tendons: dict[int, float] = {}
            for c in couplings:
                if c.leader == joint and c.tendon >= 0:
                    own = tendons.get(c.tendon, tendon_share(model, c.tendon, joint))
                    tendons[c.tendon] = own + c.ratio * tendon_share(model, c.tendon, c.follower)
            motor = motor_of(model, joint, tendons, facts, notes)
            if motor is not None:
                motors[joint] = motor
    return motors


def _check_springs(
    model: mujoco.MjModel, couplings: list[Coupling], motors: dict[int, Motor], facts: Facts, notes: Notes
) -> None:
    """Refuses springs that the motors can't hold everywhere, and what has no linear spring or damper."""
    leaders = {c.follower: c for c in couplings}
    for joint in {*motors, *leaders}:
        name, dof = model.joint(joint).name, int(model.jnt_dofadr[joint])
        where = f"the joint {name}"
        if np.any(model.jnt_stiffnesspoly[joint]) or np.any(model.dof_dampingpoly[dof]):
            found = "one with a polynomial"
            notes.obstacle(where, "a linear spring and damper", found, "give it stiffness and damping as one number")
        stiffness = float(model.jnt_stiffness[joint])
        if stiffness <= 0.0:
            continue
        rest = float(model.qpos_spring[model.jnt_qposadr[joint]])
        pull = sorted(stiffness * (float(angle) - rest) for angle in facts.of(name).range or model.jnt_range[joint])
        leader, ratio = joint, 1.0
        while leader in leaders:
            ratio, leader = ratio * leaders[leader].ratio, leaders[leader].leader
        low, high = sorted(torque * ratio for torque in pull)
        motor = motors.get(leader)
        if motor is not None and not (motor.low < low and high < motor.high):
            notes.obstacle(
                where,
                f"a spring (stiffness {stiffness:g} N m/rad, springref {rest:g} rad) that its motor can hold",
                f"{low:.2f} to {high:.2f} N m over its range, of {motor.low:g} to {motor.high:g} N m of the motor",
                f"make the spring softer, or narrow the range: [joints.{name}] range = [<lower>, <upper>]  # rad",
            )
        else:
            notes.change(f"{name}: its spring of {stiffness:g} N m/rad is compensated by its motor")


def _stated(model: mujoco.MjModel, chain: Chain, sphere: TipSphere, facts: Facts) -> TipSphere:
    """The sphere that the facts give, where they do."""
    body = model.body(int(model.geom_bodyid[chain.tip])).name
    for name in (chain.name, model.geom(chain.tip).name, body):
        if name in facts.tip:
            stated = facts.tip[name]
            return TipSphere(np.array(stated.centre), stated.radius, sphere.error)
    return sphere


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
    renumbered = {
        now(c.follower): Coupling(now(c.follower), now(c.leader), c.ratio, c.offset, c.tendon) for c in couplings
    }
    return Hand(
        source, spec, model, tuple(fingers), renumbered, references, tuple(notes.changes), tuple(notes.warnings)
    )


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


__all__ = ["OURS", "Finger", "Hand", "compile_spec", "import_hand", "load_spec", "shown"]
