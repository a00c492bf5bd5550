"""Matrices of any size, brought to a size at which their squares can be computed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .statespace import ComplexArray

Exponents = NDArray[np.intc]


def normalised(M: ComplexArray) -> tuple[ComplexArray, Exponents]:
    """N and e (n_w,) with M = 2^e N for each M (n_w, rows, columns), and N's largest part in [1/2, 1), or N = 0.

    mu and its bounds are homogeneous, mu(c M) = |c| mu(M), and a power of two changes no digit: what is computed for N
    holds for M, whose norm may not even have a square among the floating-point numbers.
    """
    size = np.maximum(np.abs(M.real), np.abs(M.imag)).max(axis=(1, 2), initial=0.0)
    exponents = np.frexp(size)[1]
    down = -exponents[:, None, None]
    N = np.empty(M.shape, dtype=complex)
    N.real, N.imag = np.ldexp(M.real, down), np.ldexp(M.imag, down)
    return N, exponents
