"""The command: exit status, one line of error, JSON alone on standard output, and the files of a run."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fingergait.cli import main
from fingergait.paths import MODELS
from fingergait.run.log import Log


def call(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """Exit status of `fingergait ARGUMENTS`, run in this process."""
    monkeypatch.setattr(sys, "argv", ["fingergait", *arguments])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)


RUN_KEYS = set(
    """scenario seed duration_s dropped rotation_rad max_position_error_m max_orientation_error_rad rms_position_error_m
    rms_orientation_error_rad metrics_from_s settling_time_s recovery_time_s gaits gait_time_s qdot_positive_fraction
    min_quality slips saturated_fraction deadline_misses solver step_us real_time_factor log simulator
    versions""".split()
)


def test_run_prints_json_alone_and_writes_its_files(tmp_path: Path) -> None:
    arguments = ["run", "hold", "--duration", "1.0", "--seed", "3", "--json", "--out", str(tmp_path)]
    done = subprocess.run(
        [sys.executable, "-m", "fingergait.cli", *arguments], capture_output=True, text=True, check=True
    )
    metrics = json.loads(done.stdout)
    assert set(metrics) >= RUN_KEYS
    assert metrics["seed"] == 3
    assert set(metrics["step_us"]) == {"mean", "median", "p99", "p999", "max"}
    assert metrics["simulator"]["impratio"] == 10.0
    assert json.loads((tmp_path / "metrics.json").read_text()) == metrics
    log = Log.read(Path(metrics["log"]))
    assert json.loads(log.metadata["scenario"])["duration"] == 1.0
    for name in ("errors.png", "quality.png", "forces.png"):
        assert (tmp_path / name).read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / "film.png").exists() or "apt-get install" in done.stderr


def test_run_shows_its_result_beside_the_papers(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    status = call(monkeypatch, "run", "lift-and-rotate", "--duration", "4", "--out", str(tmp_path))
    text = capsys.readouterr().out
    assert status == 0
    assert "3.7 mm" in text
    assert "impratio 10" in text
    assert str(tmp_path) in text.replace("\n", "")


def test_a_lost_object_is_exit_status_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    arguments = ["run", "hold", "--set", "truth.friction=0.05", "--duration", "3", "--out", str(tmp_path)]
    assert call(monkeypatch, *arguments) == 1
    assert "LOST: " in capsys.readouterr().out


BAD_CALLS = {
    "unknown scenario": (["run", "no-such"], "scenario: expected"),
    "unknown key": (["run", "hold", "--set", "object.masss=1"], "object.masss: expected one of shape, size, mass"),
    "bad value": (["run", "hold", "--set", "object.mass=nan"], "object.mass: expected a finite number, found nan"),
    "core's key": (["run", "hold", "--set", "gait.nothing=1"], "nothing"),
    "no value": (["run", "hold", "--set", "object.mass"], "--set: expected KEY=VALUE"),
    "missing artefact": (["run", "hold", "--controller", "none"], "controller.file: expected"),
    "no option": (["run", "hold", "--no-such"], "No such option"),
    "no mp4": (["run", "hold", "--video", "film.gif"], "--video: expected"),
    "no display": (["run", "hold", "--view=native"], "--view=native: expected a display"),
    "no file": (["check", "nothing.xml"], "FILE: expected a file, found nothing"),
    "no kind": (["check", "nothing.txt"], "FILE: expected a scenario"),
}


@pytest.mark.parametrize("case", BAD_CALLS)
def test_bad_input_is_exit_status_two_and_names_the_field(
    case: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    arguments, message = BAD_CALLS[case]
    assert call(monkeypatch, *arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert message in captured.err
    if case != "no option":  # the option parser draws a box
        assert captured.err.startswith("fingergait: ")
        assert captured.err.count("\n") == 1


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("hand.xml", "a valid hand of 4 fingers"),
        ("scenarios/push.toml", "a valid scenario"),
        ("controllers/mu.json", "a valid controller artefact, mu-synthesis"),
    ],
)
def test_check_describes_a_valid_file(
    file: str, text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(monkeypatch, "check", str(MODELS / file)) == 0
    assert text in capsys.readouterr().out


def test_check_refuses_a_hand_without_fingertips(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "stump.xml"
    path.write_text("<mujoco><worldbody><geom name='stump' size='1'/></worldbody></mujoco>")
    assert call(monkeypatch, "check", str(path)) == 2
    assert "stump.xml: fingers: expected 2 to 6 fingers, found 0" in capsys.readouterr().err


def test_the_suite_prints_a_row_a_seed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["suite", "--seeds", "2", "--workers", "2", "--set", "duration=2.5", "--json"]
    status = call(monkeypatch, *arguments)
    result = json.loads(capsys.readouterr().out)
    assert status == (0 if result["held"] == 2 else 1)
    assert [row["seed"] for row in result["runs"]] == [0, 1]
    assert all(np.isfinite(row["max_position_error_m"]) for row in result["runs"])
    assert result["held"] == sum(not row["missed"] for row in result["runs"])
