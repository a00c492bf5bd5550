"""The result table of a run, beside the paper's figures."""

from collections.abc import Callable
from typing import Any

from rich.console import Console
from rich.table import Table

Row = tuple[str, Callable[[dict[str, Any]], str], str]


def _milli(key: str, unit: str, digits: int = 2) -> Callable[[dict[str, Any]], str]:
    return lambda metrics: "-" if metrics[key] is None else f"{1e3 * metrics[key]:.{digits}f} {unit}"


def _number(key: str, form: str, unit: str = "") -> Callable[[dict[str, Any]], str]:
    return lambda metrics: "-" if metrics[key] is None else f"{metrics[key]:{form}} {unit}".rstrip()


def _share(key: str) -> Callable[[dict[str, Any]], str]:
    return lambda metrics: "-" if metrics[key] is None else f"{100 * metrics[key]:.1f} %"


def _recovery(metrics: dict[str, Any]) -> str:
    times = metrics["recovery_time_s"]
    if not times:
        return "-"
    slow = sum(time is None for time in times)
    worst = max((time for time in times if time is not None), default=float("nan"))
    return f"{worst:.2f} s" + (f", {slow} never" if slow else "")


def _settling(metrics: dict[str, Any]) -> str:
    time = metrics["settling_time_s"]["max"]
    return "-" if time is None else f"{time:.3f} s"


# The paper's column: its Section V, same quantity, its own hand and object.
ROWS: list[Row] = [
    ("task", lambda m: "completed" if m["completed"] else "NOT completed", ""),
    (
        "turned",
        lambda m: f"{m['rotation_rad'] * 57.29578:.0f} deg in {m['duration_s']:.1f} s",
        "lost near 90 without gaits",
    ),
    ("largest position error", _milli("max_position_error_m", "mm"), "3.7 mm"),
    ("largest orientation error", _milli("max_orientation_error_rad", "mrad", 1), "27 mrad"),
    ("rms position error", _milli("rms_position_error_m", "mm"), ""),
    ("rms orientation error", _milli("rms_orientation_error_rad", "mrad", 1), ""),
    ("settling time, 5 %", _settling, "1.106 s (+20 %), 2.214 s (40 %)"),
    ("slowest recovery", _recovery, "0.5 s"),
    ("gaits", _number("gaits", "d"), ""),
    ("time of a gait", _number("gait_time_s", ".2f", "s"), ""),
    ("predicted dQ/dt > 0", _share("qdot_positive_fraction"), "always"),
    ("gaits that raised Q", _share("quality_gain_fraction"), ""),
    (
        "smallest Q, threshold",
        lambda m: f"{_number('min_quality', '.5f')(m)}, {m['quality_threshold']:.5f}",
        "Q above it",
    ),
    ("slips, least friction", lambda m: f"{m['slips']}, {_number('min_assumed_friction', '.2f')(m)}", ""),
    (
        "safe modes",
        lambda m: f"{m['worst_safe_mode']} at worst, {100 * m['safe_mode_fraction']:.1f} % of the time",
        "",
    ),
    ("control steps with links on the object", _number("link_contacts", "d"), ""),
    ("torques at their limit", _share("saturated_fraction"), ""),
    (
        "control step, mean, max",
        lambda m: f"{m['step_us']['mean']:.1f}, {m['step_us']['max']:.0f} us",
        "< 1000 us mean",
    ),
    ("missed deadlines", _number("deadline_misses", "d"), ""),
    ("real-time factor", _number("real_time_factor", ".1f"), ""),
]


def table_of(metrics: dict[str, Any]) -> Table:
    """The figures of a run beside the paper's."""
    title = f"{metrics['scenario']}, seed {metrics['seed']}"
    table = Table(title=title, title_justify="left", header_style="bold")
    table.add_column("figure", no_wrap=True)
    table.add_column("here", justify="right")
    table.add_column("paper", justify="right", style="dim")
    for name, measured, paper in ROWS:
        value = measured(metrics)
        if value != "-":
            table.add_row(name, value, paper)
    return table


def show(metrics: dict[str, Any], console: Console) -> None:
    """Prints the table, the simulator's settings and, if the object was lost, why."""
    console.print(table_of(metrics))
    console.print(_settings(metrics["simulator"]), style="dim", highlight=False)
    if metrics["dropped"]:
        console.print(f"LOST: {metrics['lost_reason']}", style="bold red", highlight=False)
    elif not metrics["completed"]:
        console.print(f"NOT COMPLETED: {metrics['incomplete_reason']}", style="bold red", highlight=False)


def _settings(s: dict[str, Any]) -> str:
    """The simulator's version and contact settings in one line."""
    contact = f"condim {s['condim']}, friction {s['friction'][0]:g}, solref {s['solref']}, solimp {s['solimp'][:3]}"
    step = f"{1e3 * s['timestep_s']:g} ms {s['integrator']}, {s['cone']} cone, impratio {s['impratio']:g}"
    return f"MuJoCo {s['mujoco']}, {step}, {contact}"
