"""Injected faults: what sensors say and motors do while each acts; a mistake in one is a line that names its field."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fingergait._core import ConfigError
from fingergait.run.simulate import simulate
from fingergait.scenario import Scenario
from fingergait.scenario.faults import KINDS
from fingergait.sim.injection import Injection
from fingergait.sim.plant import MujocoPlant
from fingergait.sim.scene import OBJECT, SceneModel, build_scene

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def scene() -> SceneModel:
    return build_scene(Scenario())


@dataclass
class Reading:
    """One measurement, as the injection gets it."""

    q: Array
    tau: Array
    pose: Array
    place: Array
    force: Array


def clean(t: float) -> Reading:
    """A measurement whose every number changes with time."""
    q = 0.1 * np.arange(12.0).reshape(4, 3) + t
    pose = np.array([0.01 * t, 0.0, 0.1, np.cos(t), 0.0, 0.0, np.sin(t)])
    return Reading(q, 0.01 + 0.1 * q, pose, 0.01 * np.ones((4, 3)) + 0.001 * t, np.full(4, 2.0) + t)


def injection(scene: SceneModel, **fault: Any) -> Injection:
    """The injection of one fault, from 1 s on for 1 s."""
    values = {"at": 1.0, "duration": 1.0, **fault}
    return Injection(scene, Scenario.build({}, {"fault": [values]}).fault)


def spoiled(faults: Injection, t: float) -> tuple[float, Reading]:
    reading = clean(t)
    said = faults.read(t, reading.q.reshape(-1), reading.tau.reshape(-1), reading.pose, reading.place, reading.force)
    return said, reading


def differing(scene: SceneModel, **fault: Any) -> dict[str, Any]:
    """What differs from a clean measurement halfway through the fault; checks that nothing does outside it."""
    faults = injection(scene, **fault)
    found: dict[str, Any] = {}
    for t in (0.998, 1.0, 1.5, 1.998, 2.0):
        said, reading = spoiled(faults, t)
        right = clean(t)
        if t < 1.0 or t >= 2.0:
            assert said == t
            for name, value in vars(reading).items():
                np.testing.assert_array_equal(value, getattr(right, name))
        if t == 1.5:
            found = {name: value for name, value in vars(reading).items() if (value != getattr(right, name)).any()}
            found |= {"t": said} if said != t else {}
    return found


def only(shape: tuple[int, ...], *where: tuple[int, ...] | int) -> NDArray[np.bool_]:
    mask = np.zeros(shape, dtype=bool)
    for index in where:
        mask[index] = True
    return mask


def test_nan_reaches_just_the_sensor_it_names(scene: SceneModel) -> None:
    found = differing(scene, kind="sensor_nan", sensor="encoder", finger=1, joint=2)
    assert set(found) == {"q"}
    np.testing.assert_array_equal(np.isnan(found["q"]), only((4, 3), (1, 2)))
    found = differing(scene, kind="sensor_nan", sensor="torque", finger=3)
    assert set(found) == {"tau"}
    np.testing.assert_array_equal(np.isnan(found["tau"]), only((4, 3), 3))
    found = differing(scene, kind="sensor_nan", sensor="pose")
    assert set(found) == {"pose"} and np.isnan(found["pose"]).all()
    found = differing(scene, kind="sensor_nan", sensor="tactile")
    assert set(found) == {"place", "force"} and np.isnan(found["force"]).all()


def test_a_pose_jumps_by_its_shift_and_stands_still_when_stale(scene: SceneModel) -> None:
    found = differing(scene, kind="pose_jump", shift=[0.01, 0.0, -0.02, 0.0, 0.0, 0.2])
    right = clean(1.5).pose
    np.testing.assert_allclose(found["pose"][:3], right[:3] + [0.01, 0.0, -0.02])
    np.testing.assert_allclose(found["pose"][3:], [np.cos(1.6), 0.0, 0.0, np.sin(1.6)])
    found = differing(scene, kind="pose_stale")
    np.testing.assert_array_equal(found["pose"], clean(1.0).pose)


def test_reads_fail_scales_and_axes_differ(scene: SceneModel) -> None:
    found = differing(scene, kind="encoder_dropout", share=1.0)
    assert set(found) == {"q"} and not found["q"].any()
    faults = injection(scene, kind="encoder_dropout", share=0.3)
    zeros = [not spoiled(faults, 1.0 + k / 2000)[1].q.any() for k in range(1000)]
    assert 0.25 < np.mean(zeros) < 0.35
    found = differing(scene, kind="tactile_scale", factor=0.1)
    np.testing.assert_allclose(found["force"], 0.1 * clean(1.5).force)
    faults = injection(scene, kind="tactile_axes", order=[2, 0, 1])
    reading = clean(1.5)
    reading.place[:] = [1.0, 2.0, 3.0]
    faults.read(1.5, reading.q, reading.tau, reading.pose, reading.place, reading.force)
    np.testing.assert_array_equal(reading.place, np.tile([3.0, 1.0, 2.0], (4, 1)))


def test_encoders_stick_and_leave_their_range(scene: SceneModel) -> None:
    found = differing(scene, kind="encoder_stuck", finger=2, joint=0)
    np.testing.assert_array_equal(found["q"] != clean(1.5).q, only((4, 3), (2, 0)))
    assert found["q"][2, 0] == clean(1.0).q[2, 0]
    found = differing(scene, kind="encoder_range", finger=2, joint=1, value=-7.0)
    assert found["q"][2, 1] == -7.0
    found = differing(scene, kind="encoder_offset", finger=1, joint=0, shift=0.3)
    assert found["q"][1, 0] == clean(1.5).q[1, 0] + 0.3


def test_touch_is_lost_or_stands_at_full_scale(scene: SceneModel) -> None:
    found = differing(scene, kind="tactile_lost", finger=0)
    np.testing.assert_array_equal(found["force"] == 0.0, only((4,), 0))
    np.testing.assert_array_equal((found["place"] == 0.0).all(axis=1), only((4,), 0))
    assert not differing(scene, kind="tactile_lost")["force"].any()
    found = differing(scene, kind="tactile_stuck", finger=3)
    assert found["force"][3] == 30.0
    np.testing.assert_array_equal(found["place"][3], clean(1.0).place[3])


def test_the_clock_stalls_and_jumps(scene: SceneModel) -> None:
    assert differing(scene, kind="clock_stall") == {"t": 1.0}
    assert differing(scene, kind="clock_jump", shift=-5.0) == {"t": -3.5}


def test_swapped_joints_are_swapped_in_readings_and_commands(scene: SceneModel) -> None:
    fault = {"kind": "joint_order_swapped", "finger": 1, "joint": 0, "other": 2}
    found = differing(scene, **fault)
    assert set(found) == {"q", "tau"}
    right = clean(1.5)
    np.testing.assert_array_equal(found["q"][1], right.q[1, [2, 1, 0]])
    faults = injection(scene, **fault)
    np.testing.assert_array_equal(faults.command(1.5, right.tau.ravel()).reshape(4, 3)[1], right.tau[1, [2, 1, 0]])
    np.testing.assert_array_equal(faults.command(2.5, right.tau), right.tau)


def test_motors_without_power_and_weak_ones(scene: SceneModel) -> None:
    torque = np.linspace(-0.5, 0.5, 12)
    faults = injection(scene, kind="finger_power_loss", finger=1)
    np.testing.assert_array_equal(faults.motors(1.5, torque) == 0.0, only((4, 3), 1).ravel())
    np.testing.assert_array_equal(faults.motors(0.5, torque), torque)
    one = injection(scene, kind="finger_power_loss", finger=1, joint=0).motors(1.5, torque)
    np.testing.assert_array_equal(one == 0.0, only((4, 3), (1, 0)).ravel())
    weak = injection(scene, kind="motor_weak", scale=0.4).motors(1.5, torque)
    np.testing.assert_allclose(weak, np.clip(torque, -0.2, 0.2))


def test_friction_halves_and_comes_back(scene: SceneModel) -> None:
    faults = injection(scene, kind="friction_drop")
    seen = []
    for t in (0.5, 1.5, 2.5):
        faults.contacts(t)
        seen.append(scene.model.geom(OBJECT).friction[0])
    np.testing.assert_allclose(seen, [1.0, 0.5, 1.0])


def test_the_reference_is_spoilt_for_the_controller_alone(scene: SceneModel) -> None:
    faults = injection(scene, kind="reference_nan")
    pose, twist = np.ones(7), np.zeros(6)
    assert (
        np.isnan(faults.reference(1.5, pose, twist)[0]).all() and np.isnan(faults.reference(1.5, pose, twist)[1]).all()
    )
    assert faults.reference(2.5, pose, twist)[0] is pose
    run = simulate(Scenario.load("hold", {"duration": 0.5, "fault": [{"kind": "reference_nan", "at": 0.2}]}))
    assert np.isfinite(run.log["desired_x"]).all() and not run.metrics["dropped"]


def test_the_object_is_pulled_out_of_the_hand() -> None:
    fault = {"kind": "object_pulled", "at": 0.3}
    run = simulate(Scenario.load("hold", {"duration": 1.5, "fault": [fault]}))
    assert run.metrics["dropped"] and run.log["safe_mode"].max() == 4.0


def test_dropped_ticks_hold_the_command_for_longer() -> None:
    fault = {"kind": "dropped_ticks", "at": 0.0, "duration": 0.5, "ticks": 4, "every": 10}
    run = simulate(Scenario.load("hold", {"duration": 1.0, "fault": [fault]}))
    steps = np.diff(run.log.t)
    np.testing.assert_allclose(np.unique(steps.round(9)), [0.002, 0.010])
    # 14 periods with one loss each fit 17 times and a bit into the half second.
    assert (steps > 0.005).sum() == 18
    assert run.log.t[-1] == pytest.approx(0.998)


def test_a_fault_acts_in_a_run_and_truth_stays_true() -> None:
    fault = {"kind": "tactile_lost", "at": 0.2, "duration": 0.05, "finger": 0}
    plant = MujocoPlant(Scenario.load("hold", {"grasp.settle": 0.0, "fault": [fault]}))
    plant.t = 0.21
    plant.sensors.read(0.21)
    assert plant.sensors.row[-4] == 0.0  # measured
    assert plant.sensors.normal_force[0] > 0.1  # true


def test_a_faulty_run_repeats_bit_for_bit() -> None:
    fault = {"kind": "friction_drop", "at": 0.3, "scale": 0.8}
    rows = []
    for _ in range(2):
        log = simulate(Scenario.load("hold", {"duration": 0.8, "fault": [fault]})).log
        rows.append(np.column_stack([log[name] for name in log.names]))
    np.testing.assert_array_equal(rows[0], rows[1])


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "unknown kind": ({"kind": "gremlin", "at": 1.0}, r"fault\.0\.kind: expected one of sensor_nan, .*found 'gremlin'"),
    "no kind": ({"at": 1.0}, r"fault\.0\.kind: expected one of sensor_nan, .*found None"),
    "no time": ({"kind": "pose_stale"}, r"fault\.0\.pose_stale\.at: expected a value, found none"),
    "no finger": (
        {"kind": "encoder_stuck", "at": 1.0, "joint": 0},
        r"fault\.0\.encoder_stuck\.finger: expected a value",
    ),
    "needless finger": (
        {"kind": "pose_stale", "at": 1.0, "finger": 0},
        r"fault\.0\.pose_stale\.finger: expected one of at, duration, kind, found an unknown key",
    ),
    "no duration": (
        {"kind": "pose_stale", "at": 1.0, "duration": 0.0},
        r"fault\.0\.pose_stale\.duration: expected greater than 0, found 0",
    ),
    "unknown sensor": (
        {"kind": "sensor_nan", "at": 1.0, "sensor": "nose"},
        r"fault\.0\.sensor_nan\.sensor: expected 'encoder', 'torque', 'pose' or 'tactile', found 'nose'",
    ),
    "negative finger": ({"kind": "tactile_lost", "at": 1.0, "finger": -1}, r"fault\.0\.tactile_lost\.finger: expected"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_fault_is_one_line_that_names_the_field(name: str) -> None:
    fault, message = BAD[name]
    with pytest.raises(ConfigError, match=message) as error:
        Scenario.build({}, {"fault": [fault]})
    assert "\n" not in str(error.value)


UNFIT: dict[str, tuple[dict[str, Any], str]] = {
    "finger": ({"kind": "finger_power_loss", "finger": 4}, r"fault\.0\.finger: expected 0 to 3, found 4"),
    "joint": ({"kind": "encoder_stuck", "finger": 0, "joint": 3}, r"fault\.0\.joint: expected 0 to 2, found 3"),
    "same joint": (
        {"kind": "joint_order_swapped", "finger": 0, "joint": 1, "other": 1},
        r"fault\.0\.other: expected another joint than 1",
    ),
    "pose of a finger": (
        {"kind": "sensor_nan", "sensor": "pose", "finger": 0},
        r"fault\.0\.finger: expected none for the sensor pose",
    ),
    "joint without finger": (
        {"kind": "sensor_nan", "sensor": "encoder", "joint": 0},
        r"fault\.0\.finger: expected the finger of joint 0, found none",
    ),
}


@pytest.mark.parametrize("name", UNFIT)
def test_a_fault_that_the_hand_cannot_have_names_the_field(scene: SceneModel, name: str) -> None:
    fault, message = UNFIT[name]
    with pytest.raises(ConfigError, match=message):
        injection(scene, **fault)


def test_every_kind_is_tested_here() -> None:
    source = Path(__file__).read_text(encoding="utf-8")
    assert [kind for kind in KINDS if source.count(f'"{kind}"') == 0] == []
