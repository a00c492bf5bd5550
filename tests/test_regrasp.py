"""Set down and take again, in closed loop: on the palm of the paper's hand, and on a table under three fingers."""

import math

import numpy as np
import pytest

import fingergait as fg


@pytest.fixture(scope="module")
def run() -> fg.Run:
    """Nine seconds: two set-downs."""
    return fg.simulate(fg.Scenario.load("regrasp-on-palm", {"duration": 9.0}))


def test_a_slippery_object_turns_by_regrasping_on_the_palm(run: fg.Run) -> None:
    figures = run.metrics["regrasp"]
    assert not run.metrics["dropped"]
    assert figures["set_downs"] == 2
    assert figures["failed_grasps"] == 0
    assert figures["turned_in_air_rad"] > math.radians(90.0)


def test_the_object_follows_its_reference_in_the_air(run: fg.Run) -> None:
    figures = run.metrics["regrasp"]
    assert figures["max_position_error_in_air_m"] < 1e-3
    assert figures["max_orientation_error_in_air_rad"] < 0.02
    assert figures["max_drift_on_support_m"] < 1e-3
    assert figures["dragged_rad"] < 0.05


def test_only_what_is_felt_tells_that_the_object_lies(run: fg.Run) -> None:
    # It is on the palm when the controller says so, and was not a moment before.
    phase, height = run.log["regrasp"].astype(int), run.log.pose("object")[:, 2]
    names = fg._core.Diagnostics.regrasp_phase_names()
    for k in np.flatnonzero(np.diff(phase)) + 1:
        if names[phase[k]] == "release":
            assert abs(height[k] - height[0]) < 5e-4


def turned_in_air(run: fg.Run) -> float:
    return math.degrees(run.metrics["regrasp"]["turned_in_air_rad"])


# Both ways, the mass up or down: how far each turns in 12 s in the air, and how exactly, mrad.
@pytest.mark.parametrize(
    ("name", "rate", "mass_scale", "degrees", "mrad"),
    [
        ("regrasp-cylinder", 2.0, 1.2, 570.0, 12.0),
        ("regrasp-cylinder", -2.0, 0.8, 570.0, 12.0),
        ("regrasp-cube", 2.0, 0.8, 340.0, 40.0),
        ("regrasp-cube", -2.0, 1.2, 340.0, 40.0),
    ],
)
def test_three_fingers_turn_an_object_on_a_table_without_end(
    name: str, rate: float, mass_scale: float, degrees: float, mrad: float
) -> None:
    keys = {"duration": 12.0, "reference.yaw_rate": rate, "truth.mass_scale": mass_scale, "seed": 3}
    run = fg.simulate(fg.Scenario.load(name, keys))
    figures = run.metrics["regrasp"]
    assert run.metrics["completed"] and not run.metrics["dropped"], run.metrics["incomplete_reason"]
    assert math.copysign(1.0, rate) * turned_in_air(run) > degrees
    assert figures["dragged_rad"] < math.radians(5.0)
    assert figures["max_position_error_in_air_m"] < 1e-3
    assert figures["max_orientation_error_in_air_rad"] < 1e-3 * mrad
    assert figures["max_drift_on_support_m"] < 1e-3
    assert figures["failed_grasps"] <= 1


def test_a_hand_that_can_spare_no_finger_regrasps_of_itself() -> None:
    run = fg.simulate(fg.Scenario.load("regrasp-cylinder", {"duration": 6.0, "gait.change": "auto"}))
    assert run.metrics["gaits"] == 0 and "overdue" not in run.metrics["faults"]
    assert turned_in_air(run) > 240.0


def test_a_hand_that_can_spare_a_finger_walks() -> None:
    run = fg.simulate(fg.Scenario.load("lift-and-rotate", {"duration": 6.0, "gait.change": "auto"}))
    assert run.metrics["gaits"] > 0 and run.metrics["regrasp"] is None


# It is tipped onto the table when it is let go, and upright again once it is lifted.
@pytest.mark.parametrize("support", [{"tilt_deg": [5.0, 0.0]}, {"tilt_deg": [0.0, -5.0]}, {"softness": 5.0}])
def test_a_tilted_or_soft_support_is_felt_all_the_same(support: dict[str, object]) -> None:
    keys = {"duration": 8.0, **{f"support.{key}": value for key, value in support.items()}}
    run = fg.simulate(fg.Scenario.load("regrasp-cylinder", keys))
    figures = run.metrics["regrasp"]
    assert not run.metrics["dropped"] and figures["set_downs"] >= 2
    assert turned_in_air(run) > 330.0
    assert figures["max_position_error_in_air_m"] < 1e-3
    assert figures["max_orientation_error_in_air_rad"] < 0.02
    assert figures["max_drift_on_support_m"] < 5e-3


def test_gaits_alone_do_not_set_down() -> None:
    run = fg.simulate(fg.Scenario.load("regrasp-on-palm", {"duration": 2.0, "gait.change": "gait"}))
    assert run.metrics["regrasp"] is None
