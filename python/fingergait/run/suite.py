"""The sampled suite: many seeds of `sampling.sampled`, in parallel processes, each held against the same limits."""

from collections.abc import Callable
from typing import Any

from fingergait.run.sampling import missed, sampled
from fingergait.run.simulate import simulate
from fingergait.scenario import parse_override
from fingergait.stopping import in_processes

ROW = (
    "seed",
    "dropped",
    "completed",
    "lost_reason",
    "rotation_rad",
    "max_position_error_m",
    "max_orientation_error_rad",
    "gaits",
    "gait_fraction",
    "max_height_deviation_m",
    "slips",
    "min_quality",
    "quality_threshold",
    "saturated_fraction",
    "real_time_factor",
)


def run_seed(seed: int, base: str, overrides: list[str]) -> dict[str, Any]:
    """The row of one seed: the object drawn, the figures of `ROW`, and `missed`."""
    scenario = sampled(seed, base)
    if overrides:
        scenario = scenario.replace(dict(map(parse_override, overrides)))
    metrics = simulate(scenario).metrics
    drawn = {
        "radius_m": scenario.object.size[0],
        "half_height_m": scenario.object.size[-1],
        "mass_kg": scenario.object.mass,
        "mass_scale": scenario.truth.mass_scale,
        "inertia_scale": scenario.truth.inertia_scale,
        "yaw_rate": scenario.reference.yaw_rate,
    }
    return {**{key: metrics[key] for key in ROW}, **drawn, "missed": missed(metrics)}


def run_suite(
    seeds: list[int], workers: int, base: str, overrides: list[str], done: Callable[[dict[str, Any]], None]
) -> list[dict[str, Any]]:
    """Rows of all seeds, in order; `done` is shown each as it comes.

    Parameters
    ----------
    seeds
        Which.
    workers
        Processes; 1 runs them in this one.
    base
        Scenario that is varied.
    overrides
        KEY=VALUE on every one.
    """
    rows = []
    for _, row in in_processes([(run_seed, (seed, base, overrides)) for seed in seeds], workers):
        done(row)
        rows.append(row)
    return sorted(rows, key=lambda row: seeds.index(row["seed"]))
