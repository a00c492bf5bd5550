"""The simulated plant and its sensors, against MuJoCo's own numbers and known statistics."""

import mujoco
import numpy as np
import pytest

from fingergait._core import ConfigError
from fingergait.scenario import Scenario
from fingergait.sim.plant import MujocoPlant
from fingergait.sim.scene import OBJECT, build_scene, torque_limits
from fingergait.sim.start import nominal_start

N, M = 4, 3  # fingers, joints


class Torques:
    """A command of fixed torques, in place of the core's."""

    def __init__(self, tau: np.ndarray) -> None:
        self.tau = tau


def plant_of(values: dict[str, object] | None = None) -> MujocoPlant:
    return MujocoPlant(Scenario.build({"name": "case"}, values))


def holding(plant: MujocoPlant) -> np.ndarray:
    """The torques (N, M) of the start: they hold the fingers and press lightly."""
    return plant.start.torque.reshape(N, M)


SHAPES = {
    "cylinder": [0.025, 0.06],
    "thick cylinder": [0.030, 0.07],
    "thin cylinder": [0.022, 0.05],
    "ellipsoid": [0.026, 0.026, 0.06],
    "box": [0.022, 0.022, 0.06],
    "cone": [0.028, 0.022, 0.06],
}


@pytest.mark.parametrize("shape", SHAPES)
def test_all_tips_touch_lightly_and_the_object_rests_at_the_start(shape: str) -> None:
    plant = plant_of({"object.shape": shape.split()[-1], "object.size": SHAPES[shape]})
    np.testing.assert_allclose(plant.sensors.row[-N:], 0.5, atol=0.1)
    pose = plant.object_pose.copy()
    for _ in range(100):
        plant.step(Torques(holding(plant)))
    np.testing.assert_allclose(plant.object_pose, pose, atol=2e-4)


def test_first_grasp_offsets_move_object_and_contacts() -> None:
    turns, heights = [5.0, -5.0, 3.0, 0.0], [0.003, -0.003, 0.0, 0.001]
    case = Scenario.build(
        {
            "truth": {
                "first_grasp": [0.003, -0.002, 0.0, 0.0, 0.0, np.deg2rad(5.0)],
                "finger_offset_deg": turns,
                "finger_height_offset": heights,
            }
        }
    )
    scene = build_scene(case)
    data = mujoco.MjData(scene.model)
    data.qpos[:] = nominal_start(scene, case).qpos
    mujoco.mj_kinematics(scene.model, data)
    np.testing.assert_allclose(data.xpos[scene.object_body], [0.003, -0.002, 0.06], atol=1e-9)
    arms = data.geom_xpos[scene.tips] - data.xpos[scene.object_body]
    azimuths = np.rad2deg(np.arctan2(arms[:, 1], arms[:, 0]))
    np.testing.assert_allclose((azimuths - [0, 90, 180, 270] - turns + 180) % 360 - 180, 0.0, atol=0.01)
    np.testing.assert_allclose(arms[:, 2], heights, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(arms[:, :2], axis=1), 0.025 + 0.014 - 1e-5, atol=2e-6)


def test_the_true_object_is_what_the_scenario_says() -> None:
    truth = {"mass_scale": 1.2, "inertia_scale": [1.5, 1.4, 0.5], "com_offset": [0.001, 0.0, 0.002], "friction": 0.6}
    plant = plant_of({"truth": {**truth, "motor_lag_s": 0.02, "joint_damping_scale": 2.0}})
    scene, model = plant.scene, plant.scene.model
    body = scene.object_body
    inertia = plant.scenario.object.geometry.inertia(0.5) * [1.5, 1.4, 0.5]
    assert model.body_mass[body] == pytest.approx(0.6)
    np.testing.assert_allclose(model.body_inertia[body], inertia)
    np.testing.assert_allclose(model.body_ipos[body], [0.001, 0.0, 0.002])
    np.testing.assert_allclose(model.dof_damping[scene.v], 0.1)
    np.testing.assert_allclose(model.actuator_dynprm[scene.act, 0], 0.02)
    np.testing.assert_allclose(torque_limits(scene), np.array([[-0.5], [0.5]]) * np.ones(N * M))
    contacts = plant.data.contact
    on_object = (contacts.geom == model.geom(OBJECT).id).any(axis=1)
    assert on_object.sum() >= N + 3  # the tips, and the palm at three points or more
    np.testing.assert_allclose(contacts.friction[on_object, 0], 0.6)


