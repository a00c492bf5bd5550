"""The work of `fingergait check`: what a scenario, a controller artefact or a hand holds, if it is valid."""

from pathlib import Path

import numpy as np

from fingergait._core import ArtifactError, ConfigError, Controller, DualStagePlanner, HandModel
from fingergait.hand import compile_spec, find_fingers, hand_json, load_spec
from fingergait.paths import find
from fingergait.run.simulate import load_controller
from fingergait.scenario import Scenario
from fingergait.sim.plant import MujocoPlant


def describe_file(file: Path) -> str:
    """Some lines on a valid file; an invalid one raises the error that a run would."""
    kinds = {".toml": _scenario, ".json": _controller, ".xml": _hand}
    if file.suffix not in kinds:
        raise ConfigError(f"FILE: expected a scenario (.toml), a controller (.json) or a hand (.xml), found {file}")
    if not file.is_file():
        raise ConfigError(f"FILE: expected a file, found nothing at {file}")
    return kinds[file.suffix](file)


def _scenario(file: Path) -> str:
    scenario = Scenario.load(file)
    plant = MujocoPlant(scenario)
    hand = find(scenario.hand.file, "", ".xml", "hand.file")
    DualStagePlanner(HandModel(hand_json(hand)), load_controller(scenario), plant.config)
    o, rate = scenario.object, scenario.controller.rate_hz
    lines = [
        f"{file}: a valid scenario",
        f"object: {o.shape} {list(o.size)} m, {o.mass} kg, in truth {scenario.truth.mass_scale:g} times that",
        f"hand: {hand}, {len(plant.scene.fingers)} fingers of {plant.scene.n_joints} joints; all reach the object",
        f"run: {scenario.duration:g} s, control {rate:g} Hz, physics {rate * plant.scene.substeps:g} Hz",
    ]
    return "\n".join(lines)


def _controller(file: Path) -> str:
    try:
        controller = Controller(file.read_text(encoding="utf-8"))
    except (ArtifactError, UnicodeDecodeError) as error:
        raise ArtifactError(f"{file.name}: {error}") from None
    inertia = ", ".join(f"{x:.3g}" for x in controller.inertia)
    return (
        f"{file}: a valid controller artefact, {controller.kind}\n"
        f"sample time {1e3 * controller.sample_time:g} ms, nominal {controller.mass:g} kg, {inertia} kg m^2"
    )


def _hand(file: Path) -> str:
    model = compile_spec(load_spec(file), file.name)
    fingers = find_fingers(model, file.name)
    HandModel(hand_json(file))
    lines = [f"{file}: a valid hand of {len(fingers)} fingers with {len(fingers[0].joints)} joints each"]
    for finger in fingers:
        ranges = np.rad2deg(model.jnt_range[list(finger.joints)])
        joints = ", ".join(
            f"{model.joint(joint).name} {lower:.0f} to {upper:.0f}"
            for joint, (lower, upper) in zip(finger.joints, ranges, strict=True)
        )
        lines.append(f"{finger.name}: tip radius {1e3 * model.geom_size[finger.tip, 0]:g} mm; {joints} degrees")
    return "\n".join(lines)
