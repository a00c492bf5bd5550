"""From a spec to a discrete controller: D-K iteration for each kind of axis, back-off, reduction, discretisation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from .analysis import MuCurve, Problem, mu_curve
from .discretise import DiscreteController, discretise
from .dk import DKResult, Iteration, Scaling, dk_iteration, fit_scalings, scalar_structure, scaled_plant
from .errors import LibraryError, SynthesisError
from .feasibility import check_feasible, explain
from .hinf import h_infinity
from .mu_upper import upper_bound
from .pid import pid
from .plant import GeneralizedPlant
from .reduction import reduce
from .spec import AXES, SynthesisSpec
from .statespace import Array, StateSpace, close_loop

Progress = Callable[[str, Iteration], None]
_START_BANDWIDTHS = (40.0, 20.0, 80.0)  # rad/s, of the PID loops whose scalings start the iteration


@dataclass(frozen=True)
class AxisDesign:
    """The design of one kind of axis.

    Attributes
    ----------
    axes : which of x y z rx ry rz share it, by index
    plant : its generalised plant (one axis)
    iteration : result of the D-K iteration
    full : continuous K at the back-off level
    reduced : continuous K after reduction
    controller : the discrete K
    mu : bounds with `full`, `reduced` and the discrete K
    """

    axes: tuple[int, ...]
    plant: GeneralizedPlant
    iteration: DKResult
    full: StateSpace
    reduced: StateSpace
    controller: DiscreteController
    mu: dict[str, MuCurve] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return " ".join(AXES[i] for i in self.axes)


STAGES = ("full order", "reduced", "at the sample rate")


def design_axes(spec: SynthesisSpec, progress: Progress | None = None) -> list[AxisDesign]:
    """One design for each kind of axis, each with mu below one at every stage.

    Raises
    ------
    InfeasibleSpecError
        If a floor of the spec makes mu < 1 impossible, or the iteration ends above one.
    SynthesisError
        If the reduction or the sampling loses the property.
    """
    check_feasible(spec)
    designs = []
    for axes in axis_groups(spec):
        plant = GeneralizedPlant(spec.body([axes[0]]), [spec.axis_weights(axes[0])], spec.actuation())
        name = " ".join(AXES[i] for i in axes)
        designs.append(_design(spec, axes, name, plant, progress))
    return designs


def axis_groups(spec: SynthesisSpec) -> list[tuple[int, ...]]:
    """Axes with the same uncoupled plant and weights, which share one design."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for axis in range(6):
        body = spec.body([axis])
        figures = (body.inertia.item(), body.damping.item(), body.inertia_error.item(), body.damping_error)
        key = (*(round(v, 9) for v in figures), spec.axis_weights(axis), spec.iteration.gamma[axis])
        groups.setdefault(key, []).append(axis)
    return [tuple(axes) for axes in groups.values()]


def _design(
    spec: SynthesisSpec, axes: tuple[int, ...], name: str, plant: GeneralizedPlant, progress: Progress | None
) -> AxisDesign:
    P, omega, options = plant.statespace(), spec.omega, spec.iteration
    structure = scalar_structure(plant.blocks())
    band = (0.05, 2000.0)
    result: DKResult | None = None
    for bandwidth in _START_BANDWIDTHS:
        start = _first_scaling(P, plant, omega, bandwidth, options.fit_order, band)
        try:
            found = dk_iteration(
                P,
                1,
                1,
                plant.blocks(),
                omega,
                iterations=options.iterations,
                max_order=options.fit_order,
                initial=start,
                band=band,
                progress=None if progress is None else lambda step: progress(name, step),
            )
        except SynthesisError:
            continue
        if result is None or found.mu_peak < result.mu_peak:
            result = found
        if result.mu_peak < 1.0:
            break
    if result is None:
        raise SynthesisError(f"{name}: no D-K iteration could start; the first K step failed from every scaling")
    if result.mu_peak >= 1.0:
        raise explain(spec, name, plant, result)
    full = result.K
    gamma = options.gamma[axes[0]]
    if result.mu_peak < gamma:
        try:
            full, _ = h_infinity(scaled_plant(P, structure, result.scaling, 1, 1), 1, 1, gamma=gamma)
        except LibraryError:
            full = result.K  # the fitted scaling reaches mu but not this level: the best iterate stands
    reduced = reduce(full, spec.control.order)
    controller = discretise(reduced, spec.control.sample_time, windup_decay=spec.control.windup_decay)
    design = AxisDesign(axes, plant, result, full, reduced, controller)
    for stage, K, delay in zip(STAGES, (full, reduced, controller.system), _delays(spec), strict=True):
        design.mu[stage] = mu_curve([Problem(plant, K)], omega, delay)
        if design.mu[stage].peak >= 1.0:
            raise SynthesisError(
                f"{name}: mu is {design.mu[stage].peak:.3f} {stage} (the iteration reached {result.mu_peak:.3f}): "
                f"raise control.order (now {spec.control.order}) or lower iteration.gamma (now {gamma})"
            )
    return design


def _delays(spec: SynthesisSpec) -> tuple[float, float, float]:
    """Dead time to apply at each stage: a continuous K has the hold's half sample in it, a discrete K its own hold."""
    return spec.control.dead_time, spec.control.dead_time, spec.control.delay


def _first_scaling(
    P: StateSpace,
    plant: GeneralizedPlant,
    omega: Array,
    bandwidth: float,
    fit_order: int,
    band: tuple[float, float],
) -> Scaling:
    """Scalings of a PID loop: a far better start than D = 1 where the damping is uncertain."""
    structure = scalar_structure(plant.blocks())
    M = close_loop(P.at(omega), pid(bandwidth, 0.01).at(omega))
    bound = upper_bound(M, structure, diagonal=True, real=False, tolerance=1e-4)
    return fit_scalings(omega, M, structure, bound.block_gains(structure), bound.value, fit_order, band)


def six(designs: Sequence[AxisDesign], stage: str) -> list[StateSpace]:
    """K of each of the six axes at a stage, in order."""
    ordered: dict[int, StateSpace] = {}
    for design in designs:
        by_stage = dict(zip(STAGES, (design.full, design.reduced, design.controller.system), strict=True))
        ordered.update(dict.fromkeys(design.axes, by_stage[stage]))
    return [ordered[i] for i in range(6)]
