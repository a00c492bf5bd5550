"""The structured singular value mu of a family of matrices, bounded from above and below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .blocks import parse_blocks, shape
from .mu_lower import lower_bound
from .mu_upper import upper_bound
from .statespace import Array


def mu_bounds(M: ArrayLike, blocks: Sequence[tuple[int, int]]) -> tuple[Array, Array]:
    """Upper and lower bounds of mu, each (n_w,).

        1 / mu(M) = min { sigma_max(Delta) : det(I - M Delta) = 0, Delta in the structure }

    Parameters
    ----------
    M : (n_w, n_out, n_in) or (n_out, n_in), complex
    blocks : structure as in MATLAB's mussv: (r, c) full complex block of r rows and c columns, (r, 0) repeated complex
        scalar delta I_r, (-r, 0) repeated real scalar. The blocks' columns add up to n_out, their rows to n_in.

    Notes
    -----
    Upper: D scalings, and D, G for real blocks (Fan, Tits and Doyle 1991). Lower: power iteration, with the real
    scalars swept; both are proven by the scalings and perturbations that were found, never extrapolated. Both are
    homogeneous to the last digit under powers of two, over the whole range of floating-point numbers.
    """
    matrix = np.asarray(M, dtype=complex)
    if matrix.ndim == 2:
        matrix = matrix[None]
    parsed = parse_blocks(blocks)
    if matrix.ndim != 3 or matrix.shape[1:] != shape(parsed):
        raise ValueError(f"mu_bounds: for these blocks M must be (n_w, {shape(parsed)}), found {matrix.shape}")
    wrong = np.argwhere(~np.isfinite(matrix))
    if len(wrong):
        at = tuple(wrong[0].tolist())
        raise ValueError(f"mu_bounds: M[{', '.join(map(str, at))}]: expected a finite number, found {matrix[at]}")
    upper = upper_bound(matrix, parsed).value
    lower = np.minimum(lower_bound(matrix, parsed), upper)
    return upper, lower
