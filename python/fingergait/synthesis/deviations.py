"""Every departure of a spec from the paper's Table I, with its reason."""

from __future__ import annotations

from dataclasses import dataclass
from math import isclose, pi
from typing import Any

from .errors import SpecError
from .spec import SynthesisSpec

# Table I; `a` is (a1, a2, a3) read as (x, y, z), for translations and for rotations alike
TABLE_I: dict[str, dict[str, Any]] = {
    "W_perf": {"omega_c": 2.0 * pi, "G_l": 1100.0, "G_h": 0.9, "a": (1.0, 1.0, 2.0), "n": 2},
    "W_u": {"omega_c": None, "G_l": 1e-4, "G_h": 1e-4, "a": (1.0, 1.0, 0.5), "n": 1},
    "W_dis": {"omega_c": 200.0 * pi, "G_l": 80.0, "G_h": 0.1, "a": (1.0, 1.0, 10.0), "n": 2},
    "W_n": {"omega_c": 20.0 * pi, "G_l": 0.1, "G_h": 10.0, "a": (1.0, 1.0, 1.0), "n": 1},
}


@dataclass(frozen=True)
class Deviation:
    """One figure that is not the paper's."""

    name: str
    paper: str
    used: str
    reason: str


def deviations(spec: SynthesisSpec) -> list[Deviation]:
    """All departures from Table I and from the plant that the paper's figure shows.

    Raises
    ------
    SpecError
        If a departure has no reason in the spec's `reasons`, or a reason explains no departure.
    """
    found = [*_weights(spec), *_sizes(spec), *_plant(spec)]
    missing = [name for name, _, _ in found if name not in spec.reasons]
    if missing:
        name, paper, used = next(item for item in found if item[0] == missing[0])
        raise SpecError(
            f"reasons: expected a reason for every departure from Table I, found none for {', '.join(missing)} "
            f"({name}: the paper has {paper}, the spec {used})"
        )
    surplus = sorted(set(spec.reasons) - {name for name, _, _ in found})
    if surplus:
        raise SpecError(f"reasons: {', '.join(surplus)} is as in the paper or is no figure of the spec")
    return [Deviation(name, paper, used, spec.reasons[name]) for name, paper, used in found]


def _weights(spec: SynthesisSpec) -> list[tuple[str, str, str]]:
    found = []
    for weight, row in TABLE_I.items():
        used = getattr(spec.weights, weight)
        for symbol, paper in row.items():
            value = getattr(used, symbol)
            if symbol == "a":
                paper = list(paper) * 2
            if not _same(value, paper):
                found.append((f"{weight}.{symbol}", _show(paper), _show(value)))
    return found


def _sizes(spec: SynthesisSpec) -> list[tuple[str, str, str]]:
    found = []
    for name in type(spec.sizes).model_fields:
        values = getattr(spec.sizes, name)
        if any(v != 1.0 for v in values):
            found.append((f"sizes.{name}", "1 (SI)", _show(values)))
    return found


def _plant(spec: SynthesisSpec) -> list[tuple[str, str, str]]:
    found = []
    if spec.plant != "free":
        found.append(("plant", "free rigid body, ideal wrench", "the body with the fingers' inertia and damping"))
    if spec.uncertainty.damping.size > 0.0:
        d = spec.uncertainty.damping
        low, high = d.centre * (1.0 - d.size), d.centre * (1.0 + d.size)
        found.append(("uncertainty.damping", "none", f"{low:.3g} to {high:.3g} of nominal, one block for each axis"))
    if spec.control.motor_lag > 0.0 or spec.control.delay > 0.0:
        lag, dead = 1e3 * spec.control.motor_lag, 1e3 * spec.control.dead_time
        found.append(("control", "no lag, no delay", f"{lag:.3g} ms motor lag, {dead:.3g} ms dead time"))
    if spec.control.prefilter is not None:
        found.append(("control.prefilter", "none", f"{spec.control.prefilter:.3g} rad/s, outside the loop"))
    return found


def _same(value: Any, paper: Any) -> bool:
    """Whether a figure, or each of a list, is the paper's."""
    if value is None or paper is None:
        return value is paper
    values = value if isinstance(value, list) else [value]
    papers = paper if isinstance(paper, list) else [paper] * len(values)
    return all(isclose(v, p, rel_tol=1e-6) for v, p in zip(values, papers, strict=True))


def _show(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, (list, tuple)):
        values = [float(v) for v in value]
        return f"{values[0]:.4g}" if len(set(values)) == 1 else "(" + ", ".join(f"{v:.4g}" for v in values) + ")"
    return f"{float(value):.4g}"
