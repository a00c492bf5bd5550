"""One run: the plant under the compiled control step, from the scenario to its log and metrics."""

import importlib.metadata
import platform
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from rich.table import Table

from fingergait import _core
from fingergait.run.log import Log, describe
from fingergait.run.loss import LossMonitor, reason
from fingergait.run.metrics import Timing, metrics_of
from fingergait.run.progress import RunProgress, in_notebook
from fingergait.run.report.table import table_of
from fingergait.run.stepper import Stepper
from fingergait.run.stepper import load_controller as load_controller
from fingergait.scenario import Scenario
from fingergait.sim.plant import MujocoPlant
from fingergait.sim.scene import settings, torque_limits

Watcher = Callable[[MujocoPlant, "Log"], bool | None]
"""Called while a run goes on, see `simulate`; True ends the run."""

_REFUSED_S = 0.5  # time at which a start that is still refused ends the run: nothing is driven, nothing will change
_CHECK_EVERY = 5  # control steps between two looks at whether the object is lost


@dataclass(frozen=True, repr=False)
class Run:
    """The outcome of one run. A notebook shows its table, film strip and plots; `rich.print` its table.

    Attributes
    ----------
    metrics
        The figures of `fingergait run --json`, without the log's path: plain numbers in SI units by their names.
    log
        What happened in every control step, see `Log`.
    """

    metrics: dict[str, Any]
    log: Log

    def __repr__(self) -> str:
        m = self.metrics
        outcome = f"LOST: {m['lost_reason']}" if m["dropped"] else f"{m['gaits']} gaits, object held"
        turned = f"turned by {57.29578 * m['rotation_rad']:.0f} degrees in {m['duration_s']:.1f} s"
        return f"<Run {m['scenario']}, seed {m['seed']}: {turned}, {outcome}>"

    def __rich__(self) -> Table:
        return table_of(self.metrics)

    def _repr_html_(self) -> str:
        return self._html

    @cached_property
    def _html(self) -> str:
        from fingergait.run.report.page import run_html  # draws with Matplotlib, which few runs need

        return run_html(self.metrics, self.log)


def simulate(
    scenario: Scenario, watch: Watcher | None = None, *, progress: bool | None = None, every: float = 0.016
) -> Run:
    """The figures and the log of a scenario's run: until its duration is over or the object is lost.

    The plant is MuJoCo with the scenario's true object, the controller the compiled control step; the order of a step
    is that of the paper's Section II. The same scenario gives the same log, byte for byte, on one machine.

    Parameters
    ----------
    scenario
        What to run.
    watch
        Shown the plant and the log while the run goes on; for viewers. True ends the run.
    progress
        Whether a bar shows how far the run is; absent: in a notebook only.
    every
        Simulated time between two looks of `watch`, s; zero: every control step.

    Raises
    ------
    ConfigError
        A key that the core refuses, a hand that cannot be used, or fingers that cannot reach the object.
    ArtifactError
        A controller artefact that is missing, corrupt, or made for another control rate.
    """
    with RunProgress(scenario, in_notebook() if progress is None else progress) as bar:
        return _simulate(scenario, watch, bar, every)


def _simulate(scenario: Scenario, watch: Watcher | None, bar: RunProgress, every: float) -> Run:
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
            if stepper.refused and plant.t >= _REFUSED_S:
                break
            goal, felt, lying = stepper.goal, plant.sensors.normal_force, stepper.lying
            if not stepper.refused and monitor.update(plant.t, plant.object_pose, goal, felt, standing, lying):
                lost = reason(log, plant.scene, monitor.symptom)
                break
        if k % watch_every == 0:
            bar.update(plant.t, log)
            if watch is not None and watch(plant, log):
                break
        if plant.t >= scenario.duration - 1.5 * scenario.period:
            break  # dropped ticks make a step longer than a period
        stepper.advance()
    plant.close()
    timing = Timing(step_ns[: len(log)], time.perf_counter() - begin, dict(solver))
    low, high = torque_limits(plant.scene)
    metrics = metrics_of(log, scenario, lost, timing, np.minimum(-low, high))
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
