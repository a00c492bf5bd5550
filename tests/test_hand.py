"""MJCF to HandModel: MuJoCo's own kinematics and gravity are the oracle."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

from fingergait._core import ConfigError, HandModel
from fingergait.hand import find_fingers, hand_json, hand_spec
from fingergait.paths import MODELS

# A hand that has all that the format must carry: two joints in one body off its origin, reference angles, turned and
# empty bodies between joints, and a fingertip in a body welded to the last link.
ODD_FINGER = """
<body pos="{x} 0.02 0.01" euler="10 {tilt} 5">
  <body pos="0.01 0 0" euler="0 25 0">
    <joint name="{n}_a" axis="0 -1 0.2" pos="0.003 0.001 -0.002" range="-60 90" ref="20"/>
    <joint name="{n}_b" axis="0 0 1" pos="0 0.004 0" range="-45 45" ref="-15"/>
    <geom type="capsule" size="0.006" fromto="0 0 0 0.05 0 0.004" mass="0.03"/>
    <body pos="0.05 0 0.004" euler="30 0 0">
      <body pos="0.002 0 0" euler="0 0 12">
        <joint name="{n}_c" axis="0 -1 0" range="-10 100"/>
        <geom type="capsule" size="0.005" fromto="0 0 0 0.03 0 0" mass="0.02"/>
        <body pos="0.03 0 0.001" euler="0 40 0"><geom name="{n}_tip" size="0.011" pos="0 0 -0.003" mass="0.004"/></body>
      </body>
    </body>
  </body>
</body>"""


def odd_hand(tips: tuple[str, ...] = ("thumb", "index", "ring")) -> str:
    """MJCF text of a hand with odd fingers of these names."""
    bodies = "".join(ODD_FINGER.format(n=n, x=0.05 * i, tilt=15 * i) for i, n in enumerate(tips))
    motors = "".join(f'<motor joint="{n}_{j}" name="{n}{j}"/>' for n in tips for j in "abc")
    return f"<mujoco><worldbody>{bodies}</worldbody><actuator>{motors}</actuator></mujoco>"


@pytest.fixture(params=["shipped", "odd"])
def hand_file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    if request.param == "shipped":
        return MODELS / "hand.xml"
    path = tmp_path / "odd.xml"
    path.write_text(odd_hand())
    return path


def test_kinematics_and_gravity_agree_with_mujoco_at_random_poses(hand_file: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(hand_file))
    data = mujoco.MjData(model)
    fingers = find_fingers(model, "hand")
    hand = HandModel(hand_json(hand_file))
    joints = np.array([finger.joints for finger in fingers])
    assert (hand.n_fingers, hand.n_joints) == joints.shape
    dofs = model.jnt_dofadr[joints]
    lower, upper = model.jnt_range[joints].transpose(2, 0, 1)
    rng = np.random.default_rng(1)
    jacobian = np.zeros((3, model.nv))
    for _ in range(50):
        q = rng.uniform(lower, upper)
        data.qpos[model.jnt_qposadr[joints]] = q
        mujoco.mj_forward(model, data)
        tips = np.array([data.geom_xpos[finger.tip] for finger in fingers])
        np.testing.assert_allclose(hand.tip_positions(q), tips, atol=1e-12)
        np.testing.assert_allclose(hand.gravity_torque(q), data.qfrc_bias[dofs], atol=1e-12)  # qvel is zero
        for index, finger in enumerate(fingers):
            point = tips[index] + rng.uniform(-0.01, 0.01, 3)
            mujoco.mj_jac(model, data, jacobian, None, point, int(model.geom_bodyid[finger.tip]))
            np.testing.assert_allclose(hand.jacobian(q, index, point), jacobian[:, dofs[index]], atol=1e-12)


def test_shipped_hand_is_the_papers() -> None:
    spec = json.loads(hand_json(MODELS / "hand.xml"))
    assert [finger["name"] for finger in spec["fingers"]] == ["f0", "f1", "f2", "f3"]
    for finger in spec["fingers"]:
        limits = np.rad2deg([[joint["lower"], joint["upper"]] for joint in finger["joints"]])
        np.testing.assert_allclose(limits, [[-10, 135], [-45, 45], [-10, 170]], atol=1e-9)
        assert finger["tip"]["radius"] == 0.014
        assert sum(joint["mass"] for joint in finger["joints"]) == pytest.approx(0.054)


BAD_HANDS = {
    "no tip": ("_tip", "_end", "expected sphere geoms whose names end in 'tip'"),
    "unequal": (
        '<joint name="ring_c" axis="0 -1 0" range="-10 100"/>',
        "",
        "as many joints in each finger, found thumb 3",
    ),
    "slide": ('<joint name="ring_c"', '<joint type="slide" name="ring_c"', "hinge joints only, found ring_c, a slide"),
    "no range": (
        'name="ring_c" axis="0 -1 0" range="-10 100"',
        'name="ring_c"',
        "a range on every joint, found none on",
    ),
    "no sphere": ('name="ring_tip" size="0.011"', 'name="ring_tip" type="box" size=".01 .01 .01"', "found a box"),
    "no motor": ('<motor joint="ring_b" name="ringb"/>', "", "one actuator on the joint ring_b, found 0"),
    "lid": ("</worldbody>", "<body><joint name='lid' range='0 1'/><geom size='.1'/></body></worldbody>", "lid in none"),
}


@pytest.mark.parametrize("case", BAD_HANDS)
def test_a_hand_that_cannot_be_used_says_why(case: str) -> None:
    old, new, message = BAD_HANDS[case]
    text = odd_hand()
    assert old in text
    text = text.replace(old, new)
    if case == "unequal":
        text = text.replace('<motor joint="ring_c" name="ringc"/>', "")
    with pytest.raises(ConfigError, match=message) as error:
        hand_spec(mujoco.MjModel.from_xml_string(text), "odd.xml")
    assert "\n" not in str(error.value)
    assert str(error.value).startswith("odd.xml: expected ")


def test_a_shared_joint_is_refused() -> None:
    text = """<mujoco><worldbody><body><joint name="wrist" range="-1 1"/><geom size="0.01"/>
    <body pos="1 0 0"><joint name="j1" range="-1 1"/><geom name="1tip" size=".01"/></body>
    <body pos="2 0 0"><joint name="j2" range="-1 1"/><geom name="2tip" size=".01"/></body></body></worldbody>
    <actuator><motor joint="wrist"/><motor joint="j1"/><motor joint="j2"/></actuator></mujoco>"""
    with pytest.raises(ConfigError, match="no joint in two fingers, found wrist in 1 and 2"):
        hand_spec(mujoco.MjModel.from_xml_string(text), "hand")


def test_a_file_that_is_no_mjcf_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "broken.xml"
    path.write_text("<mujoco>\n<worldbody>")
    with pytest.raises(ConfigError, match=r"broken\.xml") as error:
        hand_json(path)
    assert "\n" not in str(error.value)
