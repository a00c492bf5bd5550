"""`fingergait bench`: its rows, its exactness, and the comparison with the reference."""

import json
from pathlib import Path

import pytest
from rich.console import Console

from fingergait.bench.run import REFERENCE, YARDSTICK, changed, run_bench


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    return run_bench(tmp_path_factory.mktemp("bench"), quick=True, console=Console(quiet=True))


def test_rows_have_the_promised_figures(result: dict[str, list[dict[str, float]]]) -> None:
    rows = {row["name"]: row for row in result["rows"]}
    for row in rows.values():
        assert row["median_us"] <= row["p99_us"] <= row["p999_us"] <= row["max_us"]
    assert {"step/all", "step/python", "force_qp/core", "gait_lp/python", YARDSTICK} <= rows.keys()


def test_the_core_allocates_nothing_and_is_exact(result: dict[str, list[dict[str, float]]]) -> None:
    rows = {row["name"]: row for row in result["rows"]}
    assert rows["step/all"]["allocations"] == 0
    assert rows["force_qp/core"]["allocations"] == 0
    assert rows["force_qp/core"]["error_max"] < 1e-6  # N, against clarabel, polished


def test_a_row_that_became_slower_is_named() -> None:
    rows = json.loads(REFERENCE.read_text(encoding="utf-8"))["rows"]
    assert changed(rows) == {}
    for row in rows:
        row["median_us"] *= 2.0 if row["name"] == "step/all" else 1.0
    assert list(changed(rows)) == ["step/all"]
    # A machine that is twice as slow at everything changes nothing.
    twice = [{**row, "median_us": 2.0 * row["median_us"]} for row in json.loads(REFERENCE.read_text())["rows"]]
    assert changed(twice) == {}


def test_files_are_written(tmp_path: Path) -> None:
    run_bench(tmp_path, quick=True, console=Console(quiet=True))
    assert (tmp_path / "latency.png").stat().st_size > 1000
    assert json.loads((tmp_path / "bench.json").read_text())["rows"]
