"""The sampled suite as a growing table with a summary."""

from typing import Any

from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn

from fingergait.run.sampling import ORIENTATION_LIMIT, POSITION_LIMIT

_HEAD = "seed  radius  h/2   mass  true  inertia  yaw    turned     position  orientation  gaits  verdict"


class SuiteTable:
    """Prints one line a seed as it comes and a progress bar below.

    Parameters
    ----------
    total
        Number of seeds.
    console
        Where to.
    """

    def __init__(self, total: int, console: Console) -> None:
        self._console = console
        bar = Console(stderr=True)
        self._progress = Progress(
            *Progress.get_default_columns()[:2],
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=bar,
            transient=True,
            disable=not bar.is_terminal,
        )
        self._task = self._progress.add_task("seeds", total=total)

    def __enter__(self) -> "SuiteTable":
        self._console.print(_HEAD, style="bold", highlight=False, soft_wrap=True)
        self._progress.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._progress.stop()

    def add(self, row: dict[str, Any]) -> None:
        """Prints one seed's line."""
        verdict = "held" if not row["missed"] else ", ".join(row["missed"])
        if row["lost_reason"]:
            verdict += f": {row['lost_reason']}"
        self._console.print(
            f"{row['seed']:4d}  {1e3 * row['radius_m']:4.1f}  {1e3 * row['half_height_m']:4.1f} mm  "
            f"{row['mass_kg']:.2f} x {row['mass_scale']:.2f}  {row['inertia_scale']:7.2f}  {row['yaw_rate']:+.1f}  "
            f"{57.29578 * row['rotation_rad']:+5.0f} deg  {_milli(row['max_position_error_m'])} mm  "
            f"{_milli(row['max_orientation_error_rad'])} mrad  {row['gaits']:5d}  {verdict}",
            highlight=False,
            soft_wrap=True,
            style="red" if row["missed"] else None,
        )
        self._progress.advance(self._task)

    def summary(self, rows: list[dict[str, Any]]) -> dict[str, Any]:
        """Prints and returns how many seeds held the limits, how many lost the object, and the worst errors."""
        kept = [row for row in rows if not row["dropped"]]
        worst = {
            key: max((row[key] for row in kept if row[key] is not None), default=None)
            for key in ("max_position_error_m", "max_orientation_error_rad")
        }
        summary = {
            "seeds": len(rows),
            "held": sum(not row["missed"] for row in rows),
            "dropped": len(rows) - len(kept),
            **{f"worst_{key}": value for key, value in worst.items()},
            "limits": {"position_error_m": POSITION_LIMIT, "orientation_error_rad": ORIENTATION_LIMIT},
        }
        errors = f"{_milli(worst['max_position_error_m'])} mm, {_milli(worst['max_orientation_error_rad'])} mrad"
        counts = f"{summary['held']} of {len(rows)} held the limits, {summary['dropped']} lost the object"
        self._console.print(f"{counts}; worst of the others {errors}", style="bold", highlight=False, soft_wrap=True)
        return summary


def _milli(value: float | None) -> str:
    return "    -" if value is None else f"{1e3 * value:5.2f}"
