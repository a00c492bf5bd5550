"""The work of `fingergait run`: one scenario with progress, and its files."""

import contextlib
import json
import os
import sys
import time
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


def run_scenario(
    scenario: Scenario, out: Path | None, view: bool, video: Path | None, quiet: bool
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
        Show the run in MuJoCo's viewer, in real time.
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
        with _Watch(scenario, view, flag) as watch:
            result = simulate(scenario, watch, progress=True)
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


class _Watch:
    """The viewer, if it is wanted; called by `simulate`."""

    def __init__(self, scenario: Scenario, view: bool, flag: StopFlag) -> None:
        self._scenario, self._view, self._flag = scenario, view, flag
        self._viewer: Any = None
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> "_Watch":
        self._begin = time.perf_counter()
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def __call__(self, plant: MujocoPlant, log: Log) -> bool:
        """Shows the present state; True when the viewer has been closed or the user has stopped the command."""
        if self._flag:
            return True
        if not self._view:
            return False
        if self._viewer is None:
            self._viewer = self._stack.enter_context(_open_viewer(plant))
        if not self._viewer.is_running():
            return True
        self._viewer.sync()
        ahead = plant.t + self._scenario.grasp.settle - (time.perf_counter() - self._begin)
        time.sleep(max(0.0, ahead))
        return False


def _open_viewer(plant: MujocoPlant) -> Any:
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise ConfigError("--view: expected a display, found neither DISPLAY nor WAYLAND_DISPLAY set")
    try:
        import mujoco.viewer

        return mujoco.viewer.launch_passive(plant.scene.model, plant.data, show_left_ui=False, show_right_ui=False)
    except (ImportError, RuntimeError) as error:
        raise ConfigError(f"--view: expected a display that MuJoCo's viewer can open, found none ({error})") from None
