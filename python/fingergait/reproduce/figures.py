"""The figures of the page: the paper's own, drawn from our runs, and a few more."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fingergait.reproduce.case import Outcome
from fingergait.reproduce.gaits import SLIDE, measured_rate
from fingergait.reproduce.style import AXES, BAD, GOOD, GREY, INK, panels, shade, styled, thin
from fingergait.run.metrics import CHANNELS, SETTLED

Array = NDArray[np.float64]

_POSITION, _ORIENTATION = "position error [mm]", "orientation error [rad]"


@styled
def tracking(outcome: Outcome) -> Figure:
    """Position and orientation errors over time."""
    figure, axes = panels(2)
    for row, (label, scale, names) in enumerate(((_POSITION, 1e3, "xyz"), (_ORIENTATION, 1.0, ("rx", "ry", "rz")))):
        _errors(axes[row, 0], outcome, list(names), scale)
        axes[row, 0].set_ylabel(label)
    axes[0, 0].legend(loc="upper right", ncols=3)
    axes[1, 0].set_xlabel("time [s]")
    return figure


@styled
def steps(outcomes: Sequence[Outcome]) -> Figure:
    """Errors after a step, one column a run."""
    figure, axes = panels(2, len(outcomes), height=2.1)
    for column, outcome in enumerate(outcomes):
        t, step = outcome.trace["t"], outcome.case.scenario.reference.step
        settling = outcome.metrics["settling_time_s"]
        for row, (label, scale, offset) in enumerate(((_POSITION, 1e3, 0), (_ORIENTATION, 1.0, 3))):
            ax: Axes = axes[row, column]
            shown = (t >= -0.1) & (t <= 1.5)
            for index in range(3):
                channel = CHANNELS[offset + index]
                error = scale * outcome.trace[f"e_{channel}"]
                ax.plot(t[shown], error[shown], color=AXES[index], label="XYZ"[index])
                if step[offset + index] != 0.0 and settling[channel] is not None:
                    level = np.interp(settling[channel], t, error)
                    ax.plot(settling[channel], level, "o", ms=4, color=AXES[index])
                    ax.axhline(scale * SETTLED * step[offset + index], color=AXES[index], lw=0.6, ls=":")
            if column == 0:
                ax.set_ylabel(label)
        axes[0, column].set_title(outcome.case.key)
        axes[1, column].set_xlabel("time [s]")
    axes[0, -1].legend(loc="upper right", ncols=3)
    return figure


@styled
def quality(outcome: Outcome) -> Figure:
    """Grasp quality with threshold and gaits, and the contacts' heights on the object."""
    figure, axes = panels(2)
    trace = outcome.trace
    top, bottom = axes[:, 0]
    if trace["t"][-1] < 120.0:
        for ax in (top, bottom):
            shade(ax, trace["t"], trace["free_finger"])
    top.plot(*thin(trace["t"], 1e3 * trace["Q"]), color=INK, label="Q")
    top.plot(trace["t"], 1e3 * trace["threshold"], color=BAD, ls="--", label="threshold")
    top.set_ylabel("quality Q [10$^{-3}$]")
    top.legend(loc="upper right", ncols=2)
    bottom.plot(*thin(trace["t"], 1e3 * trace["height"]), color=INK, label="mean")
    bottom.plot(*thin(trace["t"], 1e3 * trace["height_spread"]), color=GREY, label="highest less lowest")
    bottom.set_ylabel("contact height [mm]")
    bottom.set_xlabel("time [s]")
    bottom.legend(loc="upper right", ncols=2)
    return figure


@styled
def relocations(outcome: Outcome) -> Figure:
    """Some relocations from near: the quality, and its rate as predicted and as measured."""
    figure, axes = panels(2)
    trace = outcome.trace
    t = trace["t"]
    shown = (t >= max(0.0, t[-1] - 12.0)) & (t <= t[-1] - 4.0)
    top, bottom = axes[:, 0]
    for ax in (top, bottom):
        shade(ax, t[shown], trace["free_finger"][shown])
    top.plot(t[shown], 1e3 * trace["Q"][shown], color=INK, label="Q")
    top.plot(t[shown], 1e3 * trace["threshold"][shown], color=BAD, ls="--", label="threshold")
    top.set_ylabel("quality Q [10$^{-3}$]")
    predicted = np.where(trace["phase"] == SLIDE, 1e3 * trace["Q_dot"], np.nan)
    measured = 1e3 * measured_rate(t, trace["Q"])
    bottom.axhline(0.0, color=GREY, lw=0.8)
    bottom.plot(t[shown], measured[shown], color=INK, label="measured, all contacts")
    bottom.plot(t[shown], predicted[shown], color=AXES[1], lw=1.4, label="predicted, free finger")
    bottom.set_ylabel("dQ/dt [10$^{-3}$/s]")
    bottom.set_xlabel("time [s]")
    for ax in (top, bottom):
        ax.legend(loc="upper right", ncols=2)
    return figure


