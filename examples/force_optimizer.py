"""The force optimiser alone, eq. (8): which contact forces lift 0.5 kg with three fingertips round a cylinder."""

import numpy as np

import fingergait as fg

RADIUS, WEIGHT, FRICTION, EDGES = 0.025, 0.5 * 9.81, 0.6, 8

# Contact frames: z along the normal into the object, x and y along the surface.
azimuths = np.deg2rad([0.0, 120.0, 240.0])
points, frames = [], []
for angle in azimuths:
    outward = np.array([np.cos(angle), np.sin(angle), 0.0])
    along = np.array([-np.sin(angle), np.cos(angle), 0.0])
    points.append(RADIUS * outward)
    frames.append(np.column_stack([along, np.cross(-outward, along), -outward]))  # R_WC


def cross(p: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -p[2], p[1]], [p[2], 0.0, -p[0]], [-p[1], p[0], 0.0]])


G = np.hstack([np.vstack([R, cross(p) @ R]) for p, R in zip(points, frames, strict=True)])  # (6, 3n), wrench = G f
J = 0.05 * np.eye(9)  # tau = J^T f: each motor moves one direction of one contact over an arm of 50 mm

# The friction pyramid: a unit of normal force with FRICTION of tangential force in EDGES directions.
around = np.linspace(0.0, 2.0 * np.pi, EDGES, endpoint=False)
edges = np.stack([FRICTION * np.cos(around), FRICTION * np.sin(around), np.ones(EDGES)])
optimizer = fg.ForceOptimizer(np.tile(edges, (3, 1, 1)), alpha=[1e-3, 1e-3, 1.0])

wrench = np.array([0.0, 0.0, WEIGHT, 0.0, 0.0, 0.0])  # [force; torque] in W at the object's centre
limit = np.full(9, 0.5)
solution = optimizer.solve(G, J, wrench, np.zeros(9), -limit, limit)
print(f"{solution.status} by {solution.solver} in {solution.solve_ns / 1e3:.1f} us, KKT residual {solution.kkt:.1e} N")
for azimuth, (fx, fy, fn) in zip(azimuths, solution.f.reshape(3, 3), strict=True):
    print(f"finger at {np.rad2deg(azimuth):3.0f} degrees: normal {fn:.2f} N, friction {np.hypot(fx, fy):.2f} N")
print(f"not delivered: {np.linalg.norm(solution.psi[:3]):.3f} N")
assert np.allclose(G @ solution.f + solution.psi, wrench)

# A motor that gives less: the optimiser delivers what it can and says what is missing.
weak = optimizer.solve(G, J, wrench, solution.f, -0.1 * limit, 0.1 * limit)
print(f"with a tenth of the torque, not delivered: {np.linalg.norm(weak.psi[:3]):.2f} N")
