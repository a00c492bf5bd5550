"""Files that are there whole or not at all, whatever their names, and one line where they can't be written."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn
from uuid import uuid4

from fingergait._core import ConfigError


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A file beside `path` to write, which takes its name at the end; where that fails nothing of it is left.

    Raises
    ------
    ConfigError
        One line that names the file, where the system refuses: no room, no permission, something in the way.
    """
    temporary = path.with_name(f".{uuid4().hex[:12]}.tmp{path.suffix}")
    try:
        yield temporary
        _sync(temporary)
        if path.is_dir():  # which a plain file can't replace
            raise IsADirectoryError(None, "Is a directory", str(path))
        os.replace(temporary, path)
    except OSError as error:
        refuse(path, error)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Writes a text file, whole or not at all; parts of file names that are no text are shown escaped."""
    with whole_file(path) as temporary:
        temporary.write_bytes(text.encode("utf-8", errors="backslashreplace"))


def make_folder(folder: Path, option: str = "--out") -> None:
    """Makes a folder that can be written; says so in one line where it can't be.

    Raises
    ------
    ConfigError
        Names `option` and the folder.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".{uuid4().hex[:12]}.tmp"
        try:
            probe.write_bytes(b"\n")  # a full disk still takes an empty file
        finally:
            with contextlib.suppress(OSError):
                probe.unlink(missing_ok=True)
    except OSError as error:
        raise ConfigError(f"{option}: expected a folder that can be written, found {folder} ({why(error)})") from None


def refuse(path: Path, error: OSError) -> NoReturn:
    """Raises the one line that says why `path` can't be written."""
    raise ConfigError(f"expected to write {path}, found: {why(error)}; nothing of it is kept") from None


def why(error: OSError) -> str:
    """What the system said, in one line."""
    if error.errno is not None:  # libraries wrap the number in words of their own
        return os.strerror(error.errno)
    return error.strerror or " ".join(str(error).split()) or type(error).__name__


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
