"""What the terminal says before anything runs: the welcome, help with examples, lists, completion."""

import json
import os
import shlex
import subprocess
import sys

import click
import pytest
import typer.main

from fingergait.catalogue import KINDS, names
from fingergait.cli import app, main

COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]


def call(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["fingergait", *arguments])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)


def test_without_arguments_it_says_what_to_try(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch) == 0
    assert "fingergait run lift-and-rotate" in capsys.readouterr().out


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_an_example_that_parses(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, name, "--help") == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    examples = [line for line in lines if line.startswith(f"fingergait {name}")]
    assert examples and any(line.startswith("Example") for line in lines)
    for example in examples:
        _, _, *arguments = shlex.split(example)
        with click.Context(typer.main.get_command(app), info_name="fingergait") as parent:
            assert COMMANDS[name].make_context(name, arguments, parent=parent).args == []


@pytest.mark.parametrize("kind", KINDS)
def test_list_has_a_line_on_everything_packaged(
    kind: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "list", kind, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found) == [kind]
    assert list(found[kind]) == names(kind) != []
    assert all(len(line) > 10 for line in found[kind].values())
    assert call(monkeypatch, "list") == 0
    text = capsys.readouterr().out
    assert all(line in text for line in found[kind].values())


def test_list_refuses_another_kind(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(monkeypatch, "list", "robots") == 2
    assert "KIND: expected one of scenarios, hands" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "offered"),
    [("run pu", "push"), ("run hold --controller ", "mu"), ("campaign pa", "paper-box"), ("list sc", "scenarios")],
)
def test_the_shell_completes_names(words: str, offered: str) -> None:
    typed = f"fingergait {words}"
    count = len(typed.split(" ")) - 1
    environment = {
        **os.environ,
        "_FINGERGAIT_COMPLETE": "complete_bash",
        "COMP_WORDS": typed,
        "COMP_CWORD": str(count),
    }
    code = "import sys; sys.argv[0] = 'fingergait'; from fingergait.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert offered in done.stdout.split()
