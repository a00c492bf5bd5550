"""The grasp search: its parts against MuJoCo, closed forms and brute force; what it promises of what it finds."""

import itertools
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import fingergait as fg
from fingergait.adopt import (
    Coupling,
    FingerView,
    Grasp,
    HandView,
    ObjectSpec,
    SearchOptions,
    search_grasps,
    search_object,
    view_of,
)
from fingergait.adopt.clearance import Clearance
from fingergait.adopt.evaluate import Judge
from fingergait.adopt.kinematics import Chain
from fingergait.adopt.library import draw_library
from fingergait.adopt.search import task_frame
from fingergait.adopt.statics import Contacts, Load, Statics, contact_frames, pressing
from fingergait.adopt.stroke import Poses, march, onto_surface, surface
from fingergait.adopt.view import with_probes
from fingergait.hand import import_hand, load_spec
from fingergait.paths import find_hand

SMALL = SearchOptions(
    samples=2048,
    positions=10,
    places_refined=1,
    nearby=4,
    candidates=24,
    judged=24,
    marched=3,
    generations=12,
    refined=1,
)

# Unequal fingers, a joint with a reference angle, one that slides, one that follows another, bodies without joints.
ODD = """
<mujoco><compiler angle="radian"/>
<worldbody>
  <geom name="palm" type="box" size=".05 .05 .01" pos="0 0 -.01"/>
  <body pos=".05 0 0" euler="0 0 .3"><body euler="0 -.4 0">
    <joint name="a1" axis="0 -1 0" range="-.2 1.8" pos="0 0 .002" ref=".1"/>
    <geom type="box" size=".02 .006 .006" pos=".02 0 0"/>
    <body pos=".04 0 0" quat=".9 .1 0 .2">
      <joint name="a2" axis="0 -.6 .8" range="0 1.6"/>
      <geom type="capsule" size=".005" fromto="0 0 0 .03 0 0"/>
      <body pos=".03 0 0"><joint name="a3" axis="0 -1 0" range="0 1.4"/>
        <geom type="capsule" size=".005" fromto="0 0 0 .02 0 0"/>
        <body pos=".02 0 0"><geom name="a_tip" type="sphere" size=".007"/></body>
      </body>
    </body>
  </body></body>
  <body pos="-.05 0 0">
    <joint name="b1" axis="0 1 0" range="-.2 1.5"/>
    <geom type="capsule" size=".005" fromto="0 0 0 -.03 0 .03"/>
    <body pos="-.03 0 .03"><joint name="b2" type="slide" axis="0 0 1" range="-.01 .02"/>
      <geom name="b_tip" type="sphere" size=".008"/></body>
  </body>
</worldbody></mujoco>
"""


def odd_hand() -> HandView:
    """Finger a: two driven joints and a3 = 0.1 + 0.7 a2; finger b: a hinge and a slide."""
    model, probes = with_probes(mujoco.MjSpec.from_string(ODD))
    fingers = []
    for name, driven, follower in (("a", ("a1", "a2"), "a3"), ("b", ("b1", "b2"), "")):
        joints = tuple(int(model.joint(joint).id) for joint in driven)
        lower, upper = model.jnt_range[list(joints)].T
        tip = int(model.geom(f"{name}_tip").id)
        couplings = (Coupling(int(model.joint(follower).id), 1, 0.7, 0.1),) if follower else ()
        fingers.append(
            FingerView(
                name, joints, lower, upper, 0.5 * (lower + upper), np.array([-0.4, -0.2]), np.array([0.5, 0.3]),
                int(model.geom_bodyid[tip]), model.geom_pos[tip].copy(), float(model.geom_size[tip, 0]), (tip,),
                couplings=couplings,
            )
        )  # fmt: skip
    return HandView("odd", model, tuple(fingers), np.array([0.0, 3.0, -9.0]), probes)


@pytest.fixture(scope="module")
def paper() -> HandView:
    return view_of(import_hand(find_hand("hand", "hand.file")))


@pytest.fixture(scope="module")
def three() -> HandView:
    return view_of(import_hand(find_hand("three-by-three", "hand.file")))


