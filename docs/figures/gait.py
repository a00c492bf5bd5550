"""One gait frame by frame: what the fingers do, and the quality and forces meanwhile."""

import numpy as np
from _drawing import COLOURS, PHASES, Stage, save, tidy
from matplotlib.figure import Figure

import fingergait as fg

SHADES = {"unload": "#f2e3c6", "slide": "#d5e8d4", "press": "#dae8fc", "load": "#e1d5e7"}

log = fg.simulate(fg.Scenario.load("lift-and-rotate", {"duration": 9.0})).log
t, free, phase = log.t, log["free_finger"].astype(int), log["phase"].astype(int)
begins = np.flatnonzero((free[1:] >= 0) & (free[:-1] != free[1:])) + 1
gains = []
for first in begins[:-1]:
    last = first + np.argmax(free[first:] != free[first])
    gains.append((log["Q"][last] - log["Q"][first], first, last))
_, begin, end = max(gains)  # the gait that mends the most
finger = free[begin]


def middle(name: str) -> int:
    """The row in the middle of a phase of the gait."""
    rows = begin + np.flatnonzero(phase[begin:end] == PHASES.index(name))
    return int(rows[len(rows) // 2])


slide = begin + np.flatnonzero(phase[begin:end] == PHASES.index("slide"))
rows = [begin - 20, middle("unload"), int(slide[len(slide) // 4]), int(slide[-1]), middle("load"), end + 20]
titles = ["all hold", "unload", "slide", "slide, at its end", "load", "all hold"]

figure = Figure(figsize=(13.0, 6.4), layout="constrained")
grid = figure.add_gridspec(3, len(rows), height_ratios=[0.95, 0.75, 0.75])
stage = Stage(log)
for column, (row, title) in enumerate(zip(rows, titles, strict=True)):
    axes = figure.add_subplot(grid[0, column])
    outer = column in (0, len(rows) - 1)
    azimuth = 90.0 * finger + 35.0
    axes.imshow(stage.picture(row, azimuth + 180.0, -32.0, 0.30, None if outer else int(finger)))
    axes.set_title(f"{t[row]:.2f} s: {title}", fontsize=10)
    axes.axis("off")

shown = (t > t[begin] - 0.25) & (t < t[end] + 0.25)
quality, forces = figure.add_subplot(grid[1, :]), figure.add_subplot(grid[2, :])
quality.plot(t[shown], 1e3 * log["Q"][shown], color="black")
quality.plot(t[shown], 1e3 * log["threshold"][shown], "--", color="black", lw=0.8)
quality.text(t[shown][0], 1e3 * log["threshold"][begin], " threshold", va="bottom", fontsize=9)
quality.set_ylabel("quality Q [1e-3]")
for j, name in enumerate(log.fingers):
    width = 2.2 if j == finger else 1.0
    forces.plot(t[shown], log.block("measured_force")[shown, j], color=COLOURS[j], lw=width, label=name)
forces.set(ylabel="normal force [N]", xlabel="time [s]")
forces.legend(ncols=len(log.fingers), fontsize=9, loc="lower right")
for axes in (quality, forces):
    axes.margins(x=0.0)
    for name, shade in SHADES.items():
        part = begin + np.flatnonzero(phase[begin:end] == PHASES.index(name))
        if len(part):
            axes.axvspan(t[part[0]], t[part[-1] + 1], color=shade, lw=0.0)
            if axes is quality:
                centre = 0.5 * (t[part[0]] + t[part[-1]])
                axes.text(centre, 1.0, name, ha="center", va="bottom", fontsize=9, transform=axes.get_xaxis_transform())
    for row in rows:
        axes.axvline(t[row], color="grey", lw=0.7, ls=":")
tidy(figure)
save(figure)
