"""The live page without a browser: what it may ask, what it says, and that a session can be run again."""

import math
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

import fingergait as fg
from fingergait.cli import main
from fingergait.run.log import Log
from fingergait.run.simulate import simulate
from fingergait.run.stepper import Stepper
from fingergait.scenario import Input, Scenario
from fingergait.sim.plant import MujocoPlant
from fingergait.stopping import StopFlag
from fingergait.view import server
from fingergait.view.history import Names, Recorded, Ring, Row
from fingergait.view.inputs import CONTROLS, FAULT_TIME, FORCE, Inputs
from fingergait.view.pacer import Pacer
from fingergait.view.pose import PHASES, Pose
from fingergait.view.reach import reach
from fingergait.view.words import CAUSES, REGRASPING, explain

if server.missing is not None:
    pytest.skip("expected the packages of the live page: pip install 'fingergait[view]'", allow_module_level=True)

from fingergait.view.live import LivePage
from fingergait.view.play import bench
from fingergait.view.session import Session

BOUNDS = np.array([-0.01, -0.01, -0.01, -0.2, -0.2, -0.2]), np.array([0.01, 0.01, 0.01, 0.2, 0.2, 0.3])


def poses(log: Log, scenario: Scenario, rows: Any) -> list[Pose]:
    """Pose of each of these rows."""
    scene, names = MujocoPlant(scenario).scene, Names(log.names, log.fingers)
    t, values = log.raw()
    made = []
    for k in rows:
        pose = Pose(scene)
        pose.update(Row(float(t[k]), values[k], names))
        made.append(pose)
    return made


@pytest.fixture(scope="module")
def turning() -> tuple[Log, Scenario]:
    scenario = Scenario.load("lift-and-rotate", {"duration": 6.0})
    return simulate(scenario).log, scenario


# --- what the page may ask ---

anything = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.binary(max_size=8),
    st.lists(st.floats(), max_size=8),
    st.dictionaries(st.text(max_size=3), st.floats(), max_size=2),
    st.sampled_from([*CONTROLS, "+x", "-z", "power", "tactile", "stale", np.float32(3.0), 10**400, object()]),
)
calls = st.lists(
    st.one_of(
        st.tuples(st.just("set"), st.one_of(st.sampled_from(list(CONTROLS)), anything), anything),
        st.tuples(st.just("goal"), st.one_of(st.lists(st.floats(), min_size=6, max_size=6), anything)),
        st.tuples(st.just("push"), st.one_of(st.sampled_from(["+x", "-y"]), anything), anything),
        st.tuples(st.just("fault"), st.sampled_from(["power", "tactile", "stale"]), anything, anything),
        st.tuples(st.just("fault"), anything, st.integers(-2, 5), anything),
    ),
    max_size=60,
)


