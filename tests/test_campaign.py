"""Campaigns end to end: rows, report and exact replay; killed workers and commands lose and repeat nothing."""

import contextlib
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import psutil
import pyarrow as pa
import pytest
from distributed import KilledWorker

from fingergait._core import FingergaitError
from fingergait.campaign import cluster, trial
from fingergait.campaign.build import build_id
from fingergait.campaign.store import Store, row_schema
from fingergait.cli import main
from fingergait.run.simulate import simulate
from fingergait.scenario import Scenario, parse_override

SPEC = """
scenario = "hold"
samples = 12
seed = 5

[set]
duration = 0.7

[vary]
"truth.mass_scale" = { uniform = [0.8, 1.2] }
"truth.first_grasp[0:2]" = { ball = 0.002 }
"sensors.position_noise" = { choice = [0.0, 1e-4] }

[limits]
drop_rate = 0.0
"""


def command(folder: Path, *options: str) -> list[str]:
    spec = folder.parent / "case.toml"
    spec.write_text(SPEC)
    return [sys.executable, "-m", "fingergait.cli", "campaign", str(spec), "--out", str(folder), "--json", *options]


def rows_of(folder: Path) -> pa.Table:
    manifest = json.loads((folder / "campaign.json").read_text())
    drawn = {"truth.mass_scale": True, "truth.first_grasp[0]": True, "truth.first_grasp[1]": True}
    schema = row_schema(drawn | {"sensors.position_noise": True})
    return Store(folder, manifest, schema, resume=True).rows()


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], pa.Table]:
    """Figures and rows of the campaign when nothing happens to it."""
    folder = tmp_path_factory.mktemp("undisturbed") / "out"
    done = subprocess.run(command(folder, "--workers", "2"), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), rows_of(folder)


def test_a_campaign_gives_rows_figures_and_a_page(undisturbed: tuple[dict[str, Any], pa.Table]) -> None:
    figures, rows = undisturbed
    assert set(figures) >= {"runs", "drops", "errors", "drop_rate", "interval", "data", "report"}
    assert (figures["runs"], figures["drops"], figures["errors"], figures["drop_rate"]) == (12, 0, 0, 0.0)
    assert rows.column("index").to_pylist() == list(range(12))
    assert set(rows.column("status").to_pylist()) == {"held"}
    assert set(rows.column("bad_commands").to_pylist()) == {0}
    page = Path(figures["report"]).read_text()
    assert page.startswith("<!doctype html>") and page.rstrip().endswith("</html>")
    assert 'src="http' not in page and "<script" not in page and "<link" not in page  # opens without a network
    assert page.count("data:image/svg+xml;base64,") >= 1
    assert "paper 3.70" in page and "campaign.json" not in page
    written = json.loads(Path(figures["data"]).parent.joinpath("summary.json").read_text())
    assert written == figures


def test_the_replay_command_gives_the_row_again(undisturbed: tuple[dict[str, Any], pa.Table]) -> None:
    _, rows = undisturbed
    row = rows.slice(7, 1).to_pylist()[0]
    words = shlex.split(row["replay"])
    assert words[:3] == ["fingergait", "run", "hold"]
    overrides = dict(parse_override(word) for flag, word in pairwise(words) if flag == "--set")
    overrides["seed"] = int(words[words.index("--seed") + 1])
    metrics = simulate(Scenario.load(words[2], overrides)).metrics
    assert {key: metrics[key] for key in trial.METRICS} == {key: row[key] for key in trial.METRICS}


