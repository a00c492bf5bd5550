"""The pages of the documentation do what they say: commands run, Python runs, and each file on them is valid."""

import shlex
import sys
from pathlib import Path

import pytest
from pages import PAGES, ROOT, Block, blocks

from fingergait.cli import main

# What makes a command short enough for a test. Later options win over those on the page.
QUICK = {
    "run": ["--set", "duration=1.0"],
    "suite": ["--set", "duration=1.5", "--seeds", "1", "--workers", "1"],
    "campaign": ["--samples", "1", "--workers", "1"],
    "bench": ["--quick"],
}
# The duration on these pages is what they are about: the object is lost, or a log is read afterwards.
AS_WRITTEN = ("truth.friction=0.05", "--out runs/mine")


def quick(command: str) -> list[str]:
    """The arguments of a command on a page, for a test."""
    _, *arguments = shlex.split(command)
    if any(part in command for part in AS_WRITTEN):
        return arguments
    kept = [a for i, a in enumerate(arguments) if a != "--duration" and arguments[i - 1] != "--duration"]
    return kept + QUICK.get(arguments[0], [])


def run(block: Block, names: dict[str, object], monkeypatch: pytest.MonkeyPatch) -> None:
    if block.title is not None:
        Path(block.title).write_text(block.text, encoding="utf-8")
    elif block.kind == "python":
        exec(compile(block.text, "page", "exec"), names)
    else:
        for command in block.commands():
            monkeypatch.setattr(sys, "argv", ["fingergait", *quick(command)])
            with pytest.raises(SystemExit) as stop:
                main()
            status = int(stop.value.code or 0)
            assert status == block.status, f"{command}: exit status {status}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_shows_runs(page: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "page"}
    for block in blocks(page):
        if block.runs:
            run(block, names, monkeypatch)


def test_most_blocks_are_run() -> None:
    found = [block for page in PAGES for block in blocks(page) if block.kind in ("sh", "python")]
    assert sum(block.runs for block in found) > 0.7 * len(found) > 15
