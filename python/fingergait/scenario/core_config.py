"""The compiled core's configuration for a scenario. Defaults and ranges are the core's own: none is restated here."""

import json
from typing import Any

from fingergait.scenario.scenario import Scenario


def core_config(scenario: Scenario) -> str:
    """JSON for `_core.DualStagePlanner` and `_core.TorquePid`.

    The scenario's own keys set the control rate, the nominal mass and the assumed friction,;
    torque limits are the hand's; what the tables `gait`, `force`, `robust`, `torque` and `safety` say
    goes before.
    """
    config: dict[str, Any] = {
        "rate_hz": scenario.controller.rate_hz,
        "mass": scenario.object.mass,
        "gait": scenario.gait,
        "regrasp": scenario.regrasp,
        "force": {"friction": scenario.controller.friction, **scenario.force},
        "robust": scenario.robust,
        "torque": scenario.torque,
    }
    if scenario.safety:
        config["safety"] = scenario.safety
    return json.dumps(config)
