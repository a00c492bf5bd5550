"""Distributions that a campaign draws from: each maps numbers in [0, 1) to values, so any point set will do."""

import math
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from scipy.stats import truncnorm

from fingergait.fields import Positive, Table

Array = NDArray[np.float64]
Range = tuple[float, float]

_KINDS = ("uniform", "log_uniform", "normal", "integers", "choice", "ball")


class Distribution(Table):
    """One distribution: exactly one of these keys.

    uniform, log_uniform
        [low, high].
    normal
        [mean, standard deviation], cut off at `within` = [low, high].
    integers
        [first, last], both drawn.
    choice
        A list of values, each as likely.
    ball
        Radius of a disc or a ball round zero in which a list of two or three numbers is drawn uniformly.

    `levels` is how many equal steps of probability a grid takes, both ends included.
    """

    uniform: Range | None = None
    log_uniform: Range | None = None
    normal: tuple[float, Positive] | None = None
    within: Range | None = None
    integers: tuple[int, int] | None = None
    choice: Annotated[list[Any], Field(min_length=1)] | None = None
    ball: Positive | None = None
    levels: Annotated[int, Field(ge=2)] = 5

    @model_validator(mode="after")
    def _one(self) -> Self:
        given = [kind for kind in _KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            raise ValueError(f"expected exactly one of {', '.join(_KINDS)}, found {' and '.join(given) or 'none'}")
        if (self.normal is None) != (self.within is None):
            raise ValueError("expected `within` = [low, high] with `normal` and with nothing else")
        for kind in ("uniform", "log_uniform", "within", "integers"):
            limits = getattr(self, kind)
            if limits is not None and not (limits[0] < limits[1]):
                raise ValueError(f"expected {kind} = [low, high] with low < high, found {list(limits)}")
        if self.log_uniform is not None and self.log_uniform[0] <= 0.0:
            raise ValueError(f"expected log_uniform limits > 0, found {list(self.log_uniform)}")
        return self

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return self.choice is None or all(type(value) in (int, float) for value in self.choice)

    @property
    def count(self) -> int:
        """Values that a grid visits."""
        if self.choice is not None:
            return len(self.choice)
        return self.levels if self.integers is None else self.integers[1] - self.integers[0] + 1

    def value(self, u: float) -> Any:
        """The value at probability u in [0, 1]."""
        if self.uniform is not None:
            low, high = self.uniform
            return low + u * (high - low)
        if self.log_uniform is not None:
            low, high = self.log_uniform
            return math.exp(math.log(low) + u * (math.log(high) - math.log(low)))
        if self.normal is not None and self.within is not None:
            mean, deviation = self.normal
            a, b = ((limit - mean) / deviation for limit in self.within)
            return float(truncnorm.ppf(u, a, b, loc=mean, scale=deviation))
        if self.integers is not None:
            first, last = self.integers
            return first + min(int(u * (last - first + 1)), last - first)
        if self.choice is not None:
            return self.choice[min(int(u * len(self.choice)), len(self.choice) - 1)]
        raise AssertionError("a ball has several values")

    def point(self, u: Array) -> list[float]:
        """A point of the disc (u of 2 numbers) or the ball (3 numbers), drawn uniformly."""
        assert self.ball is not None
        angle = 2.0 * math.pi * u[1]
        if len(u) == 2:
            radius = self.ball * math.sqrt(u[0])
            return [radius * math.cos(angle), radius * math.sin(angle)]
        radius, height = self.ball * u[0] ** (1.0 / 3.0), 2.0 * u[2] - 1.0
        ring = radius * math.sqrt(max(0.0, 1.0 - height * height))
        return [float(x) for x in (ring * math.cos(angle), ring * math.sin(angle), radius * height)]
