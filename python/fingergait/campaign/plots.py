"""The plots of a campaign's page."""

import base64
import io
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
import pyarrow as pa
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from fingergait.campaign.sensitivity import DUMMY, Influence
from fingergait.campaign.statistics import PAPER_ORIENTATION, PAPER_POSITION, column, percentile, wilson

Array = NDArray[np.float64]

_HELD, _LOST, _PAPER, _BOX = "#3b6ea5", "#c0392b", "#555555", "#2e8b57"
_PALE = "#b8c4d0"
_RASTER = 2000  # points above which a scatter is drawn as pixels
_BINS = 8


@dataclass(frozen=True)
class Nominal:
    """What a controller was designed for: mass, kg, and moments (3,), kg m^2.

    `certified`: the errors of mass and moments that its certificate covers, as fractions; None without one.
    """

    mass: float
    inertia: tuple[float, ...]
    certified: tuple[float, tuple[float, ...]] | None


def image(figure: Figure) -> str:
    """The figure as an SVG in a data URL; the same figure gives the same text."""
    buffer = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "fingergait", "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode()


def error_figure(rows: pa.Table, limits: tuple[float | None, float | None]) -> Figure:
    """Distributions of the runs' largest errors, with the paper's figures and the campaign's limits (m, rad)."""
    figure = Figure(figsize=(10.0, 3.2), layout="constrained")
    held = _status(rows) == "held"
    quantities = (
        ("largest position error of a run [mm]", "max_position_error_m", 1e3, PAPER_POSITION, limits[0]),
        ("largest orientation error of a run [mrad]", "max_orientation_error_rad", 1e3, PAPER_ORIENTATION, limits[1]),
    )
    for axes, (label, name, scale, paper, limit) in zip(figure.subplots(1, 2), quantities, strict=True):
        values = scale * column(rows, name)[held]
        values = values[np.isfinite(values)]
        if values.size:
            low, high = min(values.min(), 0.5 * scale * paper), max(values.max(), 1.3 * scale * paper)
            axes.hist(values, bins=list(np.geomspace(max(low, 1e-3), high, 40)), color=_HELD, alpha=0.85)
        axes.set_xscale("log")
        axes.axvline(scale * paper, color=_PAPER, ls="--", lw=1.2, label=f"paper's worst, {scale * paper:g}")
        p99 = percentile(values, 99)
        if p99 is not None:
            axes.axvline(p99, color=_LOST, lw=1.2, label=f"99th percentile, {p99:.2f}")
        if limit is not None and limit != paper:
            axes.axvline(scale * limit, color=_BOX, lw=1.2, ls=":", label=f"limit, {scale * limit:g}")
        axes.set_xlabel(label)
        axes.set_ylabel("runs")
        _plain_log_ticks(axes)
        axes.legend(fontsize=8, framealpha=0.9, edgecolor="none")
    return figure


def box_figure(rows: pa.Table, nominal: Nominal) -> Figure | None:
    """Outcomes over the true mass and moments of inertia, relative to what the controller was designed for.

    None where neither varies.
    """
    status = _status(rows)
    held, lost = status == "held", status == "dropped"
    m = 100.0 * (column(rows, "true_mass_kg") / nominal.mass - 1.0)
    moments = [
        100.0 * (column(rows, f"true_inertia_{axis}") / value - 1.0)
        for axis, value in zip("xyz", nominal.inertia, strict=True)
    ]
    ran = held | lost
    if not ran.any() or max(np.ptp(m[ran]), *(np.ptp(inertia[ran]) for inertia in moments)) == 0.0:
        return None
    figure = Figure(figsize=(11.0, 3.7), layout="constrained")
    errors = 1e3 * column(rows, "max_position_error_m")
    grid = figure.subplots(1, 3, sharey=True)
    for index, (axes, inertia) in enumerate(zip(grid, moments, strict=True)):
        points = axes.scatter(
            m[held], inertia[held], c=errors[held], s=14, cmap="viridis", lw=0.0, rasterized=held.sum() > _RASTER
        )
        if lost.any():
            axes.scatter(m[lost], inertia[lost], marker="x", s=32, color=_LOST, lw=1.5, label="dropped", zorder=3)
        if nominal.certified is not None:
            wide, tall = 100.0 * nominal.certified[0], 100.0 * nominal.certified[1][index]
            box = Rectangle((-wide, -tall), 2 * wide, 2 * tall, fill=False, ec=_BOX, lw=1.8, label="certified")
            axes.add_patch(box)
        axes.autoscale_view()
        axes.margins(0.08)
        axes.set_xlabel("true mass against design [%]")
        axes.set_title(f"inertia {'xyz'[index]}", fontsize=10)
    grid[0].set_ylabel("true moment against design [%]")
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2, fontsize=8, frameon=False)
    if held.any():
        figure.colorbar(points, ax=list(grid), label="largest position error [mm]")
    return figure


