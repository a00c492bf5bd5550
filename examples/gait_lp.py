"""The gait LP alone, eq. (4): the joint velocities that raise the grasp quality fastest without leaving the surface."""

import numpy as np

import fingergait as fg
from fingergait.paths import MODELS

hand = fg.HandModel(fg.hand_json(MODELS / "hand.xml"))
q = np.deg2rad([[100.0, 15.0, 40.0]] * 4)  # (n_fingers, n_joints)
finger = 0
tip = hand.tip_positions(q)[finger]
J = hand.jacobian(q, finger, tip)  # (3, n_joints): v = J qd, in W

normal = np.array([-1.0, 0.0, 0.0])  # into the object, where this tip touches it
gradient = np.array([0.0, -0.04, 0.0])  # dQ/dp of the contact, 1/m: here the quality grows towards -y
limit = np.full(3, 1.0)  # rad/s, (4b)

# max (dQ/dp) J qd  subject to  n . J qd = 0  and  |qd| <= limit
solution = fg.gait_lp(gradient @ J, normal @ J, -limit, limit)
print(f"feasible: {solution.feasible}, dQ/dt {solution.value:.5f} 1/s, qd {np.round(solution.x, 3)} rad/s")
print(
    f"the tip moves at {np.round(1e3 * (J @ solution.x), 1)} mm/s, towards the surface at {normal @ J @ solution.x:.1e}"
)

# Against a solver that knows nothing of the problem's structure.
rng = np.random.default_rng(0)
velocities = rng.uniform(-1.0, 1.0, (200_000, 3))
velocities -= np.outer(velocities @ (normal @ J), normal @ J) / np.sum((normal @ J) ** 2)
allowed = velocities[(np.abs(velocities) <= limit).all(axis=1)]
best = (allowed @ (gradient @ J)).max()
print(f"best of {len(allowed)} random velocities: {best:.5f} 1/s")
assert best <= solution.value + 1e-12
