"""Runs trials on dask: a local cluster of one-thread processes, or any scheduler that is already there."""

import contextlib
import logging
import os
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

import dask
from distributed import Client, KilledWorker, LocalCluster, as_completed
from distributed.client import Future

from fingergait._core import ConfigError, FingergaitError
from fingergait.campaign.trial import METRICS, OBSERVED, Outcome, Trial, run_trial
from fingergait.stopping import shielded

_CONNECT_S = 10.0
_ATTEMPTS = 3  # times that a run is handed in again after the scheduler lost it
_AHEAD = 4  # tasks handed in for each core: enough to keep it busy, few enough to lose little
_TASKS = 64  # cores from which on a task takes more than one run


def default_workers() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextlib.contextmanager
def connect(scheduler: str | None, workers: int | None) -> Iterator[Client]:
    """A client of the scheduler at that address, or of a new local cluster of `workers` processes."""
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    if scheduler is not None:
        try:
            with shielded():
                client = Client(scheduler, timeout=_CONNECT_S)
        except (OSError, TimeoutError, ValueError) as error:
            found = " ".join(str(error).split()) or type(error).__name__
            raise ConfigError(f"--scheduler: expected a dask scheduler at {scheduler}, found none ({found})") from None
        with client:
            yield client
        return
    settings = {
        "distributed.worker.daemon": True,
        "distributed.scheduler.worker-saturation": 2.0,  # the next run is there when one ends
        "distributed.worker.profile.enabled": False,  # it stops the run a hundred times a second
        "distributed.admin.tick.limit": "60s",
    }
    with dask.config.set(settings):
        with shielded():
            cluster = LocalCluster(
                n_workers=workers or default_workers(),
                threads_per_worker=1,
                processes=True,
                dashboard_address=":0",
                silence_logs=logging.CRITICAL,
            )
        with cluster, Client(cluster) as client:
            yield client


def run_all(client: Client, trials: Iterator[Trial], done: Callable[[list[Outcome]], None]) -> None:
    """Runs all trials and shows `done` each batch of outcomes as it comes.

    Only a few runs for each worker are handed in at a time. A run whose worker dies is given to another by dask; one
    that kills every worker it gets becomes a row with that error. On many cores each task takes several runs, so that
    the scheduler keeps up.

    Raises
    ------
    FingergaitError
        Where the scheduler goes away, or a worker runs another build.
    """
    waiting: dict[str, tuple[list[Trial], int]] = {}
    finished = as_completed()

    def hand_in(task: list[Trial], attempt: int) -> None:
        # No two submissions share a key: a scheduler that still knows a failed one would answer with it.
        key = f"fingergait-{task[0].build}-{client.id}-{task[0].index}-{len(task)}-{attempt}"
        waiting[key] = task, attempt
        finished.add(client.submit(run_trials, task, key=key, pure=False))

    def refill() -> None:
        cores = sum(client.nthreads().values())
        for _ in range(max(_AHEAD, _AHEAD * cores) - len(waiting)):
            task = list(islice(trials, max(1, cores // _TASKS)))
            if not task:
                return
            hand_in(task, 1)

    refill()
    while waiting:
        outcomes: list[Outcome] = []
        for future in finished.next_batch(block=True):
            task, attempt = waiting.pop(future.key)
            found, again = _outcome(future, task, attempt)
            outcomes += found
            for rest in again:
                hand_in(rest, attempt + 1)
        if outcomes:
            done(outcomes)
        refill()


def run_trials(task: list[Trial]) -> list[Outcome]:
    """Runs several samples one after the other."""
    return [run_trial(trial) for trial in task]


def _outcome(future: Future[Any], task: list[Trial], attempt: int) -> tuple[list[Outcome], list[list[Trial]]]:
    """What a finished future says, and what must be handed in again."""
    if future.status == "finished":
        outcomes: list[Outcome] = future.result()
        for outcome in outcomes:
            outcome.timing["attempts"] = attempt
        return outcomes, []
    error: Any = future.exception() if future.status == "error" else None
    if isinstance(error, KilledWorker):
        if len(task) > 1:  # one of them kills: the others must not suffer for it
            return [], [[trial] for trial in task]
        row = {"error": "KilledWorker: each worker that took this run died", **dict.fromkeys([*METRICS, *OBSERVED])}
        return [Outcome(task[0].index, row, {"attempts": attempt})], []
    if isinstance(error, FingergaitError):
        raise error
    if attempt >= _ATTEMPTS:
        found = "a cancelled run" if error is None else f"{type(error).__name__}: {error}"
        raise FingergaitError(f"scheduler: expected an outcome of run {task[0].index}, found {found}; --resume goes on")
    return [], [task]
