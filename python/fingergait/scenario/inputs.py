"""Inputs that change while a run is under way: `[[input]]` with `at`, `key` and `value`.

A page that people play with writes them down, and `fingergait run` repeats them. They act on what the controller
is asked (`reference.*`) and on what is true of the plant (`truth.*`, `sensors.*`); the controller is never touched.
"""

import math
from typing import Self

from pydantic import model_validator

from fingergait.fields import Table, Twist

RANGES: dict[str, tuple[float, float]] = {
    "reference.offset": (-math.inf, math.inf),
    "reference.yaw_rate": (-math.inf, math.inf),
    "reference.swing_amplitude": (-math.inf, math.inf),
    "truth.friction": (1e-3, math.inf),
    "truth.mass_scale": (1e-3, math.inf),
    "sensors.position_noise": (0.0, math.inf),
    "sensors.orientation_noise": (0.0, math.inf),
    "sensors.encoder_noise": (0.0, math.inf),
    "sensors.contact_place_noise": (0.0, math.inf),
    "sensors.contact_force_noise": (0.0, math.inf),
    "sensors.pose_delay_s": (0.0, math.inf),
}
"""The keys that an input may change, and what each may be. They mean what the scenario's keys mean, but for
`reference.offset`, [x, y, z, rx, ry, rz] in m and rad: the desired pose off the trajectory, which the reference goes to
at a bounded rate and acceleration, see `steering`."""


class Input(Table):
    """From `at`, s, on, `key` is `value`."""

    at: float
    key: str
    value: float | Twist

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.key not in RANGES:
            raise ValueError(f"expected a key out of {', '.join(RANGES)}")
        if isinstance(self.value, tuple) != (self.key == "reference.offset"):
            expected = "six numbers [x, y, z, rx, ry, rz]" if self.key == "reference.offset" else "one number"
            raise ValueError(f"expected {expected} for {self.key}")
        lower, upper = RANGES[self.key]
        if not isinstance(self.value, tuple) and not lower <= self.value <= upper:
            raise ValueError(f"expected {lower:g} or more for {self.key}")
        return self

    @property
    def twist(self) -> Twist:
        """The value as six numbers."""
        return self.value if isinstance(self.value, tuple) else (self.value,) * 6

    @property
    def number(self) -> float:
        """The value as one number."""
        return self.value[0] if isinstance(self.value, tuple) else self.value
