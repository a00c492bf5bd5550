"""The work of `fingergait grasps`: the search for a hand's grasps, and its files."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from fingergait.adopt.options import SearchOptions
from fingergait.adopt.picture import write_map
from fingergait.adopt.pipeline import Adoption
from fingergait.adopt.survey import GraspSearch, objects_for, search_grasps
from fingergait.adopt.view import view_of
from fingergait.files import make_folder, whole_file, write_text
from fingergait.hand import import_hand
from fingergait.paths import find_hand
from fingergait.stopping import Stopped


def run_grasps(
    hand: str,
    facts: Path | None,
    families: tuple[str, ...],
    mass: float | None,
    out: Path,
    quick: bool,
    workers: int | None,
) -> dict[str, Any]:
    """Searches grasps and writes grasps.json and map.png to `out`; the JSON's values."""
    make_folder(out)
    view = view_of(import_hand(find_hand(hand, "HAND"), facts))
    options = SearchOptions().quick() if quick else SearchOptions()
    search = search_grasps(view, objects_for(view, families, mass), options, workers=workers)
    with whole_file(out / "map.png") as file:
        write_map(search, file)
    values = search.as_json()
    write_text(out / "grasps.json", json.dumps(values, indent=2) + "\n")
    return values


def run_adopt(adoption: Adoption) -> dict[str, Any]:
    """All stages of an adoption; the JSON's values. Where the user stops it, what is done is kept."""
    try:
        return adoption.report
    except Stopped as stop:
        kept = f"the finished stages are kept in {adoption.out}; the same command goes on from there"
        raise Stopped(kept, stop.status - 128) from None


def show_adoption(values: dict[str, Any], console: Console) -> None:
    """Prints what the runs did, a row a scenario, and why the hand does not turn its object where it doesn't."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("scenario", "object", "held", "asked", "forwards", "backwards", "fails first"):
        table.add_column(name)
    for entry in values["verified"]:
        turned = ["-" if (x := entry[f"turned_{way}_rad"]) is None else f"{np.rad2deg(x):.0f}°" for way in _WAYS]
        asked, held = f"{np.rad2deg(entry['asked_rad']):.0f}°", f"{entry['completed']} of {entry['runs']}"
        table.add_row(entry["file"], entry["object"], held, asked, *turned, entry["fails_first"])
    console.print(table)
    if values["controller"]:
        peak = values["mu_peak"]
        console.print(f"controller: mu {'none, unstable' if peak is None else f'{peak:.2f}'}", highlight=False)
    verdict = "turns its object, both ways" if values["turns"] else f"does not turn without end: {values['reason']}"
    console.print(f"{values['hand']} {verdict}", highlight=False, markup=False)
    console.print(f"bundle: {values['bundle']}; report: {values['report']}", highlight=False, markup=False)


_WAYS = ("forwards", "backwards")


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
