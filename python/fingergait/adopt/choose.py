"""Which of the grasps to go on with: a short turn from each, both ways, in contact."""

from pathlib import Path
from typing import Any

import numpy as np

from fingergait.adopt.grasp import Grasp
from fingergait.adopt.verify import Trial, run_trial

LENGTH = 15.0  # s of each run


def candidates(grasps: dict[str, Any], most: int) -> list[Grasp]:
    """At most `most` grasps, one an object: longest strokes first; those that turn in the air go before all others."""
    best = [Grasp.from_json(entry["grasps"][0]) for entry in grasps["objects"] if entry["grasps"]]
    if any(grasp.kind == "gait" for grasp in best):
        best = [grasp for grasp in best if grasp.kind == "gait"]
    best.sort(key=lambda grasp: (-round(grasp.stroke, 3), max(grasp.spared), grasp.object.size))
    return best[:most]


def try_turn(folder: Path, file: str, sense: int) -> dict[str, Any]:
    """What came of a turn of `file` as it is, as `run_trial` has it."""
    return run_trial(folder, Trial(file, None, sense))


def score(rows: list[dict[str, Any]]) -> tuple[int, float, float]:
    """How well an object turned, more is better: runs that did all, share of the turn reached, the error's negative.

    Of two ways the worse one counts.
    """
    reached = min(row["turned_rad"] / row["asked_rad"] if row["asked_rad"] else 0.0 for row in rows)
    errors = [row.get("max_orientation_error_rad") for row in rows]
    worst = max(np.inf if error is None else error for error in errors)
    return sum(bool(row["held"]) for row in rows), round(min(reached, 1.0), 2), -float(worst)


def ordered(grasps: list[Grasp], rows: list[list[dict[str, Any]]]) -> list[int]:
    """Numbers of the grasps, the one that turned best first; among equals the order stands."""
    return sorted(range(len(grasps)), key=lambda i: tuple(-x for x in score(rows[i])))
