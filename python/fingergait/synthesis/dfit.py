"""The D fit: a stable, minimum-phase rational function with a given magnitude."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from .statespace import Array, StateSpace, first_order_chain


@dataclass(frozen=True)
class MagnitudeFit:
    """gain * prod (s + z_i)/(s + p_i) with real positive z_i, p_i in rad/s; `error` is the worst |log| misfit."""

    zeros: tuple[float, ...]
    poles: tuple[float, ...]
    gain: float
    error: float

    @property
    def order(self) -> int:
        return len(self.poles)

    def statespace(self) -> StateSpace:
        return first_order_chain(self.zeros, self.poles, self.gain)

    def inverse(self) -> StateSpace:
        return first_order_chain(self.poles, self.zeros, 1.0 / self.gain)

    def log_magnitude(self, omega: Array) -> Array:
        """log |d(j omega)|."""
        w2 = omega[:, None] ** 2
        numerator = 0.5 * np.log(w2 + np.array(self.zeros) ** 2).sum(axis=1)
        return np.asarray(np.log(self.gain) + numerator - 0.5 * np.log(w2 + np.array(self.poles) ** 2).sum(axis=1))


def fit_magnitude(
    omega: Array,
    magnitude: Array,
    *,
    weight: Array | None = None,
    max_order: int = 3,
    tolerance: float = 0.05,
    band: tuple[float, float] | None = None,
) -> MagnitudeFit:
    """The fit of lowest order whose weighted rms error of log|d| is below `tolerance`, else that of `max_order`.

    Real poles and zeros, so the fit is stable and minimum phase by construction. They are kept inside `band`: poles
    that are decades slower than the loop fit nothing and destroy the conditioning of the K step.

    Parameters
    ----------
    omega, magnitude : (n_w,), rad/s and |d| > 0
    weight : (n_w,) >= 0, how much each frequency matters; None: all alike
    band : (low, high) rad/s for the corners; None: the span of omega
    """
    target = np.log(magnitude)
    weights = np.ones_like(target) if weight is None else np.asarray(weight, dtype=float)
    weights = weights / np.sqrt(np.mean(weights**2))
    low, high = np.log(band if band is not None else (omega[0], omega[-1]))
    best, best_rms = _fit(omega, target, weights, 0, low, high)
    for order in range(1, max_order + 1):
        if best_rms < tolerance:
            break
        fit, rms = _fit(omega, target, weights, order, low, high)
        if rms < 0.9 * best_rms:
            best, best_rms = fit, rms
    return best


def _fit(
    omega: Array, target: Array, weights: Array, order: int, low: float, high: float
) -> tuple[MagnitudeFit, float]:
    w2 = omega[:, None] ** 2

    def shape(corners: Array) -> Array:
        z2, p2 = np.exp(2.0 * corners[:order]), np.exp(2.0 * corners[order:])
        return np.asarray(0.5 * (np.log(w2 + z2).sum(axis=1) - np.log(w2 + p2).sum(axis=1)))

    def offset(corners: Array) -> float:
        return float(np.average(target - shape(corners), weights=weights**2))

    def residual(corners: Array) -> Array:
        values = shape(corners)
        return np.asarray(weights * (values + np.average(target - values, weights=weights**2) - target))

    def jacobian(corners: Array) -> Array:
        squares = np.exp(2.0 * corners)
        slopes = squares / (w2 + squares)  # of log|s + c| with respect to log c, (n_w, 2 order)
        slopes[:, order:] *= -1.0
        mean = np.average(slopes, axis=0, weights=weights**2)
        return np.asarray(weights[:, None] * (slopes - mean))

    if order == 0:
        corners = np.zeros(0)
    else:
        # two starts: corners spread over the band with zeros first, and with poles first
        spread = np.linspace(low, high, 2 * order + 2)[1:-1]
        starts = [np.concatenate([spread[0::2], spread[1::2]]), np.concatenate([spread[1::2], spread[0::2]])]
        answers = [least_squares(residual, s, jacobian, bounds=(low, high), xtol=1e-9, ftol=1e-9) for s in starts]
        corners = min(answers, key=lambda a: float(a.cost)).x
    error = shape(corners) + offset(corners) - target
    fit = MagnitudeFit(
        tuple(np.exp(corners[:order]).tolist()),
        tuple(np.exp(corners[order:]).tolist()),
        float(np.exp(offset(corners))),
        float(np.abs(error).max()),
    )
    return fit, float(np.sqrt(np.mean((weights * error) ** 2)))
