"""What `mkdocs build` does besides the pages: draws their pictures before, and adds rustdoc's output after.

Each `figures/NAME.py` draws `pictures/NAME.png`. A picture that is newer than its script and the package is kept.
"""

import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
ROOT = DOCS.parent
LIBRARIES = ("egl", "osmesa")  # that MuJoCo can draw with where there is no display
log = logging.getLogger("mkdocs.hooks.fingergait")


def on_pre_build(config: Any) -> None:
    """Draws each picture that is missing or older than what draws it."""
    pictures = DOCS / "pictures"
    pictures.mkdir(exist_ok=True)
    sources = [*(ROOT / "python").rglob("*.py"), *(ROOT / "models").rglob("*.*"), *(ROOT / "python").rglob("*.so")]
    newest = max(path.stat().st_mtime for path in sources)
    for script in sorted((DOCS / "figures").glob("[!_]*.py")):
        picture = pictures / f"{script.stem}.png"
        if not picture.exists() or picture.stat().st_mtime < max(newest, script.stat().st_mtime):
            _draw(script, picture)


def _draw(script: Path, picture: Path) -> None:
    problem = ""
    for library in LIBRARIES:
        environment = {"MUJOCO_EGL_DEVICE_ID": "0", **os.environ, "MUJOCO_GL": library}
        command = [sys.executable, str(script), str(picture)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            return
        problem = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"exit status {done.returncode}"
    log.warning("%s drew nothing: %s", script.name, problem)  # an error with --strict


def on_post_build(config: Any) -> None:
    """Puts rustdoc's pages beside ours, where `cargo doc` has written them."""
    pages = ROOT / "target" / "doc"
    if not (pages / "fg_core" / "index.html").is_file():
        log.warning("no pages of the Rust core: run `cargo doc --no-deps --package fg-core`, or `make docs`")
        return
    shutil.copytree(pages, Path(config["site_dir"]) / "rust", dirs_exist_ok=True)
