"""Inputs that change during a run: what they may be, how the reference goes to them, and what they do to the plant."""

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

import fingergait as fg
from fingergait.run.pose_error import pose_errors
from fingergait.scenario import ReferenceConfig
from fingergait.scenario.reference import Trajectory
from fingergait.scenario.steering import ANGULAR, LINEAR

START = [0.0, 0.0, 0.06, 1.0, 0.0, 0.0, 0.0]
CONFIG = ReferenceConfig(lift=0.01, yaw_rate=0.2, swing_amplitude=0.1)
DT = 0.002


@pytest.mark.parametrize(
    "change, text",
    [
        ({"at": 1.0, "key": "gait.w1", "value": 1.0}, "input.0: expected a key out of reference.offset, "),
        ({"at": 1.0, "key": "reference.offset", "value": 1.0}, "expected six numbers"),
        ({"at": 1.0, "key": "truth.friction", "value": [0.0] * 6}, "expected one number for truth.friction"),
        ({"at": 1.0, "key": "truth.friction", "value": -1.0}, "expected 0.001 or more for truth.friction"),
        ({"at": 1.0, "key": "truth.friction", "value": 1.0, "until": 2.0}, "expected one of at, key, value"),
    ],
)
def test_an_input_that_is_wrong_is_refused(change: dict[str, object], text: str) -> None:
    with pytest.raises(fg.ConfigError, match="scenario: ") as error:
        fg.Scenario.build({"input": [change]})
    assert text in str(error.value) and "\n" not in str(error.value)


def test_steering_that_nobody_touches_changes_no_bit() -> None:
    plain, steered = Trajectory(CONFIG, START), Trajectory(CONFIG, START, steered=True)
    for t in np.arange(-0.3, 4.0, DT):
        for a, b in zip(plain.sample(t), steered.sample(t), strict=True):
            assert a.tobytes() == b.tobytes() or np.array_equal(a, b)


number = st.floats(-0.4, 0.4)


@settings(max_examples=20, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(asked=st.lists(st.tuples(st.integers(0, 900), number, number, number), max_size=8))
@example(asked=[(900, 0.07, 0.0, 0.0), (899, -0.2, -0.3, 0.0)])
def test_the_reference_never_jumps_and_its_twist_is_its_motion(asked: list[tuple[int, float, float, float]]) -> None:
    trajectory = Trajectory(CONFIG, START, steered=True)
    assert trajectory.steering is not None
    poses, twists = [], []
    for k in range(1000):
        for at, x, r, rate in asked:
            if at == k:
                trajectory.steering.ask("reference.offset", (0.02 * x, 0.0, 0.02 * r, r, x, -r))
                trajectory.steering.ask("reference.yaw_rate", rate)
                trajectory.steering.ask("reference.swing_amplitude", 0.2 * x)
        pose, twist = trajectory.sample(0.5 + k * DT)
        poses.append(pose.copy())
        twists.append(twist.copy())
    moved = pose_errors(np.array(poses[:-1]), np.array(poses[1:])) / DT  # the mean twist of each period
    mean = 0.5 * (np.array(twists[1:]) + np.array(twists[:-1]))
    bound = np.array([LINEAR[1]] * 3 + [3.0 * ANGULAR[1]] * 3)  # one change of rate within a period
    assert (np.abs(moved - mean) < 1.5 * bound * DT + 1e-9).all()  # which a goal reached within a period attains
    assert (np.abs(np.diff(np.array(twists), axis=0)) < 2.0 * bound * DT + 1e-3).all()


def test_the_reference_arrives_where_it_was_asked_to_and_rests() -> None:
    trajectory = Trajectory(ReferenceConfig(), START, steered=True)
    assert trajectory.steering is not None
    trajectory.sample(0.0)
    goal = (0.004, -0.003, 0.005, 0.1, -0.2, 0.3)
    trajectory.steering.ask("reference.offset", goal)
    for k in range(1, 2000):
        pose, twist = trajectory.sample(k * DT)
    error = pose_errors(np.array([START]), pose[None])[0]
    np.testing.assert_allclose(error, goal, atol=1e-9)
    assert not twist.any()


def test_the_plant_takes_friction_mass_noise_and_delay_while_it_runs() -> None:
    changes = [("truth.friction", 0.7), ("truth.mass_scale", 1.3), ("sensors.position_noise", 2e-4)]
    inputs = [{"at": 0.4, "key": key, "value": value} for key, value in changes]
    before = fg.simulate(fg.Scenario.load("hold", {"duration": 0.4})).log
    log = fg.simulate(fg.Scenario.load("hold", {"duration": 1.6, "input": inputs})).log
    same = slice(0, len(before))
    assert np.array_equal(log.pose("object")[same], before.pose("object")[same])
    noise = log["measured_x"] - log["object_x"]
    assert noise[log.t < 0.4].std() < 1e-9 and noise[log.t > 0.41].std() == pytest.approx(2e-4, rel=0.2)
    heavier = fg.simulate(fg.Scenario.load("hold", {"duration": 1.6, "truth.mass_scale": 1.3})).log
    late = log.t > 1.2
    weight = [table.block("friction_force")[late].sum(axis=1).mean() for table in (log, heavier)]
    assert weight[0] == pytest.approx(weight[1], rel=0.1)  # the fingers carry the heavier object
