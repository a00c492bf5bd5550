"""What only a run in contact tells of a grasp: the damping that the object really feels."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait.run.simulate import simulate
from fingergait.scenario import Scenario
from fingergait.synthesis.identify import identify_damping
from fingergait.synthesis.spec import SynthesisSpec

Array = NDArray[np.float64]

_FIRST, _APART, _LENGTH = 0.5, 1.2, 0.2  # s: the first pulse, from one to the next, and how long each is
_TORQUE = 0.25  # of the weight times the contacts' radius
_TRUSTED = 8.0  # factor by which an axis may feel more or less than the model says


@dataclass(frozen=True)
class Damping:
    """Damping (6, 6) that the object feels, and in words where it is from."""

    matrix: Array
    words: str


def pulses(values: dict[str, Any], weight: float, radius: float) -> dict[str, Any]:
    """The scenario with a pulse on each axis, of the weight or of a quarter of it at the contacts' radius."""
    table = []
    for i in range(6):
        size = (weight if i < 3 else _TORQUE * weight * radius) * (1.0 if i % 2 == 0 else -1.0)
        push = [size if k == i % 3 else 0.0 for k in range(3)]
        table.append({"at": _FIRST + i * _APART, "duration": _LENGTH, "force" if i < 3 else "torque": push})
    return {**values, "duration": _FIRST + 6 * _APART, "disturbance": table, "gait": {"enabled": False}}


def identified(values: dict[str, Any], spec: SynthesisSpec, weight: float, radius: float) -> Damping:
    """The damping by least squares over pulses on the resting object, or the model's where the run does not tell it."""
    assert spec.hand is not None
    model = np.array(spec.hand.damping)
    scenario = Scenario.build(pulses(values, weight, radius))
    run = simulate(scenario, progress=False)
    if run.metrics["dropped"] or run.metrics["worst_safe_mode"] == "stop":
        why = run.metrics["lost_reason"] or run.metrics["incomplete_reason"]
        return Damping(model, f"by the model only: the object did not stand the pulses ({why})")
    found = identify_damping(run.log, scenario, spec)
    found = 0.5 * (found + found.T)
    ratio = np.diag(found) / np.maximum(np.diag(model), 1e-9)
    if not np.isfinite(ratio).all() or ratio.min() < 1.0 / _TRUSTED or ratio.max() > _TRUSTED:
        text = ", ".join(f"{x:.2g}" for x in ratio)
        return Damping(model, f"by the model only: identified in contact it was {text} times that, axis by axis")
    values_, vectors = np.linalg.eigh(found)
    definite = vectors @ np.diag(np.maximum(values_, 1e-9 * values_.max())) @ vectors.T
    text = ", ".join(f"{x:.2f}" for x in ratio)
    return Damping(definite, f"identified in contact, {text} times the model's, axis by axis")
