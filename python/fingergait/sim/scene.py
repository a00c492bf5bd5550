"""The MuJoCo model of a scenario: the hand of the MJCF with the true object on its palm, held by friction only."""

from dataclasses import dataclass
from math import ceil
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait._core import ConfigError
from fingergait.hand import OURS, Finger, Hand, compile_spec, import_hand, last_link
from fingergait.paths import find_hand
from fingergait.scenario import Scenario

OBJECT = f"{OURS}_object"
SUPPORT = f"{OURS}_support"
_TORSION, _ROLLING = 0.002, 0.0001  # m: friction of a rubber tip's contact patch, at a sliding coefficient of 1


@dataclass(frozen=True)
class SceneModel:
    """A compiled scene and where its parts are.

    `hand`: what the importer made of the hand's file. `q`, `v`: addresses of the independent joints' positions and
    velocities, finger by finger; `act`: their motors; `joints`: where each finger's are in these. `object_q`: address
    of the object's pose in qpos; `object_body`: its body; `tips`: the sphere that stands for each fingertip;
    `links`: each finger's last link's body; `touch`: address of each tip's contact sensor; `substeps`: physics steps a
    control step.
    """

    model: mujoco.MjModel
    hand: Hand
    q: NDArray[np.intp]
    v: NDArray[np.intp]
    act: NDArray[np.intp]
    joints: list[slice]
    object_q: int
    object_body: int
    tips: NDArray[np.intp]
    links: NDArray[np.intp]
    touch: NDArray[np.intp]
    substeps: int

    @property
    def fingers(self) -> tuple[Finger, ...]:
        """The hand's fingers."""
        return self.hand.fingers

    @property
    def counts(self) -> list[int]:
        """Independent joints of each finger."""
        return [len(finger.joints) for finger in self.hand.fingers]


TOUCH_SIZE = 7  # numbers of one contact sensor: found, force (3) on the object in W, place (3) in W


def hand_of(scenario: Scenario) -> Hand:
    """The hand that a scenario names, with its facts, where the scenario puts it."""
    facts = find_hand(scenario.hand.facts, "hand.facts") if scenario.hand.facts is not None else None
    return import_hand(find_hand(scenario.hand.file, "hand.file"), facts, scenario.hand.pose)


def build_scene(scenario: Scenario) -> SceneModel:
    """The compiled scene of a scenario."""
    hand = hand_of(scenario)
    spec, fingers = hand.spec, hand.fingers
    _add_object(spec, scenario, hand)
    for number, finger in enumerate(fingers):
        spec.add_sensor(
            name=f"{OURS}_touch_{number}",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=hand.model.geom(finger.tip).name,
            reftype=mujoco.mjtObj.mjOBJ_GEOM,
            refname=OBJECT,
            # Which numbers (found, force, place), one net contact at the force-weighted centre, one slot.
            intprm=[_bits("FOUND", "FORCE", "POS"), 3, 1],
        )
    model = compile_spec(spec, hand.source)
    substeps = max(1, ceil(scenario.period / scenario.physics.timestep - 1e-9))
    model.opt.timestep = scenario.period / substeps
    joints = np.array([joint for finger in fingers for joint in finger.joints])
    links = np.array([joint for finger in fingers for joint in finger.links])
    motors = np.array([motor for finger in fingers for motor in finger.actuators])
    model.dof_damping[model.jnt_dofadr[links]] *= scenario.truth.joint_damping_scale
    lagging = model.actuator_dyntype[motors] == mujoco.mjtDyn.mjDYN_FILTEREXACT
    if scenario.truth.motor_lag_s is not None:
        if not lagging.all():
            raise ConfigError(
                "truth.motor_lag_s: expected motors with a lag, found some without; write in the facts file: lag = <s>"
            )
        model.actuator_dynprm[motors, 0] = scenario.truth.motor_lag_s
    ends = np.cumsum([len(finger.joints) for finger in fingers]).tolist()
    return SceneModel(
        model=model,
        hand=hand,
        q=np.asarray(model.jnt_qposadr[joints], dtype=np.intp),
        v=np.asarray(model.jnt_dofadr[joints], dtype=np.intp),
        act=motors.astype(np.intp),
        joints=[slice(end - len(finger.joints), end) for finger, end in zip(fingers, ends, strict=True)],
        object_q=int(model.joint(OBJECT).qposadr[0]),
        object_body=int(model.body(OBJECT).id),
        tips=np.array([finger.probe for finger in fingers], dtype=np.intp),
        links=np.array([last_link(model, finger) for finger in fingers], dtype=np.intp),
        touch=np.array([int(model.sensor(f"{OURS}_touch_{k}").adr[0]) for k in range(len(fingers))], dtype=np.intp),
        substeps=substeps,
    )


