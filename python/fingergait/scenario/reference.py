"""The desired motion of the object, with its exact twist.

The frame D starts at the object's first measured pose and moves by
`X_WD(t): p = p_0 + step_t + lift(t) e_z,  R = R_y(swing(t)) R_z(yaw(t)) exp(step_r) R_0`:
the yaw turns the object about the vertical, then the swing tilts it about the world's Y axis, so the plane of the tilt
stays fixed in the world while the object turns in it. `lift` is a quintic in time; yaw rate and swing amplitude grow by
a quintic blend, so that neither velocity nor acceleration jumps. Only `step` jumps: it is a test signal.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fingergait.scenario.scenario import ReferenceConfig
from fingergait.scenario.steering import Steering

Array = NDArray[np.float64]


class Trajectory:
    """The desired pose and twist as functions of time, from the scenario's `reference` table.

    Parameters
    ----------
    config
        The table.
    start
        Pose (7,) of the object in W that the motion starts from: position, m, and wxyz quaternion.
    steered
        Let `steering` change the motion while it is under way; `sample` must then be called in order of time.
    """

    def __init__(self, config: ReferenceConfig, start: ArrayLike, steered: bool = False) -> None:
        start = np.asarray(start, dtype=float)
        self._config = config
        self._p = [float(x) for x in start[:3]]
        self._q = _unit([float(x) for x in start[3:]])
        self._p_step = [a + b for a, b in zip(self._p, config.step[:3], strict=True)]
        self._q_step = _multiply(_exponential(config.step[3:]), self._q)
        self._pose = np.empty(7)
        self._twist = np.zeros(6)
        self.steering = Steering(config.yaw_rate, config.swing_amplitude) if steered else None

    def sample(self, t: float) -> tuple[Array, Array]:
        """Desired pose (7,) in W and twist (6,), [linear; angular] in W, at time t, s. The arrays are reused."""
        c = self._config
        stepped = t >= c.step_at
        p, q = (self._p_step, self._q_step) if stepped else (self._p, self._q)
        rise, rise_rate = _quintic((t - c.lift_at) / c.lift_time)
        since = t - c.motion_start
        yaw, yaw_rate = self.yaw(t)
        amplitude, amplitude_rate = c.swing_amplitude, 0.0
        grow, grow_rate = _quintic(since / c.blend)
        if self.steering is not None:
            steering = self.steering
            steering.advance(t, grow)
            yaw, yaw_rate = yaw + steering.yaw, yaw_rate + steering.yaw_rate
            amplitude, amplitude_rate = amplitude + steering.swing, steering.swing_rate
        phase = c.swing_frequency * since
        swing = amplitude * grow * math.sin(phase)
        swing_rate = amplitude * (grow * c.swing_frequency * math.cos(phase) + grow_rate / c.blend * math.sin(phase))
        swing_rate += amplitude_rate * grow * math.sin(phase)
        cos_y, sin_y = math.cos(0.5 * swing), math.sin(0.5 * swing)
        cos_z, sin_z = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
        turn = (cos_y * cos_z, sin_y * sin_z, sin_y * cos_z, cos_y * sin_z)  # q_y q_z
        self._pose[0], self._pose[1], self._pose[2] = p[0], p[1], p[2] + c.lift * rise
        self._pose[3:] = _multiply(turn, q)
        # omega = swing' e_y + yaw' R_y(swing) e_z
        self._twist[2] = c.lift * rise_rate / c.lift_time
        self._twist[3] = yaw_rate * math.sin(swing)
        self._twist[4] = swing_rate
        self._twist[5] = yaw_rate * math.cos(swing)
        if self.steering is not None:
            self._twist[:2] = 0.0
            self.steering.move(self._pose, self._twist)
        return self._pose, self._twist

    def yaw(self, t: float) -> tuple[float, float]:
        """Desired yaw, rad, and its rate, rad/s, at time t: the integral of the blended rate."""
        c = self._config
        s = (t - c.motion_start) / c.blend
        if s <= 0.0:
            return 0.0, 0.0
        if s >= 1.0:
            return c.yaw_rate * c.blend * (s - 0.5), c.yaw_rate
        integral = s**4 * (2.5 + s * (-3.0 + s))  # of the quintic
        return c.yaw_rate * c.blend * integral, c.yaw_rate * _quintic(s)[0]


def _quintic(s: float) -> tuple[float, float]:
    """Smooth step from 0 at s = 0 to 1 at s = 1 with zero first and second derivatives there; value and d/ds."""
    if s <= 0.0:
        return 0.0, 0.0
    if s >= 1.0:
        return 1.0, 0.0
    return s**3 * (10.0 + s * (-15.0 + 6.0 * s)), 30.0 * s * s * (1.0 - s) ** 2


def _multiply(a: Sequence[float], b: Sequence[float]) -> list[float]:
    w, x, y, z = a
    w2, x2, y2, z2 = b
    return [
        w * w2 - x * x2 - y * y2 - z * z2,
        w * x2 + x * w2 + y * z2 - z * y2,
        w * y2 - x * z2 + y * w2 + z * x2,
        w * z2 + x * y2 - y * x2 + z * w2,
    ]


def _exponential(v: Sequence[float]) -> list[float]:
    x, y, z = v
    angle = math.sqrt(x * x + y * y + z * z)
    scale = 0.5 if angle < 1e-12 else math.sin(0.5 * angle) / angle
    return [math.cos(0.5 * angle), scale * x, scale * y, scale * z]


def _unit(q: list[float]) -> list[float]:
    norm = math.sqrt(sum(x * x for x in q))
    return [x / norm for x in q]
