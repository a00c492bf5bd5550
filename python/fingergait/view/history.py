"""Rows of a run as the page reads them: the newest one, and thinned windows for the plots.

Whoever simulates appends; the page reads. A row is never changed once it is published, so neither waits for the other.
"""

import re
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fingergait.run.log import Log

Array = NDArray[np.float64]

_POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")


class Names:
    """Where the columns of a log are.

    Parameters
    ----------
    columns
        Names of the columns after `t`.
    fingers
        Names of the fingers.
    """

    def __init__(self, columns: list[str], fingers: list[str]) -> None:
        self.columns, self.fingers = columns, fingers
        self._at = {name: i for i, name in enumerate(columns)}
        self._groups: dict[str, list[int]] = {}
        for name, i in self._at.items():
            numbered = re.fullmatch(r"(.+)_(\d+)", name)
            if numbered is not None:
                self._groups.setdefault(numbered[1], []).append(i)
        for prefix in ("object", "desired", "measured"):
            self._groups[prefix] = [self._at[f"{prefix}_{name}"] for name in _POSE]
        for prefix in ("measured_force", "friction_force"):
            self._groups[prefix] = [self._at[f"{prefix}_{name}"] for name in fingers]
        for prefix in ("q", "measured_q", "measured_tau"):
            self._groups[prefix] = [i for name in fingers for i in self._groups.pop(f"{prefix}_{name}", [])]
        self._groups["measured_place"] = [
            self._at[f"measured_place_{name}_{axis}"] for name in fingers for axis in "xyz"
        ]

    def __contains__(self, name: str) -> bool:
        return name in self._at or name in self._groups

    def index(self, name: str) -> list[int]:
        """Columns of a single number or of a group such as `f`, `f_n`, `q`, `object`."""
        return self._groups[name] if name in self._groups else [self._at[name]]


@dataclass(frozen=True)
class Row:
    """One control step: time t, s, and the numbers of a log's row."""

    t: float
    values: NDArray[np.float32]
    names: Names

    def __getitem__(self, name: str) -> float:
        """One number."""
        return float(self.values[self.names.index(name)[0]])

    def group(self, name: str) -> Array:
        """The numbers of a group, in order; what a fault made NaN is zero."""
        return np.nan_to_num(self.values[self.names.index(name)].astype(np.float64), posinf=0.0, neginf=0.0)


class History(Protocol):
    """What the page shows."""

    names: Names

    def row(self) -> Row | None:
        """The row to show now."""

    def window(self, seconds: float, points: int) -> tuple[Array, NDArray[np.float32]]:
        """Times (T,) and rows (T, n) of the last `seconds` before `row`, thinned to about `points`."""


class Ring:
    """The newest rows of a run without end.

    Parameters
    ----------
    names
        The columns.
    capacity
        Rows that are kept; readers see the newest half, so that none is overwritten while it is read.
    """

    def __init__(self, names: Names, capacity: int) -> None:
        self.names = names
        self._capacity = capacity
        self._t = np.zeros(capacity)
        self._rows = np.zeros((capacity, len(names.columns)), dtype=np.float32)
        self._count = 0
        self._first = 0

    def append(self, t: float) -> NDArray[np.float32]:
        """The row of time t, to be filled in and then published."""
        at = self._count % self._capacity
        self._t[at] = t
        row: NDArray[np.float32] = self._rows[at]
        return row

    def publish(self) -> None:
        """Shows the row last appended to readers."""
        self._count += 1

    def clear(self) -> None:
        """Hides all rows from readers."""
        self._first = self._count

    def row(self) -> Row | None:
        """The newest row."""
        count = self._count
        if count == self._first:
            return None
        at = (count - 1) % self._capacity
        return Row(float(self._t[at]), self._rows[at].copy(), self.names)

    def window(self, seconds: float, points: int) -> tuple[Array, NDArray[np.float32]]:
        """As `History.window`."""
        count = self._count
        first = max(self._first, count - self._capacity // 2)
        return _window(self._t, self._rows, first, count, self._capacity, seconds, points)


class Recorded:
    """A log, whole or while it grows, with a place in it that is shown.

    Attributes
    ----------
    at
        The row that is shown; None: the newest.
    published
        Rows that are complete.
    """

    def __init__(self, log: Log) -> None:
        self.log = log
        self.names = Names(log.names, log.fingers)
        self.published = len(log)
        self.at: int | None = None

    def _shown(self) -> int:
        return self.published if self.at is None else min(self.at + 1, self.published)

    def row(self) -> Row | None:
        """The row at `at`, or the newest."""
        count = self._shown()
        if count == 0:
            return None
        t, rows = self.log.raw()
        return Row(float(t[count - 1]), rows[count - 1].copy(), self.names)

    def window(self, seconds: float, points: int) -> tuple[Array, NDArray[np.float32]]:
        """As `History.window`."""
        t, rows = self.log.raw()
        return _window(t, rows, 0, self._shown(), len(t), seconds, points)


def _window(
    t: Array, rows: NDArray[np.float32], first: int, count: int, capacity: int, seconds: float, points: int
) -> tuple[Array, NDArray[np.float32]]:
    if count <= first:
        return np.zeros(0), rows[:0]
    newest = (count - 1) % capacity
    period = max(1e-6, float(t[newest] - t[(count - 2) % capacity])) if count - first > 1 else 1.0
    span = min(count - first, int(seconds / period) + 1)
    stride = max(1, span // points)
    last = (count - 1) // stride * stride  # the same rows are picked from one window to the next
    picked = np.arange(last, max(first, count - span) - 1, -stride)[::-1] % capacity
    return t[picked], rows[picked]
