"""Random variations of a scenario: what "not tuned to one number" means here, in one place."""

from typing import Any

import numpy as np

from fingergait.scenario import Scenario

DURATION = 40.0  # s
POSITION_LIMIT = 1e-3  # m, after lift-off
ORIENTATION_LIMIT = 0.03  # rad, after lift-off


def sampled(seed: int, base: str = "lift-and-rotate") -> Scenario:
    """The scenario `base` with everything drawn at once from the seed.

    Radius 22 to 30 mm, half-height 50 to 70 mm, nominal mass 0.3 to 0.7 kg, true mass 0.6 to 1.4 times that, inertia
    0.5 to 1.5 times, either sense of rotation. First grasp: the object up to 3 mm off the hand's axis in any direction,
    each finger up to 5 degrees round the object and 3 mm in height off its nominal contact. White noise on the pose
    (0.1 mm, 0.1 degree), the contact place (0.3 mm) and the normal force (5 %).
    """
    rng = np.random.default_rng(seed)
    radius, half_height = rng.uniform(0.022, 0.030), rng.uniform(0.050, 0.070)
    mass, mass_scale = rng.uniform(0.3, 0.7), rng.uniform(0.6, 1.4)
    inertia_scale, sense = rng.uniform(0.5, 1.5), rng.choice([-1.0, 1.0])
    distance, direction = 0.003 * np.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
    turns, heights = rng.uniform(-5.0, 5.0, 4), rng.uniform(-0.003, 0.003, 4)
    scenario = Scenario.load(base)
    offset = [distance * np.cos(direction), distance * np.sin(direction), 0.0, 0.0, 0.0, 0.0]
    values: dict[str, Any] = {
        "name": f"{base}-sampled",
        "seed": seed,
        "duration": DURATION,
        "object.shape": "cylinder",
        "object.size": [radius, half_height],
        "object.mass": mass,
        "truth.mass_scale": mass_scale,
        "truth.inertia_scale": inertia_scale,
        "truth.first_grasp": offset,
        "truth.finger_offset_deg": turns.tolist(),
        "truth.finger_height_offset": heights.tolist(),
        "reference.yaw_rate": sense * abs(scenario.reference.yaw_rate),
        "sensors.position_noise": 1e-4,
        "sensors.orientation_noise": float(np.deg2rad(0.1)),
        "sensors.contact_place_noise": 3e-4,
        "sensors.contact_force_noise": 0.05,
    }
    return scenario.replace(values)


def missed(metrics: dict[str, Any]) -> list[str]:
    """Which of the suite's limits a run missed, in words; empty where it held them all."""
    words = []
    if metrics["dropped"]:
        words.append("lost")
    for key, limit, unit, scale in (
        ("max_position_error_m", POSITION_LIMIT, "mm", 1e3),
        ("max_orientation_error_rad", ORIENTATION_LIMIT, "mrad", 1e3),
    ):
        value = metrics[key]
        if value is None or value > limit:
            found = "none" if value is None else f"{scale * value:.2f}"
            words.append(f"{found} {unit} > {scale * limit:g}")
    return words
