"""Linear systems in state-space form: x' = A x + B u, y = C x + D u, and the few operations the synthesis needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class StateSpace:
    """A linear time-invariant system.

    Attributes
    ----------
    A, B, C, D : (n, n), (n, m), (p, n), (p, m)
    dt : float or None
        Sample time in s of a discrete system (x+ = A x + B u); None for a continuous one.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    dt: float | None = None

    def __post_init__(self) -> None:
        D = np.atleast_2d(np.asarray(self.D, dtype=float))
        p, m = D.shape
        n = np.asarray(self.A).size
        n = round(n**0.5)
        for name, shape in (("A", (n, n)), ("B", (n, m)), ("C", (p, n)), ("D", (p, m))):
            value = np.asarray(D if name == "D" else getattr(self, name), dtype=float)
            if value.size != shape[0] * shape[1]:
                raise ValueError(f"state space: {name} must have shape {shape}, found {value.shape}")
            object.__setattr__(self, name, value.reshape(shape))

    @property
    def order(self) -> int:
        """Number of states."""
        return int(self.A.shape[0])

    @property
    def n_inputs(self) -> int:
        """Number of inputs."""
        return int(self.D.shape[1])

    @property
    def n_outputs(self) -> int:
        """Number of outputs."""
        return int(self.D.shape[0])

    @property
    def poles(self) -> ComplexArray:
        """Eigenvalues of A."""
        return np.asarray(np.linalg.eigvals(self.A), dtype=complex)

    def is_stable(self) -> bool:
        """True if every pole is strictly inside the stability region."""
        if self.order == 0:
            return True
        poles = self.poles
        return bool(np.all(poles.real < 0.0)) if self.dt is None else bool(np.all(np.abs(poles) < 1.0))

    def at(self, omega: ArrayLike) -> ComplexArray:
        """Frequency response (n_w, p, m) at omega in rad/s: at s = j omega, or at z = e^(j omega dt)."""
        w = np.atleast_1d(np.asarray(omega, dtype=float))
        s = 1j * w if self.dt is None else np.exp(1j * w * self.dt)
        if self.order == 0:
            return np.broadcast_to(self.D.astype(complex), (w.size, *self.D.shape)).copy()
        resolvent = s[:, None, None] * np.eye(self.order) - self.A
        return np.asarray(self.C @ np.linalg.solve(resolvent, self.B.astype(complex)[None]) + self.D)

    def select(self, outputs: Sequence[int] | slice, inputs: Sequence[int] | slice) -> StateSpace:
        """The system between the chosen inputs and outputs; keeps every state."""
        return StateSpace(self.A, self.B[:, inputs], self.C[outputs], self.D[outputs][:, inputs], self.dt)

    def scaled(self, left: ArrayLike, right: ArrayLike) -> StateSpace:
        """left @ self @ right, for constant matrices (or scalars)."""
        L = np.asarray(left, dtype=float)
        R = np.asarray(right, dtype=float)
        L = L * np.eye(self.n_outputs) if L.ndim == 0 else L
        R = R * np.eye(self.n_inputs) if R.ndim == 0 else R
        return StateSpace(self.A, self.B @ R, L @ self.C, L @ self.D @ R, self.dt)

    def transformed(self, T: Array) -> StateSpace:
        """The same system in the coordinates xi = T^-1 x."""
        inverse = np.linalg.inv(T)
        return system(inverse @ self.A @ T, inverse @ self.B, self.C @ T, self.D, self.dt)

    def __matmul__(self, first: StateSpace) -> StateSpace:
        """self @ first: `first` acts on the input, self on its output."""
        if self.n_inputs != first.n_outputs or self.dt != first.dt:
            raise ValueError(f"series: {self.n_inputs} inputs and dt {self.dt} after {first.n_outputs} and {first.dt}")
        A = np.block([[self.A, self.B @ first.C], [np.zeros((first.order, self.order)), first.A]])
        B = np.vstack([self.B @ first.D, first.B])
        return StateSpace(A, B, np.hstack([self.C, self.D @ first.C]), self.D @ first.D, self.dt)


def system(A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike, dt: float | None = None) -> StateSpace:
    """A StateSpace from anything that numpy reads as matrices."""
    A, B, C, D = (np.atleast_2d(np.asarray(M, dtype=float)) for M in (A, B, C, D))
    return StateSpace(A, B, C, D, dt)


def gain(D: ArrayLike, dt: float | None = None) -> StateSpace:
    """A constant matrix as a system without states."""
    matrix = np.atleast_2d(np.asarray(D, dtype=float))
    p, m = matrix.shape
    return StateSpace(np.zeros((0, 0)), np.zeros((0, m)), np.zeros((p, 0)), matrix, dt)


