"""The figures of a run, from its log: errors, settling and recovery times, gaits, quality, time of a step."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait.run.log import Log
from fingergait.run.pose_error import pose_errors, yaw_reached
from fingergait.run.regrasping import regrasp_metrics
from fingergait.run.verdict import verdict
from fingergait.scenario import Disturbance, Scenario

Array = NDArray[np.float64]

CHANNELS = ("x", "y", "z", "rx", "ry", "rz")
SETTLED = 0.05  # of the step, the paper's threshold
RECOVERED = 0.10  # of the peak
_BEFORE = 1.0  # s before a pulse that say how large the error was without it; a gait takes about as long
_STAYED = 0.3  # s that the error must stay back: longer than K swings, shorter than until a later gait brings its own
_AFTER = 2.0  # s after a pulse in which its peak and recovery are sought, unless the next one begins


@dataclass(frozen=True)
class Timing:
    """Time that the control steps took in the core (ns, one a step), wall-clock time of the run (s), and the number of
    steps that each solver answered."""

    step_ns: NDArray[np.int64]
    wall_s: float
    solver: dict[str, int] = field(default_factory=dict)


def metrics_of(
    log: Log, scenario: Scenario, lost: str | None, timing: Timing, tau_max: Array | float
) -> dict[str, Any]:
    """The figures of `fingergait run --json`, without paths, versions and simulator settings.

    `lost` says why the object was lost, if it was; `tau_max` is the torque limit of each joint, (n_q,) or one,
    N m.
    """
    t = log.t
    errors = pose_errors(log.pose("object"), log.pose("desired"))  # (T, 6)
    position, orientation = np.linalg.norm(errors[:, :3], axis=1), np.linalg.norm(errors[:, 3:], axis=1)
    counted = t >= scenario.metrics_from
    return {
        "scenario": scenario.name,
        "seed": scenario.seed,
        "duration_s": float(t[-1]) + scenario.period,
        "dropped": lost is not None,
        **verdict(log, scenario, lost is not None),
        "lost_reason": lost,
        "rotation_rad": float(yaw_reached(log.pose("object"))[-1]),
        "metrics_from_s": scenario.metrics_from,
        "max_position_error_m": _over(np.max, position[counted]),
        "max_orientation_error_rad": _over(np.max, orientation[counted]),
        "rms_position_error_m": _over(_rms, position[counted]),
        "rms_orientation_error_rad": _over(_rms, orientation[counted]),
        "settling_time_s": settling_times(t, errors, scenario.reference.step, scenario.reference.step_at),
        "recovery_time_s": [
            recovery_time(t, position, orientation, pulse, _next_start(scenario, pulse))
            for pulse in scenario.disturbance
        ],
        **gait_metrics(log, scenario),
        "regrasp": regrasp_metrics(log),
        "saturated_fraction": saturated_fraction(log, scenario, tau_max),
        "deadline_misses": int((timing.step_ns > 1e9 * scenario.period).sum()),
        "solver": timing.solver,
        "step_us": step_times(timing.step_ns),
        "real_time_factor": len(log) * scenario.period / timing.wall_s,
    }


def settling_times(t: Array, errors: Array, step: tuple[float, ...], at: float) -> dict[str, float | None]:
    """Time from the step until each stepped channel's error stays within 5 % of its step, s.

    Parameters
    ----------
    t, errors
        Times (T,) and pose errors (T, 6).
    step, at
        Step of each channel, m and rad, and its time, s.

    Returns
    -------
    dict
        One time a channel and their `max`; None where the channel isn't stepped or never settles.
    """
    times: dict[str, float | None] = dict.fromkeys(CHANNELS)
    after = t >= at
    for index, channel in enumerate(CHANNELS):
        if step[index] != 0.0:
            outside = np.abs(errors[after, index]) > SETTLED * abs(step[index])
            times[channel] = _last_true(t[after], outside, at)
    stepped = [times[channel] for index, channel in enumerate(CHANNELS) if step[index] != 0.0]
    settled = [time for time in stepped if time is not None]
    times["max"] = max(settled) if settled and len(settled) == len(stepped) else None
    return times


def recovery_time(t: Array, position: Array, orientation: Array, pulse: Disturbance, until: float) -> float | None:
    """Time from a pulse's end until the error it caused has gone, s; None where it hasn't by `until`.

    Gone: back under the largest error of the second before the pulse plus 10 % of the peak above it, and there for
    0.3 s: what a gait brings later is not the pulse's. A force is judged by the position error (T,), a torque by the
    orientation error (T,), both by the later of the two.
    """
    times = []
    for error, cause in ((position, pulse.force), (orientation, pulse.torque)):
        if not any(cause):
            continue
        before = error[(t >= pulse.at - _BEFORE) & (t < pulse.at)]
        window = (t >= pulse.at) & (t < min(until, pulse.at + pulse.duration + _AFTER))
        if not before.size or not window.any():
            return None
        level = before.max()
        limit = level + RECOVERED * max(0.0, error[window].max() - level)
        after = window & (t >= pulse.at + pulse.duration)
        time = _back(t[after], error[after] > limit)
        if time is None:
            return None
        times.append(time)
    return max(times, default=None)


def gait_metrics(log: Log, scenario: Scenario) -> dict[str, Any]:
    """Number and length of the gaits, and what they did to the grasp quality.

    `qdot_positive_fraction` is of the LP's prediction; `quality_gain_fraction` of whole gaits, by the measured Q before
    and after each.
    """
    t, free, quality = log.t, log["free_finger"], log["Q"]
    counted = t >= scenario.metrics_from
    predicted = log["Q_dot"][log["Q_dot"] != 0.0]
    spans = _gaits(free, log["gaits"])
    lengths = np.array([t[end] - t[begin] for begin, end in spans])
    gains = np.array([quality[end] - quality[begin] for begin, end in spans])
    heights = np.abs(log.block("height")[counted])
    return {
        "gaits": int(log["gaits"][-1]),
        "gait_time_s": _over(np.mean, lengths),
        "gait_fraction": float((free[counted] >= 0.0).mean()) if counted.any() else None,
        "qdot_positive_fraction": _over(np.mean, np.asarray(predicted > 0.0)),
        "quality_gain_fraction": _over(np.mean, np.asarray(gains > 0.0)),
        "quality_rate": _over(np.mean, gains / lengths) if len(spans) else None,
        "min_quality": _over(np.min, quality[counted]),
        "quality_threshold": float(log["threshold"][-1]),
        "max_height_deviation_m": _over(np.max, heights),
        "slips": int(log["slips"][-1]),
        "min_assumed_friction": _over(np.min, log["friction"][counted]),
    }


def saturated_fraction(log: Log, scenario: Scenario, tau_max: Array | float) -> float | None:
    """Share of the counted control steps in which some joint's torque command is at its limit."""
    counted = log.t >= scenario.metrics_from
    commands = np.abs(log.block("tau_des")[counted])
    return _over(np.mean, np.any(commands >= 0.999 * tau_max, axis=1))


