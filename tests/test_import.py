"""What an import makes of servos, gears, tips, names, poses and facts: variants of the packaged hands, and runs."""

import json
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

import fingergait as fg
from fingergait._core import ConfigError
from fingergait.check import check_file
from fingergait.hand import HandError, import_hand
from fingergait.paths import MODELS
from fingergait.scenario import Scenario
from fingergait.sim.scene import build_scene

PAPER = (MODELS / "hand.xml").read_text()
TIP = '<geom type="sphere" size="0.014" contype="1"'
MOTOR = '<general name="f{k}_m{i}" class="motor" joint="f{k}_j{i}"/>'
GENERAL = 'ctrlrange="-2 2" actlimited="true" actrange="-0.5 0.5" forcerange="-0.5 0.5"'


def variant(tmp_path: Path, *changes: tuple[str, str], text: str = PAPER, name: str = "variant.xml") -> Path:
    """The paper's hand in a file with each first text replaced by the second, wherever it stands."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path = tmp_path / name
    path.write_text(text)
    return path


def motors(line: str) -> list[tuple[str, str]]:
    """Each motor of the paper's hand replaced by `line`, in which {k} and {i} count fingers and joints."""
    places = [(k, i) for k in range(4) for i in (1, 2, 3)]
    return [(MOTOR.format(k=k, i=i), line.format(k=k, i=i)) for k, i in places]


def held(path: Path, **values: object) -> fg.Run:
    """A run of 1.5 s that lifts the object with the hand at `path`."""
    given = {"hand.file": str(path), "duration": 1.5, "metrics_from_s": 1.2, "reference.lift": 0.005, **values}
    return fg.simulate(Scenario.load("hold", given))


RUNS = {
    "plain motor": motors('<motor joint="f{k}_j{i}" ctrlrange="-0.4 0.4"/>'),
    "geared motor": motors('<motor joint="f{k}_j{i}" gear="-40" ctrlrange="-0.01 0.01"/>'),
    "position servo": motors('<position joint="f{k}_j{i}" kp="4" kv="0.02" forcerange="-0.5 0.5"/>'),
    "velocity servo": motors('<velocity joint="f{k}_j{i}" kv="0.3" forcerange="-0.5 0.5"/>'),
    "integrating servo": motors(
        '<intvelocity joint="f{k}_j{i}" kp="3" actrange="-1 3" forcerange="-0.5 0.5" name="s{k}{i}"/>'
    ),
    "two on a joint": [
        *motors(
            '<motor joint="f{k}_j{i}" ctrlrange="0 1" gear="0.5"/>'
            '<motor joint="f{k}_j{i}" ctrlrange="0 1" gear="-0.5"/>'
        )
    ],
    "weak spring": [('damping="0.05"', 'damping="0.05" stiffness="0.02" springref="40"')],
    "no weight": [(f'<body name="f{k}_distal"', f'<body name="f{k}_distal" gravcomp="1"') for k in range(4)],
    "ellipsoid tip": [(TIP, '<geom type="ellipsoid" size="0.014 0.014 0.014" contype="1"')],
    "names like ours": [
        (
            '<geom name="palm"',
            '<site name="object"/><body name="fingergait"><geom size=".001"/></body><geom name="palm"',
        )
    ],
    "duplicate names": [('name="f1_tip"', 'name="f0-tip"')],
    "masks of no kind": [
        ('contype="1" conaffinity="5" material="link"', 'material="link"'),
        ('contype="1" conaffinity="5" mass="0.004"', 'mass="0.004"'),
        ('contype="2" conaffinity="4" material', "material"),
    ],
    "keys and sensors": [
        (
            "</actuator>",
            '</actuator><sensor><jointpos joint="f0_j1"/><actuatorfrc actuator="f0_m1"/></sensor>'
            f'<keyframe><key name="home" qpos="{" ".join(12 * ["0.3"])}"/></keyframe>',
        )
    ],
}


@pytest.mark.parametrize("case", RUNS)
def test_what_check_accepts_holds_an_object(case: str, tmp_path: Path) -> None:
    path = variant(tmp_path, *RUNS[case])
    assert check_file(path)["valid"]
    metrics = held(path).metrics
    assert not metrics["dropped"]
    assert metrics["max_position_error_m"] < 5e-4


