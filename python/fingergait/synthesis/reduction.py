"""Controller reduction: balanced singular-perturbation approximation, which keeps the DC gain."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from .errors import LibraryError, SynthesisError
from .statespace import Array, StateSpace, balanced_scaling


def balance(G: StateSpace) -> tuple[StateSpace, Array]:
    """A balanced realisation of a stable continuous G (minimal part), and its Hankel singular values.

    Square-root method: with the Gramians P = R R^T and Q = L L^T, and L^T R = U S V^T, the projections are
    T = R V S^-1/2 and T^-1 = S^-1/2 U^T L^T.
    """
    if G.dt is not None or not G.is_stable():
        raise SynthesisError(
            f"reduction needs a stable continuous controller; largest real part {G.poles.real.max():.3g} rad/s"
        )
    G = balanced_scaling(G)
    R = _root(linalg.solve_continuous_lyapunov(G.A, -G.B @ G.B.T))
    L = _root(linalg.solve_continuous_lyapunov(G.A.T, -G.C.T @ G.C))
    U, s, Vt = linalg.svd(L.T @ R)
    keep = s > 1e-11 * s[0]
    root = 1.0 / np.sqrt(s[keep])
    T = R @ Vt.T[:, keep] * root
    Tinv = (U[:, keep] * root).T @ L.T
    return StateSpace(Tinv @ G.A @ T, Tinv @ G.B, G.C @ T, G.D), s


def _root(gramian: Array) -> Array:
    """A square root (n, n) of a positive semidefinite matrix; rounding below zero is cut off."""
    values, vectors = linalg.eigh(0.5 * (gramian + gramian.T))
    if values[0] < -1e-6 * abs(values[-1]):
        raise LibraryError(f"a Gramian is not positive semidefinite: smallest eigenvalue {values[0]:.3g}")
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def reduce(G: StateSpace, order: int) -> StateSpace:
    """G with at most `order` states: the weakest states of the balanced form are set to their steady state.

    Raises
    ------
    SynthesisError
        If G or the result is unstable.
    """
    balanced, _ = balance(G)
    if order >= balanced.order:
        return balanced
    A11, A12 = balanced.A[:order, :order], balanced.A[:order, order:]
    A21, A22 = balanced.A[order:, :order], balanced.A[order:, order:]
    B1, B2 = balanced.B[:order], balanced.B[order:]
    C1, C2 = balanced.C[:, :order], balanced.C[:, order:]
    X, Y = np.linalg.solve(A22, A21), np.linalg.solve(A22, B2)
    reduced = StateSpace(A11 - A12 @ X, B1 - A12 @ Y, C1 - C2 @ X, balanced.D - C2 @ Y)
    if not reduced.is_stable():
        raise SynthesisError(f"reduction to order {order} is unstable")
    return reduced