def test_killed_worker_and_killed_command_lose_and_repeat_nothing(
    tmp_path: Path, undisturbed: tuple[dict[str, Any], pa.Table]
) -> None:
    folder = tmp_path / "out"
    process = subprocess.Popen(command(folder, "--workers", "2"), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        wait_for_rows(folder, 1, process)
        os.kill(workers_of(process.pid)[0], signal.SIGKILL)
        wait_for_rows(folder, 4, process)
        left = workers_of(process.pid)
    finally:
        process.kill()
        process.communicate()
    for worker in left:  # they end by themselves once the command is gone
        with contextlib.suppress(psutil.NoSuchProcess):
            psutil.Process(worker).wait(timeout=20)
    kept = rows_of(folder)
    assert 4 <= kept.num_rows < 12
    done = subprocess.run(command(folder, "--workers", "1", "--resume"), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    assert figures["speed"]["runs"] == 12 - kept.num_rows
    finished = rows_of(folder)
    assert finished.equals(undisturbed[1])
    assert kept.equals(finished.filter(pa.compute.is_in(finished["index"], kept["index"].combine_chunks())))
    assert [path.name.partition("-")[0] for path in (folder / "data").iterdir()] == ["rows"]


def wait_for_rows(folder: Path, count: int, process: subprocess.Popen[bytes]) -> None:
    until = time.monotonic() + 60.0
    while time.monotonic() < until and process.poll() is None:
        if len(list((folder / "data").glob("part-*.parquet"))) >= count:
            return
        time.sleep(0.01)
    pytest.fail(f"no {count} rows before the end of the campaign")


def workers_of(pid: int) -> list[int]:
    """Processes of the local cluster's workers."""
    children = psutil.Process(pid).children(recursive=True)
    return [child.pid for child in children if "spawn_main" in " ".join(child.cmdline())]


def test_a_finished_campaign_is_not_run_again_by_accident(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    undisturbed: tuple[dict[str, Any], pa.Table],
) -> None:
    folder = Path(undisturbed[0]["data"]).parent
    arguments = command(folder)[3:]  # from "campaign" on
    assert call(monkeypatch, arguments) == 2
    assert "--out: expected a folder without a campaign, or --resume" in capsys.readouterr().err
    spec = folder.parent / "case.toml"
    spec.write_text(SPEC.replace("seed = 5", "seed = 6"))
    assert call(monkeypatch, [*arguments, "--resume"]) == 2
    assert "--resume: expected the campaign of" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["no-such-campaign"],
            "campaign: expected a .toml file or one of the packaged names (faults, paper-box, sensors)",
        ),
        (["paper-box", "--resume", "--out", "{}/none"], "--resume: expected the folder of a campaign, found none"),
        (
            ["paper-box", "--scheduler", "tcp://127.0.0.1:9", "--out", "{}/out"],
            "--scheduler: expected a dask scheduler",
        ),
    ],
)
def test_bad_calls_are_one_line_and_status_two(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.5)
    assert call(monkeypatch, ["campaign", *(word.format(tmp_path) for word in arguments)]) == 2
    error = capsys.readouterr().err.strip()
    assert message in error
    assert error.splitlines()[-1].startswith("fingergait: ")


def test_a_value_that_the_core_refuses_is_said_before_anything_runs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    spec = tmp_path / "case.toml"
    spec.write_text(SPEC + '\n[vary."gait.no_such"]\nuniform = [0.0, 1.0]\n')
    assert call(monkeypatch, ["campaign", str(spec), "--out", str(tmp_path / "out")]) == 2
    assert "no_such" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_crash_is_a_row_with_its_error() -> None:
    base = Scenario.load("hold").model_dump(mode="json", exclude_unset=True)
    outcome = trial.run_trial(trial.Trial(3, base, {"object.size": [0.2, 0.06]}, build_id()))
    assert outcome.row["error"].startswith("ConfigError: object: expected an object that finger")
    assert set(outcome.row) == {"error", *trial.METRICS, *trial.OBSERVED}
    with pytest.raises(trial.BuildMismatch):
        trial.run_trial(trial.Trial(3, base, {}, "another"))


class Failed:
    """A future that failed."""

    status = "error"

    def __init__(self, error: Exception) -> None:
        self._error = error

    def exception(self) -> Exception:
        return self._error


def test_a_run_that_kills_its_workers_is_a_row_and_a_lost_one_is_handed_in_again() -> None:
    runs = [trial.Trial(index, {}, {}, "build") for index in (3, 4)]
    killed: Any = Failed(KilledWorker("key", None, []))
    (outcome,), again = cluster._outcome(killed, runs[:1], 1)
    assert outcome.index == 3 and outcome.row["error"].startswith("KilledWorker") and again == []
    assert cluster._outcome(killed, runs, 1) == ([], [[runs[0]], [runs[1]]])
    lost: Any = Failed(OSError("gone"))
    assert cluster._outcome(lost, runs, 1) == ([], [runs])
    with pytest.raises(FingergaitError, match="--resume goes on"):
        cluster._outcome(lost, runs, 3)
    other: Any = Failed(trial.BuildMismatch("other"))
    with pytest.raises(trial.BuildMismatch):
        cluster._outcome(other, runs, 1)


def call(monkeypatch: pytest.MonkeyPatch, arguments: list[str]) -> int:
    """Exit status of `fingergait ARGUMENTS`, run in this process."""
    monkeypatch.setattr(sys, "argv", ["fingergait", *arguments])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)
