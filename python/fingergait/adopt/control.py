"""K for a new hand and object: the packaged one with each axis's gain fitted, and its mu; or a synthesis.

Each axis of the packaged K is scaled so that its loop crosses one where it does in the hand that it was made for: the
wrench for a given error follows |M (jw)^2 + B jw| of object and fingers together at that frequency.
"""

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait.paths import find
from fingergait.synthesis import SynthesisError, SynthesisSpec, synthesize
from fingergait.synthesis.analysis import mu_curve
from fingergait.synthesis.artefact import Artefact, Nominal
from fingergait.synthesis.contact_plant import ReflectedHand
from fingergait.synthesis.discretise import DiscreteController
from fingergait.synthesis.spec import HandSpec, ObjectSpec
from fingergait.synthesis.statespace import StateSpace
from fingergait.synthesis.verify import campaign, margins, nominal_loop, problems

Array = NDArray[np.float64]

_KEPT = {(0, 4), (1, 3)}
"""Couplings that mu counts: a push beside the contacts' plane tilts. All six axes in one problem take minutes;
that the others do no harm is left to the random bodies, which have all of them."""
_GRID, _REFINED = 60, 4


@dataclass(frozen=True)
class Base:
    """The packaged controller: its spec and its axes."""

    spec: SynthesisSpec
    axes: tuple[DiscreteController, ...]

    @classmethod
    def load(cls, name: str = "mu") -> "Base":
        """The controller packaged under `name`, with the spec in its provenance."""
        artefact = json.loads(find(name, "controllers", ".json", "controller").read_text(encoding="utf-8"))
        dt = artefact["sample_time"]
        axes = tuple(DiscreteController(_system(K, dt), np.array(K["L"])) for K in artefact["K"]["axes"])
        return cls(SynthesisSpec.parse(artefact["provenance"]["spec"]), axes)


FACTORS = (1.0, 0.8, 0.6, 0.45, 0.35)
"""On all gains: the first with mu < 1 is taken, else the one with the least. Where pushes and tilts are
coupled closely, what each axis asks for alone is too much for all together."""


DESIGNS = ((1.0, 1.0), (1.0, 0.85), (0.6, 0.85))
"""Factors on the sizes and on the levels gamma of a synthesis, tried in turn: lower levels leave room for couplings."""


@dataclass(frozen=True)
class Fitted:
    """A spec for the new plant and the packaged K scaled for it; `gain` (6,): wrench for an error, over the base's."""

    spec: SynthesisSpec
    axes: tuple[DiscreteController, ...]
    gain: Array


def fit(base: Base, nominal: Nominal, radius: float, hand: ReflectedHand, lag: float, factor: float = 1.0) -> Fitted:
    """The base controller with each axis scaled for an object in a hand.

    Parameters
    ----------
    base
        What is scaled.
    nominal
        The object as the controller is to believe it.
    radius
        Of its contacts, m.
    hand
        What the fingers add.
    lag
        Of the motors, s.
    factor
        On top, on every axis.
    """
    old, own = base.spec, base.spec.object
    assert old.hand is not None
    ours = ReflectedHand(np.array(old.hand.inertia), np.array(old.hand.damping))
    before, after = _body(own.mass, own.inertia), _body(nominal.mass, nominal.inertia)
    gain = np.empty(6)
    for i in range(6):
        omega = _crossing(base.axes[i].system, before, ours, i)
        gain[i] = factor * _needs(after, hand, i, omega) / _needs(before, ours, i, omega)
    share = gain * before / after  # of acceleration, in which K gives its answer
    axes = tuple(
        DiscreteController(StateSpace(K.system.A, K.system.B, s * K.system.C, s * K.system.D, K.system.dt), K.L / s)
        for K, s in zip(base.axes, share, strict=True)
    )
    sizes, control = old.sizes, old.control
    force = control.force_limit * nominal.mass / own.mass
    changed = {
        "object": ObjectSpec(mass=nominal.mass, inertia=list(nominal.inertia)),
        "description": "for an adopted hand",
        "control": control.model_copy(
            update={"motor_lag": lag, "force_limit": force, "torque_limit": 0.6 * force * radius}
        ),
        "hand": HandSpec(
            provenance="identified in the nominal grasp", inertia=hand.inertia.tolist(), damping=hand.damping.tolist()
        ),
        "sizes": sizes.model_copy(
            update={
                "effort": (np.array(sizes.effort) * share).tolist(),
                "disturbance": (np.array(sizes.disturbance) * share).tolist(),
            }
        ),
    }
    return Fitted(old.model_copy(update=changed), axes, gain)


