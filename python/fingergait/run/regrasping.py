"""What a run that sets its object down says of itself: how far it turned in the air, and how well.

A turn counts only in the air. While the object lies it may be dragged, and that is no manipulation.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait._core import Diagnostics
from fingergait.run.log import Log
from fingergait.run.pose_error import pose_errors, yaw_reached

PHASES = Diagnostics.regrasp_phase_names()
LYING = frozenset({"release", "return", "approach", "preload", "check", "rest"})
"""Phases in which the support carries the object, or part of it."""
LEFT = frozenset({"stand", "rest"})
"""Phases in which the object is not taken any further: it is held where it is, or lies."""

_HELD = ("turn", "brake", "stand")
_CLEAR = 5e-4  # m above where the object lay at the start, from which on it is in the air


def regrasp_metrics(log: Log) -> dict[str, Any] | None:
    """Figures of regrasping, None where there was none.

    `set_downs`; `turned_in_air_rad`: net turn about the vertical while the object is in the air; `dragged_rad`: all
    turns while it is not, to either side; `duty_in_air`: share of the time in the air, from the first turn on;
    `max_position_error_in_air_m`, `max_orientation_error_in_air_rad`: against what the object is to do at each moment,
    while it is held in the air, neither on its way up nor down; `max_drift_on_support_m`: farthest that it moves across
    its support between one set-down and the next lift; `failed_grasps`; `ended`: the last phase.
    """
    phase = log["regrasp"].astype(int)
    begun = np.flatnonzero(phase > 0)
    if not len(begun):
        return None
    first = int(begun[0])
    pose, goal = log.pose("object"), log.block("governed")
    held = np.isin(phase, [PHASES.index(name) for name in _HELD])
    lifted = pose[:, 2] > pose[0, 2] + _CLEAR
    lies = np.isin(phase, [PHASES.index(name) for name in LYING])
    lower = phase == PHASES.index("lower")
    air = lifted & ~lies & ~lower & (phase > 0)
    turns = np.diff(yaw_reached(pose), prepend=0.0)
    errors = pose_errors(pose[held], goal[held])
    spans = _spans(lies)
    drifts = [np.linalg.norm(pose[a:b, :2] - pose[a, :2], axis=1).max() for a, b in spans]
    starts = np.flatnonzero((phase[1:] == PHASES.index("release")) & (phase[:-1] != phase[1:]))
    failed = sum(PHASES[phase[k]] != "lower" for k in starts)
    refused = (phase[1:] == PHASES.index("lower")) & (phase[:-1] == PHASES.index("lift"))
    return {
        "set_downs": int(log["set_downs"][-1]),
        "turned_in_air_rad": float(turns[air].sum()),
        "dragged_rad": float(np.abs(turns[lies]).sum()),
        "duty_in_air": float(air[first:].mean()),
        "max_position_error_in_air_m": float(np.linalg.norm(errors[:, :3], axis=1).max(initial=0.0)),
        "max_orientation_error_in_air_rad": float(np.linalg.norm(errors[:, 3:], axis=1).max(initial=0.0)),
        "max_drift_on_support_m": float(max(drifts, default=0.0)),
        "failed_grasps": int(failed + refused.sum()),
        "ended": PHASES[phase[-1]],
    }


def _spans(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last-plus-one sample of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
