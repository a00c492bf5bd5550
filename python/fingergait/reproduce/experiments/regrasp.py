"""Objects that are set down and taken again, because no finger can be spared."""

import math
from typing import Any

from fingergait.reproduce.case import Case, Outcome
from fingergait.reproduce.claim import Claim, share, worst
from fingergait.reproduce.experiment import Experiment

_OBJECTS = {"cylinder": (50.0, 20.0), "cube": (33.0, 30.0)}  # degrees a second at least, mrad at most
_POSITION = 1.0  # mm


def regrasp(quick: bool) -> Experiment:
    """A cylinder and a cube in a hand of three fingers, at two frictions, three masses, both ways."""
    duration = 20.0 if quick else 60.0
    conditions = [(0.7, 1.2, 2.0)] if quick else [(0.7, 1.2, 2.0), (0.7, 0.8, -2.0), (1.0, 0.8, 2.0), (1.0, 1.2, -2.0)]
    cases = [
        Case(
            f"{name}, friction {friction:g}, mass {mass:g}, {rate:+g} rad/s",
            f"regrasp-{name}",
            {
                "duration": duration,
                "seed": seed,
                "truth.friction": friction,
                "truth.mass_scale": mass,
                "reference.yaw_rate": rate,
            },
            film=seed == 0,
        )
        for name in _OBJECTS
        for seed, (friction, mass, rate) in enumerate(conditions)
    ]
    return Experiment(
        key="regrasp",
        title="Set down and take again",
        paper="beyond the paper, whose gait needs a finger that the others can do without",
        text="A hand of three fingers over a table turns a cylinder and a cube of 65 mm at 2 rad/s while it holds "
        "them, sets them down, takes them again and goes on. Only what the fingers feel tells that the object lies. "
        "A turn counts in the air only, and so do the errors. Every run has noise on all sensors.",
        cases=tuple(cases),
        judge=lambda outcomes: _judge(list(outcomes.values()), duration),
    )


def _judge(outcomes: list[Outcome], duration: float) -> list[Claim]:
    claims = []
    for name, (rate, orientation) in _OBJECTS.items():
        runs = [outcome for outcome in outcomes if outcome.case.base == f"regrasp-{name}"]
        claims += [
            share(f"regrasp-{name}-held", f"The {name} is never lost", runs, lambda o: o.kept),
            worst(
                f"regrasp-{name}-turned",
                f"The {name} turns in the air, in {duration:g} s",
                runs,
                _turned,
                rate * (duration - 1.0),
                "degrees",
                at_least=True,
            ),
            worst(
                f"regrasp-{name}-position",
                f"Position error of the {name} in the air",
                runs,
                lambda o: _figure(o, "max_position_error_in_air_m", 1e3),
                _POSITION,
                "mm",
            ),
            worst(
                f"regrasp-{name}-orientation",
                f"Orientation error of the {name} in the air",
                runs,
                lambda o: _figure(o, "max_orientation_error_in_air_rad", 1e3),
                orientation,
                "mrad",
            ),
        ]
    return claims


def _turned(outcome: Outcome) -> float | None:
    """Net turn in the air in the sense that was asked, degrees."""
    sense = math.copysign(1.0, outcome.case.scenario.reference.yaw_rate)
    return _figure(outcome, "turned_in_air_rad", sense * 180.0 / math.pi)


def _figure(outcome: Outcome, key: str, unit: float) -> float | None:
    """A figure of regrasping; None where there was none, or the object was lost."""
    figures: dict[str, Any] | None = outcome.metrics["regrasp"]
    return None if figures is None or not outcome.kept else unit * float(figures[key])
