"""The verification of a bundle: its scenarios as they are, run with other masses, frictions and noises, both ways."""

import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fingergait._core import FingergaitError
from fingergait.run.log import Log
from fingergait.run.pose_error import yaw_reached
from fingergait.run.report.film import film_strip
from fingergait.run.simulate import simulate
from fingergait.scenario import Scenario
from fingergait.sim.plant import MujocoPlant

REACHED, POSITION, ORIENTATION = 0.95, 1e-3, 0.06
"""What a run must keep to count: share of the turn asked for, m, rad; and no part but the tips touches the object."""
_STANDS = 5.0  # s on end in a safe mode after which a run is ended: it is not going on
_SENSORS = {
    "sensors.position_noise": 1e-4,
    "sensors.orientation_noise": float(np.deg2rad(0.1)),
    "sensors.contact_place_noise": 3e-4,
    "sensors.contact_force_noise": 0.05,
}


@dataclass(frozen=True)
class Trial:
    """One run: file of the scenario, seed of what is drawn (None: as the file has it), sense of the turn; `film`: the
    picture of a film strip to write, where there is a GL library."""

    scenario: str
    seed: int | None
    sense: int
    film: str | None = None


def drawn(scenario: Scenario, trial: Trial) -> Scenario:
    """The scenario of a trial: mass and inertia 0.8 to 1.2 times nominal, friction 0.7 to 1, the suite's noise."""
    changes: dict[str, Any] = {}
    if scenario.reference.yaw_rate != 0.0:
        changes["reference.yaw_rate"] = trial.sense * abs(scenario.reference.yaw_rate)
    if trial.seed is not None:
        rng = np.random.default_rng([trial.seed, trial.sense + 1])
        changes |= {
            "seed": trial.seed,
            "truth.mass_scale": float(rng.uniform(0.8, 1.2)),
            "truth.inertia_scale": float(rng.uniform(0.8, 1.2)),
            "truth.friction": float(rng.uniform(0.7, 1.0)),
            **_SENSORS,
        }
    return scenario.replace(changes) if changes else scenario


def run_trial(folder: Path, trial: Trial) -> dict[str, Any]:
    """What came of one run, as plain values; `held` says whether it did all that is asked, `fails` what not."""
    row: dict[str, Any] = {"scenario": trial.scenario, "seed": trial.seed, "sense": trial.sense}
    try:
        scenario = drawn(Scenario.load(folder / trial.scenario), trial)
        watch = _Standing()
        run = simulate(scenario, watch, progress=False)
        metrics = run.metrics
        if trial.film is not None:
            _film(run.log, folder / trial.film)
    except FingergaitError as error:
        return {**row, "held": False, "fails": f"refused: {error}", "turned_rad": 0.0, "asked_rad": 0.0}
    reference = scenario.reference
    asked = reference.yaw_rate * max(0.0, scenario.duration - reference.motion_start - 0.5 * reference.blend)
    row |= {
        "asked_rad": asked or metrics["asked_rotation_rad"],
        "ended_early": watch.ended,
        "friction": scenario.truth.friction,
        "mass_scale": scenario.truth.mass_scale,
        "link_contact_at_rad": _first(run.log, "link_contact"),
        "safe_mode_at_rad": _first(run.log, "safe_mode"),
        **{key: metrics[key] for key in _KEPT},
    }
    fails = failing(row, turns=asked != 0.0)
    return {**row, "held": not fails, "fails": fails}


_KEPT = (
    "duration_s",
    "turned_rad",
    "completed",
    "dropped",
    "lost_reason",
    "incomplete_reason",
    "max_position_error_m",
    "max_orientation_error_rad",
    "link_contacts",
    "gaits",
    "worst_safe_mode",
    "safe_mode_fraction",
    "saturated_fraction",
)


def failing(row: dict[str, Any], turns: bool) -> str:
    """What a run failed, in words, what came first first; empty where it did all that is asked."""
    words = _failing_at_the_end(row, turns)
    if not row["link_contacts"]:
        return words
    at, stood = row["link_contact_at_rad"], row["safe_mode_at_rad"]
    link = f"a link lay on the object after {np.rad2deg(at):.0f} degrees, in {row['link_contacts']} control steps"
    if stood is not None and stood < at and words:
        return f"{words}; then {link}"
    return f"{link}; then {words}" if words else link


