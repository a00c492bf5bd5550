"""The work of `fingergait play`: a session with its page, until it is interrupted."""

import contextlib
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco

from fingergait.scenario import Scenario
from fingergait.stopping import stop_flag
from fingergait.view import server

if TYPE_CHECKING:
    from fingergait.view.page import Page
    from fingergait.view.session import Session


def play(scenario: Scenario, host: str = server.HOST, port: int = server.PORT) -> None:
    """Serves the bench until Ctrl-C.

    Parameters
    ----------
    scenario
        What is played with.
    host, port
        Where the page listens.
    """
    with stop_flag() as flag, bench(scenario, host, port, show=True) as (session, page):
        while not flag and not session.wait(0.5) and page.failure is None:
            pass
    failure = session.failure or page.failure
    if failure is not None:
        raise failure


@contextlib.contextmanager
def bench(
    scenario: Scenario, host: str, port: int, show: bool = False, folder: Path = Path("runs/play")
) -> "Iterator[tuple[Session, Page]]":
    """A session that runs, with its page; both end with the context.

    `folder` is where a scenario is saved to; `show` opens the page where there is a desktop.
    """
    server.require()
    from fingergait.view.bench import Bench
    from fingergait.view.page import Page
    from fingergait.view.session import Session

    session = Session(scenario)
    opened = server.open_server(f"fingergait play {scenario.name}", host, port, show)
    page = Page(opened, session.history, session.scene, scenario, session.pacer, started(session))
    Bench(page, session, folder / f"{scenario.name}-{time.strftime('%Y%m%d-%H%M%S')}.toml")
    session.start()
    page.start()
    try:
        yield session, page
    finally:
        session.stop()
        page.stop()


def started(session: "Session") -> mujoco.MjData:
    """The state that a session's run starts from."""
    data = mujoco.MjData(session.scene.model)
    data.qpos[:] = session.start_qpos
    mujoco.mj_kinematics(session.scene.model, data)
    return data
