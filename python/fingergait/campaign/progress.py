"""What a running campaign shows: runs done, time left, drop rate so far."""

from collections import Counter
from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from fingergait.campaign.statistics import wilson


class CampaignProgress:
    """A progress bar on standard error.

    Parameters
    ----------
    name
        Of the campaign.
    total
        Runs that it has.
    seen
        How many of each status there are already, from a campaign that is resumed.
    """

    def __init__(self, name: str, total: int, seen: Counter[str]) -> None:
        self._seen = seen
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[state]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
        )
        self._task = self._progress.add_task(name, total=total, completed=seen.total(), state=self.state)

    @property
    def state(self) -> str:
        """Drop rate so far with its interval, and crashes."""
        drops, errors = self._seen["dropped"], self._seen["error"]
        runs = self._seen.total() - errors
        low, high = wilson(drops, runs)
        rate = f"{100 * drops / runs:.1f} %" if runs else "-"
        crashed = f", {errors} crashed" if errors else ""
        return f"{drops} dropped, {rate} ({100 * low:.1f} to {100 * high:.1f}){crashed}"

    def add(self, statuses: list[str]) -> None:
        """Counts runs that have finished."""
        self._seen.update(statuses)
        self._progress.update(self._task, advance=len(statuses), state=self.state)

    def __enter__(self) -> "CampaignProgress":
        self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._progress.stop()
