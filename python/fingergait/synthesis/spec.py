"""The synthesis spec: a TOML file with the paper's Table I by its symbols, the plant, the uncertainty and the rate."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from .errors import SpecError
from .plant import Actuation, AxisWeights
from .statespace import Array
from .uncertainty import UncertainBody, damping_modes
from .weights import Weight

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

AXES = ("x", "y", "z", "rx", "ry", "rz")


def _six(value: Any) -> Any:
    return [value] * 6 if isinstance(value, (int, float)) else value


def _three(value: Any) -> Any:
    return [value] * 3 if isinstance(value, (int, float)) else value


Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
SixPositive = Annotated[list[Positive], BeforeValidator(_six), Field(min_length=6, max_length=6)]
Fraction = Annotated[float, Field(ge=0.0, lt=1.0)]
ThreeFractions = Annotated[list[Fraction], BeforeValidator(_three), Field(min_length=3, max_length=3)]
Row = Annotated[list[float], Field(min_length=6, max_length=6)]
Matrix6 = Annotated[list[Row], Field(min_length=6, max_length=6)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ObjectSpec(_Part):
    """The nominal object that the feedback linearisation assumes."""

    mass: Positive  # kg
    inertia: Annotated[list[Positive], Field(min_length=3, max_length=3)]  # kg m^2, principal


class ControlSpec(_Part):
    """Rate, delay and what the runtime needs."""

    rate_hz: Positive = 500.0
    delay: NonNegative = 0.002  # s, from the measurement to the torque, without the hold
    motor_lag: NonNegative = 0.0  # s
    prefilter: Positive | None = None  # rad/s
    order: Annotated[int, Field(ge=1)] = 6  # of each axis, after reduction
    windup_decay: Positive = 10.0  # 1/s
    force_limit: Positive = 10.0  # N, around the object's weight
    torque_limit: Positive = 0.15  # N m

    @property
    def sample_time(self) -> float:
        return 1.0 / self.rate_hz

    @property
    def dead_time(self) -> float:
        """What the continuous design allows for, s: the delay and half a sample for the hold."""
        return self.delay + 0.5 * self.sample_time


class HandSpec(_Part):
    """The fingers' inertia and damping reflected to the object at the nominal grasp, see `contact_plant.reflect`."""

    provenance: str
    inertia: Matrix6  # kg, kg m, kg m^2
    damping: Matrix6  # N s/m, N s, N m s


class DampingSpec(_Part):
    """The damping block: the truth is between (1 - size) and (1 + size) times `centre` times the nominal damping."""

    centre: Positive = 1.0
    size: Fraction = 0.0
    stable: Annotated[list[Positive], Field(min_length=2, max_length=2)] | None = None
    """Range of damping, relative to nominal, over which stability (not performance) is certified as well."""


class UncertaintySpec(_Part):
    """Relative errors: of the mass, of each principal moment of inertia, and of the damping."""

    mass: Fraction = 0.4
    inertia: ThreeFractions = [0.5, 0.5, 0.5]
    damping: DampingSpec = DampingSpec()


class WeightSpec(_Part):
    """One row of Table I. `omega_c` in rad/s, absent for a constant; `a` scales each axis x y z rx ry rz.

    `omega_c` may also be a list of six.
    """

    omega_c: SixPositive | None = None
    G_l: Positive
    G_h: Positive
    a: SixPositive = [1.0] * 6
    n: Annotated[int, Field(ge=1)] = 1

    def weight(self, axis: int, factor: float) -> Weight:
        crossover = None if self.omega_c is None else self.omega_c[axis]
        return Weight(self.G_l, self.G_h, crossover, self.n, self.a[axis] * factor)


class WeightsSpec(_Part):
    """Table I."""

    W_perf: WeightSpec
    W_u: WeightSpec
    W_dis: WeightSpec
    W_n: WeightSpec


class SizesSpec(_Part):
    """The size of one unit of each signal on each axis, in m or rad (and per s^2): 1 reads the table in plain SI."""

    reference: SixPositive = [1.0] * 6
    error: SixPositive = [1.0] * 6
    effort: SixPositive = [1.0] * 6
    disturbance: SixPositive = [1.0] * 6
    noise: SixPositive = [1.0] * 6


class IterationSpec(_Part):
    """How the D-K iteration is run."""

    iterations: Annotated[int, Field(ge=1, le=30)] = 5
    fit_order: Annotated[int, Field(ge=0, le=8)] = 3
    gamma: SixPositive = [0.97] * 6
    """Level of each axis for its last K: high keeps K's gains low, low leaves room for the coupling."""
    omega: tuple[Positive, Positive, int] = (0.01, 3000.0, 120)
    """Grid: first and last frequency in rad/s, and how many, evenly spaced in the logarithm."""


