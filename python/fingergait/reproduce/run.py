"""The work of `fingergait reproduce`: all runs, the verdicts, the page and the JSON file."""

import json
import time
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from fingergait.files import make_folder, write_text
from fingergait.reproduce.ablations import ablation_cases, ablation_table
from fingergait.reproduce.case import Case
from fingergait.reproduce.experiments import all_experiments
from fingergait.reproduce.limits import Bisection, Limit, all_limits, bisect_by_key
from fingergait.reproduce.pool import Job, Keep, run_case, run_jobs
from fingergait.reproduce.result import Reproduction, settings_of
from fingergait.stopping import Stopped


def reproduce(out: Path, quick: bool, workers: int, quiet: bool = False) -> dict[str, Any]:
    """Runs every experiment, writes `index.html` and `reproduce.json` into `out`, and returns the JSON.

    Parameters
    ----------
    out
        Folder of the results.
    quick
        Fewer seeds, shorter runs, coarser limits.
    workers
        Processes.
    quiet
        Show no progress.
    """
    make_folder(out)
    keep = partial(_keep, out / "partial.json")
    result = run_all(quick, workers, quiet, keep)
    from fingergait.reproduce.page import write_page  # matplotlib is slow to import

    report = out / "index.html"
    write_page(result, report)
    summary = as_json(result, report)
    write_text(out / "reproduce.json", json.dumps(summary, indent=2) + "\n")
    return summary


def run_all(quick: bool, workers: int, quiet: bool = False, keep: Keep | None = None) -> Reproduction:
    """Runs every experiment, bisection and ablation; writes nothing. `keep`: see `run_jobs`."""
    begin = time.perf_counter()
    experiments, limits = all_experiments(quick), all_limits()
    cases = [case for experiment in experiments for case in experiment.cases]
    ablations = ablation_cases(quick)
    seeds, halvings = (1, 3) if quick else (3, 6)
    searches = [(limit, seed) for limit in limits for seed in range(seeds)]
    jobs = [_case_job(case) for case in (*cases, *ablations)]
    jobs += [_search_job(limit, seed, halvings) for limit, seed in searches]
    results = run_jobs(jobs, workers, quiet, keep)
    outcomes = {case.key: outcome for case, outcome in zip(cases, results, strict=False)}
    removed = {case.key: outcome for case, outcome in zip(ablations, results[len(cases) :], strict=False)}
    found: list[Bisection] = results[len(cases) + len(ablations) :]
    return Reproduction(
        quick=quick,
        seconds=time.perf_counter() - begin,
        experiments=experiments,
        claims={e.key: e.judge({case.key: outcomes[case.key] for case in e.cases}) for e in experiments},
        outcomes=outcomes,
        limits=limits,
        bisections={limit.key: [b for b in found if b.key == limit.key] for limit in limits},
        ablations=ablation_table(removed),
    )


def _keep(path: Path, results: dict[str, Any], stop: Stopped) -> None:
    """Writes the figures of the runs that are done when the user stops the command, and says so in `stop`."""
    figures = {
        label: asdict(result) if isinstance(result, Bisection) else {**result.metrics, **result.extra}
        for label, result in results.items()
    }
    if figures:
        write_text(path, json.dumps(figures, indent=2, default=str) + "\n")
        stop.args = (f"no verdict yet; the figures of the {len(figures)} runs that are done: {path}",)


def _case_job(case: Case) -> Job:
    return (case.key, case.scenario.duration + (10.0 if case.film else 0.0), run_case, (case,))


def _search_job(limit: Limit, seed: int, halvings: int) -> Job:
    runs = 0.7 * (2 + halvings)  # a lost object ends its run early
    label = f"limit: {limit.title}, seed {seed}"
    return (label, runs * limit.duration(limit.easy), bisect_by_key, (limit.key, seed, halvings))


def as_json(result: Reproduction, report: Path) -> dict[str, Any]:
    """The reproduction as JSON: `claims`, `report`, and what the page shows besides."""
    claims = [claim.row() for claim in result.all_claims]
    return {
        "claims": claims,
        "report": str(report),
        "held": sum(bool(claim["held"]) for claim in claims),
        "quick": result.quick,
        "seconds": result.seconds,
        "limits": {
            key: [asdict(bisection) for bisection in bisections] for key, bisections in result.bisections.items()
        },
        "ablations": {
            variant: {condition: asdict(cell) for condition, cell in row.items()}
            for variant, row in result.ablations.items()
        },
        **settings_of(result),
    }
