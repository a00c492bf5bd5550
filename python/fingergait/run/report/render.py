"""Renders a log's poses: `python -m fingergait.run.report.render strip|video LOG OUTPUT`, with MUJOCO_GL set."""

import errno
import json
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fingergait._core import ConfigError
from fingergait.files import whole_file
from fingergait.run.log import Log
from fingergait.run.pose_error import yaw_reached
from fingergait.run.report.film import UNWRITABLE
from fingergait.scenario import Scenario
from fingergait.sim import gl
from fingergait.sim.scene import SceneModel, build_scene

_FRAMES = 8
_FPS = 30
_VIEWS = {
    "front": (90.0, -18.0, 0.36),
    "top": (90.0, -89.0, 0.34),
}  # azimuth and elevation, degrees; distance, m
_LOOK_AT = (0.0, 0.0, 0.06)

Image = NDArray[np.uint8]


class Camera:
    """Renders the scene of a log at any of its rows."""

    def __init__(self, log: Log, width: int, height: int) -> None:
        scenario = Scenario.build(json.loads(log.metadata["scenario"]))
        self.scene: SceneModel = build_scene(scenario)
        self._log = log
        self._data = mujoco.MjData(self.scene.model)
        self._renderer = mujoco.Renderer(self.scene.model, height, width)
        self._joints, self._object = log.block("q"), log.pose("object")

    def picture(self, row: int, view: str) -> Image:
        """The scene at one row of the log, (height, width, 3)."""
        self._data.qpos[self.scene.q] = self._joints[row]
        self._data.qpos[self.scene.object_q : self.scene.object_q + 7] = self._object[row]
        mujoco.mj_forward(self.scene.model, self._data)
        camera = mujoco.MjvCamera()
        camera.azimuth, camera.elevation, camera.distance = _VIEWS[view]
        camera.lookat[:] = _LOOK_AT
        self._renderer.update_scene(self._data, camera)
        picture: Image = self._renderer.render().copy()
        return picture

    def close(self) -> None:
        """Releases the GL context."""
        self._renderer.close()


def strip(log: Log, output: Path) -> None:
    """Writes the film strip: pictures from the front and the top at equal times, the paper's Figs. 4 and 8."""
    camera = Camera(log, 360, 360)
    shown = np.linspace(int(np.searchsorted(log.t, 0.0)), len(log) - 1, _FRAMES).round().astype(int)
    turned = np.rad2deg(yaw_reached(log.pose("object")))
    figure = Figure(figsize=(1.9 * _FRAMES, 4.2), layout="constrained")
    grid = figure.subplots(len(_VIEWS), _FRAMES, squeeze=False)
    for column, row in enumerate(shown):
        for axes, view in zip(grid[:, column], _VIEWS, strict=True):
            axes.imshow(camera.picture(int(row), view))
            axes.set_xticks([])
            axes.set_yticks([])
        grid[0, column].set_title(f"{log.t[row]:.1f} s, {turned[row]:.0f} deg", fontsize=9)
    for axes, view in zip(grid[:, 0], _VIEWS, strict=True):
        axes.set_ylabel(view)
    camera.close()
    with whole_file(output) as temporary:
        figure.savefig(temporary, dpi=110)


def video(log: Log, output: Path) -> None:
    """Writes the video: front and top side by side, in real time."""
    import imageio.v2 as imageio

    camera = Camera(log, 640, 640)
    times = np.arange(0.0, log.t[-1], 1.0 / _FPS)
    with whole_file(output) as temporary:
        writer: Any = imageio.get_writer(temporary, fps=_FPS, macro_block_size=16)
        for row in np.searchsorted(log.t, times):
            writer.append_data(np.hstack([camera.picture(int(row), view) for view in _VIEWS]))
        writer.close()
        if not _is_whole(temporary, len(times)):
            raise OSError(errno.ENOSPC, "the video is cut short", str(temporary))
    camera.close()


def _is_whole(film: Path, frames: int) -> bool:
    """Whether a video has all its frames: the encoder's process does not say when it ran out of room."""
    from imageio_ffmpeg import count_frames_and_secs

    try:
        return bool(count_frames_and_secs(str(film))[0] >= frames)
    except RuntimeError:
        return False


def main(kind: str, log: str, output: str) -> None:
    """Renders the log in the file `log` into `output`; `kind` is "strip" or "video".

    Exit status `UNWRITABLE`, with one line, where the output can't be written.
    """
    if gl.problem is not None:
        sys.exit(gl.problem)
    try:
        {"strip": strip, "video": video}[kind](Log.read(Path(log)), Path(output))
    except ConfigError as error:
        print(str(error).encode("ascii", errors="backslashreplace").decode(), file=sys.stderr)
        sys.exit(UNWRITABLE)


if __name__ == "__main__":
    main(*sys.argv[1:])
