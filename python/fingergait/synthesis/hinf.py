"""The K step: an H-infinity controller for a generalised plant, by slycot's SB10AD, with its answer checked."""

from __future__ import annotations

import numpy as np
import slycot

from .errors import LibraryError
from .statespace import StateSpace, balanced_scaling, lft_lower, system

_START = 100.0  # first gamma tried: SB10AD's bisection is quick from here and stalls from 1e100


def h_infinity(
    P: StateSpace, n_y: int, n_u: int, *, gamma: float | None = None, backoff: float = 1.01
) -> tuple[StateSpace, float]:
    """A stabilising K with ||F_l(P, K)||_inf <= gamma, and that gamma.

    Parameters
    ----------
    P : continuous generalised plant; its last n_y outputs are measured and its last n_u inputs are controls.
    gamma : the level to reach; None finds the smallest one.
    backoff : with gamma None, K is computed at this multiple of the smallest gamma: the optimal K is ill conditioned.

    Raises
    ------
    LibraryError
        If no level up to 1e8 is feasible, if SB10AD reports an error, or if its K does not stabilise P.
    """
    scaled = balanced_scaling(P)
    arguments = (P.order, P.n_inputs, P.n_outputs, n_u, n_y)
    matrices = (scaled.A, scaled.B, scaled.C, scaled.D)
    if gamma is None:
        gamma = backoff * _smallest(arguments, matrices)
    try:
        answer = slycot.sb10ad(*arguments, gamma, *matrices, job=4)
    except Exception as error:
        raise LibraryError(f"SB10AD found no controller at gamma = {gamma:.4g}: {_line(error)}") from error
    K = system(*answer[1:5])
    closed = lft_lower(P, K)
    if not all(np.all(np.isfinite(m)) for m in (K.A, K.B, K.C, K.D)) or not closed.is_stable():
        raise LibraryError(
            f"SB10AD returned a K that does not stabilise the plant at gamma = {gamma:.4g} "
            f"(largest real part {closed.poles.real.max():.3g} rad/s)"
        )
    return K, gamma


def _smallest(arguments: tuple[int, ...], matrices: tuple[object, ...]) -> float:
    """The smallest feasible gamma, by SB10AD's bisection from a start that is raised until it is admissible."""
    start = _START
    while True:
        try:
            return float(slycot.sb10ad(*arguments, start, *matrices, job=1, gtol=1e-4)[0])
        except Exception as error:
            if start >= 1e8:
                raise LibraryError(f"SB10AD found no controller up to gamma = {start:.0e}: {_line(error)}") from error
            start *= 10.0


def h_infinity_norm(G: StateSpace) -> float:
    """||G||_inf of a stable system, by slycot's AB13DD.

    Raises
    ------
    LibraryError
        If G is not stable (the norm of an unstable system would look finite) or the routine fails.
    """
    if not G.is_stable():
        raise LibraryError("the H-infinity norm was asked of a system that is not stable")
    kind = "C" if G.dt is None else "D"
    try:
        peak, _ = slycot.ab13dd(
            kind, "I", "S", "D", G.order, G.n_inputs, G.n_outputs, G.A, np.eye(G.order), G.B, G.C, G.D, 1e-8
        )
    except Exception as error:
        raise LibraryError(f"AB13DD failed: {_line(error)}") from error
    return float(peak)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
