"""A scenario: plant, reference, disturbances and the errors of the model, read from TOML and checked.

The tables `gait`, `regrasp`, `force`, `torque`, `robust` and `safety` belong to the compiled core's configuration: they
are passed on as they are, and the core refuses what it doesn't know.
"""

import json
import sys
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, Field, ValidationError, model_validator

from fingergait._core import ConfigError
from fingergait.fields import NonNegative, Positive, Table, Twist, Vector
from fingergait.object.shapes import SIZES, Shape
from fingergait.paths import as_text, find
from fingergait.scenario.faults import KINDS, Fault
from fingergait.scenario.inputs import Input

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


class HandConfig(Table):
    """The hand: an MJCF or URDF file, an adopted bundle's folder, or a packaged name; its facts file (absent:
    `<stem>.facts.toml` beside it); pose of the model in the world [x, y, z, rx, ry, rz], m and rotation vector, where
    the file's own does not serve."""

    file: str = "hand"
    facts: str | None = None
    pose: Twist | None = None


class SupportConfig(Table):
    """A table below the object: height of its top, m (absent: none), and where its middle is, m.

    tilt_deg
        Its tilt, a rotation vector about x and y through the middle of its top, degrees.
    softness
        How many times softer than the fingertips its contact is, at the same share of critical damping.
    """

    height: float | None = None
    position: tuple[float, float] = (0.0, 0.0)
    tilt_deg: tuple[float, float] = (0.0, 0.0)
    softness: Positive = 1.0


class ObjectConfig(Table):
    """The object as the controller believes it: shape, lengths (m) as `shapes.SIZES` says, mass (kg); nominal pose
    at the start [x, y, z, rx, ry, rz] in W, m and rotation vector (absent: upright amid the fingers, on the palm)."""

    shape: Literal["cylinder", "ellipsoid", "box", "cone"] = "cylinder"
    size: tuple[float, ...] = (0.025, 0.06)
    mass: Positive = 0.5
    pose: Twist | None = None

    @property
    def geometry(self) -> Shape:
        """The homogeneous body."""
        return Shape(self.shape, self.size)

    @model_validator(mode="after")
    def _lengths(self) -> Self:
        self.geometry  # noqa: B018  raises where the size doesn't fit the shape
        return self


class TruthConfig(Table):
    """What the simulator has instead of what the controller believes.

    mass_scale, inertia_scale
        Factors on the nominal mass, and on the nominal moments of inertia (one number or one an axis); independent.
    friction
        Sliding friction coefficient of every contact of the object.
    com_offset
        Centre of mass in the object's frame, m.
    joint_damping_scale
        Factor on the joint damping of the MJCF.
    motor_lag_s
        Time constant of the motors, s; absent: that of the MJCF.
    first_grasp
        [x, y, z, rx, ry, rz], m and rad: the object off its nominal start when the fingers close. An object that would
        stand in the palm is raised onto it.
    finger_offset_deg, finger_height_offset
        Offset of each finger's first contact round the object, in degrees, and along the vertical, m; empty: zero.
    """

    mass_scale: Positive = 1.0
    inertia_scale: Positive | tuple[Positive, Positive, Positive] = 1.0
    friction: Positive = 1.0
    com_offset: Vector = (0.0, 0.0, 0.0)
    joint_damping_scale: NonNegative = 1.0
    motor_lag_s: Positive | None = None
    first_grasp: Twist = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    finger_offset_deg: tuple[float, ...] = ()
    finger_height_offset: tuple[float, ...] = ()


class GraspConfig(Table):
    """How the run starts: contact height above O, m; force (N) with which each tip presses when the controller takes
    over; time (s) before t = 0 in which the controller holds the start pose. joints: angles of the independent joints,
    finger by finger, rad (absent: each tip touches the side at the azimuth of its finger's base)."""

    joints: tuple[float, ...] | None = None
    height: float = 0.0
    press: Positive = 0.5
    settle: NonNegative = 0.3


class ControllerConfig(Table):
    """Artefact (file or packaged name), control rate, Hz, and the friction that the force optimiser assumes."""

    file: str = "mu"
    rate_hz: Positive = 500.0
    friction: Positive = 0.65


