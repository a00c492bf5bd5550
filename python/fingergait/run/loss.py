"""When an object counts as lost, and the likely reason in words."""

import math

import numpy as np
from numpy.typing import NDArray

from fingergait.run.log import Log
from fingergait.run.pose_error import yaw_reached
from fingergait.scenario import Scenario
from fingergait.sim.scene import SceneModel, torque_limits

Array = NDArray[np.float64]

POSITION_LIMIT = 0.010  # m: less than the lift, so that an object that stays on the palm is lost too
ORIENTATION_LIMIT = 0.35  # rad
SUSTAINED = 0.1  # s
_STEP_TIME = 2.0  # s that a step of the reference may take before its own size counts as an error
_LOOK_BACK = 1.0  # s before the loss in which the reason is sought


class LossMonitor:
    """Says when the object is lost: an error past its limit, or no pair of fingers on it, for 0.1 s on end.

    Parameters
    ----------
    scenario
        Its reference step, which for two seconds is no error. With faults the reference may stand inside the
        controller: then only a tilt of the object's axis counts as an error of orientation.
    """

    def __init__(self, scenario: Scenario) -> None:
        step = scenario.reference.step
        self._step_at = scenario.reference.step_at
        self._allowance = math.hypot(*step[:3]), math.hypot(*step[3:])
        self._tilt_only = bool(scenario.fault)
        self._lags = False
        self._since: float | None = None
        self.symptom = ""

    def update(
        self,
        t: float,
        true: Array,
        desired: Array,
        normal_forces: Array,
        standing: bool = False,
        lying: bool = False,
    ) -> bool:
        """True once the object is lost, from the poses (7,) and the fingertips' normal forces, N.

        `standing`: the controller lets the reference stand in this step. From then on only a tilt counts, until the
        object has caught up with the desired yaw. `lying`: the controller has set the object down, and need not touch
        it.
        """
        self._lags = standing or (self._lags and _angle(true.tolist(), desired.tolist()) > ORIENTATION_LIMIT)
        symptom = self._symptom(t, true.tolist(), desired.tolist(), normal_forces, lying)
        if symptom is None:
            self._since = None
            return False
        if self._since is None:
            self._since, self.symptom = t, symptom
        return t - self._since >= SUSTAINED

    def _symptom(self, t: float, p: list[float], d: list[float], normal_forces: Array, lying: bool) -> str | None:
        stepping = self._step_at <= t < self._step_at + _STEP_TIME
        position_limit = POSITION_LIMIT + (self._allowance[0] if stepping else 0.0)
        orientation_limit = ORIENTATION_LIMIT + (self._allowance[1] if stepping else 0.0)
        if math.dist(p[:3], d[:3]) > position_limit:
            return f"the position error passed {1e3 * POSITION_LIMIT:.0f} mm"
        angle = _tilt(p, d) if self._tilt_only or self._lags else _angle(p, d)
        if angle > orientation_limit:
            return f"the orientation error passed {ORIENTATION_LIMIT} rad"
        if t > 0.0 and not lying and np.count_nonzero(normal_forces) < 2:
            return "fewer than two fingertips touched the object"
        return None


def _angle(p: list[float], d: list[float]) -> float:
    """Angle between two orientations, rad."""
    cosine = abs(p[3] * d[3] + p[4] * d[4] + p[5] * d[5] + p[6] * d[6])
    return 2.0 * math.acos(min(1.0, cosine))


def _tilt(p: list[float], d: list[float]) -> float:
    """Angle between the z axes of two poses, rad."""
    axes = []
    for _, _, _, w, x, y, z in (p, d):
        axes.append((2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)))
    cosine = sum(a * b for a, b in zip(*axes, strict=True))
    return math.acos(max(-1.0, min(1.0, cosine)))


def reason(log: Log, scene: SceneModel, symptom: str) -> str:
    """Why the object was lost: the symptom, when and at what turn, and the limits that were active before."""
    t = log.t
    turned = float(np.rad2deg(yaw_reached(log.pose("object"))[-1]))
    before = t >= t[-1] - SUSTAINED - _LOOK_BACK
    causes = [*_joints_at_limits(log, scene, before), *_torques_at_limits(log, scene, before)]
    causes += [*_sliding(log, before), *_undelivered(log, before)]
    found = "; ".join(causes) if causes else "no joint, torque or friction limit was active"
    return f"{symptom} at {t[-1]:.2f} s, after {turned:.0f} degrees; in the second before, {found}"


def _joints_at_limits(log: Log, scene: SceneModel, before: NDArray[np.bool_]) -> list[str]:
    joints = [joint for finger in scene.fingers for joint in finger.joints]
    lower, upper = scene.model.jnt_range[joints].T
    q = log.block("q")[before]
    margin = np.deg2rad(1.0)
    at = [(q < lower + margin).mean(axis=0), (q > upper - margin).mean(axis=0)]
    words = []
    for index, joint in enumerate(joints):
        for fraction, limit, name in zip(at, (lower, upper), ("lower", "upper"), strict=True):
            if fraction[index] > 0.3:
                words.append(
                    f"{scene.model.joint(joint).name} stood at its {name} limit ({np.rad2deg(limit[index]):.0f})"
                )
    return words


def _torques_at_limits(log: Log, scene: SceneModel, before: NDArray[np.bool_]) -> list[str]:
    low, high = torque_limits(scene)
    tau = log.block("tau_des")[before]
    at = ((tau >= 0.999 * high) | (tau <= 0.999 * low)).mean(axis=0)
    names = [scene.model.joint(joint).name for finger in scene.fingers for joint in finger.joints]
    saturated = [f"{name} {100 * share:.0f} %" for name, share in zip(names, at, strict=True) if share > 0.1]
    return [f"torques were at their limit ({', '.join(saturated)} of the time)"] if saturated else []


def _sliding(log: Log, before: NDArray[np.bool_]) -> list[str]:
    """Fingers that slid while they should have held, by the core's own slip speed."""
    slip = np.abs(log.block("slip")[before])
    fast = (slip > 0.02).mean(axis=0)
    names = [name for name, share in zip(log.fingers, fast, strict=True) if share > 0.1]
    return [f"{', '.join(names)} slid on the object"] if names else []


def _undelivered(log: Log, before: NDArray[np.bool_]) -> list[str]:
    """What the force optimiser could not deliver of the wrench asked for."""
    psi = log.block("psi")[before]
    force = float(np.linalg.norm(psi[:, :3], axis=1).mean())
    torque = float(np.linalg.norm(psi[:, 3:], axis=1).mean())
    if force < 0.3 and torque < 0.01:
        return []
    return [f"the contacts fell short of the wrench asked for by {force:.1f} N and {1e3 * torque:.0f} mN m on average"]
