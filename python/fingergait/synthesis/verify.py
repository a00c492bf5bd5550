"""Checks of a finished controller on the model: mu of the coupled plant, margins, and many nonlinear bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .analysis import MuCurve, Problem, below_nyquist, mu_curve, refined, response
from .blocks import parse_blocks, real_scalars
from .discretise import DiscreteController
from .errors import SynthesisError
from .loop import SampledLoop, delay_margin, gain_margins, join
from .mu_upper import upper_bound
from .plant import GeneralizedPlant
from .rigid_body import Bodies, Outcome, Runtime, simulate_step
from .spec import SynthesisSpec
from .statespace import Array, StateSpace

PAPER_STEP = np.array([0.004, 0.004, 0.010, 0.0, 0.0, 0.5])  # m, rad: the move of the paper's step experiment


@dataclass(frozen=True)
class Margins:
    """Of the coupled nominal loop with every axis changed at once: s, and factors on K's gain."""

    delay: float
    gain_low: float
    gain_high: float


def margins(loop: SampledLoop) -> Margins:
    low, high = gain_margins(loop)
    return Margins(delay_margin(loop), low, high)


def nominal_loop(spec: SynthesisSpec, axes: Sequence[StateSpace], chosen: list[int] | None = None) -> SampledLoop:
    """The sampled loop on the nominal body with its nominal damping, all axes coupled or some axes alone."""
    body = spec.body(chosen)
    damping = body.damping / spec.uncertainty.damping.centre
    K = join([axes[i] for i in chosen] if chosen is not None else list(axes))
    return SampledLoop(K, body.inertia, damping, spec.control.motor_lag, spec.control.delay, spec.control.prefilter)


def coupled_axes(spec: SynthesisSpec) -> list[list[int]]:
    """The axes in groups that the hand's inertia and damping couple; x ry, y rx, z and rz for the shipped hand."""
    if spec.plant == "free" or spec.hand is None:
        return [[i] for i in range(6)]
    linked = np.abs(np.array(spec.hand.inertia)) + np.abs(np.array(spec.hand.damping)) > 0.0
    linked |= np.eye(6, dtype=bool)
    reach = np.linalg.matrix_power(linked.astype(float), 6) > 0.0
    return [list(np.flatnonzero(reach[i])) for i in range(6) if not reach[i, :i].any()]


def problems(spec: SynthesisSpec, axes: Sequence[StateSpace]) -> list[Problem]:
    """The coupled six-axis problem with its controllers, as parts that share no coupling; see `analysis.mu_curve`."""
    return [
        Problem(
            GeneralizedPlant(spec.body(group), [spec.axis_weights(i) for i in group], spec.actuation()),
            join([axes[i] for i in group]),
        )
        for group in coupled_axes(spec)
    ]


def full_mu(spec: SynthesisSpec, stages: dict[str, tuple[list[StateSpace], float]]) -> dict[str, MuCurve]:
    """mu of the coupled six-axis problem at each stage {name: (six controllers, dead time in s)}.

    D-K works axis by axis and takes the parameters for complex numbers. This is where the coupling is counted, and that
    masses, inertias and dampings are real. The lower bound is found at the last stage only.

    Raises
    ------
    SynthesisError
        If a stage has mu >= 1.
    """
    curves: dict[str, MuCurve] = {}
    last = list(stages)[-1]
    for stage, (axes, delay) in stages.items():
        curves[stage] = mu_curve(problems(spec, axes), spec.omega, delay, real=True, lower=stage == last)
        if curves[stage].peak >= 1.0:
            raise SynthesisError(
                f"the coupled six-axis problem has mu = {curves[stage].peak:.3f} {stage} at "
                f"{curves[stage].peak_omega:.3g} rad/s, though every axis alone is below one: the off-diagonal terms "
                f"of hand.damping and hand.inertia count; lower iteration.gamma or balance sizes between m and rad"
            )
    return curves


def complex_mu(spec: SynthesisSpec, axes: Sequence[StateSpace]) -> float:
    """Peak of mu of the coupled problem if the parameters could be any complex numbers, as D-K iteration takes them."""
    return mu_curve(problems(spec, axes), spec.omega, spec.control.delay, lower=False).peak


def stability_curve(spec: SynthesisSpec, axes: Sequence[StateSpace]) -> MuCurve | None:
    """mu of stability alone over the wider damping range `uncertainty.damping.stable`, with real scalars; None without.

    The body's parameters are real, so D-G scalings apply; the structure is as in the coupled problem.
    """
    damping = spec.uncertainty.damping
    if damping.stable is None:
        return None
    low, high = sorted(damping.stable)
    centre, size = 0.5 * (low + high), (high - low) / (high + low)

    def bound(omega: Array) -> Array:
        bounds = []
        for problem in problems(spec, axes):
            body = problem.plant.body
            wide = replace(body, damping_left=body.damping_left * (centre / damping.centre), damping_error=size)
            n = wide.n_delta
            M = response(replace(problem.plant, body=wide), problem.K, omega, spec.control.delay)[:, :n, :n]
            real = parse_blocks(real_scalars(wide.blocks()))
            bounds.append(upper_bound(M, real, tolerance=1e-4).value)
        return np.asarray(np.max(bounds, axis=0))

    omega, upper = refined(below_nyquist(spec.omega, spec.control.sample_time), bound, 12)
    return MuCurve(omega, upper, np.zeros_like(upper))


