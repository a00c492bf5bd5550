"""What is asked of the reference while it moves: an offset of the pose, another yaw rate, another swing.

Each number goes to what was asked last with a bounded rate and acceleration, so that no input, however abrupt, makes
the desired pose or twist jump. Untouched, every number is exactly zero and the trajectory is the scenario's own.
"""

import math

import numpy as np
from numpy.typing import NDArray

from fingergait.fields import Twist

Array = NDArray[np.float64]

LINEAR = (0.03, 0.15)  # m/s, m/s^2: what the offset's translation may do; 1.5 % of gravity
ANGULAR = (0.5, 2.5)  # rad/s, rad/s^2: its rotation
_YAW = (math.inf, 0.5)  # the yaw rate itself: only its acceleration is bounded, rad/s^2
_SWING = (0.1, 0.5)  # rad/s, rad/s^2: the swing's amplitude


class Steering:
    """The numbers that are added to a `Trajectory`.

    Attributes
    ----------
    yaw, yaw_rate
        Added yaw, rad, and its rate, rad/s.
    swing, swing_rate
        Added amplitude of the swing, rad, and its rate, rad/s.
    """

    def __init__(self, yaw_rate: float, swing_amplitude: float) -> None:
        self._base = yaw_rate, swing_amplitude
        self._offset = [_Follower(*LINEAR) for _ in range(3)] + [_Follower(*ANGULAR) for _ in range(3)]
        self._rate, self._amplitude = _Follower(_YAW[1], math.inf), _Follower(*_SWING)
        self._t: float | None = None
        self.yaw = self.yaw_rate = self.swing = self.swing_rate = 0.0

    def ask(self, key: str, value: float | Twist) -> None:
        """Takes a new goal: `reference.offset`, `reference.yaw_rate` or `reference.swing_amplitude`."""
        if isinstance(value, tuple):
            for follower, goal in zip(self._offset, value, strict=True):
                follower.goal = goal
        elif key == "reference.yaw_rate":
            self._rate.goal = value - self._base[0]
        else:
            self._amplitude.goal = value - self._base[1]

    def advance(self, t: float, grown: float) -> None:
        """Goes on to time t, s; `grown`, 0 to 1, is how far the trajectory's own yaw has set in."""
        dt = 0.0 if self._t is None else t - self._t
        self._t = t
        if dt <= 0.0:
            return
        for follower in (*self._offset, self._rate, self._amplitude):
            follower.advance(dt)
        self.yaw_rate = grown * self._rate.value
        self.yaw += self.yaw_rate * dt
        self.swing, self.swing_rate = self._amplitude.value, self._amplitude.rate

    @property
    def offset(self) -> tuple[Array, Array]:
        """The offset now, (6,), m and rad, and its rate, (6,)."""
        return np.array([f.value for f in self._offset]), np.array([f.rate for f in self._offset])

    def move(self, pose: Array, twist: Array) -> None:
        """Moves a desired pose (7,) and twist (6,) by the offset, in place.

        The position is shifted and the orientation turned by exp(r), both in W: R = exp(r) R_D and
        omega = J_l(r) r' + exp(r) omega_D, with J_l the left Jacobian of SO(3).
        """
        if not any(f.value or f.rate for f in self._offset):
            return
        offset, rate = self.offset
        pose[:3] += offset[:3]
        twist[:3] += rate[:3]
        rotation, jacobian = _exponential(offset[3:])
        twist[3:] = jacobian @ rate[3:] + rotation @ twist[3:]
        w, v = pose[3], pose[4:].copy()
        angle = float(np.linalg.norm(offset[3:]))
        c, s = math.cos(0.5 * angle), 0.5 * float(np.sinc(0.5 * angle / math.pi)) * offset[3:]
        pose[3], pose[4:] = c * w - s @ v, c * v + w * s + np.cross(s, v)


class _Follower:
    """A number that goes to its goal with bounded rate and acceleration, and brakes in time."""

    def __init__(self, max_rate: float, acceleration: float) -> None:
        self._max_rate, self._acceleration = max_rate, acceleration
        self.goal = self.value = self.rate = 0.0

    def advance(self, dt: float) -> None:
        """Goes on by dt, s."""
        gap = self.goal - self.value
        if gap == 0.0 and self.rate == 0.0:
            return
        speed = min(self._max_rate, abs(gap) / dt)
        if math.isfinite(self._acceleration):
            # A little early: the braking curve is followed in steps.
            speed = min(speed, math.sqrt(1.6 * self._acceleration * abs(gap)))
            step = self._acceleration * dt
            self.rate += min(step, max(-step, math.copysign(speed, gap) - self.rate))
        else:
            self.rate = math.copysign(speed, gap)
            step = 0.0
        self.value += self.rate * dt
        if abs(self.goal - self.value) <= 1e-9 or (abs(self.rate) <= step and abs(gap) <= step * dt):
            self.value, self.rate = self.goal, 0.0


def _exponential(r: Array) -> tuple[Array, Array]:
    """Rotation exp(r) and the left Jacobian J_l(r), each (3, 3)."""
    angle = float(np.linalg.norm(r))
    x = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
    if angle < 1e-6:
        return np.eye(3) + x, np.eye(3) + 0.5 * x
    a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
    return np.eye(3) + a * x + b * x @ x, np.eye(3) + b * x + (1.0 - a) / angle**2 * x @ x
