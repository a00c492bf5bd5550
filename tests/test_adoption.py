"""Adopting a hand: stages that stand, bundles that move, controllers that fit, reports that say what runs did."""

import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import fingergait as fg
from fingergait.adopt import Grasp, GraspSearch, ObjectSpec, SearchOptions, pipeline, search_object, view_of
from fingergait.adopt.bundle import write_hand, write_scenario
from fingergait.adopt.choose import ordered
from fingergait.adopt.control import Base, fit
from fingergait.adopt.reflected import reflected
from fingergait.adopt.stages import Stages
from fingergait.adopt.verify import failing, summary
from fingergait.hand import hand_json, import_hand
from fingergait.paths import MODELS
from fingergait.synthesis.artefact import Nominal
from fingergait.synthesis.contact_plant import ReflectedHand, reflect

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

HAND = MODELS / "hand.xml"


def test_a_stage_is_repeated_only_where_inputs_or_files_have_changed(tmp_path: Path) -> None:
    done: list[int] = []

    def work() -> dict[str, int]:
        done.append(1)
        (tmp_path / "made").write_text("x")
        return {"result": len(done)}

    assert Stages(tmp_path).get("one", [1], work, ["made"]) == {"result": 1}
    again = Stages(tmp_path)
    assert again.get("one", [1], work, ["made"]) == {"result": 1} and again.repeated == []
    assert again.get("one", [2], work, ["made"]) == {"result": 2} and again.repeated == ["one"]
    (tmp_path / "made").unlink()
    assert Stages(tmp_path).get("one", [2], work, ["made"]) == {"result": 3}
    (tmp_path / "stages" / "one.json").write_text("torn")
    assert Stages(tmp_path).get("one", [2], work, ["made"]) == {"result": 4}


def test_a_bundles_hand_is_the_same_hand_wherever_it_is_moved(tmp_path: Path) -> None:
    """A hand with a mesh in a folder of its own, and with facts."""
    source = tmp_path / "source"
    (source / "parts").mkdir(parents=True)
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, 2)]
    (source / "parts" / "block.obj").write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1 2 3\nf 4 5 6\n"
    )
    text = HAND.read_text(encoding="utf-8").replace("<compiler ", '<compiler meshdir="parts" ', 1)
    mesh = '<asset><mesh name="block" file="block.obj" scale=".002 .002 .002"/></asset>\n<worldbody>'
    text = text.replace("<worldbody>", mesh + '<geom type="mesh" mesh="block" pos="0 0 -.1"/>', 1)
    (source / "mine.xml").write_text(text)
    facts = source / "mine.facts.toml"
    facts.write_text("torque = 0.3\n")
    files = write_hand(source / "mine.xml", facts, tmp_path / "made")
    expected = json.loads(hand_json(source / "mine.xml"))
    shutil.rmtree(source)
    moved = (tmp_path / "made").rename(tmp_path / "moved")
    assert set(files) == {"hand.xml", "hand.facts.toml", "assets/block.obj"}
    assert all((moved / file).is_file() for file in files)
    found = json.loads(hand_json(moved / "hand.xml"))
    assert found["fingers"][0]["joints"][0]["tau_max"] == 0.3
    for finger, other in zip(found["fingers"], expected["fingers"], strict=True):
        assert finger["tip"]["position"] == pytest.approx(other["tip"]["position"], abs=1e-6)


def test_scenarios_are_written_as_they_are_read(tmp_path: Path) -> None:
    values: dict[str, Any] = {
        "description": 'a "name" with \\ and an ü',
        "duration": 2.5,
        "object": {"shape": "cylinder", "size": [0.02, 1e-05], "mass": 1},
        "gait": {"enabled": False},
        "disturbance": [{"at": 1.0, "force": [1.0, 0.0, -2e-7]}, {"at": 2.0}],
    }
    write_scenario(tmp_path / "one.toml", values)
    assert tomllib.loads((tmp_path / "one.toml").read_text(encoding="utf-8")) == values


@pytest.fixture(scope="module")
def grasp() -> Grasp:
    """A grasp of the packaged hand; its promises are looked at elsewhere."""
    view = view_of(import_hand(HAND))
    options = SearchOptions(samples=2048, positions=8, places_refined=1, nearby=3, candidates=16, judged=16, marched=3,
                            generations=6, refined=1)  # fmt: skip
    found = search_object(view, ObjectSpec("cylinder", (0.025, 0.04), 0.3), options).best
    assert found is not None and found.kind == "gait"
    return found