class ReferenceConfig(Table):
    """The desired motion, see `reference.Trajectory`: lengths in m, angles in rad, times in s.

    lift, lift_at, lift_time
        Height, start and duration of the lift.
    step, step_at
        A jump [x, y, z, rx, ry, rz] of the desired pose, and when.
    yaw_rate, swing_amplitude, swing_frequency
        Rate about the vertical, rad/s; amplitude, rad, and angular frequency, rad/s, of the swing about the world's Y.
    motion_at, blend
        When yaw and swing begin (absent: as the lift ends), and in what time they reach their full rate and amplitude.
    """

    lift: float = 0.0
    lift_at: float = 0.0
    lift_time: Positive = 1.0
    step: Twist = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    step_at: float = 0.0
    yaw_rate: float = 0.0
    swing_amplitude: float = 0.0
    swing_frequency: NonNegative = 4.0
    motion_at: float | None = None
    blend: Positive = 0.5

    @property
    def motion_start(self) -> float:
        """When yaw and swing begin, s."""
        if self.motion_at is not None:
            return self.motion_at
        return self.lift_at + self.lift_time if self.lift != 0.0 else 0.0


class SensorConfig(Table):
    """Errors of the sensors, ideal by default; the noise is white, given by its standard deviation.

    position_noise (m, each axis), orientation_noise (rad, each axis), pose_rate_hz (Hz; absent: every control step),
    pose_delay_s (s): the object's pose. encoder_noise (rad), encoder_bits (bits a turn; absent: no quantisation): joint
    angles. contact_place_noise (m, each axis), contact_force_noise (fraction of the force): tactile sensors, which are
    also off by contact_place_bias (m, in each fingertip's frame) and contact_force_bias (N) while they touch.
    """

    position_noise: NonNegative = 0.0
    orientation_noise: NonNegative = 0.0
    encoder_noise: NonNegative = 0.0
    contact_place_noise: NonNegative = 0.0
    contact_force_noise: NonNegative = 0.0
    contact_place_bias: Vector = (0.0, 0.0, 0.0)
    contact_force_bias: float = 0.0
    pose_rate_hz: Positive | None = None
    pose_delay_s: NonNegative = 0.0
    encoder_bits: Annotated[int, Field(ge=4, le=32)] | None = None


class PhysicsConfig(Table):
    """Longest physics step, s; the step used divides the control period."""

    timestep: Positive = 0.001


class Disturbance(Table):
    """A pulse on the object from `at` for `duration` seconds: force (N) and torque (N m) in W at O."""

    at: float
    duration: Positive
    force: Vector = (0.0, 0.0, 0.0)
    torque: Vector = (0.0, 0.0, 0.0)


