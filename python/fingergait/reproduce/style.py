"""The look of the page's figures, and how they get into it."""

import base64
import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, ParamSpec

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fingergait.run.report.thin import thin as report_thin

Array = NDArray[np.float64]
P = ParamSpec("P")

INK, GREY, GOOD, BAD = "#1c2733", "#8a96a3", "#1f7a4d", "#b3362b"
AXES = ("#2a6fb0", "#d9822b", "#2f8f6b")  # x, y, z
FINGERS = ("#2a6fb0", "#d9822b", "#2f8f6b", "#b8504a", "#7a63a8", "#8a6d5a")

_POINTS = 2400  # of a line in a figure
_RC: dict[Any, Any] = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.xmargin": 0.0,
    "grid.color": "#e4e8ec",
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.0,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.size": 0.0,
    "ytick.major.size": 0.0,
    "svg.hashsalt": "fingergait",
}


@contextmanager
def style() -> Iterator[None]:
    """The page's matplotlib settings."""
    with matplotlib.rc_context(_RC):
        yield


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """`draw` with the page's settings."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with style():
            return draw(*args, **kwargs)

    return drawn


def panels(rows: int, columns: int = 1, height: float = 1.9, share: bool = True) -> tuple[Figure, NDArray[np.object_]]:
    """A figure of the page's width and its axes (rows, columns)."""
    figure = Figure(figsize=(9.6, height * rows + 0.35), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=share, squeeze=False)
    return figure, axes


def thin(t: Array, values: Array) -> tuple[Array, Array]:
    """A line of a figure of the page, thinned to what its width can show."""
    return report_thin(t, values, _POINTS)


def shade(axes: Axes, t: Array, free: Array) -> None:
    """Shades the time in which a finger is free in that finger's colour."""
    edges = np.flatnonzero(np.diff(free) != 0.0) + 1
    bounds = [0, *edges.tolist(), len(free) - 1]
    for begin, end in zip(bounds[:-1], bounds[1:], strict=True):
        if free[begin] >= 0.0:
            colour = FINGERS[int(free[begin]) % len(FINGERS)]
            axes.axvspan(t[begin], t[end], color=colour, alpha=0.16, lw=0.0)


def svg(figure: Figure) -> str:
    """The figure as a data URI; an image of its own, so that the names inside it don't meet those of others."""
    buffer = io.BytesIO()
    with style():
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return f"data:image/svg+xml;base64,{base64.b64encode(buffer.getvalue()).decode()}"


def png(picture: bytes) -> str:
    """A PNG as a data URI."""
    return f"data:image/png;base64,{base64.b64encode(picture).decode()}"
