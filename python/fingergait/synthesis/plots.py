"""The plots of the report, each as one inline SVG."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import matplotlib
import matplotlib.patches
import numpy as np
from cycler import cycler
from matplotlib.figure import Figure

from .analysis import Problem, below_nyquist, parts
from .certificate import Certificate
from .design import STAGES, AxisDesign
from .loop import SampledLoop, hold, simulate
from .spec import AXES, SynthesisSpec
from .statespace import Array, StateSpace
from .verify import Boundary, nominal_loop

_COLOURS = ("#0b6e99", "#d9730d", "#448361", "#9065b0", "#c14c8a", "#6b6b6b")
_STYLE: Any = {
    "svg.hashsalt": "fingergait",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.prop_cycle": cycler(color=_COLOURS),
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
}


def mu_plot(certificate: Certificate) -> str:
    """mu of the coupled problem: upper and lower bound, its parts, and the stability-only bound."""
    with matplotlib.rc_context(_STYLE):
        figure, axes = _figure(1)
        (ax,) = axes
        curve = certificate.full[STAGES[-1]]
        ax.semilogx(curve.omega, curve.upper, color="black", linewidth=2, label="upper bound, shipped controller")
        ax.semilogx(curve.omega, curve.lower, color="black", linestyle=":", linewidth=1.6, label="lower bound")
        for stage in STAGES[:-1]:
            c = certificate.full[stage]
            ax.semilogx(c.omega, c.upper, color="#aaaaaa", linestyle="--" if stage == STAGES[0] else "-.", label=stage)
        for name, values in certificate.parts.items():
            ax.semilogx(curve.omega, values, label=f"{name} alone")
        if certificate.stability is not None:
            ax.semilogx(certificate.stability.omega, certificate.stability.upper, label="stability, wide damping")
        ax.axhline(1.0, color="#c0392b", linewidth=0.8)
        ax.set(xlabel="frequency, rad/s", ylabel="mu", ylim=(0, 1.15), title="Coupled six-axis problem")
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return _svg(figure)


def axis_mu_plot(designs: Sequence[AxisDesign]) -> str:
    """mu of each kind of axis alone: bounds and parts."""
    with matplotlib.rc_context(_STYLE):
        figure, axes = _figure(len(designs), height=2.6)
        for ax, design in zip(axes, designs, strict=True):
            curve = design.mu[STAGES[-1]]
            ax.semilogx(curve.omega, curve.upper, color="black", linewidth=1.8, label="upper")
            ax.semilogx(curve.omega, curve.lower, color="black", linestyle=":", label="lower")
            K = design.controller.system
            delay = max(design.plant.actuation.dead_time - 0.5 * (K.dt or 0.0), 0.0)
            for name, values in parts([Problem(design.plant, K)], curve.omega, delay).items():
                ax.semilogx(curve.omega, values, linewidth=1.0, label=name)
            ax.axhline(1.0, color="#c0392b", linewidth=0.8)
            ax.set(title=design.name, ylim=(0, 1.1), xlabel="rad/s")
        axes[0].set_ylabel("mu")
        axes[-1].legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return _svg(figure)


def weights_plot(designs: Sequence[AxisDesign], omega: Array) -> str:
    """Gains of the weights with the sizes of their signals, for each kind of axis."""
    names = (
        ("perf", "W_perf / error"),
        ("effort", "W_u / effort"),
        ("disturbance", "W_dis size"),
        ("noise", "W_n size"),
    )
    with matplotlib.rc_context(_STYLE):
        figure, axes = _figure(4, height=2.6)
        for ax, (field, label) in zip(axes, names, strict=True):
            for design in designs:
                system = getattr(design.plant.weights[0], field).statespace()
                ax.loglog(omega, np.abs(system.at(omega)[:, 0, 0]), label=design.name)
            ax.set(title=label, xlabel="rad/s")
        axes[0].legend()
        return _svg(figure)


def sensitivity_plot(spec: SynthesisSpec, designs: Sequence[AxisDesign]) -> str:
    """|S|, |T| and |K S| of each kind of axis on its nominal uncoupled body, with hold, delay and lag."""
    with matplotlib.rc_context(_STYLE):
        figure, axes = _figure(3, height=2.8)
        for design in designs:
            K = design.controller.system
            assert K.dt is not None
            omega = below_nyquist(np.geomspace(0.1, 3000.0, 300), K.dt)
            loop = nominal_loop(spec, _spread(design), [design.axes[0]])
            s = 1j * omega
            body = 1.0 / (loop.inertia[0, 0] * s**2 + loop.damping[0, 0] * s)
            held = hold(omega, K.dt) * np.exp(-s * loop.delay)
            G = body * held / (loop.lag * s + 1.0)
            Kw = K.at(omega)[:, 0, 0]
            S = 1.0 / (1.0 + G * Kw)
            for ax, values in zip(axes, (S, 1.0 - S, Kw * S), strict=True):
                ax.loglog(omega, np.abs(values), label=design.name)
        for ax, name in zip(axes, ("|S|", "|T|", "|K S|, 1/s²"), strict=True):
            ax.set(title=name, xlabel="rad/s")
        axes[0].set_ylim(1e-4, 5)
        axes[1].set_ylim(1e-4, 5)
        axes[0].legend()
        return _svg(figure)


def poles_plot(spec: SynthesisSpec, designs: Sequence[AxisDesign]) -> str:
    """Poles of each K and of its nominal closed loop, mapped from the unit disc to the left half plane."""
    with matplotlib.rc_context(_STYLE):
        figure, axes = _figure(len(designs), height=2.6)
        for ax, design in zip(axes, designs, strict=True):
            loop = replace(nominal_loop(spec, _spread(design), [design.axes[0]]), prefilter=None)
            for system, marker, label in ((loop.system(), "x", "closed loop"), (design.controller.system, "o", "K")):
                z = system.poles
                s = np.log(z[np.abs(z) > 1e-4]) / loop.dt
                ax.plot(s.real, s.imag, marker, markersize=5, fillstyle="none", label=label)
            ax.set_xscale("symlog", linthresh=1.0)
            ax.set_yscale("symlog", linthresh=10.0)
            ax.set(title=design.name, xlabel="real, 1/s")
        axes[0].set_ylabel("imaginary, rad/s")
        axes[0].legend(fontsize=7)
        return _svg(figure)


def corner_plot(spec: SynthesisSpec, designs: Sequence[AxisDesign], baseline: StateSpace) -> str:
    """Unit steps (above) and 0.2 s pushes (below) at the corners of the uncertainty set, and of the PID baseline."""
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(10.5, 4.6), layout="constrained")
        grid = figure.subplots(2, len(designs), sharex=True, squeeze=False)
        for column, design in enumerate(designs):
            for K, colour, label in ((baseline, "#d9730d", "PID"), (design.controller.system, "#0b6e99", "mu")):
                for i, loop in enumerate(corners(spec, design, K)):
                    system = loop.system()
                    if not system.is_stable():
                        continue
                    t, step, push = _responses(system, loop.dt)
                    style = {"color": colour, "linewidth": 1.6 if i == 0 else 0.6, "alpha": 1.0 if i == 0 else 0.7}
                    named = {"label": label} if i == 0 else {}
                    grid[0, column].plot(t, step, **style, **named)
                    grid[1, column].plot(t, push, **style)
            grid[0, column].set_title(design.name)
            grid[0, column].set_ylim(-0.1, 1.6)
            grid[1, column].set_xlabel("s")
        grid[0, 0].set_ylabel("step")
        grid[1, 0].set_ylabel("push, m or rad per m/s² or rad/s²")
        grid[0, 0].legend()
        return _svg(figure)


def boundary_plot(spec: SynthesisSpec, found: Boundary) -> str:
    """Where nonlinear bodies are stable, over mass (and inertia) and damping, with the certified box."""
    with matplotlib.rc_context(_STYLE):
        figure, (ax,) = _figure(1, height=3.2, width=5.2)
        stable = found.stable.astype(bool)
        x, y = np.meshgrid(np.arange(len(found.mass)), np.arange(len(found.damping)))
        ax.scatter(x[stable], y[stable], s=28, color="#448361", label="stable")
        ax.scatter(x[~stable], y[~stable], s=28, color="#c0392b", marker="x", label="breaks")
        u = spec.uncertainty
        if len(found.damping) > 1:
            low, high = u.damping.centre * (1 - u.damping.size), u.damping.centre * (1 + u.damping.size)
            rows = np.interp([low, high], found.damping, np.arange(len(found.damping)))
            columns = np.interp([1 - u.mass, 1 + u.mass], found.mass, np.arange(len(found.mass)))
            ax.add_patch(
                matplotlib.patches.Rectangle(
                    (columns[0], rows[0]), columns[1] - columns[0], rows[1] - rows[0], fill=False, label="certified"
                )
            )
        ax.set_xticks(range(len(found.mass)), [f"{m:.2g}" for m in found.mass], fontsize=7)
        ax.set_yticks(range(len(found.damping)), [f"{d:.2g}" for d in found.damping], fontsize=7)
        ax.set(xlabel="mass and inertia over nominal", ylabel="damping over nominal")
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return _svg(figure)


def corners(spec: SynthesisSpec, design: AxisDesign, K: StateSpace) -> list[SampledLoop]:
    """The loop of one axis on its nominal body, then at the corners: inertia low and high, damping low and high."""
    axis = design.axes[0]
    nominal = nominal_loop(spec, [K] * 6, [axis])
    u = spec.uncertainty.damping
    factors = (1.0,) if u.size == 0.0 else (u.centre * (1.0 - u.size), u.centre * (1.0 + u.size))
    p = design.plant.body.inertia_error[0]
    loops = [nominal]
    for error in (-p, p):
        loops += [replace(nominal, inertia=nominal.inertia + error, damping=nominal.damping * f) for f in factors]
    return loops


def _responses(system: StateSpace, dt: float) -> tuple[Array, Array, Array]:
    n = round(1.5 / dt)
    inputs = np.zeros((n, 3))
    inputs[:, 0] = 1.0
    step = simulate(system, inputs)[:, 0]
    inputs = np.zeros((n, 3))
    inputs[: round(0.2 / dt), 1] = 1.0
    return np.linspace(0.0, (n - 1) * dt, n), step, simulate(system, inputs)[:, 0]


def _spread(design: AxisDesign) -> list[StateSpace]:
    return [design.controller.system] * len(AXES)


def _figure(columns: int, *, height: float = 3.4, width: float = 10.5) -> tuple[Figure, list[Any]]:
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, list(np.atleast_1d(figure.subplots(1, columns)))


def _svg(figure: Figure) -> str:
    """The figure as an SVG element, the same bytes for the same figure."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return re.sub(r"(?s)^.*?(?=<svg)", "", text, count=1)
