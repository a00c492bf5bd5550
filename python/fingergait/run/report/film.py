"""Film strips and videos, rendered offscreen in a process of their own.

MuJoCo chooses its GL library when it is imported and fails there if the library is missing, so a process of its own
tries one library after the other and the run itself never depends on any.
"""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

from fingergait._core import ConfigError
from fingergait.sim import gl

_ADVICE = "install one: apt-get install libegl1 libgl1-mesa-dri (EGL) or libosmesa6 (OSMesa)"
_LIBRARIES = ("egl", "osmesa")
UNWRITABLE = 73
"""Exit status of the rendering process where its picture or film can't be written, as in sysexits.h."""


def film_strip(log: Path, picture: Path) -> str | None:
    """Renders the film strip of a log into a PNG; None, or one line that says why there is none."""
    return _render("strip", log, picture)


def video(log: Path, film: Path) -> str | None:
    """Renders the video of a log into an MP4; None, or one line that says why there is none."""
    return video_problem() or _render("video", log, film)


def video_problem() -> str | None:
    """One line if the packages that write a video are missing."""
    packages = ("imageio", "imageio_ffmpeg")
    if all(importlib.util.find_spec(package) for package in packages):
        return None
    return "--video: expected the package imageio[ffmpeg], found none; install it: pip install 'fingergait[video]'"


def _render(kind: str, log: Path, output: Path) -> str | None:
    libraries = (gl.WANTED,) if gl.WANTED else _LIBRARIES
    reasons = []
    for library in libraries:
        environment = {**os.environ, "MUJOCO_GL": library}
        if library == "egl":
            environment.setdefault("MUJOCO_EGL_DEVICE_ID", "0")
        command = [sys.executable, "-m", "fingergait.run.report.render", kind, str(log), str(output)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, errors="replace", check=False)
        if done.returncode == 0:
            return None
        if done.returncode == UNWRITABLE:
            raise ConfigError(done.stderr.strip())
        lines = [line for line in done.stderr.splitlines() if line.strip()] or [f"exit status {done.returncode}"]
        reasons.append(f"{library}: {lines[-1].strip()}")
    return f"no {kind}: no GL library for offscreen rendering ({'; '.join(reasons)}); {_ADVICE}"
