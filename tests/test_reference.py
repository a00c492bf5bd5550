"""The desired motion: its twist against finite differences, and no jump where none is meant."""

import mujoco
import numpy as np
import pytest

from fingergait.scenario import ReferenceConfig
from fingergait.scenario.reference import Trajectory

MOTION = {"lift": 0.011, "yaw_rate": 0.2, "swing_amplitude": 0.1}
STEP = [0.004, 0.004, 0.01, 0.0, 0.0, 0.5]
UPRIGHT = np.array([0.0, 0.0, 0.06, 1.0, 0.0, 0.0, 0.0])


def trajectory(start: np.ndarray = UPRIGHT, **table: object) -> Trajectory:
    return Trajectory(ReferenceConfig.model_validate(table), start)


@pytest.mark.parametrize("t", [0.01, 0.3, 0.77, 1.1, 1.45, 2.0, 9.3])
def test_twist_is_the_poses_derivative(t: float) -> None:
    path = trajectory(np.array([0.01, -0.02, 0.06, 0.9, 0.1, -0.2, 0.3]), **MOTION, step=STEP, step_at=-1.0)
    h = 1e-6
    before, after = (path.sample(t + s)[0].copy() for s in (-h, h))
    difference, angular = np.zeros(4), np.zeros(3)
    mujoco.mju_mulQuat(difference, after[3:], before[3:] * [1, -1, -1, -1])
    mujoco.mju_quat2Vel(angular, difference, 2 * h)
    linear = (after[:3] - before[:3]) / (2 * h)
    np.testing.assert_allclose(path.sample(t)[1], [*linear, *angular], atol=1e-8)


def test_the_motion_begins_at_rest_and_never_jumps() -> None:
    path = trajectory(**MOTION)
    times = np.arange(-0.1, 5.0, 1e-3)
    twists = np.array([path.sample(t)[1].copy() for t in times])
    assert np.abs(twists[0]).max() == 0.0
    # Steps of 1 ms: the swing's onset reaches 3.9 rad/s^2, a sudden one would show as 0.4 rad/s.
    assert np.abs(np.diff(twists, axis=0)).max() < 4e-3
    assert np.abs(twists[times > 2.0, 4]).max() == pytest.approx(0.4, rel=1e-3)  # the paper's swing


def test_yaw_is_the_integral_of_its_blended_rate() -> None:
    path = trajectory(**MOTION)
    assert path.yaw(5.0) == (pytest.approx(0.2 * (5.0 - 1.25)), 0.2)
    assert path.yaw(1.0) == (0.0, 0.0)


def test_a_step_moves_the_pose_by_exactly_itself() -> None:
    path = trajectory(step=STEP)
    np.testing.assert_allclose(path.sample(-1e-3)[0], UPRIGHT, atol=1e-15)
    expected = [0.004, 0.004, 0.07, np.cos(0.25), 0.0, 0.0, np.sin(0.25)]
    np.testing.assert_allclose(path.sample(0.0)[0], expected, atol=1e-15)
    np.testing.assert_array_equal(path.sample(0.0)[1], 0.0)
