"""The sampled loop in exact discrete time: a discrete K, hold, dead time and lag, and the body between samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from .statespace import Array, ComplexArray, StateSpace, append

STEP, PUSH, NOISE = "reference", "disturbance", "noise"  # the three groups of inputs of `SampledLoop.system`


@dataclass(frozen=True)
class SampledLoop:
    """K around (E) x'' + (B) x' = a + d, lag a' = u(t - delay) - a, in acceleration units, q axes.

    Attributes
    ----------
    K : discrete controller, q inputs and outputs; its dt is the sample time
    inertia, damping : (q, q), E and B of `UncertainBody`
    lag : s, of the motors
    delay : s, any number, from the sample to the hold's output
    prefilter : rad/s, critically damped second-order filter on the reference; None for none
    """

    K: StateSpace
    inertia: Array
    damping: Array
    lag: float
    delay: float
    prefilter: float | None = None

    @property
    def dt(self) -> float:
        assert self.K.dt is not None
        return self.K.dt

    def system(self) -> StateSpace:
        """The closed loop: inputs [reference; disturbance; noise] (3q), outputs [x; u] (2q)."""
        q, n = len(self.inertia), self.K.order
        plant = self._plant()
        Ef, Bf = _prefilter(self.prefilter, self.dt)
        n_p, n_f = plant.order, 2 if self.prefilter is not None else 0
        N = n_p + n + q * n_f
        p, k = slice(0, n_p), slice(n_p, n_p + n)
        one = np.eye(q)
        E = np.zeros((q, N + 3 * q))  # e = r_f - x - noise, as a row over (states, inputs)
        E[:, :q] = -one
        E[:, N + 2 * q :] = -one
        if n_f:
            E[:, n_p + n : n_p + n + q] = one
        else:
            E[:, N : N + q] = one
        U = self.K.D @ E
        U[:, k] += self.K.C
        rows = np.zeros((N, N + 3 * q))
        rows[p, p] = plant.A
        rows[p] += plant.B[:, :q] @ U
        rows[p, N + q : N + 2 * q] += plant.B[:, q:]
        rows[k, k] = self.K.A
        rows[k] += self.K.B @ E
        if n_f:
            f = slice(n_p + n, N)
            rows[f, f] = np.kron(Ef, one)
            rows[f, N : N + q] = np.kron(Bf, one)
        out = np.zeros((2 * q, N + 3 * q))
        out[:q, :q] = one
        out[q:] = U
        return StateSpace(rows[:, :N], rows[:, N:], out[:, :N], out[:, N:], self.dt)

    def _plant(self) -> StateSpace:
        """The body, lag and delay line over one sample: inputs (u, d), states (x, x', a, past u)."""
        q, T = len(self.inertia), self.dt
        Einv = np.linalg.inv(self.inertia)
        one = np.eye(q)
        n = 3 * q if self.lag > 0.0 else 2 * q
        A, Bu, Bd = np.zeros((n, n)), np.zeros((n, q)), np.zeros((n, q))
        A[:q, q : 2 * q] = one
        A[q : 2 * q, q : 2 * q] = -Einv @ self.damping
        Bd[q : 2 * q] = Einv
        if self.lag > 0.0:
            A[q : 2 * q, 2 * q :] = Einv
            A[2 * q :, 2 * q :] = -one / self.lag
            Bu[2 * q :] = one / self.lag
        else:
            Bu[q : 2 * q] = Einv
        Phi, whole = _over(A, np.hstack([Bu, Bd]), T)
        steps = int(np.floor(self.delay / T + 1e-9))
        rest = max(self.delay - steps * T, 0.0)
        rest = 0.0 if rest < 1e-9 * T else rest
        # over [0, rest) the older sample u[k - steps - 1] acts, over [rest, T) the newer one u[k - steps]
        _, newer = _over(A, Bu, T - rest)
        older = whole[:, :q] - newer
        line = steps + (1 if rest > 0.0 else 0)
        N = n + q * line  # states: n, then u[k-1], u[k-2], ...
        F, G = np.zeros((N, N)), np.zeros((N, 2 * q))
        F[:n, :n] = Phi
        G[:n, q:] = whole[:, q:]
        for gain, age in ((newer, steps), (older, steps + 1)):
            if age == 0:
                G[:n, :q] += gain
            elif age <= line:
                F[:n, n + (age - 1) * q : n + age * q] += gain
        if line:
            G[n : n + q, :q] = one
            F[n + q :, n : N - q] = np.eye(N - n - q)
        return StateSpace(F, G, np.eye(N)[: 2 * q], np.zeros((2 * q, 2 * q)), T)

    def is_stable(self) -> bool:
        return self.system().is_stable()

    def radius(self) -> float:
        """Largest eigenvalue modulus of the sampled loop."""
        return float(np.abs(np.linalg.eigvals(self.system().A)).max())


def _over(A: Array, B: Array, time: float) -> tuple[Array, Array]:
    """exp(A t) and the integral of exp(A s) B over [0, t]."""
    n, m = B.shape
    big = np.zeros((n + m, n + m))
    big[:n, :n], big[:n, n:] = A, B
    E = linalg.expm(big * time)
    return E[:n, :n], E[:n, n:]


def _prefilter(bandwidth: float | None, dt: float) -> tuple[Array, Array]:
    """Exact step of r_f'' + 2 w r_f' + w^2 r_f = w^2 r with r held: states (r_f, r_f')."""
    if bandwidth is None:
        return np.zeros((0, 0)), np.zeros((0, 1))
    w = bandwidth
    return _over(np.array([[0.0, 1.0], [-w * w, -2.0 * w]]), np.array([[0.0], [w * w]]), dt)


def hold(omega: Array, dt: float) -> ComplexArray:
    """(1 - exp(-j w T))/(j w T): the zero-order hold, seen at the frequency itself."""
    return np.asarray(np.exp(-0.5j * omega * dt) * np.sinc(omega * dt / (2.0 * np.pi)))


def join(axes: Sequence[StateSpace]) -> StateSpace:
    """K of several axes side by side."""
    return append(*axes)


def simulate(system: StateSpace, inputs: Array) -> Array:
    """Outputs (T, p) of a discrete system from rest for inputs (T, m)."""
    x = np.zeros(system.order)
    outputs = np.empty((len(inputs), system.n_outputs))
    for i, v in enumerate(inputs):
        outputs[i] = system.C @ x + system.D @ v
        x = system.A @ x + system.B @ v
    return outputs


def noise_deviation(system: StateSpace, covariance: Array) -> Array:
    """Standard deviations of a stable discrete system's outputs for white noise of the given covariance (m, m)."""
    power, X = system.A, system.B @ covariance @ system.B.T
    for _ in range(40):  # doubling: the sum of A^k Q A^k' converges for any stable A, singular or not
        X = X + power @ X @ power.T
        power = power @ power
        if np.abs(power).max() < 1e-12:
            break
    Y = system.C @ X @ system.C.T + system.D @ covariance @ system.D.T
    return np.asarray(np.sqrt(np.maximum(np.diag(Y), 0.0)))


def largest_stable(loop: Callable[[float], SampledLoop], start: float, stop: float, points: int = 40) -> float:
    """How far a parameter can move from `start` towards `stop` before the loop is unstable; `stop` if it never is.

    The parameter is scanned on a grid, then the first change is bisected: islands of stability beyond do not count.
    """
    good = start
    for value in np.linspace(start, stop, points + 1)[1:]:
        if loop(float(value)).is_stable():
            good = float(value)
            continue
        bad = float(value)
        for _ in range(30):
            middle = 0.5 * (good + bad)
            good, bad = (middle, bad) if loop(middle).is_stable() else (good, middle)
        return good
    return stop


def delay_margin(loop: SampledLoop, limit: float = 0.2) -> float:
    """Extra dead time in s that the loop stands, up to `limit`; zero if it is unstable as it is."""
    if not loop.is_stable():
        return 0.0
    return largest_stable(lambda extra: replace(loop, delay=loop.delay + extra), 0.0, limit, 100)


def gain_margins(loop: SampledLoop, limit: float = 30.0) -> tuple[float, float]:
    """By what factor K's gain may fall and rise, (1/limit..1, 1..limit); (1, 1) if the loop is unstable as it is."""
    if not loop.is_stable():
        return 1.0, 1.0

    def scaled(log: float) -> SampledLoop:
        factor = float(np.exp(log))
        return replace(loop, K=StateSpace(loop.K.A, loop.K.B, factor * loop.K.C, factor * loop.K.D, loop.K.dt))

    edge = float(np.log(limit))
    return float(np.exp(largest_stable(scaled, 0.0, -edge))), float(np.exp(largest_stable(scaled, 0.0, edge)))
