"""The table of faults in docs/safety.md in the closed loop: the object survives, and all returns to normal."""

from typing import Any

import numpy as np
import pytest

import fingergait as fg
from fingergait.scenario import Scenario

AT, LAST, END = 2.0, 0.6, 4.5  # s: the object has been lifted and turns; gaits begin later
MODES = {"normal": 0, "hold": 1, "squeeze": 2, "damp": 3, "stop": 4}
BITS = {
    name: 1 << bit
    for bit, name in enumerate(
        "clock late encoder encoder_stuck pose pose_jump pose_stale tactile tactile_lost tactile_stuck".split()
    )
}
BITS |= {"reference": 1 << 10, "motor": 1 << 16, "finger_lost": 1 << 17, "overdue": 1 << 18}

FAULTS: list[tuple[dict[str, Any], str | None, str]] = [
    ({"kind": "sensor_nan", "sensor": "encoder", "finger": 1}, "encoder", "hold"),
    ({"kind": "sensor_nan", "sensor": "encoder"}, "encoder", "hold"),
    ({"kind": "sensor_nan", "sensor": "pose"}, "pose", "squeeze"),
    ({"kind": "sensor_nan", "sensor": "tactile", "finger": 2}, "tactile", "hold"),
    ({"kind": "sensor_nan", "sensor": "tactile"}, "tactile", "hold"),
    ({"kind": "pose_jump", "shift": [0.03, 0.0, 0.02, 0.0, 0.0, 0.0]}, "pose_jump", "squeeze"),
    ({"kind": "pose_jump", "shift": [0.0, 0.0, 0.0, 0.0, 0.0, 0.8]}, "pose_jump", "squeeze"),
    ({"kind": "pose_stale"}, "pose_stale", "squeeze"),
    ({"kind": "encoder_stuck", "finger": 0, "joint": 1, "duration": 2.0}, None, "hold"),
    ({"kind": "encoder_offset", "finger": 2, "joint": 0, "shift": 0.3}, "encoder", "hold"),
    ({"kind": "encoder_range", "finger": 3, "joint": 2}, "encoder", "hold"),
    ({"kind": "tactile_lost", "finger": 1}, "tactile_lost", "hold"),
    ({"kind": "tactile_lost"}, "tactile_lost", "hold"),
    ({"kind": "tactile_stuck", "finger": 0}, "tactile_stuck", "hold"),
    ({"kind": "clock_stall"}, "clock", "hold"),
    ({"kind": "clock_jump", "shift": -5.0}, "clock", "normal"),
    ({"kind": "reference_nan"}, "reference", "hold"),
    ({"kind": "finger_power_loss", "finger": 2}, "motor", "hold"),
    ({"kind": "finger_power_loss", "finger": 1, "joint": 0}, "motor", "hold"),
    ({"kind": "motor_weak", "scale": 0.5}, None, "normal"),
    ({"kind": "dropped_ticks", "ticks": 5, "every": 50}, "late", "normal"),
]


@pytest.mark.parametrize(
    ("fault", "bit", "mode"), FAULTS, ids=lambda value: value.get("kind") if isinstance(value, dict) else None
)
def test_object_survives_and_all_returns_to_normal(fault: dict[str, Any], bit: str | None, mode: str) -> None:
    scenario = Scenario.load(
        "lift-and-rotate",
        {"duration": END + (1.0 if "duration" in fault else 0.0), "fault": [{"at": AT, "duration": LAST, **fault}]},
    )
    run = fg.simulate(scenario)
    log = run.log
    assert not run.metrics["dropped"]
    assert run.metrics["max_position_error_m"] < 2e-3
    faults = log["faults"].astype(int)
    if bit is not None:
        assert np.any(faults & BITS[bit])
    assert log["safe_mode"].max() <= MODES[mode]
    if bit is not None:
        assert log["safe_mode"].max() == MODES[mode]
    assert faults[-1] == 0
    assert log["safe_mode"][-1] == 0


