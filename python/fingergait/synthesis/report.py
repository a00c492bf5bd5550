"""The one-page report: self-contained HTML with the certificate in words, tables and plots."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from jinja2 import Environment, StrictUndefined

from fingergait.files import write_text

from . import plots
from .analysis import Problem, mu_curve
from .certificate import breaks_at
from .loop import SampledLoop, delay_margin, noise_deviation, simulate
from .pid import pid_controller
from .spec import AXES
from .statespace import StateSpace
from .synthesize import Controller

BASELINE_BANDWIDTH, BASELINE_FILTER = 40.0, 0.01  # rad/s, s: the well-tuned PID that the report compares with
_FORCE, _TORQUE, _PUSH = 5.0, 0.03, 0.2  # N, N m, s: the paper's disturbances
_POSITION_NOISE, _ORIENTATION_NOISE = 2e-4, 2e-3  # m, rad, white at the control rate


@dataclass(frozen=True)
class Comparison:
    """One axis under one controller on its nominal body. Lengths in mm or mrad, wrenches in N or N m."""

    axis: str
    controller: str
    mu: float
    delay_margin: float
    settling: float
    overshoot: float
    push_peak: float
    push_left: float
    noise_wrench: float


def compare(controller: Controller) -> list[Comparison]:
    """The synthesised controller and the PID baseline, axis by axis."""
    spec = controller.spec
    dt = spec.control.sample_time
    baseline = pid_controller(BASELINE_BANDWIDTH, BASELINE_FILTER, dt, spec.control.windup_decay).system
    rows = []
    for design in controller.designs:
        for name, K in (("mu", design.controller.system), ("PID", baseline)):
            loop = plots.corners(spec, design, K)[0]
            curve = mu_curve([Problem(design.plant, K)], spec.omega, spec.control.delay, lower=False, refine=0)
            robust = all(corner.is_stable() for corner in plots.corners(spec, design, K))
            mu = curve.peak if robust else float("inf")
            rows.append(_row(design.name, design.axes[0], name, mu, loop, controller))
    return rows


def _row(label: str, axis: int, name: str, mu: float, loop: SampledLoop, controller: Controller) -> Comparison:
    spec = controller.spec
    inertia = spec.nominal_inertia()[axis, axis]
    if not loop.is_stable():
        return Comparison(label, name, mu, 0.0, *([float("inf")] * 5))
    system, dt = loop.system(), loop.dt
    time, step = _channel(system, dt, 0, 1.0, 3.0)
    outside = np.flatnonzero(np.abs(step - 1.0) > 0.05)
    settling = float(time[outside[-1]] + dt) if outside.size else 0.0
    _, push = _channel(system, dt, 1, (_FORCE if axis < 3 else _TORQUE) / inertia, _PUSH)
    after = round((_PUSH + 0.5) / dt)
    peak = float(np.abs(push).max())
    noise = _POSITION_NOISE if axis < 3 else _ORIENTATION_NOISE
    wrench = inertia * noise_deviation(system, np.diag([0.0, 0.0, noise**2]))[1]
    return Comparison(
        label,
        name,
        mu,
        1e3 * delay_margin(loop),
        settling,
        100.0 * float(max(step.max() - 1.0, 0.0)),
        1e3 * peak,
        100.0 * float(np.abs(push[after:]).max()) / peak,
        float(wrench),
    )


def _channel(system: StateSpace, dt: float, channel: int, value: float, held: float) -> tuple[np.ndarray, np.ndarray]:
    """Time and position of one axis (T,) when one input has a value for `held` seconds, over 3 s."""
    n = round(3.0 / dt)
    inputs = np.zeros((n, 3))
    inputs[: round(held / dt), channel] = value
    return dt * np.arange(n), simulate(system, inputs)[:, 0]


def render(controller: Controller) -> str:
    """The report as one HTML page without links to anything outside."""
    spec, certificate = controller.spec, controller.certificate
    baseline = pid_controller(BASELINE_BANDWIDTH, BASELINE_FILTER, spec.control.sample_time).system
    template = files(__package__).joinpath("report.html.j2").read_text(encoding="utf-8")
    environment = Environment(undefined=StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(template).render(
        controller=controller,
        spec=spec,
        certificate=certificate,
        words=certificate.words(spec),
        breaks=breaks_at(certificate.boundary),
        comparison=compare(controller),
        axes=AXES,
        svg={
            "mu": plots.mu_plot(certificate),
            "axis_mu": plots.axis_mu_plot(controller.designs),
            "weights": plots.weights_plot(controller.designs, np.geomspace(0.01, 3e4, 200)),
            "sensitivity": plots.sensitivity_plot(spec, controller.designs),
            "poles": plots.poles_plot(spec, controller.designs),
            "corners": plots.corner_plot(spec, controller.designs, baseline),
            "boundary": plots.boundary_plot(spec, certificate.boundary),
        },
    )


def write_report(controller: Controller, path: str | Path) -> None:
    """Writes the report."""
    write_text(Path(path), render(controller))