@settings(max_examples=150, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(calls=calls)
def test_nothing_that_a_page_sends_raises_or_leaves_its_range(calls: list[tuple[Any, ...]]) -> None:
    inputs = Inputs(4, BOUNDS, 0.002)
    for name, *arguments in calls:
        getattr(inputs, name)(*arguments)
    ranges = {key: (c.lower * f, c.upper * f) for c in CONTROLS.values() for key, f in c.keys.items()}
    events = inputs.take(0.0)
    assert len(events) <= 32 + len(ranges) + 1
    for event in events:
        if isinstance(event, fg.scenario.Disturbance):
            size = max(abs(x) for x in event.force)
            assert FORCE[0] <= size <= FORCE[1] and not any(event.torque)
        elif not isinstance(event, Input):
            assert FAULT_TIME[0] <= event.duration <= FAULT_TIME[1]
            assert 0 <= getattr(event, "finger", 0) < 4
        elif event.key == "reference.offset":
            assert (np.array(event.value) >= BOUNDS[0]).all() and (np.array(event.value) <= BOUNDS[1]).all()
        else:
            lower, upper = ranges[event.key]
            assert lower - 1e-12 <= event.number <= upper + 1e-12
    Scenario.build(inputs.saved(Scenario.load("hold"), 1.0))  # what was asked is a scenario


def test_a_number_changes_at_most_every_fifty_milliseconds() -> None:
    inputs = Inputs(4, BOUNDS, 0.002)
    taken = []
    for k in range(500):
        inputs.goal([0.001 * math.sin(0.1 * k), 0, 0, 0, 0, 0])
        taken += inputs.take(0.002 * k)
    assert len(taken) == 20


def test_the_gizmo_is_bounded_to_what_the_hand_holds() -> None:
    scenario = Scenario.load("hold", {"duration": 2.0})
    plant = MujocoPlant(scenario)
    lower, upper = reach(plant.scene, plant.start.qpos)
    assert (lower < 0.0).all() and (upper > 0.0).all() and (upper[:3] <= 0.015).all()
    for axis, bound in ((0, lower), (1, upper), (2, upper), (5, lower)):
        offset = np.where(np.arange(6) == axis, bound, 0.0).tolist()
        asked = {"input": [{"at": 0.1, "key": "reference.offset", "value": offset}]}
        metrics = simulate(scenario.replace(asked)).metrics
        assert not metrics["dropped"] and metrics["max_position_error_m"] < 2e-3, (axis, metrics)


# --- sessions ---


def test_a_session_that_was_saved_is_run_again_row_by_row(tmp_path: Path) -> None:
    import tomli_w

    session = Session(Scenario.load("lift-and-rotate"))
    rows = []
    asked: dict[int, Any] = {
        50: lambda: session.inputs.goal([0.003, -0.002, 0.004, 0.0, 0.1, 0.2]),
        300: lambda: session.inputs.set("yaw_rate", -0.3),
        400: lambda: (session.inputs.set("friction", 0.8), session.inputs.set("mass", 1.3)),
        500: lambda: (session.inputs.set("noise", 0.2), session.inputs.set("delay", 10.0)),
        700: lambda: session.inputs.push("-y", 4.0),
        900: lambda: session.inputs.fault("power", 2, 0.5),
        1300: lambda: session.inputs.fault("stale", None, 0.5),
    }
    for k in range(1700):
        asked.get(k, lambda: None)()
        session.step()
        row = session.history.row()
        assert row is not None
        rows.append(row.values)
    assert session.lost is None
    file = tmp_path / "session.toml"
    file.write_bytes(tomli_w.dumps(session.saved()).encode())
    log = simulate(Scenario.load(file)).log
    assert len(log) == len(rows)
    assert np.array_equal(log.raw()[1][: len(log)], np.array(rows), equal_nan=True)


def test_a_session_keeps_time_stands_steps_and_begins_anew() -> None:
    session = Session(Scenario.load("hold"))
    session.pacer.set_speed(0.5)
    session.start()
    time.sleep(1.0)
    session.pacer.pause(True)
    time.sleep(0.1)
    row = session.history.row()
    assert row is not None and row.t + 0.3 < 0.6  # half the time, however busy the machine is
    steps = session.steps
    session.pacer.step()
    session.pacer.step()
    time.sleep(0.2)
    assert session.steps == steps + 2
    session.inputs.push("+x", 5.0)
    session.reset()  # while it stands
    session.pacer.step()
    time.sleep(0.4)
    row = session.history.row()
    assert row is not None and row.t == pytest.approx(-0.3) and session.inputs.record == []
    session.stop()
    assert session.failure is None and session.wait(0.0)


def test_what_the_plant_does_wrong_ends_the_session_and_is_kept() -> None:
    session = Session(Scenario.load("hold"))
    session.inputs.take = lambda t: [object()]  # type: ignore[method-assign, list-item]
    session.start()
    assert session.wait(5.0)
    assert isinstance(session.failure, AttributeError)


# --- what is drawn and said ---


def test_forces_are_drawn_where_they_make_the_wrench_that_was_asked_for(turning: tuple[Log, Scenario]) -> None:
    log, scenario = turning
    compared = 0
    for pose in poses(log, scenario, range(700, len(log), 60)):
        if not pose.touching.all():
            continue
        wanted = pose.row.group("F_des") - pose.row.group("psi")
        arms = pose.places - pose.row.group("measured")[:3]
        torque = np.cross(arms, pose.forces).sum(axis=0)
        np.testing.assert_allclose([*pose.forces.sum(axis=0), *torque], wanted, atol=2e-3)
        compared += 1
    assert compared > 5


def test_a_reserve_is_what_brings_one_motor_to_its_limit(turning: tuple[Log, Scenario]) -> None:
    log, scenario = turning
    hand = fg.HandModel(fg.hand_json(Path(fg.paths.MODELS / "hand.xml")))
    for pose in poses(log, scenario, [900, 1500]):
        q = pose.row.group("q").reshape(4, 3)
        tau = pose.row.group("tau_des").reshape(4, 3)
        for j, reserve in enumerate(pose.reserve()):
            if pose.touching[j]:
                pressed = tau[j] + hand.jacobian(q, j, pose.places[j]).T @ pose.normals[j] * reserve
                assert np.abs(pressed).max() == pytest.approx(0.5, abs=1e-3)


def test_the_page_knows_the_cores_codes() -> None:
    faults = [
        {"kind": "finger_power_loss", "at": 0.2, "duration": 0.5, "finger": 1},
        {"kind": "reference_nan", "at": 1.0, "duration": 0.1},
        {"kind": "sensor_nan", "at": 1.3, "duration": 0.1, "sensor": "encoder", "finger": 0},
        {"kind": "tactile_lost", "at": 1.6, "duration": 0.3, "finger": 2},
        {"kind": "clock_jump", "at": 2.1, "duration": 0.1, "shift": 5.0},
    ]
    stepper = Stepper(Scenario.load("lift-and-rotate", {"fault": faults}))
    names, pose = Names(stepper.columns, stepper.fingers), Pose(stepper.plant.scene)
    values, seen = np.zeros(len(stepper.columns), dtype=np.float32), set()
    for _ in range(1300):
        diagnostics = stepper.plan()
        stepper.record(values)
        pose.update(Row(stepper.t, values, names))
        assert (pose.safe_mode, pose.faults) == (diagnostics.safe_mode, diagnostics.faults)
        assert (pose.phase, pose.free) == (diagnostics.phase, diagnostics.free_finger)
        seen |= {*pose.faults, pose.safe_mode}
        assert explain(pose)
        stepper.advance()
    assert {"motor", "reference", "encoder", "clock", "hold"} <= seen
    assert len(PHASES) == 5 and list(CAUSES) == fg.Diagnostics.fault_names()


def test_words_say_what_happens_and_why(turning: tuple[Log, Scenario]) -> None:
    log, scenario = turning
    said = {explain(pose) for pose in poses(log, scenario, range(0, len(log), 20))}
    assert any("have just closed" in words for words in said)
    assert any("slides: Q fell below its threshold; the others hold with " in words for words in said)
    assert any("Q is above its threshold. 4 fingers hold with " in words for words in said)
    lost = explain(poses(log, scenario, [900])[0], "the position error passed 10 mm")
    assert lost == "The object is lost: the position error passed 10 mm. Reset begins anew."


def test_words_follow_an_object_that_is_set_down_and_taken_again() -> None:
    assert list(REGRASPING) == [name for name in fg.Diagnostics.regrasp_phase_names() if name not in ("idle", "turn")]
    scenario = Scenario.load("regrasp-cylinder", {"duration": 3.0})
    log = fg.simulate(scenario).log
    said = " ".join(explain(pose) for pose in poses(log, scenario, range(0, len(log), 10)))
    for words in ("goes down until it is felt to lie", "all fingers go back round it", "is lifted again"):
        assert words in said


# --- rows ---


def test_a_ring_gives_the_newest_rows_while_it_is_written(turning: tuple[Log, Scenario]) -> None:
    names = Names(turning[0].names, turning[0].fingers)
    ring = Ring(names, 1000)
    assert ring.row() is None and len(ring.window(1.0, 50)[0]) == 0
    for k in range(5000):
        ring.append(0.002 * k)[:] = k
        ring.publish()
    row = ring.row()
    assert row is not None and row.t == pytest.approx(9.998) and row["Q"] == 4999.0
    t, rows = ring.window(0.5, 50)
    assert 45 <= len(t) <= 55 and (np.diff(t) > 0.0).all()
    np.testing.assert_allclose(rows[:, 0] * 0.002, t, atol=1e-9)
    ring.clear()
    assert ring.row() is None


def test_a_recorded_log_shows_the_row_it_is_at(turning: tuple[Log, Scenario]) -> None:
    recorded = Recorded(turning[0])
    recorded.at = 700
    row = recorded.row()
    assert row is not None and row.t == turning[0].t[700]
    assert recorded.window(1.0, 100)[0][-1] <= row.t


def test_a_pacer_keeps_the_speed_that_is_asked_for() -> None:
    pacer = Pacer()
    pacer.set_speed(4.0)
    begin = time.perf_counter()
    for k in range(400):
        assert pacer.wait(0.002 * k)
    assert time.perf_counter() - begin >= 0.8 / 4.0 - 0.01
    pacer.pause(True)
    threading.Timer(0.05, pacer.wake).start()
    assert not pacer.wait(1.0)
    pacer.end()
    assert not pacer.wait(1.0)


# --- the server and the commands ---


def test_a_port_in_use_gives_a_line_and_the_next_one(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        opened = server.open_server("test", port=port, show=False)
        try:
            printed = capsys.readouterr()
            assert opened.get_port() > port and opened.get_host() == "127.0.0.1"
            assert f"port {port} is in use; taking {opened.get_port()}\n" in printed.err
            assert f"live page: http://127.0.0.1:{opened.get_port()}\n" in printed.err
        finally:
            opened.stop()
    assert capsys.readouterr().out == ""


def test_other_addresses_are_warned_about_or_refused(capsys: pytest.CaptureFixture[str]) -> None:
    opened = server.open_server("test", host="0.0.0.0", port=18080, show=False)
    opened.stop()
    assert "warning: the page listens on 0.0.0.0" in " ".join(capsys.readouterr().err.split())
    with pytest.raises(fg.ConfigError, match="--host: expected an address of this machine, found '203.0.113.7'"):
        server.open_server("test", host="203.0.113.7", show=False)


def test_without_the_extra_a_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code = "import sys; sys.modules['viser'] = None; from fingergait.cli import main; sys.argv[1:] = ['play']; main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    monkeypatch.setattr(server, "missing", ImportError(name="viser"))
    said = [(done.returncode, done.stderr)]
    for command in (["show", "x.parquet"], ["run", "hold", "--view"]):
        monkeypatch.setattr(sys, "argv", ["fingergait", *command])
        with pytest.raises(SystemExit) as stop:
            main()
        said.append((stop.value.code, capsys.readouterr().err))
    for status, error in said:
        assert status == 2
        assert error.count("\n") == 1 and "pip install 'fingergait[view]'" in error


def test_a_run_with_a_page_gives_the_log_of_one_without() -> None:
    scenario = Scenario.load("hold", {"duration": 0.5})
    plain = simulate(scenario)
    with LivePage(StopFlag(), port=18090, patience=0.0) as page:
        begin = time.perf_counter()
        shown = simulate(scenario, page, every=0.0)
        assert time.perf_counter() - begin > 0.7  # it is held to real time
    assert np.array_equal(plain.log.raw()[1], shown.log.raw()[1], equal_nan=True)


@pytest.mark.parametrize(("patience", "paused"), [(100.0, False), (0.0, True)])
def test_a_run_that_waits_for_its_page_hears_who_stops_it(patience: float, paused: bool) -> None:
    flag = StopFlag()
    with LivePage(flag, port=18095, patience=patience) as page:
        page.pacer.pause(paused)
        timer = threading.Timer(1.0, lambda: setattr(flag, "signum", 2))
        timer.start()
        log = simulate(Scenario.load("hold"), lambda plant, log: bool(flag) or page(plant, log), every=0.0).log
        timer.join()
    assert len(log) < 10


@pytest.mark.parametrize("hand", [{}, {"hand.file": "five-unequal"}], ids=["four-by-four", "five-unequal"])
def test_any_hand_is_played_with(hand: dict[str, Any], tmp_path: Path) -> None:
    scenario = Scenario.load("hold" if hand else "hold-four-by-four", hand)
    with bench(scenario, server.HOST, 18110, folder=tmp_path) as (session, page):
        session.inputs.goal([0.01] * 6)
        until = time.perf_counter() + 60.0
        while (row := session.history.row()) is None or row.t < 0.6:
            assert time.perf_counter() < until and session.failure is None
            time.sleep(0.02)
        for count in range(6):  # every overlay, plot and word, as if somebody looked
            for switch in page.overlays.switches.values():
                switch.value = True
            page._picture(count)
        assert len(page.overlays._labels) == len(session.scene.fingers) == len(page.plots.charts[2].data) - 1
        assert session.lost is None and session.failure is None


def test_a_log_is_exported_for_rerun(tmp_path: Path, turning: tuple[Log, Scenario]) -> None:
    pytest.importorskip("rerun")
    from fingergait.view.rerun import export

    turning[0].write(tmp_path / "log.parquet")
    assert export(tmp_path / "log.parquet", tmp_path / "log.rrd") == 315
    assert (tmp_path / "log.rrd").stat().st_size > 100_000
    with pytest.raises(fg.ConfigError, match="--rerun: expected a .rrd file"):
        export(tmp_path / "log.parquet", tmp_path / "log.txt")


def test_the_page_draws_a_copy_of_the_model() -> None:
    from fingergait.view.drawing import Drawing

    plant = MujocoPlant(Scenario.load("hold"))
    before = plant.scene.model.geom_rgba.copy(), plant.scene.model.vis.scale.framewidth
    data = mujoco.MjData(plant.scene.model)
    mujoco.mj_kinematics(plant.scene.model, data)
    opened = server.open_server("test", port=18100, show=False)
    drawing = Drawing(opened, plant.scene, data)
    drawing.update(data)
    opened.stop()
    assert np.array_equal(plant.scene.model.geom_rgba, before[0])
    assert plant.scene.model.vis.scale.framewidth == before[1]
