"""One run: the plant under the compiled control step, from the scenario to its log and metrics."""

import importlib.metadata
import platform
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from fingergait import _core
from fingergait.run.log import Log, describe
from fingergait.run.loss import LossMonitor, reason
from fingergait.run.metrics import Timing, metrics_of
from fingergait.run.stepper import Stepper
from fingergait.run.stepper import load_controller as load_controller
from fingergait.scenario import Scenario
from fingergait.sim.plant import MujocoPlant
from fingergait.sim.scene import settings, torque_limits

Watcher = Callable[[MujocoPlant, "Log"], bool | None]
"""Called while a run goes on, see `simulate`; True ends the run."""

_CHECK_EVERY = 5  # control steps between two looks at whether the object is lost


@dataclass(frozen=True)
class Run:
    """The outcome of one run: the figures of `fingergait run --json`, and the log they come from."""

    metrics: dict[str, Any]
    log: Log


def simulate(scenario: Scenario, watch: Watcher | None = None, every: float = 0.016) -> Run:
    """Runs a scenario until its duration is over or the object is lost.

    The same scenario gives the same log, byte for byte, on one machine.

    Parameters
    ----------
    scenario
        What to run.
    watch
        Shown the plant and the log while they run; for progress bars and viewers.
    every
        Simulated time between two looks, s; zero: every control step.
    """
    stepper = Stepper(scenario)
    plant = stepper.plant
    steps = round((scenario.duration + scenario.grasp.settle) * scenario.controller.rate_hz)
    log = Log(stepper.columns, stepper.fingers, steps)
    log.metadata = metadata(plant)
    step_ns = np.zeros(steps, dtype=np.int64)
    solver: Counter[str] = Counter()
    monitor = LossMonitor(scenario)
    watch_every = max(1, round(every * scenario.controller.rate_hz))
    lost: str | None = None

    begin = time.perf_counter()
    for k in range(steps):
        diagnostics = stepper.plan()
        stepper.record(log.append(plant.t))
        step_ns[k] = diagnostics.step_ns
        solver[diagnostics.solver] += 1
        if k % _CHECK_EVERY == 0:
            standing = diagnostics.safe_mode != "normal"
            if monitor.update(plant.t, plant.object_pose, stepper.pose, plant.sensors.normal_force, standing):
                lost = reason(log, plant.scene, monitor.symptom)
                break
        if watch is not None and k % watch_every == 0 and watch(plant, log):
            break
        if plant.t >= scenario.duration - 1.5 * scenario.period:
            break  # dropped ticks make a step longer than a period
        stepper.advance()
    plant.close()
    timing = Timing(step_ns[: len(log)], time.perf_counter() - begin, dict(solver))
    metrics = metrics_of(log, scenario, lost, timing, float(torque_limits(plant.scene).min()))
    metrics["simulator"] = settings(plant.scene, scenario)
    metrics["versions"] = versions()
    return Run(metrics, log)


def versions() -> dict[str, str]:
    """Versions of what a result depends on."""
    try:
        own = importlib.metadata.version("fingergait")
    except importlib.metadata.PackageNotFoundError:  # run from a source tree
        own = _core.__version__
    return {
        "fingergait": own,
        "core": _core.__version__,
        "mujoco": mujoco.mj_versionString(),
        "numpy": np.__version__,
        "python": platform.python_version(),
    }


def metadata(plant: MujocoPlant) -> dict[str, str]:
    """What a log says of its run: scenario, seed, versions and simulator settings."""
    scenario = plant.scenario
    return {
        "scenario": describe(scenario.model_dump(mode="json", exclude_unset=True)),
        "seed": str(scenario.seed),
        "versions": describe(versions()),
        "simulator": describe(settings(plant.scene, scenario)),
    }
