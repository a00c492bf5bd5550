"""The pages of the documentation do what they say: commands run, Python runs, and each file on them is valid."""

import shlex
import sys
from pathlib import Path
from typing import Any

import click
import pytest
import typer.main
from pages import PAGES, ROOT, blocks

from fingergait.cli import app, main, spelled_out
from fingergait.paths import MODELS

# What makes a command short enough for a test. Later options win over those on the page.
QUICK = {
    "run": ["--set", "duration=1.0"],
    "suite": ["--set", "duration=4", "--seeds", "1", "--workers", "1"],
    "campaign": ["--samples", "1", "--workers", "1"],
    "bench": ["--quick"],
}
# Minutes, however quick, or without an end: their options are read, and tests of their own run them.
LONG = ("synthesize", "reproduce", "adopt", "grasps", "play", "show")
# On these pages the object is lost, or the log is read afterwards: they need the time that they take.
AS_WRITTEN = ("truth.friction=0.05", "--out runs/mine")


def quick(command: str) -> list[str]:
    """The arguments of a command on a page, for a test."""
    _, *arguments = shlex.split(command)
    if arguments[0] == "run" and any(part in command for part in AS_WRITTEN):
        return arguments
    if "--no-gait" in arguments:  # lost after half a minute, which the paper's tests show
        return [*arguments, "--set", "duration=1.0"]
    kept = [a for i, a in enumerate(arguments) if a != "--duration" and arguments[i - 1] != "--duration"]
    return kept + QUICK.get(arguments[0], [])


def execute(command: str, status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments = quick(command)
    if arguments[0] in LONG or "--view" in arguments:
        group: Any = typer.main.get_command(app)
        name, *rest = spelled_out(arguments)
        with click.Context(group, info_name="fingergait") as parent:
            assert group.commands[name].make_context(name, rest, parent=parent).args == []
        return
    monkeypatch.setattr(sys, "argv", ["fingergait", *arguments])
    with pytest.raises(SystemExit) as stop:
        main()
    # One sample of a campaign may miss the limits that a thousand hold.
    expected = (0, 1) if arguments[0] == "campaign" else (status,)
    assert int(stop.value.code or 0) in expected, command


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_shows_runs(page: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("fingergait.run.command.film_strip", lambda *_: None)  # seconds each; test_cli.py looks at it
    (tmp_path / "models").symlink_to(MODELS)
    found = blocks(page)
    for block in found:
        if block.title is not None:
            Path(block.title).write_text(block.text, encoding="utf-8")
    names: dict[str, object] = {"__name__": "page"}
    for block in found:
        if block.runs and block.kind == "python":
            exec(compile(block.text, str(page), "exec"), names)
        elif block.runs and block.kind == "sh":
            for command in block.commands():
                execute(command, block.status, monkeypatch)


def test_commands_stand_in_blocks_that_are_tested() -> None:
    for page in PAGES:
        for block in blocks(page):
            assert block.kind in ("sh", "bash") or not list(block.commands()), f"{page}: {block.text}"


def test_most_blocks_are_run() -> None:
    found = [block for page in PAGES for block in blocks(page) if block.kind in ("sh", "python")]
    assert sum(block.runs for block in found) > 0.7 * len(found) > 15