def test_an_inertia_that_no_body_has_is_refused() -> None:
    with pytest.raises(ConfigError, match="truth.inertia_scale: expected moments of which none exceeds"):
        plant_of({"truth.inertia_scale": [1.5, 0.5, 1.0]})


def test_only_friction_holds_the_object() -> None:
    model = plant_of().scene.model
    free = [joint for joint in range(model.njnt) if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE]
    assert [model.joint(joint).name for joint in free] == [OBJECT]
    assert model.neq == 0
    assert model.ntendon == 0
    assert model.dof_damping[model.joint(OBJECT).dofadr[0] :].max() == 0.0


def test_motor_torque_follows_its_command_with_the_lag() -> None:
    plant = plant_of({"truth.motor_lag_s": 0.01})
    begin = plant.data.act.copy()
    plant.data.ctrl[:] = 0.3
    for k in range(1, 21):
        mujoco.mj_step(plant.scene.model, plant.data)
        expected = 0.3 + (begin - 0.3) * np.exp(-0.001 * k / 0.01)
        np.testing.assert_allclose(plant.data.act, expected, rtol=1e-9)


def test_motor_torque_never_passes_its_limit() -> None:
    plant = plant_of()
    torques = []
    for _ in range(50):
        plant.step(Torques(np.full((N, M), 5.0)))
        torques.append(plant.data.actuator_force.copy())
    assert np.abs(torques).max() == pytest.approx(0.5)


def test_tactile_sensors_agree_with_the_simulators_contacts() -> None:
    plant = plant_of()
    for _ in range(40):
        plant.step(Torques(holding(plant) * [1.0, 1.0, 1.4]))
    scene, data = plant.scene, plant.data
    place, force = plant.sensors.row[-4 * N : -N].reshape(N, 3), plant.sensors.row[-N:]
    seen = []
    for index in range(data.ncon):
        contact = data.contact[index]
        tips = np.flatnonzero(np.isin([finger.tip for finger in scene.fingers], contact.geom))
        if not len(tips):
            continue
        finger = int(tips[0])
        wrench = np.zeros(6)
        mujoco.mj_contactForce(scene.model, data, index, wrench)
        assert force[finger] == pytest.approx(wrench[0], rel=1e-6)
        assert plant.sensors.tangential[finger] == pytest.approx(np.hypot(*wrench[1:3]), rel=1e-4)
        rotation = data.xmat[scene.links[finger]].reshape(3, 3)
        in_world = data.geom_xpos[scene.tips[finger]] + rotation @ place[finger]
        np.testing.assert_allclose(in_world, contact.pos, atol=5e-5)  # half the penetration
        assert np.linalg.norm(place[finger]) == pytest.approx(0.014)
        seen.append(finger)
    assert sorted(seen) == list(range(N))


def test_a_tip_in_the_air_reads_zero() -> None:
    plant = plant_of()
    tau = holding(plant).copy()
    tau[0] = [-0.1, 0.0, -0.1]
    for _ in range(50):
        plant.step(Torques(tau))
    assert plant.sensors.row[-N] == 0.0
    np.testing.assert_array_equal(plant.sensors.row[-4 * N : -4 * N + 3], 0.0)
    assert (plant.sensors.row[-N + 1 :] > 0.0).all()


NOISE = {
    "position_noise": 1e-4,
    "orientation_noise": 2e-3,
    "encoder_noise": 1e-3,
    "contact_place_noise": 3e-4,
    "contact_force_noise": 0.05,
}


def still_rows(seed: int) -> np.ndarray:
    """3000 noisy measurements of the plant at its start, which stands still between the reads."""
    sensors = plant_of({"sensors": NOISE, "seed": seed}).sensors
    rows = []
    for k in range(3000):
        sensors.read(0.002 * k)
        rows.append(sensors.row.copy())
    return np.array(rows)


