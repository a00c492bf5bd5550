"""A bundle's files: the hand with its meshes, and scenarios; all name each other by relative paths."""

import json
import shutil
from pathlib import Path
from typing import Any

import mujoco

from fingergait._core import ConfigError
from fingergait.files import make_folder, whole_file, write_text
from fingergait.hand import hand_json, load_spec, shown

HAND, FACTS, ASSETS = "hand.xml", "hand.facts.toml", "assets"


def write_hand(model: Path, facts: Path | None, out: Path) -> list[str]:
    """Writes the model as `hand.xml` with its meshes in `assets`, and its facts beside it; the files' names.

    Raises
    ------
    ConfigError
        Where a mesh is missing, or the copy would be another hand than the model.
    """
    spec = load_spec(model)
    files = _copy_assets(spec, model, out)
    spec.meshdir = spec.texturedir = ASSETS if files else ""
    spec.modelfiledir = str(out.resolve())
    try:
        spec.compile()
        text = spec.to_xml()
    except ValueError as error:
        raise ConfigError(f"{shown(model)}: expected a model that MuJoCo compiles, found: {error}") from None
    write_text(out / HAND, text)
    if facts is not None:
        write_text(out / FACTS, facts.read_text(encoding="utf-8"))
        files.append(FACTS)
    else:
        (out / FACTS).unlink(missing_ok=True)
    apart = _difference(json.loads(hand_json(model, facts)), json.loads(hand_json(out / HAND)))
    if apart > 1e-4:
        raise ConfigError(f"{shown(model)}: expected a copy of the same hand, found one that differs by {apart:.2g}")
    return [HAND, *files]


def _copy_assets(spec: mujoco.MjSpec, model: Path, out: Path) -> list[str]:
    """Copies what the model loads from files, and names it by its place in `assets`."""
    root = Path(spec.modelfiledir) if spec.modelfiledir else model.parent
    if not root.is_absolute():
        root = model.parent
    copied: dict[Path, str] = {}
    groups = (
        (spec.meshes, spec.meshdir),
        (spec.hfields, ""),
        (spec.skins, spec.meshdir),
        (spec.textures, spec.texturedir),
    )
    for items, folder in groups:
        for item in items:
            if not item.file:
                continue
            source = (root / folder / item.file).resolve()
            if not source.is_file():
                raise ConfigError(f"{shown(model)}: expected the file {item.file}, found nothing at {source}")
            if source not in copied:
                name = source.name if source.name not in copied.values() else f"{len(copied)}_{source.name}"
                copied[source] = name
                make_folder(out / ASSETS)
                with whole_file(out / ASSETS / name) as file:
                    shutil.copyfile(source, file)
            item.file = copied[source]
    return [f"{ASSETS}/{name}" for name in copied.values()]


def _difference(a: Any, b: Any) -> float:
    """The largest difference of two hand models' numbers; infinite where they differ in kind."""
    if isinstance(a, dict) and isinstance(b, dict) and a.keys() == b.keys():
        return max((_difference(a[key], b[key]) for key in a), default=0.0)
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return max((_difference(x, y) for x, y in zip(a, b, strict=True)), default=0.0)
    if isinstance(a, int | float) and isinstance(b, int | float):
        return abs(a - b) / max(1.0, abs(a))
    return 0.0 if a == b else float("inf")


def write_scenario(path: Path, values: dict[str, Any]) -> None:
    """Writes a scenario's values as TOML: keys first, then a table for each dictionary, also those in a list."""
    lines = [f"{key} = {json.dumps(value)}" for key, value in values.items() if not _is_table(value)]
    for key, value in values.items():
        if isinstance(value, dict):
            lines += ["", f"[{key}]", *(f"{name} = {json.dumps(item)}" for name, item in value.items())]
        elif _is_table(value):
            for table in value:
                lines += ["", f"[[{key}]]", *(f"{name} = {json.dumps(item)}" for name, item in table.items())]
    write_text(path, "\n".join(lines) + "\n")


def _is_table(value: Any) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and bool(value) and isinstance(value[0], dict))
