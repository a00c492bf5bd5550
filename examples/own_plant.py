"""A plant of one's own under the compiled planner: rigid bodies in NumPy, without a physics engine.

What hardware has to give is the same: `reset` and `step` with a `Measurement`, see `fingergait.Plant`. The toy has
point contacts with springs and Coulomb friction, a diagonal mass matrix, ideal motors and an even floor.
"""

import json

import numpy as np

import fingergait as fg
from fingergait.paths import MODELS

MASS, RADIUS, HALF_HEIGHT, FRICTION = 0.55, 0.025, 0.06, 0.9  # of the true object; the planner assumes 0.5 kg, 0.65
STIFFNESS, DAMPING = 6000.0, 15.0  # of every contact, N/m and N s/m
JOINT = ("position", "quaternion", "anchor", "axis", "lower", "upper", "damping")  # what the model says of each
JOINT_INERTIA = np.array([2e-4, 1.5e-4, 7e-5])  # kg m^2
GRAVITY, PERIOD, SUBSTEPS = 9.81, 0.002, 4
RIM = np.array(
    [[RADIUS, 0, -HALF_HEIGHT], [-RADIUS, 0, -HALF_HEIGHT], [0, RADIUS, -HALF_HEIGHT], [0, -RADIUS, -HALF_HEIGHT]]
)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products (..., 3); `np.cross` is slow on small arrays."""
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]


def skew(v: np.ndarray) -> np.ndarray:
    """The matrices (..., 3, 3) of the cross products with v (..., 3)."""
    zero = np.zeros(v.shape[:-1])
    x, y, z = np.moveaxis(v, -1, 0)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*v.shape, 3)


def rotation(axis_skew: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of angles (...), rad, about unit axes, given as `skew(axis)`."""
    sine, versine = np.sin(angle)[..., None, None], (1.0 - np.cos(angle))[..., None, None]
    return np.eye(3) + sine * axis_skew + versine * axis_skew @ axis_skew


def matrix(q: np.ndarray) -> np.ndarray:
    """The rotation matrix of a quaternion wxyz."""
    norm = np.linalg.norm(q[1:])
    return rotation(skew(q[1:] / max(norm, 1e-12)), 2.0 * np.arctan2(norm, q[0]))


def quaternion(R: np.ndarray) -> np.ndarray:
    """The quaternion wxyz of a rotation matrix."""
    values, vectors = np.linalg.eigh(
        [
            [R[0, 0] - R[1, 1] - R[2, 2], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[2, 1] - R[1, 2]],
            [R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], R[1, 2] + R[2, 1], R[0, 2] - R[2, 0]],
            [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1], R[1, 0] - R[0, 1]],
            [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], np.trace(R)],
        ]
    )
    x, y, z, w = vectors[:, -1]
    return np.array([w, x, y, z])


