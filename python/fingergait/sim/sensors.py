"""What the hand's sensors and the vision system would say: quantised, noisy, late; never a velocity.

Joint encoders, motor torque sensors, tactile sensors that give a contact's place on the fingertip and its normal force,
and the object's pose. The surface normal, the friction and the object's shape stay in the simulator.
"""

import math
from collections import deque

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait._core import Measurement
from fingergait.scenario import SensorConfig
from fingergait.sim.injection import Injection
from fingergait.sim.scene import TOUCH_SIZE, SceneModel

Array = NDArray[np.float64]

_BLOCK = 512  # control steps of noise drawn at once


class Sensors:
    """Reads one measurement from the simulator's state.

    Parameters
    ----------
    scene
        The model.
    data
        The state that `read` reads.
    config
        Noise, rates and delays.
    seed
        Of the noise.
    injection
        The faults that spoil what is read.
    """

    def __init__(
        self, scene: SceneModel, data: mujoco.MjData, config: SensorConfig, seed: int, injection: Injection
    ) -> None:
        n, n_q = len(scene.fingers), len(scene.q)
        self._scene, self._config, self._injection = scene, config, injection
        self._q_true = _view(data.qpos, scene.q)
        self._pose_true = data.qpos[scene.object_q : scene.object_q + 7]
        self._force = _view(data.actuator_force, scene.act)
        first = int(scene.touch[0])
        self._touch = data.sensordata[first : first + TOUCH_SIZE * n].reshape(n, TOUCH_SIZE)
        self._geom_xpos, self._xmat = data.geom_xpos, data.xmat.reshape(-1, 3, 3)
        self._radius = scene.model.geom_size[scene.tips, :1]  # (n, 1)
        sizes = [n_q, n_q, 7, 3 * n, n]
        ends = np.cumsum(sizes)
        self.row = np.zeros(ends[-1])
        """The last measurement as one row: q, tau, pose, contact place, contact force."""
        parts = np.split(self.row, ends[:-1])
        self._q, self._tau = parts[0], parts[1]
        self.pose = parts[2]
        self._place, self._normal_force = parts[3].reshape(n, 3), parts[4]
        self.normal_force, self.tangential = np.zeros(n), np.zeros(n)
        """True normal and friction force at each tip, N: for the log and the verdict only."""
        self._noise = _Noise(np.random.default_rng(seed), [n_q, 6, 3 * n, n])
        self._step = 0.0 if config.encoder_bits is None else 2.0 * math.pi / 2**config.encoder_bits
        self._late: deque[tuple[float, Array]] = deque()
        self._next_pose = -math.inf
        self._seen = np.zeros(7)  # the newest pose that has come in, before faults
        self._bias = config.contact_force_bias, np.array(config.contact_place_bias)

    def change(self, key: str, value: float) -> None:
        """Replaces one number of the errors, `SensorConfig`'s `key`, from the next measurement on."""
        self._config = self._config.model_copy(update={key: value})

    @staticmethod
    def columns(fingers: list[str], counts: list[int]) -> list[str]:
        """Names of the numbers in `row`, for fingers with so many joints each."""
        joints = joint_names(fingers, counts)
        return [
            *(f"measured_q_{joint}" for joint in joints),
            *(f"measured_tau_{joint}" for joint in joints),
            *(f"measured_{name}" for name in ("x", "y", "z", "qw", "qx", "qy", "qz")),
            *(f"measured_place_{name}_{axis}" for name in fingers for axis in "xyz"),
            *(f"measured_force_{name}" for name in fingers),
        ]

    def read(self, t: float) -> Measurement:
        """The measurement at time t, s. Call it once a control step, in order of time."""
        q_noise, pose_noise, place_noise, force_noise = self._noise.next()
        c = self._config
        q = self._q
        q[:] = self._q_true
        if c.encoder_noise > 0.0:
            q += c.encoder_noise * q_noise
        if self._step > 0.0:
            q[:] = np.round(q / self._step) * self._step
        self._tau[:] = self._force
        self._read_pose(t, pose_noise)
        self._read_touch(place_noise, force_noise)
        said = self._injection.read(t, self._q, self._tau, self.pose, self._place, self._normal_force)
        return Measurement(said, self._q, self._tau, self.pose, self._place, self._normal_force)

    def _read_pose(self, t: float, noise: Array) -> None:
        c = self._config
        now = t + 1e-9
        if now >= self._next_pose:
            first = self._next_pose == -math.inf
            if c.pose_rate_hz is None:
                self._next_pose = t
            else:
                self._next_pose = (t if first else self._next_pose) + 1.0 / c.pose_rate_hz
            pose = np.array(self._pose_true)
            if c.position_noise > 0.0:
                pose[:3] += c.position_noise * noise[:3]
            if c.orientation_noise > 0.0:
                _turn(pose[3:], c.orientation_noise * noise[3:])
            self._late.append((t if first else t + c.pose_delay_s, pose))
        while self._late and self._late[0][0] <= now:
            self._seen[:] = self._late.popleft()[1]
        self.pose[:] = self._seen

    def _read_touch(self, place_noise: Array, force_noise: Array) -> None:
        c, scene = self._config, self._scene
        found, force, place = self._touch[:, 0], self._touch[:, 1:4], self._touch[:, 4:7]
        arm = place - self._geom_xpos[scene.tips]  # (n, 3), from the tip's centre
        outward = arm / np.sqrt((arm * arm).sum(axis=1, keepdims=True))
        touching = found > 0.0
        normal = np.abs((force * outward).sum(axis=1))  # along the tip's own normal
        self.tangential[:] = np.sqrt(np.maximum((force * force).sum(axis=1) - normal * normal, 0.0))
        in_tip = (self._xmat[scene.links] * outward[:, :, None]).sum(axis=1)  # R_WF^T n
        self.normal_force[:] = np.where(touching, normal, 0.0)
        force_bias, place_bias = self._bias
        if c.contact_place_noise > 0.0 or place_bias.any():
            error = c.contact_place_noise * place_noise.reshape(-1, 3) + place_bias
            in_tip = in_tip + error / self._radius
            in_tip /= np.sqrt((in_tip * in_tip).sum(axis=1, keepdims=True))
        if c.contact_force_noise > 0.0 or force_bias != 0.0:
            normal = np.maximum(normal * (1.0 + c.contact_force_noise * force_noise) + force_bias, 0.0)
        self._place[:] = np.where(touching[:, None], self._radius * in_tip, 0.0)
        self._normal_force[:] = np.where(touching, normal, 0.0)


