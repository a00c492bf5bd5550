"""Hand models to HandModel: MuJoCo's own kinematics and gravity are the oracle."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

from fingergait._core import ConfigError, HandModel
from fingergait.hand import Hand, HandError, hand_json, import_hand, model_json
from fingergait.paths import MODELS

# A hand that has all that the format must carry: two joints in one body off its origin, reference angles, turned and
# empty bodies between joints, a frame, springs, and a fingertip in a body welded to the last link.
ODD_FINGER = """
<body pos="{x} 0.02 0.01" euler="10 {tilt} 5">
  <frame pos="0.004 0 0.001" euler="0 0 20">
  <body pos="0.01 0 0" euler="0 25 0">
    <joint name="{n}_a" axis="0 -1 0.2" pos="0.003 0.001 -0.002" range="-60 90" ref="20"
           stiffness="0.01" springref="15"/>
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
  </frame>
</body>"""


def odd_hand(tips: tuple[str, ...] = ("thumb", "index", "ring")) -> str:
    """MJCF text of a hand with odd fingers of these names."""
    bodies = "".join(ODD_FINGER.format(n=n, x=0.05 * i, tilt=15 * i) for i, n in enumerate(tips))
    motors = "".join(f'<motor joint="{n}_{j}" name="{n}{j}" ctrlrange="-1 1"/>' for n in tips for j in "abc")
    return f'<mujoco><compiler autolimits="true"/><worldbody>{bodies}</worldbody><actuator>{motors}</actuator></mujoco>'


def written(tmp_path: Path, text: str, name: str = "odd.xml") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


HANDS = ["shipped", "odd", "turned", *sorted(path.stem for path in (MODELS / "hands").glob("*.xml"))]


@pytest.fixture(params=HANDS)
def hand(request: pytest.FixtureRequest, tmp_path: Path) -> Hand:
    if request.param == "shipped":
        return import_hand(MODELS / "hand.xml")
    if request.param in ("odd", "turned"):
        pose = (0.1, -0.2, 0.3, 0.4, 1.0, -0.7) if request.param == "turned" else None
        return import_hand(written(tmp_path, odd_hand()), pose=pose)
    return import_hand(MODELS / "hands" / f"{request.param}.xml")


def followed(hand: Hand, data: mujoco.MjData) -> None:
    address = hand.model.jnt_qposadr
    for coupling in hand.couplings.values():
        data.qpos[address[coupling.follower]] = coupling.ratio * data.qpos[address[coupling.leader]] + coupling.offset


def test_kinematics_gravity_and_springs_agree_with_mujoco_at_random_poses(hand: Hand) -> None:
    model, core = hand.model, HandModel(model_json(hand))
    data = mujoco.MjData(model)
    joints = np.concatenate([finger.joints for finger in hand.fingers])
    dofs = model.jnt_dofadr[joints]
    # Columns of all degrees of freedom as those of the independent joints: q-dot = C qd.
    C = np.zeros((model.nv, len(joints)))
    C[dofs, np.arange(len(joints))] = 1.0
    for coupling in hand.couplings.values():
        leader = int(np.flatnonzero(joints == coupling.leader)[0])
        C[model.jnt_dofadr[coupling.follower], leader] = coupling.ratio
    lower, upper = model.jnt_range[joints].T
    rng, jacobian = np.random.default_rng(1), np.zeros((3, model.nv))
    for _ in range(30):
        q = rng.uniform(lower, upper)
        data.qpos[model.jnt_qposadr[joints]] = q
        followed(hand, data)
        mujoco.mj_forward(model, data)
        tips = np.array([data.geom_xpos[finger.probe] for finger in hand.fingers])
        np.testing.assert_allclose(core.tip_positions(q), tips, atol=1e-9)
        held = C.T @ (data.qfrc_bias - data.qfrc_spring)  # qvel is zero
        own = np.ravel(core.gravity_torque(q)) + np.ravel(core.spring_torque(q))
        np.testing.assert_allclose(own, held, atol=1e-9)
        first = 0
        for index, finger in enumerate(hand.fingers):
            columns = slice(first, first + len(finger.joints))
            first = columns.stop
            point = tips[index] + rng.uniform(-0.01, 0.01, 3)
            mujoco.mj_jac(model, data, jacobian, None, point, int(model.geom_bodyid[finger.probe]))
            np.testing.assert_allclose(core.jacobian(q, index, point), (jacobian @ C)[:, columns], atol=1e-9)


def test_shipped_hand_is_the_papers() -> None:
    spec = json.loads(hand_json(MODELS / "hand.xml"))
    assert [finger["name"] for finger in spec["fingers"]] == ["f0", "f1", "f2", "f3"]
    for finger in spec["fingers"]:
        limits = np.rad2deg([[joint["lower"], joint["upper"]] for joint in finger["joints"]])
        np.testing.assert_allclose(limits, [[-10, 135], [-45, 45], [-10, 170]], atol=1e-9)
        assert finger["tip"]["radius"] == 0.014
        assert sum(joint["mass"] for joint in finger["joints"]) == pytest.approx(0.054)
        assert {(joint["tau_min"], joint["tau_max"]) for joint in finger["joints"]} == {(-0.5, 0.5)}


BAD_HANDS = {
    "slide": ('<joint name="ring_c"', '<joint type="slide" name="ring_c"', "the joint ring_c", "a slide joint"),
    "ball": (
        '<joint name="ring_c" axis="0 -1 0" range="-10 100"',
        '<joint type="ball" name="ring_c" range="0 100"',
        "the joint ring_c",
        "a ball joint",
    ),
    "no range": ('name="ring_c" axis="0 -1 0" range="-10 100"', 'name="ring_c"', "the joint ring_c", "none"),
    "no motor": (
        '<motor joint="ring_b" name="ringb" ctrlrange="-1 1"/>',
        "",
        "the joint ring_b",
        "neither",
    ),
    "no limit": ('name="ringb" ctrlrange="-1 1"', 'name="ringb"', "the motor ringb", "none"),
    "one way": ('name="ringb" ctrlrange="-1 1"', 'name="ringb" ctrlrange="0 1"', "the motor ringb", "0 to 1 N m"),
    "muscle": (
        '<motor joint="ring_b" name="ringb" ctrlrange="-1 1"/>',
        '<muscle joint="ring_b" name="ringb" range="0.8 1.1" lengthrange="0 1"/>',
        "the actuator ringb",
        "a muscle",
    ),
    "adhesion": (
        "</actuator>",
        '<adhesion name="glue" body="pad" ctrlrange="0 1" gain="1"/></actuator>',
        "the actuator glue",
        "one on a body",
    ),
    "strong spring": (
        'name="ring_b" axis="0 0 1"',
        'name="ring_b" axis="0 0 1" stiffness="5"',
        "the joint ring_b",
        "N m of the motor",
    ),
    "other finger": (
        "</actuator>",
        '</actuator><equality><joint name="both" joint1="ring_c" joint2="index_c"/></equality>',
        "the equality both",
        "joints of two",
    ),
    "polynomial": (
        "</actuator>",
        '</actuator><equality><joint name="curve" joint1="ring_c" joint2="ring_a" polycoef="0 1 0.5 0 0"/></equality>',
        "the equality curve",
        "a polynomial",
    ),
    "weld": (
        "</actuator>",
        '</actuator><equality><weld name="chain" body1="pad" body2="world"/></equality>',
        "the equality chain",
        "a weld",
    ),
    "spatial tendon": (
        "</actuator>",
        '<motor name="rope" tendon="rope" ctrlrange="-1 1"/></actuator><tendon><spatial name="rope"><site site="s1"/>'
        '<site site="s2"/></spatial></tendon>',
        "the tendon rope",
        "a spatial one",
    ),
    "tendon spring": (
        "</actuator>",
        '</actuator><tendon><fixed name="band" stiffness="1"><joint joint="ring_a" coef="1"/></fixed></tendon>',
        "the tendon band",
        "1",
    ),
}
PAD = '<body name="pad" pos="0 0 0.001"><geom size="0.002" mass="0.001"/><site name="s2"/></body>'


@pytest.mark.parametrize("case", BAD_HANDS)
def test_what_cannot_be_honoured_is_refused_by_name_with_a_remedy(case: str, tmp_path: Path) -> None:
    old, new, where, found = BAD_HANDS[case]
    text = odd_hand().replace("<worldbody>", '<worldbody><site name="s1"/>')
    place = '<geom name="ring_tip" size="0.011" pos="0 0 -0.003" mass="0.004"/>'
    text = text.replace(place, place + PAD)
    assert old in text
    with pytest.raises(HandError) as error:
        import_hand(written(tmp_path, text.replace(old, new)))
    named = [obstacle for obstacle in error.value.obstacles if obstacle.where == where]
    assert named, error.value
    assert any(found in obstacle.found for obstacle in named), named
    assert all(obstacle.remedy for obstacle in error.value.obstacles)
    assert str(error.value).startswith("odd.xml: ")


def test_all_obstacles_are_named_at_once(tmp_path: Path) -> None:
    with pytest.raises(HandError) as error:
        import_hand(written(tmp_path, odd_hand().replace(' ctrlrange="-1 1"', "")))
    assert len(error.value.obstacles) == 9


def test_a_file_that_is_no_model_is_one_line(tmp_path: Path) -> None:
    path = written(tmp_path, "<mujoco>\n<worldbody>", "broken.xml")
    with pytest.raises(ConfigError, match=r"broken\.xml") as error:
        hand_json(path)
    assert "\n" not in str(error.value)


def test_a_name_that_is_not_utf8_is_read(tmp_path: Path) -> None:
    path = Path(str(tmp_path) + "/h\udce4nd.xml")
    path.write_text(odd_hand())
    assert len(import_hand(path).fingers) == 3
