"""Parts of the hand that stand in each other."""

import mujoco
import numpy as np

from fingergait.hand.chains import geom_name
from fingergait.hand.obstacle import Notes

_POSTURES = 24
_DEPTH = 1e-3  # m


def part_what_stands_in_each_other(spec: mujoco.MjSpec, model: mujoco.MjModel, notes: Notes) -> None:
    """Excludes pairs of bodies that stand in each other at every posture, and names those that do in mid-range.

    The first is a flaw of the model: the joints between them could never move as the motors say. The second may be one.
    """
    data = mujoco.MjData(model)
    limited = [j for j in range(model.njnt) if model.jnt_limited[j]]
    lower, upper = model.jnt_range[limited].T
    rng = np.random.default_rng(0)
    always: dict[tuple[int, int], float] = {}
    parts: dict[tuple[int, int], tuple[int, int]] = {}
    for posture in range(_POSTURES):
        share = rng.random(len(limited)) if posture else np.full(len(limited), 0.5)
        data.qpos[:] = model.qpos0
        data.qpos[model.jnt_qposadr[limited]] = lower + share * (upper - lower)
        _follow(model, data)
        mujoco.mj_fwdPosition(model, data)
        deep: dict[tuple[int, int], float] = {}
        for contact in data.contact[: data.ncon]:
            if contact.dist < -_DEPTH:
                a, b = (int(g) for g in contact.geom)
                pair = (int(model.geom_bodyid[a]), int(model.geom_bodyid[b]))
                if -contact.dist > deep.get(pair, 0.0):
                    deep[pair] = -float(contact.dist)
                    if posture == 0:
                        parts[pair] = (a, b)
        always = deep if posture == 0 else {pair: d for pair, d in always.items() if pair in deep}
        if posture == 0:
            middle = deep
    for pair, depth in middle.items():
        first, second = (geom_name(model, g) for g in parts[pair])
        where = f"{first} and {second} stand {1e3 * depth:.1f} mm in each other"
        if pair in always:
            bodies = [model.body(body).name for body in pair]
            spec.add_exclude(bodyname1=bodies[0], bodyname2=bodies[1])
            notes.change(f"{where} at every posture: they no longer touch")
        else:
            notes.warn(f"{where} with the joints in mid-range")


def _follow(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Brings joints that follow others to where their equality wants them."""
    for _ in range(2):
        for e in range(model.neq):
            if model.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj2id[e] >= 0:
                follower, leader = (model.jnt_qposadr[int(j)] for j in (model.eq_obj1id[e], model.eq_obj2id[e]))
                turned = data.qpos[leader] - model.qpos0[leader]
                c = model.eq_data[e]
                data.qpos[follower] = model.qpos0[follower] + c[0] + c[1] * turned
