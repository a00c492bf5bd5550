"""Connects linear blocks by constant matrices."""

from __future__ import annotations

import numpy as np

from .statespace import Array, StateSpace


def interconnect(blocks: StateSpace, feedback: Array, entry: Array, readout: Array, direct: Array) -> StateSpace:
    """The system that results from a = feedback b + entry v, y = readout b + direct v around b = blocks a.

    Parameters
    ----------
    blocks : block-diagonal system with inputs a (m,) and outputs b (p,)
    feedback, entry, readout, direct : (m, p), (m, n_v), (n_y, p), (n_y, n_v)

    Raises
    ------
    numpy.linalg.LinAlgError
        If the algebraic loop I - feedback D is singular.
    """
    loop = np.linalg.inv(np.eye(blocks.n_inputs) - feedback @ blocks.D)
    Ca = loop @ feedback @ blocks.C  # a = Ca x + Da v
    Da = loop @ entry
    A = blocks.A + blocks.B @ Ca
    B = blocks.B @ Da
    C = readout @ (blocks.C + blocks.D @ Ca)
    return StateSpace(A, B, C, readout @ blocks.D @ Da + direct, blocks.dt)
