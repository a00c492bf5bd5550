"""Stages that are not repeated while their inputs stand: what they made is kept beside what they were made of."""

import hashlib
import json
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import mujoco

from fingergait.files import make_folder, write_text

FOLDER = "stages"


class Stages:
    """The stages kept in a folder.

    Attributes
    ----------
    folder
        Of the bundle; the stages' results are in its folder `stages`.
    repeated
        Names of the stages that were worked out by this object, in order.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.repeated: list[str] = []

    def get(self, name: str, inputs: Any, work: Callable[[], Any], files: Iterable[str] = ()) -> Any:
        """What the stage `name` gave for these inputs, or what `work` gives now; plain values of JSON.

        Parameters
        ----------
        name
            Of the stage.
        inputs
            All that the result depends on, as plain values; the program itself is counted in.
        work
            Gives the result.
        files
            That it writes into the bundle: where one is missing, it works again.
        """
        key = digest(json.dumps([inputs, _program()], sort_keys=True).encode())
        kept = self.folder / FOLDER / f"{name}.json"
        try:
            found = json.loads(kept.read_text(encoding="utf-8"))
            if found["inputs"] == key and all((self.folder / file).is_file() for file in files):
                return found["result"]
        except (OSError, ValueError, KeyError, TypeError):
            pass  # not there, or not whole
        self.repeated.append(name)
        result = json.loads(json.dumps(work()))
        make_folder(kept.parent)
        write_text(kept, json.dumps({"inputs": key, "result": result}, indent=1) + "\n")
        return result


def digest(*parts: bytes) -> str:
    """One hash of all parts, in their order."""
    found = hashlib.sha256()
    for part in parts:
        found.update(len(part).to_bytes(8, "little") + part)
    return found.hexdigest()


def digest_of(folder: Path, files: Iterable[str | Path]) -> str:
    """One hash of files in a folder, names and contents."""
    return digest(*(part for file in files for part in (str(file).encode(), (folder / file).read_bytes())))


@lru_cache
def _program() -> str:
    """A hash of this package, compiled core included, and of the simulator's version: results depend on both."""
    root = Path(__file__).resolve().parent.parent
    files = sorted(path for kind in ("*.py", "*.so", "*.pyd") for path in root.rglob(kind))
    return digest(mujoco.mj_versionString().encode(), *(path.read_bytes() for path in files))
