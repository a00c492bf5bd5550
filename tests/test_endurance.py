"""Rotation without end in one process: memory, step time and grasp stay as they are.

Half a minute by default, of which the memory says little; `FINGERGAIT_ENDURANCE_S=3600` makes it an hour.
"""

import os
import resource
from pathlib import Path

import numpy as np
import pytest

from fingergait import _core
from fingergait.hand import hand_json
from fingergait.paths import find
from fingergait.run.loss import LossMonitor
from fingergait.run.simulate import load_controller
from fingergait.scenario import Scenario
from fingergait.scenario.reference import Trajectory
from fingergait.sim.plant import MujocoPlant

SECONDS = float(os.environ.get("FINGERGAIT_ENDURANCE_S", "30"))
PARTS = 12


def resident_bytes() -> int:
    """Memory of this process now, or, where the system does not say, the most there was."""
    statm = Path("/proc/self/statm")
    if statm.exists():
        return int(statm.read_text().split()[1]) * resource.getpagesize()
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


@pytest.mark.timeout(max(300.0, SECONDS))
def test_rotation_without_end_neither_grows_nor_slows_nor_drops() -> None:
    scenario = Scenario.load("lift-and-rotate", {"duration": SECONDS})
    plant = MujocoPlant(scenario)
    hand = _core.HandModel(hand_json(find(scenario.hand.file, "", ".xml", "hand.file")))
    planner = _core.DualStagePlanner(hand, load_controller(scenario), plant.config)
    trajectory, monitor = Trajectory(scenario.reference, plant.sensors.pose), LossMonitor(scenario)
    measurement = plant.reset()
    steps = round(SECONDS * scenario.controller.rate_hz) // PARTS
    memory, median_us = [], []
    step_ns = np.zeros(steps, dtype=np.int64)
    for _ in range(PARTS):
        for k in range(steps):
            pose, twist = trajectory.sample(plant.t)
            command, diagnostics = planner.step(measurement, _core.Reference(pose, twist))
            step_ns[k] = diagnostics.step_ns
            assert diagnostics.step_allocations == 0
            measurement = plant.step(command)
            dropped = monitor.update(plant.t, plant.object_pose, pose, plant.sensors.normal_force)
            assert not dropped, f"{plant.t} s: {monitor.symptom}"
        memory.append(resident_bytes())
        median_us.append(float(np.median(step_ns)) / 1e3)
    plant.close()
    print(f"\n{plant.t:.0f} s: {[round(m / 2**20, 1) for m in memory]} MiB, {np.round(median_us, 2)} us a step")
    counts = diagnostics.solver_counts
    assert counts["active_set"] == sum(counts[name] for name in ("active_set", "clarabel_polished", "clarabel", "held"))
    assert memory[-1] - memory[1] <= 2 * 2**20
    # The second half against the first: the clock counts this thread's own time, but a busy machine slows that too.
    assert np.median(median_us[PARTS // 2 :]) <= 1.5 * np.median(median_us[: PARTS // 2])
