"""The pose error of the paper, from true and desired poses: e = [p_D - p_O; log(R_D R_O^T)] in W."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def pose_errors(true: Array, desired: Array) -> Array:
    """Errors (T, 6), m and rad, of the poses (T, 7)."""
    w, v = _relative(true, desired)
    norm = np.linalg.norm(v, axis=1)
    angle = 2.0 * np.arctan2(norm, np.abs(w))
    scale = np.where(norm > 1e-9, angle / np.maximum(norm, 1e-9), 2.0) * np.where(w < 0.0, -1.0, 1.0)
    return np.hstack([desired[:, :3] - true[:, :3], scale[:, None] * v])


def yaw_reached(true: Array) -> Array:
    """Net turn (T,) of the poses (T, 7) about the vertical since the first, rad, counted over whole turns.

    It is the twist part of the rotation R R_0^T about z, which for R = R_y(swing) R_z(yaw) R_0 is the yaw itself.
    """
    first = np.broadcast_to(true[:1], true.shape)
    w, v = _relative(first, true)
    yaw: Array = np.unwrap(2.0 * np.arctan2(v[:, 2], w))
    yaw -= yaw[0].copy()
    return yaw


def _relative(a: Array, b: Array) -> tuple[Array, Array]:
    """Scalar (T,) and vector part (T, 3) of q_b q_a^-1."""
    wa, va, wb, vb = a[:, 3], -a[:, 4:], b[:, 3], b[:, 4:]
    w = wb * wa - np.einsum("ti,ti->t", vb, va)
    v = wb[:, None] * va + wa[:, None] * vb + np.cross(vb, va)
    return w, v
