"""The page of an adoption: what was measured, what fails first, and what no grasp was found for."""

import base64
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from fingergait.files import write_text


def write_page(values: dict[str, Any], rows: list[dict[str, Any]], grasps: dict[str, Any], folder: Path) -> None:
    """Writes report.html, which opens without a network.

    Parameters
    ----------
    values
        The JSON of `fingergait adopt`.
    rows
        Every run, see `verify.run_trial`.
    grasps
        What the search found.
    folder
        The bundle: the page goes there, and shows its map.png and, where it is there, turn.png.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["milli"] = lambda value: "-" if value is None else f"{1e3 * value:.2f}"
    environment.filters["degrees"] = lambda value: "-" if value is None else f"{np.rad2deg(value):.0f}"
    text = environment.get_template("report.html").render(
        values=values, rows=rows, grasps=grasps, map=_image(folder / "map.png"), film=_image(folder / "turn.png")
    )
    write_text(folder / "report.html", text)


def _image(path: Path) -> str | None:
    """The picture as a data URL; None where there is none."""
    if not path.is_file():
        return None
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode("ascii")
