"""mu of a closed loop on a frequency grid, with the exact dead time and the hold of a discrete controller."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .blocks import parse_blocks, real_scalars
from .loop import hold
from .mu_lower import lower_bound
from .mu_upper import upper_bound
from .plant import Actuation, GeneralizedPlant
from .statespace import Array, ComplexArray, StateSpace, close_loop


@dataclass(frozen=True)
class MuCurve:
    """Upper and lower bounds of mu against frequency."""

    omega: Array
    upper: Array
    lower: Array

    @property
    def peak(self) -> float:
        return float(self.upper.max())

    @property
    def peak_omega(self) -> float:
        """rad/s, where the upper bound peaks."""
        return float(self.omega[int(self.upper.argmax())])


def response(plant: GeneralizedPlant, K: StateSpace, omega: Array, delay: float) -> ComplexArray:
    """F_l(P, K) at omega (n_w,), (n_w, n_z, n_w), with the exact delay in s and the hold of a discrete K.

    With a discrete K this is the response at the frequency itself: the images of the sampling are left out. They are
    those of a plant that falls by two decades from the loop's bandwidth to the sample rate; the time-domain checks of
    `loop` and `rigid_body` include them.
    """
    P = replace(plant, actuation=Actuation(plant.actuation.lag)).statespace(dead_time=False)
    held = hold(omega, K.dt) if K.dt is not None else np.ones_like(omega)
    late = np.exp(-1j * omega * delay) * held
    return close_loop(P.at(omega), K.at(omega) * late[:, None, None])


@dataclass(frozen=True)
class Problem:
    """A generalised plant with the controller of its axes."""

    plant: GeneralizedPlant
    K: StateSpace


def mu_curve(
    problems: Sequence[Problem],
    omega: Array,
    delay: float,
    *,
    real: bool = False,
    lower: bool = True,
    refine: int = 12,
) -> MuCurve:
    """mu of one problem, or of several that share no coupling, on a grid that is refined around the peak.

    Several problems stand for the large one that has their plants side by side, one performance block around all, and
    the mass shared. Its upper bound is the largest of theirs: flipping the signs of one part's signals maps the large
    problem to itself, so by convexity the best scalings can be taken without terms between parts, and then the
    inequality falls apart. Its lower bound is at least theirs: the other parts' Delta can be zero.

    Parameters
    ----------
    delay : s, from the sample to the actuators; for a continuous K, the whole dead time
    real : whether the scalars of Delta are real (D-G scalings), or may be any complex numbers (D scalings; higher)
    lower : whether to find the lower bound as well
    refine : extra frequencies on each side of the peak
    """
    structures = [parse_blocks(problem.plant.blocks(real=real)) for problem in problems]

    def responses(w: Array) -> list[ComplexArray]:
        return [response(problem.plant, problem.K, w, delay) for problem in problems]

    def bound(w: Array) -> Array:
        pairs = zip(responses(w), structures, strict=True)
        return np.asarray(np.max([upper_bound(M, blocks, tolerance=1e-4).value for M, blocks in pairs], axis=0))

    grid, values = refined(below_nyquist(omega, problems[0].K.dt), bound, refine)
    if not lower:
        return MuCurve(grid, values, np.zeros_like(values))
    low = np.zeros_like(values)
    for M, blocks in zip(responses(grid), structures, strict=True):
        # A part whose upper bound is at most 1 % above what another part has proven can hardly raise it.
        higher = upper_bound(M, blocks, tolerance=1e-3).value > 1.01 * low
        if higher.any():
            low[higher] = np.maximum(low[higher], lower_bound(M[higher], blocks))
    return MuCurve(grid, values, np.minimum(low, values))


def below_nyquist(omega: Array, dt: float | None) -> Array:
    """The part of the grid below pi/dt, with its end; all of it for a continuous system."""
    if dt is None:
        return omega
    nyquist = 0.9999 * np.pi / dt
    return np.append(omega[omega < nyquist], nyquist)


def refined(omega: Array, bound: Callable[[Array], Array], points: int) -> tuple[Array, Array]:
    """The grid and its values with `points` extra frequencies on each side of the peak."""
    values = bound(omega)
    if points <= 0:
        return omega, values
    i = int(values.argmax())
    low, high = omega[max(i - 1, 0)], omega[min(i + 1, len(omega) - 1)]
    extra = np.geomspace(low, high, 2 * points + 3)[1:-1]
    omega, values = np.append(omega, extra), np.append(values, bound(extra))
    order = np.argsort(omega)
    return omega[order], values[order]


def parts(problems: Sequence[Problem], omega: Array, delay: float, *, real: bool = False) -> dict[str, Array]:
    """What each part of the structure contributes: mu (n_w,) with the other parts left out, the largest over problems.

    `real` as in `mu_curve`.

    Keys: "mass and inertia", "damping" if there is a damping block, "stability" (all of Delta, no performance) and
    "performance" (no Delta: the largest singular value).
    """
    found: dict[str, list[Array]] = {}
    for problem in problems:
        body = problem.plant.body
        k, q = body.n_delta, body.q
        M = response(problem.plant, problem.K, omega, delay)
        inertia, delta = body.inertia_blocks(), body.blocks()
        slices = {"mass and inertia": (slice(0, q), inertia)}
        if body.has_damping_block:
            slices |= {"damping": (slice(q, k), delta[len(inertia) :]), "stability": (slice(0, k), delta)}
        for name, (pick, blocks) in slices.items():
            structure = parse_blocks(real_scalars(blocks) if real else blocks)
            value = upper_bound(M[:, pick, pick], structure, tolerance=1e-3).value
            found.setdefault(name, []).append(value)
        found.setdefault("performance", []).append(np.linalg.norm(M[:, k:, k:], 2, axis=(1, 2)))
    return {name: np.max(values, axis=0) for name, values in found.items()}