def draw(finger: FingerView, count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(finger.lower, finger.upper, (count, finger.n))


@pytest.mark.parametrize("which", ["odd", "paper"])
def test_kinematics_are_mujocos(which: str, paper: HandView) -> None:
    hand = odd_hand() if which == "odd" else paper
    data = mujoco.MjData(hand.model)
    for j, finger in enumerate(hand.fingers):
        chain = Chain(hand.model, finger, hand.links[j])
        q = draw(finger, 20)
        postures, frames = chain.at(q), chain.frames(q)
        point = postures.centre + np.array([0.003, -0.002, 0.001])
        J = chain.jacobian(postures, point)
        for i in range(len(q)):
            rest = [other.reference for other in hand.fingers]
            rest[j] = q[i]
            data.qpos[:] = hand.qpos(rest)
            mujoco.mj_kinematics(hand.model, data)
            mujoco.mj_comPos(hand.model, data)
            R = data.xmat[finger.tip_body].reshape(3, 3)
            np.testing.assert_allclose(
                postures.centre[i], data.xpos[finger.tip_body] + R @ finger.tip_centre, atol=1e-12
            )
            np.testing.assert_allclose(frames.centre[i], data.geom_xpos[list(hand.links[j])], atol=1e-12)
            np.testing.assert_allclose(
                frames.rotation[i].reshape(-1, 9), data.geom_xmat[list(hand.links[j])], atol=1e-12
            )
            full = np.zeros((3, hand.model.nv))
            mujoco.mj_jac(hand.model, data, full, None, point[i], finger.tip_body)
            expected = full[:, hand.model.jnt_dofadr[list(finger.joints)]]
            for follower in finger.couplings:
                expected[:, follower.driver] += follower.ratio * full[:, hand.model.jnt_dofadr[follower.joint]]
            np.testing.assert_allclose(J[i], expected, atol=1e-12)


def test_own_weight_with_a_coupling_is_the_potentials_slope() -> None:
    """tau = dV/dq of the driven joints, by differences; gravity leans."""
    hand = odd_hand()
    statics, data = Statics(hand, Load(0.1, 0.03)), mujoco.MjData(hand.model)

    def potential(q: list[np.ndarray]) -> float:
        data.qpos[:] = hand.qpos(q)
        mujoco.mj_kinematics(hand.model, data)
        return float(-(hand.model.body_mass @ data.xipos @ hand.gravity))

    for j, finger in enumerate(hand.fingers):
        q = [other.reference for other in hand.fingers]
        slope = []
        for i in range(finger.n):
            ends = [[*q[:j], q[j] + sign * 1e-5 * np.eye(finger.n)[i], *q[j + 1 :]] for sign in (1.0, -1.0)]
            slope.append((potential(ends[0]) - potential(ends[1])) / 2e-5)
        np.testing.assert_allclose(statics.own_torque(j, q[j]), slope, atol=1e-9)


@pytest.mark.parametrize("spec", [ObjectSpec("cylinder", (0.03, 0.02), 0.1), ObjectSpec("ball", (0.03,), 0.1),
                                  ObjectSpec("box", (0.02, 0.03, 0.04), 0.1)], ids=str)  # fmt: skip
def test_distance_to_an_object_is_mujocos(spec: ObjectSpec, paper: HandView) -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(-0.07, 0.07, (200, 3))
    distance, normal = spec.distance(points)
    model = mujoco.MjSpec()
    spec.shape.add_to(model, model.worldbody, "object")
    ball = model.worldbody.add_body()
    ball.add_geom(name="point", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[1e-4, 0, 0])
    compiled = model.compile()
    data = mujoco.MjData(compiled)
    mujoco.mj_kinematics(compiled, data)
    a, b = compiled.geom("object").id, compiled.geom("point").id
    for x, d in zip(points, distance, strict=True):
        data.geom_xpos[b] = x
        found = mujoco.mj_geomDistance(compiled, data, a, b, 1.0, None)
        assert found == pytest.approx(d - 1e-4, abs=1e-5 if d > 0.0 else 1e-3)
    step = 1e-7
    slope = [
        (spec.distance(points + step * e)[0] - spec.distance(points - step * e)[0]) / (2 * step) for e in np.eye(3)
    ]
    np.testing.assert_allclose(np.column_stack(slope), normal, atol=1e-5)


def test_clearance_is_that_of_all_pairs(paper: HandView) -> None:
    """Bounding spheres leave out nothing: the same postures are blocked as with every distance measured."""
    spec, options = ObjectSpec("cylinder", (0.028, 0.03), 0.1), SearchOptions()
    library = draw_library(paper, 8, 0)
    clearance = Clearance(paper, spec, library.chains)
    position, asked = np.array([0.005, -0.004, 0.06]), options.asked(0.0)
    model = paper.model
    probe = paper.probes["cylinder"]
    model.geom_size[probe] = (*spec.size, 0.0)
    data = mujoco.MjData(model)
    seen = set()
    for j, finger in enumerate(paper.fingers):
        q = draw(finger, 40, j)
        found = clearance.first_blocked(
            j, library.chains[j].frames(q), np.tile(position, (40, 1)), np.tile(np.eye(3), (40, 1, 1)), [1] * 40, asked
        )
        for row, (_, words) in enumerate(found):
            rest = [other.reference for other in paper.fingers]
            rest[j] = q[row]
            data.qpos[:] = paper.qpos(rest)
            mujoco.mj_kinematics(model, data)
            data.geom_xpos[probe], data.geom_xmat[probe] = position, np.eye(3).ravel()
            links = [g for g in paper.links[j] if g not in finger.tip_geoms]
            near = any(mujoco.mj_geomDistance(model, data, g, probe, 0.1, None) < asked.link for g in links)
            deep = any(mujoco.mj_geomDistance(model, data, g, probe, 0.1, None) < -asked.tip for g in finger.tip_geoms)
            own = any(mujoco.mj_geomDistance(model, data, a, b, 0.1, None) < asked.own for a, b in paper.own[j])
            assert bool(words) == (near or deep or own), words
            seen.add(bool(words))
    assert seen == {True, False}


def test_load_factor_has_its_closed_form() -> None:
    """Four contacts a quarter apart, each component of force on a motor of its own with the lever l, carry weight W.

    All press: N = W / (4 mu) each, so the factor is l W / (4 mu tau). One away: the one opposite can't carry without a
    moment, the two others carry W / 2 each: l W / (2 mu tau).
    """
    hand = view_of(import_hand(find_hand("hand", "hand.file")))
    lever, friction, mass = 0.08, 0.65, 0.3
    statics = Statics(hand, Load(mass, 0.03, friction, 0.0))
    contacts = _ring(statics, lever)
    tau, weight = hand.fingers[0].torque_upper[0], mass * 9.81
    assert statics.holding(contacts, None).factor == pytest.approx(lever * weight / (4 * friction * tau), rel=1e-6)
    for away in range(4):
        assert statics.holding(contacts, away).factor == pytest.approx(lever * weight / (2 * friction * tau), rel=1e-6)


def _ring(statics: Statics, lever: float) -> Contacts:
    angles = np.arange(4) * np.pi / 2
    normal = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(4)])
    R = contact_frames(-normal)
    parts = pressing(0.03 * normal, normal, lever * R.transpose(0, 2, 1), np.zeros((4, 3)), np.zeros((4, 3)))
    # Each joint feels one component in the contact frame.
    return statics.contacts([replace(part, J=lever * np.eye(3)) for part in parts])