def test_noise_has_the_stated_deviation() -> None:
    rows, exact = still_rows(3), plant_of().sensors.row
    deviation = rows.std(axis=0)
    # 3000 samples: the estimate of a deviation scatters by 1.3 %.
    np.testing.assert_allclose(deviation[:12], 1e-3, rtol=0.07)
    np.testing.assert_allclose(deviation[12:24], 0.0, atol=1e-15)
    np.testing.assert_allclose(deviation[24:27], 1e-4, rtol=0.07)
    np.testing.assert_allclose(2.0 * deviation[28:31], 2e-3, rtol=0.07)  # a quaternion holds half the angle
    np.testing.assert_allclose(deviation[-N:], 0.05 * exact[-N:], rtol=0.07)
    np.testing.assert_allclose(rows.mean(axis=0)[24:27], exact[24:27], atol=1e-5)
    place = rows[:, -4 * N : -N].reshape(-1, N, 3)
    np.testing.assert_allclose(np.linalg.norm(place, axis=2), 0.014, rtol=1e-12)  # the sensor is the tip's skin
    scatter = np.sqrt(((place - place.mean(axis=0)) ** 2).sum(axis=2).mean(axis=0))
    np.testing.assert_allclose(scatter, np.sqrt(2.0) * 3e-4, rtol=0.07)  # two directions in the skin


def test_noise_repeats_with_its_seed() -> None:
    np.testing.assert_array_equal(still_rows(3), still_rows(3))
    assert not np.array_equal(still_rows(3), still_rows(4))


def test_encoders_are_quantised() -> None:
    plant = plant_of({"sensors.encoder_bits": 12})
    counts = plant.sensors.row[:12] / (2 * np.pi / 4096)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    assert np.abs(plant.sensors.row[:12] - plant.joint_angles).max() <= np.pi / 4096 + 1e-12


def test_the_pose_comes_at_its_rate_and_late() -> None:
    plant = plant_of({"sensors": {"pose_rate_hz": 50.0, "pose_delay_s": 0.03}, "grasp.settle": 0.0})
    command = Torques(holding(plant) + 0.02)
    true, seen = [plant.object_pose.copy()], [plant.sensors.pose.copy()]
    for _ in range(150):
        plant.step(command)
        true.append(plant.object_pose.copy())
        seen.append(plant.sensors.pose.copy())
    changes = np.flatnonzero(np.abs(np.diff(seen, axis=0)).max(axis=1) > 0.0) + 1
    np.testing.assert_array_equal(np.diff(changes), 10)  # 50 Hz of 500 Hz
    for step in changes:
        np.testing.assert_array_equal(seen[step], true[step - 15])  # 30 ms


def test_a_pulse_accelerates_the_free_object_as_newton_says() -> None:
    pulse = {"at": 0.0, "duration": 0.02, "force": [1.0, 0.0, 30.0], "torque": [0.0, 0.0, 0.001]}
    plant = plant_of({"disturbance": [pulse], "grasp": {"settle": 0.0}})
    plant.data.qpos[plant.scene.q] = 0.0  # the fingers out of the way
    plant.data.qpos[plant.scene.object_q + 2] = 0.5
    plant.data.qvel[:] = 0.0
    for _ in range(20):
        plant.step(Torques(np.zeros((N, M))))
    velocity = plant.data.qvel[N * M :]
    inertia = plant.scenario.object.geometry.inertia(0.5)
    np.testing.assert_allclose(velocity[:3], [0.04, 0.0, 30.0 * 0.04 - 9.81 * 0.04], rtol=1e-6, atol=1e-9)
    assert velocity[5] == pytest.approx(0.001 * 0.02 / inertia[2], rel=1e-6)


def test_a_pulse_acts_at_the_frames_origin_and_not_at_the_centre_of_mass() -> None:
    pulse = {"at": 0.0, "duration": 0.01, "force": [1.0, 0.0, 0.0]}
    truth = {"com_offset": [0.0, 0.01, 0.0]}
    plant = plant_of({"disturbance": [pulse], "grasp": {"settle": 0.0}, "truth": truth})
    plant.data.qpos[plant.scene.q] = 0.0
    plant.data.qpos[plant.scene.object_q + 2] = 0.5
    plant.data.qvel[:] = 0.0
    mujoco.mj_forward(plant.scene.model, plant.data)
    for _ in range(5):
        plant.step(Torques(np.zeros((N, M))))
    inertia = plant.scenario.object.geometry.inertia(0.5)
    assert plant.data.qvel[N * M + 5] == pytest.approx(0.01 * 1.0 * 0.01 / inertia[2], rel=1e-3)


def test_the_control_rate_sets_period_and_physics_step() -> None:
    plant = plant_of({"controller.rate_hz": 333.0})
    assert plant.scene.substeps == 4
    begin = plant.t
    plant.step(Torques(holding(plant)))
    assert plant.t - begin == pytest.approx(1.0 / 333.0)
    assert plant.scene.model.opt.timestep == pytest.approx(1.0 / 1332.0)