@pytest.mark.parametrize(
    "sensors",
    [
        {},
        {"position_noise": 2e-4, "orientation_noise": 2e-3, "contact_place_noise": 3e-4, "contact_force_noise": 0.05},
        {"pose_rate_hz": 60.0, "pose_delay_s": 0.03},
        {"encoder_bits": 12},
        {
            "position_noise": 2e-4,
            "orientation_noise": 2e-3,
            "pose_rate_hz": 60.0,
            "pose_delay_s": 0.03,
            "encoder_bits": 12,
        },
    ],
    ids=["ideal", "noise", "slow", "bits", "all"],
)
def test_sensors_that_are_fit_raise_no_fault(sensors: dict[str, float]) -> None:
    overrides = {f"sensors.{key}": value for key, value in sensors.items()} | {"duration": 8.0}
    run = fg.simulate(Scenario.load("lift-and-rotate", overrides))
    assert not run.metrics["dropped"]
    assert not run.log["faults"].any()
    assert not run.log["safe_mode"].any()


@pytest.mark.parametrize(
    ("finger", "at", "duration"),
    # The other three hold, a gait of the finger opposite is under way, the finger itself slides; for ever.
    [(3, 3.0, 2.0), (2, 5.198, 3.93), (1, 4.871, 2.94), (0, 6.0, 20.0)],
)
def test_three_fingers_hold_while_one_has_no_power(finger: int, at: float, duration: float) -> None:
    fault = {"kind": "finger_power_loss", "finger": finger, "at": at, "duration": duration}
    run = fg.simulate(Scenario.load("lift-and-rotate", {"duration": 14.0, "fault": [fault]}))
    assert not run.metrics["dropped"]
    motor = (run.log["faults"].astype(int) & BITS["motor"]) != 0
    assert not motor[run.log.t < at].any()
    assert motor[(run.log.t > at + 1.5) & (run.log.t < at + duration)].all()
    assert not motor[run.log.t > at + duration + 0.2].any()


@pytest.mark.parametrize("name", ["push", "push-hard", "push-at-rest", "noisy", "slippery", "robust-step", "ellipsoid"])
def test_motors_that_are_fit_are_never_taken_for_dead(name: str) -> None:
    run = fg.simulate(Scenario.load(name))
    assert not (run.log["faults"].astype(int) & BITS["motor"]).any()


def test_an_angle_that_was_refused_is_believed_again_once_it_explains_the_contact() -> None:
    # Angles so alike that their exchange goes unseen; it moves the finger, and at the end the true angles have jumped.
    fault = {"kind": "joint_order_swapped", "finger": 3, "joint": 0, "other": 2, "at": 2.81, "duration": 0.03}
    log = fg.simulate(Scenario.load("lift-and-rotate", {"duration": 5.0, "fault": [fault]})).log
    faults = log["faults"].astype(int)
    assert np.any(faults[log.t > 2.9] & BITS["encoder"])
    assert faults[-1] == 0
    assert log["safe_mode"][-1] == 0


def test_an_encoder_that_is_off_for_good_is_refused_for_good() -> None:
    fault = {"kind": "encoder_offset", "finger": 1, "joint": 2, "shift": -0.3, "at": 3.0}
    run = fg.simulate(Scenario.load("lift-and-rotate", {"duration": 10.0, "fault": [fault]}))
    assert not run.metrics["dropped"]
    after = run.log.t > 3.0
    assert (run.log["faults"].astype(int)[after] & BITS["encoder"]).all()
    assert run.log["safe_mode"][-1] == MODES["hold"]


def test_the_object_is_held_while_a_finger_looks_for_it() -> None:
    # Its commands go to the wrong joints for a while, and it ends up off the object.
    fault = {"kind": "joint_order_swapped", "finger": 1, "joint": 0, "other": 1, "at": 4.0, "duration": 0.25}
    run = fg.simulate(Scenario.load("lift-and-rotate", {"duration": 15.0, "fault": [fault]}))
    assert not run.metrics["dropped"]
    assert np.any(run.log["faults"].astype(int) & BITS["finger_lost"])
    assert run.log["safe_mode"][-1] == 0


def test_the_object_is_held_where_no_finger_can_be_spared() -> None:
    # 0.6 kg at friction 0.4: three fingers cannot carry it, and turning on with four would lose it.
    overdue = []
    for seed in (5, 9):
        overrides = {"seed": seed, "truth": {"friction": 0.4, "mass_scale": 1.2}}
        run = fg.simulate(Scenario.load("slippery", overrides))
        assert not run.metrics["dropped"]
        overdue.append(bool(np.any(run.log["faults"].astype(int) & BITS["overdue"])))
    assert any(overdue)
