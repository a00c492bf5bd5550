"""The claims of a reproduction as a table in the terminal."""

from typing import Any

from rich.console import Console
from rich.table import Table


def show_claims(summary: dict[str, Any], console: Console) -> None:
    """Prints the claims of `reproduce`'s JSON, one a row, and where the page is."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("", "claim"):
        table.add_column(name)
    for name in ("paper", "measured", "limit"):
        table.add_column(name, justify="right")
    for claim in summary["claims"]:
        verdict = "[green]held[/]" if claim["held"] else "[red]missed[/]"
        measured = "lost" if claim["measured"] is None else f"{claim['measured']:.3g} {claim['unit']}"
        sign = "≥" if claim["at_least"] else "≤"
        table.add_row(verdict, claim["claim"], claim["paper"], measured, f"{sign} {claim['limit']:g} {claim['unit']}")
    console.print(table)
    counted = f"{summary['held']} of {len(summary['claims'])} claims hold, {summary['seconds']:.0f} s"
    console.print(f"{counted}; page: {summary['report']}", style="bold", highlight=False, soft_wrap=True)
