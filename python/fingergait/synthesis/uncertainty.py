"""The uncertain rigid body in the hand, in descriptor form, as an upper linear fractional transformation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .blocks import Blocks
from .statespace import Array, StateSpace


@dataclass(frozen=True)
class UncertainBody:
    """The object with what the fingers add to it, in acceleration units, for q degrees of freedom.

        (E + P Delta_M) x'' + (B + R B Delta_B) x' = f

    where f is an acceleration (wrench over the nominal inertia M0 = diag(m0, m0, m0, I0)), E = 1 + M0^-1 M_hand,
    B = M0^-1 B_hand, P = diag(p) the relative error of each of the object's own inertias and R the relative error
    of the damping. Both Delta are diagonal with entries in [-1, 1]. The double integrator of the paper is E = 1, B = 0.

    As an LFT, with w = Delta z,

        E x'' + B x' = f - P w_M - w_B,     z_M = x'',     z_B = R B x'.

    The descriptor form avoids the inverse of the uncertain inertia, so each delta appears once per axis.

    Attributes
    ----------
    inertia : (q, q), E
    damping : (q, q), B, 1/s
    inertia_error : (q,), p
    damping_error : R, zero to leave the block out
    mass_axes : how many leading axes share one mass error delta_m (3 in the full problem)
    """

    inertia: Array
    damping: Array
    inertia_error: Array
    damping_error: float = 0.0
    mass_axes: int = 0

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

    def blocks(self, *, shared: bool = True) -> Blocks:
        """The structure of Delta: delta_m (repeated), one scalar for each further inertia, one for each damping.

        Parameters
        ----------
        shared : False counts each axis of the mass as a block of its own, which covers more than is needed.
        """
        repeated = self.mass_axes if shared and self.mass_axes > 1 else 0
        mass: Blocks = [(repeated, 0)] if repeated else []
        inertia: Blocks = [(1, 1)] * (self.q - repeated)
        damping: Blocks = [(1, 1)] * self.q if self.has_damping_block else []
        return mass + inertia + damping

    def lft(self) -> StateSpace:
        """G with inputs (w, f) and outputs (z, x): the plant is F_u(G, Delta). States: (x, x')."""
        q = self.q
        Einv = np.linalg.inv(self.inertia)
        P = np.diag(self.inertia_error)
        zero, one = np.zeros((q, q)), np.eye(q)
        A = np.block([[zero, one], [zero, -Einv @ self.damping]])
        inputs = [-Einv @ P, -Einv] if self.has_damping_block else [-Einv @ P]
        accelerations = np.hstack([*inputs, Einv])  # of (w, f) on x''
        B = np.vstack([np.zeros_like(accelerations), accelerations])
        outputs = [np.hstack([zero, A[q:, q:]])]
        feedthrough = [accelerations]
        if self.has_damping_block:
            outputs.append(np.hstack([zero, self.damping_error * self.damping]))
            feedthrough.append(np.zeros_like(accelerations))
        outputs.append(np.hstack([one, zero]))
        feedthrough.append(np.zeros_like(accelerations))
        return StateSpace(A, B, np.vstack(outputs), np.vstack(feedthrough))

    def sample(self, delta_inertia: Array, delta_damping: Array) -> tuple[Array, Array]:
        """The true inertia and damping matrices (q, q) at given deltas (q,) in [-1, 1] each."""
        E = self.inertia + np.diag(self.inertia_error * delta_inertia)
        B = self.damping + np.diag(delta_damping) @ (self.damping_error * self.damping)
        return E, B