def mu_of(spec: SynthesisSpec, axes: tuple[DiscreteController, ...], bodies: int = 300) -> dict[str, Any]:
    """What can be said of K on the plant of a spec.

    `mu_peak`: upper bound, real parameters, over translations with their tilts, z and rz; infinite (null) where the
    nominal loop is unstable. `unstable`, `bodies`: of random rigid bodies in the set, all couplings counted.
    """
    systems = [K.system for K in axes]
    loop = nominal_loop(spec, systems)
    if not loop.is_stable():
        return {"mu_peak": None, "delay_margin_s": 0.0, "gain_margins": None, "bodies": 0, "unstable": 0}
    thin = _thin(spec)
    low, high, _ = spec.iteration.omega
    curve = mu_curve(
        problems(thin, systems),
        np.geomspace(low, high, _GRID),
        spec.control.delay,
        real=True,
        lower=False,
        refine=_REFINED,
    )
    room, inside = margins(loop), campaign(spec, axes, bodies)
    peak = curve.peak if np.isfinite(curve.peak) else None
    return {
        "mu_peak": peak,
        "mu_peak_omega": curve.peak_omega,
        "delay_margin_s": room.delay,
        "gain_margins": [room.gain_low, room.gain_high],
        "bodies": inside.bodies,
        "unstable": inside.unstable,
    }


def design(
    base: Base, nominal: Nominal, radius: float, hand: ReflectedHand, lag: float, search: bool
) -> tuple[Artefact, dict[str, Any]]:
    """The controller for an object in a hand, and its figures; `search`: synthesise where the scaled one has mu >= 1.

    `kind` of the figures: "scaled" or "synthesised". The scaled one stays where the synthesis finds none.
    """
    found: list[tuple[float, Fitted, dict[str, Any]]] = []
    for factor in FACTORS:
        one = fit(base, nominal, radius, hand, lag, factor)
        said = mu_of(one.spec, one.axes)
        found.append((np.inf if said["mu_peak"] is None else said["mu_peak"], one, said))
        if found[-1][0] < 1.0:
            break
    _, fitted, said = min(found, key=lambda entry: entry[0])
    figures: dict[str, Any] = {"kind": "scaled", "gain": fitted.gain.tolist(), "tried": len(found), **said}
    figures["synthesis"] = "not asked for: the scaled controller was enough, or --quick"
    if search and (figures["mu_peak"] is None or figures["mu_peak"] >= 1.0):
        for factor, level in DESIGNS:
            spec = fit(base, nominal, radius, hand, lag, factor).spec
            gamma = [level * gamma for gamma in spec.iteration.gamma]
            spec = spec.model_copy(update={"iteration": spec.iteration.model_copy(update={"gamma": gamma})})
            try:
                axes = synthesize(_thin(spec), bodies=300).axes
            except SynthesisError as error:
                figures["synthesis"] = f"found none: {error}"
            else:
                figures |= {"kind": "synthesised", "synthesis": "", "sizes": factor, **mu_of(spec, axes)}
                return artefact_of(base, nominal, spec, axes, figures), figures
    return artefact_of(base, nominal, fitted.spec, fitted.axes, figures), figures


def artefact_of(
    base: Base, nominal: Nominal, spec: SynthesisSpec, axes: tuple[DiscreteController, ...], figures: dict[str, Any]
) -> Artefact:
    """The file's contents; its kind says "mu-synthesis" only with mu < 1."""
    control, peak = base.spec.control, figures.get("mu_peak")
    return Artefact(
        kind="mu-synthesis" if peak is not None and peak < 1.0 else "hand-tuned",
        description=f"adopted, {figures.get('kind', 'scaled')}, for {1e3 * nominal.mass:.0f} g",
        sample_time=control.sample_time,
        delay=control.dead_time,
        nominal=nominal,
        axes=axes,
        prefilter=control.prefilter,
        provenance={"figures": figures, "spec": spec.model_dump(mode="json")},
    )


def _system(K: dict[str, Any], dt: float) -> StateSpace:
    A, B, C, D = (np.array(K[key]) for key in "ABCD")
    return StateSpace(A, B, C, D, dt)


def _thin(spec: SynthesisSpec) -> SynthesisSpec:
    """The spec with the couplings of `_KEPT` only, scaled back where the rest was needed to keep them definite."""
    assert spec.hand is not None
    kept = {"inertia": spec.hand.inertia, "damping": spec.hand.damping}
    thin = {}
    for name, rows in kept.items():
        full = np.array(rows)
        matrix = np.diag(np.diag(full))
        for i, k in _KEPT:
            most = 0.999 * np.sqrt(full[i, i] * full[k, k])
            matrix[i, k] = matrix[k, i] = np.clip(full[i, k], -most, most)
        thin[name] = matrix.tolist()
    return spec.model_copy(update={"hand": spec.hand.model_copy(update=thin)})


def _body(mass: float, inertia: Any) -> Array:
    return np.array([mass, mass, mass, *inertia], dtype=np.float64)


def _needs(body: Array, hand: ReflectedHand, i: int, omega: float) -> float:
    """Wrench for a motion of one unit at omega along axis i, while the other axes stand still."""
    return float(abs(-(body[i] + hand.inertia[i, i]) * omega**2 + 1j * hand.damping[i, i] * omega))


def _crossing(K: StateSpace, body: Array, hand: ReflectedHand, i: int) -> float:
    """The last frequency, rad/s, at which the loop's gain is one."""
    omega = np.geomspace(1.0, 1000.0, 400)
    gains = body[i] * np.abs(K.at(omega)[:, 0, 0])
    needs = np.array([_needs(body, hand, i, float(w)) for w in omega])
    above = np.flatnonzero(gains > needs)
    return float(omega[above[-1]]) if len(above) else 20.0
