"""A campaign's page: one HTML file that opens without a network."""

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import pyarrow as pa

from fingergait.campaign.plots import Nominal, box_figure, error_figure, image, influence_figure, trend_figure
from fingergait.campaign.sensitivity import influences
from fingergait.campaign.spec import CampaignSpec
from fingergait.campaign.statistics import (
    PAPER_ORIENTATION,
    PAPER_POSITION,
    column,
    fault_rows,
    percentile,
)
from fingergait.files import write_text
from fingergait.paths import find

_SHOWN = 12  # failures listed for each cause


def write_campaign_page(
    spec: CampaignSpec, rows: pa.Table, timings: pa.Table, figures: dict[str, Any], path: Path
) -> None:
    """Writes the page.

    Parameters
    ----------
    spec
        What was run.
    rows, timings
        What came of it, and how long it took.
    figures
        As `command.run_campaign` gives them.
    path
        Of the page.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["milli"] = lambda value: "-" if value is None else f"{1e3 * value:.2f}"
    found = influences(rows)
    nominal, words = design(spec)
    plots = {
        "errors": error_figure(rows, (spec.limits.position_error_p99, spec.limits.orientation_error_p99)),
        "box": box_figure(rows, nominal),
        "influence": influence_figure(found),
        "trend": trend_figure(rows, found),
    }
    text = environment.get_template("report.html").render(
        spec=spec,
        described=json.dumps(spec.model_dump(mode="json", exclude_defaults=True), indent=2),
        figures=figures,
        paper=(PAPER_POSITION, PAPER_ORIENTATION),
        plots={name: image(figure) for name, figure in plots.items() if figure is not None},
        certified=words,
        faults=fault_rows(rows),
        failures=failures(rows),
        shown=_SHOWN,
        timing=timing_figures(timings),
    )
    write_text(path, text)


def failures(rows: pa.Table) -> list[tuple[str, list[dict[str, Any]]]]:
    """The rows that failed, by cause, the commonest cause first."""
    names = ["index", "cause", "error", "lost_reason", "duration_s", "replay"]
    groups: defaultdict[str, list[dict[str, Any]]] = defaultdict(list)
    for row in rows.select(names).to_pylist():
        if row["cause"] is not None:
            groups[row["cause"]].append(row)
    return sorted(groups.items(), key=lambda item: (-len(item[1]), item[0]))


def design(spec: CampaignSpec) -> tuple[Nominal, str]:
    """What the controller was designed and is certified for, from its artefact, and the certificate in words."""
    name = spec.base().controller.file
    path = find(name, "controllers", ".json", "controller.file")
    artefact = json.loads(path.read_text(encoding="utf-8"))
    mass, inertia = float(artefact["nominal"]["mass"]), tuple(map(float, artefact["nominal"]["inertia"]))
    try:
        uncertainty = artefact["provenance"]["spec"]["uncertainty"]
        certified = float(uncertainty["mass"]), tuple(map(float, uncertainty["inertia"]))
        peak = float(artefact["provenance"]["figures"]["mu_peak"])
    except (KeyError, TypeError, ValueError):
        return Nominal(mass, inertia, None), f"The controller {path.stem} states no certified uncertainty."
    each = " and ".join(sorted({f"{100 * x:g} %" for x in certified[1]}))
    return Nominal(mass, inertia, certified), (
        f"The controller {path.stem} is certified for a mass off by {100 * certified[0]:g} % and moments of inertia "
        f"off by {each}, mu at most {peak:.3f}: the green frame. The certificate is of a linear model with contacts "
        "that hold; the dots are simulated runs with everything else drawn at once."
    )


def timing_figures(timings: pa.Table) -> dict[str, float | None]:
    """Wall-clock and processor time of a run, s, and runs an hour of a core that does nothing else."""
    cpu = column(timings, "cpu_s")
    cpu = cpu[np.isfinite(cpu)]
    mean = float(cpu.mean()) if cpu.size else None
    return {
        "wall_s": percentile(column(timings, "wall_s"), 50),
        "cpu_s": percentile(cpu, 50),
        "cpu_max_s": percentile(cpu, 100),
        "runs_per_core_hour": 3600.0 / mean if mean else None,
        "step_p999_us": percentile(column(timings, "step_p999_us"), 50),
    }
