"""Plots of one run: tracking errors, grasp quality with the gaits, normal forces."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fingergait.files import whole_file
from fingergait.run.log import Log
from fingergait.run.pose_error import pose_errors
from fingergait.run.report.thin import thin
from fingergait.scenario import Scenario

Array = NDArray[np.float64]

_FINGER_COLOURS = ("#4C72B0", "#DD8452", "#55A868", "#C44E52", "#8172B3", "#937860")


def write_plots(log: Log, scenario: Scenario, folder: Path) -> list[Path]:
    """Writes errors.png, quality.png and forces.png into `folder`; their paths."""
    paths = []
    for name, draw in FIGURES.items():
        path = folder / f"{name}.png"
        with whole_file(path) as temporary:
            draw(log, scenario).savefig(temporary, dpi=110)
        paths.append(path)
    return paths


def error_figure(log: Log, scenario: Scenario) -> Figure:
    """Position and orientation errors over time, the paper's tracking figure."""
    figure = _figure(f"{scenario.name}: tracking errors", 2)
    errors = pose_errors(log.pose("object"), log.pose("desired"))
    rows = [("position error [mm]", 1e3 * errors[:, :3], "xyz"), ("orientation error [rad]", errors[:, 3:], "xyz")]
    for axes, (label, values, names) in zip(figure.axes, rows, strict=True):
        _shade_pulses(axes, scenario)
        norm = np.linalg.norm(values, axis=1)
        axes.fill_between(*thin(log.t, norm), color="black", alpha=0.15, lw=0.0, label="norm")
        for index, name in enumerate(names):
            axes.plot(*thin(log.t, values[:, index]), lw=0.8, label=name.upper())
        axes.set_ylabel(label)
        axes.legend(loc="upper right", ncols=4, fontsize=8)
    return figure


def quality_figure(log: Log, scenario: Scenario) -> Figure:
    """Grasp quality with its threshold, and the rate that the gait LP predicts; gaits in their finger's colour."""
    figure = _figure(f"{scenario.name}: grasp quality, gaits shaded by finger", 2)
    quality, rate = figure.axes
    for axes in figure.axes:
        _shade_gaits(axes, log)
    quality.plot(*thin(log.t, log["Q"]), lw=0.9, color="black", label="Q")
    quality.plot(*thin(log.t, log["threshold"]), lw=0.9, ls="--", color="black", label="threshold")
    quality.set_ylabel("Q, eq. (1)")
    rate.plot(*thin(log.t, log["Q_dot"]), lw=0.8, color="black", label="predicted dQ/dt")
    rate.set_ylabel("dQ/dt of the LP [1/s]")
    for index, name in enumerate(log.fingers):
        quality.fill_between([], [], color=_colour(index), alpha=0.3, label=name)
    quality.legend(loc="upper right", ncols=6, fontsize=8)
    return figure


def _per_finger(values: Array, log: Log) -> Array:
    """Largest of each finger's joints, (T, n_fingers), of the values (T, n_q)."""
    pattern = [re.compile(rf"measured_q_{re.escape(finger)}_\d+") for finger in log.fingers]
    counts = [sum(bool(own.fullmatch(name)) for name in log.names) for own in pattern]
    return np.stack([part.max(axis=1) for part in np.split(values, np.cumsum(counts)[:-1], axis=1)], axis=1)


def force_figure(log: Log, scenario: Scenario) -> Figure:
    """Measured normal force of each fingertip, and the largest torque command of its joints."""
    figure = _figure(f"{scenario.name}: normal forces and torques", 2)
    forces, torques = figure.axes
    commands = _per_finger(np.abs(log.block("tau_des")), log)
    measured = log.block("measured_force")
    for index, name in enumerate(log.fingers):
        forces.plot(*thin(log.t, measured[:, index]), lw=0.7, color=_colour(index), label=name)
        torques.plot(*thin(log.t, commands[:, index]), lw=0.7, color=_colour(index), label=name)
    forces.set_ylabel("normal force [N]")
    torques.set_ylabel("largest joint torque [N m]")
    for axes in figure.axes:
        _shade_pulses(axes, scenario)
    forces.legend(loc="upper right", ncols=4, fontsize=8)
    return figure


def _figure(title: str, rows: int) -> Figure:
    figure = Figure(figsize=(10.0, 2.6 * rows + 0.6), layout="constrained")
    figure.suptitle(title, fontsize=11)
    axes = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    for ax in axes:
        ax.grid(alpha=0.3)
        ax.margins(x=0.0)
    axes[-1].set_xlabel("time [s]")
    return figure


def _shade_gaits(axes: Axes, log: Log) -> None:
    free = log["free_finger"]
    edges = np.flatnonzero(np.diff(free) != 0.0) + 1
    bounds = [0, *edges.tolist(), len(free) - 1]
    for begin, end in zip(bounds[:-1], bounds[1:], strict=True):
        if free[begin] >= 0.0:
            axes.axvspan(log.t[begin], log.t[end], color=_colour(int(free[begin])), alpha=0.3, lw=0.0)


def _shade_pulses(axes: Axes, scenario: Scenario) -> None:
    for pulse in scenario.disturbance:
        axes.axvspan(pulse.at, pulse.at + pulse.duration, color="grey", alpha=0.35, lw=0.0)


def _colour(finger: int) -> str:
    return _FINGER_COLOURS[finger % len(_FINGER_COLOURS)]


FIGURES: dict[str, Callable[[Log, Scenario], Figure]] = {
    "errors": error_figure,
    "quality": quality_figure,
    "forces": force_figure,
}
"""The plots of a run, by their names."""
