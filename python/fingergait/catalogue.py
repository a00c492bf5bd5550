"""The work of `fingergait list`: what is packaged, with a line on each from the file itself."""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fingergait._core import ConfigError
from fingergait.hand import import_hand
from fingergait.paths import MODELS

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


@dataclass(frozen=True)
class Kind:
    """Packaged files of one kind: their folders under the models, their ending, and how a file tells what it is."""

    folders: tuple[str, ...]
    suffix: str
    describe: Callable[[Path], str]


def _toml(path: Path) -> str:
    return str(tomllib.loads(path.read_text(encoding="utf-8")).get("description", ""))


def _controller(path: Path) -> str:
    artefact = json.loads(path.read_text(encoding="utf-8"))
    return f"{artefact['description']}; {1.0 / artefact['sample_time']:g} Hz, for {artefact['nominal']['mass']:g} kg"


def _hand(path: Path) -> str:
    counts = [len(finger.joints) for finger in import_hand(path).fingers]
    each = f"{counts[0]} joints each" if len(set(counts)) == 1 else f"{', '.join(map(str, counts))} joints"
    return f"{len(counts)} fingers with {each}"


KINDS = {
    "scenarios": Kind(("scenarios",), ".toml", _toml),
    "hands": Kind(("", "hands"), ".xml", _hand),
    "controllers": Kind(("controllers",), ".json", _controller),
    "specs": Kind(("specs",), ".toml", _toml),
    "campaigns": Kind(("campaigns",), ".toml", _toml),
}


def files(kind: str) -> dict[str, Path]:
    """Packaged files of a kind by name, in order, without reading any."""
    where = KINDS[kind]
    found = [path for folder in where.folders for path in (MODELS / folder).glob(f"*{where.suffix}")]
    return {path.stem: path for path in sorted(found, key=lambda path: path.stem)}


def names(kind: str) -> list[str]:
    """Names of the packaged files of a kind, in order: for shell completion."""
    return list(files(kind))


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
    return {key: {name: where.describe(path) for name, path in files(key).items()} for key, where in chosen.items()}
