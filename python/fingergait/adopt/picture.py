"""The map of what a hand can turn: radius and family of the object, with the stroke or what forbids it."""

from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from fingergait.adopt.grasp import Found
from fingergait.adopt.survey import GraspSearch

_COLOURS = {"gait": "#2a7f62", "regrasp": "#d8a13a", "none": "#b9b9b9"}
_WORDS = {
    "gait": "turns in the air: any one finger can be spared",
    "regrasp": "held with all fingers only: turning on needs a table",
    "none": "no grasp",
}


def write_map(search: GraspSearch, path: Path) -> None:
    """Writes the map as a PNG: a row a family, a column a size, bars of stroke, and the first reason where none is."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    rows: dict[str, list[Found]] = {}
    for found in search.found:
        rows.setdefault(found.object.family, []).append(found)
    figure = Figure(figsize=(8.5, 1.4 + 2.3 * len(rows)), layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.subplots(len(rows), 1, squeeze=False)[:, 0]
    top = max([10.0, *(np.rad2deg(grasp.stroke) for grasp in search.grasps)])
    for axis, (family, own) in zip(axes, rows.items(), strict=True):
        own = sorted(own, key=lambda found: (found.object.radius, found.object.size))
        strokes = [np.rad2deg(found.best.stroke) if found.best else 0.0 for found in own]
        colours = [_COLOURS[found.kind] for found in own]
        axis.bar(range(len(own)), strokes, color=colours, width=0.7)
        for i, found in enumerate(own):
            if found.best is None:
                words = fill(found.reason.split(":")[0], 16, max_lines=7, placeholder=" ...")
                axis.text(i, 0.03 * top, words, fontsize=6, ha="center", va="bottom", color="#444444")
            else:
                spared = max(found.best.spared) if found.kind == "gait" else found.best.load
                axis.text(i, strokes[i], f"±{strokes[i]:.0f}°\nload {spared:.2f}", fontsize=7, ha="center", va="bottom")
        axis.set_xticks(range(len(own)), [_size(found) for found in own], fontsize=8)
        axis.set_ylim(0.0, 1.35 * top)
        axis.set_ylabel(f"{family}\nstroke, degrees")
        axis.spines[["top", "right"]].set_visible(False)
    axes[-1].set_xlabel("radius, mm (height, mm)")
    masses = sorted({found.object.mass for found in search.found})
    mass = f"{1e3 * masses[0]:.0f} g" if len(masses) == 1 else f"{1e3 * masses[0]:.0f} to {1e3 * masses[-1]:.0f} g"
    options = search.options
    figure.suptitle(
        f"{search.hand}: what it can turn, and how far both ways without moving a finger\n"
        f"{mass}, friction {options.friction:g}, disturbance {options.disturbance:g} of the weight, "
        f"load factor at most {options.load_limit:g}",
        fontsize=10,
    )
    kinds = [kind for kind in _COLOURS if any(found.kind == kind for found in search.found)]
    handles = [Patch(color=_COLOURS[kind], label=_WORDS[kind]) for kind in kinds]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=8, frameon=False)
    figure.savefig(path, dpi=130)


def _size(found: Found) -> str:
    spec = found.object
    radius = f"{1e3 * spec.radius:.0f}"
    return radius if spec.family == "ball" else f"{radius} ({2e3 * spec.size[-1]:.0f})"
