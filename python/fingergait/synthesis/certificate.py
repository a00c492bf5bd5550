"""The certificate: what is guaranteed, by what margin, at which rate and delay; in figures and in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .analysis import MuCurve
from .deviations import Deviation
from .spec import AXES, SynthesisSpec
from .statespace import Array
from .verify import Boundary, Campaign, Margins


@dataclass(frozen=True)
class Certificate:
    """What was proven and what was measured about one controller.

    Attributes
    ----------
    full : mu of the coupled six-axis problem, real parameters, by stage; the last is the shipped controller at its rate
    complex_peak : the same peak, at the last stage, if the parameters were complex
    per_axis : mu peak of each axis alone, x y z rx ry rz, complex parameters, at the sample rate
    parts : mu of the coupled problem's parts on `full`'s last grid
    stability : mu of stability alone over the wider damping range, or None
    margins : of the coupled nominal loop
    axis_margins : of each axis alone
    campaign, boundary : the nonlinear body inside and outside the box
    """

    full: dict[str, MuCurve]
    complex_peak: float
    per_axis: tuple[float, ...]
    parts: dict[str, Array]
    stability: MuCurve | None
    margins: Margins
    axis_margins: tuple[Margins, ...]
    campaign: Campaign
    boundary: Boundary
    deviations: Sequence[Deviation]

    @property
    def mu_peak(self) -> float:
        """Upper bound for the shipped controller on the full problem."""
        return list(self.full.values())[-1].peak

    def holds(self) -> bool:
        """Every stage and axis below one, and no random body unstable."""
        below = all(curve.peak < 1.0 for curve in self.full.values()) and max(self.per_axis) < 1.0
        wide = self.stability is None or self.stability.peak < 1.0
        return below and wide and self.campaign.unstable == 0

    def words(self, spec: SynthesisSpec) -> list[str]:
        """The certificate as sentences."""
        u, c = spec.uncertainty, spec.control
        shipped = list(self.full.values())[-1]
        inertia = " and ".join(sorted({f"{100 * v:.0f} %" for v in u.inertia}))
        covered = f"{100 * u.mass:.0f} % error of the mass and {inertia} of each principal moment of inertia"
        if u.damping.size > 0.0 and spec.plant == "contact":
            low, high = u.damping.centre * (1 - u.damping.size), u.damping.centre * (1 + u.damping.size)
            covered += f", with the fingers' damping anywhere between {low:.2f} and {high:.2f} of nominal on each axis"
        dead = f"{1e3 * c.delay:.3g} ms from measurement to actuator and a motor lag of {1e3 * c.motor_lag:.3g} ms"
        low_bound = shipped.lower.max()
        lines = [
            f"At {c.rate_hz:.0f} Hz with {dead}, stability and the performance that the weights state are kept for "
            f"{covered}, all at once. The largest structured singular value of the coupled six-axis problem is at most "
            f"{shipped.peak:.3f} (at {shipped.peak_omega:.3g} rad/s), the parameters being real numbers: "
            f"uncertainty and performance level together may grow by a factor of {1 / shipped.peak:.2f} before the "
            "guarantee ends.",
            f"The lower bound found is {low_bound:.3f}, so the guarantee is tight to "
            f"{100 * (1 - low_bound / shipped.peak):.0f} %. If the parameters could be any complex numbers of the same "
            f"size, the bound would be {self.complex_peak:.3f}; so taken, the peaks axis by axis are "
            + ", ".join(f"{name} {value:.3f}" for name, value in zip(AXES, self.per_axis, strict=True))
            + (
                "; the coupling between translation and rotation through the fingers is counted."
                if spec.plant == "contact"
                else "; the axes are not coupled."
            ),
        ]
        if self.stability is not None and u.damping.stable is not None:
            low, high = sorted(u.damping.stable)
            lines.append(
                f"Stability alone is guaranteed for damping from {low:g} to {high:g} times nominal, with the same "
                f"errors of mass and inertia (mu at most {self.stability.peak:.3f}, real parameters)."
            )
        m = self.margins
        lines.append(
            f"With the nominal body the loop stands {1e3 * m.delay:.0f} ms of further delay, and a gain between "
            f"{m.gain_low:.2f} and {m.gain_high:.1f} times the designed one on all axes at once."
        )
        k = self.campaign
        lines.append(
            f"{k.bodies} nonlinear rigid bodies from the set, the vertices of the box among them, with wrenches "
            f"limited to {c.force_limit:g} N around the weight and {c.torque_limit:g} N m: {k.unstable} unstable, "
            f"worst 5 % settling {k.settling:.2f} s, worst overshoot {100 * k.overshoot:.0f} %, worst final error "
            f"{1e3 * k.final[0]:.2f} mm and {1e3 * k.final[1]:.2f} mrad."
        )
        lines.append(
            "The guarantee is for the linear model around one grasp: contacts that neither slip nor break, uncertain "
            "parameters that are constant, frequencies on a grid that is refined around the peak. Slip, saturation and "
            "gaits are tested, not proven."
        )
        return lines

    def figures(self) -> dict[str, Any]:
        """Everything that fits in JSON, for the artefact's provenance."""
        shipped = list(self.full.values())[-1]
        return {
            "mu_peak": shipped.peak,
            "mu_lower": float(shipped.lower.max()),
            "mu_peak_complex": self.complex_peak,
            "mu_peak_omega": shipped.peak_omega,
            "mu_by_stage": {stage: curve.peak for stage, curve in self.full.items()},
            "mu_peak_per_axis": list(self.per_axis),
            "mu_stability": None if self.stability is None else self.stability.peak,
            "delay_margin_s": self.margins.delay,
            "gain_margins": [self.margins.gain_low, self.margins.gain_high],
            "campaign": asdict(self.campaign),
            "deviations": [asdict(d) for d in self.deviations],
        }


def breaks_at(boundary: Boundary) -> str:
    """In words, where the nonlinear loop was found to break."""
    if np.all(boundary.stable):
        return "nowhere on the grid"
    nominal = int(np.abs(np.log(np.maximum(boundary.damping, 1e-3))).argmin())
    row = boundary.stable[nominal]
    kept = boundary.mass[row.astype(bool)]
    span = f"{kept.min():.2g} to {kept.max():.2g}" if kept.size else "nothing"
    return f"at nominal damping the loop holds {span} times the nominal mass and inertia; the map shows the rest"
