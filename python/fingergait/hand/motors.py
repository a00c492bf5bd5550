"""Torque motors in place of whatever drives the joints, with the torque that counts: the one at the joint."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait.hand.chains import Chain
from fingergait.hand.facts import Facts
from fingergait.hand.obstacle import Notes

_LARGEST = 50.0  # N m: beyond, a limit is a placeholder and no motor of a hand


@dataclass(frozen=True)
class Motor:
    """Limits (N m) and lag (s) of the torque at one joint."""

    low: float
    high: float
    lag: float


def motor_of(model: mujoco.MjModel, joint: int, tendons: dict[int, float], facts: Facts, notes: Notes) -> Motor | None:
    """The torque motor of `joint`: the smallest of all limits that the model and the facts state.

    What drives one joint together adds up. `tendons`: torque at the joint for a unit of force of the tendons that drive
    it with the joints that follow it. None where an obstacle was noted.
    """
    name = model.joint(joint).name
    own = facts.of(name)
    low, high, lag, drives = 0.0, 0.0, 0.0, []
    for actuator in range(model.nu):
        gear = gear_at(model, actuator, joint)
        if gear == 0.0:
            continue
        if model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_TENDON:
            tendon = int(model.actuator_trnid[actuator, 0])
            gear = tendons.get(tendon, gear / float(model.actuator_gear[actuator, 0]))
            gear *= float(model.actuator_gear[actuator, 0])
        drives.append(actuator)
        limits = _force_limits(model, actuator, notes)
        a, b = sorted((limits[0] * gear, limits[1] * gear))
        low, high, lag = low + a, high + b, max(lag, _lag(model, actuator))
    stated, capped = "forcerange, ctrlrange and gear", False
    if not drives:
        low, high = -np.inf, np.inf
    if model.jnt_actfrclimited[joint]:
        a, b = map(float, model.jnt_actfrcrange[joint])
        if drives and (a > low or b < high):
            stated, capped = "actuatorfrcrange", True
        low, high = max(low, a), min(high, b)
    where = f"the motor {', '.join(_actuator_name(model, a) for a in drives)}" if drives else f"the joint {name}"
    remedy = f"write in the facts file: torque = <N m> for all motors, or [joints.{name}] torque = <N m>"
    if own.torque is not None:
        a, b = own.torque if isinstance(own.torque, tuple) else (-own.torque, own.torque)
        if max(-low, high) > _LARGEST:
            low, high = a, b
        low, high = max(low, a), min(high, b)
    elif not drives and model.nu and not model.jnt_actfrclimited[joint]:
        remedy += f', or couple it: [joints.{name}] follows = "<joint>", or hold it: [joints.{name}] held = <rad>'
        notes.obstacle(where, "a motor, or another joint that it follows", "neither", remedy)
        return None
    if not (np.isfinite(low) and np.isfinite(high)):
        expected = "a torque limit (forcerange, actuatorfrcrange, or ctrlrange of a motor without a lag)"
        notes.obstacle(where, expected, "none", remedy)
        return None
    if max(-low, high) > _LARGEST:
        notes.obstacle(where, f"a torque limit of a motor, at most {_LARGEST:g} N m", f"{max(-low, high):g}", remedy)
        return None
    if not low < 0.0 < high:
        notes.obstacle(where, "a torque in both directions", f"{low:g} to {high:g} N m ({stated})", remedy)
        return None
    if len(drives) > 1:
        notes.change(f"{name}: its {len(drives)} actuators become one torque motor")
    if capped or any(abs(gear_at(model, a, joint)) != 1.0 or _narrow(model, a) for a in drives):
        notes.change(f"{name}: {low:g} to {high:g} N m at the joint, by {stated}")
    return Motor(float(low), float(high), float(own.lag if own.lag is not None else lag))


def refuse_transmissions(model: mujoco.MjModel, chains: list[Chain], notes: Notes) -> None:
    """Notes actuators that act on the fingers otherwise than at joints: none of them is dropped unseen."""
    kinds = mujoco.mjtTrn
    bodies = {int(model.jnt_bodyid[joint]) for chain in chains for joint in chain.joints}
    for actuator in range(model.nu):
        kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator, 0])
        if kind in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT, kinds.mjTRN_TENDON):
            continue
        body = target if kind == kinds.mjTRN_BODY else int(model.site_bodyid[target])
        name = mujoco.mjtTrn(kind).name.removeprefix("mjTRN_").lower()
        where, remedy = f"the actuator {_actuator_name(model, actuator)}", "replace it by motors on the joints it moves"
        while body and body not in bodies:
            body = int(model.body_parentid[body])
        if body:
            notes.obstacle(where, "an actuator on a joint or a fixed tendon", f"one on a {name}", remedy)
        else:
            notes.change(f"{where} acts on no finger and is taken out")


def reflected_armature(model: mujoco.MjModel, joint: int) -> float:
    """Inertia, kg m^2, that the armature of the joint's actuators has at the joint."""
    gears = [(gear_at(model, a, joint), float(model.actuator_armature[a])) for a in range(model.nu)]
    return sum(gear * gear * armature for gear, armature in gears)


