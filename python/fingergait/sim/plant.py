"""The seam to hardware: a plant takes joint torques and gives measurements. `MujocoPlant` is the simulated one."""

from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait._core import Command, Measurement, TorquePid
from fingergait.scenario import Disturbance, Scenario
from fingergait.scenario.core_config import core_config
from fingergait.sim.injection import Injection
from fingergait.sim.scene import SceneModel, build_scene, set_mass, torque_limits
from fingergait.sim.sensors import Sensors
from fingergait.sim.start import nominal_start

Array = NDArray[np.float64]

_CLOSING_S = 0.05  # time in which the preloaded fingers come to rest on the object before the first measurement


class Plant(Protocol):
    """Anything that the control step can drive at its own rate."""

    def reset(self) -> Measurement:
        """Brings the plant to its start and gives the first measurement."""

    def step(self, command: Command) -> Measurement:
        """Applies the joint torques of `command` for one control period and gives the next measurement."""

    def close(self) -> None:
        """Releases what the plant holds; the motors are off."""


class MujocoPlant:
    """The hand of the MJCF with the scenario's true object, at the scenario's control rate.

    Within a control period the torque PID runs once a physics step on the measured motor torques. The encoders are read
    at the end of the period; the tactile and torque sensors are one physics step older, as the simulator computes them.

    Attributes
    ----------
    config
        JSON of the core's configuration that fits this plant.
    t
        Time of the last measurement, s; the scenario's settling time lies before zero.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.scene: SceneModel = build_scene(scenario)
        self.start = nominal_start(self.scene, scenario)
        self.injection = Injection(self.scene, scenario.fault)
        self.data = mujoco.MjData(self.scene.model)
        self.config = core_config(scenario)
        low, high = torque_limits(self.scene)
        self._pid = TorquePid(len(self.scene.q), float(self.scene.model.opt.timestep), self.config, low, high)
        # A motor that answers within two physics steps gives what it is told: feedback would only make it ring.
        self._open = _lags(self.scene) < 2.0 * self.scene.model.opt.timestep
        self._low, self._high = low, high
        self._tau = np.zeros(len(self.scene.q))
        self._object_geoms, self._link_geoms = _parts(self.scene)
        self._pulses = scenario.disturbance
        self.t = 0.0
        self.reset()

    def reset(self) -> Measurement:
        """The first measurement: the object on the palm, every tip pressing lightly, `grasp.settle` s before t = 0."""
        scene, data = self.scene, self.data
        mujoco.mj_resetData(scene.model, data)
        data.qpos[:] = self.start.qpos
        data.ctrl[scene.act] = self.start.torque
        lagging = scene.model.actuator_actadr[scene.act] >= 0
        data.act[scene.model.actuator_actadr[scene.act[lagging]]] = self.start.torque[lagging]
        for _ in range(round(_CLOSING_S / scene.model.opt.timestep)):
            mujoco.mj_step(scene.model, data)
        self._tau[:] = data.actuator_force[scene.act]
        self._pid.reset()
        self.injection.reset()
        self._steps = 0
        self._lead = round(self.scenario.grasp.settle * self.scenario.controller.rate_hz)
        self.t = -self._lead * self.scenario.period
        self.sensors = Sensors(scene, data, self.scenario.sensors, self.scenario.seed, self.injection)
        return self.sensors.read(self.t)

    def step(self, command: Command) -> Measurement:
        """Drives the motors with `command` for one control period, or for more where a fault makes ticks drop."""
        for _ in range(self.injection.periods(self.t)):
            self._drive(command.tau.ravel())
            self._steps += 1
            self.t = (self._steps - self._lead) * self.scenario.period
        return self.sensors.read(self.t)

    def _drive(self, tau: Array) -> None:
        """Drives the motors to the joint torques `tau` for one control period."""
        model, data, act, faults = self.scene.model, self.data, self.scene.act, self.injection
        if self._pulses:
            self._disturb()
        faults.contacts(self.t)
        pull = faults.pull(self.t)
        if pull is not None:
            if not self._pulses:  # which starts anew from zero otherwise
                data.xfrc_applied[self.scene.object_body] = 0.0
            data.xfrc_applied[self.scene.object_body, :3] += pull
        desired = faults.command(self.t, tau)
        for _ in range(self.scene.substeps):
            motors = self._pid.step(desired, faults.torque_reading(self.t, self._tau)).ravel()
            motors = np.where(self._open, np.clip(desired, self._low, self._high), motors)
            data.ctrl[act] = faults.motors(self.t, motors)
            mujoco.mj_step(model, data)
            self._tau[:] = data.actuator_force[act]

    def change(self, key: str, value: float) -> None:
        """Changes the truth during the run: a `truth.*` or `sensors.*` key of an input, see `scenario.inputs`."""
        table, _, field = key.partition(".")
        if table == "sensors":
            self.sensors.change(field, value)
        elif field == "friction":
            self.injection.friction(value)
        else:
            set_mass(self.scene, self.scenario.object.mass * value)

    def push(self, pulse: Disturbance) -> None:
        """Takes one more pulse on the object; it must not have begun before now."""
        self._pulses = (*self._pulses, pulse)

    def close(self) -> None:
        """Switches the motors off."""
        self.data.ctrl[:] = 0.0

    @property
    def object_pose(self) -> Array:
        """True pose (7,) of the object's frame O in W; for the log only."""
        first = self.scene.object_q
        pose: Array = self.data.qpos[first : first + 7]
        return pose

    @property
    def link_contact(self) -> bool:
        """Whether a part of a finger other than its tip touches the object; for the log only."""
        pairs = self.data.contact.geom
        if not len(pairs):
            return False
        on_object, on_link = self._object_geoms[pairs], self._link_geoms[pairs]
        return bool((on_object & on_link[:, ::-1]).any())

    @property
    def joint_angles(self) -> Array:
        """True joint angles (n_q,), rad; for the log only."""
        angles: Array = self.data.qpos[self.scene.q]
        return angles

    def _disturb(self) -> None:
        """Applies the pulses that act now; MuJoCo takes the force at the centre of mass, the scenario gives it at O."""
        wrench = np.zeros(6)
        for pulse in self._pulses:
            if pulse.at - 1e-9 <= self.t < pulse.at + pulse.duration - 1e-9:
                wrench += [*pulse.force, *pulse.torque]
        body = self.scene.object_body
        arm = self.data.xpos[body] - self.data.xipos[body]
        wrench[3:] += np.cross(arm, wrench[:3])
        self.data.xfrc_applied[body] = wrench


def _lags(scene: SceneModel) -> Array:
    """Time constant of each motor, (n_q,), s; zero where it has none."""
    lagging = scene.model.actuator_dyntype[scene.act] != mujoco.mjtDyn.mjDYN_NONE
    return np.where(lagging, scene.model.actuator_dynprm[scene.act, 0], 0.0)


def _parts(scene: SceneModel) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """For each geom, whether it is the object's, and whether it is a part of a finger other than its tip."""
    model = scene.model
    joints = {int(model.jnt_bodyid[joint]) for finger in scene.fingers for joint in finger.links}
    moves = np.zeros(model.nbody, dtype=bool)
    for body in range(1, model.nbody):  # parents come first
        moves[body] = body in joints or moves[model.body_parentid[body]]
    links = moves[model.geom_bodyid]
    links[[finger.tip for finger in scene.fingers]] = False
    return model.geom_bodyid == scene.object_body, links