@pytest.mark.parametrize("away", [None, 2])
def test_the_qp_delivers_at_the_load_factor_and_not_below(away: int | None, paper: HandView) -> None:
    statics = Statics(paper, Load(0.3, 0.03, 0.65, 0.4))
    contacts = _ring(statics, 0.08)
    factor = statics.holding(contacts, away).factor
    assert statics.excess(contacts, 1.001 * factor, away) < 1e-4
    assert statics.excess(contacts, 0.98 * factor, away) > 1e-3


def test_a_pointed_tip_sticks_to_its_place(paper: HandView) -> None:
    """A tip of radius zero does not roll: in the object's frame it stays where it was."""
    spec = ObjectSpec("cylinder", (0.025, 0.04), 0.3)
    finger = replace(paper.fingers[0], tip_radius=1e-6)
    chain = Chain(paper.model, finger, paper.links[0])
    q = draw(finger, 200)
    poses = Poses(np.tile([0.0, 0.0, 0.05], (len(q), 1)), np.zeros(len(q)), np.eye(3))
    q, touches = onto_surface(spec, chain, q, poses, 1e-3, 0.05, 12)
    q, poses = q[touches], poses.take(np.flatnonzero(touches))
    assert len(q) > 5
    angles = np.linspace(0.0, 0.3, 40)
    for way, sign in zip(march(spec, chain, q, poses, 1e-3, 0.03, angles), (-1.0, 1.0), strict=True):
        start = chain.at(q).centre - poses.position
        assert (way.reach > 0.25).any()
        for row in np.flatnonzero(way.reach > 0.05):
            step = int(np.searchsorted(angles, way.reach[row] + 1e-9)) - 1
            end = chain.at(way.path[row, step][None])
            turned = poses.turned(int(row), np.array([sign * angles[step]]))[0]
            stuck = turned.T @ (end.centre[0] - poses.position[row])
            np.testing.assert_allclose(stuck, start[row], atol=3e-4)
            assert (
                abs(
                    surface(spec, chain, end.centre, poses.take(np.array([row])), 1e-3, sign * angles[step]).distance[0]
                )
                < 2e-4
            )