@styled
def pushes(outcome: Outcome) -> Figure:
    """Pulses and the errors they cause, force above torque."""
    figure, axes = panels(4, height=1.25)
    scenario = outcome.case.scenario
    t = outcome.trace["t"]
    rows = (
        ("force", "force [N]", 1e0, _POSITION, 1e3, "xyz"),
        ("torque", "torque [N m]", 1e0, _ORIENTATION, 1.0, ("rx", "ry", "rz")),
    )
    for index, (kind, label, unit, error_label, scale, names) in enumerate(rows):
        load = np.zeros((len(t), 3))
        for pulse in scenario.disturbance:
            load[(t >= pulse.at) & (t < pulse.at + pulse.duration)] += np.array(getattr(pulse, kind))
        for axis in range(3):
            axes[2 * index, 0].plot(t, unit * load[:, axis], color=AXES[axis], label="XYZ"[axis])
        axes[2 * index, 0].set_ylabel(label)
        _errors(axes[2 * index + 1, 0], outcome, list(names), scale)
        axes[2 * index + 1, 0].set_ylabel(error_label.replace(" error", "\nerror"))
    axes[0, 0].legend(loc="upper right", ncols=3)
    axes[-1, 0].set_xlabel("time [s]")
    return figure


@styled
def friction(outcome: Outcome) -> Figure:
    """The assumed friction as it is learnt, and the orientation error."""
    figure, axes = panels(2)
    t, truth = outcome.trace["t"], outcome.case.scenario.truth.friction
    top, bottom = axes[:, 0]
    top.plot(t, outcome.trace["friction"], color=INK, label="assumed")
    top.axhline(truth, color=BAD, ls="--", label="true")
    top.set_ylim(0.35, 0.9)
    top.set_ylabel("friction")
    top.legend(loc="upper right", ncols=2)
    _errors(bottom, outcome, ["rx", "ry", "rz"], 1.0)
    bottom.set_ylabel(_ORIENTATION)
    bottom.set_xlabel("time [s]")
    return figure


@styled
def grid(outcomes: Sequence[Outcome]) -> Figure:
    """One row a group of seeds: rotation reached, and largest orientation error."""
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.case.key.split(", seed")[0], []).append(outcome)
    figure, axes = panels(1, 2, height=0.3 * len(groups) + 0.7, share=False)
    left, right = axes[0]
    for row, runs in enumerate(groups.values()):
        for run in runs:
            colour = GOOD if run.kept else BAD
            left.plot(np.rad2deg(run.turned), row, "o", ms=5, color=colour, alpha=0.7)
            error = run.value("max_orientation_error_rad")
            if error is not None:
                right.plot(error, row, "o", ms=5, color=colour, alpha=0.7)
    left.set_yticks(range(len(groups)), list(groups))
    right.set_yticks(range(len(groups)), [""] * len(groups))
    left.axvline(360.0, color=GREY, ls="--", lw=0.9)
    for ax, label in ((left, "turned [degrees]"), (right, "largest orientation error of kept runs [rad]")):
        ax.set_xlim(0.0, 1.06 * ax.get_xlim()[1])
        ax.set_ylim(len(groups) - 0.5, -0.5)
        ax.set_xlabel(label)
    left.set_xlim(right=max(420.0, left.get_xlim()[1]))
    return figure


def _errors(ax: Axes, outcome: Outcome, names: list[str], scale: float) -> None:
    for index, name in enumerate(names):
        ax.plot(
            *thin(outcome.trace["t"], scale * outcome.trace[f"e_{name}"]),
            color=AXES[index],
            lw=0.9,
            label=name[-1].upper(),
        )
