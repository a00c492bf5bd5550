"""From a continuous controller to one that runs at the control rate, with its anti-windup gain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from .errors import LibraryError, SynthesisError
from .statespace import Array, StateSpace


@dataclass(frozen=True)
class DiscreteController:
    """u = C x + D e, x+ = A x + B e + L (u_realised - u), once every sample time.

    Attributes
    ----------
    system : discrete StateSpace (A, B, C, D)
    L : (n, n_u), anti-windup gain; the states follow what the actuators really did
    """

    system: StateSpace
    L: Array


def tustin(G: StateSpace, dt: float) -> StateSpace:
    """The bilinear transform s = (2/dt)(z - 1)/(z + 1) of a continuous system, states scaled for like gains.

    Stable stays stable, and the response at DC is kept.
    """
    if G.dt is not None:
        raise ValueError("tustin: the system is already discrete")
    n = G.order
    inverse = np.linalg.inv(np.eye(n) - 0.5 * dt * G.A)
    A = inverse @ (np.eye(n) + 0.5 * dt * G.A)
    B = inverse @ G.B * np.sqrt(dt)
    C = np.sqrt(dt) * G.C @ inverse
    return StateSpace(A, B, C, G.D + 0.5 * dt * G.C @ inverse @ G.B, dt)


def anti_windup(K: StateSpace, decay: float) -> Array:
    """The anti-windup gain L (n, n_u) with which every state of A - L C decays faster than exp(-decay t).

    While the actuators give u_realised, the states obey x+ = (A - L C) x + (B - L D) e + L u_realised: an observer of
    the input that was really applied. L is the stationary Kalman gain for process noise that enters as e does (a
    compromise between no correction and Hanus' conditioning L = B D^-1), computed for exp(decay dt) A so that the
    decay is guaranteed (prescribed degree of stability, Anderson and Moore).

    Parameters
    ----------
    K : discrete controller
    decay : 1/s
    """
    if K.dt is None:
        raise ValueError("anti_windup: the controller must be discrete")
    n = K.order
    if n == 0:
        return np.zeros((0, K.n_outputs))
    growth = float(np.exp(decay * K.dt))
    A, C = growth * K.A, K.C
    D = K.D if np.linalg.matrix_rank(K.D) == K.n_outputs else np.eye(K.n_outputs)
    Q = K.B @ K.B.T + 1e-9 * np.trace(K.B @ K.B.T) / n * np.eye(n)
    R = D @ D.T
    try:
        X = linalg.solve_discrete_are(A.T, C.T, Q, R)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise LibraryError(f"the Riccati equation of the anti-windup gain was not solved: {error}") from error
    L = A @ X @ C.T @ np.linalg.inv(C @ X @ C.T + R) / growth
    radius = float(np.abs(np.linalg.eigvals(K.A - L @ K.C)).max())
    if radius > np.exp(-decay * K.dt) * (1.0 + 1e-9):
        raise SynthesisError(f"anti-windup: a state decays at {-np.log(radius) / K.dt:.3g} 1/s, asked for {decay:.3g}")
    return np.asarray(L)


def discretise(K: StateSpace, dt: float, *, windup_decay: float = 10.0) -> DiscreteController:
    """K at sample time dt (s) by Tustin's rule, with its anti-windup gain.

    Raises
    ------
    SynthesisError
        If K has a pole in the right half plane (a pole at zero, an integrator, is fine).
    """
    if K.order and K.poles.real.max() > 1e-9 * (1.0 + np.abs(K.poles).max()):
        raise SynthesisError(f"discretise: the controller is unstable, largest real part {K.poles.real.max():.3g}")
    system = tustin(K, dt)
    return DiscreteController(system, anti_windup(system, windup_decay))