def append(*systems: StateSpace) -> StateSpace:
    """Block-diagonal arrangement of the systems: inputs and outputs are stacked."""
    dts = {g.dt for g in systems}
    if len(dts) != 1:
        raise ValueError(f"append: systems must share one sample time, found {dts}")
    A, B, C, D = (linalg.block_diag(*(getattr(g, name) for g in systems)) for name in "ABCD")
    return StateSpace(A, B, C, D, dts.pop())


def first_order_chain(zeros: Sequence[float], poles: Sequence[float], high_gain: float) -> StateSpace:
    """high_gain * prod (s + z_i)/(s + p_i), as a chain of first-order sections.

    The chain keeps each pole on the diagonal, so poles that are decades apart stay well conditioned.

    Parameters
    ----------
    zeros, poles : corner frequencies z_i, p_i in rad/s, of the same number; poles must be positive.
    high_gain : gain at infinite frequency.
    """
    if len(zeros) != len(poles):
        raise ValueError(f"chain: as many zeros as poles, found {len(zeros)} and {len(poles)}")
    chain = gain(high_gain)
    for z, p in zip(zeros, poles, strict=True):
        root = np.sqrt(abs(z - p)) or 1.0
        section = StateSpace(np.array([[-p]]), np.array([[root]]), np.array([[(z - p) / root]]), np.array([[1.0]]))
        chain = section @ chain
    return chain


def lft_lower(P: StateSpace, K: StateSpace) -> StateSpace:
    """F_l(P, K): the loop u = K y closed around the last inputs u and outputs y of P."""
    if P.dt != K.dt:
        raise ValueError(f"lft: P has sample time {P.dt}, K has {K.dt}")
    n_u, n_y = K.n_outputs, K.n_inputs
    B1, B2 = P.B[:, :-n_u], P.B[:, -n_u:]
    C1, C2 = P.C[:-n_y], P.C[-n_y:]
    D11, D12 = P.D[:-n_y, :-n_u], P.D[:-n_y, -n_u:]
    D21, D22 = P.D[-n_y:, :-n_u], P.D[-n_y:, -n_u:]
    F = np.linalg.inv(np.eye(n_u) - K.D @ D22)  # u = F (K.D y0 + K.C x_K), y0 = y at u = 0
    H = np.linalg.inv(np.eye(n_y) - D22 @ K.D)
    A = np.block([[P.A + B2 @ F @ K.D @ C2, B2 @ F @ K.C], [K.B @ H @ C2, K.A + K.B @ H @ D22 @ K.C]])
    B = np.vstack([B1 + B2 @ F @ K.D @ D21, K.B @ H @ D21])
    C = np.hstack([C1 + D12 @ F @ K.D @ C2, D12 @ F @ K.C])
    return StateSpace(A, B, C, D11 + D12 @ F @ K.D @ D21, P.dt)


def close_loop(P: ComplexArray, K: ComplexArray) -> ComplexArray:
    """F_l(P, K) frequency by frequency: P (n_w, p + n_y, m + n_u), K (n_w, n_u, n_y) -> (n_w, p, m)."""
    n_u, n_y = K.shape[1:]
    P11, P12 = P[:, :-n_y, :-n_u], P[:, :-n_y, -n_u:]
    P21, P22 = P[:, -n_y:, :-n_u], P[:, -n_y:, -n_u:]
    u = np.linalg.solve(np.eye(n_u) - K @ P22, K @ P21)
    return np.asarray(P11 + P12 @ u)


def balanced_scaling(G: StateSpace, sweeps: int = 50) -> StateSpace:
    """The system with its states scaled so that rows and columns of [A B; C 0] have like norms (Osborne, powers of 2).

    Poles that are decades apart make the Riccati equations of the H-infinity step ill conditioned; this repairs it
    without changing the transfer function.
    """
    A, B, C = G.A.copy(), G.B.copy(), G.C.copy()
    for _ in range(sweeps):
        moved = False
        for i in range(G.order):
            row = np.sqrt(np.sum(A[i] ** 2) - A[i, i] ** 2 + np.sum(B[i] ** 2))
            column = np.sqrt(np.sum(A[:, i] ** 2) - A[i, i] ** 2 + np.sum(C[:, i] ** 2))
            if row == 0.0 or column == 0.0:
                continue
            f = 2.0 ** np.round(np.log2(np.sqrt(row / column)))
            if f == 1.0:
                continue
            A[i] /= f
            B[i] /= f
            A[:, i] *= f
            C[:, i] *= f
            moved = True
        if not moved:
            break
    return StateSpace(A, B, C, G.D, G.dt)


def as_statespace(given: Any) -> StateSpace:
    """Any object with A, B, C, D (python-control's, scipy's, ours) as a StateSpace."""
    if isinstance(given, StateSpace):
        return given
    dt = getattr(given, "dt", None)
    return system(given.A, given.B, given.C, given.D, float(dt) if dt else None)
