"""The sphere that stands for a fingertip: fitted to the part of it that can touch an object."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_CAP = 0.5  # the cap's height as a share of the sphere's radius: beyond, a tip is not used
_POINTS = 2000


@dataclass(frozen=True)
class TipSphere:
    """Centre (3,) in the frame of the tip's body, radius, and the largest distance of the touching part from it, m."""

    centre: Array
    radius: float
    error: float


def fit_tip(model: mujoco.MjModel, geom: int, joint: int) -> TipSphere:
    """The sphere that fits the outer cap of `geom`, away from the last joint before it.

    Spheres and capsules are exact. Other shapes are sampled on their surface: a sphere is fitted by least squares to
    the points within half of its radius of the outermost one, along the line from the joint, until it stands still.
    """
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    position, rotation = model.geom_pos[geom].copy(), _matrix(model.geom_quat[geom])
    outward = _outward(model, geom, joint)
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return TipSphere(position, float(size[0]), 0.0)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        axis = rotation[:, 2]
        side = 1.0 if axis @ outward >= 0.0 else -1.0
        return TipSphere(position + side * size[1] * axis, float(size[0]), 0.0)
    points = position + _surface(model, geom, kind, size) @ rotation.T
    return _fit_cap(points, outward)


def _fit_cap(points: Array, outward: Array) -> TipSphere:
    heights = points @ outward
    top = float(heights.max())
    radius = 0.25 * float(np.ptp(points, axis=0).max())
    centre, cap = points[int(heights.argmax())] - radius * outward, points
    for _ in range(30):
        cap = points[heights > top - _CAP * radius]
        if len(cap) < 8:
            cap = points[np.argsort(heights)[-8:]]
        solution, *_ = np.linalg.lstsq(
            np.hstack([2.0 * cap, np.ones((len(cap), 1))]), (cap * cap).sum(axis=1), rcond=None
        )
        found = solution[:3]
        square = float(solution[3] + found @ found)
        # A flat end fits a sphere of any size: none larger than the part itself.
        new = min(float(np.sqrt(max(square, 1e-12))), 0.5 * float(np.ptp(points, axis=0).max()))
        if abs(new - radius) < 1e-7:
            break
        radius, centre = 0.5 * (radius + new), found
    distances = np.linalg.norm(cap - centre, axis=1)
    if abs(float(np.median(distances)) - radius) > 0.2 * radius:
        centre = cap.mean(axis=0) - radius * outward + outward * 0.5 * _CAP * radius
        distances = np.linalg.norm(cap - centre, axis=1)
    return TipSphere(centre, radius, float(np.abs(distances - radius).max()))


def _outward(model: mujoco.MjModel, geom: int, joint: int) -> Array:
    """Unit vector (3,) in the frame of the geom's body from the last joint to the geom's middle."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body = int(model.geom_bodyid[geom])
    away = data.geom_xpos[geom] - data.xanchor[joint]
    away = data.xmat[body].reshape(3, 3).T @ away
    norm = float(np.linalg.norm(away))
    return away / norm if norm > 1e-9 else np.array([0.0, 0.0, 1.0])


def _matrix(quaternion: Array) -> Array:
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, quaternion)
    return out.reshape(3, 3)


def _surface(model: mujoco.MjModel, geom: int, kind: int, size: Array) -> Array:
    """Points (n, 3) on the surface of a geom in its own frame."""
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        vertices = np.asarray(model.mesh_vert[first : first + count], dtype=float)
        # Only the hull touches.
        start, end = int(model.mesh_graphadr[mesh]), None
        if start >= 0:
            number = int(model.mesh_graph[start])
            ids = np.asarray(model.mesh_graph[start + 2 + number : start + 2 + 2 * number])
            vertices = vertices[ids] if end is None else vertices
        return vertices
    # A sunflower's directions, projected onto the shape.
    k = np.arange(_POINTS) + 0.5
    z, turn = 1.0 - 2.0 * k / _POINTS, np.pi * (1.0 + 5.0**0.5) * k
    ring = np.sqrt(1.0 - z * z)
    directions = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return np.asarray(directions * size)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return np.asarray(directions / np.abs(directions / size).max(axis=1, keepdims=True))
    radial = np.linalg.norm(directions[:, :2], axis=1, keepdims=True)
    height = np.abs(directions[:, 2:])
    return np.asarray(directions / np.maximum(radial / size[0], height / size[1]))