@dataclass(frozen=True)
class Campaign:
    """Random bodies inside the uncertainty set under the paper's step.

    Attributes
    ----------
    bodies, unstable : counts
    settling : worst 5 % settling time of any stepped channel, s
    overshoot : worst, as a fraction of the step
    final : worst pose error at the end, m and rad
    """

    bodies: int
    unstable: int
    settling: float
    overshoot: float
    final: tuple[float, float]


def runtime(spec: SynthesisSpec, controllers: Sequence[DiscreteController]) -> Runtime:
    """What the compiled controller does, for the rigid-body simulation."""
    c = spec.control
    i1, i2, i3 = spec.object.inertia
    return Runtime(
        controllers, spec.object.mass, (i1, i2, i3), c.sample_time, c.delay, c.motor_lag, c.prefilter,
        c.force_limit, c.torque_limit,
    )  # fmt: skip


def bodies(spec: SynthesisSpec, delta: Array) -> Bodies:
    """True bodies at deltas (N, 5): mass, three inertias, damping; one is the edge of the uncertainty set."""
    u = spec.uncertainty
    mass = spec.object.mass * (1.0 + u.mass * delta[:, 0])
    inertia = np.array(spec.object.inertia) * (1.0 + np.array(u.inertia) * delta[:, 1:4])
    factor = u.damping.centre * (1.0 + u.damping.size * delta[:, 4])
    if spec.plant == "free" or spec.hand is None:
        return Bodies(mass, inertia, np.zeros((len(delta), 6, 6)), np.zeros((6, 6)))
    return Bodies(mass, inertia, factor[:, None, None] * np.array(spec.hand.damping), np.array(spec.hand.inertia))


def sample_deltas(n: int, seed: int = 0) -> Array:
    """(n, 5) deltas: the 32 vertices of the box first, then uniform."""
    vertices = np.array(np.meshgrid(*[[-1.0, 1.0]] * 5)).reshape(5, -1).T
    rest = np.random.default_rng(seed).uniform(-1.0, 1.0, (max(n - len(vertices), 0), 5))
    return np.concatenate([vertices, rest])[:n]


def campaign(
    spec: SynthesisSpec, controllers: Sequence[DiscreteController], n: int = 2000, duration: float = 2.0
) -> Campaign:
    """The paper's step on `n` nonlinear bodies inside the box, with the wrench limits of the spec."""
    outcome = step(spec, controllers, sample_deltas(n), duration)
    stepped = np.flatnonzero(PAPER_STEP)
    settling = outcome.settling(PAPER_STEP)[:, stepped]
    final = np.abs(outcome.error[-1])
    return Campaign(
        n,
        int(outcome.unstable.sum()),
        float(settling.max()),
        float(outcome.overshoot(PAPER_STEP)[:, stepped].max()),
        (float(final[:, :3].max()), float(final[:, 3:].max())),
    )


def step(spec: SynthesisSpec, controllers: Sequence[DiscreteController], delta: Array, duration: float) -> Outcome:
    """The paper's step on the bodies at `delta` (N, 5)."""
    return simulate_step(bodies(spec, delta), runtime(spec, controllers), PAPER_STEP, duration)


@dataclass(frozen=True)
class Boundary:
    """Where the nonlinear loop breaks outside the box.

    Attributes
    ----------
    mass, damping : grids of the true value over the nominal one
    stable : (n_damping, n_mass); the inertias err as the mass does
    """

    mass: Array
    damping: Array
    stable: Array


def boundary(spec: SynthesisSpec, controllers: Sequence[DiscreteController], points: int = 13) -> Boundary:
    """The paper's step over a grid of true bodies well beyond the box.

    Mass and inertias together run from a tenth to eight times nominal, the damping from nothing to eight times.
    """
    u = spec.uncertainty
    mass = np.geomspace(0.1, 8.0, points)
    free = spec.plant == "free"
    damping = np.ones(1) if free else np.concatenate([[0.0], np.geomspace(0.03, 8.0, points - 1)])
    m, b = np.meshgrid(mass, damping)
    delta = np.zeros((m.size, 5))
    delta[:, 0] = (m.ravel() - 1.0) / u.mass
    delta[:, 1:4] = (m.ravel()[:, None] - 1.0) / np.array(u.inertia)
    if not free and u.damping.size > 0.0:
        delta[:, 4] = (b.ravel() / u.damping.centre - 1.0) / u.damping.size
    outcome = step(spec, controllers, delta, 1.5)
    calm = np.abs(outcome.error[-250:]).max(axis=(0, 2)) < np.abs(PAPER_STEP).max()
    return Boundary(mass, damping, (~outcome.unstable & calm).reshape(m.shape))
