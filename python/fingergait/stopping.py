"""Ctrl-C and SIGTERM: what was measured so far is kept, and one line says so."""

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from multiprocessing import resource_tracker
from types import FrameType
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM)

Call = tuple[Callable[..., Any], tuple[Any, ...]]
"""A function of a module, and its arguments."""


class Stopped(BaseException):
    """The user has stopped the command. No `Exception`, so that nobody takes it for an error of a run.

    Parameters
    ----------
    message
        What is kept, and how to go on.
    signum
        The signal; the exit status is 128 more, as shells have it.
    """

    def __init__(self, message: str = "nothing was written", signum: int = signal.SIGINT) -> None:
        super().__init__(message)
        self.status = 128 + signum


@contextlib.contextmanager
def stoppable() -> Iterator[None]:
    """Ctrl-C and SIGTERM raise `Stopped` in this block."""

    def stop(signum: int, frame: FrameType | None) -> None:
        raise Stopped(signum=signum)

    with _handled_by(stop):
        yield


class StopFlag:
    """Whether the user has asked to stop. A second request doesn't wait."""

    signum: int | None = None

    def __bool__(self) -> bool:
        return self.signum is not None


@contextlib.contextmanager
def stop_flag() -> Iterator[StopFlag]:
    """Turns the first Ctrl-C or SIGTERM into a flag that the block looks at when it suits it."""
    flag = StopFlag()

    def ask(signum: int, frame: FrameType | None) -> None:
        if flag:
            raise Stopped("stopped at once; files may be missing", signum)
        flag.signum = signum

    with _handled_by(ask):
        yield flag


@contextlib.contextmanager
def _handled_by(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """The signals go to `handler` in this block, but for those that are ignored; nothing changes in other threads."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    former = {signum: signal.getsignal(signum) for signum in _SIGNALS}
    former = {signum: old for signum, old in former.items() if old is not signal.SIG_IGN}
    for signum in former:
        signal.signal(signum, handler)
    try:
        yield
    finally:
        for signum, old in former.items():
            signal.signal(signum, old)


@contextlib.contextmanager
def shielded() -> Iterator[None]:
    """Processes and threads that are started in this block do not see Ctrl-C: their parent ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # as it starts, it unblocks the signal
    former = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, former)


def in_processes(calls: Sequence[Call], workers: int) -> Iterator[tuple[int, Any]]:
    """Number and result of each call, as they come, from that many processes; 1 runs all in this one, in order.

    Whatever ends the loop, an error, Ctrl-C or the caller, ends the processes with it.
    """
    if workers == 1:
        yield from ((number, function(*arguments)) for number, (function, arguments) in enumerate(calls))
        return
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
    try:
        with shielded():
            pending: dict[Future[Any], int] = {
                pool.submit(function, *arguments): number for number, (function, arguments) in enumerate(calls)
            }
        for future in as_completed(pending):
            yield pending[future], future.result()
        pool.shutdown()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - before:
            process.terminate()
        raise
