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

from fingergait._core import ConfigError
from fingergait.files import make_folder, write_text
from fingergait.run.log import Log
from fingergait.run.report.film import film_strip, video_problem
from fingergait.run.report.film import video as write_video
from fingergait.run.report.plots import write_plots
from fingergait.run.report.table import show
from fingergait.run.simulate import simulate
from fingergait.scenario import Scenario
from fingergait.sim.plant import MujocoPlant
from fingergait.stopping import StopFlag, Stopped, stop_flag

Shown = Callable[[MujocoPlant, Log], bool]
"""Shows a run in real time: called at every control step, True ends the run."""

Viewer = Callable[[StopFlag], contextlib.AbstractContextManager[Shown]]
"""Opens what shows a run: `NativeViewer`, or the page `fingergait.view.live.LivePage`. It need not look at the flag,
but where it lets the run stand."""


def run_scenario(
    scenario: Scenario, out: Path | None, view: Viewer | None, video: Path | None, quiet: bool
) -> tuple[dict[str, Any], Stopped | None]:
    """Runs a scenario and writes log.parquet, metrics.json, the plots and film.png; its metrics, and what stopped it.

    Where the user stops it, what was measured so far is written all the same, but for the film strip and the video.

    Parameters
    ----------
    scenario
        What to run.
    out
        Folder of the results; absent: runs/<scenario>-<seed>.
    view
        Shows the run in real time.
    video
        File of a video to write.
    quiet
        Write nothing to standard output.
    """
    folder = out if out is not None else Path("runs") / f"{scenario.name}-{scenario.seed}"
    if video is not None:
        _check_video(video)
    make_folder(folder)
    notes = Console(stderr=True, highlight=False, soft_wrap=True)
    with stop_flag() as flag:
        with contextlib.ExitStack() as stack:
            shown = stack.enter_context(view(flag)) if view is not None else None

            def watch(plant: MujocoPlant, log: Log) -> bool:
                return bool(flag) or (shown is not None and shown(plant, log))

            result = simulate(scenario, watch, progress=True, every=0.016 if view is None else 0.0)
        metrics = result.metrics
        stopped = _stopped(flag, metrics, scenario, folder)
        log = folder / "log.parquet"
        metrics["log"] = str(log)
        result.log.write(log)
        write_text(folder / "metrics.json", json.dumps(metrics, indent=2) + "\n")
        if len(result.log) > 1:
            write_plots(result.log, scenario, folder)
    problems = []
    if stopped is None:
        problems = [film_strip(log, folder / "film.png"), write_video(log, video) if video is not None else None]
    for problem in problems:
        if problem is not None:
            notes.print(problem, style="yellow")
    if not quiet:
        console = Console()
        show(metrics, console)
        console.print(f"log, metrics, plots and film strip: {folder}", highlight=False, markup=False)
    return metrics, stopped


def _stopped(flag: StopFlag, metrics: dict[str, Any], scenario: Scenario, folder: Path) -> Stopped | None:
    """What to say where the user has stopped the run."""
    if flag.signum is None:
        return None
    reached = f"{max(0.0, metrics['duration_s']):.2f} of {scenario.duration:g} s"
    return Stopped(f"at {reached}; log, metrics and plots up to there: {folder}", flag.signum)


def _check_video(video: Path) -> None:
    problem = video_problem()
    if problem is not None:
        raise ConfigError(problem)
    if video.suffix != ".mp4" or not video.parent.is_dir() or video.is_dir():
        raise ConfigError(f"--video: expected a .mp4 file in a folder that exists, found {video}")


class NativeViewer(contextlib.ExitStack):
    """MuJoCo's own window, held to real time; closing it ends the run."""

    def __init__(self, flag: StopFlag) -> None:
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
