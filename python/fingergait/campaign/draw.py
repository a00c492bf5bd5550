"""One line of a campaign's `[vary]`: which scenario key, which of its elements, and from which distribution."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait._core import ConfigError
from fingergait.campaign.distributions import Distribution

_KEY = re.compile(r"(?P<key>[A-Za-z_][\w.]*)(\[(?P<first>\d+)(:(?P<end>\d+))?\])?")


@dataclass(frozen=True)
class Draw:
    """What is drawn for one key.

    `key`: dotted, without elements; `elements`: which items of a list are drawn, None for the whole value; `width`:
    numbers in [0, 1) that one sample needs.
    """

    name: str
    key: str
    elements: tuple[int, ...] | None
    distribution: Distribution

    @classmethod
    def parse(cls, name: str, distribution: Distribution) -> "Draw":
        """The draw of a key such as `truth.friction`, `truth.inertia_scale[0]` or `truth.first_grasp[0:2]`."""
        match = _KEY.fullmatch(name)
        if match is None:
            raise ConfigError(f"vary: expected a key such as truth.friction or truth.com_offset[0:3], found {name}")
        elements: tuple[int, ...] | None = None
        if match["first"] is not None:
            first = int(match["first"])
            end = first + 1 if match["end"] is None else int(match["end"])
            elements = tuple(range(first, end))
            if not elements:
                raise ConfigError(f"vary.{name}: expected [first:end] with first < end, found [{first}:{end}]")
        if distribution.ball is not None and (elements is None or len(elements) not in (2, 3)):
            raise ConfigError(f"vary.{name}: expected two or three elements for a ball, such as [0:3], found others")
        return cls(name, match["key"], elements, distribution)

    @property
    def width(self) -> int:
        """Numbers in [0, 1) that one sample needs."""
        return 1 if self.elements is None else len(self.elements)

    @property
    def columns(self) -> list[str]:
        """Names of the drawn values in the data set."""
        return [self.key] if self.elements is None else [f"{self.key}[{i}]" for i in self.elements]

    def values(self, u: NDArray[np.float64]) -> list[Any]:
        """The drawn values, one a column, at the point u (width,)."""
        if self.distribution.ball is not None:
            return list(self.distribution.point(u))
        return [self.distribution.value(float(x)) for x in u]

    def assign(self, values: list[Any], overrides: dict[str, Any], present: Any) -> None:
        """Writes the drawn values into `overrides[key]`, a whole list where elements are drawn.

        Parameters
        ----------
        values
            As `values` gave them.
        overrides
            Scenario keys and their new values.
        present
            The value that the scenario has without: its other elements stay.
        """
        if self.elements is None:
            overrides[self.key] = values[0]
            return
        items = list(overrides[self.key]) if self.key in overrides else _items(present, self.elements[-1] + 1)
        if self.elements[-1] >= len(items):
            raise ConfigError(f"vary.{self.name}: expected an element 0 to {len(items) - 1}, found {self.elements[-1]}")
        for element, value in zip(self.elements, values, strict=True):
            items[element] = value
        overrides[self.key] = items


def _items(present: Any, needed: int) -> list[Any]:
    """The list that a value stands for: one number is that number on each of three axes, no items are zeros."""
    if isinstance(present, int | float):
        return [present] * 3
    items = list(present) if isinstance(present, list | tuple) else []
    return items if items else [0.0] * needed
