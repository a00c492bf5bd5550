"""Ctrl-C and SIGTERM: one line, what was measured so far is kept and named, and the exit status of the signal."""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from fingergait.run.log import Log

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="signals to a group of processes")


def stopped(
    arguments: list[str], ready: Callable[[], bool], signum: int = signal.SIGINT, cwd: Path | None = None
) -> tuple[int, str, str]:
    """Status, output and errors of a command to whose group of processes a signal comes once it is `ready`."""
    process = subprocess.Popen(
        [sys.executable, "-m", "fingergait.cli", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        cwd=cwd,
    )
    until = time.monotonic() + 120.0
    while not ready() and time.monotonic() < until and process.poll() is None:
        time.sleep(0.02)
    assert process.poll() is None, process.communicate()
    children = psutil.Process(process.pid).children(recursive=True)
    os.killpg(process.pid, signum)  # as a terminal does
    out, err = process.communicate(timeout=60)
    _, alive = psutil.wait_procs(children, timeout=20)
    assert alive == []
    return process.returncode, out, err


def then(ready: Callable[[], bool], seconds: float) -> Callable[[], bool]:
    """Whether it has been `ready` for some time."""
    begin: list[float] = []

    def waited() -> bool:
        if not begin and ready():
            begin.append(time.monotonic())
        return bool(begin) and time.monotonic() - begin[0] > seconds

    return waited


def children_of(count: int) -> Callable[[], bool]:
    """Whether this process's child has that many processes of its own."""
    return lambda: any(len(child.children()) >= count for child in psutil.Process().children())


@pytest.mark.parametrize(("signum", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_run_keeps_what_was_measured(signum: int, status: int, tmp_path: Path) -> None:
    tmp_path /= "out"
    arguments = ["run", "lift-and-rotate", "--duration", "3000", "--json", "--out", str(tmp_path)]
    found, out, err = stopped(arguments, then(tmp_path.is_dir, 1.0), signum)
    assert (
        found == status and err.count("\n") == 1 and err.startswith("fingergait: stopped: at ") and str(tmp_path) in err
    )
    figures = json.loads(out)
    log = Log.read(tmp_path / "log.parquet")
    assert figures["duration_s"] == pytest.approx(log.t[-1] + 0.002) and log.t[-1] < 3000.0
    assert json.loads((tmp_path / "metrics.json").read_text()) == figures
    assert (tmp_path / "errors.png").is_file() and not list(tmp_path.glob(".*"))


def listening(port: int) -> Callable[[], bool]:
    """Whether a page is there."""

    def served() -> bool:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}", timeout=5.0) as answer:
                return bool(answer.status == 200)
        except OSError:
            return False

    return served


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_a_bench_ends_when_it_is_told_to(signum: int) -> None:
    pytest.importorskip("viser")
    status, out, err = stopped(["play", "hold", "--port", "18510"], listening(18510), signum)
    assert (status, out, err) == (0, "", "live page: http://127.0.0.1:18510\n")


CAMPAIGN = """
scenario = "lift-and-rotate"
samples = 64
[set]
duration = 4.0
[vary."truth.mass_scale"]
uniform = [0.9, 1.1]
"""


def test_a_campaign_keeps_its_rows_and_says_how_to_go_on(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(CAMPAIGN)
    folder = tmp_path / "out"
    arguments = ["campaign", str(tmp_path / "mine.toml"), "--workers", "1", "--out", str(folder)]
    status, out, err = stopped(arguments, lambda: len(list((folder / "data").glob("[!.]*.parquet"))) >= 1)
    assert status == 130 and out == "" and "Traceback" not in err
    said = [line for line in err.splitlines() if "stopped" in line]
    assert len(said) == 1 and "of 64 runs are kept; --resume --out" in said[0] and str(folder) in said[0]
    assert not list(folder.rglob(".*"))


def test_a_suite_counts_the_seeds_that_are_done() -> None:
    status, out, err = stopped(
        ["suite", "--seeds", "40", "--workers", "2", "--set", "duration=3"], then(children_of(2), 6.0)
    )
    assert status == 130 and err.count("\n") == 1 and "of 40 seeds are done" in err
    assert "held the limits" in out


def test_reproduce_keeps_the_figures_of_the_runs_that_are_done(tmp_path: Path) -> None:
    status, out, err = stopped(["reproduce", "--quick", "--out", str(tmp_path)], then(children_of(2), 2.0))
    assert status == 130 and out == "" and "Traceback" not in err
    last = err.strip().splitlines()[-1]
    assert last.startswith("fingergait: stopped: ")
    kept = tmp_path / "partial.json"
    assert ("partial.json" in last and len(json.loads(kept.read_text())) >= 1) if kept.is_file() else "nothing" in last


def test_a_synthesis_writes_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    status, _, err = stopped(["synthesize", "--out", str(out / "K.json")], then(out.is_dir, 1.0))
    assert status == 130 and err == "fingergait: stopped: nothing was written\n"
    assert list(out.iterdir()) == []


def test_a_scheduler_that_is_not_there_costs_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.toml").write_text(CAMPAIGN.replace("64", "1").replace("4.0", "0.5"))
    command = [
        sys.executable,
        "-m",
        "fingergait.cli",
        "campaign",
        str(tmp_path / "mine.toml"),
        "--out",
        str(tmp_path / "out"),
    ]
    for _ in range(2):
        done = subprocess.run([*command, "--scheduler", "tcp://127.0.0.1:9"], capture_output=True, text=True)
        assert done.returncode == 2 and done.stderr.count("\n") == 1
        assert "--scheduler: expected a dask scheduler" in done.stderr
        assert not (tmp_path / "out").exists()
    assert subprocess.run([*command, "--workers", "1", "--json"], capture_output=True).returncode == 0
