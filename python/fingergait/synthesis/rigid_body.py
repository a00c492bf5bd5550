"""Many nonlinear rigid bodies in the hand at once, under one discrete controller with limited wrenches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .discretise import DiscreteController
from .loop import _prefilter
from .statespace import Array

GRAVITY = 9.81  # m/s^2


@dataclass(frozen=True)
class Bodies:
    """N true bodies.

    Attributes
    ----------
    mass : (N,), kg
    inertia : (N, 3), kg m^2, principal, in the body's axes
    damping : (N, 6, 6), N s/m, N s, N m s: of the fingers, in W
    hand_inertia : (6, 6), of the fingers, in W
    """

    mass: Array
    inertia: Array
    damping: Array
    hand_inertia: Array


@dataclass(frozen=True)
class Runtime:
    """What runs at the control rate: u = K e, F_des = [m0 u_t + m0 g e_z; I0 u_r], limited, delayed, lagged."""

    axes: Sequence[DiscreteController]
    mass: float
    inertia: tuple[float, float, float]
    dt: float
    delay: float
    lag: float
    prefilter: float | None
    force_limit: float
    torque_limit: float


@dataclass(frozen=True)
class Outcome:
    """error (T, N, 6): pose error to the unfiltered reference, m and rad; time (T,); unstable (N,)."""

    time: Array
    error: Array
    unstable: NDArray[np.bool_]

    def settling(self, step: Array, fraction: float = 0.05) -> Array:
        """(N, 6) times in s after which a stepped channel stays within `fraction` of its step; nan where unstepped."""
        times = np.full(self.error.shape[1:], np.nan)
        for channel in np.flatnonzero(step):
            outside = np.abs(self.error[:, :, channel]) > fraction * abs(step[channel])
            last = len(self.time) - 1 - np.argmax(outside[::-1], axis=0)
            late = self.time[np.minimum(last + 1, len(self.time) - 1)]
            times[:, channel] = np.where(outside.any(axis=0), late, 0.0)
            times[outside[-1], channel] = np.inf
        return times

    def overshoot(self, step: Array) -> Array:
        """(N, 6) largest excursion beyond the target, as a fraction of the step; nan where unstepped."""
        values = np.full(self.error.shape[1:], np.nan)
        for channel in np.flatnonzero(step):
            values[:, channel] = np.maximum((-self.error[:, :, channel] / step[channel]).max(axis=0), 0.0)
        return values


def simulate_step(bodies: Bodies, runtime: Runtime, step: Array, duration: float, substeps: int = 2) -> Outcome:
    """The move `step` (6,) in m and rad from rest, gravity mismatch included, for all bodies together.

    Between control instants the wrench follows a first-order lag, exactly, and the body a semi-implicit Euler step:
    (M + h B) v+ = M v + h (wrench - gyroscopic torque). A body counts as unstable if its error exceeds ten times the
    largest step or is not finite; it is then frozen.
    """
    N, dt = len(bodies.mass), runtime.dt
    h = dt / substeps
    blend = 1.0 - np.exp(-h / runtime.lag) if runtime.lag > 0.0 else 1.0
    late = round(runtime.delay / h)
    n = max((K.system.order for K in runtime.axes), default=0)
    A, B, C, D, L = (np.zeros((6, *s)) for s in ((n, n), (n,), (n,), (), (n,)))
    for i, K in enumerate(runtime.axes):
        k = K.system.order
        A[i, :k, :k], B[i, :k], C[i, :k] = K.system.A, K.system.B[:, 0], K.system.C[0]
        D[i], L[i, :k] = K.system.D[0, 0], K.L[:, 0]
    Ef, Bf = _prefilter(runtime.prefilter, dt)
    scale = np.array([runtime.mass] * 3 + list(runtime.inertia))
    limit = np.array([runtime.force_limit] * 3 + [runtime.torque_limit] * 3) / scale
    mismatch = np.zeros((N, 6))
    mismatch[:, 2] = -(bodies.mass - runtime.mass) * GRAVITY

    position, R, v = np.zeros((N, 3)), np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 6))
    state, filtered = np.zeros((N, 6, n)), np.zeros((2, 6))
    wrench = np.zeros((N, 6))
    queue = [np.zeros((N, 6))] * late
    steps = round(duration / dt)
    error = np.zeros((steps, N, 6))
    alive = np.ones(N, dtype=bool)
    bound = 10.0 * max(np.abs(step).max(), 1e-3)
    M: Array = np.zeros((N, 6, 6))
    inverse: Array = M
    for k in range(steps):
        if runtime.prefilter is not None:
            filtered = Ef @ filtered + Bf * step
        target = filtered[0] if runtime.prefilter is not None else step
        e = np.concatenate([target[:3] - position, rotation_vector(exponential(target[3:]) @ R.transpose(0, 2, 1))], 1)
        u = np.einsum("ai,nai->na", C, state) + D * e
        realised = np.clip(u, -limit, limit)
        state = np.einsum("aij,naj->nai", A, state) + B * e[:, :, None] + L * (realised - u)[:, :, None]
        if k % 5 == 0:
            M = np.tile(bodies.hand_inertia, (N, 1, 1))
            M[:, [0, 1, 2], [0, 1, 2]] += bodies.mass[:, None]
            M[:, 3:, 3:] += (R * bodies.inertia[:, None, :]) @ R.transpose(0, 2, 1)
            inverse = np.asarray(np.linalg.inv(M + h * bodies.damping), dtype=float)
        for _ in range(substeps):
            queue.append(realised * scale)
            wrench = wrench + blend * (queue.pop(0) - wrench)
            omega = v[:, 3:]
            load = wrench + mismatch
            momentum = np.einsum("nij,nj->ni", R, bodies.inertia * np.einsum("nji,nj->ni", R, omega))
            load[:, 3:] -= np.cross(omega, momentum)
            v = np.einsum("nij,nj->ni", inverse, np.einsum("nij,nj->ni", M, v) + h * load)
            v[~alive] = 0.0
            position = position + h * v[:, :3]
            R = exponential(h * v[:, 3:]) @ R
        error[k, :, :3] = step[:3] - position
        error[k, :, 3:] = rotation_vector(exponential(step[3:]) @ R.transpose(0, 2, 1))
        alive &= np.isfinite(error[k]).all(axis=1) & (np.abs(error[k]).max(axis=1) < bound)
    return Outcome(np.linspace(dt, steps * dt, steps), error, ~alive)


def exponential(w: Array) -> Array:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), by Rodrigues' formula."""
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    W = np.zeros((*w.shape, 3))
    W[..., 0, 1], W[..., 0, 2], W[..., 1, 2] = -w[..., 2], w[..., 1], -w[..., 0]
    W -= np.swapaxes(W, -1, -2)
    half = np.sinc(angle / (2.0 * np.pi))
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * W + 0.5 * half**2 * (W @ W))


def rotation_vector(R: Array) -> Array:
    """Rotation vectors (..., 3) of rotation matrices with angles below pi."""
    skew = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1) / 2.0
    sine = np.linalg.norm(skew, axis=-1)
    cosine = (np.trace(R, axis1=-2, axis2=-1) - 1.0) / 2.0
    angle = np.arctan2(sine, cosine)
    factor = np.where(sine > 1e-9, angle / np.where(sine > 1e-9, sine, 1.0), 1.0)
    return np.asarray(skew * factor[..., None])
