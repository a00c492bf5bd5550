"""Which limit of the hand, the contacts or the planner became active first before an object was lost."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait.hand import import_hand
from fingergait.paths import find
from fingergait.run.log import Log
from fingergait.scenario import Scenario

Flags = NDArray[np.bool_]

_WINDOW = 0.5  # s over which a constraint's activity is averaged
_ACTIVE = 0.25  # share of the window in which an active constraint holds
_GAIT_SHARE = 0.97  # share of two seconds spent in gaits from which on there is none to spare
_GAIT_WINDOW = 2.0  # s
_NEAR_LIMIT = np.deg2rad(1.0)
_SLIP = 0.02  # m/s
_SLACK_FORCE, _SLACK_TORQUE = 0.5, 0.02  # N, N m
_GAIT_ABORT = 4  # of the core's GaitEnd

WORDS = {
    "joint": "a joint reached its limit",
    "torque": "joint torques reached their limit",
    "wrench": "the contacts fell short of the wrench asked for (friction cone and torque limits)",
    "slip": "a holding finger slid",
    "friction": "the assumed friction was lowered to its floor",
    "gait time": "no gait time was left to spare",
    "abort": "gaits were broken off",
}
"""Each constraint in words."""


def active_constraints(log: Log, scenario: Scenario) -> list[dict[str, Any]]:
    """The constraints that became active in a run, in the order in which they did.

    A constraint is active from the first time that it holds in a quarter of half a second.

    Returns
    -------
    list of dict
        `name`, a key of `WORDS`; `at_s`, when; `share`, of the time from then on.
    """
    since = log.t >= max(0.0, scenario.reference.lift_at)
    period = scenario.period
    found = []
    for name, flags in _flags(log, scenario).items():
        flags = flags & since
        window = _GAIT_WINDOW if name == "gait time" else _WINDOW
        level = _GAIT_SHARE if name == "gait time" else _ACTIVE
        onset = _onset(flags, max(1, round(window / period)), level)
        if onset is not None:
            found.append({"name": name, "at_s": float(log.t[onset]), "share": float(flags[onset:].mean())})
    return sorted(found, key=lambda item: float(item["at_s"]))


def _flags(log: Log, scenario: Scenario) -> dict[str, Flags]:
    path = find(scenario.hand.file, "", ".xml", "hand.file")
    hand = import_hand(path)
    model, fingers = hand.model, hand.fingers
    lower, upper = model.jnt_range[[joint for finger in fingers for joint in finger.joints]].T
    torque = np.abs(model.actuator_forcerange[[motor for finger in fingers for motor in finger.actuators]]).min(axis=1)
    torque = np.minimum(torque, scenario.force.get("tau_max", np.inf))
    q, psi = log.block("q"), log.block("psi")
    holding = np.arange(len(fingers)) != log["free_finger"][:, None]
    short = np.linalg.norm(psi[:, :3], axis=1) > _SLACK_FORCE
    short |= np.linalg.norm(psi[:, 3:], axis=1) > _SLACK_TORQUE
    gaiting = log["free_finger"] >= 0.0
    friction = log["friction"]
    ended = np.diff(log["gait_end"], prepend=log["gait_end"][0]) != 0.0
    return {
        "joint": np.asarray(((q < lower + _NEAR_LIMIT) | (q > upper - _NEAR_LIMIT)).any(axis=1)),
        "torque": np.asarray((np.abs(log.block("tau_des")) >= 0.999 * torque).any(axis=1)),
        "wrench": short,
        "slip": np.asarray(((np.abs(log.block("slip")) > _SLIP) & holding).any(axis=1)),
        "friction": friction <= min(0.999 * scenario.controller.friction, friction.min() * 1.001),
        "gait time": gaiting,
        "abort": _held(ended & (log["gait_end"] == _GAIT_ABORT), round(_WINDOW / scenario.period)),
    }


def _held(events: Flags, rows: int) -> Flags:
    """True from each event on for `rows` samples."""
    counts = np.cumsum(events)
    return np.asarray(counts - np.concatenate([np.zeros(min(rows, len(counts))), counts[:-rows]]) > 0)


def _onset(flags: Flags, window: int, level: float) -> int | None:
    """First row of the first window in which `flags` holds in more than `level` of the rows."""
    if len(flags) < window:
        return None
    sums = np.concatenate([[0], np.cumsum(flags)])
    busy = np.flatnonzero(sums[window:] - sums[:-window] > level * window)
    return int(busy[0]) if len(busy) else None


def explain(constraints: list[dict[str, Any]]) -> str:
    """The first constraint in words, with its time; and the next one."""
    if not constraints:
        return "no limit of the joints, torques, friction or gait time became active"
    words = [f"{WORDS[item['name']]} at {item['at_s']:.1f} s" for item in constraints[:2]]
    return ", then ".join(words)
