"""What can't be written is one line and exit status 2, and nothing half-written; names may be any bytes."""

import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fingergait import files
from fingergait._core import ConfigError
from fingergait.files import make_folder, whole_file, write_text
from fingergait.paths import MODELS, as_path, as_text
from fingergait.run.log import Log
from fingergait.run.report import plots
from test_cli import call

RAW = os.fsdecode(b"h\xe4nd-\xff")  # Latin-1, no UTF-8


def left_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_is_there_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "text.txt"
    write_text(path, "before")
    with pytest.raises(ConfigError, match="No space left on device"), whole_file(path) as temporary:
        temporary.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")
    assert path.read_text() == "before" and left_in(tmp_path) == ["text.txt"]
    with pytest.raises(KeyboardInterrupt), whole_file(path) as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "before" and left_in(tmp_path) == ["text.txt"]
    (tmp_path / "folder").mkdir()
    with pytest.raises(ConfigError, match="Is a directory"):
        write_text(tmp_path / "folder", "text")
    assert left_in(tmp_path) == ["folder", "text.txt"]


def test_a_folder_is_tried_before_anything_runs(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(ConfigError, match=r"--out: expected a folder that can be written, found .*file"):
            make_folder(folder)


OUT_IN_THE_WAY = {
    "run": ["run", "hold", "--duration", "1"],
    "campaign": ["campaign", "paper-box", "--samples", "1"],
    "reproduce": ["reproduce", "--quick"],
    "synthesize": ["synthesize"],
    "bench": ["bench", "--quick"],
}


@pytest.mark.parametrize("command", OUT_IN_THE_WAY)
def test_a_file_where_a_folder_should_be_is_one_line(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("in the way")
    out = tmp_path / "file" / ("K.json" if command == "synthesize" else "out")
    assert call(monkeypatch, *OUT_IN_THE_WAY[command], "--out", str(out)) == 2
    said = capsys.readouterr().err
    assert said.startswith("fingergait: --out: expected a folder that can be written") and said.count("\n") == 1
    assert (tmp_path / "file").read_text() == "in the way"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
@pytest.mark.parametrize("command", OUT_IN_THE_WAY)
def test_a_folder_without_permission_is_one_line(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    tmp_path.chmod(0o500)
    out = tmp_path / ("K.json" if command == "synthesize" else "out")
    try:
        assert call(monkeypatch, *OUT_IN_THE_WAY[command], "--out", str(out)) == 2
        assert capsys.readouterr().err.count("\n") == 1 and left_in(tmp_path) == []
    finally:
        tmp_path.chmod(0o700)


@pytest.mark.parametrize("full_at", ["log.parquet", "metrics.json", "quality.png"])
def test_a_disk_that_fills_up_is_one_line_and_leaves_whole_files(
    full_at: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    sync = files._sync

    def full(path: Path) -> None:
        if path.suffix == Path(full_at).suffix and not (
            full_at == "quality.png" and "errors.png" not in left_in(tmp_path)
        ):
            raise OSError(errno.ENOSPC, "No space left on device")
        sync(path)

    monkeypatch.setattr(files, "_sync", full)
    assert call(monkeypatch, "run", "hold", "--duration", "0.5", "--out", str(tmp_path)) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and full_at in said and "No space left on device" in said
    assert not any(name.startswith(".") for name in left_in(tmp_path)) and full_at not in left_in(tmp_path)
    for name in left_in(tmp_path):  # what is there is whole
        if name == "log.parquet":
            assert len(Log.read(tmp_path / name)) > 100
        elif name == "metrics.json":
            json.loads((tmp_path / name).read_text())


def test_an_error_of_the_system_that_nobody_expected_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def fails(*_: object) -> None:
        raise OSError(errno.EIO, "Input/output error", "somewhere")

    monkeypatch.setattr("fingergait.run.command.write_plots", fails)
    assert plots.write_plots is not fails
    assert call(monkeypatch, "run", "hold", "--duration", "0.5", "--out", str(tmp_path)) == 2
    assert capsys.readouterr().err == "fingergait: somewhere: Input/output error\n"


def test_names_that_are_no_text_pass_through_text() -> None:
    for name in (RAW, "plain", "ümläut", "中"):
        text = as_text(name)
        text.encode("utf-8")
        assert str(as_path(text)) == name


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names")
@pytest.mark.parametrize(("encoding", "as_json"), [("latin-1", False), ("ascii", True)])
def test_files_and_terminals_that_are_not_utf_8(encoding: str, as_json: bool, tmp_path: Path) -> None:
    folder = tmp_path / RAW
    folder.mkdir()
    hand, scenario = folder / f"{RAW}.xml", folder / f"{RAW}.toml"
    shutil.copy(MODELS / "hand.xml", hand)
    text = (MODELS / "scenarios" / "hold.toml").read_text(encoding="utf-8")
    scenario.write_text(text, encoding="utf-8")
    environment = {**os.environ, "PYTHONIOENCODING": encoding, "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"}

    def run(*arguments: str | Path) -> str:
        command = [sys.executable, "-m", "fingergait.cli", *map(str, arguments)]
        done = subprocess.run(command, env=environment, capture_output=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout.decode(encoding)

    assert "valid" in run("check", hand) and "valid" in run("check", scenario)
    arguments = ["run", scenario, "--set", f"hand.file={hand}", "--duration", "0.3", "--out", folder / "out"]
    said = run(*arguments, *(["--json"] if as_json else []))
    log = folder / "out" / "log.parquet"
    assert Path(json.loads(said)["log"]) == log if as_json else "completed" in said
    assert len(Log.read(log)) > 100
    missing = subprocess.run(
        [sys.executable, "-m", "fingergait.cli", "run", str(folder / "none")], env=environment, capture_output=True
    )
    assert missing.returncode == 2 and missing.stderr.count(b"\n") == 1 and b"Traceback" not in missing.stderr
