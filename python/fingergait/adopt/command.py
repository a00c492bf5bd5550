"""The work of `fingergait grasps`: the search for a hand's grasps, and its files."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from fingergait._core import ConfigError
from fingergait.adopt.options import SearchOptions
from fingergait.adopt.picture import write_map
from fingergait.adopt.survey import GraspSearch, objects_for, search_grasps
from fingergait.adopt.view import view_of
from fingergait.hand import load_spec
from fingergait.paths import find


def run_grasps(
    hand: str, families: tuple[str, ...], mass: float | None, out: Path, quick: bool, workers: int | None
) -> dict[str, Any]:
    """Searches grasps and writes grasps.json, map.png and a scenario of each grasp to `out`; the JSON's values."""
    path = find(hand, "", ".xml", "HAND")
    view = view_of(load_spec(path), path.name)
    options = SearchOptions().quick() if quick else SearchOptions()
    search = search_grasps(view, objects_for(view, families, mass), options, workers=workers)
    try:
        out.mkdir(parents=True, exist_ok=True)
        write_map(search, out / "map.png")
        values = search.as_json()
        (out / "grasps.json").write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"--out: expected a folder that can be written, found {out} ({error.strerror})") from None
    return values


def show(search: GraspSearch | dict[str, Any], console: Console) -> None:
    """Prints a row an object: its best grasp's stroke and loads, or what forbids it."""
    values = search.as_json() if isinstance(search, GraspSearch) else search
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("object", "kind", "stroke", "load", "worst spared", "why not"):
        table.add_column(name)
    for entry in values["objects"]:
        size = " x ".join(f"{1e3 * x:.0f}" for x in entry["size"])
        best = entry["grasps"][0] if entry["grasps"] else None
        figures = ["", "", ""]
        if best is not None:
            spared = [x for x in best["spared"] if x is not None]
            worst = f"{max(spared):.2f}" if len(spared) == len(best["spared"]) else "none holds"
            figures = [f"±{np.rad2deg(best['stroke']):.0f}°", f"{best['load']:.2f}", worst]
        table.add_row(f"{entry['family']} {size} mm", entry["kind"], *figures, entry["reason"])
    console.print(table)
    if values["reason"]:
        console.print(f"nothing can be turned in the air; {values['reason']}", highlight=False)
