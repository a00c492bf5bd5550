"""The page: scene, overlays, plots and words of a history, in threads that never make the simulation wait."""

import math
import sys
import threading
import time
from collections.abc import Callable

import mujoco
import viser

from fingergait.scenario import Scenario
from fingergait.sim.scene import SceneModel
from fingergait.view.drawing import Drawing
from fingergait.view.history import History
from fingergait.view.overlays import Overlays
from fingergait.view.pacer import SPEEDS, Pacer
from fingergait.view.plots import Plots
from fingergait.view.pose import Pose
from fingergait.view.words import explain

_FRAME = 1.0 / 30.0  # s between two pictures of the scene
_OVERLAYS, _WORDS, _PLOTS = 2, 3, 6  # pictures between two updates of each
_SWITCH = 5e-4  # s: how soon a thread that wants Python's lock gets it; five milliseconds are two control steps

Tick = Callable[[Pose], None]


class Page:
    """What is common to a run, a bench and a recorded log.

    Parameters
    ----------
    server
        Where the page lives.
    history
        What is shown.
    scene, scenario
        The model of the run, and what was asked.
    pacer
        What pause, step and speed act on.
    start
        `qpos` that the camera is framed to.

    Attributes
    ----------
    ticks
        Called with every picture.
    lost
        Says how the object was lost, if it was.
    failure
        The error that ended the drawing, if one did.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        history: History,
        scene: SceneModel,
        scenario: Scenario,
        pacer: Pacer,
        start: mujoco.MjData,
    ) -> None:
        sys.setswitchinterval(min(sys.getswitchinterval(), _SWITCH))
        self.server, self.pacer = server, pacer
        self._history = history
        self._pose = Pose(scene)
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(360)
        self._words = gui.add_markdown("...")
        with gui.add_folder("Time"):
            self._time = gui.add_markdown("")
            self._add_transport()
        self.drawing = Drawing(server, scene, start)
        panel = gui.add_panel()
        with panel.add_tab("Plots", viser.Icon.CHART_LINE):
            self.plots = Plots(server, history, self._pose)
        with panel.add_tab("Overlays", viser.Icon.STACK_2):
            self.overlays = Overlays(server, self._pose, scenario)
        panel.dock_left()
        panel.set_width(340)
        self._drawn = self._plotted = math.nan  # time of the row that the scene and the plots show
        self.ticks: list[Tick] = []
        self.lost: Callable[[], str | None] = lambda: None
        self.failure: Exception | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._draw, name="fingergait-page", daemon=True)

    def start(self) -> None:
        """Begins to draw."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the page."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self.server.stop()

    def _add_transport(self) -> None:
        gui, pacer = self.server.gui, self.pacer
        buttons = gui.add_button_group("Run", ("pause", "go on", "step"))
        speeds = {f"{speed:g} x": speed for speed in SPEEDS}
        chosen = gui.add_dropdown("Speed", tuple(speeds), initial_value="1 x")

        @buttons.on_click
        def _(event: object) -> None:
            if buttons.value == "step":
                pacer.step()
            else:
                pacer.pause(buttons.value == "pause")

        @chosen.on_update
        def _(event: object) -> None:
            pacer.set_speed(speeds.get(chosen.value, 1.0))

    def _draw(self) -> None:
        try:
            count, due = 0, time.perf_counter()
            while not self._stop.wait(max(0.0, due - time.perf_counter())):
                due = max(due + _FRAME, time.perf_counter())
                if self.server.get_clients():
                    self._picture(count)
                    count += 1
        except Exception as error:  # the command says so
            self.failure = error

    def _picture(self, count: int) -> None:
        row = self._history.row()
        if row is None:
            return
        pose = self._pose
        pose.update(row)
        if row.t != self._drawn:  # a run that stands costs the browser nothing
            self._drawn = row.t
            self.drawing.update(pose.data)
        for tick in self.ticks:
            tick(pose)
        if count % _OVERLAYS == 0:
            self.overlays.update(pose)
        if count % _PLOTS == 1 and row.t != self._plotted:
            self._plotted = row.t
            self.plots.update()
        if count % _WORDS == 2:
            self._say(pose)

    def _say(self, pose: Pose) -> None:
        words = f"**{explain(pose, self.lost())}**"
        if self._words.content != words:
            self._words.content = words
        state = "paused" if self.pacer.paused else f"real time x {self.pacer.factor:.2f}"
        self._time.content = (
            f"t = {pose.row.t:.2f} s, {state}, safe mode {pose.safe_mode}, {pose.row['gaits']:.0f} gaits"
        )