def test_reflection_is_that_of_a_square_jacobian(grasp: Grasp) -> None:
    """By `synthesis.reflect` with Jacobians and inertias of MuJoCo; a finger away takes its share with it."""
    view = view_of(import_hand(HAND))
    model, data = view.model, mujoco.MjData(view.model)
    data.qpos[:] = view.qpos([np.array(q) for q in grasp.joints])
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    G, J = np.zeros((6, 12)), np.zeros((12, model.nv))
    for j, finger in enumerate(view.fingers):
        row, arm = slice(3 * j, 3 * j + 3), np.array(grasp.places[j]) - np.array(grasp.pose[:3])
        mujoco.mj_jac(model, data, J[row], None, np.array(grasp.places[j]), finger.tip_body)
        G[:3, row], G[3:, row] = np.eye(3), np.cross(np.eye(3), arm).T @ -np.eye(3)
    G[3:] = np.hstack([_cross(np.array(p) - np.array(grasp.pose[:3])) for p in grasp.places])
    expected = reflect(G, J, model.dof_damping, mass)
    found = reflected(view, grasp)
    np.testing.assert_allclose(found.inertia, expected.inertia, rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(found.damping, expected.damping, rtol=2e-3, atol=1e-4)
    shares = [found.damping - reflected(view, grasp, j).damping for j in range(4)]
    np.testing.assert_allclose(sum(shares), found.damping, rtol=1e-9, atol=1e-12)


def _cross(v: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def test_the_controller_of_the_same_hand_and_object_is_the_packaged_one() -> None:
    base = Base.load()
    own, hand = base.spec.object, base.spec.hand
    assert hand is not None
    same = ReflectedHand(np.array(hand.inertia), np.array(hand.damping))
    nominal = Nominal(own.mass, (own.inertia[0], own.inertia[1], own.inertia[2]))
    fitted = fit(base, nominal, 0.025, same, base.spec.control.motor_lag)
    np.testing.assert_allclose(fitted.gain, 1.0)
    # Everything twice as heavy and as damped is the same loop with twice the wrench: K in accelerations is unchanged.
    twice = Nominal(2.0 * own.mass, (2 * own.inertia[0], 2 * own.inertia[1], 2 * own.inertia[2]))
    double = fit(base, twice, 0.025, ReflectedHand(2.0 * same.inertia, 2.0 * same.damping), 0.005)
    np.testing.assert_allclose(double.gain, 2.0)
    for K, L in zip(double.axes, base.axes, strict=True):
        np.testing.assert_allclose(K.system.D, L.system.D)
    np.testing.assert_allclose(double.spec.sizes.effort, base.spec.sizes.effort)


ROW: dict[str, Any] = {
    "scenario": "turn.toml", "sense": 1, "asked_rad": 6.0, "turned_rad": 6.0, "dropped": False, "lost_reason": None,
    "completed": True, "incomplete_reason": None, "link_contacts": 0,
    "link_contact_at_rad": None, "safe_mode_at_rad": None, "max_position_error_m": 1e-4,
    "max_orientation_error_rad": 0.01, "worst_safe_mode": "normal",
}  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, ""),
        ({"dropped": True, "lost_reason": "it slid"}, "lost: it slid"),
        (
            {"turned_rad": 5.0, "incomplete_reason": "turned 286 of 300 degrees; stood still"},
            "turned 286 of 344 degrees; stood",
        ),
        ({"turned_rad": -6.0}, "turned back 344 of 344 degrees"),
        ({"link_contacts": 7, "link_contact_at_rad": 0.5}, "a link lay on the object after 29 degrees, in 7"),
        ({"link_contacts": 7, "link_contact_at_rad": 0.5, "dropped": True, "lost_reason": "x"}, "steps; then lost: x"),
        (
            {"link_contacts": 7, "link_contact_at_rad": 0.5, "safe_mode_at_rad": 0.4, "turned_rad": 1.0},
            "s; then a link",
        ),
        ({"max_position_error_m": 2e-3}, "2 mm off, 1 allowed"),
        ({"max_orientation_error_rad": 0.07}, "70 mrad off, 60 allowed"),
    ],
)
def test_what_a_run_failed_is_said(changes: dict[str, Any], words: str) -> None:
    row = {**ROW, **changes}
    found = failing(row, turns=True)
    assert words in found and bool(found) == bool(words)


