"""A spec at another control rate: what follows the period, and what a slower loop must give up."""

from __future__ import annotations

import math
from typing import Any

from .errors import SpecError
from .spec import SynthesisSpec


def at_rate(spec: SynthesisSpec, rate_hz: float) -> SynthesisSpec:
    """The spec for a controller that is sampled at `rate_hz`.

    The delay keeps its number of samples: it is the time from the sensors to the motors of a loop that computes once a
    period, one sample in the packaged spec. A computer with another delay at that rate needs a spec that says so.

    A slower rate has more dead time, lag + delay + half a sample of hold, by 1/k. The bandwidth that is asked for falls
    with k^2, the disturbance that is to be met and the effort for it with k. Without that the uncertain damping is no
    longer met. A faster rate keeps the weights, and gains margin.

    Raises
    ------
    SpecError
        If `rate_hz` is not a finite number of Hz above zero, or leaves the spec inconsistent.
    """
    if not (math.isfinite(rate_hz) and rate_hz > 0.0):
        raise SpecError(f"rate: expected a finite number of Hz > 0, found {rate_hz}")
    if rate_hz == spec.control.rate_hz:
        return spec
    data: dict[str, Any] = spec.model_dump()
    was = spec.control
    data["control"] |= {"rate_hz": rate_hz, "delay": was.delay * was.rate_hz / rate_hz}
    k = min(1.0, _dead_time(spec) / (was.motor_lag + (was.delay * was.rate_hz + 0.5) / rate_hz))
    data["description"] = f"{spec.description}; at {rate_hz:g} Hz"
    said = f"At {rate_hz:g} Hz instead of {was.rate_hz:g} the delay keeps its {was.delay * was.rate_hz:g} samples"
    reasons = {"control": f"{said}."}
    if k < 1.0:
        perf, sizes = data["weights"]["W_perf"], data["sizes"]
        if perf["omega_c"] is not None:
            perf["omega_c"] = [k * k * omega for omega in perf["omega_c"]]
        for name in ("disturbance", "effort"):
            sizes[name] = [k * size for size in sizes[name]]
        reasons |= {"W_perf.omega_c": f"{said}, and the bandwidth falls to {k * k:.2g} of what it was."}
        reasons |= dict.fromkeys(("sizes.disturbance", "sizes.effort"), f"{said}, and this falls to {k:.2g} of it.")
    for name, reason in reasons.items():
        data["reasons"][name] = " ".join(filter(None, (spec.reasons.get(name), reason)))
    return SynthesisSpec.parse(data, f"spec at {rate_hz:g} Hz")


def _dead_time(spec: SynthesisSpec) -> float:
    """From the measurement to the torque, with the motors' lag and half a sample for the hold, s."""
    return spec.control.motor_lag + spec.control.dead_time