@pytest.fixture(scope="module")
def found(paper: HandView) -> Grasp:
    grasp = search_object(paper, ObjectSpec("cylinder", (0.025, 0.04), 0.3), SMALL).best
    assert grasp is not None and grasp.kind == "gait"
    return grasp


def test_a_grasp_keeps_its_promises(found: Grasp, paper: HandView) -> None:
    """Judged anew by MuJoCo's distances over the whole stroke and by the LP."""
    options, spec = SMALL, found.object
    judge = Judge(paper, spec, draw_library(paper, 8, 0), task_frame(paper, None), options)
    q, position = tuple(np.array(angles) for angles in found.joints), np.array(found.pose[:3])
    contacts = judge.contacts(q, position, 0.0)
    assert max(found.load, *found.spared) <= options.load_limit + 5e-3
    assert [judge.statics.holding(contacts, j).factor for j in range(4)] == pytest.approx(found.spared)
    assert found.stroke >= options.reserve
    assert found.joint_margin >= 0.05 - 1e-9
    model, probe = paper.model, paper.probes["cylinder"]
    model.geom_size[probe] = (*spec.size, 0.0)
    data = mujoco.MjData(model)
    pose = Poses(position[None], np.zeros(1), judge.frame)
    touches = [judge.touches(j, q[j][None], pose, 1) for j in range(4)]
    step = int(np.searchsorted(options.angles, found.stroke + 1e-9)) - 1
    for ways in itertools.product((0, 1), repeat=4):
        data.qpos[:] = paper.qpos([touch.path[0, way, step] for touch, way in zip(touches, ways, strict=True)])
        mujoco.mj_kinematics(model, data)
        data.geom_xpos[probe], data.geom_xmat[probe] = position, np.eye(3).ravel()
        links = [g for j in range(4) for g in paper.links[j] if g not in paper.fingers[j].tip_geoms]
        assert (
            min(mujoco.mj_geomDistance(model, data, g, probe, 0.1, None) for g in links) > options.link_clearance - 1e-6
        )
        between = [pair for pairs in paper.between.values() for pair in pairs]
        assert min(mujoco.mj_geomDistance(model, data, a, b, 0.1, None) for a, b in between) > options.finger_gap - 1e-6
    assert min(found.reach.ravel()) >= found.stroke - 1e-9


