"""The controller artefact: the JSON file that the compiled controller reads."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fingergait.files import make_folder, write_text

from .discretise import DiscreteController

FORMAT = "fingergait-controller/1"


@dataclass(frozen=True)
class Nominal:
    """The body that the feedback linearisation assumes: mass in kg, principal inertias (3,) in kg m^2."""

    mass: float
    inertia: tuple[float, float, float]


@dataclass(frozen=True)
class Artefact:
    """What is written to models/controllers: see ARCHITECTURE.md for the format.

    Attributes
    ----------
    axes : six controllers, x y z rx ry rz
    delay : s, the dead time the design allowed for
    prefilter : rad/s of the critically damped reference filter, None for none
    """

    kind: Literal["mu-synthesis", "hand-tuned"]
    description: str
    sample_time: float
    delay: float
    nominal: Nominal
    axes: Sequence[DiscreteController]
    prefilter: float | None
    provenance: dict[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """The JSON object, in the order of the file."""
        return {
            "format": FORMAT,
            "kind": self.kind,
            "description": self.description,
            "sample_time": self.sample_time,
            "delay": self.delay,
            "nominal": {"mass": self.nominal.mass, "inertia": list(self.nominal.inertia)},
            "K": {"axes": [_matrices(K) for K in self.axes]},
            "prefilter": self.prefilter,
            "provenance": self.provenance,
        }

    def write(self, path: Path) -> None:
        """Writes the JSON text; numbers are exact (shortest text that reads back the same)."""
        make_folder(path.parent)
        write_text(path, json.dumps(self.as_dict(), indent=1, allow_nan=False) + "\n")


def _matrices(K: DiscreteController) -> dict[str, list[list[float]]]:
    g = K.system
    return {name: np.asarray(m).tolist() for name, m in (("A", g.A), ("B", g.B), ("C", g.C), ("D", g.D), ("L", K.L))}


def cylinder(mass: float, radius: float, half_height: float) -> Nominal:
    """A solid cylinder about z: Ixx = Iyy = m (3 r^2 + h^2)/12 with h its height, Izz = m r^2/2."""
    h = 2.0 * half_height
    transverse = mass * (3.0 * radius**2 + h**2) / 12.0
    return Nominal(mass, (transverse, transverse, 0.5 * mass * radius**2))
