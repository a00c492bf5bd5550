"""What the page may ask of a run: checked, bounded, and handed to the simulation one control step at a time.

Everything that comes from the page passes here. A value outside its range is brought back into it; what is no value at
all is dropped. Nothing raises, whatever a page sends.
"""

import math
import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait.run.stepper import Event
from fingergait.scenario import Disturbance, Input, Scenario
from fingergait.scenario.faults import FingerPowerLoss, PoseStale, TactileLost

Array = NDArray[np.float64]

_EVERY = 0.05  # s of simulated time between two changes of one number: what a drag leaves in a saved scenario
_PUSH = 0.2  # s that a push lasts
_EVENTS = 32  # pushes and faults that wait for the simulation at most
_RECORDED = 200_000  # events of a session that are kept for saving; hours of dragging


@dataclass(frozen=True)
class Control:
    """A number that the page may change: label, unit, range, step of the slider, and the scenario's keys it sets, each
    with a factor from the slider's unit."""

    label: str
    unit: str
    lower: float
    upper: float
    step: float
    keys: dict[str, float]
    hint: str

    def value(self, scenario: Scenario) -> float:
        """Where the slider stands for a scenario, in its unit."""
        table, _, field = next(iter(self.keys)).partition(".")
        found = float(getattr(getattr(scenario, table), field)) / next(iter(self.keys.values()))
        return min(max(round(round(found / self.step) * self.step, 9), self.lower), self.upper)


CONTROLS: dict[str, Control] = {
    "yaw_rate": Control(
        "yaw rate",
        "rad/s",
        -0.4,
        0.4,
        0.01,
        {"reference.yaw_rate": 1.0},
        "How fast the object is to turn, without end.",
    ),
    "swing": Control(
        "swing", "rad", 0.0, 0.15, 0.01, {"reference.swing_amplitude": 1.0}, "Amplitude of the tilt to and fro about Y."
    ),
    "friction": Control(
        "true friction",
        "",
        0.4,
        1.5,
        0.05,
        {"truth.friction": 1.0},
        "Of every contact of the object. The controller isn't told.",
    ),
    "mass": Control(
        "true mass", "x nominal", 0.5, 1.6, 0.05, {"truth.mass_scale": 1.0}, "Of the object. The controller isn't told."
    ),
    "noise": Control(
        "sensor noise",
        "mm",
        0.0,
        1.0,
        0.05,
        {
            "sensors.position_noise": 1e-3,
            "sensors.orientation_noise": 1e-2,
            "sensors.contact_place_noise": 1.5e-3,
            "sensors.contact_force_noise": 0.25,
        },
        "Standard deviation of the measured position; orientation, tactile place and force get noise in proportion.",
    ),
    "delay": Control(
        "delay of the pose",
        "ms",
        0.0,
        50.0,
        1.0,
        {"sensors.pose_delay_s": 1e-3},
        "By which the camera's pose comes late.",
    ),
}
"""The sliders of the page."""

DIRECTIONS: dict[str, tuple[float, float, float]] = {
    "+x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "+z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
}
"""Directions of a push, in W."""

FORCE = (0.5, 10.0)
"""N: range of a push."""

FAULT_TIME = (0.5, 10.0)
"""s: range of how long a fault lasts."""


