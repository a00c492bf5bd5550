"""The D-K iteration, eq. (7) of the paper: min over K of inf over D of ||D F_l(P, K) D^-1||_inf."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .blocks import Block, Blocks, parse_blocks
from .dfit import MagnitudeFit, fit_magnitude
from .errors import LibraryError, SynthesisError
from .hinf import h_infinity
from .mu_upper import upper_bound
from .statespace import Array, ComplexArray, StateSpace, append, as_statespace, close_loop, gain

Scaling = list[MagnitudeFit]  # one fit per block of Delta, the last block's is one


@dataclass(frozen=True)
class Iteration:
    """One round: the H-infinity level of the scaled problem, the mu peak of its K, and K's order."""

    gamma: float
    mu_peak: float
    order: int
    fit_orders: tuple[int, ...]


@dataclass(frozen=True)
class DKResult:
    """The best iterate of a D-K iteration.

    Attributes
    ----------
    K : the controller
    mu_peak : peak over omega of the mu upper bound (diagonal scalings) of F_l(P, K)
    history : every iteration, in order; the sequence need not be monotone
    omega, mu : (n_w,), the upper bound of the best iterate
    scaling : the fitted D with which K was computed
    """

    K: StateSpace
    mu_peak: float
    history: list[Iteration]
    omega: Array
    mu: Array
    scaling: Scaling


def dk_iteration(
    P: Any,
    n_y: int,
    n_u: int,
    blocks: Sequence[tuple[int, int]],
    omega: ArrayLike,
    *,
    iterations: int = 6,
    max_order: int = 3,
    target: float = 0.0,
    initial: Scaling | None = None,
    band: tuple[float, float] | None = None,
    progress: Callable[[Iteration], None] | None = None,
) -> DKResult:
    """A controller that makes mu of the closed loop small, by alternating H-infinity and scaling steps.

    Parameters
    ----------
    P : continuous generalised plant with A, B, C, D; inputs (w, u), outputs (z, y)
    n_y, n_u : number of measurements and of controls, the last outputs and inputs of P
    blocks : Delta with its performance block, as in mussv; the last block's scaling is fixed to one
    omega : (n_w,) rad/s, grid on which mu is computed
    iterations : at most this many K steps
    max_order : largest order of each fitted scaling
    target : stop once the mu peak is below
    initial : scalings to start from instead of one
    band : rad/s, where the corners of the fits may lie; None: the span of omega
    progress : called with each iteration

    Raises
    ------
    SynthesisError
        If not even the first K step succeeds.

    Deviation
    ---------
    Repeated scalar blocks get diagonal scalings, and real blocks are treated as complex: both are conservative.
    """
    plant = as_statespace(P)
    w = np.asarray(omega, dtype=float)
    structure = scalar_structure(blocks)
    response = plant.at(w)
    scaling = initial if initial is not None else [_ONE] * len(structure)
    history: list[Iteration] = []
    best: DKResult | None = None
    for _ in range(iterations):
        try:
            K, gamma = h_infinity(scaled_plant(plant, structure, scaling, n_y, n_u), n_y, n_u)
        except LibraryError as error:
            if best is None:
                raise SynthesisError(f"D-K iteration: the first K step failed: {error}") from error
            break
        M = close_loop(response, K.at(w))
        bound = upper_bound(M, structure, diagonal=True, real=False, tolerance=1e-4)
        step = Iteration(gamma, float(bound.value.max()), K.order, tuple(f.order for f in scaling))
        history.append(step)
        if progress is not None:
            progress(step)
        if best is None or step.mu_peak < best.mu_peak:
            best = DKResult(K, step.mu_peak, history, w, bound.value, scaling)
        if step.mu_peak < target:
            break
        scaling = fit_scalings(w, M, structure, bound.block_gains(structure), bound.value, max_order, band)
    assert best is not None
    return best


def scalar_structure(blocks: Sequence[tuple[int, int]]) -> list[Block]:
    """The structure with each repeated or real scalar block split into complex 1x1 blocks."""
    split: Blocks = []
    for r, c in blocks:
        split += [(r, c)] if r > 0 and c > 0 else [(1, 1)] * abs(r)
    return parse_blocks(split)


def scaled_plant(P: StateSpace, structure: Sequence[Block], scaling: Scaling, n_y: int, n_u: int) -> StateSpace:
    """D P D^-1 with the fitted scalings in state-space form; measurements and controls untouched."""
    left = append(
        *[f.statespace() for f, b in zip(scaling, structure, strict=True) for _ in range(b.c)], gain(np.eye(n_y))
    )
    right = append(
        *[f.inverse() for f, b in zip(scaling, structure, strict=True) for _ in range(b.r)], gain(np.eye(n_u))
    )
    return left @ P @ right


def fit_scalings(
    omega: Array,
    M: ComplexArray,
    structure: Sequence[Block],
    gains: Array,
    mu: Array,
    max_order: int,
    band: tuple[float, float] | None,
) -> Scaling:
    """Fits of the optimal scalings; a frequency counts by how much mu there depends on d, and by how near it is to
    the peak."""
    fits: Scaling = []
    near = (mu / mu.max()) ** 2
    for i in range(len(structure) - 1):
        weight = near * np.sqrt(_curvature(M, structure, gains, i))
        weight = np.maximum(weight, 0.02 * weight.max())
        fits.append(fit_magnitude(omega, gains[:, i], weight=weight, max_order=max_order, band=band))
    return [*fits, _ONE]


def _curvature(M: ComplexArray, structure: Sequence[Block], gains: Array, i: int, h: float = 0.2) -> Array:
    """Second difference of log sigma_max(D M D^-1) with respect to log d_i, at least a small positive number."""

    def level(step: float) -> Array:
        d = gains.copy()
        d[:, i] *= np.exp(step)
        left = np.concatenate([np.repeat(d[:, k, None], b.c, axis=1) for k, b in enumerate(structure)], axis=1)
        right = np.concatenate([np.repeat(d[:, k, None], b.r, axis=1) for k, b in enumerate(structure)], axis=1)
        return np.asarray(np.log(np.linalg.norm(left[:, :, None] * M / right[:, None, :], 2, axis=(1, 2))))

    return np.asarray(np.maximum(level(h) + level(-h) - 2.0 * level(0.0), 0.0) / h**2 + 1e-6)


_ONE = MagnitudeFit((), (), 1.0, 0.0)
