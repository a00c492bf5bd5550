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
from fingergait.hand import model_json
from fingergait.paths import find
from fingergait.run.log import Log, columns, describe
from fingergait.run.loss import LossMonitor, reason
from fingergait.run.metrics import Timing, metrics_of
from fingergait.run.progress import RunProgress, in_notebook
from fingergait.run.regrasping import LYING
from fingergait.run.report.table import table_of
from fingergait.scenario import Scenario
from fingergait.scenario.reference import Trajectory
from fingergait.sim.plant import MujocoPlant
from fingergait.sim.scene import settings, torque_limits

Watcher = Callable[[MujocoPlant, "Log"], bool | None]
"""Called about every 16 ms of simulated time; True ends the run."""

_REFUSED_S = 0.5  # time at which a start that is still refused ends the run: nothing is driven, nothing will change
_REFUSED = {"pose_frame", "tactile_axes"}
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


def load_controller(scenario: Scenario) -> _core.Controller:
    """The controller artefact that a scenario names."""
    path = find(scenario.controller.file, "controllers", ".json", "controller.file")
    try:
        return _core.Controller(path.read_text(encoding="utf-8"))
    except (_core.ArtifactError, UnicodeDecodeError) as error:
        raise _core.ArtifactError(f"{path.name}: {error}") from None


def simulate(scenario: Scenario, watch: Watcher | None = None, *, progress: bool | None = None) -> Run:
    """The figures and the log of a scenario's run: until its duration is over or the object is lost.

    The plant is MuJoCo with the scenario's true object, the controller the compiled control step; the order of a step
    is that of the paper's Section II. The same scenario gives the same log, byte for byte, on one machine.

    Parameters
    ----------
    scenario
        What to run.
    watch
        Shown the plant and the log every 16 ms of simulated time; for viewers. True ends the run.
    progress
        Whether a bar shows how far the run is; absent: in a notebook only.

    Raises
    ------
    ConfigError
        A key that the core refuses, a hand that cannot be used, or fingers that cannot reach the object.
    ArtifactError
        A controller artefact that is missing, corrupt, or made for another control rate.
    """
    with RunProgress(scenario, in_notebook() if progress is None else progress) as bar:
        return _simulate(scenario, watch, bar)


def _simulate(scenario: Scenario, watch: Watcher | None, bar: RunProgress) -> Run:
    plant = MujocoPlant(scenario)
    hand = _core.HandModel(model_json(plant.scene.hand))
    planner = _core.DualStagePlanner(hand, load_controller(scenario), plant.config)
    scene = plant.scene
    low, high = torque_limits(scene)
    n, counts = len(scene.fingers), scene.counts
    names = [finger.name for finger in scene.fingers]
    steps = round((scenario.duration + scenario.grasp.settle) * scenario.controller.rate_hz)
    log = Log(columns(names, counts), names, steps)
    log.metadata = metadata(plant)
    step_ns = np.zeros(steps, dtype=np.int64)
    solver: Counter[str] = Counter()
    monitor = LossMonitor(scenario)
    watch_every = max(1, round(0.016 * scenario.controller.rate_hz))
    lost: str | None = None

    measurement = plant.reset()
    trajectory = Trajectory(scenario.reference, plant.sensors.pose)
    begin = time.perf_counter()
    cuts = np.cumsum([7, 7, len(scene.q), n, 1, len(plant.sensors.row)]).tolist()
    for k in range(steps):
        pose, twist = trajectory.sample(plant.t)
        given = plant.injection.reference(plant.t, pose, twist)
        command, diagnostics = planner.step(measurement, _core.Reference(*given))
        row = log.append(plant.t)
        row[: cuts[0]] = plant.object_pose
        row[cuts[0] : cuts[1]] = pose
        row[cuts[1] : cuts[2]] = plant.joint_angles
        row[cuts[2] : cuts[3]] = plant.sensors.tangential
        row[cuts[3]] = plant.link_contact
        row[cuts[4] : cuts[5]] = plant.sensors.row
        row[cuts[5] :] = diagnostics.row()
        step_ns[k] = diagnostics.step_ns
        solver[diagnostics.solver] += 1
        if k % _CHECK_EVERY == 0:
            standing = diagnostics.safe_mode != "normal"
            refused = not _REFUSED.isdisjoint(diagnostics.faults)
            if refused and plant.t >= _REFUSED_S:
                break
            # What the object is to do now: what is asked, less what it missed while it was set down.
            goal = pose if diagnostics.regrasp == "idle" else diagnostics.governed
            lying = diagnostics.regrasp in LYING
            felt = plant.sensors.normal_force
            if not refused and monitor.update(plant.t, plant.object_pose, goal, felt, standing, lying):
                lost = reason(log, scene, monitor.symptom)
                break
        if k % watch_every == 0:
            bar.update(plant.t, log)
            if watch is not None and watch(plant, log):
                break
        if plant.t >= scenario.duration - 1.5 * scenario.period:
            break  # dropped ticks make a step longer than a period
        measurement = plant.step(command)
    plant.close()
    timing = Timing(step_ns[: len(log)], time.perf_counter() - begin, dict(solver))
    metrics = metrics_of(log, scenario, lost, timing, np.minimum(-low, high))
    metrics["simulator"] = settings(scene, scenario)
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
