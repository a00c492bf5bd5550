"""Runs cases in parallel processes, with a progress bar."""

import contextlib
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from fingergait.reproduce.analysis import analyse, trace_of
from fingergait.reproduce.case import Case, Outcome
from fingergait.run.log import Log
from fingergait.run.report.film import film_strip
from fingergait.run.simulate import simulate
from fingergait.stopping import Stopped, in_processes

Keep = Callable[[dict[str, Any], Stopped], None]

Job = tuple[str, float, Callable[..., Any], tuple[Any, ...]]
"""Label, simulated seconds (the bar's measure), a function of a module, and its arguments."""


def run_case(case: Case) -> Outcome:
    """Runs one case in this process."""
    run = simulate(case.scenario)
    film, note = _film(run.log) if case.film else (None, "")
    trace = trace_of(run.log) if case.trace else {}
    return Outcome(case, run.metrics, analyse(run.log, case.scenario), trace, film, note)


def _film(log: Log) -> tuple[bytes | None, str]:
    with tempfile.TemporaryDirectory() as folder:
        source, picture = Path(folder) / "log.parquet", Path(folder) / "film.png"
        log.write(source)
        problem = film_strip(source, picture)
        return (None, problem) if problem is not None else (picture.read_bytes(), "")


def run_jobs(jobs: Sequence[Job], workers: int, quiet: bool = False, keep: Keep | None = None) -> list[Any]:
    """The results of all jobs in their order; the longest start first.

    Parameters
    ----------
    jobs
        What to run.
    workers
        Processes; 1 runs everything in this one.
    quiet
        Show no progress bar.
    keep
        Given the results so far, by label, where the user stops the command.
    """
    results: dict[int, Any] = {}
    try:
        with _bar(sum(job[1] for job in jobs), quiet) as advance:
            for index, result in _results(jobs, workers):
                results[index] = result
                advance(jobs[index])
    except Stopped as stop:
        if keep is not None:
            keep({jobs[index][0]: result for index, result in results.items()}, stop)
        raise
    return [results[index] for index in range(len(jobs))]


def _results(jobs: Sequence[Job], workers: int) -> Iterator[tuple[int, Any]]:
    order = sorted(range(len(jobs)), key=lambda index: -jobs[index][1])
    for number, result in in_processes([jobs[index][2:] for index in order], workers):
        yield order[number], result


@contextlib.contextmanager
def _bar(total: float, quiet: bool) -> Iterator[Callable[[Job], None]]:
    if quiet:
        yield lambda job: None
        return
    columns = (
        TextColumn("reproduce"),
        BarColumn(),
        TextColumn("{task.completed:.0f}/{task.total:.0f} s simulated  {task.fields[state]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=total, state="")
        yield lambda job: progress.update(task, advance=job[1], state=job[0])
