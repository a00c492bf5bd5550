"""Injects a scenario's faults between the simulator and the controller: in what sensors say and what motors do."""

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait._core import ConfigError
from fingergait.scenario import faults as kinds
from fingergait.sim.scene import OBJECT, SceneModel, contact_friction, torque_limits

Array = NDArray[np.float64]


class Injection:
    """The faults of one run, with what they remember. Without faults it costs nothing.

    Parameters
    ----------
    scene
        The compiled model; its friction is changed while a fault says so.
    faults
        The scenario's.

    Raises
    ------
    ConfigError
        Where a fault names a finger or a joint that the hand doesn't have.
    """

    def __init__(self, scene: SceneModel, faults: tuple[kinds.FaultWindow, ...]) -> None:
        self._joints = scene.joints
        self._scene = scene
        self._faults = faults
        for number, fault in enumerate(faults):
            _check(fault, number, scene.joints)
        self._friction = scene.model.geom(OBJECT).friction.copy()
        self._low, self._high = torque_limits(scene)
        self.reset()

    def add(self, fault: kinds.FaultWindow) -> None:
        """Takes one more fault while the run is under way; it must not have begun before now."""
        _check(fault, len(self._faults), self._joints)
        self._faults = (*self._faults, fault)

    def friction(self, mu: float) -> None:
        """Gives the contacts of the object the true sliding friction `mu`, which faults may lower."""
        self._friction[:] = contact_friction(mu)
        self._scene.model.geom(OBJECT).friction[:] = self._friction

    def reset(self) -> None:
        """Forgets what the faults froze or counted, and gives the contacts their friction back."""
        self._frozen: dict[int, Any] = {}
        self._steps: dict[int, int] = {}
        self._dice: dict[int, np.random.Generator] = {}
        self._scene.model.geom(OBJECT).friction[:] = self._friction

    def read(self, t: float, q: Array, tau: Array, pose: Array, place: Array, force: Array) -> float:
        """Spoils one measurement in place and gives its time, s.

        Parameters
        ----------
        t
            True time, s.
        q, tau
            Joint angles, rad, and torques, N m, (n_q,), finger by finger.
        pose
            Object pose (7,) in W, wxyz.
        place, force
            Tactile place (n_fingers, 3), m, and force (n_fingers,), N.
        """
        said = t
        for number, fault in enumerate(self._faults):
            if not fault.active(t):
                self._frozen.pop(number, None)
                continue
            match fault:
                case kinds.SensorNan(sensor=sensor, finger=finger, joint=joint):
                    if sensor in ("encoder", "torque"):
                        (q if sensor == "encoder" else tau)[self._at(finger, joint)] = np.nan
                    else:
                        for array in (pose,) if sensor == "pose" else (place, force):
                            array[_which(finger)] = np.nan
                case kinds.PoseJump(shift=shift):
                    pose[:3] += shift[:3]
                    _turn(pose[3:], np.array(shift[3:]))
                case kinds.PoseStale():
                    pose[:] = self._freeze(number, pose)
                case kinds.EncoderStuck(finger=finger, joint=joint):
                    q[self._at(finger, joint)] = self._freeze(number, q[self._at(finger, joint)])
                case kinds.EncoderRange(finger=finger, joint=joint, value=value):
                    q[self._at(finger, joint)] = value
                case kinds.EncoderOffset(finger=finger, joint=joint, shift=shift):
                    q[self._at(finger, joint)] += shift
                case kinds.EncoderDropout(share=share):
                    # One number a step, the same in every run.
                    if self._dice.setdefault(number, np.random.default_rng(number)).random() < share:
                        q[:] = 0.0
                case kinds.TactileScale(factor=factor):
                    force *= factor
                case kinds.TactileAxes(order=order):
                    place[:] = place[:, list(order)]
                case kinds.TactileLost(finger=finger):
                    place[_which(finger)], force[_which(finger)] = 0.0, 0.0
                case kinds.TactileStuck(finger=finger, value=value):
                    place[finger], force[finger] = self._freeze(number, place[finger]), value
                case kinds.ClockStall():
                    said = float(self._freeze(number, np.float64(t)))
                case kinds.ClockJump(shift=shift):
                    said += shift
                case kinds.JointOrderSwapped(finger=finger, joint=joint, other=other):
                    for array in (q, tau):
                        self._swap(array, finger, joint, other)
        return said

    def command(self, t: float, tau: Array) -> Array:
        """Torques, N m, (n_q,), that reach the motors' own controllers at time t."""
        for fault in self._faults:
            if isinstance(fault, kinds.JointOrderSwapped) and fault.active(t):
                tau = tau.copy()
                self._swap(tau, fault.finger, fault.joint, fault.other)
        return tau

    def torque_reading(self, t: float, tau: Array) -> Array:
        """Joint torques, N m, (n_q,), as the torque controllers measure them."""
        for fault in self._faults:
            if isinstance(fault, kinds.SensorNan) and fault.sensor == "torque" and fault.active(t):
                tau = tau.copy()
                tau[self._at(fault.finger, fault.joint)] = np.nan
        return tau

    def motors(self, t: float, torque: Array) -> Array:
        """Torques (n_q,), N m, that the motors give of those asked for."""
        for fault in self._faults:
            if not fault.active(t):
                continue
            if isinstance(fault, kinds.FingerPowerLoss):
                torque = torque.copy()
                torque[self._at(fault.finger, fault.joint)] = 0.0
            elif isinstance(fault, kinds.MotorWeak):
                share = np.ones(len(torque))
                share[self._at(fault.finger, None)] = fault.scale
                torque = np.clip(torque, share * self._low, share * self._high)
        return torque

    def reference(self, t: float, pose: Array, twist: Array) -> tuple[Array, Array]:
        """The reference, pose (7,) and twist (6,), that the controller is given at time t."""
        if any(isinstance(fault, kinds.ReferenceNan) and fault.active(t) for fault in self._faults):
            return np.full_like(pose, np.nan), np.full_like(twist, np.nan)
        return pose, twist

    def pull(self, t: float) -> Array | None:
        """Force (3,), N, in W, at the object's centre of mass at time t; None where there never is any."""
        pulls = [fault for fault in self._faults if isinstance(fault, kinds.ObjectPulled)]
        return sum((np.array(p.force) for p in pulls if p.active(t)), np.zeros(3)) if pulls else None

    def contacts(self, t: float) -> None:
        """Gives the object the friction that it has at time t."""
        drops = [fault for fault in self._faults if isinstance(fault, kinds.FrictionDrop)]
        if drops:
            scale = np.prod([fault.scale for fault in drops if fault.active(t)])
            self._scene.model.geom(OBJECT).friction[:] = scale * self._friction

    def periods(self, t: float) -> int:
        """Control periods for which the motors go on with the command given at time t: 1, and those missed."""
        count = 1
        for number, fault in enumerate(self._faults):
            if isinstance(fault, kinds.DroppedTicks) and fault.active(t):
                step = self._steps.get(number, 0)
                self._steps[number] = step + 1
                if step % fault.every == 0:
                    count += fault.ticks
        return count

    def _at(self, finger: int | None, joint: int | None) -> slice | int:
        """Index of one joint, one finger, or everything in a flat array of the joints."""
        if finger is None:
            return slice(None)
        return self._joints[finger] if joint is None else self._joints[finger].start + joint

    def _swap(self, array: Array, finger: int, joint: int, other: int) -> None:
        first = self._joints[finger].start
        array[[first + joint, first + other]] = array[[first + other, first + joint]]

    def _freeze(self, number: int, value: Any) -> Any:
        """What fault `number` read when it began."""
        return self._frozen.setdefault(number, value.copy())


