"""Upper bound of the structured singular value by D (and D, G) scalings, for many matrices at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .blocks import Block, shape
from .scale import normalised
from .statespace import Array, ComplexArray

_ZERO = 1e-14  # t below this, for a matrix of norm one, counts as zero


@dataclass(frozen=True)
class Scalings:
    """An upper bound with the scalings that prove it.

        M^H Dz M + j (G M - M^H G^H) <= value^2 Dw,   Dw > 0

    Attributes
    ----------
    value : (n_w,), the bound
    Dw, Dz : (n_w, n_in, n_in) and (n_w, n_out, n_out), Hermitian, with the structure that commutes with Delta
    G : (n_w, n_in, n_out), Hermitian on the real blocks and zero elsewhere
    """

    value: Array
    Dw: ComplexArray
    Dz: ComplexArray
    G: ComplexArray

    def block_gains(self, blocks: Sequence[Block]) -> Array:
        """d_i(omega) (n_w, n_blocks), relative to the last block's, of diagonal scalings: z_i -> d_i z_i."""
        d = np.stack([np.sqrt(self.Dw[:, b.rows.start, b.rows.start].real) for b in blocks], axis=1)
        return np.asarray(d / d[:, -1:])


def _basis(blocks: Sequence[Block], *, diagonal: bool, real: bool) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Basis matrices of the scalings: of Dw (k, n_in, n_in), Dz (k, n_out, n_out), G (k, n_in, n_out)."""
    n_out, n_in = shape(blocks)
    triples: list[tuple[ComplexArray, ComplexArray, ComplexArray]] = []

    def zeros() -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        return np.zeros((n_in, n_in), complex), np.zeros((n_out, n_out), complex), np.zeros((n_in, n_out), complex)

    def hermitian(size: int) -> list[ComplexArray]:
        units = []
        for i in range(size):
            for j in range(i, size):
                if diagonal and i != j:
                    continue
                for value in (1.0,) if i == j else (1.0, 1j):
                    unit = np.zeros((size, size), complex)
                    unit[i, j] = value
                    unit[j, i] = np.conj(value)
                    units.append(unit)
        return units

    for block in blocks:
        if block.kind == "full":
            Dw, Dz, G = zeros()
            Dw[block.rows, block.rows] = np.eye(block.r)
            Dz[block.cols, block.cols] = np.eye(block.c)
            triples.append((Dw, Dz, G))
            continue
        for unit in hermitian(block.r):
            Dw, Dz, G = zeros()
            Dw[block.rows, block.rows] = Dz[block.cols, block.cols] = unit
            triples.append((Dw, Dz, G))
        if real and block.kind == "real":
            for unit in hermitian(block.r):
                Dw, Dz, G = zeros()
                G[block.rows, block.cols] = unit
                triples.append((Dw, Dz, G))
    Dws, Dzs, Gs = zip(*triples, strict=True)
    return np.stack(Dws), np.stack(Dzs), np.stack(Gs)


def osborne(M: ComplexArray, blocks: Sequence[Block], sweeps: int = 30) -> Array:
    """Gains d (n_w, n_blocks) that balance the blocks' norms: a good first scaling, z_i -> d_i z_i."""
    n = len(blocks)
    N = np.empty((M.shape[0], n, n))
    for i, bi in enumerate(blocks):
        for j, bj in enumerate(blocks):
            N[:, i, j] = np.linalg.norm(M[:, bi.cols, bj.rows], axis=(1, 2))
    logd = np.zeros((M.shape[0], n))
    off = ~np.eye(n, dtype=bool)
    tiny = 1e-12 * (N.max(axis=(1, 2)) + 1e-300)
    for _ in range(sweeps):
        for i in range(n):
            scaled = N * np.exp(logd[:, :, None] - logd[:, None, :])
            row = np.sqrt((scaled[:, i, off[i]] ** 2).sum(axis=1)) + tiny
            column = np.sqrt((scaled[:, off[i], i] ** 2).sum(axis=1)) + tiny
            logd[:, i] += 0.5 * (np.log(column) - np.log(row))
    return np.asarray(np.exp(np.clip(logd, -25.0, 25.0)))


def _hermitian_part(X: ComplexArray) -> ComplexArray:
    return np.asarray(0.5 * (X + np.conj(np.swapaxes(X, -1, -2))))


def _largest(A: ComplexArray, D: ComplexArray) -> Array:
    """Largest eigenvalue of the pencil A - t D, per matrix."""
    L = np.linalg.cholesky(D)
    half = np.linalg.solve(L, A)
    whole = np.linalg.solve(L, np.conj(np.swapaxes(half, -1, -2)))
    return np.asarray(np.linalg.eigvalsh(_hermitian_part(np.asarray(whole, dtype=complex)))[:, -1])