def test_figures_of_runs_are_those_of_the_worst() -> None:
    rows = [{**ROW, "held": True, "fails": ""},
            {**ROW, "sense": -1, "asked_rad": -6.0, "turned_rad": -2.0, "held": False, "link_contacts": 3,
             "max_position_error_m": 5e-3, "fails": "turned 9; stood still from 1 s"}]  # fmt: skip
    found = summary(rows)
    assert (found["runs"], found["completed"], found["lost"], found["runs_with_link_contact"]) == (2, 1, 0, 1)
    assert found["turned_forwards_rad"] == 6.0 and found["turned_backwards_rad"] == 2.0
    assert found["turned_least_rad"] == 2.0 and found["max_position_error_m"] == 5e-3
    assert "safe mode" in found["fails_first"] and found["example"] == rows[1]["fails"]


def test_the_object_that_turns_furthest_both_ways_is_chosen(grasp: Grasp) -> None:
    far = [{**ROW, "held": True}, {**ROW, "held": True}]
    one_way = [{**ROW, "held": True}, {**ROW, "held": False, "turned_rad": 1.0}]
    nearly = [{**ROW, "held": False, "turned_rad": 5.5}] * 2
    assert ordered([grasp] * 3, [nearly, one_way, far]) == [2, 1, 0]


def test_an_adoption_says_what_its_runs_did(grasp: Grasp, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From a known grasp with short runs; the second time nothing is repeated; the bundle can be moved."""
    monkeypatch.setattr(pipeline, "LENGTH", 1.6)
    monkeypatch.setattr(pipeline, "_QUICK_SEEDS", 0)
    monkeypatch.setattr("fingergait.adopt.control.FACTORS", (1.0,))
    monkeypatch.setattr("fingergait.adopt.control._GRID", 20)
    monkeypatch.setattr(fg.adopt.Adoption, "_turn", lambda self, g: {  # type: ignore[attr-defined]
        "duration": 2.5, "reference": {"yaw_rate": 0.1, "motion_at": 0.5}})  # fmt: skip
    view = view_of(import_hand(HAND))
    found = search_known(view.name, grasp)
    monkeypatch.setattr(pipeline, "search_grasps", lambda *_, **__: found)

    def again() -> Any:
        return fg.adopt(HAND, out=tmp_path / "bundle", quick=True, workers=1, progress=False)

    first = again()
    values = first.report
    assert first.stages.repeated == ["grasps", "choice", "controller", "scenarios", "verification"]
    assert {entry["file"] for entry in values["verified"]} == {"turn.toml", "hold.toml", "step.toml"}
    turn = next(entry for entry in values["verified"] if entry["task"] == "turn")
    assert values["turns"] == (turn["completed"] == turn["runs"] == 2) and bool(values["reason"]) != values["turns"]
    assert json.loads((tmp_path / "bundle" / "report.json").read_text())["turns"] == values["turns"]
    page = (tmp_path / "bundle" / "report.html").read_text(encoding="utf-8")
    assert ("It turns its object" in page) == values["turns"]
    second = again()
    assert second.stages.repeated == [] and second.report["verified"] == values["verified"]
    moved = (tmp_path / "bundle").rename(tmp_path / "elsewhere")
    run = fg.simulate(fg.Scenario.load(moved / "turn.toml"))
    assert run.metrics["turned_rad"] == pytest.approx(first.verified[0]["rows"][0]["turned_rad"])


def search_known(name: str, grasp: Grasp) -> GraspSearch:
    """A search that found this grasp and none of a smaller object."""
    from fingergait.adopt.grasp import Found

    small = replace(grasp.object, size=(0.002, 0.001))
    entries = (Found(grasp.object, (grasp,), "", "", 0.0), Found(small, (), "reach", "finger f0 misses by 9 mm", 0.0))
    return GraspSearch(name, (0.0, 0.0, -9.81), (0.0, 0.0, 1.0), SearchOptions(), entries)
