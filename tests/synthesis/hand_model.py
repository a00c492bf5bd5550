"""The shipped hand and its nominal grasp in closed form: an oracle that shares nothing with the hand's MJCF reader."""

import numpy as np

BASE_RADIUS, BASE_HEIGHT = 0.0751, -0.0011  # m, of the first joints
LINKS = (0.052, 0.045)  # m
TIP, OBJECT_RADIUS = 0.014, 0.025  # m
MASSES = (0.030, 0.020, 0.004)  # kg: proximal link, distal link, tip


def grasp(contact_height: float, object_height: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """G (6, 12), J (12, 12) and the joint-space inertia (12, 12), for contacts on a ring around the object.

    Four fingers at 90 degrees, each a planar two-link arm in the plane through the hand's axis (J1 and J3 about the
    tangent) that J2 turns sideways. Heights in m above the palm.
    """
    G, J, M = np.zeros((6, 12)), np.zeros((12, 12)), np.zeros((12, 12))
    for k in range(4):
        here = slice(3 * k, 3 * k + 3)
        c, s = np.cos(k * np.pi / 2), np.sin(k * np.pi / 2)
        outward, tangent, up = np.array([c, s, 0.0]), np.array([-s, c, 0.0]), np.array([0.0, 0.0, 1.0])
        base = BASE_RADIUS * outward + BASE_HEIGHT * up
        tip = (OBJECT_RADIUS + TIP) * outward + contact_height * up
        contact = OBJECT_RADIUS * outward + contact_height * up
        reach = tip - base
        L = np.linalg.norm(reach)
        bend = np.arccos((LINKS[0] ** 2 + L**2 - LINKS[1] ** 2) / (2 * LINKS[0] * L))
        angle = np.arctan2(reach @ up, reach @ outward) - bend  # the knee stands outward
        along = np.cos(angle) * outward + np.sin(angle) * up
        knee = base + LINKS[0] * along
        axes = (-tangent, np.cross(tangent, along), -tangent)
        points = (base, base, knee)
        J[here, here] = np.column_stack([np.cross(a, contact - p) for a, p in zip(axes, points, strict=True)])
        G[:3, here] = np.eye(3)
        arm = contact - object_height * up
        G[3:, here] = [[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]]
        M[here, here] = 5e-5 * np.eye(3)
        distal = (tip - knee) / np.linalg.norm(tip - knee)
        for mass, com, joints, length, line in (
            (MASSES[0], (base + knee) / 2, 2, LINKS[0], along),
            (MASSES[1], (knee + tip) / 2, 3, LINKS[1], distal),
            (MASSES[2], tip, 3, 0.0, distal),
        ):
            linear, angular = np.zeros((3, 3)), np.zeros((3, 3))
            for j in range(joints):
                linear[:, j], angular[:, j] = np.cross(axes[j], com - points[j]), axes[j]
            rod = mass * length**2 / 12 * (np.eye(3) - np.outer(line, line))
            M[here, here] += mass * linear.T @ linear + angular.T @ rod @ angular
    return G, J, M
