"""Set down and take again, in closed loop, on the palm of the paper's hand."""

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


def test_gaits_alone_do_not_set_down() -> None:
    run = fg.simulate(fg.Scenario.load("regrasp-on-palm", {"duration": 2.0, "gait.change": "gait"}))
    assert run.metrics["regrasp"] is None
