"""Joints that follow others by fixed ratios: by an equality of the model, or by a tendon that drives several."""

from dataclasses import dataclass

import mujoco
import numpy as np

from fingergait.hand.chains import Chain
from fingergait.hand.facts import Facts
from fingergait.hand.obstacle import Notes

_STIFF = (0.01, 1.0)  # solref of equalities that the importer adds


@dataclass(frozen=True)
class Coupling:
    """`follower` is at `ratio` times the angle of `leader` plus `offset`, rad. `tendon`: the one that drives both,
    whose equality the importer adds; -1 where the model has one itself. `stated`: by the facts, added too."""

    follower: int
    leader: int
    ratio: float
    offset: float
    tendon: int = -1
    stated: bool = False


def find_couplings(model: mujoco.MjModel, chains: list[Chain], facts: Facts, notes: Notes) -> list[Coupling]:
    """The couplings of all fingers' joints; what can't be one is an obstacle."""
    finger = {joint: k for k, chain in enumerate(chains) for joint in chain.joints}
    couplings = _stated(model, finger, facts, notes)
    for equality in range(model.neq):
        coupling = _equality(model, equality, finger, notes)
        if coupling is not None and coupling.follower in {c.follower for c in couplings}:
            where = f"the joint {model.joint(coupling.follower).name}"
            notes.obstacle(where, "one joint that it follows", "two", "take one of the equalities out")
        elif coupling is not None:
            couplings.append(coupling)
    known = {coupling.follower for coupling in couplings}
    for actuator in range(model.nu):
        if model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_TENDON:
            couplings += _driven(model, int(model.actuator_trnid[actuator, 0]), finger, known, notes)
            known |= {coupling.follower for coupling in couplings}
    for tendon in range(model.ntendon):
        _refuse_spring(model, tendon, finger, notes)
    return couplings


def _stated(model: mujoco.MjModel, finger: dict[int, int], facts: Facts, notes: Notes) -> list[Coupling]:
    """What the facts say."""
    couplings = []
    for name, own in facts.joints.items():
        if own.follows is None:
            continue
        ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, n) for n in (name, own.follows)]
        if ids[0] < 0 or ids[1] < 0 or ids[0] == ids[1] or finger.get(ids[0], -1) != finger.get(ids[1], -2):
            expected = "another joint of the same finger"
            notes.obstacle(f"facts: joints.{name}.follows", expected, repr(own.follows), "correct the name")
        else:
            couplings.append(Coupling(ids[0], ids[1], own.ratio, own.offset, stated=True))
    return couplings


def _equality(model: mujoco.MjModel, equality: int, finger: dict[int, int], notes: Notes) -> Coupling | None:
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_EQUALITY, equality) or f"number {equality}"
    where = f"the equality {name}"
    if not model.eq_active0[equality]:
        notes.warn(f"{where} is not active at the start and is left out")
        return None
    if model.eq_type[equality] != mujoco.mjtEq.mjEQ_JOINT:
        kind = mujoco.mjtEq(int(model.eq_type[equality])).name.removeprefix("mjEQ_").lower()
        joints = [j for j in finger if model.jnt_bodyid[j] in (model.eq_obj1id[equality], model.eq_obj2id[equality])]
        if kind in ("connect", "weld") or joints:
            notes.obstacle(
                where, "equalities between joints only", f"a {kind}", "replace a closed chain by a mimic joint"
            )
        return None
    follower, leader = int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])
    if follower not in finger:
        return None
    data = model.eq_data[equality]
    if leader < 0:
        notes.obstacle(where, "a joint to follow", "none", "hold the joint: [joints.<name>] held = <rad>")
        return None
    if finger.get(leader) != finger[follower]:
        remedy = f"hold one of the two: [joints.{model.joint(follower).name}] held = <rad>"
        notes.obstacle(where, "joints of one finger", "joints of two", remedy)
        return None
    if np.abs(data[2:5]).max() > 1e-9 or data[1] == 0.0:
        notes.obstacle(
            where, "a fixed ratio", f"a polynomial {data[:5].tolist()}", "state its slope at the grasp instead"
        )
        return None
    # MuJoCo: q_f - q0_f = c0 + c1 (q_l - q0_l).
    ratio = float(data[1])
    offset = float(data[0] + model.qpos0[model.jnt_qposadr[follower]] - ratio * model.qpos0[model.jnt_qposadr[leader]])
    return Coupling(follower, leader, ratio, offset)


def _driven(
    model: mujoco.MjModel, tendon: int, finger: dict[int, int], known: set[int], notes: Notes
) -> list[Coupling]:
    """Followers of the first joint of a fixed tendon that drives several."""
    first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    where = f"the tendon {model.tendon(tendon).name or tendon}"
    wraps = range(first, first + count)
    if any(model.wrap_type[w] != mujoco.mjtWrap.mjWRAP_JOINT for w in wraps):
        notes.obstacle(where, "a fixed tendon", "a spatial one", "replace it by motors on its joints, and couple them")
        return []
    joints = [(int(model.wrap_objid[w]), float(model.wrap_prm[w])) for w in wraps]
    joints = [(j, c) for j, c in joints if j in finger]
    if len({finger[j] for j, _ in joints}) > 1:
        notes.obstacle(where, "joints of one finger", "joints of several", "replace it by motors on its joints")
        return []
    free = [(j, c) for j, c in joints if j not in known]
    if len(free) < 2:
        return []
    (leader, share), couplings = free[0], []
    for follower, other in free[1:]:
        ratio = other / share
        at = model.qpos0[model.jnt_qposadr[[follower, leader]]]
        couplings.append(Coupling(follower, leader, ratio, float(at[0] - ratio * at[1]), tendon))
        names = model.joint(follower).name, model.joint(leader).name
        notes.change(f"{where} drives {names[1]} and {names[0]}: {names[0]} follows {names[1]} {ratio:g} to 1")
    return couplings


def _refuse_spring(model: mujoco.MjModel, tendon: int, finger: dict[int, int], notes: Notes) -> None:
    first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    wraps = range(first, first + count)
    fixed = all(model.wrap_type[w] == mujoco.mjtWrap.mjWRAP_JOINT for w in wraps)
    if fixed and not any(int(model.wrap_objid[w]) in finger for w in wraps):
        return
    where = f"the tendon {model.tendon(tendon).name or tendon}"
    for what, value in (
        ("stiffness", model.tendon_stiffness[tendon]),
        ("damping", model.tendon_damping[tendon]),
        ("frictionloss", model.tendon_frictionloss[tendon]),
        ("armature", model.tendon_armature[tendon]),
        ("stiffness polynomial", model.tendon_stiffnesspoly[tendon]),
        ("force limit", model.tendon_actfrclimited[tendon]),
    ):
        if float(np.max(np.abs(value))) > 0.0:
            remedy = f"give its joints {what} of their own, or take it out"
            notes.obstacle(where, f"a tendon without {what}", f"{float(np.max(value)):g}", remedy)
    if model.tendon_limited[tendon]:
        notes.warn(f"{where} has a range, which the controller does not know")


def reflect(couplings: list[Coupling], joint: int) -> float:
    """Torque at the leader for a unit at `joint`: 1 for a joint that follows none."""
    return next((c.ratio for c in couplings if c.follower == joint), 1.0)
