"""The command `fingergait bench`: measure, print one table, compare with the reference, write JSON and a plot."""

import json
import os
import platform
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from fingergait.bench.measure import Sample, measure
from fingergait.files import make_folder, whole_file, write_text
from fingergait.paths import MODELS

REFERENCE = MODELS / "bench" / "reference.json"
"""What was measured when the reference was committed; only ratios to `YARDSTICK` are compared."""
YARDSTICK = "force_qp/clarabel_in_core"
BUDGET_US = 2000.0
SLOWER = 1.5  # ratio to the reference above which a row counts as changed


def run_bench(out: Path, quick: bool, console: Console) -> dict[str, Any]:
    """Measures, prints to `console`, writes `bench.json` and `latency.png` to `out`; gives what `bench.json` says."""
    make_folder(out)
    samples = measure(3.0, 1, 1) if quick else measure()
    rows = [sample.row(name) for name, sample in sorted(samples.items())]
    slower = changed(rows)
    result = {"rows": rows, "changed": slower, "machine": machine()}
    console.print(table(rows))
    for name, ratio in slower.items():
        console.print(f"[red]{name}: {ratio:.2f} times the reference")
    write_text(out / "bench.json", json.dumps(result, indent=2) + "\n")
    plot(samples, out / "latency.png")
    return result


def machine() -> dict[str, str]:
    """What the figures were measured on."""
    model = platform.processor()
    if os.path.exists("/proc/cpuinfo"):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        model = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), model)
    return {"processor": model, "cores": str(os.cpu_count()), "system": platform.platform()}


def changed(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Rows of our own whose median, in units of the yardstick's, is over 1.5 times the reference's, with that ratio."""
    if not REFERENCE.is_file():
        return {}
    reference = {row["name"]: row for row in json.loads(REFERENCE.read_text(encoding="utf-8"))["rows"]}
    now = {row["name"]: row for row in rows}
    if YARDSTICK not in reference or YARDSTICK not in now:
        return {}
    scale = reference[YARDSTICK]["median_us"] / now[YARDSTICK]["median_us"]
    ratios = {
        name: round(now[name]["median_us"] / reference[name]["median_us"] * scale, 3)
        for name in now.keys() & reference.keys()
        if name.startswith("step/") or name in ("force_qp/core", "gait_lp/python")
    }
    return {name: ratio for name, ratio in sorted(ratios.items()) if ratio > SLOWER}


def table(rows: list[dict[str, Any]]) -> Table:
    """The rows for people."""
    caption = "us; p99.9 as a share of 2 ms; heap allocations; largest error in N (force) and 1/s (LP)"
    made = Table(title="Thread CPU time", caption=caption, box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for name in ("", "median", "p99", "p99.9", "max", "of 2 ms", "heap", "error"):
        # Whole figures in 80 columns, where the table is piped or logged.
        made.add_column(name, justify="right" if name else "left", no_wrap=True)
    for row in rows:
        times = (f"{row[key]:.4g}" for key in ("median_us", "p99_us", "p999_us", "max_us"))
        allocations = "" if row["allocations"] is None else str(row["allocations"])
        error = "" if row["error_max"] is None else f"{row['error_max']:.1e}"
        share = f"{100.0 * row['p999_us'] / BUDGET_US:.1f} %"
        made.add_row(row["name"], *times, share, allocations, error)
    return made


def plot(samples: dict[str, Sample], path: Path) -> None:
    """The distribution of the step's time: what share of the steps took longer."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.add_subplot()
    for name in ("step/hold", "step/gait", "step/faults", "step/python"):
        if name in samples:
            us = np.sort(np.asarray(samples[name].ns) / 1e3)
            axes.loglog(us, 1.0 - np.arange(len(us)) / len(us), label=name)
    axes.axvline(BUDGET_US, color="0.5", linestyle="--", label="period")
    axes.set_xlabel("thread CPU time of one step, us")
    axes.set_ylabel("share of steps that took longer")
    axes.grid(True, which="both", alpha=0.3)
    axes.legend()
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=150)
