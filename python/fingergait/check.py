"""The work of `fingergait check`: what a scenario, a controller artefact or a hand holds, if it is valid."""

from pathlib import Path
from typing import Any

import numpy as np

from fingergait._core import ArtifactError, ConfigError, Controller, DualStagePlanner, HandModel
from fingergait.hand import Hand, HandError, model_json, shown
from fingergait.run.simulate import load_controller
from fingergait.scenario import Scenario
from fingergait.scenario.core_config import core_config
from fingergait.sim.plant import MujocoPlant
from fingergait.sim.scene import SceneModel, build_scene
from fingergait.sim.start import nominal_start


def check_file(file: Path, facts: Path | None = None) -> dict[str, Any]:
    """What is in a file, as the JSON of `fingergait check`; `text` has it in lines for people.

    A file that a run would refuse gives `valid` false with its obstacles.
    """
    kinds = {".toml": _scenario, ".json": _controller, ".xml": _hand, ".urdf": _hand, ".mjcf": _hand}
    kind = kinds.get(file.suffix.lower())
    if kind is None:
        expected = "a scenario (.toml), a controller (.json) or a hand (.xml, .urdf)"
        raise ConfigError(f"FILE: expected {expected}, found {shown(file)}")
    if not file.is_file():
        raise ConfigError(f"FILE: expected a file, found nothing at {file}")
    try:
        return kind(file, facts)
    except HandError as error:
        obstacles = [vars(obstacle) for obstacle in error.obstacles]
        return _result("hand", [str(error)], obstacles=obstacles, valid=False)


def describe_file(file: Path) -> str:
    """Some lines on a valid file; an invalid one raises the error that a run would."""
    found = check_file(file)
    if not found["valid"]:
        raise ConfigError("\n".join(found["text"]))
    return "\n".join(found["text"])


def _result(kind: str, text: list[str], **more: Any) -> dict[str, Any]:
    empty: dict[str, Any] = {"fingers": [], "changes": [], "obstacles": [], "warnings": []}
    return {"kind": kind, "valid": True, **empty, "text": text, **more}


def _scenario(file: Path, facts: Path | None) -> dict[str, Any]:
    scenario = Scenario.load(file)
    if facts is not None:
        scenario = scenario.replace({"hand.facts": str(facts)})
    plant = MujocoPlant(scenario)
    hand = plant.scene.hand
    DualStagePlanner(HandModel(model_json(hand)), load_controller(scenario), plant.config)
    o, rate = scenario.object, scenario.controller.rate_hz
    counts = ", ".join(f"{finger.name} {len(finger.joints)}" for finger in hand.fingers)
    lines = [
        f"{shown(file)}: a valid scenario",
        f"object: {o.shape} {list(o.size)} m, {o.mass} kg, in truth {scenario.truth.mass_scale:g} times that",
        f"hand: {hand.source}, joints of each finger: {counts}; all reach the object",
        f"run: {scenario.duration:g} s, control {rate:g} Hz, physics {rate * plant.scene.substeps:g} Hz",
    ]
    return _result("scenario", lines, fingers=_fingers(hand), changes=list(hand.changes), warnings=list(hand.warnings))


def _controller(file: Path, facts: Path | None) -> dict[str, Any]:
    try:
        controller = Controller(file.read_text(encoding="utf-8"))
    except (ArtifactError, UnicodeDecodeError) as error:
        raise ArtifactError(f"{shown(file)}: {error}") from None
    inertia = ", ".join(f"{x:.3g}" for x in controller.inertia)
    lines = [
        f"{shown(file)}: a valid controller artefact, {controller.kind}",
        f"sample time {1e3 * controller.sample_time:g} ms, nominal {controller.mass:g} kg, {inertia} kg m^2",
    ]
    return _result("controller", lines)


def _hand(file: Path, facts: Path | None) -> dict[str, Any]:
    values = {"name": "check", "hand": {"file": str(file), "facts": None if facts is None else str(facts)}}
    scenario = Scenario.build(values)
    scene = build_scene(scenario)
    hand = scene.hand
    DualStagePlanner(HandModel(model_json(hand)), load_controller(scenario), core_config(scenario))
    warnings = [*hand.warnings, *_start_problems(scene, scenario)]
    lines = [f"{shown(file)}: a valid hand of {len(hand.fingers)} fingers"]
    for finger in hand.fingers:
        joints = ", ".join(
            f"{hand.model.joint(joint).name} {lower:.0f} to {upper:.0f} degrees, {motor.low:g} to {motor.high:g} N m"
            for joint, (lower, upper), motor in zip(
                finger.joints, np.rad2deg(hand.model.jnt_range[list(finger.joints)]), finger.motors, strict=True
            )
        )
        sphere = finger.sphere
        tip = f"tip radius {1e3 * sphere.radius:.2f} mm, off by {1e3 * sphere.error:.2f} mm at most"
        lines.append(f"{finger.name}: {tip}; {joints}")
    lines += [f"changed: {change}" for change in hand.changes]
    lines += [f"warning: {warning}" for warning in warnings]
    return _result("hand", lines, fingers=_fingers(hand), changes=list(hand.changes), warnings=warnings)


def _start_problems(scene: SceneModel, scenario: Scenario) -> list[str]:
    """What keeps a scenario that says nothing of object and grasp from starting with this hand."""
    o = scenario.object
    try:
        nominal_start(scene, scenario)
    except ConfigError as error:
        return [f"the default object ({o.shape} {list(o.size)} m on the palm) can't be grasped as it stands: {error}"]
    return []


def _fingers(hand: Hand) -> list[dict[str, Any]]:
    return [
        {
            "name": finger.name,
            "joints": [str(hand.model.joint(joint).name) for joint in finger.joints],
            "tip_radius_m": finger.sphere.radius,
            "tip_fit_error_m": finger.sphere.error,
            "tau_min": [motor.low for motor in finger.motors],
            "tau_max": [motor.high for motor in finger.motors],
        }
        for finger in hand.fingers
    ]
