"""The live page in a real browser without a display: what a person would see and do."""

import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fingergait.run.simulate import simulate
from fingergait.scenario import Scenario
from fingergait.view import server

if server.missing is not None:
    pytest.skip("expected the packages of the live page: pip install 'fingergait[view]'", allow_module_level=True)
from fingergait.view.page import Page
from fingergait.view.play import bench
from fingergait.view.screenshot import BROWSERS, browser, open_page
from fingergait.view.session import Session
from fingergait.view.show import replay

pytestmark = pytest.mark.timeout(600)  # the CPU draws, and may have other work


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    pytest.importorskip("playwright")
    if not any(map(shutil.which, BROWSERS)):
        pytest.skip("expected Chromium, found none; install it: apt-get install chromium")
    with browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def playing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Session, Page, Path]]:
    folder = tmp_path_factory.mktemp("play")
    with bench(Scenario.load("lift-and-rotate"), server.HOST, 18200, folder=folder) as (session, page):
        yield session, page, folder


@pytest.fixture(scope="module")
def tab(chromium: Any, playing: tuple[Session, Page, Path]) -> Any:
    shown = tab_of(chromium, playing[1])
    shown.errors = []
    shown.on("pageerror", lambda error: shown.errors.append(str(error)))
    return shown


def address(page: Page) -> str:
    return f"http://127.0.0.1:{page.server.get_port()}"


@pytest.fixture(autouse=True)
def going(playing: tuple[Session, Page, Path]) -> Iterator[None]:
    """A test that fails doesn't leave the bench standing."""
    yield
    playing[0].pacer.pause(False)


def tab_of(chromium: Any, page: Page) -> Any:
    """The page in a small tab of its own: the CPU draws the scene."""
    page.server.scene.configure_default_lights(cast_shadow=False)
    page.server.scene.configure_environment_map(None)
    for name, switch in page.overlays.switches.items():
        switch.value = name == "forces"
    return open_page(chromium, address(page), 1040, 360, rate=6.0)


def until(true: Callable[[], bool], timeout: float = 200.0) -> None:
    end = time.perf_counter() + timeout
    while not true():
        assert time.perf_counter() < end, "it never came true"
        time.sleep(0.05)


def picture(page: Page) -> NDArray[np.int16]:
    """The scene as a browser draws it now."""
    client = next(iter(page.server.get_clients().values()))
    return np.asarray(client.get_render(height=120, width=160))[:, :, :3].astype(np.int16)


def difference(page: Page) -> float:
    """Share of the scene that changes within a second."""
    first = picture(page)
    time.sleep(1.0)
    return float((np.abs(picture(page) - first).max(axis=2) > 24).mean())


def newest(session: Session, name: str) -> NDArray[np.float64]:
    until(lambda: session.history.row() is not None)  # a run that begins anew has none for a moment
    row = session.history.row()
    assert row is not None
    return row.group(name)


def error(page: Page) -> float:
    """Largest position error that the page's first plot shows, mm."""
    return float(max(page.plots.charts[0].data[1]))


def press(tab: Any, row: str, name: str) -> None:
    """Clicks a button of a group by the label of its row."""
    tab.get_by_text(row, exact=True).locator("xpath=ancestor::*[.//button][1]").get_by_role(
        "button", name=name, exact=True
    ).click()


def test_the_object_turns_and_stands_while_paused(playing: tuple[Session, Page, Path], tab: Any) -> None:
    session = playing[0]
    until(lambda: newest(session, "object").size == 7)
    moving = difference(playing[1])
    tab.get_by_role("button", name="pause", exact=True).click()
    until(lambda: session.pacer.paused)
    assert moving > 0.005
    until(lambda: difference(playing[1]) < 0.1 * moving)  # the CPU draws: the picture may come late
    tab.get_by_role("button", name="go on", exact=True).click()
    until(lambda: not session.pacer.paused)
    assert tab.errors == []


def test_a_push_moves_the_error_plot(playing: tuple[Session, Page, Path], tab: Any) -> None:
    session, page, _ = playing
    until(lambda: float(newest(session, "object")[2]) > 0.07)  # it has been lifted
    before = error(page)
    chart = tab.locator(".uplot canvas").first
    first = chart.screenshot()
    press(tab, "push", "+x")
    until(lambda: error(page) > 3.0 * before + 0.1)
    assert chart.screenshot() != first
    assert len(session.inputs.record) == 1


def test_a_finger_without_power_is_shown_and_explained(playing: tuple[Session, Page, Path], tab: Any) -> None:
    session = playing[0]
    press(tab, "no power, finger", "1")
    tab.get_by_text("hold: the object is held where it is, because a motor gives no torque").wait_for()
    tab.get_by_text("safe mode hold").wait_for()
    assert session.lost is None
    tab.get_by_text("safe mode normal").wait_for()  # its power is back


