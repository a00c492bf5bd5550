"""Lower bound of the structured singular value: each figure is proven by a perturbation that was found."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice, product

import numpy as np
from numpy.typing import NDArray

from .blocks import Block
from .scale import normalised
from .statespace import Array, ComplexArray


def lower_bound(M: ComplexArray, blocks: Sequence[Block], iterations: int = 60) -> Array:
    """A proven lower bound of mu for each M (n_w, n_out, n_in).

    Complex structures: Packard's power iteration from several starts; for the Delta it ends with, the spectral radius
    of M Delta is a lower bound whether or not the iteration has converged. With real blocks: the real scalars are
    swept, see `_mixed`.
    """
    N, exponents = normalised(M)
    if any(b.kind == "real" for b in blocks):
        bound = np.array([_mixed(m, blocks) for m in N])
    else:
        bound = _complex(N, blocks, iterations, n_starts=6)
    return np.asarray(np.ldexp(bound, exponents))


def _unit(v: ComplexArray) -> ComplexArray:
    norm = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.asarray(np.divide(v, norm, out=np.zeros_like(v), where=norm > 1e-300))


def _complex(M: ComplexArray, blocks: Sequence[Block], iterations: int, n_starts: int = 0) -> Array:
    MH = np.conj(np.swapaxes(M, -1, -2))
    # starts: singular vectors and an even one
    _, _, Vh = np.linalg.svd(M, full_matrices=False)
    rng = np.random.default_rng(0)
    starts = [np.conj(Vh[:, i]) for i in range(min(3, Vh.shape[1]))]
    for _ in range(n_starts):
        random = rng.normal(size=(2, M.shape[2]))
        starts.append(np.broadcast_to(_unit(random[0] + 1j * random[1]), starts[0].shape))
    best = np.zeros(M.shape[0])
    for start in starts:
        b, w = start, start
        for step in range(iterations):
            a = _unit(np.einsum("nij,nj->ni", M, b))  # (n_w, n_out)
            z = _left(a, w, blocks)
            w = _unit(np.einsum("nij,nj->ni", MH, z))  # (n_w, n_in)
            b = _right(a, w, blocks)
            if step % 20 == 19 or step == iterations - 1:
                best = np.maximum(best, _radius(M, _delta(a, w, blocks, M.shape)))
    return best


def _left(a: ComplexArray, w: ComplexArray, blocks: Sequence[Block]) -> ComplexArray:
    """z of the power iteration: aligned with a, block by block."""
    z = np.zeros_like(a)
    for block in blocks:
        ai, wi = a[:, block.cols], w[:, block.rows]
        if block.kind == "full":
            z[:, block.cols] = np.linalg.norm(wi, axis=1, keepdims=True) * _unit(ai)
        else:
            inner = np.sum(np.conj(ai) * wi, axis=1, keepdims=True)
            z[:, block.cols] = wi * np.exp(-1j * np.angle(inner))
    return z


def _right(a: ComplexArray, w: ComplexArray, blocks: Sequence[Block]) -> ComplexArray:
    """b of the power iteration: aligned with w, block by block."""
    b = np.zeros_like(w)
    for block in blocks:
        ai, wi = a[:, block.cols], w[:, block.rows]
        if block.kind == "full":
            b[:, block.rows] = np.linalg.norm(ai, axis=1, keepdims=True) * _unit(wi)
        else:
            inner = np.sum(np.conj(ai) * wi, axis=1, keepdims=True)
            b[:, block.rows] = ai * np.exp(1j * np.angle(inner))
    return b


def _delta(a: ComplexArray, w: ComplexArray, blocks: Sequence[Block], dims: tuple[int, ...]) -> ComplexArray:
    """The unit perturbation (n_w, n_in, n_out) that takes a to w, block by block."""
    Delta = np.zeros((dims[0], dims[2], dims[1]), complex)
    for block in blocks:
        ai, wi = a[:, block.cols], w[:, block.rows]
        if block.kind == "full":
            Delta[:, block.rows, block.cols] = _unit(wi)[:, :, None] * np.conj(_unit(ai))[:, None, :]
        else:
            phase = np.exp(1j * np.angle(np.sum(np.conj(ai) * wi, axis=1)))
            Delta[:, block.rows, block.cols] = phase[:, None, None] * np.eye(block.r)
    return Delta


def _radius(M: ComplexArray, Delta: ComplexArray) -> Array:
    return np.asarray(np.abs(np.linalg.eigvals(M @ Delta)).max(axis=-1))


def _mixed(M: ComplexArray, blocks: Sequence[Block]) -> float:
    """Lower bound for one M (n_out, n_in) with real scalar blocks.

    With the real scalars fixed at k v, |v_i| <= 1, the complex blocks see a matrix with a complex lower bound g(k).
    Blocks of norm k make the whole loop singular if k g(k) >= 1, so every such k proves mu >= 1/k. The directions v are
    points on the surface of the unit cube, the vertices first; k is found on a grid and then refined. If all blocks are
    real, 1/k is the largest real eigenvalue of M V.
    """
    real = [b for b in blocks if b.kind == "real"]
    rest = [b for b in blocks if b.kind != "real"]
    v = _directions(len(real))
    V = np.zeros((len(v), M.shape[1], M.shape[0]))
    for i, block in enumerate(real):
        V[:, block.rows, block.cols] = v[:, i, None, None] * np.eye(block.r)
    MV = M @ V
    eigenvalues = np.linalg.eigvals(MV)
    on_axis = np.abs(eigenvalues.imag) <= 1e-9 * np.abs(eigenvalues).max(initial=1e-300)
    best = float(np.where(on_axis, eigenvalues.real, 0.0).max(initial=0.0))
    peak = float(np.linalg.norm(M, 2))
    if not rest or peak <= best:
        return best
    rows = np.concatenate([np.arange(b.rows.start, b.rows.stop) for b in rest])
    cols = np.concatenate([np.arange(b.cols.start, b.cols.stop) for b in rest])
    inner = _compact(rest)

    def proven(k: Array, MV: ComplexArray) -> NDArray[np.bool_]:
        """Which of the pairs (k, direction) make the loop singular within norm k."""
        loop = np.eye(len(M)) - k[:, None, None] * MV
        closed = np.linalg.solve(loop, np.broadcast_to(M, (len(k), *M.shape)))[:, cols][:, :, rows]
        return np.asarray(np.multiply(k, _complex(np.asarray(closed, dtype=complex), inner, 20)) >= 1.0)

    # Just short of the k at which the real scalars alone make the loop singular, which would stop the solver.
    ceiling = min((1.0 - 1e-9) / best, 100.0 / peak) if best > 0.0 else 100.0 / peak
    ks = np.geomspace(1.0 / peak, ceiling, 10)
    works = proven(np.tile(ks, len(v)), np.repeat(MV, len(ks), axis=0)).reshape(len(v), len(ks))
    if not works.any():
        return best
    first = np.where(works.any(axis=1), works.argmax(axis=1), len(ks))
    chosen = np.flatnonzero(first == first.min())
    high = np.full(chosen.size, ks[first.min()])
    low = np.full(chosen.size, ks[max(first.min() - 1, 0)])
    for _ in range(14):
        middle = np.sqrt(low * high)
        ok = proven(middle, MV[chosen])
        high, low = np.where(ok, middle, high), np.where(ok, low, middle)
    return max(best, float(1.0 / high.min()))


def _directions(n: int) -> Array:
    """Points (n_v, n) on the surface of the unit cube; vertices only beyond three scalars, at most 1024 of them."""
    grid = {1: 2, 2: 9, 3: 5}.get(n, 2)
    points = np.array(list(islice(product(np.linspace(-1.0, 1.0, grid), repeat=n), 1024)))
    return np.asarray(points[np.abs(points).max(axis=1) >= 1.0])


def _compact(blocks: Sequence[Block]) -> list[Block]:
    """The same blocks, placed one after the other from zero."""
    placed: list[Block] = []
    i = j = 0
    for block in blocks:
        placed.append(Block(block.kind, slice(i, i + block.r), slice(j, j + block.c)))
        i, j = i + block.r, j + block.c
    return placed