def _which(finger: int | None) -> slice | int:
    """Index of one finger, or of all."""
    return slice(None) if finger is None else finger


def _check(fault: kinds.FaultWindow, number: int, joints: list[slice]) -> None:
    finger = getattr(fault, "finger", None)
    counts = [own.stop - own.start for own in joints]
    count_joints = counts[finger] if finger is not None and finger < len(joints) else max(counts)
    for field, count in (("finger", len(joints)), ("joint", count_joints), ("other", count_joints)):
        value = getattr(fault, field, None)
        if value is not None and value >= count:
            raise ConfigError(f"fault.{number}.{field}: expected 0 to {count - 1}, found {value}")
    if isinstance(fault, kinds.SensorNan):
        applies = {"encoder": 2, "torque": 2, "tactile": 1, "pose": 0}[fault.sensor]
        for index, field in enumerate(("finger", "joint")):
            if getattr(fault, field) is not None and index >= applies:
                raise ConfigError(f"fault.{number}.{field}: expected none for the sensor {fault.sensor}, found one")
        if fault.joint is not None and fault.finger is None:
            raise ConfigError(f"fault.{number}.finger: expected the finger of joint {fault.joint}, found none")
    if isinstance(fault, kinds.JointOrderSwapped) and fault.joint == fault.other:
        raise ConfigError(f"fault.{number}.other: expected another joint than {fault.joint}, found the same")


def _turn(quaternion: Array, vector: Array) -> None:
    """Turns the wxyz `quaternion` in place by the rotation vector (3,) in W."""
    angle = float(np.linalg.norm(vector))
    if angle > 0.0:
        turn = np.empty(4)
        mujoco.mju_axisAngle2Quat(turn, vector / angle, angle)
        mujoco.mju_mulQuat(quaternion, turn, quaternion.copy())
