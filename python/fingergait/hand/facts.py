"""What a model's file doesn't say about a hand: a small TOML file beside it.

torque = 0.5                      # N m, every motor; or [lower, upper]
lag = 0.005                       # s, every motor's time constant
tips = ["ff_tip", "th_tip"]       # geoms, bodies or sites; one a finger
leave_out = ["little"]            # fingers by name, or tips: held where they are
pose = [0, 0, 0.1, 0, 0, 0]       # of the model in the world: m and rotation vector

[joints.ffj0]
torque = [-0.3, 0.5]              # lag, damping, reference, range likewise
held = 0.2                        # rad: fixed there, no joint of a finger
follows = "ffj1"                  # at `ratio` (1) times that joint's angle plus `offset` (0), rad

[tip.ff_tip]
centre = [0, 0, 0.029]            # m, in the frame of the tip's body
radius = 0.012                    # m
"""

import sys
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, ValidationError, model_validator

from fingergait._core import ConfigError
from fingergait.fields import NonNegative, Positive, Table, Twist, Vector

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Limits = Annotated[tuple[float, float], Field(description="lower and upper")]


class JointFacts(Table):
    """Facts of one joint: torque limits (N m), motor lag (s), damping (N m s/rad), posture (rad), range (rad); or the
    angle (rad) at which it is held; or the joint that it follows, ratio and offset (rad)."""

    torque: Positive | Limits | None = None
    lag: NonNegative | None = None
    damping: NonNegative | None = None
    reference: float | None = None
    range: Limits | None = None
    held: float | None = None
    follows: str | None = None
    ratio: float = 1.0
    offset: float = 0.0

    @model_validator(mode="after")
    def _orders(self) -> Self:
        if isinstance(self.torque, tuple) and not self.torque[0] < 0.0 < self.torque[1]:
            raise ValueError("expected torque limits [lower < 0, upper > 0]")
        if self.ratio == 0.0:
            raise ValueError("expected a ratio that is not 0")
        if self.range is not None and not self.range[0] < self.range[1]:
            raise ValueError("expected a range [lower, upper] with lower < upper")
        return self


class TipFacts(Table):
    """The sphere of one fingertip, in the frame of its body, m."""

    centre: Vector
    radius: Positive


class Facts(Table):
    """All facts of a hand, see the module."""

    torque: Positive | Limits | None = None
    lag: NonNegative | None = None
    damping: NonNegative | None = None
    tips: tuple[str, ...] = ()
    leave_out: tuple[str, ...] = ()
    pose: Twist | None = None
    joints: dict[str, JointFacts] = {}
    tip: dict[str, TipFacts] = {}

    @model_validator(mode="after")
    def _orders(self) -> Self:
        if isinstance(self.torque, tuple) and not self.torque[0] < 0.0 < self.torque[1]:
            raise ValueError("expected torque limits [lower < 0, upper > 0]")
        return self

    @classmethod
    def load(cls, path: Path) -> "Facts":
        """The facts in a TOML file; an error is one line that names the key."""
        try:
            values = tomllib.loads(path.read_bytes().decode("utf-8"))
        except OSError as error:
            raise ConfigError(f"{path.name}: expected a facts file that can be read, found {error.strerror}") from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ConfigError(f"{path.name}: expected TOML, found: {error}") from None
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            first, *rest = error.errors(include_url=False)
            place = ".".join(str(part) for part in first["loc"] if "[" not in str(part) and part != "constrained-float")
            expected = first["msg"].replace("Input should be", "expected").replace("Value error, ", "")
            if first["type"] == "extra_forbidden":
                expected = f"expected one of {', '.join(cls.model_fields)}"
            text = f"{path.name}: {place or 'facts'}: {expected[0].lower()}{expected[1:]}, found {first['input']!r}"
            raise ConfigError(text + (f" (and {len(rest)} more)" if rest else "")) from None

    def of(self, joint: str) -> JointFacts:
        """Facts of one joint; what is said of all joints holds for it too."""
        own = self.joints.get(joint, JointFacts())
        given = {
            key: getattr(own, key) if getattr(own, key) is not None else getattr(self, key)
            for key in ("torque", "lag", "damping")
        }
        return own.model_copy(update=given)


def facts_beside(path: Path) -> Path | None:
    """`<stem>.facts.toml` in the folder of the model, where there is one."""
    beside = path.with_name(f"{path.stem}.facts.toml")
    return beside if beside.is_file() else None
