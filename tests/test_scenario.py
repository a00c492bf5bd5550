"""Scenario files: what they accept, and the one line they say where they don't."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from fingergait._core import ConfigError
from fingergait.object.shapes import Shape
from fingergait.paths import MODELS
from fingergait.scenario import Scenario, parse_override

BAD: dict[str, Any] = {
    "object.masss": (0.5, "object.masss: expected one of shape, size, mass, pose, found an unknown key"),
    "objekt.mass": (0.5, "objekt: expected one of name"),
    "object.mass": (-0.5, "object.mass: expected greater than 0, found -0.5"),
    "object.shape": ("ball", "object.shape: expected 'cylinder', 'ellipsoid', 'box' or 'cone', found 'ball'"),
    "object.size": ([0.025], "object.size: expected 2 lengths > 0 m .radius, half-height. for a cylinder, found"),
    "truth.friction": (float("nan"), "truth.friction: expected a finite number, found nan"),
    "truth.com_offset": ([0.0, 0.0], "truth.com_offset.2: expected a value"),
    "truth.first_grasp": ("left", "truth.first_grasp: expected a valid tuple, found 'left'"),
    "truth.inertia_scale": ([1.0, -1.0, 1.0], "truth.inertia_scale"),
    "duration": (0, "duration: expected greater than 0"),
    "seed": (1.5, "seed: expected a valid integer"),
    "sensors.encoder_bits": (2, "sensors.encoder_bits: expected greater than or equal to 4"),
    "gait": (3, "gait: expected a valid dictionary"),
}


@pytest.mark.parametrize("key", BAD)
def test_a_bad_value_is_one_line_with_field_expected_and_found(key: str) -> None:
    value, message = BAD[key]
    with pytest.raises(ConfigError, match=message) as error:
        Scenario.build({"name": "case"}, {key: value})
    assert "\n" not in str(error.value)
    assert str(error.value).startswith("case: ")


@pytest.mark.parametrize("name", sorted(path.stem for path in (MODELS / "scenarios").glob("*.toml")))
def test_every_packaged_scenario_loads_by_its_name(name: str) -> None:
    scenario = Scenario.load(name)
    assert scenario.name == name
    assert scenario.description


def test_an_unknown_name_lists_the_packaged_ones() -> None:
    with pytest.raises(ConfigError, match=r"lift-and-rotate.*found 'lift-and-roll'"):
        Scenario.load("lift-and-roll")


def test_broken_toml_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "broken.toml"
    path.write_text("duration = \n")
    with pytest.raises(ConfigError, match=r"broken\.toml: expected TOML") as error:
        Scenario.load(path)
    assert "\n" not in str(error.value)


def test_files_are_found_beside_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "my.json").write_text("{}")
    path = tmp_path / "case.toml"
    path.write_text('[controller]\nfile = "my.json"\n')
    assert Scenario.load(path).controller.file == str(tmp_path / "my.json")


def test_overrides_reach_tables_and_lists() -> None:
    values = {"disturbance": [{"at": 1.0, "duration": 0.1}]}
    overrides = dict(map(parse_override, ["object.size=[0.03, 0.05]", "disturbance.0.at=2", "object.shape=cylinder"]))
    scenario = Scenario.build(values, overrides)
    assert scenario.object.size == (0.03, 0.05)
    assert scenario.disturbance[0].at == 2.0
    assert Scenario.build({}, {"gait.w2": 0.02}).gait == {"w2": 0.02}
    assert scenario.replace({"seed": 4}).disturbance == scenario.disturbance


@pytest.mark.parametrize("text", ["object.mass", "=3", ""])
def test_an_override_without_key_or_value_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="expected KEY=VALUE"):
        parse_override(text)


@pytest.mark.parametrize("key", ["disturbance.1.at", "disturbance.x.at"])
def test_an_override_of_a_missing_item_is_refused(key: str) -> None:
    with pytest.raises(ConfigError, match="expected the number of an item"):
        Scenario.build({"disturbance": [{"at": 1.0, "duration": 0.1}]}, {key: 1.0})


def test_an_override_below_a_number_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"seed\.x: expected a table at 'seed', found 3"):
        Scenario.build({"seed": 3}, {"seed.x": 1.0})


SHAPES = [
    Shape("cylinder", (0.03, 0.05)),
    Shape("ellipsoid", (0.02, 0.03, 0.05)),
    Shape("box", (0.02, 0.03, 0.05)),
    Shape("cone", (0.03, 0.02, 0.05)),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_inertia_and_centre_of_mass_agree_with_mujocos_for_a_homogeneous_body(shape: Shape) -> None:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="object")
    body.add_freejoint()
    shape.add_to(spec, body, "object").mass = 0.4
    model = spec.compile()
    # A mesh of 256 facets lacks 0.02 % of the cone's area; its principal axes may come in another order.
    np.testing.assert_allclose(np.sort(model.body_inertia[1]), np.sort(shape.inertia(0.4)), rtol=5e-4)
    np.testing.assert_allclose(model.body_ipos[1], 0.0, atol=1e-6)


def test_cone_of_equal_radii_is_a_cylinder() -> None:
    cone, cylinder = Shape("cone", (0.03, 0.03, 0.05)), Shape("cylinder", (0.03, 0.05))
    np.testing.assert_allclose(cone.inertia(1.0), cylinder.inertia(1.0), rtol=1e-12)
    assert cone.bottom == pytest.approx(cylinder.bottom)
