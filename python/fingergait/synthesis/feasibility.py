"""Why a spec has no solution: floors that no controller can pass, and what to change."""

from __future__ import annotations

import numpy as np

from .dk import DKResult
from .errors import InfeasibleSpecError
from .plant import AxisWeights, GeneralizedPlant
from .spec import AXES, SynthesisSpec
from .statespace import Array


def tracking_floor(weights: AxisWeights, omega: Array) -> Array:
    """Lower bound of mu (n_w,) on one axis from S + T = 1 alone, whatever the controller and the plant.

    The tracking error is w_perf = W_perf (S s_r r + T W_n n). Since S + T = 1 its gain is at least

        |W_perf| s_r |W_n| / sqrt(s_r^2 + |W_n|^2),

    reached at S = |W_n|^2 / (s_r^2 + |W_n|^2).
    """
    perf = np.abs(weights.perf.statespace().at(omega)[:, 0, 0])
    noise = np.abs(weights.noise.statespace().at(omega)[:, 0, 0])
    return np.asarray(perf * weights.reference * noise / np.hypot(weights.reference, noise))


def roll_off_floor(weights: AxisWeights) -> float:
    """Lower bound of mu from S = 1 at high frequency, where any loop around a body with inertia has no gain left."""
    return weights.perf.scale * weights.perf.high_gain * weights.reference


def check_feasible(spec: SynthesisSpec) -> None:
    """Raises if the floor of some axis is one or more.

    Raises
    ------
    InfeasibleSpecError
        Names the floor, where it is, and what to change.
    """
    omega = np.concatenate([[0.0], np.geomspace(1e-4, 1e5, 400)])
    weights = [spec.axis_weights(axis) for axis in range(6)]
    tracking = [tracking_floor(w, omega) for w in weights]
    floors = [max(float(t.max()), roll_off_floor(w)) for t, w in zip(tracking, weights, strict=True)]
    blocked = [axis for axis in range(6) if floors[axis] >= 1.0]
    if not blocked:
        return
    worst = max(blocked, key=lambda axis: floors[axis])
    by_axis = ", ".join(f"{AXES[axis]} {floors[axis]:.4g}" for axis in blocked)
    if floors[worst] > tracking[worst].max():
        why = _roll_off_words(spec, worst)
    else:
        why = _tracking_words(spec, blocked, worst, float(omega[int(tracking[worst].argmax())]))
    raise InfeasibleSpecError(f"no controller has mu < 1 for this spec. Floors of mu by axis: {by_axis}. {why}")


def _roll_off_words(spec: SynthesisSpec, worst: int) -> str:
    weights = spec.axis_weights(worst)
    floor = roll_off_floor(weights)
    return (
        f"At high frequency the loop has no gain left, so S = 1 and mu >= W_perf(inf) s_r = "
        f"{weights.perf.scale * weights.perf.high_gain:.4g} * {weights.reference:.4g} = {floor:.4g} on {AXES[worst]}: "
        f"all of the reference stays as error. Change sizes.reference to below {weights.reference / floor:.2g}, or "
        f"lower W_perf.G_h."
    )


def _tracking_words(spec: SynthesisSpec, blocked: list[int], worst: int, omega: float) -> str:
    weights = spec.axis_weights(worst)
    perf, noise = _gains(weights, omega)
    formula = "|W_perf| s_r |W_n| / sqrt(s_r^2 + |W_n|^2)"
    where = "DC" if omega < 1e-3 else f"{omega:.3g} rad/s"
    products: dict[str, list[str]] = {}
    for axis in blocked:
        p, n = _gains(spec.axis_weights(axis), omega)
        products.setdefault(f"{p * n:.4g}", []).append(AXES[axis])
    forced = " and ".join(f"{value} on {' '.join(names)}" for value, names in products.items())
    product = "G_l W_n(0)" if where == "DC" else "|W_perf W_n|"
    return (
        f"S + T = 1 at {where} forces mu >= {product} = {forced} (with the reference counted, {formula}): the error "
        f"cannot be kept below 1/{perf:.4g} when the pose is measured with an error of {noise:.4g}. Change "
        f"sizes.noise to at most {0.9 / (perf * noise):.2g} of what it is (1e-3 reads W_n in mm and mrad), or "
        f"lower W_perf.G_l."
    )


def _gains(weights: AxisWeights, omega: float) -> tuple[float, float]:
    """|W_perf| and |W_n| at omega."""
    systems = (weights.perf.statespace(), weights.noise.statespace())
    perf, noise = (abs(complex(system.at(omega)[0, 0, 0])) for system in systems)
    return perf, noise


def explain(spec: SynthesisSpec, name: str, plant: GeneralizedPlant, result: DKResult) -> InfeasibleSpecError:
    """The error for a D-K iteration that ended above one: where mu peaks, and which requirement to relax."""
    peak = float(result.omega[int(result.mu.argmax())])
    closed = 1.0 / max(spec.control.dead_time + spec.control.motor_lag, 1e-6)
    if peak < 0.3 * closed:
        advice = "tracking and disturbance rejection ask for too much there: raise sizes.error, or lower W_perf.omega_c"
    else:
        advice = (
            "the dead time and lag leave no room there: lower sizes.disturbance or the uncertainty, "
            "raise sizes.effort, or run at a higher rate"
        )
    return InfeasibleSpecError(
        f"{name}: the D-K iteration ended at mu = {result.mu_peak:.3f}, with its peak at {peak:.3g} rad/s "
        f"(iterations: {', '.join(f'{step.mu_peak:.3g}' for step in result.history)}); {advice}."
    )
