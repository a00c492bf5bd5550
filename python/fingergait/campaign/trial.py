"""One run of a campaign: from a sample to a row that depends on nothing but the sample and the build."""

import time
import traceback
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from fingergait import _core
from fingergait.campaign.build import build_id
from fingergait.hand import import_hand
from fingergait.paths import find
from fingergait.run.log import Log
from fingergait.run.simulate import simulate
from fingergait.scenario import Scenario
from fingergait.sim.scene import true_inertia

METRICS: dict[str, type] = {
    "duration_s": float,
    "dropped": bool,
    "completed": bool,
    "lost_reason": str,
    "rotation_rad": float,
    "max_position_error_m": float,
    "max_orientation_error_rad": float,
    "rms_position_error_m": float,
    "rms_orientation_error_rad": float,
    "gaits": int,
    "gait_time_s": float,
    "gait_fraction": float,
    "min_quality": float,
    "max_height_deviation_m": float,
    "slips": int,
    "min_assumed_friction": float,
    "saturated_fraction": float,
}
"""Figures of `run` that become columns."""

OBSERVED: dict[str, type] = {
    "true_mass_kg": float,
    "true_inertia_x": float,
    "true_inertia_y": float,
    "true_inertia_z": float,
    "gaiting_at_end": bool,
    "gaiting_at_fault": bool,
    "worst_safe_mode": int,
    "last_safe_mode": int,
    "detected_after_s": float,
    "bad_commands": int,
    "max_torque_share": float,
    "max_torque_rate_share": float,
}
"""Figures that a campaign adds: true mass and principal moments, kg m^2; from the log, whether a finger was free at the
end and as the fault began; the most severe mode of the core's guard and the last one, and when after the fault's
beginning it first saw one; commands that were not finite or outside their limits; largest command and largest change of
it in one step as shares of their limits."""

_ROUNDING = 1e-5  # relative: a log holds single precision


@dataclass(frozen=True)
class Trial:
    """What a worker needs for one run: the base scenario's values and what is replaced in it."""

    index: int
    base: dict[str, Any]
    overrides: dict[str, Any]
    build: str


@dataclass(frozen=True)
class Outcome:
    """What came of one run: its row, and the times it took, which are not part of it."""

    index: int
    row: dict[str, Any]
    timing: dict[str, Any]


class BuildMismatch(_core.FingergaitError):
    """A worker runs other code than the campaign's command."""


def run_trial(trial: Trial) -> Outcome:
    """Runs one sample; whatever goes wrong in it becomes its row."""
    if build_id() != trial.build:
        raise BuildMismatch(f"workers: expected fingergait build {trial.build}, found {build_id()} on a worker")
    begin, worked = time.perf_counter(), time.thread_time()
    timing: dict[str, Any] = {
        "wall_s": 0.0,
        "cpu_s": 0.0,
        "real_time_factor": None,
        "step_p999_us": None,
        "deadline_misses": None,
    }
    try:
        scenario = Scenario.build(trial.base, trial.overrides)
        result = simulate(scenario)
        row = {"error": None, **{key: result.metrics[key] for key in METRICS}, **observed(result.log, scenario)}
        timing["real_time_factor"] = result.metrics["real_time_factor"]
        timing["step_p999_us"] = result.metrics["step_us"]["p999"]
        timing["deadline_misses"] = result.metrics["deadline_misses"]
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a panic of the compiled core is no Exception
        row = {"error": describe(error), **dict.fromkeys([*METRICS, *OBSERVED])}
    timing["wall_s"], timing["cpu_s"] = time.perf_counter() - begin, time.thread_time() - worked
    return Outcome(trial.index, row, timing)


def describe(error: BaseException) -> str:
    """A crash in one line: its type, its text, and the line of this package that it came from."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "fingergait" in frame.filename]
    place = f" ({frames[-1].filename.rpartition('fingergait/')[2]}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {' '.join(str(error).split())}{place}"


def observed(log: Log, scenario: Scenario) -> dict[str, Any]:
    """The figures of `OBSERVED` of one run."""
    free = log["free_finger"]
    at = min((fault.at for fault in scenario.fault), default=None)
    begun = None if at is None else int(np.searchsorted(log.t, at))
    modes = log["safe_mode"] if "safe_mode" in log.names else None
    seen = log["faults"][begun:] != 0.0 if begun is not None and "faults" in log.names else np.zeros(0)
    first = int(np.argmax(seen)) if seen.any() else None
    return {
        "true_mass_kg": scenario.object.mass * scenario.truth.mass_scale,
        **{f"true_inertia_{axis}": float(x) for axis, x in zip("xyz", true_inertia(scenario), strict=True)},
        "gaiting_at_end": bool(free[-1] >= 0.0),
        "gaiting_at_fault": None if begun is None or begun >= len(free) else bool(free[begun] >= 0.0),
        "worst_safe_mode": None if modes is None else int(modes.max()),
        "last_safe_mode": None if modes is None else int(modes[-1]),
        "detected_after_s": None if begun is None or first is None else float(log.t[begun + first] - log.t[begun]),
        **command_figures(log, scenario),
    }


def command_figures(log: Log, scenario: Scenario) -> dict[str, Any]:
    """How the torque commands kept their limits."""
    limit, rate = command_limits(scenario)
    commands = log.block("tau_des")  # (T, n m)
    elapsed = np.diff(log.t, prepend=log.t[0] - scenario.period)[:, None]
    changes = np.abs(np.diff(commands, axis=0, prepend=np.zeros((1, commands.shape[1])))) / (rate * elapsed)
    shares = np.abs(commands) / limit
    kept = (shares <= 1.0 + _ROUNDING) & (changes <= 1.0 + 1e-3)  # NaN keeps nothing
    return {
        "bad_commands": int((~kept).any(axis=1).sum()),
        "max_torque_share": float(np.nanmax(shares)),
        "max_torque_rate_share": float(np.nanmax(changes)),
    }


def command_limits(scenario: Scenario) -> tuple[float, float]:
    """Torque limit, N m, and torque rate limit, N m/s, that the core is given."""
    force = {**_core.default_config()["force"], "tau_max": _hand_limit(scenario.hand.file), **scenario.force}
    return float(force["tau_max"]), float(force["tau_rate_max"])


@cache
def _hand_limit(file: str) -> float:
    """Torque of the hand's weakest motor, N m."""
    path = find(file, "", ".xml", "hand.file")
    motors = [motor for finger in import_hand(path).fingers for motor in finger.motors]
    return min(max(-motor.low, motor.high) for motor in motors)