def joint_names(fingers: list[str], counts: list[int]) -> list[str]:
    """Names of the independent joints, finger by finger: the finger's and a number from 1 on."""
    return [f"{name}_{i + 1}" for name, count in zip(fingers, counts, strict=True) for i in range(count)]


class _Noise:
    """Standard normal numbers, one row a control step, drawn in blocks."""

    def __init__(self, rng: np.random.Generator, sizes: list[int]) -> None:
        self._rng, self._total, self._ends = rng, sum(sizes), np.cumsum(sizes)[:-1].tolist()
        self._next = _BLOCK
        self._block = np.empty((_BLOCK, self._total))

    def next(self) -> tuple[Array, Array, Array, Array]:
        """The next row, split by `sizes`."""
        if self._next == _BLOCK:
            self._rng.standard_normal(out=self._block)
            self._next = 0
        row = self._block[self._next]
        self._next += 1
        a, b, c = self._ends
        return row[:a], row[a:b], row[b:c], row[c:]


def _turn(quaternion: Array, vector: Array) -> None:
    """Turns the wxyz `quaternion` in place by the rotation vector (3,) in W."""
    angle = math.sqrt(vector @ vector)
    if angle > 0.0:
        turn = np.empty(4)
        mujoco.mju_axisAngle2Quat(turn, vector / angle, angle)
        mujoco.mju_mulQuat(quaternion, turn, quaternion.copy())


def _view(array: Array, index: NDArray[np.intp]) -> Array:
    """`array[index]` as a view that stays current.

    Joints that an MJCF defines in a row lie in a row, but motors may be listed in any order: then the numbers are
    gathered at each use.
    """
    first, count = int(index[0]), len(index)
    if np.array_equal(index, np.arange(first, first + count)):
        return array[first : first + count]
    return _Gathered(array, index)  # type: ignore[return-value]


class _Gathered:
    """`array[index]`, gathered anew each time NumPy reads it."""

    def __init__(self, array: Array, index: NDArray[np.intp]) -> None:
        self._array, self._index = array, index

    def __array__(self, dtype: object = None, copy: object = None) -> Array:
        return self._array[self._index]
