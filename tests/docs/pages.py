"""What the pages of the documentation hold that can be run: commands, Python, and files that they write down."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").rglob("*.md")) + [ROOT / "README.md"]
_FENCE = re.compile(
    r"(?:^<!-- (?P<note>not run: [^\n]+|exit status \d) -->\n)?^```(?P<kind>\w*)(?P<rest>[^\n]*)\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """A fenced block: what it is, its title if it is a file, its text, and what a comment before it says of it."""

    kind: str
    title: str | None
    text: str
    note: str

    @property
    def runs(self) -> bool:
        return not self.note.startswith("not run")

    @property
    def status(self) -> int:
        """Exit status that its commands have."""
        return int(self.note.rpartition(" ")[2]) if self.note.startswith("exit status") else 0

    def commands(self) -> Iterator[str]:
        """Its lines that call fingergait, without the remarks behind them."""
        for line in self.text.splitlines():
            if line.startswith("fingergait "):
                yield re.sub(r"\s+# .*", "", line)


def blocks(page: Path) -> list[Block]:
    """The blocks of a page, in order."""
    found = []
    for match in _FENCE.finditer(page.read_text(encoding="utf-8")):
        title = re.search(r'title="([^"]+)"', match["rest"])
        found.append(Block(match["kind"], title and title[1], match["text"], match["note"] or ""))
    return found
