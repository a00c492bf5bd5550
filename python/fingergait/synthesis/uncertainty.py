"""The uncertain rigid body in the hand, in descriptor form, as an upper linear fractional transformation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .blocks import Blocks
from .statespace import Array, StateSpace


@dataclass(frozen=True)
class UncertainBody:
    """The object with what the fingers add to it, in acceleration units, for q degrees of freedom.

        (E + P Delta_M) x'' + L (1 + R Delta_B) N x' = f

    where f is an acceleration (wrench over the nominal inertia M0 = diag(m0, m0, m0, I0)), E = 1 + M0^-1 M_hand,
    L N = B = M0^-1 B_hand, P = diag(p) the relative error of each of the object's own inertias and R the relative error
    of the damping. Both Delta are diagonal with entries in [-1, 1]. The double integrator of the paper is E = 1, B = 0.

    As an LFT, with w = Delta z,

        E x'' + B x' = f - P w_M - L w_B,     z_M = x'',     z_B = R N x'.

    The descriptor form avoids the inverse of the uncertain inertia, so each delta appears once per axis. With
    L = M0^-1 V and N = V^T the columns v_i of V are modes of the damping, B_hand = sum (1 + R delta_i) v_i v_i^T: it is
    symmetric and takes energy away whatever the deltas, and a common factor on all joints is among them.

    Attributes
    ----------
    inertia : (q, q), E
    damping_left, damping_right : (q, q), L and N; L N in 1/s
    inertia_error : (q,), p
    damping_error : R, zero to leave the block out
    mass_axes : how many leading axes share one mass error delta_m (3 in the full problem)
    """

    inertia: Array
    damping_left: Array
    damping_right: Array
    inertia_error: Array
    damping_error: float = 0.0
    mass_axes: int = 0

    @property
    def damping(self) -> Array:
        """B = L N, (q, q), 1/s."""
        return np.asarray(self.damping_left @ self.damping_right)

    @property
    def q(self) -> int:
        """Degrees of freedom."""
        return len(self.inertia_error)

    @property
    def has_damping_block(self) -> bool:
        return self.damping_error > 0.0

    @property
    def n_delta(self) -> int:
        """Size of Delta."""
        return self.q * (2 if self.has_damping_block else 1)

    def inertia_blocks(self) -> Blocks:
        """Structure of the inertia part of Delta: delta_m (repeated), then one scalar for each further inertia."""
        repeated = self.mass_axes if self.mass_axes > 1 else 0
        mass: Blocks = [(repeated, 0)] if repeated else []
        return mass + [(1, 1)] * (self.q - repeated)

    def blocks(self) -> Blocks:
        """The structure of Delta: the inertia part, and one scalar for each mode of the damping."""
        return self.inertia_blocks() + ([(1, 1)] * self.q if self.has_damping_block else [])

    def lft(self) -> StateSpace:
        """G with inputs (w, f) and outputs (z, x): the plant is F_u(G, Delta). States: (x, x')."""
        q = self.q
        Einv = np.linalg.inv(self.inertia)
        P = np.diag(self.inertia_error)
        zero, one = np.zeros((q, q)), np.eye(q)
        A = np.block([[zero, one], [zero, -Einv @ self.damping]])
        inputs = [-Einv @ P, -Einv @ self.damping_left] if self.has_damping_block else [-Einv @ P]
        accelerations = np.hstack([*inputs, Einv])  # of (w, f) on x''
        B = np.vstack([np.zeros_like(accelerations), accelerations])
        outputs = [np.hstack([zero, A[q:, q:]])]
        feedthrough = [accelerations]
        if self.has_damping_block:
            outputs.append(np.hstack([zero, self.damping_error * self.damping_right]))
            feedthrough.append(np.zeros_like(accelerations))
        outputs.append(np.hstack([one, zero]))
        feedthrough.append(np.zeros_like(accelerations))
        return StateSpace(A, B, np.vstack(outputs), np.vstack(feedthrough))

    def sample(self, delta_inertia: Array, delta_damping: Array) -> tuple[Array, Array]:
        """The true inertia and damping matrices (q, q) at given deltas (q,) in [-1, 1] each."""
        E = self.inertia + np.diag(self.inertia_error * delta_inertia)
        B = self.damping_left @ np.diag(1.0 + self.damping_error * delta_damping) @ self.damping_right
        return E, np.asarray(B)


def damping_modes(B: Array) -> Array:
    """V (n, n) with B = V V^T for a symmetric positive semidefinite B, one mode a column.

    The modes are those of B scaled to a unit diagonal, so that N s/m and N m s do not mix by their size; a diagonal B
    has one mode on each axis, in order.
    """
    scale = np.sqrt(np.diag(B))
    safe = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(B / np.outer(safe, safe))
    V = safe[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    order = _match(np.abs(vectors))
    return np.asarray(V[:, order])


def _match(weights: Array) -> list[int]:
    """Columns in the order that gives each row the free column with its largest weight."""
    free = list(range(weights.shape[1]))
    order: list[int] = []
    for row in weights:
        order.append(max(free, key=lambda column: row[column]))
        free.remove(order[-1])
    return order
