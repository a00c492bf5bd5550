"""The page of `fingergait run --view`: a run that `simulate` drives, held to real time and shown as it goes."""

import time
from types import TracebackType
from typing import TYPE_CHECKING

import mujoco

from fingergait.run.log import Log
from fingergait.sim.plant import MujocoPlant
from fingergait.stopping import StopFlag
from fingergait.view import server
from fingergait.view.history import Recorded
from fingergait.view.pacer import Pacer

if TYPE_CHECKING:
    from fingergait.view.page import Page

_LOOK = 0.2  # s between two looks at whether the user has asked to stop
_PATIENCE = 20.0  # s that the run waits for the page to be opened


class LivePage:
    """A watcher for `simulate` that shows the run on a page; to be called at every control step.

    Parameters
    ----------
    flag
        Whether the user has asked to stop: then nothing waits any more.
    host, port
        Where the page listens.
    patience
        How long the run waits for the page to be opened before it begins, s.
    """

    def __init__(
        self, flag: StopFlag, host: str = server.HOST, port: int = server.PORT, patience: float = _PATIENCE
    ) -> None:
        server.require()
        self._flag = flag
        self.pacer = Pacer()
        self.page: Page | None = None
        self._where, self._patience = (host, port), patience

    def __enter__(self) -> "LivePage":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self.page is not None:
            self.page.stop()
            if kind is None and self.page.failure is not None:
                raise self.page.failure

    def __call__(self, plant: MujocoPlant, log: Log) -> bool:
        """Waits until the step is due; never ends the run."""
        if self.page is None:
            self._open(plant, log)
        self._history.published = len(log)
        while not self.pacer.wait(plant.t, timeout=_LOOK) and not self._flag:
            pass
        return False

    def _open(self, plant: MujocoPlant, log: Log) -> None:
        from fingergait.view.page import Page

        self._history = Recorded(log)
        start = mujoco.MjData(plant.scene.model)
        start.qpos[:] = plant.start.qpos
        mujoco.mj_kinematics(plant.scene.model, start)
        opened = server.open_server(f"fingergait run {plant.scenario.name}", *self._where)
        self.page = Page(opened, self._history, plant.scene, plant.scenario, self.pacer, start)
        self.page.start()
        until = time.perf_counter() + self._patience
        while time.perf_counter() < until and not self._flag and not opened.get_clients():
            time.sleep(0.05)
