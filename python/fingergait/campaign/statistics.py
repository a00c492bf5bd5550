"""What the rows of a campaign say: drop rate with its interval, error percentiles, limits held, promises kept."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from scipy.stats import norm

from fingergait.campaign.spec import Limits

STOP = 4
"""The safe mode in which nothing is held."""
PAPER_POSITION = 3.7e-3
"""Largest position error that the paper reports of a single run, m."""
PAPER_ORIENTATION = 0.027
"""Largest orientation error that the paper reports of a single run, rad."""


def wilson(hits: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval of a share, of which `hits` of `trials` were seen; (0, 1) where nothing was."""
    if trials == 0:
        return 0.0, 1.0
    z = float(norm.ppf(0.5 + 0.5 * confidence))
    share, weight = hits / trials, z * z / trials
    centre = (share + 0.5 * weight) / (1.0 + weight)
    half = z / (1.0 + weight) * math.sqrt(share * (1.0 - share) / trials + 0.25 * weight / trials)
    low = 0.0 if hits == 0 else max(0.0, centre - half)
    high = 1.0 if hits == trials else min(1.0, centre + half)
    return low, high


@dataclass(frozen=True)
class Claim:
    """One limit of the campaign: what it asks for, what was measured, whether it held."""

    name: str
    limit: str
    measured: str
    held: bool


@dataclass(frozen=True)
class FaultRow:
    """What came of one kind of fault.

    `gaiting`: runs and drops where it began during a gait; `seen`: runs in which the core's guard noticed something,
    and the median time that it took, s; `unstopped`: runs in which the mode was never stop.
    """

    label: str
    promise: str
    runs: int
    drops: int
    errors: int
    gaiting: tuple[int, int]
    seen: tuple[int, float | None]
    bad_commands: int
    unstopped: int = 0

    @property
    def kept(self) -> bool:
        """Whether the promise was kept in every run; commands within their limits are part of each."""
        held = self.errors == 0 and self.bad_commands == 0
        return held and {"hold": self.drops, "stop": self.unstopped}.get(self.promise, 0) == 0


def column(rows: pa.Table, name: str) -> NDArray[np.float64]:
    """A column as numbers, NaN where a row has none."""
    return np.array(rows.column(name).cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)


def percentile(values: NDArray[np.float64], share: float) -> float | None:
    """A percentile of the numbers among `values`; None where there are none."""
    numbers = values[np.isfinite(values)]
    return float(np.percentile(numbers, share)) if numbers.size else None


def summary(rows: pa.Table, limits: Limits) -> dict[str, Any]:
    """The figures of `fingergait campaign --json`, without paths.

    Error percentiles are over the runs that kept the object: a drop is counted as a drop.
    """
    status = np.array(rows.column("status").to_pylist(), dtype=object)
    runs, drops, errors = len(status), int((status == "dropped").sum()), int((status == "error").sum())
    low, high = wilson(drops, runs - errors)
    kept = rows.filter(pa.array(status == "held"))
    figures: dict[str, Any] = {
        "runs": runs,
        "drops": drops,
        "errors": errors,
        "drop_rate": drops / (runs - errors) if runs > errors else None,
        "interval": [low, high],
        "bad_commands": int(np.nansum(column(rows, "bad_commands"))),
    }
    for name in ("position_error_m", "orientation_error_rad"):
        values = column(kept, f"max_{name}")
        figures[name] = {key: percentile(values, share) for key, share in (("p50", 50), ("p99", 99), ("max", 100))}
    figures["claims"] = [claim.__dict__ for claim in claims(rows, figures, limits)]
    return figures


def claims(rows: pa.Table, figures: dict[str, Any], limits: Limits) -> list[Claim]:
    """Each limit that the campaign states, and what always holds: no run crashes, no command leaves its limits."""
    found = [
        Claim("runs that crashed", "0", str(figures["errors"]), figures["errors"] == 0),
        Claim("commands outside their limits", "0", str(figures["bad_commands"]), figures["bad_commands"] == 0),
    ]
    if limits.drop_rate is not None:
        rate = figures["drop_rate"]
        measured = "none" if rate is None else f"{100 * rate:.2f} %"
        found.append(
            Claim("drop rate", f"{100 * limits.drop_rate:g} %", measured, rate is not None and rate <= limits.drop_rate)
        )
    for name, limit, key, scale, unit in (
        ("position error, 99th percentile", limits.position_error_p99, "position_error_m", 1e3, "mm"),
        ("orientation error, 99th percentile", limits.orientation_error_p99, "orientation_error_rad", 1e3, "mrad"),
    ):
        if limit is not None:
            value = figures[key]["p99"]
            measured = "none" if value is None else f"{scale * value:.2f} {unit}"
            found.append(Claim(name, f"{scale * limit:g} {unit}", measured, value is not None and value <= limit))
    if limits.promises:
        broken = [row.label for row in fault_rows(rows) if not row.kept]
        found.append(Claim("faults whose promise was broken", "none", ", ".join(broken) or "none", not broken))
    return found


def fault_rows(rows: pa.Table) -> list[FaultRow]:
    """One row a kind of fault, in alphabetical order."""
    columns = ("fault", "promise", "status", "gaiting_at_fault", "detected_after_s", "bad_commands", "worst_safe_mode")
    records = rows.select(list(columns)).to_pylist()
    labels = sorted({record["fault"] for record in records if record["fault"] is not None})
    found = []
    for label in labels:
        own = [record for record in records if record["fault"] == label]
        gaiting = [record for record in own if record["gaiting_at_fault"]]
        seen = [record["detected_after_s"] for record in own if record["detected_after_s"] is not None]
        found.append(
            FaultRow(
                label,
                own[0]["promise"],
                len(own),
                sum(record["status"] == "dropped" for record in own),
                sum(record["status"] == "error" for record in own),
                (len(gaiting), sum(record["status"] == "dropped" for record in gaiting)),
                (len(seen), float(np.median(seen)) if seen else None),
                sum(record["bad_commands"] or 0 for record in own),
                sum(record["worst_safe_mode"] != STOP for record in own),
            )
        )
    return found
