"""One run of an experiment: the scenario, what to keep of it, and the command that repeats it."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait.scenario import Scenario


@dataclass(frozen=True)
class Case:
    """A run: a packaged scenario with some keys replaced.

    key
        Its name, unique in the reproduction.
    base
        Name of the packaged scenario.
    overrides
        Dotted scenario keys and their values.
    trace
        Keep the thinned signals that the plots show.
    film
        Render a film strip.
    """

    key: str
    base: str
    overrides: Mapping[str, Any] = field(default_factory=dict)
    trace: bool = False
    film: bool = False

    @property
    def scenario(self) -> Scenario:
        """The scenario to run."""
        return Scenario.load(self.base, dict(self.overrides))

    @property
    def command(self) -> str:
        """The command line that repeats the run."""
        words = ["fingergait", "run", self.base]
        for key, value in self.overrides.items():
            if key in ("duration", "seed"):
                words += [f"--{key}", toml(value)]
            elif key == "gait.enabled" and value is False:
                words.append("--no-gait")
            else:
                words += ["--set", f"{key}={toml(value)}"]
        return shlex.join(words)


@dataclass(frozen=True)
class Outcome:
    """What is kept of a run.

    metrics
        As in `fingergait run --json`.
    extra
        The figures of `analysis.analyse`.
    trace
        Thinned signals by name, where the case asks for them.
    film
        The film strip as PNG, or None.
    note
        Why there is no film strip.
    """

    case: Case
    metrics: dict[str, Any]
    extra: dict[str, Any]
    trace: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    film: bytes | None = None
    note: str = ""

    @property
    def kept(self) -> bool:
        """Whether the object was never lost."""
        return not self.metrics["dropped"]

    @property
    def turned(self) -> float:
        """Net rotation about the vertical, rad, without its sign."""
        return abs(float(self.metrics["rotation_rad"]))

    def value(self, key: str) -> float | None:
        """A metric of a run that kept the object; None otherwise."""
        return self.metrics[key] if self.kept else None


def toml(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + "}"
    return repr(value) if isinstance(value, int | float) else f'"{value}"'


def full_turn(yaw_rate: float) -> float:
    """Duration of a scenario, s, that lifts within the first second and then turns by a little over 360 degrees."""
    return float(np.ceil(10.0 * (1.0 + 0.4 + 2.0 * np.pi / abs(yaw_rate)) + 1.0)) / 10.0
