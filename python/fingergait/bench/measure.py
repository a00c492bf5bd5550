"""The measurements behind `fingergait bench`."""

import importlib
import time
from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fingergait import _core
from fingergait.bench.instances import (
    ALPHA,
    FAMILIES,
    FINGERS,
    Array,
    Instance,
    dense,
    edges,
    facet_normals,
    sequence,
)
from fingergait.bench.peers import installed
from fingergait.hand import hand_json
from fingergait.paths import find
from fingergait.run.simulate import load_controller
from fingergait.scenario import Scenario
from fingergait.scenario.reference import Trajectory
from fingergait.sim.plant import MujocoPlant

STEPS = 60  # of each sequence of force problems


@dataclass
class Sample:
    """Times of one thing, ns, with what else was found."""

    ns: list[int] = field(default_factory=list)
    allocations: int | None = None
    error: float | None = None

    def add(self, ns: int, allocations: int | None = None, error: float | None = None) -> None:
        """Takes one more measurement."""
        self.ns.append(ns)
        if allocations is not None:
            self.allocations = max(self.allocations or 0, allocations)
        if error is not None:
            self.error = max(self.error or 0.0, error)

    def row(self, name: str) -> dict[str, Any]:
        """The figures of one line of the table."""
        us = np.asarray(self.ns) / 1e3
        median, p99, p999 = np.percentile(us, [50.0, 99.0, 99.9])
        return {
            "name": name,
            "median_us": round(float(median), 3),
            "p99_us": round(float(p99), 3),
            "p999_us": round(float(p999), 3),
            "max_us": round(float(us.max()), 3),
            "allocations": self.allocations,
            "error_max": self.error,
            "samples": len(us),
        }


def measure(seconds: float = 12.0, repeat: int = 5, sequences: int = 4) -> dict[str, Sample]:
    """All rows: the step on `seconds` of measurements, each seen `repeat` times, and `sequences` per family of QPs."""
    samples: dict[str, Sample] = defaultdict(Sample)
    measure_step(samples, seconds, repeat)
    measure_force(samples, sequences)
    measure_lp(samples)
    return dict(samples)


def measure_step(samples: dict[str, Sample], seconds: float, repeat: int) -> None:
    """The control step by mode, in the core and from Python, on the measurements of a real run."""
    scenario = Scenario.load("lift-and-rotate", {"duration": seconds})
    plant = MujocoPlant(scenario)
    hand = _core.HandModel(hand_json(find(scenario.hand.file, "", ".xml", "hand.file")))
    planner = _core.DualStagePlanner(hand, load_controller(scenario), plant.config)
    measurement = plant.reset()
    trajectory = Trajectory(scenario.reference, plant.sensors.pose)
    rows = []
    for _ in range(round((seconds + scenario.grasp.settle) * scenario.controller.rate_hz)):
        reference = _core.Reference(*trajectory.sample(plant.t))
        rows.append((measurement, reference))
        measurement = plant.step(planner.step(measurement, reference)[0])
    plant.close()
    n, m = hand.n_fingers, hand.n_joints
    pid = _core.TorquePid(n * m, 1e-3)
    lost = [float("nan")] * 7
    least = np.full(len(rows), np.iinfo(np.int64).max)
    for _ in range(repeat):
        planner.reset()
        for k, (measurement, reference) in enumerate(rows):
            begin = time.thread_time_ns()
            command, diagnostics = planner.step(measurement, reference)
            python = time.thread_time_ns() - begin
            samples[f"step/{diagnostics.mode}"].add(diagnostics.step_ns, diagnostics.step_allocations)
            samples["step/all"].add(diagnostics.step_ns, diagnostics.step_allocations)
            samples["step/python"].add(python)
            least[k] = min(least[k], diagnostics.step_ns)
            begin = time.thread_time_ns()
            pid.step(command.tau, command.tau)
            samples["torque_pid/python"].add(time.thread_time_ns() - begin)
    # The same steps take the same work each time; what an interrupt adds to one of them is not in the least of all.
    samples["step/least_of_repeats"].ns.extend(least.tolist())
    zeros, touch = np.zeros((n, m)), np.zeros((n, 3))
    for k in range(2000):
        blind = _core.Measurement(1e3 + 0.002 * k, zeros, zeros, lost, touch, np.zeros(n))
        diagnostics = planner.step(blind, rows[-1][1])[1]
        samples["step/faults"].add(diagnostics.step_ns, diagnostics.step_allocations)


def measure_force(samples: dict[str, Sample], sequences: int) -> None:
    """The force QP: our own and the peers on the same instances, with the largest error of the forces, N."""
    peers = installed()
    facets = facet_normals()
    for family in FAMILIES:
        for seed in range(sequences):
            fast = _core.ForceOptimizer(edges(), ALPHA)
            slow = _core.ForceOptimizer(edges(), ALPHA, "clarabel")
            f_prev = np.zeros(3 * FINGERS)
            for instance in sequence(family, STEPS, seed):
                truth = _solve(samples["force_qp/clarabel_in_core"], slow, instance, f_prev, None, None)
                f = _solve(samples["force_qp/core"], fast, instance, f_prev, truth, samples["force_qp/python"])
                qp = dense(instance, f_prev, facets)
                for name, solve in peers.items():
                    begin = time.thread_time_ns()
                    try:
                        x = solve(qp)
                    except (ValueError, RuntimeError):  # the solver's own way to give up
                        continue
                    ns = time.thread_time_ns() - begin
                    error = float(np.linalg.norm(x - truth)) if x.shape == truth.shape else np.inf
                    samples[f"force_qp/{name}"].add(ns, error=error)
                f_prev = f


def _solve(
    sample: Sample,
    optimizer: _core.ForceOptimizer,
    instance: Instance,
    f_prev: Array,
    truth: Array | None,
    python: Sample | None,
) -> Array:
    begin = time.thread_time_ns()
    solution = optimizer.solve(
        instance.G, instance.J, instance.F_des, f_prev, instance.tau_min, instance.tau_max, instance.cap
    )
    ns = time.thread_time_ns() - begin
    f = solution.f
    error = None if truth is None else float(np.linalg.norm(f - truth))
    sample.add(solution.solve_ns, solution.solve_allocations, error)
    if python is not None:
        python.add(ns, error=error)
    return f


def measure_lp(samples: dict[str, Sample], count: int = 500) -> None:
    """The gait LP from Python, and HiGHS where it is installed, with the largest error of the value."""
    try:
        highspy: Any = importlib.import_module("highspy")
    except ImportError:
        highspy = None
    rng = np.random.default_rng(0)
    for _ in range(count):
        c, a = rng.normal(size=3), rng.normal(size=3)
        lower, upper = -rng.uniform(0.1, 1.0, 3), rng.uniform(0.1, 1.0, 3)
        begin = time.thread_time_ns()
        solution = _core.gait_lp(c, a, lower, upper)
        samples["gait_lp/python"].add(time.thread_time_ns() - begin)
        if highspy is None:
            continue
        solver = highspy.Highs()
        solver.silent()
        solver.addVars(3, lower, upper)
        solver.changeColsCost(3, np.arange(3), -c)
        solver.addRow(0.0, 0.0, 3, np.arange(3), a)
        begin = time.thread_time_ns()
        solver.run()
        ns = time.thread_time_ns() - begin
        value = -solver.getInfo().objective_function_value
        samples["gait_lp/highs"].add(ns, error=abs(value - solution.value))
