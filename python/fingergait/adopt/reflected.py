"""What the fingers add to an object held in a grasp, by the model: inertia and damping through the contacts.

A finger with more joints than its contact needs moves as its inertia (at once) or damping (in the long run) lets it;
the contact feels (J M^-1 J')^-1 and (J D^-1 J')^-1. With as many joints as directions these are `synthesis.reflect`'s.
"""

import mujoco
import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.grasp import Grasp
from fingergait.adopt.view import FingerView, HandView
from fingergait.synthesis.contact_plant import ReflectedHand

Array = NDArray[np.float64]

_LEAST_DAMPING = 1e-6  # N m s/rad: a joint without any
_RANK = 1e-4  # directions in which a finger gives way less than this share of the easiest it can't follow at all


def reflected(hand: HandView, grasp: Grasp, away: int | None = None) -> ReflectedHand:
    """The fingers' inertia and damping in W at O, (6, 6), at a grasp whose contacts neither slip nor break.

    A direction that a finger can't follow adds nothing: there its contact rolls.

    Parameters
    ----------
    hand, grasp
        The hand, and one of its grasps.
    away
        A finger that does not touch; absent: all do.
    """
    model, data = hand.model, mujoco.MjData(hand.model)
    data.qpos[:] = hand.qpos([np.array(angles) for angles in grasp.joints])
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    inertia, damping = np.zeros((6, 6)), np.zeros((6, 6))
    for j, finger in enumerate(hand.fingers):
        if j == away:
            continue
        place = np.asarray(grasp.places[j])
        full = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, full, None, place, finger.tip_body)
        T = _driven(model, finger)
        J = full @ T
        D = T.T @ (np.diag(model.dof_damping) + _LEAST_DAMPING * np.eye(model.nv)) @ T
        G = np.vstack([np.eye(3), _cross_matrix(place - np.array(grasp.pose[:3]))])
        inertia += G @ _felt(J, T.T @ mass @ T) @ G.T
        damping += G @ _felt(J, D) @ G.T
    return ReflectedHand(0.5 * (inertia + inertia.T), 0.5 * (damping + damping.T))


def _driven(model: mujoco.MjModel, finger: FingerView) -> Array:
    """(nv, n): how all degrees of freedom move with the finger's driven joints."""
    T = np.zeros((model.nv, finger.n))
    for i, joint in enumerate(finger.joints):
        T[model.jnt_dofadr[joint], i] = 1.0
    for follower in finger.couplings:
        T[model.jnt_dofadr[follower.joint], follower.driver] = follower.ratio
    return T


def _felt(J: Array, of_joints: Array) -> Array:
    """(J X^-1 J')^-1, (3, 3), in the directions that the finger can follow."""
    gives: Array = np.linalg.pinv(J @ np.linalg.solve(of_joints, J.T), rcond=_RANK, hermitian=True)
    return gives


def _cross_matrix(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