def test_the_gizmo_drags_the_object_there_and_back(playing: tuple[Session, Page, Path], tab: Any) -> None:
    session, page, _ = playing
    press_rate = session.inputs
    press_rate.set("yaw_rate", 0.0)  # so that the object's height is the gizmo's alone
    press_rate.set("swing", 0.0)
    time.sleep(2.0)
    height = float(newest(session, "object")[2])
    grip, along = handle(page)
    drag(tab, grip, grip - 60.0 * along)
    until(lambda: float(newest(session, "object")[2]) < height - 0.003)
    lower = float(session.inputs.bounds[0][2])
    time.sleep(1.0)
    assert height + lower - 1e-3 < float(newest(session, "object")[2]) < height - 0.003
    tab.get_by_role("button", name="gizmo back").click()
    until(lambda: abs(float(newest(session, "object")[2]) - height) < 5e-4)
    assert session.lost is None


def handle(page: Page) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the gizmo's upward arrow is on the screen, px, and which way it points there."""
    (client,) = page.server.get_clients().values()
    camera = client.camera
    goal = page.server.scene.get_handle_by_name("/goal")
    assert goal is not None
    R = np.asarray(camera_rotation(camera.wxyz))
    focal = 0.5 * camera.image_height / np.tan(0.5 * camera.fov)
    points = []
    for up in (0.45, 0.55):
        p = R.T @ (np.asarray(goal.position) + [0.0, 0.0, up * 0.6 * page.drawing.size] - camera.position)
        points.append(np.array([focal * p[0] / p[2], focal * p[1] / p[2]]))
    along = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
    return points[1] + [0.5 * camera.image_width, 0.5 * camera.image_height], along


def camera_rotation(wxyz: Any) -> NDArray[np.float64]:
    import viser.transforms as vtf

    return vtf.SO3(np.asarray(wxyz)).as_matrix()


def drag(tab: Any, begin: NDArray[np.float64], end: NDArray[np.float64]) -> None:
    box = tab.locator("canvas[data-engine]").bounding_box()
    begin, end = begin + [box["x"], box["y"]], end + [box["x"], box["y"]]
    tab.mouse.move(*begin)
    time.sleep(0.3)
    tab.mouse.down()
    for share in np.linspace(0.0, 1.0, 8):
        tab.mouse.move(*(begin + share * (end - begin)))
        time.sleep(0.05)
    tab.mouse.up()


def test_what_was_played_is_saved_as_a_scenario_that_runs(playing: tuple[Session, Page, Path], tab: Any) -> None:
    playing[0].pacer.pause(True)  # there is time for the second run then
    tab.get_by_role("button", name="save as a scenario").click()
    tab.get_by_text("It repeats with").wait_for()
    (file,) = playing[2].glob("*.toml")
    scenario = Scenario.load(file)
    assert scenario.disturbance and scenario.fault and scenario.input
    assert not simulate(scenario.replace({"duration": 1.0})).metrics["dropped"]


def test_two_pages_share_the_bench_and_closing_them_ends_nothing(
    chromium: Any, playing: tuple[Session, Page, Path], tab: Any
) -> None:
    session, page, _ = playing
    other = tab_of(chromium, page)
    until(lambda: len(page.server.get_clients()) == 2)
    clock = other.get_by_text("gaits")  # in the line that begins with the time
    said = clock.inner_text()
    until(lambda: clock.inner_text() != said)
    asked = len(session.inputs.record)
    press(other, "push", "-x")
    until(lambda: len(session.inputs.record) == asked + 1)
    other.close()
    until(lambda: len(page.server.get_clients()) == 1)
    steps = session.steps
    until(lambda: session.steps > steps + 200)
    assert session.failure is None and page.failure is None


def test_reset_begins_anew(playing: tuple[Session, Page, Path], tab: Any) -> None:
    session = playing[0]
    tab.get_by_role("button", name="reset").click()
    until(lambda: session.runs == 1)
    row = session.history.row()
    assert session.inputs.record == [] and (row is None or row.t < 3.0)
    until(lambda: float(newest(session, "desired")[2]) > 0.07)
    assert session.lost is None and tab.errors == []


def test_the_simulation_goes_on_without_any_page(playing: tuple[Session, Page, Path], tab: Any) -> None:
    session, page, _ = playing
    tab.close()
    until(lambda: not page.server.get_clients())
    steps = session.steps
    until(lambda: session.steps > steps + 200)
    assert session.failure is None and page.failure is None


def test_a_recorded_run_has_a_time_bar(chromium: Any, playing: tuple[Session, Page, Path], tmp_path: Path) -> None:
    playing[0].pacer.pause(True)
    log = simulate(Scenario.load("lift-and-rotate", {"duration": 3.0})).log
    log.write(tmp_path / "log.parquet")
    with replay(tmp_path / "log.parquet", server.HOST, 18300) as (player, page):
        shown = tab_of(chromium, page)
        until(lambda: player.pacer.paused)  # it has come to its end
        bar = shown.get_by_text("t, s", exact=True).locator("xpath=ancestor::*[.//input][1]").locator("input").last
        until(lambda: float(bar.input_value()) > 2.8)  # the page has come there too
        bar.fill("1.5")
        bar.press("Enter")
        shown.get_by_text("t = 1.50 s, paused").wait_for()
        shown.close()
        assert page.failure is None