def step_times(step_ns: NDArray[np.int64]) -> dict[str, float]:
    """Mean, median, high percentiles and maximum of the control step's time, us."""
    us = step_ns / 1e3
    p99, p999 = np.percentile(us, [99.0, 99.9])
    return {
        "mean": float(us.mean()),
        "median": float(np.median(us)),
        "p99": float(p99),
        "p999": float(p999),
        "max": float(us.max()),
    }


def _last_true(t: Array, outside: NDArray[np.bool_], begin: float) -> float | None:
    """Time from `begin` to just after the last sample that is `outside`; None where that is the last of all."""
    last = np.flatnonzero(outside)
    if not len(last):
        return 0.0
    return None if last[-1] + 1 >= len(t) else float(t[last[-1] + 1] - begin)


def _back(t: Array, outside: NDArray[np.bool_]) -> float | None:
    """Time from the first sample until none is `outside` for `_STAYED`, or any more; None where the last one is."""
    if not len(t) or outside[-1]:
        return None
    begin = 0
    for last in np.flatnonzero(outside):
        if t[last] - t[begin] >= _STAYED:
            break
        begin = int(last) + 1
    return float(t[begin] - t[0])


def _next_start(scenario: Scenario, pulse: Disturbance) -> float:
    later = [other.at for other in scenario.disturbance if other.at > pulse.at]
    return min(later, default=float("inf"))


def _gaits(free: Array, count: Array) -> list[tuple[int, int]]:
    """First and last-plus-one sample of each completed gait, from the free finger and the number of gaits begun."""
    edges = np.flatnonzero((np.diff(free) != 0.0) | (np.diff(count) != 0.0)) + 1
    bounds = [0, *edges.tolist(), len(free)]
    pairs = zip(bounds[:-1], bounds[1:], strict=True)
    return [(begin, end) for begin, end in pairs if free[begin] >= 0.0 and end < len(free)]


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x * x)))


def _over(function: Any, values: NDArray[Any]) -> float | None:
    """`function` of the values as a plain number, None where there are none."""
    return float(function(values)) if values.size else None
