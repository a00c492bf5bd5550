"""The work of `fingergait run`: one scenario with progress, and its files."""

import contextlib
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from fingergait._core import ConfigError
from fingergait.run.log import Log
from fingergait.run.report.film import film_strip, video_problem
from fingergait.run.report.film import video as write_video
from fingergait.run.report.plots import write_plots
from fingergait.run.report.table import show
from fingergait.run.simulate import simulate
from fingergait.scenario import Scenario
from fingergait.sim.plant import MujocoPlant

Viewer = contextlib.AbstractContextManager[Callable[[MujocoPlant, Log], bool]]
"""Shows a run in real time: called at every control step, True ends the run."""


def run_scenario(
    scenario: Scenario, out: Path | None, view: Viewer | None, video: Path | None, quiet: bool
) -> dict[str, Any]:
    """Runs a scenario and writes log.parquet, metrics.json, the plots and film.png; its metrics.

    Parameters
    ----------
    scenario
        What to run.
    out
        Folder of the results; absent: runs/<scenario>-<seed>.
    view
        Shows the run in real time: `NativeViewer`, or the page `fingergait.view.live.LivePage`.
    video
        File of a video to write.
    quiet
        Write nothing to standard output.
    """
    folder = out if out is not None else Path("runs") / f"{scenario.name}-{scenario.seed}"
    if video is not None:
        _check_video(video)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"--out: expected a folder that can be written, found {folder} ({error.strerror})") from None
    notes = Console(stderr=True, highlight=False)
    with _Watch(scenario, view) as watch:
        result = simulate(scenario, watch, every=0.016 if view is None else 0.0)
    metrics = result.metrics
    log = folder / "log.parquet"
    metrics["log"] = str(log)
    result.log.write(log)
    (folder / "metrics.json").write_text(json.dumps(metrics, indent=2) + "\n", encoding="utf-8")
    write_plots(result.log, scenario, folder)
    problems = [film_strip(log, folder / "film.png"), write_video(log, video) if video is not None else None]
    for problem in problems:
        if problem is not None:
            notes.print(problem, style="yellow")
    if not quiet:
        console = Console()
        show(metrics, console)
        console.print(f"log, metrics, plots and film strip: {folder}", highlight=False)
    return metrics


def _check_video(video: Path) -> None:
    problem = video_problem()
    if problem is not None:
        raise ConfigError(problem)
    if video.suffix != ".mp4" or not video.parent.is_dir():
        raise ConfigError(f"--video: expected a .mp4 file in a folder that exists, found {video}")


class _Watch:
    """A progress bar on standard error and, if wanted, the viewer; called by `simulate`."""

    def __init__(self, scenario: Scenario, view: Viewer | None) -> None:
        self._view = view
        self._viewer: Callable[[MujocoPlant, Log], bool] | None = None
        self._stack = contextlib.ExitStack()
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed:5.1f}/{task.total:.0f} s  {task.fields[state]}"),
            TimeElapsedColumn(),
        )
        console = Console(stderr=True)
        self._progress = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self._progress.add_task(scenario.name, total=scenario.duration, state="")
        self._shown = 0.0

    def __enter__(self) -> "_Watch":
        self._stack.enter_context(self._progress)
        if self._view is not None:
            self._viewer = self._stack.enter_context(self._view)
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def __call__(self, plant: MujocoPlant, log: Log) -> bool:
        """Shows the present state; True when the viewer has been closed."""
        now = time.perf_counter()
        if now - self._shown > 0.1:
            self._shown = now
            state = f"{int(log.last('gaits'))} gaits, Q {log.last('Q'):.5f}"
            self._progress.update(self._task, completed=max(0.0, plant.t), state=state)
        return self._viewer is not None and self._viewer(plant, log)


class NativeViewer(contextlib.ExitStack):
    """MuJoCo's own window, held to real time; closing it ends the run."""

    def __init__(self) -> None:
        super().__init__()
        self._viewer: Any = None

    def __enter__(self) -> "NativeViewer":
        return self

    def __call__(self, plant: MujocoPlant, log: Log) -> bool:
        """Shows the present state about 60 times a second; True when the window has been closed."""
        if self._viewer is None:
            self._viewer = self.enter_context(_open_viewer(plant))
            self._begin, self._shown = time.perf_counter() - plant.t, 0.0
        now = time.perf_counter()
        if now - self._shown > 0.016:
            self._shown = now
            if not self._viewer.is_running():
                return True
            self._viewer.sync()
        time.sleep(max(0.0, plant.t - (now - self._begin) - 0.008))
        return False


def _open_viewer(plant: MujocoPlant) -> Any:
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise ConfigError("--view=native: expected a display, found neither DISPLAY nor WAYLAND_DISPLAY set")
    try:
        import mujoco.viewer

        return mujoco.viewer.launch_passive(plant.scene.model, plant.data, show_left_ui=False, show_right_ui=False)
    except (ImportError, RuntimeError) as error:
        raise ConfigError(
            f"--view=native: expected a display that MuJoCo's viewer can open, found none ({error})"
        ) from None
