"""How far a run is: a bar in a terminal, or in a notebook."""

import importlib
import time
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from fingergait.run.log import Log
from fingergait.scenario import Scenario

_EVERY = 0.1  # s between two updates


class RunProgress:
    """A progress bar of one run, on standard error or below the notebook's cell.

    Parameters
    ----------
    scenario
        Whose duration is 100 %.
    shown
        False: nothing is drawn, and nor is anything where standard error is neither a terminal nor a notebook's.
    """

    def __init__(self, scenario: Scenario, shown: bool = True) -> None:
        self._name, self._duration, self._next = scenario.name, scenario.duration, 0.0
        self._bar = _Nothing() if not shown else _NotebookBar(self._name) if in_notebook() else _TerminalBar(scenario)

    def __enter__(self) -> "RunProgress":
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def update(self, t: float, log: Log) -> None:
        """Shows simulated time t, s, and the newest row of the log; cheap enough to be called at every step."""
        now = time.perf_counter()
        if now >= self._next:
            self._next = now + _EVERY
            state = f"{int(log.last('gaits'))} gaits, Q {log.last('Q'):.5f}"
            self._bar.show(max(0.0, t), self._duration, state)


def in_notebook() -> bool:
    """Whether this runs in a kernel that shows HTML, as Jupyter's does."""
    try:
        from IPython.core.getipython import get_ipython
    except ImportError:
        return False
    return getattr(get_ipython(), "kernel", None) is not None


class _Nothing:
    def start(self) -> None: ...

    def show(self, done: float, total: float, state: str) -> None: ...

    def stop(self) -> None: ...


class _TerminalBar:
    def __init__(self, scenario: Scenario) -> None:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed:5.1f}/{task.total:.0f} s  {task.fields[state]}"),
            TimeElapsedColumn(),
        )
        console = Console(stderr=True)
        self._progress = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self._progress.add_task(scenario.name, total=scenario.duration, state="")

    def start(self) -> None:
        self._progress.start()

    def show(self, done: float, total: float, state: str) -> None:
        self._progress.update(self._task, completed=done, state=state)

    def stop(self) -> None:
        self._progress.stop()


class _NotebookBar:
    """HTML's own progress element: rich's bar would need ipywidgets."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._display = importlib.import_module("IPython.display")
        self._handle: Any = None

    def start(self) -> None:
        self._handle = self._display.display(self._display.HTML(""), display_id=True)

    def show(self, done: float, total: float, state: str) -> None:
        bar = f'<progress value="{done:.2f}" max="{total:.2f}"></progress>'
        self._handle.update(self._display.HTML(f"{self._name} {bar} {done:.1f} s, {state}"))

    def stop(self) -> None:
        self._handle.update(self._display.HTML(""))
