"""The work of `fingergait list`: what is packaged, with a line on each from the file itself."""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fingergait._core import ConfigError
from fingergait.hand import compile_spec, find_fingers, load_spec
from fingergait.paths import MODELS

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


@dataclass(frozen=True)
class Kind:
    """Packaged files of one kind: their folder under the models, their ending, and how a file tells what it is."""

    folder: str
    suffix: str
    describe: Callable[[Path], str]


def _toml(path: Path) -> str:
    return str(tomllib.loads(path.read_text(encoding="utf-8")).get("description", ""))


def _controller(path: Path) -> str:
    artefact = json.loads(path.read_text(encoding="utf-8"))
    return f"{artefact['description']}; {1.0 / artefact['sample_time']:g} Hz, for {artefact['nominal']['mass']:g} kg"


def _hand(path: Path) -> str:
    fingers = find_fingers(compile_spec(load_spec(path), path.name), path.name)
    return f"{len(fingers)} fingers with {len(fingers[0].joints)} joints each"


KINDS = {
    "scenarios": Kind("scenarios", ".toml", _toml),
    "hands": Kind("", ".xml", _hand),
    "controllers": Kind("controllers", ".json", _controller),
    "specs": Kind("specs", ".toml", _toml),
    "campaigns": Kind("campaigns", ".toml", _toml),
}


def names(kind: str) -> list[str]:
    """Names of the packaged files of a kind, in order, without reading any: for shell completion."""
    where = KINDS[kind]
    return sorted(path.stem for path in (MODELS / where.folder).glob(f"*{where.suffix}"))


def catalogue(kind: str | None = None) -> dict[str, dict[str, str]]:
    """A line on each packaged file, by kind and name; of one kind, or of all.

    Raises
    ------
    ConfigError
        If there is no such kind.
    """
    if kind is not None and kind not in KINDS:
        raise ConfigError(f"KIND: expected one of {', '.join(KINDS)}, found {kind!r}")
    chosen = KINDS if kind is None else {kind: KINDS[kind]}
    return {
        key: {name: where.describe(MODELS / where.folder / f"{name}{where.suffix}") for name in names(key)}
        for key, where in chosen.items()
    }
