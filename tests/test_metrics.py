"""Metrics on signals whose answer is known."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fingergait._core import ConfigError
from fingergait.run.log import Log, columns
from fingergait.run.loss import LossMonitor
from fingergait.run.metrics import Timing, metrics_of, recovery_time, settling_times, step_times
from fingergait.run.pose_error import pose_errors, yaw_reached
from fingergait.run.sampling import missed, sampled
from fingergait.scenario import Disturbance, Scenario

STEP = (0.004, 0.0, 0.010, 0.0, 0.0, 0.5)


def quaternion(vector: np.ndarray) -> np.ndarray:
    """Quaternions wxyz (T, 4) of rotation vectors (T, 3)."""
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    axis = np.divide(vector, angle, out=np.zeros_like(vector), where=angle > 0.0)
    return np.hstack([np.cos(0.5 * angle), np.sin(0.5 * angle) * axis])


def poses(position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    return np.hstack([position, quaternion(rotation)])


def test_pose_error_is_the_difference_and_the_rotation_vector() -> None:
    rng = np.random.default_rng(2)
    # R_D = exp(e) R_O with a rotation about a fixed axis: then log(R_D R_O^T) = e.
    axis = np.array([0.6, 0.0, 0.8])
    before, error = rng.uniform(-1.5, 1.5, 200), rng.uniform(-1.5, 1.5, 200)
    p_O, p_D = rng.normal(size=(2, 200, 3))
    true = poses(p_O, before[:, None] * axis)
    desired = poses(p_D, (before + error)[:, None] * axis)
    desired[::2, 3:] *= -1.0  # the same rotation
    expected = np.hstack([p_D - p_O, error[:, None] * axis])
    np.testing.assert_allclose(pose_errors(true, desired), expected, atol=1e-9)
    np.testing.assert_array_equal(pose_errors(true, true)[:, 3:], 0.0)


def test_yaw_counts_whole_turns_and_ignores_the_swing() -> None:
    t = np.linspace(0.0, 100.0, 20001)
    yaw, swing = -0.2 * t, 0.1 * np.sin(4.0 * t)
    w, x, y, z = np.cos(swing / 2) * [[1.0]], 0.0, np.sin(swing / 2), 0.0
    c, s = np.cos(yaw / 2), np.sin(yaw / 2)
    q = np.stack([w[0] * c, y * s, y * c, w[0] * s], axis=1)  # q_y q_z
    assert (x, z) == (0.0, 0.0)
    reached = yaw_reached(np.hstack([np.zeros((len(t), 3)), q]))
    np.testing.assert_allclose(reached, yaw, atol=1e-9)


def test_settling_time_of_an_exponential_is_its_logarithm() -> None:
    t = np.arange(-1.0, 5.0, 1e-3)
    errors = np.outer(np.where(t >= 0.0, np.exp(-t / 0.2), 0.0), STEP)
    times = settling_times(t, errors, STEP, 0.0)
    expected = 0.2 * np.log(20.0)
    assert times["x"] == pytest.approx(expected, abs=1.5e-3)
    assert times["rz"] == times["z"] == times["x"] == times["max"]
    assert times["y"] is times["rx"] is None


def test_settling_counts_the_last_leaving_and_says_when_it_never_settles() -> None:
    t = np.arange(0.0, 2.0, 1e-3)
    errors = np.zeros((len(t), 6))
    errors[:, 0] = np.where((t < 0.1) | ((t > 0.5) & (t < 0.7)), 0.001, 0.0)
    assert settling_times(t, errors, (0.004, 0, 0, 0, 0, 0), 0.0)["x"] == pytest.approx(0.7, abs=2e-3)
    errors[-1, 2] = 1.0
    times = settling_times(t, errors, STEP, 0.0)
    assert times["z"] is None
    assert times["max"] is None


@pytest.mark.parametrize("kind", ["force", "torque"])
def test_recovery_is_measured_from_the_pulses_end_above_the_level_before(kind: str) -> None:
    t = np.arange(0.0, 5.0, 1e-3)
    end, decay = 2.2, 0.15
    bump = np.where(t < 2.0, 0.0, np.where(t < end, 1.0, np.exp(-(t - end) / decay)))
    error, other = 0.3 + 2.0 * bump, np.zeros(len(t))
    pulse = Disturbance(at=2.0, duration=end - 2.0, **{kind: (0.0, 1.0, 0.0)})  # type: ignore[arg-type]
    signals = (error, other) if kind == "force" else (other, error)
    assert recovery_time(t, *signals, pulse, float("inf")) == pytest.approx(decay * np.log(10.0), abs=2e-3)
    assert recovery_time(t, *signals, pulse, 2.3) is None  # the next pulse comes first
    # What a gait brings a second later is not the pulse's; what comes back at once is.
    for late, time in ((1.5, decay * np.log(10.0)), (0.6, 0.7)):
        error[(t >= end + late) & (t < end + late + 0.1)] = 1.0
        assert recovery_time(t, *signals, pulse, float("inf")) == pytest.approx(time, abs=2e-3)


def make_log(scenario: Scenario, steps: int) -> Log:
    """A log of a perfect run: every number zero, the poses upright and equal."""
    fingers = ["f0", "f1", "f2", "f3"]
    log = Log(columns(fingers, [3] * len(fingers)), fingers, 16)
    log.metadata = {"scenario": json.dumps(scenario.model_dump(mode="json", exclude_unset=True))}
    for k in range(steps):
        row = log.append(k * scenario.period)
        row[:] = 0.0
        row[[3, 10]] = 1.0
    return log


def set_column(log: Log, name: str, values: np.ndarray) -> None:
    log._rows[: len(log), log.names.index(name)] = values


def test_gaits_are_counted_and_their_gain_is_measured() -> None:
    scenario = Scenario.build({"metrics_from_s": 0.0})
    log = make_log(scenario, 1000)
    k = np.arange(1000)
    # Three gaits: two of finger 1 without a pause between them, one of finger 2 that the end cuts off.
    free = np.where((k >= 100) & (k < 300), 1.0, np.where(k >= 900, 2.0, -1.0))
    set_column(log, "free_finger", free)
    set_column(log, "gaits", (k >= 100).astype(float) + (k >= 200) + (k >= 900))
    set_column(log, "Q", np.where(k < 200, 1e-3 + 1e-6 * k, 1.2e-3 - 1e-6 * (k - 200)))
    set_column(log, "Q_dot", np.where((k >= 100) & (k < 300), np.where(k % 4 == 0, -1.0, 1.0), 0.0))
    metrics = metrics_of(log, scenario, None, Timing(np.full(1000, 5000), 0.5, {"active_set": 1000}), 0.5)
    assert metrics["gaits"] == 3
    assert metrics["gait_time_s"] == pytest.approx(0.2)
    assert metrics["quality_gain_fraction"] == pytest.approx(0.5)
    assert metrics["qdot_positive_fraction"] == pytest.approx(0.75)
    assert metrics["min_quality"] == pytest.approx(4.01e-4, rel=1e-3)
    assert metrics["real_time_factor"] == pytest.approx(4.0)
    assert metrics["step_us"]["mean"] == pytest.approx(5.0)
    assert metrics["deadline_misses"] == 0
    assert metrics["max_position_error_m"] == 0.0


def test_errors_count_from_their_time_on() -> None:
    scenario = Scenario.build({"metrics_from_s": 1.0})
    log = make_log(scenario, 1000)
    t = log.t
    set_column(log, "object_x", np.where(t < 1.0, 0.01, 0.001))
    set_column(log, "tau_des_3", np.where(t > 1.499, -0.5, 0.0))
    metrics = metrics_of(log, scenario, None, Timing(np.ones(1000, dtype=np.int64), 1.0), 0.5)
    assert metrics["max_position_error_m"] == pytest.approx(0.001)
    assert metrics["rms_position_error_m"] == pytest.approx(0.001)
    assert metrics["saturated_fraction"] == pytest.approx(0.5, abs=2e-3)


def test_step_times_are_percentiles_in_microseconds() -> None:
    times = step_times(np.arange(1, 10001) * 1000)
    assert times["median"] == pytest.approx(5000.5)
    assert times["p99"] == pytest.approx(9900.0, abs=1.0)
    assert times["p999"] == pytest.approx(9990.0, abs=1.0)
    assert times["max"] == 10000.0


UPRIGHT = np.array([0.0, 0.0, 0.06, 1.0, 0.0, 0.0, 0.0])
TOUCHING = np.ones(4)


@pytest.mark.parametrize(
    ("pose", "forces", "symptom"),
    [
        ([0.0, 0.011, 0.06, 1.0, 0.0, 0.0, 0.0], TOUCHING, "position error passed 10 mm"),
        ([0.0, 0.0, 0.06, np.cos(0.18), np.sin(0.18), 0.0, 0.0], TOUCHING, "orientation error passed 0.35 rad"),
        (UPRIGHT, [0.0, 0.0, 2.0, 0.0], "fewer than two fingertips"),
    ],
)
def test_an_object_is_lost_after_a_sustained_symptom(pose: list[float], forces: list[float], symptom: str) -> None:
    monitor = LossMonitor(Scenario.build({}))
    bad = np.asarray(pose)
    assert not monitor.update(1.0, bad, UPRIGHT, np.asarray(forces))
    assert not monitor.update(1.05, UPRIGHT, UPRIGHT, TOUCHING)  # recovered: the count starts anew
    assert not monitor.update(1.06, bad, UPRIGHT, np.asarray(forces))
    assert not monitor.update(1.15, bad, UPRIGHT, np.asarray(forces))
    assert monitor.update(1.161, bad, UPRIGHT, np.asarray(forces))
    assert symptom in monitor.symptom


def test_yaw_that_lags_is_no_loss_once_the_reference_has_stood_until_it_has_caught_up() -> None:
    monitor = LossMonitor(Scenario.build({}))
    turned = np.array([0.0, 0.0, 0.06, np.cos(0.5), 0.0, 0.0, np.sin(0.5)])
    tilted = np.array([0.0, 0.0, 0.06, np.cos(0.5), np.sin(0.5), 0.0, 0.0])
    assert not monitor.update(0.0, UPRIGHT, turned, TOUCHING, standing=True)
    assert not monitor.update(1.0, UPRIGHT, turned, TOUCHING)
    assert not monitor.update(1.2, UPRIGHT, tilted, TOUCHING)
    assert monitor.update(1.4, UPRIGHT, tilted, TOUCHING)
    assert not monitor.update(2.0, UPRIGHT, UPRIGHT, TOUCHING)  # caught up
    assert not monitor.update(3.0, UPRIGHT, turned, TOUCHING)
    assert monitor.update(3.2, UPRIGHT, turned, TOUCHING)


def test_a_step_of_the_reference_is_no_loss_while_it_settles() -> None:
    monitor = LossMonitor(Scenario.build({"reference": {"step": [0.0, 0.0, 0.03, 0.0, 0.0, 0.5]}}))
    desired = np.array([0.0, 0.0, 0.09, np.cos(0.25), 0.0, 0.0, np.sin(0.25)])
    assert not monitor.update(0.0, UPRIGHT, desired, TOUCHING)
    assert not monitor.update(1.0, UPRIGHT, desired, TOUCHING)
    assert not monitor.update(2.0, UPRIGHT, desired, TOUCHING)
    assert monitor.update(2.2, UPRIGHT, desired, TOUCHING)


def test_a_log_survives_its_file(tmp_path: Path) -> None:
    log = make_log(Scenario.build({"name": "case"}), 50)
    set_column(log, "Q", np.linspace(0.0, 1.0, 50))
    log.write(tmp_path / "log.parquet")
    again = Log.read(tmp_path / "log.parquet")
    assert again.names == log.names
    assert again.fingers == log.fingers
    assert again.metadata == log.metadata
    np.testing.assert_array_equal(again.t, log.t)
    np.testing.assert_array_equal(again["Q"], log["Q"])
    assert again.block("measured_force").shape == (50, 4)
    assert again.last("Q") == 1.0


def test_a_file_that_is_no_log_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    path.write_text("nothing")
    with pytest.raises(ConfigError, match="expected a log in Parquet"):
        Log.read(path)


def test_the_suite_draws_what_it_says() -> None:
    drawn = [sampled(seed) for seed in range(300)]
    columns_ = {
        "radius": ([s.object.size[0] for s in drawn], 0.022, 0.030),
        "half-height": ([s.object.size[1] for s in drawn], 0.050, 0.070),
        "mass": ([s.object.mass for s in drawn], 0.3, 0.7),
        "mass scale": ([s.truth.mass_scale for s in drawn], 0.6, 1.4),
        "inertia scale": ([s.truth.inertia_scale for s in drawn], 0.5, 1.5),
        "finger turn": (np.ravel([s.truth.finger_offset_deg for s in drawn]), -5.0, 5.0),
        "finger height": (np.ravel([s.truth.finger_height_offset for s in drawn]), -0.003, 0.003),
        "offset": (np.hypot(*np.transpose([s.truth.first_grasp[:2] for s in drawn])), 0.0, 0.003),
    }
    for name, (values, lower, upper) in columns_.items():
        values = np.asarray(values)
        assert lower <= values.min() and values.max() <= upper, name
        assert values.max() - values.min() > 0.9 * (upper - lower), name
    assert {s.reference.yaw_rate for s in drawn} == {-0.2, 0.2}
    assert {s.sensors.contact_place_noise for s in drawn} == {3e-4}
    assert {s.duration for s in drawn} == {40.0}
    assert sampled(7) == sampled(7) != sampled(8)


def test_the_suites_limits() -> None:
    good = {"dropped": False, "max_position_error_m": 1e-3, "max_orientation_error_rad": 0.03}
    assert missed(good) == []
    assert missed({**good, "dropped": True}) == ["lost"]
    assert missed({**good, "max_position_error_m": 1.1e-3}) == ["1.10 mm > 1"]
    assert missed({**good, "max_orientation_error_rad": None}) == ["none mrad > 30"]


def test_a_missing_gl_library_costs_the_pictures_only(tmp_path: Path) -> None:
    code = "from fingergait.run.report.film import film_strip; import sys; print(film_strip(*sys.argv[1:]))"
    log = tmp_path / "log.parquet"
    make_log(Scenario.build({"name": "case"}), 50).write(log)
    done = subprocess.run(
        [sys.executable, "-c", code, str(log), str(tmp_path / "film.png")],
        env={"PATH": "/usr/bin:/bin", "MUJOCO_GL": "no-such-library"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "no strip: no GL library" in done.stdout
    assert "apt-get install libegl1" in done.stdout
