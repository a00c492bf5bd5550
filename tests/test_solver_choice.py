"""The fast path and clarabel lead the closed loop along the same trajectory."""

import numpy as np
import pytest

import fingergait as fg
from fingergait.run.pose_error import pose_errors

POSITION, ANGLE, TORQUE = 1e-6, 1e-5, 1e-4
"""m, rad, N m: what two runs may differ by. Both solvers certify forces to 1e-7 N; contact, and each gait's event, pass
a difference on through thousands of steps."""


def run(name: str, duration: float, solver: str) -> fg.Run:
    return fg.simulate(fg.Scenario.load(name, {"duration": duration, "force.solver": solver}))


@pytest.mark.parametrize(
    ("name", "duration", "gaits"), [("lift-and-rotate", 15.0, 8), ("noisy", 10.0, 4), ("push", 12.0, 4)]
)
def test_the_fast_path_and_clarabel_give_the_same_trajectory(name: str, duration: float, gaits: int) -> None:
    fast, slow = (run(name, duration, solver) for solver in ("active_set", "clarabel"))
    assert set(fast.metrics["solver"]) == {"active_set"}
    assert fast.metrics["gaits"] == slow.metrics["gaits"] >= gaits
    assert slow.metrics["solver"]["clarabel_polished"] > 0.99 * len(slow.log)
    assert not fast.metrics["dropped"]
    errors = np.abs(pose_errors(fast.log.pose("object"), slow.log.pose("object")))
    torques = np.abs(fast.log.block("tau_des") - slow.log.block("tau_des"))
    print(f"{name}: {errors[:, :3].max():.1e} m, {errors[:, 3:].max():.1e} rad, {torques.max():.1e} N m")
    assert errors[:, :3].max() <= POSITION
    assert errors[:, 3:].max() <= ANGLE
    assert torques.max() <= TORQUE
