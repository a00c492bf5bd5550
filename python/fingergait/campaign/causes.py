"""Why a run failed, in few enough words to be counted."""

from typing import Any

_SIGNS = (
    ("slid on the object", "fingers slid"),
    ("torques were at their limit", "torque limit"),
    ("stood at its", "joint limit"),
    ("fell short of the wrench", "wrench not delivered"),
)


def status(row: dict[str, Any]) -> str:
    """What became of a run: `error` where it crashed, `dropped` where the object was lost, else `held`."""
    if row["error"] is not None:
        return "error"
    return "dropped" if row["dropped"] else "held"


def cause(row: dict[str, Any], fault: str | None) -> str | None:
    """The cause of a failure, None for a run that held: the injected fault first, then what was at its limit."""
    if row["error"] is not None:
        found = f"crash: {row['error'].partition(':')[0]}"
    elif row["dropped"]:
        reason = row["lost_reason"] or ""
        signs = [name for sign, name in _SIGNS if sign in reason]
        found = " and ".join(signs) if signs else "no limit was active"
        found += ", during a gait" if row["gaiting_at_end"] else ""
    else:
        return None
    return found if fault is None else f"{fault}: {found}"
