"""The work of `fingergait show`: a recorded run on the page, with a time bar."""

import contextlib
import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from fingergait._core import ConfigError
from fingergait.run.log import Log
from fingergait.scenario import Scenario
from fingergait.sim.scene import build_scene
from fingergait.sim.start import set_joints
from fingergait.stopping import stop_flag
from fingergait.view import server
from fingergait.view.history import Recorded
from fingergait.view.pacer import Pacer

if TYPE_CHECKING:
    from fingergait.view.page import Page

_HANDS_OFF = 0.7  # s after somebody moved the time bar in which the replay leaves it alone


def load(path: Path) -> tuple[Log, Scenario]:
    """A log, with the scenario that it is of."""
    log = Log.read(path)
    if "scenario" not in log.metadata or len(log) == 0:
        raise ConfigError(f"{path}: expected a log with its scenario and with rows, found one without")
    return log, Scenario.build(json.loads(log.metadata["scenario"]))


def show(path: Path, host: str = server.HOST, port: int = server.PORT) -> None:
    """Serves a recorded run until Ctrl-C."""
    with stop_flag() as flag, replay(path, host, port, show=True) as (player, page):
        while not flag and player.is_alive() and page.failure is None:
            time.sleep(0.5)
    if page.failure is not None:
        raise page.failure


@contextlib.contextmanager
def replay(path: Path, host: str, port: int, show: bool = False) -> "Iterator[tuple[Player, Page]]":
    """A log that is played on a page; both end with the context."""
    server.require()
    log, scenario = load(path)
    from fingergait.view.page import Page

    scene = build_scene(scenario)
    history = Recorded(log)
    start = mujoco.MjData(scene.model)
    set_joints(scene, start, log.block("q")[0])
    start.qpos[scene.object_q : scene.object_q + 7] = log.pose("object")[0]
    mujoco.mj_kinematics(scene.model, start)
    player = Player(history)
    opened = server.open_server(f"fingergait show {path.name}", host, port, show)
    page = Page(opened, history, scene, scenario, player.pacer, start)
    player.add_bar(page)
    player.start()
    page.start()
    try:
        yield player, page
    finally:
        player.stop()
        page.stop()


class Player(threading.Thread):
    """Moves through the rows of a log in its own time, and stands at its end.

    Attributes
    ----------
    pacer
        Pause, step and speed.
    """

    def __init__(self, history: Recorded) -> None:
        super().__init__(name="fingergait-player", daemon=True)
        self.pacer = Pacer()
        self._history = history
        self._t = history.log.t
        self._ended = False
        self._bar: Any = None
        self._moved = 0.0
        history.at = 0

    def run(self) -> None:
        """Plays until `stop`."""
        while not self._ended:
            at = self._history.at or 0
            if at + 1 >= len(self._t):
                self.pacer.pause(True)
            if self.pacer.wait(float(self._t[at])):
                self._history.at = min(at + 1, len(self._t) - 1)

    def stop(self) -> None:
        """Ends the thread."""
        self._ended = True
        self.pacer.end()
        self.join()

    def seek(self, t: float) -> None:
        """Shows the row nearest to time t, s; the last one where that is no number."""
        self._history.at = min(int(np.searchsorted(self._t, t)), len(self._t) - 1)
        self.pacer.restart()

    def add_bar(self, page: "Page") -> None:
        """Adds the time bar to the page."""
        first, last = float(self._t[0]), float(self._t[-1])
        self._bar = page.server.gui.add_slider(
            "t, s",
            min=round(first, 2),
            max=max(round(last, 2), round(first, 2) + 0.01),
            step=0.01,
            initial_value=round(first, 2),
        )

        def moved(event: Any) -> None:
            if event.client is not None:
                self._moved = time.perf_counter()
                self.seek(float(self._bar.value))

        self._bar.on_update(moved)
        page.ticks.append(lambda pose: self._follow(pose.row.t))

    def _follow(self, t: float) -> None:
        if time.perf_counter() - self._moved > _HANDS_OFF and abs(self._bar.value - t) > 0.1:
            self._bar.value = min(max(round(t, 2), self._bar.min), self._bar.max)