def test_the_torque_at_the_joint_is_what_counts(tmp_path: Path) -> None:
    geared = import_hand(variant(tmp_path, *motors('<motor joint="f{k}_j{i}" gear="-40" ctrlrange="-0.01 0.02"/>')))
    assert {(m.low, m.high) for f in geared.fingers for m in f.motors} == {(-0.8, 0.4)}
    small = import_hand(variant(tmp_path, (GENERAL, GENERAL.replace("-2 2", "-0.1 0.2"))))
    assert {(m.low, m.high) for f in small.fingers for m in f.motors} == {(-0.1, 0.2)}
    capped = import_hand(variant(tmp_path, ('limited="true"/>', 'limited="true" actuatorfrcrange="-0.2 0.3"/>')))
    assert {(m.low, m.high, m.lag) for f in capped.fingers for m in f.motors} == {(-0.2, 0.3, 0.005)}
    assert any("actuatorfrcrange" in change for change in capped.changes)


def test_a_lagging_motor_without_a_force_limit_is_asked_for(tmp_path: Path) -> None:
    path = variant(tmp_path, (GENERAL, 'ctrlrange="-0.5 0.5"'))
    with pytest.raises(HandError) as error:
        import_hand(path)
    assert error.value.obstacles[0].where == "the motor f0_m1"
    assert "[joints.f0_j1] torque" in error.value.obstacles[0].remedy
    facts = path.with_name("variant.facts.toml")
    facts.write_text("torque = 0.5\n[joints.f0_j1]\ntorque = [-0.3, 0.4]\n")
    motors = import_hand(path).fingers[0].motors
    assert [(m.low, m.high) for m in motors] == [(-0.3, 0.4), (-0.5, 0.5), (-0.5, 0.5)]


FACTS = {
    "torqe = 0.5": "torqe: expected one of torque",
    "torque = -1": "torque",
    "[joints.f0_j1]\nheld = 'no'": "joints.f0_j1.held",
    "[joints.f0_j9]\nheld = 0": "joints.f0_j9: expected a joint of the model",
    "tips = ['f0_tip', 'nowhere']": "'nowhere'",
    "leave_out = ['f9']": "'f9'",
    "[joints.f0_j3]\nfollows = 'f1_j1'": "another joint of the same finger",
    "x = [": "expected TOML",
}


@pytest.mark.parametrize("text", FACTS)
def test_bad_facts_name_the_key(text: str, tmp_path: Path) -> None:
    facts = tmp_path / "facts.toml"
    facts.write_text(text)
    with pytest.raises(ConfigError) as error:
        import_hand(MODELS / "hand.xml", facts)
    assert FACTS[text] in str(error.value)


def test_facts_choose_tips_fingers_spheres_postures_and_couplings(tmp_path: Path) -> None:
    facts = tmp_path / "facts.toml"
    facts.write_text("""
tips = ["f2_distal", "f0_tip", "f1_tip", "f3_tip"]
leave_out = ["f3"]
lag = 0.01
[joints.f0_j1]
reference = 0.7
[joints.f0_j3]
follows = "f0_j1"
ratio = 0.5
offset = 0.1
[tip.f1_tip]
centre = [0.04, 0, 0]
radius = 0.012
""")
    hand = import_hand(MODELS / "hand.xml", facts)
    assert [len(finger.joints) for finger in hand.fingers] == [3, 2, 3]
    assert hand.fingers[2].sphere.radius == 0.012
    assert {m.lag for f in hand.fingers for m in f.motors} == {0.01}
    assert list(hand.references.values()) == [0.7]
    assert all(f"f3_j{i}" in " ".join(hand.changes) for i in (1, 2, 3))  # held, and said so
    data = mujoco.MjData(hand.model)
    leader, follower = (hand.model.joint(name).qposadr[0] for name in ("f0_j1", "f0_j3"))
    data.qpos[leader] = 0.6
    for _ in range(400):
        data.qpos[leader], data.qvel[hand.model.joint("f0_j1").dofadr[0]] = 0.6, 0.0
        mujoco.mj_step(hand.model, data)
    assert data.qpos[follower] == pytest.approx(0.5 * data.qpos[leader] + 0.1, abs=0.02)


