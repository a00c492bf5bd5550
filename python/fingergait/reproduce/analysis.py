"""Figures of a run that only the reproduction needs, and the thinned signals that its plots show."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait.reproduce.constraint import active_constraints
from fingergait.reproduce.gaits import gait_figures
from fingergait.run.log import Log
from fingergait.run.metrics import CHANNELS
from fingergait.run.pose_error import pose_errors
from fingergait.scenario import Disturbance, Scenario

Array = NDArray[np.float64]

GRAVITY_LIMIT = 5e-4  # m: the gravity mismatch that must be gone
_LIFTED = 1e-4  # m: an object this far above its start has left the palm
_SAMPLES = 12000  # of a trace
_AFTER = 2.0  # s after a pulse in which its peak is sought


def analyse(log: Log, scenario: Scenario) -> dict[str, Any]:
    """The figures of one run.

    Returns
    -------
    dict
        `overshoot`: largest overshoot of a stepped channel, fraction of its step; `gravity_recovery_s`: time from
        lift-off until the vertical error stays under 0.5 mm; `pulses`: for each disturbance the peak errors (m, rad)
        and whether a finger was free in it; `height_drift_m`: change of the mean contact height between the middle
        and the last third of the run; `gaits`: see `gaits.gait_figures`; `constraints`: see `active_constraints`.
    """
    errors = pose_errors(log.pose("object"), log.pose("desired"))
    return {
        "overshoot": _overshoot(log.t, errors, scenario),
        "gravity_recovery_s": _gravity_recovery(log, errors[:, 2]),
        "pulses": [_pulse(log, errors, pulse) for pulse in scenario.disturbance],
        "height_drift_m": _height_drift(log, scenario.metrics_from),
        "gaits": gait_figures(log, scenario.metrics_from),
        "constraints": active_constraints(log, scenario),
    }


def trace_of(log: Log) -> dict[str, Array]:
    """Time, errors, quality and phases of a log, at most some thousand samples each, by name."""
    stride = max(1, len(log) // _SAMPLES)
    errors = pose_errors(log.pose("object"), log.pose("desired"))
    signals = {f"e_{channel}": errors[:, index] for index, channel in enumerate(CHANNELS)}
    names = ("Q", "threshold", "Q_dot", "free_finger", "phase", "gaits", "friction")
    signals |= {"t": log.t, **{name: log[name] for name in names}}
    signals["height"] = log.block("height").mean(axis=1)
    signals["height_spread"] = np.ptp(log.block("height"), axis=1)
    return {name: np.ascontiguousarray(values[::stride]) for name, values in signals.items()}


def _overshoot(t: Array, errors: Array, scenario: Scenario) -> float | None:
    step = np.array(scenario.reference.step)
    stepped = np.flatnonzero(step)
    after = t >= scenario.reference.step_at
    if not len(stepped) or not after.any():
        return None
    return float(max(0.0, (-errors[after][:, stepped] / step[stepped]).max()))


def _gravity_recovery(log: Log, error: Array) -> float | None:
    height = log["object_z"] - log["object_z"][0]
    lifted = np.flatnonzero((log.t >= 0.0) & (height > _LIFTED))
    if not len(lifted):
        return None
    begin = int(lifted[0])
    outside = np.flatnonzero(np.abs(error[begin:]) > GRAVITY_LIMIT)
    if not len(outside):
        return 0.0
    return None if outside[-1] == len(error) - begin - 1 else float(log.t[begin + outside[-1] + 1] - log.t[begin])


def _pulse(log: Log, errors: Array, pulse: Disturbance) -> dict[str, Any]:
    window = (log.t >= pulse.at) & (log.t < pulse.at + pulse.duration + _AFTER)
    during = (log.t >= pulse.at) & (log.t < pulse.at + pulse.duration)
    if not window.any():
        return {"position_m": None, "orientation_rad": None, "in_gait": False}
    return {
        "position_m": float(np.linalg.norm(errors[window, :3], axis=1).max()),
        "orientation_rad": float(np.linalg.norm(errors[window, 3:], axis=1).max()),
        "in_gait": bool((log["free_finger"][during] >= 0.0).any()),
    }


def _height_drift(log: Log, since: float) -> float | None:
    counted = log.t >= since
    heights = log.block("height")[counted].mean(axis=1)
    third = len(heights) // 3
    return float(heights[-third:].mean() - heights[third : 2 * third].mean()) if third else None
