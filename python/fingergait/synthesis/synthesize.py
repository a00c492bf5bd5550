"""The whole synthesis: a spec in, a controller with its certificate out."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from .analysis import parts
from .artefact import Artefact, Nominal
from .certificate import Certificate
from .design import STAGES, AxisDesign, Progress, design_axes, six
from .deviations import deviations
from .discretise import DiscreteController
from .errors import SynthesisError
from .pid import pid_controller
from .plant import GeneralizedPlant
from .spec import SynthesisSpec
from .verify import (
    boundary,
    campaign,
    complex_mu,
    full_mu,
    margins,
    nominal_loop,
    problems,
    stability_curve,
)

Note = Callable[[str], None]


@dataclass(frozen=True)
class Controller:
    """A synthesised controller with its certificate.

    Attributes
    ----------
    spec : what was asked for
    designs : one for each kind of axis
    axes : the six discrete controllers x y z rx ry rz
    certificate : what was proven and measured
    artefact : what the compiled controller reads
    seconds : wall time of the synthesis
    """

    spec: SynthesisSpec
    designs: Sequence[AxisDesign]
    axes: tuple[DiscreteController, ...]
    certificate: Certificate
    artefact: Artefact
    seconds: float

    def write(self, path: str | Path) -> None:
        """Writes the artefact."""
        self.artefact.write(Path(path))

    @property
    def order(self) -> int:
        """Largest order of an axis."""
        return max(K.system.order for K in self.axes)

    @property
    def iterations(self) -> int:
        """K steps in all."""
        return sum(len(d.iteration.history) for d in self.designs)


def synthesize(
    spec: SynthesisSpec | str | Path,
    *,
    progress: Progress | None = None,
    note: Note | None = None,
    bodies: int = 2000,
) -> Controller:
    """A controller for the spec, with mu < 1 on every axis and on the coupled problem, at every stage.

    Parameters
    ----------
    spec : a spec or the path of its TOML file
    progress : called with the axis and each D-K iteration
    note : called with a line at the start of each later stage
    bodies : nonlinear random bodies in the verification

    Raises
    ------
    SpecError
        If the spec is wrong.
    InfeasibleSpecError
        If it has no solution: says which floor stops it and what to change.
    SynthesisError
        If a stage loses the guarantee, or a library fails.
    """
    started = time.perf_counter()
    say = note if note is not None else lambda line: None
    spec = spec if isinstance(spec, SynthesisSpec) else SynthesisSpec.load(spec)
    departures = deviations(spec)
    designs = design_axes(spec, progress)
    by_axis = {i: d for d in designs for i in d.axes}
    axes = tuple(by_axis[i].controller for i in range(6))
    c = spec.control
    delays = (c.dead_time, c.dead_time, c.delay)
    say("mu of the coupled six-axis problem")
    full = full_mu(spec, {s: (six(designs, s), d) for s, d in zip(STAGES, delays, strict=True)})
    shipped = six(designs, STAGES[-1])
    stability = stability_curve(spec, shipped)
    if stability is not None and stability.peak >= 1.0:
        raise SynthesisError(
            f"stability over the damping range uncertainty.damping.stable = {spec.uncertainty.damping.stable} is not "
            f"certified: mu = {stability.peak:.3f} at {stability.peak_omega:.3g} rad/s"
        )
    say("margins")
    loop = nominal_loop(spec, shipped)
    if not loop.is_stable():
        raise SynthesisError("the nominal sampled loop is unstable")
    of_axis = {d.axes[0]: margins(nominal_loop(spec, shipped, [d.axes[0]])) for d in designs}
    say(f"{bodies} nonlinear bodies")
    inside = campaign(spec, axes, bodies)
    if inside.unstable:
        raise SynthesisError(f"{inside.unstable} of {bodies} nonlinear bodies inside the uncertainty set are unstable")
    say("beyond the uncertainty set")
    certificate = Certificate(
        full=full,
        complex_peak=complex_mu(spec, shipped),
        per_axis=tuple(by_axis[i].mu[STAGES[-1]].peak for i in range(6)),
        parts=parts(problems(spec, shipped), full[STAGES[-1]].omega, c.delay, real=True),
        stability=stability,
        margins=margins(loop),
        axis_margins=tuple(of_axis[by_axis[i].axes[0]] for i in range(6)),
        campaign=inside,
        boundary=boundary(spec, axes),
        deviations=departures,
    )
    artefact = Artefact(
        kind="mu-synthesis",
        description=spec.description,
        sample_time=c.sample_time,
        delay=c.dead_time,
        nominal=Nominal(spec.object.mass, (spec.object.inertia[0], spec.object.inertia[1], spec.object.inertia[2])),
        axes=axes,
        prefilter=c.prefilter,
        provenance=_provenance(spec, designs, certificate),
    )
    return Controller(spec, designs, axes, certificate, artefact, time.perf_counter() - started)


def _provenance(spec: SynthesisSpec, designs: Sequence[AxisDesign], certificate: Certificate) -> dict[str, Any]:
    """What people and reports read: certificate, spec, block structure, iterations, versions. No times, no paths."""
    return {
        "certificate": certificate.words(spec),
        "figures": certificate.figures(),
        "blocks": GeneralizedPlant(spec.body(), [spec.axis_weights(i) for i in range(6)]).blocks(),
        "iterations": {
            d.name: [{"gamma": s.gamma, "mu_peak": s.mu_peak, "order": s.order} for s in d.iteration.history]
            for d in designs
        },
        "spec": spec.model_dump(mode="json"),
        "versions": {name: _version(name) for name in ("numpy", "scipy", "slycot")},
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"


def hand_tuned(spec: SynthesisSpec, bandwidth: float = 40.0, derivative_filter: float = 0.01) -> Artefact:
    """The PID baseline as an artefact, for the same object, rate and prefilter as the spec."""
    c = spec.control
    K = pid_controller(bandwidth, derivative_filter, c.sample_time, c.windup_decay)
    i1, i2, i3 = spec.object.inertia
    return Artefact(
        kind="hand-tuned",
        description=f"PID baseline: bandwidth {bandwidth:g} rad/s, derivative filter {1e3 * derivative_filter:g} ms",
        sample_time=c.sample_time,
        delay=c.dead_time,
        nominal=Nominal(spec.object.mass, (i1, i2, i3)),
        axes=[K] * 6,
        prefilter=c.prefilter,
        provenance={"bandwidth": bandwidth, "derivative_filter": derivative_filter},
    )
