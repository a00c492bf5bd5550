"""The figure of the limits: one strip a quantity, every trial a dot."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, ScalarFormatter

from fingergait.reproduce.limits import Bisection, Limit
from fingergait.reproduce.style import BAD, GOOD, panels, styled


@styled
def limit_figure(limits: list[Limit], bisections: dict[str, list[Bisection]]) -> Figure:
    """Strips in two columns: trials that held are green, others red; the band is where the limit lies."""
    rows = -(-len(limits) // 2)
    figure, axes = panels(rows, 2, height=0.85, share=False)
    for ax in axes.ravel()[len(limits) :]:
        ax.set_visible(False)
    for ax, limit in zip(axes.T.ravel(), limits, strict=False):
        runs = bisections[limit.key]
        for row, bisection in enumerate(runs):
            for trial in bisection.trials:
                ax.plot(trial.value, row, "o", ms=5.0, color=GOOD if trial.held else BAD, alpha=0.8, clip_on=False)
            if bisection.held is not None and bisection.lost is not None:
                ax.plot([bisection.held, bisection.lost], [row, row], color="#6b7683", lw=3.0, alpha=0.35)
        if limit.geometric:
            ax.set_xscale("log")
            ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            ax.xaxis.set_major_formatter(ScalarFormatter())
            ax.xaxis.set_minor_locator(NullLocator())
        ends = np.array([limit.easy, limit.hard])
        pad = (ends.max() / ends.min()) ** 0.04 if limit.geometric else 0.04 * float(np.ptp(ends))
        low, high = ends.min(), ends.max()
        ax.set_xlim((low / pad, high * pad) if limit.geometric else (low - pad, high + pad))
        ax.set_ylim(len(runs) - 0.4, -0.6)
        ax.set_yticks(range(len(runs)), [f"seed {b.seed}" for b in runs] if len(runs) > 1 else [""])
        ax.set_title(limit.title + (f" [{limit.unit}]" if limit.unit else ""))
        ax.grid(axis="y", visible=False)
    return figure
