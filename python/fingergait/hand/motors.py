"""Torque motors in place of whatever drives the joints, with the torque that counts: the one at the joint."""

from dataclasses import dataclass

import mujoco
import numpy as np

from fingergait.hand.facts import Facts
from fingergait.hand.obstacle import Notes

_LARGEST = 50.0  # N m: beyond, a limit is a placeholder and no motor of a hand


@dataclass(frozen=True)
class Motor:
    """Limits (N m) and lag (s) of the torque at one joint."""

    low: float
    high: float
    lag: float


def motor_of(model: mujoco.MjModel, joint: int, ratio: float, facts: Facts, notes: Notes) -> Motor | None:
    """The torque motor of `joint`: the smallest of all limits that the model and the facts state.

    `ratio` is the joint's share of a tendon that drives it, see `couplings`; 1 for its own actuator. None where an
    obstacle was noted.
    """
    name = model.joint(joint).name
    own = facts.of(name)
    low, high, lag, drives = -np.inf, np.inf, 0.0, []
    for actuator in range(model.nu):
        gear = gear_at(model, actuator, joint)
        if gear == 0.0:
            continue
        drives.append(actuator)
        limits = _force_limits(model, actuator, notes)
        if limits is None:
            continue
        a, b = sorted((limits[0] * gear * ratio, limits[1] * gear * ratio))
        low, high = max(low, a), min(high, b)
        lag = max(lag, _lag(model, actuator))
    if model.jnt_actfrclimited[joint]:
        low, high = max(low, float(model.jnt_actfrcrange[joint, 0])), min(high, float(model.jnt_actfrcrange[joint, 1]))
    if own.torque is not None:
        a, b = own.torque if isinstance(own.torque, tuple) else (-own.torque, own.torque)
        if max(-low, high) > _LARGEST:
            low, high = a, b
        low, high = max(low, a), min(high, b)
    label = ", ".join(_actuator_name(model, a) for a in drives)
    where = f"the motor {label}" if drives else f"the joint {name}"
    remedy = f"write in the facts file: torque = <N m> for all motors, or [joints.{name}] torque = <N m>"
    if not (np.isfinite(low) and np.isfinite(high)):
        expected = "a torque limit (forcerange, actuatorfrcrange, or ctrlrange of a plain motor)"
        notes.obstacle(where, expected, "none", remedy)
        return None
    if max(-low, high) > _LARGEST:
        notes.obstacle(where, f"a torque limit of a motor, at most {_LARGEST:g} N m", f"{max(-low, high):g}", remedy)
        return None
    if not low < 0.0 < high:
        notes.obstacle(where, "a torque in both directions", f"{low:g} to {high:g} N m", remedy)
        return None
    return Motor(float(low), float(high), float(own.lag if own.lag is not None else lag))


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


def _force_limits(model: mujoco.MjModel, actuator: int, notes: Notes) -> tuple[float, float] | None:
    """Least and largest force that an actuator can exert by what its own ranges say; None: nothing usable is known."""
    name = _actuator_name(model, actuator)
    if model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_MUSCLE:
        notes.obstacle(
            f"the actuator {name}", "a motor or servo", "a muscle", "replace it by a motor on the joint it moves"
        )
        return None
    low, high = -np.inf, np.inf
    if model.actuator_forcelimited[actuator]:
        low, high = map(float, model.actuator_forcerange[actuator])
    fixed = model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
    plain = fixed and model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
    if plain and model.actuator_dyntype[actuator] != mujoco.mjtDyn.mjDYN_INTEGRATOR:
        gain = float(model.actuator_gainprm[actuator, 0])
        ranges = [("ctrl", model.actuator_ctrllimited[actuator], model.actuator_ctrlrange[actuator])]
        ranges.append(("act", model.actuator_actlimited[actuator], model.actuator_actrange[actuator]))
        for _, limited, span in ranges:
            if limited:
                a, b = sorted((gain * float(span[0]), gain * float(span[1])))
                low, high = max(low, a), min(high, b)
    else:
        notes.change(f"{name}: a {_kind(model, actuator)} becomes a torque motor")
    return low, high


def _kind(model: mujoco.MjModel, actuator: int) -> str:
    if model.actuator_plugin[actuator] >= 0:
        return "plugin"
    gain, bias = model.actuator_gainprm[actuator], model.actuator_biasprm[actuator]
    if bias[1] != 0.0:
        return "position servo"
    return "velocity servo" if bias[2] != 0.0 and gain[0] != 0.0 else "general actuator"


def _lag(model: mujoco.MjModel, actuator: int) -> float:
<<<<<<< HEAD
    kind = int(model.actuator_dyntype[actuator])
    if kind in (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT)):
=======
    kind = int(model.actuator_dyntype[actuator])  # NumPy's own integers are in no tuple of enums
    if kind in (mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT):
>>>>>>> 8da23f6 (Read the motors' lag, and leave motors without one alone)
        return float(model.actuator_dynprm[actuator, 0])
    return 0.0


def _actuator_name(model: mujoco.MjModel, actuator: int) -> str:
    return str(model.actuator(actuator).name) or f"number {actuator}"
