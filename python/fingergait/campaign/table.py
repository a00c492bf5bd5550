"""The result of a campaign in the terminal."""

from typing import Any

from rich.console import Console
from rich.table import Table


def show(figures: dict[str, Any], console: Console) -> None:
    """Prints drop rate, limits and where the files are."""
    low, high = figures["interval"]
    rate = "-" if figures["drop_rate"] is None else f"{100 * figures['drop_rate']:.2f} %"
    console.print(
        f"{figures['runs']} runs, {figures['drops']} dropped: {rate} (95 %: {100 * low:.2f} to {100 * high:.2f} %), "
        f"{figures['errors']} crashed",
        highlight=False,
    )
    table = Table("figure", "limit", "measured", "")
    for claim in figures["claims"]:
        verdict = "[green]held[/green]" if claim["held"] else "[red]missed[/red]"
        table.add_row(claim["name"], claim["limit"], claim["measured"], verdict)
    console.print(table)
    console.print(f"report: {figures['report']}\ndata: {figures['data']}", highlight=False)