class Scenario(Table):
    """One run. `metrics_from_s`: when the error metrics begin; absent: half a second after the lift."""

    name: str = "scenario"
    description: str = ""
    duration: Positive = 10.0
    seed: Annotated[int, Field(ge=0)] = 0
    metrics_from_s: float | None = None
    hand: HandConfig = HandConfig()
    support: SupportConfig = SupportConfig()
    object: ObjectConfig = ObjectConfig()
    truth: TruthConfig = TruthConfig()
    grasp: GraspConfig = GraspConfig()
    controller: ControllerConfig = ControllerConfig()
    reference: ReferenceConfig = ReferenceConfig()
    sensors: SensorConfig = SensorConfig()
    physics: PhysicsConfig = PhysicsConfig()
    disturbance: tuple[Disturbance, ...] = ()
    fault: tuple[Fault, ...] = ()
    input: tuple[Input, ...] = ()
    gait: dict[str, Any] = {}
    regrasp: dict[str, Any] = {}
    force: dict[str, Any] = {}
    torque: dict[str, Any] = {}
    robust: dict[str, Any] = {}
    safety: dict[str, Any] = {}

    @classmethod
    def load(cls, name: str | Path, overrides: dict[str, Any] | None = None) -> "Scenario":
        """The scenario in a TOML file or under a packaged name, with dotted keys replaced by `overrides`.

        Raises
        ------
        ConfigError
            One line that names the scenario and the field, what was expected and what was found.
        """
        path = find(name, "scenarios", ".toml", "scenario")
        try:
            values = tomllib.loads(path.read_text(encoding="utf-8"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ConfigError(f"{path.name}: expected TOML, found: {error}") from None
        values.setdefault("name", as_text(path.stem))
        for table, key in (("controller", "file"), ("hand", "file"), ("hand", "facts")):
            _resolve_beside(values, table, key, path.parent)
        return cls.build(values, overrides)

    @classmethod
    def build(cls, values: dict[str, Any], overrides: dict[str, Any] | None = None) -> "Scenario":
        """The scenario of these TOML values, with dotted keys replaced by `overrides`; errors as `load`."""
        values = json.loads(as_text(json.dumps(values, ensure_ascii=False)))
        for key, value in (overrides or {}).items():
            _assign(values, key, json.loads(as_text(json.dumps(value, ensure_ascii=False))))
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            raise ConfigError(f"{values.get('name', 'scenario')}: {_describe(error)}") from None

    def replace(self, overrides: dict[str, Any]) -> "Scenario":
        """This scenario with dotted keys replaced by `overrides`."""
        return Scenario.build(self.model_dump(mode="json", exclude_unset=True), overrides)

    @property
    def period(self) -> float:
        """Control period, s."""
        return 1.0 / self.controller.rate_hz

    @property
    def metrics_from(self) -> float:
        """When the error metrics begin, s."""
        if self.metrics_from_s is not None:
            return self.metrics_from_s
        return self.reference.motion_start + 0.5


def parse_override(text: str) -> tuple[str, Any]:
    """Key and value of a `--set KEY=VALUE`; the value is read as TOML, else taken as text."""
    key, sign, value = text.partition("=")
    if not sign or not key.strip():
        raise ConfigError(f"--set: expected KEY=VALUE, found {text!r}")
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()


def _assign(values: dict[str, Any], key: str, value: Any) -> None:
    """Sets `values["a"]["b"]` for the key "a.b"; a number selects an item of a list."""
    node: Any = values
    parts = key.split(".")
    for part in parts[:-1]:
        node = _item(node, part, key) if isinstance(node, list) else node.setdefault(part, {})
        if not isinstance(node, dict | list):
            raise ConfigError(f"{key}: expected a table at {part!r}, found {node!r}")
    if isinstance(node, list):
        _item(node, parts[-1], key)
        node[int(parts[-1])] = value
    else:
        node[parts[-1]] = value


def _item(items: list[Any], part: str, key: str) -> Any:
    if not part.isdigit() or int(part) >= len(items):
        raise ConfigError(f"{key}: expected the number of an item, 0 to {len(items) - 1}, found {part!r}")
    return items[int(part)]


def _resolve_beside(values: dict[str, Any], table: str, key: str, folder: Path) -> None:
    """Makes a file that a scenario names relative to itself absolute; packaged names stay as they are."""
    entry = values.get(table)
    if isinstance(entry, dict) and isinstance(entry.get(key), str):
        beside = folder / entry[key]
        if beside.is_file() or (beside / "hand.xml").is_file():  # a bundle's folder
            entry[key] = as_text(beside.resolve())


def _describe(error: ValidationError) -> str:
    first, *rest = error.errors(include_url=False)
    field = ".".join(str(part) for part in first["loc"] if not str(part).startswith(("function-", "tuple[", "float")))
    if first["type"] in ("union_tag_invalid", "union_tag_not_found"):
        found = first["input"].get("kind") if isinstance(first["input"], dict) else first["input"]
        text = f"{field}.kind: expected one of {', '.join(KINDS)}, found {found!r}"
    elif first["type"] == "extra_forbidden":
        text = f"{field}: expected {_keys(first['loc'])}, found an unknown key"
    elif first["type"] == "missing":
        text = f"{field}: expected a value, found none"
    else:
        expected = first["msg"].replace("Input should be", "expected").replace("Value error, ", "")
        text = f"{field}: {expected[0].lower()}{expected[1:]}, found {first['input']!r}"
    return text if not rest else f"{text} (and {len(rest)} more)"


def _keys(loc: tuple[int | str, ...]) -> str:
    """The keys that the table around `loc` has."""
    if loc[0] in ("disturbance", "fault", "input"):
        tables: dict[str, type[Table]] = {"disturbance": Disturbance, "input": Input}
        return "one of " + ", ".join((tables.get(str(loc[0])) or KINDS[str(loc[2])]).model_fields)
    table: type[BaseModel] = Scenario
    for part in loc[:-1]:
        kind = table.model_fields[str(part)].annotation
        table = kind if isinstance(kind, type) else table
    return "one of " + ", ".join(table.model_fields)


__all__ = ["SIZES", "Disturbance", "Input", "ReferenceConfig", "Scenario", "SensorConfig", "parse_override"]
