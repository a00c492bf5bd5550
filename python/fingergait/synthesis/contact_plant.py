"""What the fingers add to the object they hold: their joints' damping and inertia, reflected through the grasp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .statespace import Array


@dataclass(frozen=True)
class ReflectedHand:
    """Damping and inertia of the fingers as the object feels them, in W at Oo, [translation; rotation].

    Attributes
    ----------
    inertia : (6, 6), kg, kg m, kg m^2
    damping : (6, 6), N s/m, N s, N m s
    """

    inertia: Array
    damping: Array


def reflect(G: ArrayLike, J: ArrayLike, joint_damping: ArrayLike, joint_inertia: ArrayLike) -> ReflectedHand:
    """The hand's damping and inertia at the object, for contacts that neither slip nor break.

    The contact points move with the object and with the fingers, J qd = G^T v, so qd = J^-1 G^T v. Equal power gives

        B_hand = G J^-T D J^-1 G^T,     M_hand = G J^-T M J^-1 G^T.

    Parameters
    ----------
    G : (6, 3n), grasp map, wrench on the object = G f
    J : (3n, n_q), velocity of the contact points = J qd, tau = J^T f
    joint_damping : (n_q,) or (n_q, n_q), N m s/rad
    joint_inertia : (n_q, n_q), kg m^2

    Raises
    ------
    ValueError
        If J is not square or is singular: a finger that cannot follow its contact point has no such reflection.
    """
    G, J = np.asarray(G, dtype=float), np.asarray(J, dtype=float)
    D, M = np.asarray(joint_damping, dtype=float), np.asarray(joint_inertia, dtype=float)
    D = np.diag(D) if D.ndim == 1 else D
    if G.shape != (6, J.shape[0]) or J.shape[0] != J.shape[1]:
        raise ValueError(f"reflect: expected G (6, 3n) and square J (3n, n_q), found {G.shape} and {J.shape}")
    if D.shape != J.shape or M.shape != J.shape:
        raise ValueError(f"reflect: damping and inertia must match J {J.shape}, found {D.shape} and {M.shape}")
    if np.linalg.cond(J) > 1e8:
        raise ValueError(f"reflect: the hand is singular in this pose (condition number of J {np.linalg.cond(J):.2g})")
    T = np.linalg.solve(J, G.T)  # (n_q, 6), qd = T v
    damping, inertia = T.T @ D @ T, T.T @ M @ T
    return ReflectedHand(0.5 * (inertia + inertia.T), 0.5 * (damping + damping.T))
