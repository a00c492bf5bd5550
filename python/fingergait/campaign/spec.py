"""What a campaign's TOML file says, checked."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from fingergait._core import ConfigError
from fingergait.campaign.distributions import Distribution
from fingergait.fields import Index, NonNegative, Table
from fingergait.paths import as_text, find
from fingergait.scenario import Scenario
from fingergait.scenario.faults import KINDS

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Promise = Literal["hold", "stop", "none"]


class Limits(Table):
    """What the whole campaign must hold; what is absent is not asked for.

    drop_rate
        Largest share of runs that lose the object.
    position_error_p99, orientation_error_p99
        99th percentile over the runs of the run's largest error, m and rad.
    promises
        Whether every fault with the promise "hold" must leave the object in the hand, and each with "stop" lead to it.
    """

    drop_rate: NonNegative | None = None
    position_error_p99: NonNegative | None = None
    orientation_error_p99: NonNegative | None = None
    promises: bool = False


class FaultDraw(Table):
    """One kind of fault of the campaign: constants and distributions for its keys.

    `label` is its name in the report, the kind by default. `promise` is what the controller's table of faults says of
    it: "hold", the object stays in the hand; "stop", the mode stop is reached; "none", only what all promise:
    commands stay within their limits.
    """

    label: str
    promise: Promise
    constants: dict[str, Any]
    drawn: dict[str, Distribution]


class CampaignSpec(Table):
    """A campaign: a scenario, what is set in it, what is varied, and how many samples of it are run."""

    name: str = "campaign"
    description: str = ""
    scenario: str
    samples: Annotated[int, Field(ge=1)] = 256
    seed: Index = 0
    method: Literal["sobol", "random", "grid"] = "sobol"
    set: dict[str, Any] = {}
    vary: dict[str, Distribution] = {}
    fault: tuple[FaultDraw, ...] = ()
    limits: Limits = Limits()

    @classmethod
    def load(cls, name: str | Path, samples: int | None = None) -> "CampaignSpec":
        """The campaign in a TOML file or under a packaged name; `samples` replaces the number in it.

        Raises
        ------
        ConfigError
            One line that names the file and the field, what was expected and what was found.
        """
        path = find(name, "campaigns", ".toml", "campaign")
        try:
            values = tomllib.loads(path.read_text(encoding="utf-8"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ConfigError(f"{path.name}: expected TOML, found: {error}") from None
        values.setdefault("name", as_text(path.stem))
        if isinstance(values.get("scenario"), str):
            beside = path.parent / values["scenario"]
            values["scenario"] = as_text(beside.resolve()) if beside.is_file() else values["scenario"]
        if samples is not None:
            values["samples"] = samples
        try:
            values["set"] = _dotted(values.get("set", {}))
            if isinstance(values.get("vary"), dict):
                values["vary"] = _dotted(values["vary"], leaf=_is_distribution)
            if isinstance(values.get("fault"), list):
                values["fault"] = [_fault(table, index) for index, table in enumerate(values["fault"])]
            spec = cls.model_validate(values)
        except ValidationError as error:
            raise ConfigError(f"{path.name}: {_describe(error)}") from None
        except ConfigError as error:
            raise ConfigError(f"{path.name}: {error}") from None
        if not spec.vary and not spec.fault:
            raise ConfigError(f"{path.name}: vary: expected at least one key or [[fault]], found none")
        if spec.method == "grid" and (spec.fault or any(d.ball is not None for d in spec.vary.values())):
            raise ConfigError(f"{path.name}: method: expected sobol or random with a ball or a [[fault]], found 'grid'")
        return spec

    def base(self) -> Scenario:
        """The scenario that every run starts from."""
        return Scenario.load(self.scenario, self.set)


def _fault(table: Any, index: int) -> dict[str, Any]:
    """The values of a `FaultDraw` from one `[[fault]]` of the file."""
    if not isinstance(table, dict) or table.get("kind") not in KINDS:
        found = table.get("kind") if isinstance(table, dict) else table
        raise ConfigError(f"fault.{index}.kind: expected one of {', '.join(KINDS)}, found {found!r}")
    rest = {key: value for key, value in table.items() if key not in ("label", "promise")}
    fields = KINDS[table["kind"]].model_fields
    for key in rest:
        if key.partition("[")[0] not in fields:
            known = ", ".join(("label", "promise", *fields))
            raise ConfigError(f"fault.{index}.{key}: expected one of {known}, found an unknown key")
    return {
        "label": table.get("label", table["kind"]),
        "promise": table.get("promise", "none"),
        "constants": {key: value for key, value in rest.items() if not isinstance(value, dict)},
        "drawn": {key: value for key, value in rest.items() if isinstance(value, dict)},
    }


def _is_distribution(value: Any) -> bool:
    return isinstance(value, dict) and any(key in Distribution.model_fields for key in value)


def _dotted(table: Any, prefix: str = "", leaf: Callable[[Any], bool] = lambda value: False) -> dict[str, Any]:
    """A nested TOML table as dotted keys, down to what `leaf` says is a value."""
    if not isinstance(table, dict):
        raise ConfigError(f"set: expected a table, found {table!r}")
    flat: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict) and value and not leaf(value):
            flat |= _dotted(value, f"{prefix}{key}.", leaf)
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def _describe(error: ValidationError) -> str:
    first, *rest = error.errors(include_url=False)
    field = ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        text = f"{field}: expected no such key, found it"
    elif first["type"] == "missing":
        text = f"{field}: expected a value, found none"
    else:
        expected = first["msg"].replace("Input should be", "expected").replace("Value error, ", "")
        text = f"{field}: {expected[0].lower()}{expected[1:]}"
        text += "" if "found" in expected else f", found {first['input']!r}"
    return text if not rest else f"{text} (and {len(rest)} more)"