def gear_at(model: mujoco.MjModel, actuator: int, joint: int) -> float:
    """Torque at `joint` for one unit of the actuator's force; zero where it doesn't drive the joint."""
    kind, gear = int(model.actuator_trntype[actuator]), float(model.actuator_gear[actuator, 0])
    if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
        return gear if int(model.actuator_trnid[actuator, 0]) == joint else 0.0
    if kind == mujoco.mjtTrn.mjTRN_TENDON:
        return gear * tendon_share(model, int(model.actuator_trnid[actuator, 0]), joint)
    return 0.0


def tendon_share(model: mujoco.MjModel, tendon: int, joint: int) -> float:
    """Coefficient of `joint` in a fixed tendon; zero where it has none."""
    first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    for wrap in range(first, first + count):
        if model.wrap_type[wrap] == mujoco.mjtWrap.mjWRAP_JOINT and int(model.wrap_objid[wrap]) == joint:
            return float(model.wrap_prm[wrap])
    return 0.0


def _force_limits(model: mujoco.MjModel, actuator: int, notes: Notes) -> tuple[float, float]:
    """Least and largest force that an actuator can exert by what its own ranges say; infinite where they don't."""
    name = _actuator_name(model, actuator)
    if mujoco.mjtDyn.mjDYN_MUSCLE == int(model.actuator_dyntype[actuator]) or (
        mujoco.mjtGain.mjGAIN_MUSCLE == int(model.actuator_gaintype[actuator])
    ):
        notes.obstacle(
            f"the actuator {name}", "a motor or servo", "a muscle", "replace it by a motor on the joint it moves"
        )
        return -1.0, 1.0
    low, high = -np.inf, np.inf
    if model.actuator_forcelimited[actuator]:
        low, high = map(float, model.actuator_forcerange[actuator])
    fixed = mujoco.mjtGain.mjGAIN_FIXED == int(model.actuator_gaintype[actuator])
    if fixed and mujoco.mjtBias.mjBIAS_NONE == int(model.actuator_biastype[actuator]):
        gain = float(model.actuator_gainprm[actuator, 0])
        dynamics = int(model.actuator_dyntype[actuator])
        if dynamics in (mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT) or _integrates(model, actuator):
            if model.actuator_actlimited[actuator]:
                low, high = _within(low, high, gain, model.actuator_actrange[actuator])
            # The range of a command that a lag follows says what may be asked for: alone not what the motor gives.
            if np.isfinite(low) and model.actuator_ctrllimited[actuator] and not _integrates(model, actuator):
                low, high = _within(low, high, gain, model.actuator_ctrlrange[actuator])
            return low, high
        if dynamics == mujoco.mjtDyn.mjDYN_NONE:
            if model.actuator_ctrllimited[actuator]:
                low, high = _within(low, high, gain, model.actuator_ctrlrange[actuator])
            return low, high
    damping = -float(model.actuator_biasprm[actuator, 2])
    without = f", without its damping of {damping:g} N m s/rad" if damping > 0.0 else ""
    notes.change(f"{name}: a {_kind(model, actuator)} becomes a torque motor{without}")
    return low, high


def _within(low: float, high: float, gain: float, span: NDArray[np.float64]) -> tuple[float, float]:
    a, b = sorted((gain * float(span[0]), gain * float(span[1])))
    return max(low, a), min(high, b)


def _integrates(model: mujoco.MjModel, actuator: int) -> bool:
    return bool(mujoco.mjtDyn.mjDYN_INTEGRATOR == int(model.actuator_dyntype[actuator]))


def _narrow(model: mujoco.MjModel, actuator: int) -> bool:
    """True where the command's range and not the force's limits the torque."""
    if not (model.actuator_ctrllimited[actuator] and model.actuator_forcelimited[actuator]):
        return False
    gain = abs(float(model.actuator_gainprm[actuator, 0]))
    if mujoco.mjtBias.mjBIAS_NONE != int(model.actuator_biastype[actuator]):
        return False
    asked, given = gain * model.actuator_ctrlrange[actuator], model.actuator_forcerange[actuator]
    return bool(asked[1] < given[1] or asked[0] > given[0])


def _kind(model: mujoco.MjModel, actuator: int) -> str:
    if model.actuator_plugin[actuator] >= 0:
        return "plugin"
    gain, bias = model.actuator_gainprm[actuator], model.actuator_biasprm[actuator]
    if bias[1] != 0.0:
        return "position servo"
    return "velocity servo" if bias[2] != 0.0 and gain[0] != 0.0 else "general actuator"


def _lag(model: mujoco.MjModel, actuator: int) -> float:
    kind = int(model.actuator_dyntype[actuator])  # NumPy's own integers are in no tuple of enums
    if kind in (mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT):
        return float(model.actuator_dynprm[actuator, 0])
    return 0.0


def _actuator_name(model: mujoco.MjModel, actuator: int) -> str:
    return str(model.actuator(actuator).name) or f"number {actuator}"