class SynthesisSpec(_Part):
    """A whole spec. `plant` "contact" adds the hand to the object; "free" is the paper's double integrator."""

    description: str
    plant: Literal["contact", "free"] = "contact"
    object: ObjectSpec
    control: ControlSpec = ControlSpec()
    hand: HandSpec | None = None
    uncertainty: UncertaintySpec = UncertaintySpec()
    weights: WeightsSpec
    sizes: SizesSpec = SizesSpec()
    iteration: IterationSpec = IterationSpec()
    reasons: dict[str, str] = {}
    """Why each figure departs from Table I, by its name, such as "W_perf.omega_c" or "sizes.noise"."""

    @model_validator(mode="after")
    def _consistent(self) -> SynthesisSpec:
        if self.plant == "contact" and self.hand is None:
            raise ValueError("hand: the contact plant needs the hand's reflected inertia and damping")
        if self.plant == "free" and self.uncertainty.damping.size > 0.0:
            raise ValueError("uncertainty.damping.size: a free object has no damping that could be uncertain")
        if self.hand is not None:
            for name in ("inertia", "damping"):
                matrix = np.array(getattr(self.hand, name))
                if np.abs(matrix - matrix.T).max() > 1e-6 * np.abs(matrix).max():
                    raise ValueError(f"hand.{name}: must be symmetric")
                if np.linalg.eigvalsh(matrix)[0] < 0.0:
                    raise ValueError(f"hand.{name}: must be positive semidefinite")
        low, high, count = self.iteration.omega
        if low >= high or not 20 <= count <= 2000:
            raise ValueError(
                f"iteration.omega: expected low < high and 20 to 2000 points, found {self.iteration.omega}"
            )
        samples = self.control.delay * self.control.rate_hz
        if samples > 20:
            raise ValueError(f"control.delay: expected at most 20 samples, found {samples:.1f}")
        return self

    @classmethod
    def load(cls, path: str | Path) -> SynthesisSpec:
        """The spec in a TOML file.

        Raises
        ------
        SpecError
            If the file is missing or not TOML, or a field is unknown, missing or out of range.
        """
        path = Path(path)
        try:
            data = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise SpecError(f"spec: cannot read {path}: {error.strerror}") from error
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise SpecError(f"spec: {path} is not TOML: {error}") from error
        return cls.parse(data, str(path))

    @classmethod
    def parse(cls, data: dict[str, Any], source: str = "spec") -> SynthesisSpec:
        """The spec in a dictionary, as read from TOML; `source` names it in errors."""
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            lines = []
            for item in error.errors():
                where = ".".join(str(part) for part in item["loc"]) or "spec"
                found = (
                    "" if item["type"] == "missing" or isinstance(item["input"], dict) else f", found {item['input']!r}"
                )
                lines.append(f"{where}: {item['msg']}{found}")
            raise SpecError(f"{source}: " + "; ".join(lines)) from error

    @property
    def omega(self) -> Array:
        """The frequency grid, rad/s."""
        low, high, count = self.iteration.omega
        return np.asarray(np.geomspace(low, high, count))

    def nominal_inertia(self) -> Array:
        """M0 = diag(m0, m0, m0, I0), (6, 6)."""
        return np.diag([self.object.mass] * 3 + list(self.object.inertia))

    def body(self, axes: list[int] | None = None) -> UncertainBody:
        """The uncertain body in acceleration units, of all six axes coupled or of some axes alone."""
        chosen = list(range(6)) if axes is None else axes
        M0 = self.nominal_inertia()
        inertia = np.eye(6)
        if self.plant == "contact" and self.hand is not None:
            inertia += np.linalg.solve(M0, np.array(self.hand.inertia))
            B = np.array(self.hand.damping)[np.ix_(chosen, chosen)]
            V = np.sqrt(self.uncertainty.damping.centre) * damping_modes(B)
        else:
            V = np.zeros((len(chosen), len(chosen)))
        error = np.array([self.uncertainty.mass] * 3 + list(self.uncertainty.inertia))
        pick = np.ix_(chosen, chosen)
        masses = sum(axis < 3 for axis in chosen)
        left = np.linalg.solve(M0[pick], V)
        return UncertainBody(inertia[pick], left, V.T, error[chosen], self.uncertainty.damping.size, masses)

    def axis_weights(self, axis: int) -> AxisWeights:
        """The weights of one axis, with the sizes of its signals."""
        w, s = self.weights, self.sizes
        return AxisWeights(
            perf=w.W_perf.weight(axis, 1.0 / s.error[axis]),
            effort=w.W_u.weight(axis, 1.0 / s.effort[axis]),
            disturbance=w.W_dis.weight(axis, s.disturbance[axis]),
            noise=w.W_n.weight(axis, s.noise[axis]),
            reference=s.reference[axis],
        )

    def actuation(self) -> Actuation:
        """Lag and dead time that the continuous design allows for."""
        return Actuation(self.control.motor_lag, self.control.dead_time)