def _failing_at_the_end(row: dict[str, Any], turns: bool) -> str:
    if row["dropped"]:
        return f"lost: {row['lost_reason']}"
    if turns and row["turned_rad"] / row["asked_rad"] < REACHED:
        reached, asked = abs(np.rad2deg([row["turned_rad"], row["asked_rad"]]))
        _, _, why = (row["incomplete_reason"] or "").partition("; ")
        back = "back " if row["turned_rad"] * row["asked_rad"] < 0.0 else ""
        return f"turned {back}{reached:.0f} of {asked:.0f} degrees" + (f"; {why}" if why else "")
    if not turns and not row["completed"]:
        return str(row["incomplete_reason"])
    limits = (("max_position_error_m", POSITION, "mm"), ("max_orientation_error_rad", ORIENTATION, "mrad"))
    for key, limit, unit in limits:
        if turns and row[key] is not None and row[key] > limit:
            return f"{1e3 * row[key]:.2g} {unit} off, {1e3 * limit:g} allowed"
    return ""


def _first(log: Log, column: str) -> float | None:
    """How far, rad, the object had turned when the column first was not zero after t = 0; None where it never was."""
    found = np.flatnonzero((log[column] != 0.0) & (log.t >= 0.0))
    return abs(float(yaw_reached(log.pose("object"))[found[0]])) if len(found) else None


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Figures over the runs of one scenario."""
    turned = [abs(row["turned_rad"]) * (1 if row["turned_rad"] * row["sense"] >= 0 else -1) for row in rows]
    fails = Counter(_kind(row["fails"]) for row in rows if not row["held"])

    def worst(key: str) -> float | None:
        found = [row[key] for row in rows if row.get(key) is not None]
        return max(found) if found else None

    return {
        "scenario": rows[0]["scenario"],
        "runs": len(rows),
        "completed": sum(row["held"] for row in rows),
        "lost": sum(bool(row.get("dropped")) for row in rows),
        "asked_rad": abs(rows[0]["asked_rad"]),
        "turned_forwards_rad": _median([t for t, row in zip(turned, rows, strict=True) if row["sense"] > 0]),
        "turned_backwards_rad": _median([t for t, row in zip(turned, rows, strict=True) if row["sense"] < 0]),
        "turned_least_rad": min(turned),
        "max_position_error_m": worst("max_position_error_m"),
        "max_orientation_error_rad": worst("max_orientation_error_rad"),
        "runs_with_link_contact": sum(bool(row.get("link_contacts")) for row in rows),
        "runs_with_safe_mode": sum(row.get("worst_safe_mode", "normal") != "normal" for row in rows),
        "fails_first": fails.most_common(1)[0][0] if fails else "",
        "example": next((row["fails"] for row in rows if not row["held"]), ""),
    }


def _kind(fails: str) -> str:
    """What kind of failure the words tell of first, by which failures are counted."""
    first = fails.partition("; then ")[0]
    for mark, kind in (
        ("a link", "a link lies on the object"),
        ("lost", "the object is lost"),
        ("refused", "the start is refused"),
        ("stood still", "the controller stands in a safe mode before the turn is done"),
        ("turned", "the turn is not reached"),
        (" off, ", "the errors are too large"),
    ):
        if first.startswith(mark) or (mark in first and mark in ("stood still", " off, ")):
            return kind
    return first


def _median(values: list[float]) -> float | None:
    return float(np.median(values)) if values else None


def _film(log: Log, picture: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        log.write(Path(folder) / "log.parquet")
        film_strip(Path(folder) / "log.parquet", picture)


class _Standing:
    """Ends a run that has stood in a safe mode for too long."""

    def __init__(self) -> None:
        self.ended = False

    def __call__(self, plant: MujocoPlant, log: Log) -> bool:
        window = round(_STANDS / plant.scenario.period)
        modes = log["safe_mode"]
        self.ended = plant.t > _STANDS and len(modes) > window and bool((modes[-window:] > 0.0).all())
        return self.ended
