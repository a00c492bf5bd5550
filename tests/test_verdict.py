"""A run is a success where it did what was asked, and says in words why it did not."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fingergait as fg
from fingergait.run.log import Log, columns
from fingergait.run.verdict import FAULTS, MODES, verdict
from fingergait.scenario import Scenario
from fingergait.scenario.reference import Trajectory
from test_cli import call


def made(scenario: Scenario, yaw: np.ndarray | None = None, off: float = 0.0) -> Log:
    """A log of 100 Hz in which the object follows its reference, but for its yaw, if given, and a shift at the end."""
    log = Log(columns([f"f{j}" for j in range(4)], [3] * 4), [f"f{j}" for j in range(4)])
    trajectory = Trajectory(scenario.reference, [0.0, 0.0, 0.06, 1.0, 0.0, 0.0, 0.0])
    times = np.arange(0.0, scenario.duration, 0.01)
    index = {name: k for k, name in enumerate(log.names)}
    for k, t in enumerate(times):
        pose, _ = trajectory.sample(t)
        row = log.append(t)
        row[:] = 0.0
        row[0:7] = row[7:14] = pose
        if yaw is not None:
            row[3:7] = [np.cos(0.5 * yaw[k]), 0.0, 0.0, np.sin(0.5 * yaw[k])]
        row[index["threshold"]] = 0.001
    row[0] += off
    return log


def turning(**reference: Any) -> Scenario:
    return Scenario.build({"duration": 9.0, "reference": {"yaw_rate": 0.8, "blend": 0.4, **reference}})


def test_the_turn_asked_is_the_integral_of_the_rate() -> None:
    found = verdict(made(turning()), turning(), dropped=False)
    assert found["completed"] and found["incomplete_reason"] is None
    # A quintic blend of 0.4 s loses half of that time: 0.8 (t - 0.2), at the last sample.
    assert found["asked_rotation_rad"] == pytest.approx(0.8 * (8.99 - 0.2), abs=1e-5)
    assert found["turned_rad"] == pytest.approx(found["asked_rotation_rad"], abs=1e-5)
    assert not verdict(made(turning()), turning(), dropped=True)["completed"]


@pytest.mark.parametrize(("lag", "reached"), [(0.05, True), (0.15, False), (2.0 * np.pi, False), (-2.0 * np.pi, False)])
def test_whole_turns_count(lag: float, reached: bool) -> None:
    scenario = turning()
    trajectory = Trajectory(scenario.reference, [0.0, 0.0, 0.06, 1.0, 0.0, 0.0, 0.0])
    times = np.arange(0.0, scenario.duration, 0.01)
    yaw = np.array([trajectory.yaw(t)[0] for t in times]) - lag * np.linspace(0.0, 1.0, len(times))
    found = verdict(made(scenario, yaw), scenario, dropped=False)
    assert found["completed"] is reached
    if not reached:
        assert "degrees" in found["incomplete_reason"]


@pytest.mark.parametrize(("off", "reached"), [(0.008, True), (-0.012, False)])
def test_a_step_must_be_reached_to_10_mm(off: float, reached: bool) -> None:
    scenario = Scenario.build({"duration": 3.0, "reference": {"step": [0.02, 0.0, 0.0, 0.0, 0.0, 0.3], "step_at": 1.0}})
    found = verdict(made(scenario, off=off), scenario, dropped=False)
    assert found["completed"] is reached
    assert reached or "12 mm off" in found["incomplete_reason"]


def test_modes_faults_and_link_contacts_are_counted_and_explained() -> None:
    scenario = turning()
    log = made(scenario, yaw=np.zeros(900))
    index = {name: k for k, name in enumerate(log.names)}
    rows = log._rows[: len(log)]
    rows[300:, index["safe_mode"]] = MODES.index("hold")
    rows[300:, index["faults"]] = 1 << FAULTS.index("overdue")
    rows[10, index["faults"]] = 1 << FAULTS.index("late")
    rows[100:120, index["link_contact"]] = 1.0
    found = verdict(log, scenario, dropped=False)
    assert found["worst_safe_mode"] == "hold" and found["faults"] == ["late", "overdue"]
    assert found["safe_mode_fraction"] == pytest.approx(600 / 900)
    assert found["link_contacts"] == 20
    words = found["incomplete_reason"]
    assert "turned 0 of 403 degrees" in words and "stood still from 3.0 s" in words
    assert (
        "no finger could be freed" in words and "0.5 kg" in words and "0.65" in words and "controller.friction" in words
    )


def test_every_fault_has_words() -> None:
    from fingergait.run.verdict import _CAUSES

    assert set(FAULTS) - set(_CAUSES) <= {"torque_sensor"}  # which changes no mode


def test_a_run_whose_reference_stood_still_is_exit_status_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    fault = "fault=[{kind='sensor_nan', sensor='tactile', finger=2, at=1.5}]"
    arguments = ["run", "lift-and-rotate", "--duration", "5", "--set", fault, "--out", str(tmp_path)]
    assert call(monkeypatch, *arguments) == 1
    text = " ".join(capsys.readouterr().out.split())
    assert "NOT COMPLETED: turned " in text and "stood still from 1.5 s (mode hold)" in text and "tactile" in text
    figures = json.loads((tmp_path / "metrics.json").read_text())
    assert not figures["dropped"] and not figures["completed"] and figures["faults"] == ["tactile"]


@pytest.mark.parametrize("shift", [[0.0, 0.07, 0.0, 0.0, 0.0, 0.0], [0.4, -0.2, 0.3, 1.0, 0.0, 0.5]])
def test_a_pose_in_another_frame_is_refused_at_the_start(shift: list[float]) -> None:
    fault = {"kind": "pose_jump", "shift": shift, "at": -1.0}
    found = fg.simulate(Scenario.load("lift-and-rotate", {"duration": 3.0, "fault": [fault]}))
    words = found.metrics["incomplete_reason"]
    assert not found.metrics["completed"] and not found.metrics["dropped"]
    assert "refused at the start" in words and "frame" in words
    assert found.metrics["faults"] == ["pose_frame"]
    assert np.abs(found.log.block("tau_des")).max() < 0.05, "nothing but the fingers' own weight"


@pytest.mark.parametrize("shift", [[0.0, 0.008, 0.0], [-0.005, 0.0, 0.006]])
def test_a_pose_that_is_a_little_off_works(shift: list[float]) -> None:
    fault = {"kind": "pose_jump", "shift": [*shift, 0.0, 0.0, 0.0], "at": -1.0}
    scenario = Scenario.load("lift-and-rotate", {"duration": 3.0, "fault": [fault]})
    log = fg.simulate(scenario).log
    assert not log["faults"].any()
    # The measured pose is off, so the true one is judged against its own start.
    assert np.ptp(log.pose("object")[:, 2]) == pytest.approx(scenario.reference.lift, abs=1e-3)


SENSORS: dict[str, tuple[dict[str, Any], str]] = {
    "nothing felt": ({"kind": "tactile_lost"}, "tactile_lost"),
    "grams": ({"kind": "tactile_scale", "factor": 102.0}, "tactile_scale"),
    "a tenth": ({"kind": "tactile_scale", "factor": 0.1}, "tactile_scale"),
    "x and y swapped": ({"kind": "tactile_axes", "order": [1, 0, 2]}, "tactile_axes"),
    "x and z swapped": ({"kind": "tactile_axes", "order": [2, 1, 0]}, "contacts_lost"),
    "turned round": ({"kind": "tactile_axes", "order": [1, 2, 0]}, "contacts_lost"),
    "no encoder read": ({"kind": "encoder_dropout", "share": 1.0}, "encoder"),
}


@pytest.mark.parametrize("name", SENSORS)
def test_sensors_that_are_wrong_from_the_start_are_named(name: str) -> None:
    fault, expected = SENSORS[name]
    found = fg.simulate(Scenario.load("lift-and-rotate", {"duration": 2.5, "fault": [{"at": -1.0, **fault}]})).metrics
    assert expected in found["faults"], found["faults"]
    assert not found["completed"]
    sensor = "encoder" if expected == "encoder" else "tactile"
    assert sensor in found["incomplete_reason"] or "joint is read" in found["incomplete_reason"]


def test_turning_goes_on_while_a_fifth_of_the_reads_fails() -> None:
    fault = {"kind": "encoder_dropout", "share": 0.2, "at": -1.0}
    found = fg.simulate(Scenario.load("lift-and-rotate", {"duration": 8.0, "fault": [fault]})).metrics
    assert found["completed"] and found["faults"] == ["encoder"] and found["gaits"] >= 3
    assert found["max_position_error_m"] < 1e-3


def test_encoders_that_all_stand_still_are_named() -> None:
    """Only the first joint of each finger is read: the others say what they said at the start."""
    faults = [{"kind": "encoder_stuck", "finger": j, "joint": i, "at": -1.0} for j in range(4) for i in (1, 2)]
    found = fg.simulate(Scenario.load("lift-and-rotate", {"duration": 2.5, "fault": faults})).metrics
    assert not found["completed"] and not found["dropped"]
    assert "encoder_stuck" in found["faults"] and "encoders stand still" in found["incomplete_reason"]
