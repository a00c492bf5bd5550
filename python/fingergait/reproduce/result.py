"""What a reproduction found: everything that the page and the JSON file show."""

import os
import platform
from dataclasses import dataclass
from typing import Any

from fingergait.reproduce.ablations import Cell
from fingergait.reproduce.case import Outcome
from fingergait.reproduce.claim import Claim
from fingergait.reproduce.experiment import Experiment
from fingergait.reproduce.limits import Bisection, Limit
from fingergait.run.simulate import load_controller


@dataclass(frozen=True)
class Reproduction:
    """Everything that the page shows.

    claims, outcomes
        By experiment key; by case key.
    bisections
        By limit key.
    ablations
        By variant and condition.
    """

    quick: bool
    seconds: float
    experiments: list[Experiment]
    claims: dict[str, list[Claim]]
    outcomes: dict[str, Outcome]
    limits: list[Limit]
    bisections: dict[str, list[Bisection]]
    ablations: dict[str, dict[str, Cell]]

    @property
    def all_claims(self) -> list[Claim]:
        """The claims of all experiments, in the page's order."""
        return [claim for experiment in self.experiments for claim in self.claims[experiment.key]]


def settings_of(result: Reproduction) -> dict[str, Any]:
    """Versions, simulator settings, controller and machine of the runs."""
    shown = next(iter(result.outcomes.values()))
    metrics, scenario = shown.metrics, shown.case.scenario
    controller = load_controller(scenario)
    return {
        "controller": {
            "artefact": scenario.controller.file,
            "kind": controller.kind,
            "rate_hz": scenario.controller.rate_hz,
            "nominal_mass_kg": controller.mass,
        },
        "versions": metrics["versions"],
        "simulator": metrics["simulator"],
        "machine": {"system": platform.platform(terse=True), "processors": os.cpu_count()},
    }
