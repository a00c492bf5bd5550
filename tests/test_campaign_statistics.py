"""What a campaign says of its rows: intervals, limits, promises, causes and influences."""

from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from scipy.stats import binomtest

from fingergait.campaign.causes import cause, status
from fingergait.campaign.sensitivity import DUMMY, influences
from fingergait.campaign.spec import Limits
from fingergait.campaign.statistics import fault_rows, summary, wilson
from fingergait.campaign.store import row_schema


def rows_of(records: list[dict[str, Any]], drawn: dict[str, bool] | None = None) -> pa.Table:
    """Rows with what the records don't say left empty."""
    full = [{"index": i, "status": "held", "bad_commands": 0, **record} for i, record in enumerate(records)]
    return pa.Table.from_pylist(full, schema=row_schema(drawn or {}))


@pytest.mark.parametrize(("hits", "trials"), [(0, 1), (0, 1000), (1, 10), (3, 64), (50, 100), (499, 500), (7, 7)])
def test_the_interval_is_wilsons(hits: int, trials: int) -> None:
    found = binomtest(hits, trials).proportion_ci(0.95, method="wilson")
    assert wilson(hits, trials) == pytest.approx((found.low, found.high), abs=1e-12)


def test_the_interval_of_known_cases() -> None:
    assert wilson(0, 1000) == pytest.approx((0.0, 0.0038268), abs=1e-6)
    assert wilson(0, 0) == (0.0, 1.0)


def test_limits_are_held_or_missed() -> None:
    good = {"max_position_error_m": 1e-3, "max_orientation_error_rad": 0.01}
    lost = {"status": "dropped", "max_position_error_m": 1.0}
    limits = Limits(drop_rate=0.01, position_error_p99=2e-3, orientation_error_p99=5e-3)
    figures = summary(rows_of([good] * 99 + [lost]), limits)
    assert figures["drop_rate"] == 0.01
    assert figures["position_error_m"]["max"] == 1e-3  # of the runs that kept the object
    assert {claim["name"]: claim["held"] for claim in figures["claims"]} == {
        "runs that crashed": True,
        "commands outside their limits": True,
        "drop rate": True,
        "position error, 99th percentile": True,
        "orientation error, 99th percentile": False,
    }


def test_a_crash_and_a_bad_command_are_never_fine() -> None:
    figures = summary(rows_of([{"status": "error"}, {"bad_commands": 2}]), Limits())
    assert [claim["held"] for claim in figures["claims"]] == [False, False]
    assert (figures["errors"], figures["drops"], figures["drop_rate"]) == (1, 0, 0.0)


def test_a_promise_to_hold_is_broken_by_one_drop() -> None:
    def row(label: str, promise: str, state: str, gaiting: bool = False) -> dict[str, Any]:
        return {"fault": label, "promise": promise, "status": state, "gaiting_at_fault": gaiting}

    rows = rows_of(
        [
            row("stale", "hold", "held"),
            row("stale", "hold", "dropped", gaiting=True),
            row("power", "none", "dropped"),
            row("jump", "hold", "held", gaiting=True),
        ]
    )
    kept = {found.label: (found.kept, found.drops, found.gaiting) for found in fault_rows(rows)}
    assert kept == {"stale": (False, 1, (1, 1)), "power": (True, 1, (0, 0)), "jump": (True, 0, (1, 0))}
    claims = summary(rows, Limits(promises=True))["claims"]
    assert claims[-1]["measured"] == "stale" and not claims[-1]["held"]


def test_a_promise_to_stop_is_broken_by_another_mode() -> None:
    rows = rows_of(
        [
            {"fault": "gone", "promise": "stop", "status": "dropped", "worst_safe_mode": 4},
            {"fault": "pulled", "promise": "stop", "status": "dropped", "worst_safe_mode": 1},
        ]
    )
    assert {found.label: found.kept for found in fault_rows(rows)} == {"gone": True, "pulled": False}


def test_causes_name_fault_and_limit() -> None:
    lost = {"error": None, "dropped": True, "gaiting_at_end": True, "lost_reason": "x; f1 slid on the object"}
    assert cause(lost, None) == "fingers slid, during a gait"
    assert cause(lost, "power") == "power: fingers slid, during a gait"
    crash = {"error": "ValueError: no", "dropped": None}
    assert (cause(crash, None), status(crash)) == ("crash: ValueError", "error")
    assert cause({"error": None, "dropped": False}, "power") is None


def test_influences_rank_what_matters_above_a_dummy() -> None:
    rng = np.random.default_rng(1)
    x = rng.random((400, 3))
    records = []
    for strong, weak, nothing in x:
        lost = strong + 0.1 * nothing > 0.95
        error = 1e-3 * (1.0 + strong + 0.3 * weak)
        drawn = {"x.strong": strong, "x.weak": weak, "x.nothing": nothing}
        records.append({**drawn, "status": "dropped" if lost else "held", "max_position_error_m": error})
    position, drops = influences(rows_of(records, {"strong": True, "weak": True, "nothing": True}))
    assert position.names[:2] == ["strong", "weak"]
    assert position.values[0] > 3.0 * position.noise
    assert abs(position.values[position.names.index("nothing")] - position.noise) < 0.1
    assert drops.names[0] == "strong" and DUMMY in drops.names


def test_too_few_runs_say_nothing_of_influence() -> None:
    assert influences(rows_of([{"x.a": 0.1 * i} for i in range(20)], {"a": True})) == []