class ToyPlant:
    """A cylinder in a hand of any number of fingers, by springs and semi-implicit Euler steps."""

    def __init__(self, hand_json: str) -> None:
        fingers = json.loads(hand_json)["fingers"]
        self.model = fg.HandModel(hand_json)
        self.n, self.m = self.model.n_fingers, self.model.n_joints
        self.tip_radius = np.array([finger["tip"]["radius"] for finger in fingers])
        self.tip = np.array([finger["tip"]["position"] for finger in fingers])
        joints = {key: np.array([[joint[key] for joint in finger["joints"]] for finger in fingers]) for key in JOINT}
        self.position, self.anchor, self.axis = joints["position"], joints["anchor"], joints["axis"]  # (n, m, 3)
        self.joint_damping, self.lower, self.upper = joints["damping"], joints["lower"], joints["upper"]  # (n, m)
        self.frame = np.array([[matrix(quaternion) for quaternion in finger] for finger in joints["quaternion"]])
        self.axis_skew = skew(self.axis)
        self.inertia = MASS * np.array([(3.0 * RADIUS**2 + 4.0 * HALF_HEIGHT**2) / 12.0] * 2 + [0.5 * RADIUS**2])

    def forward(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Tip centres (n, 3), orientations of the tips (n, 3, 3), joint axes and anchors (n, m, 3), all in W."""
        p, R = np.zeros((self.n, 3, 1)), np.eye(3)
        axes, anchors = np.empty((self.n, self.m, 3)), np.empty((self.n, self.m, 3))
        turns = rotation(self.axis_skew, q)
        for i in range(self.m):
            p = p + R @ self.position[:, i, :, None]
            R = R @ self.frame[:, i]
            anchor = p + R @ self.anchor[:, i, :, None]
            axes[:, i], anchors[:, i] = (R @ self.axis[:, i, :, None])[..., 0], anchor[..., 0]
            R = R @ turns[:, i]
            p = anchor - R @ self.anchor[:, i, :, None]
        return (p + R @ self.tip[:, :, None])[..., 0], R, axes, anchors

    def reset(self) -> fg.Measurement:
        """The object on the floor and every tip pressing it lightly at half its height."""
        self.t, self.R = 0.0, np.eye(3)
        self.p = np.array([0.0, 0.0, HALF_HEIGHT])
        self.twist, self.stretch = np.zeros(6), np.zeros((self.n, 3))
        self.q, self.qd = 0.5 * (self.lower + self.upper), np.zeros((self.n, self.m))
        bases = self.forward(self.q)[3][:, 0]
        outward = bases * [1.0, 1.0, 0.0] / np.linalg.norm(bases[:, :2], axis=1)[:, None]
        target = self.p + (RADIUS + self.tip_radius - 1e-4)[:, None] * outward
        for _ in range(100):  # inverse kinematics: damped Gauss-Newton steps
            error = target - self.model.tip_positions(self.q)
            for j in range(self.n):
                J = self.model.jacobian(self.q, j, target[j] - error[j])
                self.q[j] += np.clip(J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(3), error[j]), -0.3, 0.3)
        hold = self.model.gravity_torque(self.q)
        press = [0.5 * self.model.jacobian(self.q, j, target[j]).T @ -outward[j] for j in range(self.n)]
        self.tau = hold + np.array(press)
        for _ in range(25 * SUBSTEPS):
            self._advance()
        return self._measure()

    def step(self, command: fg.Command) -> fg.Measurement:
        """Applies the torques for one control period."""
        self.tau = command.tau
        for _ in range(SUBSTEPS):
            self._advance()
        self.t += PERIOD
        return self._measure()

    def close(self) -> None:
        """Nothing to release."""

    def _advance(self) -> None:
        """One physics step."""
        dt = PERIOD / SUBSTEPS
        tips, self.frames, axes, anchors = self.forward(self.q)
        in_object = (tips - self.p) @ self.R
        in_object[:, 2] = 0.0  # the side of the cylinder: the normal is radial
        distance = np.linalg.norm(in_object, axis=1)
        self.normal = -(in_object / distance[:, None]) @ self.R.T  # into the object, in W
        depth = RADIUS + self.tip_radius - distance
        place = tips + self.tip_radius[:, None] * self.normal
        jacobian = cross(axes, place[:, None] - anchors)  # (n, m, 3)
        arm = place - self.p
        slide = np.einsum("jmx,jm->jx", jacobian, self.qd) - self.twist[:3] - cross(self.twist[3:], arm)
        approach = np.sum(slide * self.normal, axis=1)
        self.force = np.where(depth > 0.0, np.maximum(STIFFNESS * depth + DAMPING * approach, 0.0), 0.0)
        slide -= approach[:, None] * self.normal

        # Friction: a spring between tip and surface that slips where it would pull more than the cone allows.
        self.stretch -= np.sum(self.stretch * self.normal, axis=1)[:, None] * self.normal
        self.stretch += dt * slide
        friction = STIFFNESS * self.stretch + DAMPING * slide
        size = np.maximum(np.linalg.norm(friction, axis=1), 1e-12)
        scale = np.minimum(1.0, FRICTION * self.force / size)
        friction *= scale[:, None]
        self.stretch *= scale[:, None]
        on_object = self.force[:, None] * self.normal + friction

        joint = self.tau - self.model.gravity_torque(self.q) - np.einsum("jmx,jx->jm", jacobian, on_object)
        self.qd = (JOINT_INERTIA * self.qd + dt * joint) / (JOINT_INERTIA + dt * self.joint_damping)
        self.q = self.q + dt * self.qd

        force, torque = on_object.sum(axis=0), cross(arm, on_object).sum(axis=0)
        rim = RIM @ self.R.T
        speed = self.twist[2] + cross(self.twist[3:], rim)[:, 2]
        height = self.p[2] + rim[:, 2]
        floor = np.where(height < 0.0, np.maximum(-STIFFNESS * height - DAMPING * speed, 0.0), 0.0)
        force = force + [0.0, 0.0, floor.sum() - MASS * GRAVITY]
        torque = torque + cross(rim, floor[:, None] * np.array([0.0, 0.0, 1.0])).sum(axis=0)
        inertia = self.R @ np.diag(self.inertia) @ self.R.T
        turn = self.twist[3:]
        self.twist[:3] += dt * force / MASS
        self.twist[3:] += dt * np.linalg.solve(inertia, torque - cross(turn, inertia @ turn))
        self.p = self.p + dt * self.twist[:3]
        angle = np.linalg.norm(self.twist[3:])
        if angle > 0.0:
            self.R = rotation(skew(self.twist[3:] / angle), dt * angle) @ self.R

    def _measure(self) -> fg.Measurement:
        """Angles, torques, the pose, and where and how hard each tip is touched: nothing else."""
        touching = (self.force > 0.0)[:, None]
        place = np.einsum("jxy,jx->jy", self.frames, self.tip_radius[:, None] * self.normal)  # in the tip's frame
        pose = np.concatenate([self.p, quaternion(self.R)])
        return fg.Measurement(self.t, self.q, self.tau, pose, np.where(touching, place, 0.0), self.force)


def main(seconds: float = 6.0) -> None:
    """Lifts the cylinder by 10 mm and turns it."""
    hand_json = fg.hand_json(MODELS / "hand.xml")
    plant: fg.Plant = ToyPlant(hand_json)
    controller = fg.Controller((MODELS / "controllers" / "mu.json").read_text(encoding="utf-8"))
    planner = fg.DualStagePlanner(fg.HandModel(hand_json), controller)

    measurement = plant.reset()
    start, gaits, worst = plant.p.copy(), 0, 0.0
    walking = None
    for k in range(round(seconds / PERIOD)):
        t = k * PERIOD
        s = min(t / 1.0, 1.0)
        since, rate = max(0.0, t - 1.5), 0.3 if t > 1.5 else 0.0
        yaw, height = 0.3 * since, 0.010 * s * s * (3.0 - 2.0 * s)
        desired = [*(start + [0.0, 0.0, height]), np.cos(yaw / 2.0), 0.0, 0.0, np.sin(yaw / 2.0)]
        climb = 0.060 * s * (1.0 - s)
        command, diagnostics = planner.step(measurement, fg.Reference(desired, [0.0, 0.0, climb, 0.0, 0.0, rate]))
        gaits += diagnostics.free_finger is not None and walking is None
        walking = diagnostics.free_finger
        worst = max(worst, float(np.linalg.norm(plant.p - desired[:3])))
        measurement = plant.step(command)
        if k % 500 == 499:
            turned = np.rad2deg(np.arctan2(plant.R[1, 0], plant.R[0, 0]))
            print(f"{t + PERIOD:4.1f} s: turned by {turned:6.1f} degrees, {gaits} gaits, {diagnostics.safe_mode}")
    plant.close()
    print(f"largest position error {1e3 * worst:.2f} mm")
    assert plant.p[2] > start[2] + 0.009 and gaits > 0, "the object was lost"


if __name__ == "__main__":
    main()
