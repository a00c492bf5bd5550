"""The MuJoCo model of a scenario: the hand of the MJCF with the true object on its palm, held by friction only."""

from dataclasses import dataclass
from math import ceil
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait._core import ConfigError
from fingergait.hand import Finger, compile_spec, find_fingers, last_link, load_spec
from fingergait.paths import find
from fingergait.scenario import Scenario

OBJECT = "object"
_FINGERS, _PALM, _OBJECT = 1, 2, 4  # bits of the contact masks, as in models/hand.xml
_TORSION, _ROLLING = 0.002, 0.0001  # m: friction of a rubber tip's contact patch, at a sliding coefficient of 1


@dataclass(frozen=True)
class SceneModel:
    """A compiled scene and where its parts are.

    `q`, `v`: addresses of the finger joints' positions and velocities, finger by finger; `act`: their motors;
    `object_q`: address of the object's pose in qpos; `object_body`: its body; `tips`, `links`: each finger's tip geom
    and last link's body; `touch`: address of each tip's contact sensor; `substeps`: physics steps a control step.
    """

    model: mujoco.MjModel
    fingers: list[Finger]
    q: NDArray[np.intp]
    v: NDArray[np.intp]
    act: NDArray[np.intp]
    object_q: int
    object_body: int
    tips: NDArray[np.intp]
    links: NDArray[np.intp]
    touch: NDArray[np.intp]
    substeps: int

    @property
    def n_joints(self) -> int:
        """Joints of one finger."""
        return len(self.fingers[0].joints)


TOUCH_SIZE = 7  # numbers of one contact sensor: found, force (3) on the object in W, place (3) in W


def build_scene(scenario: Scenario) -> SceneModel:
    """The compiled scene of a scenario."""
    path = find(scenario.hand.file, "", ".xml", "hand.file")
    spec = load_spec(path)
    hand = compile_spec(spec, path.name)
    fingers = find_fingers(hand, path.name)
    _add_object(spec, scenario, hand, fingers[0])
    for finger in fingers:
        spec.add_sensor(
            name=f"{finger.name}_touch",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=hand.geom(finger.tip).name,
            reftype=mujoco.mjtObj.mjOBJ_GEOM,
            refname=OBJECT,
            # Which numbers (found, force, place), one net contact at the force-weighted centre, one slot.
            intprm=[_bits("FOUND", "FORCE", "POS"), 3, 1],
        )
    model = compile_spec(spec, path.name)
    substeps = max(1, ceil(scenario.period / scenario.physics.timestep - 1e-9))
    model.opt.timestep = scenario.period / substeps
    joints = np.array([joint for finger in fingers for joint in finger.joints])
    motors = np.array([motor for finger in fingers for motor in finger.actuators])
    model.dof_damping[model.jnt_dofadr[joints]] *= scenario.truth.joint_damping_scale
    if scenario.truth.motor_lag_s is not None:
        model.actuator_dynprm[motors, 0] = scenario.truth.motor_lag_s
    if (model.actuator_actadr[motors] < 0).any():
        raise ConfigError(
            f"{path.name}: expected motors with a first-order lag (dyntype filterexact), found one without"
        )
    return SceneModel(
        model=model,
        fingers=fingers,
        q=np.asarray(model.jnt_qposadr[joints], dtype=np.intp),
        v=np.asarray(model.jnt_dofadr[joints], dtype=np.intp),
        act=motors.astype(np.intp),
        object_q=int(model.joint(OBJECT).qposadr[0]),
        object_body=int(model.body(OBJECT).id),
        tips=np.array([finger.tip for finger in fingers], dtype=np.intp),
        links=np.array([last_link(model, finger) for finger in fingers], dtype=np.intp),
        touch=np.array([int(model.sensor(f"{finger.name}_touch").adr[0]) for finger in fingers], dtype=np.intp),
        substeps=substeps,
    )


def torque_limits(scene: SceneModel) -> NDArray[np.float64]:
    """Largest torque of each finger joint's motor, (n_fingers, n_joints), N m."""
    ranges = scene.model.actuator_forcerange[scene.act]
    limits: NDArray[np.float64] = np.abs(ranges).min(axis=1)
    return limits.reshape(len(scene.fingers), scene.n_joints)


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


def _add_object(spec: mujoco.MjSpec, scenario: Scenario, hand: mujoco.MjModel, finger: Finger) -> None:
    """Adds the true object as a free body at the origin; its contacts are as stiff as the first fingertip says."""
    truth, shape = scenario.truth, scenario.object.geometry
    body = spec.worldbody.add_body(name=OBJECT)
    body.add_freejoint(name=OBJECT)
    body.mass = scenario.object.mass * truth.mass_scale
    body.ipos = np.array(truth.com_offset)
    body.inertia = true_inertia(scenario)
    body.explicitinertial = True
    geom = shape.add_to(spec, body, OBJECT)
    geom.contype, geom.conaffinity = _OBJECT, _FINGERS | _PALM | _OBJECT
    geom.priority = 1  # so that the contact takes the object's friction and not the larger of the two
    geom.condim = int(hand.geom_condim[finger.tip])
    geom.friction = truth.friction * np.array([1.0, _TORSION, _ROLLING])
    geom.solref = hand.geom_solref[finger.tip]
    geom.solimp = hand.geom_solimp[finger.tip]
    geom.rgba = np.array([0.80, 0.47, 0.25, 1.0])
    mark = body.add_geom(name="object_mark", type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[0.0025, 0.0, 0.0])
    mark.fromto, mark.contype, mark.conaffinity = shape.mark, 0, 0
    mark.rgba, mark.mass = np.array([0.97, 0.97, 0.97, 1.0]), 0.0


def _bits(*names: str) -> int:
    return sum(1 << int(getattr(mujoco.mjtConDataField, f"mjCONDATA_{name}")) for name in names)
