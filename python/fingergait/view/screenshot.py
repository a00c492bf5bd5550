"""A picture of the live page as a browser shows it: `python -m fingergait.view.screenshot OUT.png [SCENARIO]`."""

import argparse
import contextlib
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fingergait._core import ConfigError
from fingergait.scenario import Scenario
from fingergait.view.play import bench

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_FLAGS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]

_PATIENCE = 240_000  # ms: software draws the scene, on a machine that may be busy
_SLOWLY = """
window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), %g);
window.cancelAnimationFrame = clearTimeout;
"""
_SETTLED = 12.0  # s in which the browser has faded the scene in, and drawn the last of it


@contextlib.contextmanager
def browser() -> Iterator[Any]:
    """The machine's Chromium without a display, driven by Playwright."""
    found = next((path for path in map(shutil.which, BROWSERS) if path), None)
    if found is None:
        raise ConfigError("screenshot: expected Chromium, found none; install it: apt-get install chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise ConfigError("screenshot: expected playwright, found none; install it: pip install playwright") from None
    with sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=found, args=_FLAGS)
        try:
            yield chromium
        finally:
            chromium.close()


def open_page(chromium: Any, address: str, width: int = 1500, height: int = 940, rate: float | None = None) -> Any:
    """The page at `address`, drawn, in a window of so many pixels, at most `rate` times a second if that is given."""
    page = chromium.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(_PATIENCE)
    if rate is not None:
        page.add_init_script(_SLOWLY % (1e3 / rate))
    page.goto(address)
    page.add_style_tag(content="[class*=Notification] { display: none }")  # that software draws the scene
    page.wait_for_selector("canvas")
    page.get_by_text("All hold").or_(page.get_by_text("fingers have")).or_(
        page.get_by_text("to spare")
    ).first.wait_for()
    return page


def screenshot(scenario: Scenario, out: Path, after: float) -> None:
    """Writes a picture of the bench after so many seconds, shortly after a push."""
    with bench(scenario, "127.0.0.1", 8080) as (session, page), browser() as chromium:
        shown = open_page(chromium, f"http://127.0.0.1:{page.server.get_port()}")
        while (row := session.history.row()) is None or row.t < after:
            time.sleep(0.1)
        session.inputs.push("+x", 5.0)
        pushed = row.t
        while (row := session.history.row()) is None or row.t < pushed + 1.5:
            time.sleep(0.02)
        session.pacer.pause(True)
        time.sleep(_SETTLED)
        out.parent.mkdir(parents=True, exist_ok=True)
        shown.screenshot(path=str(out))


def main() -> None:
    """The command `python -m fingergait.view.screenshot`."""
    parser = argparse.ArgumentParser(prog="python -m fingergait.view.screenshot", description=__doc__)
    parser.add_argument("out", type=Path, help="the PNG to write")
    parser.add_argument("scenario", nargs="?", default="lift-and-rotate", help="a packaged scenario's name, or a file")
    parser.add_argument("--after", type=float, default=8.0, help="simulated time of the picture, s")
    arguments = parser.parse_args()
    screenshot(Scenario.load(arguments.scenario), arguments.out, arguments.after)


if __name__ == "__main__":
    main()