def test_a_shared_wrist_is_held_where_it_is_told(tmp_path: Path) -> None:
    wrist = '<body name="wrist"><joint name="w" axis="0 0 1" range="10 50"/><geom size="0.01" mass="0.1"/>'
    begin = '<body name="f0_base"'
    text = PAPER.replace(begin, wrist + begin, 1).replace("</worldbody>", "</body></worldbody>")
    path = variant(tmp_path, text=text)
    hand = import_hand(path)
    assert any("joint w" in change and "0.1745" in change for change in hand.changes)
    facts = tmp_path / "facts.toml"
    facts.write_text("[joints.w]\nheld = 0.5\n")
    data = [mujoco.MjData(h.model) for h in (import_hand(MODELS / "hand.xml"), import_hand(path, facts))]
    for d, model in zip(data, (import_hand(MODELS / "hand.xml").model, import_hand(path, facts).model), strict=True):
        mujoco.mj_kinematics(model, d)
    before, after = (d.geom("f0_tip").xpos for d in data)
    turn = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    np.testing.assert_allclose(after[:2], turn @ before[:2], atol=1e-9)


def test_fitted_spheres_of_shapes(tmp_path: Path) -> None:
    def sphere(tip: str) -> tuple[np.ndarray, float, float]:
        hand = import_hand(variant(tmp_path, (TIP, f'<geom {tip} contype="1"')))
        s = hand.fingers[0].sphere
        return s.centre, s.radius, s.error

    centre, radius, error = sphere('type="capsule" size="0.012 0.01" euler="0 90 0"')
    np.testing.assert_allclose(centre, [0.055, 0, 0], atol=1e-9)  # the outer cap
    assert (radius, error) == (0.012, 0.0)
    centre, radius, error = sphere('type="ellipsoid" size="0.014 0.012 0.012"')
    assert 0.009 < radius < 0.014 and error < 1e-3
    _, radius, error = sphere('type="box" size="0.01 0.01 0.01"')
    assert error > 5e-4  # a flat end is no sphere, and that is said


def test_a_tip_that_cannot_touch_is_not_taken(tmp_path: Path) -> None:
    path = variant(tmp_path, ('size="0.014" contype="1" conaffinity="5"', 'size="0.014" contype="0" conaffinity="0"'))
    hand = import_hand(path)
    assert {finger.sphere.radius for finger in hand.fingers} == {0.006}
    assert any("can't touch" in change for change in hand.changes)


def test_fingers_are_found_without_names(tmp_path: Path) -> None:
    text = (MODELS / "hands" / "five-unequal.xml").read_text()
    names = [(f'<geom name="{k}_tip"', "<geom") for k in "abcde"]
    hand = import_hand(variant(tmp_path, *names, text=text))
    assert sorted(len(finger.joints) for finger in hand.fingers) == [2, 3, 3, 3, 4]
    assert {finger.sphere.radius for finger in hand.fingers} == {0.014}


def test_a_tendon_and_an_equality_couple_joints() -> None:
    hand = import_hand(MODELS / "hands" / "five-unequal.xml")
    name = hand.model.joint
    found = {name(c.follower).name: (name(c.leader).name, c.ratio) for c in hand.couplings.values()}
    assert found == {"b_distal": ("b_middle", 0.5), "e_distal": ("e_middle", 0.5)}
    # A tendon's force F pulls at both: F (1 + 0.5 * 0.5) at the leader.
    assert hand.fingers[4].motors[-1].high == pytest.approx(0.5 * 1.25)


def test_a_hand_stands_where_it_is_put() -> None:
    pose = [0.3, -0.2, 0.4, 0.0, 0.0, 1.0]
    run = held(MODELS / "hand.xml", **{"hand.pose": pose})
    assert not run.metrics["dropped"] and run.metrics["max_position_error_m"] < 5e-4
    np.testing.assert_allclose(run.log.pose("object")[-1, :3], [0.3, -0.2, 0.4 + 0.06 + 0.005], atol=1e-3)