def test_a_grasp_holds_in_mujoco(found: Grasp, paper: HandView) -> None:
    """With the QP's torques, set once, the free object stays within a millimetre for a second; only tips touch it."""
    spec = load_spec(find_hand("hand", "hand.file"))
    body = spec.worldbody.add_body(name="object", pos=found.pose[:3], quat=found.pose[3:])
    body.add_freejoint()
    geom = found.object.shape.add_to(spec, body, "object")
    geom.mass, geom.contype, geom.conaffinity, geom.condim, geom.priority = found.object.mass, 4, 7, 4, 1
    geom.friction, geom.solref, geom.solimp = [1.0, 0.002, 0.0001], [0.005, 1], [0.95, 0.99, 0.0005, 0.5, 2]
    model = spec.compile()
    data = mujoco.MjData(model)
    judge = Judge(paper, found.object, draw_library(paper, 8, 0), task_frame(paper, None), SMALL)
    q, position = tuple(np.array(angles) for angles in found.joints), np.array(found.pose[:3])
    contacts = judge.contacts(q, position, 0.0)
    edges = np.vstack([0.4 * np.cos(np.arange(8) * np.pi / 4), 0.4 * np.sin(np.arange(8) * np.pi / 4), np.ones(8)])
    optimizer = fg.ForceOptimizer(np.tile(edges, (4, 1, 1)), [1e-6, 1.0, 1e6])
    wish = np.tile([0.0, 0.0, 1.5], 4)
    wrench = np.array([0.0, 0.0, 9.81 * found.object.mass, 0.0, 0.0, 0.0])
    limits = np.concatenate([finger.torque_upper for finger in paper.fingers])
    tau = optimizer.solve(contacts.G, contacts.J, wrench, wish, -limits, limits).tau + contacts.own
    names = [paper.model.joint(joint).name for finger in paper.fingers for joint in finger.joints]
    for name, angle in zip(names, np.concatenate(q), strict=True):
        data.joint(name).qpos[:] = angle
    dofs = [int(model.joint(name).dofadr[0]) for name in names]
    touching = set()
    for _ in range(1000):
        data.qfrc_applied[dofs] = tau
        mujoco.mj_step(model, data)
        for contact in data.contact:
            names_ = {model.geom(int(g)).name for g in contact.geom}
            if "object" in names_:
                touching |= names_ - {"object"}
    assert touching == {"f0_tip", "f1_tip", "f2_tip", "f3_tip"}
    assert np.linalg.norm(data.body("object").xpos - position) < 1e-3


def test_a_scenario_starts_from_the_grasp(found: Grasp) -> None:
    values = found.scenario("hand")
    assert values["object"]["shape"] == "cylinder" and values["object"]["size"] == [0.025, 0.04]
    assert len(values["grasp"]["joints"]) == 12 and len(values["object"]["pose"]) == 6


def test_three_fingers_hold_but_spare_none(three: HandView) -> None:
    result = search_object(three, ObjectSpec("cylinder", (0.025, 0.04), 0.2), SMALL)
    assert result.kind == "regrasp" and result.stage == "spare"
    assert "no finger can be spared: two point contacts" in result.reason


@pytest.mark.parametrize(
    ("size", "mass", "stage", "words"),
    [
        ((0.025, 0.04), 3.0, ("hold", "spare"), "times their torque limit at f"),
        ((0.2, 0.04), 0.2, ("room", "reach"), ""),
        ((0.002, 0.001), 0.2, ("reach",), "misses"),
    ],
    ids=["heavy", "wide", "tiny"],
)
def test_what_forbids_is_said(
    paper: HandView, size: tuple[float, float], mass: float, stage: tuple[str, ...], words: str
) -> None:
    result = search_object(
        paper, ObjectSpec("cylinder", size, mass), replace(SMALL, generations=2, positions=4, nearby=1)
    )
    assert result.kind != "gait" and result.stage in stage
    assert result.reason and words in result.reason


def test_the_search_does_not_depend_on_processes(paper: HandView) -> None:
    few = replace(
        SMALL, samples=64, positions=1, nearby=1, candidates=3, judged=2, marched=1, generations=1, offspring=2
    )
    objects = [ObjectSpec("ball", (0.025,), 0.1), ObjectSpec("cylinder", (0.025, 0.04), 0.1)]
    one = search_grasps(paper, objects, few, workers=1, progress=False)
    two = search_grasps(paper, objects, few, workers=2, progress=False)
    assert one.as_json() == two.as_json()


def test_a_wrong_object_is_refused() -> None:
    with pytest.raises(fg.ConfigError, match=r"object\.size: expected 2 lengths > 0 m for a cylinder, found \[0\.02\]"):
        ObjectSpec("cylinder", (0.02,), 0.1)
    with pytest.raises(fg.ConfigError, match="object: expected one of cylinder, ball, box, found 'cone'"):
        ObjectSpec("cone", (0.02,), 0.1)
