"""A run as HTML for a notebook: its table, its plots and its film strip, with every picture inside the text."""

import base64
import html
import io
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from fingergait.run.log import Log
from fingergait.run.report.film import film_strip
from fingergait.run.report.plots import FIGURES
from fingergait.run.report.table import ROWS
from fingergait.scenario import Scenario


def run_html(metrics: dict[str, Any], log: Log) -> str:
    """HTML of a run's figures beside the paper's, its film strip and its plots; the pictures are PNG in data URLs.

    Rendering the film strip takes about two seconds; without a GL library a line in its place says what to install.
    """
    parts = [_table(metrics)]
    if metrics["dropped"]:
        parts.append(f"<p><strong>LOST: {html.escape(metrics['lost_reason'])}</strong></p>")
    parts += _pictures(metrics, log)
    return "\n".join(parts)


def _table(metrics: dict[str, Any]) -> str:
    rows = [(name, measured(metrics), paper) for name, measured, paper in ROWS]
    cells = [
        f"<tr><td>{name}</td><td style='text-align:right'>{html.escape(value)}</td><td>{html.escape(paper)}</td></tr>"
        for name, value, paper in rows
        if value != "-"
    ]
    title = html.escape(f"{metrics['scenario']}, seed {metrics['seed']}")
    head = f"<caption>{title}</caption><tr><th>figure</th><th>here</th><th>paper</th></tr>"
    return f"<table>{head}{''.join(cells)}</table>"


def _pictures(metrics: dict[str, Any], log: Log) -> Iterator[str]:
    scenario = Scenario.build(json.loads(log.metadata["scenario"]))
    with tempfile.TemporaryDirectory() as folder:
        file, strip = Path(folder) / "log.parquet", Path(folder) / "film.png"
        log.write(file)
        problem = film_strip(file, strip)
        yield f"<p>{html.escape(problem)}</p>" if problem else _image(strip.read_bytes(), "film strip")
    for name, draw in FIGURES.items():
        buffer = io.BytesIO()
        draw(log, scenario).savefig(buffer, format="png", dpi=80)
        yield _image(buffer.getvalue(), name)


def _image(png: bytes, name: str) -> str:
    return f'<img alt="{name}" style="max-width:100%" src="data:image/png;base64,{base64.b64encode(png).decode()}"/>'
