"""The grasp search for many objects, in parallel processes: nominal grasps, and the map of what is possible."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fingergait.adopt.family import FAMILIES, ObjectSpec
from fingergait.adopt.grasp import Found, Grasp
from fingergait.adopt.library import draw_library
from fingergait.adopt.options import SearchOptions
from fingergait.adopt.progress import bar
from fingergait.adopt.search import search_object
from fingergait.adopt.view import HandView
from fingergait.stopping import in_processes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GraspSearch:
    """What a hand can turn: for each object its grasps, or why there is none.

    `gravity` and `axis` (3,) in the hand model's world; `found` in the order of the objects asked for.
    """

    hand: str
    gravity: tuple[float, ...]
    axis: tuple[float, ...]
    options: SearchOptions
    found: tuple[Found, ...]

    @property
    def grasps(self) -> list[Grasp]:
        """The best grasp of each object that has one."""
        return [found.best for found in self.found if found.best is not None]

    @property
    def gaits(self) -> list[Grasp]:
        """The best grasp of each object from which any one finger can be spared."""
        return [grasp for grasp in self.grasps if grasp.kind == "gait"]

    @property
    def reason(self) -> str:
        """Why nothing can be turned in the air: of the objects, the one that got furthest; empty where one can."""
        from fingergait.adopt.funnel import STAGES

        if self.gaits or not self.found:
            return ""
        furthest = max(self.found, key=lambda found: STAGES.index(found.stage))
        return f"{furthest.object}: {furthest.reason}"

    def as_json(self) -> dict[str, Any]:
        """Plain values for a JSON file."""
        return {
            "hand": self.hand,
            "gravity": list(self.gravity),
            "axis": list(self.axis),
            "reason": self.reason,
            "objects": [
                {
                    "family": found.object.family,
                    "size": list(found.object.size),
                    "mass": found.object.mass,
                    "kind": found.kind,
                    "stage": found.stage,
                    "reason": found.reason,
                    "grasps": [grasp.as_json() for grasp in found.grasps],
                }
                for found in self.found
            ],
        }


def objects_for(
    hand: HandView, families: Sequence[str] = FAMILIES, mass: float | None = None, steps: int = 7
) -> list[ObjectSpec]:
    """Objects of each family over the radii that the hand may hold, the smallest first.

    Radii lie between one and four tip radii; a body is as tall as a ball of 1.7 times the mean radius is wide.
    Without a mass, each object has the one that the weakest finger carries: a fifth of the force that its torque
    limits give at its whole reach, at most 0.2 kg.
    """
    tip = float(np.mean([finger.tip_radius for finger in hand.fingers]))
    radii = np.linspace(1.2 * tip, 4.2 * tip, steps)
    own = mass if mass is not None else payload(hand)
    height = 5.0 * tip
    return [ObjectSpec.of_radius(family, float(radius), height, own) for family in families for radius in radii]


def payload(hand: HandView) -> float:
    """A mass, kg, that the hand should carry: see `objects_for`."""
    library = draw_library(hand, 64, 0)
    forces = []
    for j, finger in enumerate(hand.fingers):
        chain = library.chains[j]
        postures = chain.at(library.q[j])
        reach = np.linalg.norm(postures.centre - postures.anchors[:, 0], axis=1).max()
        forces.append(float(np.minimum(finger.torque_upper, -finger.torque_lower).min() / max(reach, 1e-6)))
    weight = 0.2 * sum(forces)
    return float(np.clip(weight / np.linalg.norm(hand.gravity), 0.01, 0.2))


def search_grasps(
    hand: HandView,
    objects: Sequence[ObjectSpec],
    options: SearchOptions | None = None,
    gravity: Sequence[float] | None = None,
    axis: Sequence[float] | None = None,
    workers: int | None = None,
    progress: bool = True,
) -> GraspSearch:
    """Nominal grasps of the objects, each with its stroke about the task axis, or why there is none.

    Parameters
    ----------
    hand
        The hand, see `view`.
    objects
        What it is to hold.
    options
        What is asked of a grasp, and the search's effort.
    gravity
        In the hand model's world, (3,), m/s^2; absent: the hand's.
    axis
        About which the objects are to turn, (3,) in the same world; absent: against gravity.
    workers
        Processes; absent: one a core. The result does not depend on it.
    progress
        Show a progress bar on standard error.
    """
    options = options or SearchOptions()
    if gravity is not None:
        hand = replace(hand, gravity=np.asarray(gravity, dtype=np.float64))
    along = None if axis is None else np.asarray(axis, dtype=np.float64)
    workers = min(workers or os.cpu_count() or 1, max(1, len(objects)))
    results: dict[int, Found] = {}
    with bar("grasps", len(objects), progress) as advance:
        rows = _rows(objects)
        calls = [(_row, ([objects[index] for index in row], hand, options, along)) for row in rows]
        for number, row in in_processes(calls, min(workers, max(1, len(rows)))):
            for index, found in zip(rows[number], row, strict=True):
                results[index] = found
                advance(f"{found.object}: {found.kind}")
    up = hand.up if along is None else along / np.linalg.norm(along)
    return GraspSearch(
        hand=hand.name,
        gravity=tuple(float(x) for x in hand.gravity),
        axis=tuple(float(x) for x in up),
        options=options,
        found=tuple(results[index] for index in range(len(objects))),
    )


def _row(row: list[ObjectSpec], hand: HandView, options: SearchOptions, axis: Array | None) -> list[Found]:
    """A family's objects from the middle outwards: each search begins at its neighbour's grasp; in the row's order."""
    library = draw_library(hand, options.samples, options.seed)
    middle = len(row) // 2
    found: dict[int, Found] = {}
    for index in [middle, *range(middle + 1, len(row)), *range(middle - 1, -1, -1)]:
        neighbour = found.get(index - 1 if index > middle else index + 1)
        near = neighbour.best if neighbour is not None and neighbour.kind == "gait" else None
        found[index] = search_object(hand, row[index], options, axis, library, near)
    return [found[index] for index in range(len(row))]


def _rows(objects: Sequence[ObjectSpec]) -> list[list[int]]:
    """Indices of the objects, a row a family and mass, by size; long rows are cut so that each core has some."""
    rows: dict[tuple[str, float], list[int]] = {}
    for index in sorted(range(len(objects)), key=lambda i: (objects[i].radius, objects[i].size)):
        rows.setdefault((objects[index].family, objects[index].mass), []).append(index)
    return [row[begin : begin + _ROW] for row in rows.values() for begin in range(0, len(row), _ROW)]


_ROW = 4