def test_a_urdf_with_mimic_joints_becomes_a_hand(tmp_path: Path) -> None:
    def finger(k: int) -> str:
        links = "".join(
            f'<link name="l{k}{i}"><inertial><mass value="0.02"/><origin xyz="0.02 0 0"/>'
            '<inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial>'
            '<visual><geometry><mesh filename="package://none/seen.dae"/></geometry></visual>'
            '<collision><origin xyz="0.04 0 0"/><geometry><mesh filename="package://pads/ball.obj"/></geometry></collision>'
            "</link>"
            for i in range(3)
        )
        parents = ["base", f"l{k}0", f"l{k}1"]
        mimic = ["", "", f'<mimic joint="j{k}1" multiplier="0.8" offset="0.05"/>']
        joints = "".join(
            f'<joint name="j{k}{i}" type="revolute"><parent link="{parents[i]}"/><child link="l{k}{i}"/>'
            f'<origin xyz="0.04 0 0" rpy="0 0 {2.1 * k if i == 0 else 0}"/><axis xyz="0 -1 0"/>'
            f'<limit lower="-0.2" upper="1.5" effort="0.7" velocity="1"/><dynamics damping="0.02"/>{mimic[i]}</joint>'
            for i in range(3)
        )
        return links + joints

    ball = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    (tmp_path / "pads").mkdir()
    (tmp_path / "urdf").mkdir()
    lines = [f"v {0.008 * x} {0.008 * y} {0.008 * z}" for x, y, z in ball]
    faces = ["f 1 2 3", "f 2 4 3", "f 5 7 6", "f 6 7 8", "f 1 5 2", "f 2 5 6", "f 3 4 7", "f 4 8 7", "f 1 3 5"]
    (tmp_path / "pads" / "ball.obj").write_text("\n".join([*lines, *faces, "f 3 7 5", "f 2 6 4", "f 4 6 8"]))
    path = tmp_path / "urdf" / "hand.urdf"
    path.write_text(f'<robot name="r"><link name="base"/>{"".join(map(finger, range(3)))}</robot>')
    hand = import_hand(path)
    assert [len(finger.joints) for finger in hand.fingers] == [2, 2, 2]
    assert {(c.ratio, round(c.offset, 9)) for c in hand.couplings.values()} == {(0.8, 0.05)}
    assert {m.high for f in hand.fingers for m in f.motors} == {0.7}


def test_degrees_in_a_radian_file_are_suspected(tmp_path: Path) -> None:
    hand = import_hand(variant(tmp_path, ('angle="degree"', 'angle="radian"')))
    assert any("more than a turn" in warning for warning in hand.warnings)


def test_check_prints_the_same_as_json_and_lists_all_obstacles(tmp_path: Path) -> None:
    path = variant(tmp_path, *motors('<position joint="f{k}_j{i}" kp="4"/>'))
    command = [sys.executable, "-m", "fingergait.cli", "check", str(path)]
    bad = subprocess.run([*command, "--json"], capture_output=True, text=True, check=False)
    found = json.loads(bad.stdout)
    assert bad.returncode == 2 and not found["valid"] and len(found["obstacles"]) == 12
    assert all(set(obstacle) == {"where", "expected", "found", "remedy"} for obstacle in found["obstacles"])
    facts = tmp_path / "motors.toml"
    facts.write_text("torque = 0.5")
    good = subprocess.run([*command, "--facts", str(facts), "--json"], capture_output=True, text=True, check=False)
    found = json.loads(good.stdout)
    assert good.returncode == 0 and found["valid"] and found["kind"] == "hand"
    assert found["fingers"][0]["tau_max"] == [0.5, 0.5, 0.5]
    assert len(found["changes"]) == 12


@pytest.mark.parametrize("name", ["hold-three-by-three", "hold-four-by-four"])
def test_hands_like_real_ones_hold_within_a_tenth_of_a_millimetre(name: str) -> None:
    metrics = fg.simulate(Scenario.load(name, {"duration": 4.0})).metrics
    assert not metrics["dropped"]
    assert metrics["max_position_error_m"] < 1e-4


def test_a_step_on_the_four_by_four_hand_settles_in_half_a_second() -> None:
    metrics = fg.simulate(Scenario.load("robust-step-four-by-four")).metrics
    assert metrics["settling_time_s"]["max"] < 0.5


def test_five_unequal_coupled_fingers_hold() -> None:
    assert held(MODELS / "hands" / "five-unequal.xml").metrics["max_position_error_m"] < 1e-4


def test_a_scene_keeps_the_hands_own_collision_shapes() -> None:
    scene = build_scene(Scenario.load("hold-four-by-four"))
    model = scene.model
    touching = {model.geom(g).name for g in range(model.ngeom) if model.geom_contype[g] and model.geom_bodyid[g]}
    assert len(touching) == 1 + 4 * 5 + 1  # palm, five shapes a finger, the object
