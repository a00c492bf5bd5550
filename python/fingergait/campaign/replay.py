"""The command that repeats one run of a campaign exactly."""

import json
import shlex
from typing import Any

from fingergait.campaign.spec import CampaignSpec
from fingergait.paths import as_text


def replay(spec: CampaignSpec, overrides: dict[str, Any]) -> str:
    """`fingergait run ...` with everything that the campaign and its sample set, to the last digit."""
    words = ["fingergait", "run", spec.scenario]
    for key, value in (spec.set | overrides).items():
        words += ["--seed", str(value)] if key == "seed" else ["--set", f"{key}={toml(value)}"]
    return as_text(shlex.join(words))


def toml(value: Any) -> str:
    """A plain value as TOML in one line; numbers keep every digit."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value) if isinstance(value, str) else repr(value)
