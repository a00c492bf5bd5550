"""The command `fingergait synthesize`: prints the iterations, writes the artefact and the report."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, TextIO

from .dk import Iteration
from .rate import at_rate
from .report import write_report
from .spec import SynthesisSpec
from .synthesize import Controller, synthesize


def run_synthesize(
    spec_path: str | Path,
    out: str | Path,
    as_json: bool = False,
    *,
    rate: float | None = None,
    bodies: int = 2000,
    stream: TextIO | None = None,
) -> dict[str, Any]:
    """Synthesises a controller, writes `out` and the report beside it, and returns the figures of the JSON output.

    Parameters
    ----------
    spec_path : TOML spec
    out : where the artefact goes; the report gets the same name with the suffix .html
    as_json : print the figures as one JSON object on standard output, and progress on standard error
    rate : Hz, instead of the spec's, see `rate.at_rate`
    bodies : nonlinear bodies in the verification
    stream : where progress goes; None: standard error with `as_json`, else standard output

    Raises
    ------
    SynthesisError
        A wrong or infeasible spec, or a stage that loses the guarantee; nothing is written.
    """
    progress = stream if stream is not None else (sys.stderr if as_json else sys.stdout)
    count = 0

    def iteration(axis: str, step: Iteration) -> None:
        nonlocal count
        count += 1
        if count == 1:
            print(f"{'axis':8} {'gamma':>9} {'mu peak':>9} {'order':>6}", file=progress)
        print(f"{axis:8} {step.gamma:9.4f} {step.mu_peak:9.4f} {step.order:6d}", file=progress, flush=True)

    spec = SynthesisSpec.load(spec_path)
    if rate is not None:
        spec = at_rate(spec, rate)
        c = spec.control
        print(
            f"{c.rate_hz:g} Hz: delay {1e3 * c.delay:.3g} ms ({c.delay * c.rate_hz:g} samples, as in the spec), "
            f"dead time with the hold {1e3 * c.dead_time:.3g} ms",
            file=progress,
        )
    controller = synthesize(
        spec, progress=iteration, note=lambda line: print(f"... {line}", file=progress, flush=True), bodies=bodies
    )
    out = Path(out)
    controller.write(out)
    report = out.with_suffix(".html")
    write_report(controller, report)
    figures = summary(controller, out, report)
    if as_json:
        print(json.dumps(figures, indent=2, allow_nan=False))
    else:
        for line in controller.certificate.words(spec):
            print(line, file=progress)
        print(f"{controller.seconds:.0f} s; wrote {out} and {report}", file=progress)
    return figures


def summary(controller: Controller, artefact: Path, report: Path) -> dict[str, Any]:
    """The JSON object of `fingergait synthesize --json`."""
    spec, certificate = controller.spec, controller.certificate
    figures = certificate.figures()
    return {
        "mu_peak": figures["mu_peak"],
        "mu_lower": figures["mu_lower"],
        "mu_peak_per_axis": figures["mu_peak_per_axis"],
        "mu_by_stage": figures["mu_by_stage"],
        "mu_stability": figures["mu_stability"],
        "order": controller.order,
        "iterations": controller.iterations,
        "seconds": controller.seconds,
        "uncertainty": {
            "mass": spec.uncertainty.mass,
            "inertia": list(spec.uncertainty.inertia),
            "damping": [
                spec.uncertainty.damping.centre * (1.0 - spec.uncertainty.damping.size),
                spec.uncertainty.damping.centre * (1.0 + spec.uncertainty.damping.size),
            ],
        },
        "rate_hz": spec.control.rate_hz,
        "delay_s": spec.control.dead_time,
        "delay_margin_s": figures["delay_margin_s"],
        "gain_margins": figures["gain_margins"],
        "campaign": figures["campaign"],
        "deviations": figures["deviations"],
        "artefact": str(artefact),
        "report": str(report),
    }