def upper_bound(
    M: ComplexArray,
    blocks: Sequence[Block],
    *,
    diagonal: bool = False,
    real: bool = True,
    tolerance: float = 1e-6,
    iterations: int = 200,
) -> Scalings:
    """The smallest bound that D (and G) scalings prove, for each M (n_w, n_out, n_in).

    Solves min t such that M^H Dz M + j (G M - M^H G^H) <= t Dw by the method of centres: for a given t a few Newton
    steps towards the analytic centre of the feasible scalings, then a smaller t; the bound at any time is proven by
    the scalings at hand.

    Parameters
    ----------
    diagonal : restrict the scalings of repeated blocks to diagonal matrices (what a D-K iteration can fit).
    real : use the G scalings of real blocks; False treats real blocks as complex.
    tolerance : stop when t falls by less than this fraction between centres.
    """
    n_w = M.shape[0]
    _, n_in = shape(blocks)
    M, exponents = normalised(M)
    d = osborne(M, blocks)
    left = np.concatenate([np.repeat(d[:, i, None], b.c, axis=1) for i, b in enumerate(blocks)], axis=1)
    right = np.concatenate([np.repeat(d[:, i, None], b.r, axis=1) for i, b in enumerate(blocks)], axis=1)
    scale = np.linalg.norm(left[:, :, None] * M / right[:, None, :], axis=(1, 2))
    scale = np.where(scale > 0.0, scale, 1.0)
    N = left[:, :, None] * M / right[:, None, :] / scale[:, None, None]
    NH = np.conj(np.swapaxes(N, -1, -2))
    Ew, Ez, Eg = _basis(blocks, diagonal=diagonal, real=real)
    k = len(Ew)
    # per-frequency basis of the left-hand side, (n_w, k, n_in, n_in)
    GM = np.einsum("kij,wjl->wkil", Eg, N, optimize=True)
    Fk = np.einsum("wij,kjl,wlm->wkim", NH, Ez, N, optimize=True) + 1j * (GM - np.conj(np.swapaxes(GM, -1, -2)))
    cost = np.trace(Ew, axis1=1, axis2=2).real  # tr(Dw), keeps the homogeneous problem bounded
    x = np.zeros((n_w, k))
    x[:, :] = (np.abs(np.trace(Ew, axis1=1, axis2=2)) > 0.0).astype(float)

    def assemble(x: Array, basis: ComplexArray) -> ComplexArray:
        letters = "wk,wkij->wij" if basis.ndim == 4 else "wk,kij->wij"
        return np.asarray(np.einsum(letters, x, basis, optimize=True))

    best = _largest(assemble(x, Fk), assemble(x, Ew))
    t = best + 0.3 * np.abs(best) + 1e-9
    best_x = x.copy()
    active = np.arange(n_w)
    for _ in range(iterations):
        x[active] = _centre(x[active], t[active], Fk[active], Ew, cost)
        now = _largest(assemble(x[active], Fk[active]), assemble(x[active], Ew))
        gained = (best[active] - now) / np.maximum(np.abs(now), _ZERO)
        better = active[gained > 0.0]
        best[better] = now[gained > 0.0]
        best_x[better] = x[better]
        slack = t[active] - now
        t[active] = now + 0.25 * slack
        active = active[(slack > tolerance * np.maximum(now, _ZERO)) & (now > _ZERO)]
        if active.size == 0:
            break
    Dw = assemble(best_x, Ew)
    Dz = assemble(best_x, Ez)
    G = assemble(best_x, Eg)
    value = np.ldexp(np.sqrt(np.maximum(best, 0.0)) * scale, exponents)
    # back to the scaling of M itself: N = left M right^-1 / scale / 2^exponents
    scale = np.ldexp(scale, exponents)
    return Scalings(
        value,
        right[:, :, None] * Dw * right[:, None, :],
        left[:, :, None] * Dz * left[:, None, :],
        right[:, :, None] * G * left[:, None, :] * scale[:, None, None],
    )


def _centre(x: Array, t: Array, Fk: ComplexArray, Ew: ComplexArray, cost: Array, steps: int = 12) -> Array:
    """The minimiser of -logdet(t Dw - F) - logdet(Dw) + tr(Dw) for each matrix, by damped Newton steps."""
    x = x.copy()
    todo = np.arange(len(x))
    Sk = t[:, None, None, None] * Ew - Fk  # (n_w, k, n, n)
    for _ in range(steps):
        S = np.einsum("wk,wkij->wij", x[todo], Sk[todo], optimize=True)
        D = np.einsum("wk,kij->wij", x[todo], Ew, optimize=True)
        SiSk = np.linalg.solve(S[:, None], Sk[todo])
        DiEk = np.linalg.solve(D[:, None], np.broadcast_to(Ew, (todo.size, *Ew.shape)))
        gradient = cost - np.trace(SiSk, axis1=2, axis2=3).real - np.trace(DiEk, axis1=2, axis2=3).real
        hessian = _gram(np.asarray(SiSk)) + _gram(np.asarray(DiEk))
        ridge = 1e-13 * np.trace(hessian, axis1=1, axis2=2)
        step = -np.linalg.solve(hessian + ridge[:, None, None] * np.eye(x.shape[1]), gradient[..., None])[..., 0]
        decrement = np.sqrt(np.maximum(-np.einsum("wk,wk->w", gradient, step), 0.0))
        x[todo] += np.where(decrement > 0.25, 1.0 / (1.0 + decrement), 1.0)[:, None] * step
        todo = todo[decrement > 0.1]
        if todo.size == 0:
            break
    return x


def _gram(X: ComplexArray) -> Array:
    """tr(X_i X_j) for X (n_w, k, n, n) -> (n_w, k, k)."""
    flat = X.reshape(*X.shape[:2], -1)
    turned = np.swapaxes(X, 2, 3).reshape(*X.shape[:2], -1)
    return np.asarray((flat @ np.swapaxes(turned, 1, 2)).real)