class Inputs:
    """The queue between the page's threads and the simulation's.

    Parameters
    ----------
    fingers
        How many the hand has.
    bounds
        Smallest and largest offset (6,) of the desired pose, m and rad.
    period
        Of the control step, s.
    """

    def __init__(self, fingers: int, bounds: tuple[Array, Array], period: float) -> None:
        self._fingers, self.bounds, self._period = fingers, bounds, period
        self._lock = threading.Lock()
        self.clear()

    def clear(self) -> None:
        """Forgets what waits and what was recorded: a new run begins."""
        with self._lock:
            self._wanted: dict[str, Any] = {}  # the newest value of each key
            self._changed: dict[str, float] = {}  # when a key last changed, in simulated time
            self._actions: list[tuple[str, Any]] = []
            self.record: list[Event] = []

    def set(self, name: Any, value: Any) -> bool:
        """Asks for a value of one of `CONTROLS`, in its unit; False where that means nothing."""
        control = CONTROLS.get(name) if isinstance(name, str) else None
        number = _number(value)
        if control is None or number is None:
            return False
        number = min(max(number, control.lower), control.upper)
        with self._lock:
            for key, factor in control.keys.items():
                self._wanted[key] = number * factor
        return True

    def goal(self, offset: Any) -> tuple[float, ...] | None:
        """Asks for an offset [x, y, z, rx, ry, rz] of the desired pose; what of it is within the bounds, or None."""
        try:
            wanted = np.array(offset, dtype=float).reshape(6)
        except (TypeError, ValueError, OverflowError):
            return None
        if not np.isfinite(wanted).all():
            return None
        wanted = np.clip(wanted, *self.bounds)
        value = tuple(float(x) for x in wanted)
        with self._lock:
            self._wanted["reference.offset"] = value
        return value

    def push(self, direction: Any, force: Any) -> bool:
        """Asks for a push of `force`, N, in one of `DIRECTIONS`."""
        number = _number(force)
        if not isinstance(direction, str) or direction not in DIRECTIONS or number is None:
            return False
        number = min(max(number, FORCE[0]), FORCE[1])
        return self._act("push", tuple(number * x for x in DIRECTIONS[direction]))

    def fault(self, kind: Any, finger: Any, duration: Any) -> bool:
        """Asks for a fault: `power` or `tactile` of one finger, or a `stale` pose, for `duration`, s."""
        number = _number(duration)
        if number is None or kind not in ("power", "tactile", "stale"):
            return False
        if kind != "stale" and (type(finger) is not int or not 0 <= finger < self._fingers):
            return False
        number = min(max(number, FAULT_TIME[0]), FAULT_TIME[1])
        return self._act(kind, (finger, number))

    def take(self, t: float) -> list[Event]:
        """What is to happen at the control step of time t, s, recorded for `saved`; for the simulation's thread."""
        if not (self._wanted or self._actions):
            return []
        events: list[Event] = []
        with self._lock:
            for key in list(self._wanted):
                if t - self._changed.get(key, -math.inf) >= _EVERY:
                    self._changed[key] = t
                    events.append(Input(at=t, key=key, value=self._wanted.pop(key)))
            begin = t + self._period  # of a fault: the measurement of t has been taken
            for kind, what in self._actions:
                if kind == "push":
                    events.append(Disturbance(at=t, duration=_PUSH, force=what))
                elif kind == "power":
                    events.append(FingerPowerLoss(at=begin, finger=what[0], duration=what[1]))
                elif kind == "tactile":
                    events.append(TactileLost(at=begin, finger=what[0], duration=what[1]))
                else:
                    events.append(PoseStale(at=begin, duration=what[1]))
            self._actions.clear()
            self.record.extend(events[: max(0, _RECORDED - len(self.record))])
        return events

    def saved(self, scenario: Scenario, duration: float) -> dict[str, Any]:
        """TOML values of the scenario with all that was asked so far, ending after `duration`, s."""
        with self._lock:
            record = list(self.record)
        values = scenario.model_dump(mode="json", exclude_unset=True, exclude_none=True)
        values["duration"] = duration
        for key, kind in (("disturbance", Disturbance), ("input", Input)):
            values[key] = [*values.get(key, []), *(e.model_dump(mode="json") for e in record if isinstance(e, kind))]
        faults = [e for e in record if not isinstance(e, Disturbance | Input)]
        values["fault"] = [*values.get("fault", []), *(e.model_dump(mode="json", exclude_none=True) for e in faults)]
        return {key: value for key, value in values.items() if value != []}

    def _act(self, kind: str, what: Any) -> bool:
        with self._lock:
            if len(self._actions) >= _EVENTS:
                return False
            self._actions.append((kind, what))
        return True


def _number(value: Any) -> float | None:
    """A finite number, or None."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        return None
    try:
        number = float(value)
    except (OverflowError, TypeError, ValueError):
        return None
    return number if math.isfinite(number) else None