def torque_limits(scene: SceneModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and largest torque of each independent joint's motor, each (n_q,), N m."""
    low, high = scene.model.actuator_forcerange[scene.act].T
    return low.copy(), high.copy()


def contact_friction(mu: float) -> NDArray[np.float64]:
    """Sliding, torsional and rolling friction (3,) of the object's contacts at the sliding coefficient `mu`."""
    return mu * np.array([1.0, _TORSION, _ROLLING])


def set_mass(scene: SceneModel, mass: float) -> None:
    """Gives the true object another mass, kg, while the simulation goes on; its moments of inertia stay."""
    scene.model.body_mass[scene.object_body] = mass
    mujoco.mj_setConst(scene.model, mujoco.MjData(scene.model))  # the state of the run is not touched


def true_inertia(scenario: Scenario) -> NDArray[np.float64]:
    """Principal moments (3,) of the true object, kg m^2; refuses moments that no body can have."""
    inertia: NDArray[np.float64] = scenario.object.geometry.inertia(scenario.object.mass)
    inertia = inertia * np.asarray(scenario.truth.inertia_scale)
    if 2.0 * inertia.max() > inertia.sum():
        found = ", ".join(f"{x:.3g}" for x in inertia)
        raise ConfigError(
            f"truth.inertia_scale: expected moments of which none exceeds the other two together, found {found} kg m^2"
        )
    return inertia


def settings(scene: SceneModel, scenario: Scenario) -> dict[str, Any]:
    """The simulator's version and contact settings, printed with every result."""
    model = scene.model
    geom = model.geom(OBJECT)
    return {
        "mujoco": mujoco.mj_versionString(),
        "timestep_s": model.opt.timestep,
        "integrator": mujoco.mjtIntegrator(int(model.opt.integrator)).name.removeprefix("mjINT_").lower(),
        "solver": mujoco.mjtSolver(int(model.opt.solver)).name.removeprefix("mjSOL_").lower(),
        "cone": mujoco.mjtCone(int(model.opt.cone)).name.removeprefix("mjCONE_").lower(),
        "impratio": float(model.opt.impratio),
        "noslip_iterations": int(model.opt.noslip_iterations),
        "condim": int(geom.condim[0]),
        "friction": [float(x) for x in geom.friction],
        "solref": [float(x) for x in geom.solref],
        "solimp": [float(x) for x in geom.solimp],
    }


def _add_object(spec: mujoco.MjSpec, scenario: Scenario, hand: Hand) -> None:
    """Adds the true object as a free body, and the support if there is one.

    Its contacts are as stiff as the first fingertip says, and it touches each part of the hand that can touch anything.
    """
    truth, shape, tip = scenario.truth, scenario.object.geometry, hand.fingers[0].tip
    model = hand.model
    body = spec.worldbody.add_body(name=OBJECT)
    body.add_freejoint(name=OBJECT)
    body.mass = scenario.object.mass * truth.mass_scale
    body.ipos = np.array(truth.com_offset)
    body.inertia = true_inertia(scenario)
    body.explicitinertial = True
    geom = shape.add_to(spec, body, OBJECT)
    types = int(np.bitwise_or.reduce(model.geom_contype)) or 1
    geom.contype, geom.conaffinity = int(np.bitwise_or.reduce(model.geom_conaffinity)) or 1, types
    geom.priority = 1  # so that the contact takes the object's friction and not the larger of the two
    geom.condim = max(4, int(model.geom_condim[tip]))
    geom.friction = contact_friction(truth.friction)
    geom.solref = model.geom_solref[tip]
    geom.solimp = model.geom_solimp[tip]
    geom.rgba = np.array([0.80, 0.47, 0.25, 1.0])
    mark = body.add_geom(name=f"{OBJECT}_mark", type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[0.0025, 0.0, 0.0])
    mark.fromto, mark.contype, mark.conaffinity = shape.mark, 0, 0
    mark.rgba, mark.mass = np.array([0.97, 0.97, 0.97, 1.0]), 0.0
    if scenario.support.height is not None:
        # In a body of its own, behind all others: the ids of the hand's parts stay what they are.
        stand = spec.worldbody.add_body(name=SUPPORT, pos=[*scenario.support.position, scenario.support.height])
        tilt = np.deg2rad([*scenario.support.tilt_deg, 0.0])
        angle = float(np.linalg.norm(tilt))
        if angle > 0.0:
            mujoco.mju_axisAngle2Quat(stand.quat, tilt / angle, angle)
        table = stand.add_geom(
            name=SUPPORT, type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.15, 0.15, 0.01], pos=[0.0, 0.0, -0.01]
        )
        table.contype, table.conaffinity = types, types
        table.friction, table.condim = [1.0, _TORSION, _ROLLING], geom.condim
        table.solref, table.solimp = geom.solref, geom.solimp
        if scenario.support.softness != 1.0:
            # The time constant of a contact goes with the root of its softness; the table's own is taken.
            table.solref = geom.solref * np.array([scenario.support.softness**0.5, 1.0])
            table.priority, table.friction = 2, geom.friction
        table.rgba = np.array([0.75, 0.75, 0.72, 1.0])


def _bits(*names: str) -> int:
    return sum(1 << int(getattr(mujoco.mjtConDataField, f"mjCONDATA_{name}")) for name in names)
