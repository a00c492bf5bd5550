"""Weighting functions as in the paper's Table I: DC gain, crossover, high-frequency gain, order, axis scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .errors import SpecError
from .statespace import StateSpace, first_order_chain, gain


@dataclass(frozen=True)
class Weight:
    """One SISO weight, `scale * [(h s + g w0) / (s + w0)]^n` with g = G_l^(1/n), h = G_h^(1/n).

    The corner `w0 = w_c sqrt((1 - h^2)/(g^2 - 1))` makes the unscaled weight cross one exactly at w_c:
    |W(j w_c)| = 1. The paper gives the five figures and refers to another paper for the formula, so the form is a
    choice; see "Deviation".

    Attributes
    ----------
    dc_gain : G_l, gain at zero frequency.
    high_gain : G_h, gain at infinite frequency.
    crossover : w_c, rad/s, where the unscaled gain is one; None for a constant weight (then G_l = G_h).
    order : n, the number of first-order sections.
    scale : the axis scale a, which multiplies the whole weight.

    Deviation
    ---------
    Other forms meet the same five figures (Butterworth, Zhou and Doyle's); they lead to the same conclusions.
    """

    dc_gain: float
    high_gain: float
    crossover: float | None = None
    order: int = 1
    scale: float = 1.0

    def __post_init__(self) -> None:
        for name in ("dc_gain", "high_gain", "scale"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise SpecError(f"weight: {name} must be positive, found {value}")
        if self.order < 1:
            raise SpecError(f"weight: order must be at least 1, found {self.order}")
        if self.crossover is None:
            if self.dc_gain != self.high_gain:
                raise SpecError(
                    f"weight: without a crossover dc_gain and high_gain must be equal, "
                    f"found {self.dc_gain} and {self.high_gain}"
                )
        elif self.crossover <= 0.0:
            raise SpecError(f"weight: crossover must be positive, found {self.crossover}")
        elif (self.dc_gain - 1.0) * (self.high_gain - 1.0) >= 0.0:
            raise SpecError(
                "weight: one of dc_gain and high_gain must be above 1 and the other below, so that the gain crosses 1 "
                f"at the crossover; found {self.dc_gain} and {self.high_gain}"
            )

    @property
    def corner(self) -> float | None:
        """w0 in rad/s, the (n-fold) pole; None for a constant weight."""
        if self.crossover is None:
            return None
        g, h = self.dc_gain ** (1.0 / self.order), self.high_gain ** (1.0 / self.order)
        return float(self.crossover * np.sqrt((1.0 - h * h) / (g * g - 1.0)))

    def statespace(self) -> StateSpace:
        """The weight as a stable, minimum-phase system of order n (0 for a constant)."""
        pole = self.corner
        if pole is None:
            return gain(self.scale * self.dc_gain)
        zero = pole * (self.dc_gain / self.high_gain) ** (1.0 / self.order)
        return first_order_chain([zero] * self.order, [pole] * self.order, self.scale * self.high_gain)
