"""Torques that hold the fingers at the start and press their tips against the object."""

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from fingergait.sim.scene import OBJECT, SceneModel

Array = NDArray[np.float64]

_EDGES = 8  # of the friction pyramids
_FRICTION_SHARE = 0.8  # of the true friction, that the start uses
_RIDGE = 1e-3  # against large forces where small ones do
_SHORT = 0.02  # share of the weight that the contacts may fail to carry before the press alone is taken
_RESTS = 1e-4  # m: nearer than this the object lies on what is not a fingertip
_LENGTH = 0.03  # m: what counts a torque against a force


def holding_torques(scene: SceneModel, data: mujoco.MjData, press: float) -> Array:
    """Motor torques (n_q,), N m, that hold the fingers against weight and springs and press each tip with `press`, N.

    Where the object rests on something, each tip presses horizontally towards its middle. Where nothing is below it,
    the tips press along their normals and add the smallest forces within the friction cones that carry its weight.
    """
    model = scene.model
    mujoco.mj_forward(model, data)
    torque = independent(scene, data.qfrc_bias - data.qfrc_spring)
    forces = _carrying(scene, data, press)
    if forces is None:
        inward = data.xpos[scene.object_body] - data.geom_xpos[scene.tips]  # (n, 3)
        inward[:, 2] = 0.0  # so that the fingers together neither lift nor push down
        forces = press * inward / np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-9)
    jacobian = np.zeros((3, model.nv))
    for index, finger in enumerate(scene.fingers):
        own, centre = scene.joints[index], data.geom_xpos[finger.probe]
        mujoco.mj_jac(model, data, jacobian, None, centre, int(model.geom_bodyid[finger.probe]))
        torque[own] += independent(scene, jacobian)[:, own].T @ forces[index]
    return torque


def independent(scene: SceneModel, columns: Array) -> Array:
    """Columns (..., nv) of all joints as those (..., n_q) of the independent ones, which move their followers."""
    dofs = scene.model.jnt_dofadr
    out: Array = columns[..., scene.v].copy()
    place = {int(dof): k for k, dof in enumerate(scene.v)}
    for coupling in scene.hand.couplings.values():
        leader, ratio = coupling.leader, coupling.ratio
        while leader in scene.hand.couplings:
            ratio, leader = ratio * scene.hand.couplings[leader].ratio, scene.hand.couplings[leader].leader
        out[..., place[int(dofs[leader])]] += ratio * columns[..., dofs[coupling.follower]]
    return out


def _carrying(scene: SceneModel, data: mujoco.MjData, press: float) -> Array | None:
    """Forces (n, 3) in W of the tips that carry the object; None where it rests on something, or they cannot."""
    model, object_geom = scene.model, int(scene.model.geom(OBJECT).id)
    tips = {finger.tip for finger in scene.fingers}
    others = [g for g in range(model.ngeom) if model.geom_contype[g] and g not in tips and g != object_geom]
    near = (mujoco.mj_geomDistance(model, data, g, object_geom, 0.1, None) for g in others)
    if min(near, default=1.0) < _RESTS:
        return None
    weight = -model.body_mass[scene.object_body] * model.opt.gravity
    if not np.any(weight):
        return None
    com = data.xipos[scene.object_body]
    normals, columns = [], []
    for finger in scene.fingers:
        fromto = np.zeros(6)
        mujoco.mj_geomDistance(model, data, finger.probe, object_geom, 0.1, fromto)
        place, normal = fromto[3:], fromto[3:] - data.geom_xpos[finger.probe]
        normal = normal / max(float(np.linalg.norm(normal)), 1e-9)
        normals.append(normal)
        side = np.linalg.svd(normal[None])[2][1:]  # two tangents
        friction = _FRICTION_SHARE * float(model.geom_friction[object_geom, 0])
        for angle in np.arange(_EDGES) * 2.0 * np.pi / _EDGES:
            edge = normal + friction * (np.cos(angle) * side[0] + np.sin(angle) * side[1])
            columns.append((edge, np.cross(place - com, edge) / _LENGTH))
    edges = np.array([edge for edge, _ in columns])  # (n e, 3)
    G = np.array([np.concatenate(column) for column in columns]).T  # (6, n e)
    # Each tip presses at least so much: spread over its edges it is a force along the normal.
    base = np.full(G.shape[1], press / _EDGES)
    wanted = np.concatenate([weight, np.zeros(3)]) - G @ base
    more, _ = nnls(np.vstack([G, _RIDGE * np.eye(G.shape[1])]), np.concatenate([wanted, np.zeros(G.shape[1])]))
    if np.linalg.norm(G @ more - wanted) > _SHORT * np.linalg.norm(weight):
        return None
    forces: Array = ((base + more)[:, None] * edges).reshape(len(scene.fingers), _EDGES, 3).sum(axis=1)
    return forces