def influence_figure(influences: list[Influence], most: int = 12) -> Figure | None:
    """The strongest influences on each figure, with the dummy's level as a line."""
    if not influences:
        return None
    rows = max(min(most, len(item.names) - 1) for item in influences)
    figure = Figure(figsize=(10.0, 0.9 + 0.24 * rows), layout="constrained")
    for axes, item in zip(figure.subplots(1, len(influences), squeeze=False)[0], influences, strict=True):
        pick = [i for i, name in enumerate(item.names) if name != DUMMY][:most]
        at = np.arange(len(pick))
        values, spread = np.array(item.values)[pick], np.array(item.spread)[pick]
        colours = [_HELD if clear else _PALE for clear in values - spread > item.noise]
        axes.barh(at, values, xerr=spread if spread.any() else None, color=colours, error_kw={"lw": 0.8})
        axes.axvline(item.noise, color=_PAPER, ls="--", lw=1.0, label="dummy")
        axes.set_yticks(at, [_short(item.names[i]) for i in pick], fontsize=8)
        axes.invert_yaxis()
        axes.set_xlim(left=0.0)
        axes.set_title(f"{item.output} (PAWN)", fontsize=10)
        axes.legend(fontsize=8, frameon=False, loc="lower right")
    return figure


def trend_figure(rows: pa.Table, influences: list[Influence], most: int = 8) -> Figure | None:
    """Position error and drop rate over the values that matter most."""
    ranked: list[str] = []
    for place in range(most):
        for item in reversed(influences):  # drops first
            names = [name for name in item.names if name != DUMMY]
            if place < len(names) and names[place] not in ranked:
                ranked.append(names[place])
    ranked = ranked[:most]
    if not ranked:
        return None
    columns = 4
    lines = -(-len(ranked) // columns)
    figure = Figure(figsize=(10.5, 2.4 * lines), layout="constrained")
    grid = figure.subplots(lines, columns, squeeze=False).ravel()
    status = _status(rows)
    held, lost = status == "held", status == "dropped"
    errors = 1e3 * column(rows, "max_position_error_m")
    for axes, name in zip(grid, ranked, strict=False):
        x = column(rows, f"x.{name}")
        axes.scatter(x[held], errors[held], s=6, color=_HELD, lw=0.0, alpha=0.7, rasterized=held.sum() > _RASTER)
        axes.set_yscale("log")
        _plain_log_ticks(axes, "y")
        axes.set_xlabel(_short(name), fontsize=8)
        axes.tick_params(labelsize=7)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.ticklabel_format(axis="x", scilimits=(-3, 4))
        axes.xaxis.offsetText.set_fontsize(7)
        if lost.any():
            _drop_rate(axes.twinx(), x[held | lost], lost[held | lost])
    for axes in grid[len(ranked) :]:
        axes.set_visible(False)
    figure.supylabel("largest position error [mm], dots", fontsize=9)
    return figure


def _drop_rate(axes: Axes, x: Array, lost: NDArray[np.bool_]) -> None:
    """Share of drops in each bin of x, in percent, with Wilson's interval."""
    edges = np.linspace(x.min(), x.max(), _BINS + 1)
    for left, right in zip(edges[:-1], edges[1:], strict=True):
        inside = (x >= left) & ((x < right) | (right == edges[-1]))
        if inside.any():
            low, high = wilson(int(lost[inside].sum()), int(inside.sum()))
            share, middle = lost[inside].mean(), 0.5 * (left + right)
            axes.plot([middle, middle], [100 * low, 100 * high], color=_LOST, lw=0.8)
            axes.plot([left, right], [100 * share] * 2, color=_LOST, lw=1.6)
    axes.set_ylim(0.0, 100.0)
    axes.tick_params(labelsize=7, colors=_LOST)
    axes.set_ylabel("dropped [%]", color=_LOST, fontsize=7)


def _status(rows: pa.Table) -> NDArray[Any]:
    return np.array(rows.column("status").to_pylist(), dtype=object)


def _short(name: str) -> str:
    """A scenario key without its table, where that is clear enough."""
    return name.removeprefix("truth.").removeprefix("sensors.")


def _plain_log_ticks(axes: Axes, which: str = "x") -> None:
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_locator(LogLocator(base=10.0, subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
