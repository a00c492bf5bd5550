"""Whether a run did what was asked of it, and where it did not: what happened, and what to do about it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait._core import Diagnostics
from fingergait.run.log import Log
from fingergait.run.pose_error import pose_errors, yaw_reached
from fingergait.run.regrasping import LEFT, PHASES
from fingergait.scenario import Scenario

POSITION_REACHED = 0.010  # m
ANGLE_REACHED = 0.1  # rad

MODES = Diagnostics.safe_mode_names()
FAULTS = Diagnostics.fault_names()


@dataclass(frozen=True)
class _Cause:
    """What a fault means, and its remedy, both as parts of a sentence; fields of a scenario may be named in them."""

    what: str
    remedy: str


_LOAD = "the fingers cannot carry {mass:g} kg at the assumed friction {friction:g} with the torques that they have"
_LIGHTEN = "raise controller.friction if the contact is better than that, lower object.mass, or ask for less speed"

# The first that is present is the one to tell: a fault of a sensor explains those of the grasp below it.
_CAUSES = {
    "pose_frame": _Cause(
        "the object's pose does not fit the touching fingertips: its origin is not among their contacts",
        "give the pose in the hand's frame (check the camera's calibration), and of the object that is held",
    ),
    "tactile_axes": _Cause(
        "the normals that the tactile sensors tell point away from each other",
        "check the axes and signs of the contact places: they are in the fingertip's frame, from the tip's centre",
    ),
    "tactile_scale": _Cause(
        "the tactile sensors contradict the joint torques",
        "check the tactile sensors' unit (N), and unit (N m) and sign of the joint torques",
    ),
    "tactile_lost": _Cause(
        "fingertips press on something and feel nothing", "check that the tactile sensors are connected"
    ),
    "tactile_stuck": _Cause(
        "tactile sensors read full scale or stand still", "check the tactile sensors' unit (N) and connection"
    ),
    "tactile": _Cause("tactile readings are impossible", "check the tactile sensors' unit (N), axes and frame"),
    "encoder_stuck": _Cause("encoders stand still while their fingers move", "check that every joint is read"),
    "encoder": _Cause("joint angles are missing or impossible", "check that every joint is read in every step, in rad"),
    "clock": _Cause("the measurement's time stands still or jumps", "check the clock"),
    "late": _Cause("control steps come late", "check the machine's load, or lower controller.rate_hz"),
    "pose": _Cause("the object's pose is no pose, or out of reach", "check the pose sensor and its frame"),
    "pose_jump": _Cause("the object's pose left the place where the fingers hold it", "check the pose sensor"),
    "pose_stale": _Cause("the object's pose stands still while it moves", "check the pose sensor's connection"),
    "reference": _Cause("the reference is no pose, or out of reach", "check the reference"),
    "motor": _Cause("a joint is asked for a torque and gives none", "check the motors' power and torque sensors"),
    "contacts_lost": _Cause(
        "no finger felt the object any more",
        "check the tactile sensors' axes and connection, and grasp, friction and mass",
    ),
    "finger_lost": _Cause("a finger looked for the object and did not find it", "check the tip's reach and sensor"),
    "torque_box": _Cause(
        "joints need more torque for their own weight and motion than they have", "check the torque limits"
    ),
    "aground": _Cause(
        "the object was set down and could not be taken again, or no support was found below it (aground)",
        "see that the fingers reach all round it where it lies, and that it is lifted off a level support",
    ),
    "overdue": _Cause(f"no finger could be freed (overdue): without it {_LOAD}", _LIGHTEN),
    "saturated": _Cause(f"torques were at their limit, or the wrench undeliverable (saturated): {_LOAD}", _LIGHTEN),
    "solver": _Cause("no solver certified contact forces", "report this with the log"),
}


def verdict(log: Log, scenario: Scenario, dropped: bool) -> dict[str, Any]:
    """The figures of `run --json` that say whether the task was done.

    `completed`: not dropped or let go; at the end it is within 10 mm and 0.1 rad of the reference, and turned by
    what was asked to 0.1 rad. Of an object that is set down and taken again while the reference turns, the turn is
    asked while it is held, less what it missed while it lay; one that was left lying is not completed.
    `asked_rotation_rad`: net turn of the reference up to the end, the integral of its rate with its step.
    `turned_rad`: that of the object, about the same axis. `worst_safe_mode`, `safe_mode_fraction`, `faults`: names,
    and share of the control steps after t = 0. `goals_reached`: None, as the reference has no goals. `link_contacts`:
    control steps in which a part of a finger other than its tip touched the object.
    `incomplete_reason`: words, None where completed.
    """
    t = log.t
    goal = _goal(log)
    errors = pose_errors(log.pose("object")[-1:], goal[-1:])[0]
    asked, due = float(yaw_reached(log.pose("desired"))[-1]), float(yaw_reached(goal)[-1])
    turned = float(yaw_reached(log.pose("object"))[-1])
    position, angle = float(np.linalg.norm(errors[:3])), float(np.linalg.norm(errors[3:]))
    # Errors of orientation are those of less than half a turn; the turn itself counts whole ones.
    reached = position <= POSITION_REACHED and angle <= ANGLE_REACHED and abs(turned - due) <= ANGLE_REACHED
    modes = log["safe_mode"][t >= 0.0] if t[-1] >= 0.0 else log["safe_mode"]
    seen = np.bitwise_or.reduce(log["faults"].astype(np.int64))
    # Whoever holds nothing has not done anything, wherever the object happens to be.
    left = PHASES[int(log["regrasp"][-1])] in LEFT
    completed = reached and not dropped and not left and MODES[int(log["safe_mode"][-1])] != "stop"
    return {
        "completed": completed,
        "incomplete_reason": None if completed else explain(log, scenario, position, due, turned, angle),
        "asked_rotation_rad": asked,
        "turned_rad": turned,
        "worst_safe_mode": MODES[int(log["safe_mode"].max())],
        "safe_mode_fraction": float((modes > 0.0).mean()),
        "faults": [name for bit, name in enumerate(FAULTS) if seen >> bit & 1],
        "goals_reached": None,
        "link_contacts": int(log["link_contact"].sum()),
    }


def _goal(log: Log) -> NDArray[np.float64]:
    """Pose (T, 7) that the object is to have at each moment: what is asked, less what it may still miss."""
    desired = log.pose("desired")
    turns = len(desired) > 1 and abs(float(np.diff(yaw_reached(desired[-2:]))[-1])) > 1e-6
    return np.where(log["regrasp"][:, None] > 0.0, log.block("governed"), desired) if turns else desired


def explain(log: Log, scenario: Scenario, position: float, asked: float, turned: float, angle: float) -> str:
    """Why the task was not done: what is missing, since when which mode, its reason, and what to do."""
    missing = []
    if abs(turned - asked) > ANGLE_REACHED:
        missing.append(f"turned {np.rad2deg(turned):.0f} of {np.rad2deg(asked):.0f} degrees")
    elif angle > ANGLE_REACHED:
        missing.append(f"{angle:.2f} rad off the reference at the end")
    if position > POSITION_REACHED:
        missing.append(f"{1e3 * position:.0f} mm off the reference at the end")
    return "; ".join([*([", ".join(missing)] if missing else []), standing(log, scenario)])


def standing(log: Log, scenario: Scenario) -> str:
    """In which mode the controller ended, since when, why, and what to do; of the last such time where it went on."""
    modes = log["safe_mode"]
    abnormal = np.flatnonzero(modes > 0.0)
    if not len(abnormal):
        return "the controller followed the reference throughout and the object did not; look at forces.png and torques"
    last = int(abnormal[-1])
    before = np.flatnonzero(modes[:last] == 0.0)
    first = int(before[-1]) + 1 if len(before) else 0
    present = _present(log["faults"], first, last)
    text = (
        f"stood still from {log.t[first]:.1f} s"
        if last == len(modes) - 1
        else (f"stood still from {log.t[first]:.1f} to {log.t[last]:.1f} s")
    )
    if log["threshold"][last] != log["threshold"][last] and MODES[int(modes[last])] == "stop":
        text = "refused at the start, nothing was driven"
    cause = next((cause for name, cause in _CAUSES.items() if name in present), None)
    if cause is None:
        return f"{text} (mode {MODES[int(modes[last])]})"
    fill = {"mass": scenario.object.mass, "friction": scenario.controller.friction}
    return f"{text} (mode {MODES[int(modes[last])]}): {cause.what.format(**fill)}; {cause.remedy}"


def _present(faults: NDArray[np.float64], first: int, last: int) -> set[str]:
    """Faults in at least a tenth of these rows, by name; all of them where none is."""
    bits = faults[first : last + 1].astype(np.int64)
    shares = {name: float((bits >> bit & 1).mean()) for bit, name in enumerate(FAULTS)}
    often = {name for name, share in shares.items() if share >= 0.1}
    return often or {name for name, share in shares.items() if share > 0.0}
