"""Force optimisation problems like those of a hand at work, and the same problems as any QP solver takes them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FAMILIES = ("nominal", "disturbance", "torque_limited", "release", "infeasible")
ALPHA = np.array([0.01, 0.01, 1000.0])
FINGERS, EDGES, RADIUS, CAP = 4, 8, 0.025, 15.0


@dataclass(frozen=True)
class Instance:
    """Eq. (8) at one step: what `ForceOptimizer.solve` takes."""

    G: Array
    J: Array
    F_des: Array
    tau_min: Array
    tau_max: Array
    cap: Array


@dataclass(frozen=True)
class DenseQp:
    """min 1/2 f'H f + q'f subject to lower <= A f <= upper, divided by alpha1 + alpha2."""

    H: Array
    q: Array
    A: Array
    lower: Array
    upper: Array


def edges(mu: float = 0.8) -> Array:
    """Pyramid edges (n, 3, m) of friction coefficient `mu`."""
    angle = 2.0 * np.pi * np.arange(EDGES) / EDGES
    one = np.stack([mu * np.cos(angle), mu * np.sin(angle), np.ones(EDGES)])
    return np.repeat(one[None], FINGERS, axis=0)


def sequence(family: str, steps: int, seed: int) -> list[Instance]:
    """Steps of a hand that holds a cylinder, each a little after the one before it."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0.0, 2.0 * np.pi, 6)
    heights = rng.uniform(-5e-3, 5e-3, FINGERS)
    links = rng.uniform(0.03, 0.06, (FINGERS, 3))
    return [_instance(family, k, phase, heights, links) for k in range(steps)]


def _instance(family: str, k: int, phase: Array, heights: Array, links: Array) -> Instance:
    t = 0.002 * k
    G = np.zeros((6, 3 * FINGERS))
    J = np.zeros((3 * FINGERS, 3 * FINGERS))
    for j in range(FINGERS):
        angle = 2.0 * np.pi * j / FINGERS + 0.2 * t + 0.05 * np.sin(phase[j])
        n = -np.array([np.cos(angle), np.sin(angle), 0.0])
        x = np.array([0.0, 0.0, 1.0])
        R = np.column_stack([x, np.cross(n, x), n])
        arm = -RADIUS * n + [0.0, 0.0, heights[j]]
        G[:3, 3 * j : 3 * j + 3] = R
        G[3:, 3 * j : 3 * j + 3] = np.cross(arm, R, axis=0)
        turn = 0.3 * np.sin(2.0 * t + phase[j])
        lever = np.array([[np.cos(turn), 0.1, -np.sin(turn)], [0.0, 1.0, 0.2], [np.sin(turn), 0.3, np.cos(turn)]])
        J[3 * j : 3 * j + 3, 3 * j : 3 * j + 3] = lever * links[j]
    F_des = np.array([0.3, 0.3, 5.0, 2e-3, 2e-3, 4e-3]) + [0.5, 0.5, 0.5, 5e-3, 5e-3, 5e-3] * np.sin(4.0 * t + phase)
    cap = np.full(FINGERS, CAP)
    tau_max = 0.5
    if family == "disturbance" and 20 <= k % 60 < 40:
        F_des[0] += 5.0
    elif family == "torque_limited":
        tau_max = 0.12
    elif family == "release":
        cap[1] = max(0.0, 3.0 - 0.1 * k)
    elif family == "infeasible":
        F_des[:3] *= 8.0
    bound = np.full(3 * FINGERS, tau_max)
    return Instance(G, J, F_des, -bound, bound, cap)


def dense(instance: Instance, f_prev: Array, facets: Array) -> DenseQp:
    """The instance in facet form, in f alone; a contact whose cap is zero keeps f = 0 by its bounds."""
    s = ALPHA[0] + ALPHA[1]
    pinned = np.repeat(instance.cap <= 0.0, 3)
    G = np.where(pinned, 0.0, instance.G)
    H = np.eye(G.shape[1]) + ALPHA[2] / s * G.T @ G
    q = -(ALPHA[1] / s * np.where(pinned, 0.0, f_prev) + ALPHA[2] / s * G.T @ instance.F_des)
    cone = np.kron(np.eye(FINGERS), facets)
    lift = np.kron(np.eye(FINGERS), [[0.0, 0.0, 1.0]])
    A = np.vstack([cone, lift, instance.J.T])
    lower = np.concatenate([np.zeros(len(cone)), np.full(FINGERS, -np.inf), instance.tau_min])
    upper = np.concatenate([np.full(len(cone), np.inf), instance.cap, instance.tau_max])
    return DenseQp(H, q, A, lower, upper)


def facet_normals() -> Array:
    """Inward unit normals (m, 3) of the pyramid of `edges`."""
    e = edges()[0].T
    n = np.cross(e, np.roll(e, -1, axis=0))
    unit: Array = n / np.linalg.norm(n, axis=1, keepdims=True)
    return unit
