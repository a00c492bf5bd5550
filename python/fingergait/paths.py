"""Where the packaged models are, and how a name in a scenario or on the command line becomes a file."""

from pathlib import Path

from fingergait._core import ConfigError

MODELS = Path(__file__).resolve().parent / "models"
"""The packaged models: in a checkout a link to `models/`, in a wheel a copy of it."""

_RAW = {0xDC00 + byte: 0xEF00 + byte for byte in range(0x80, 0x100)}
"""Bytes that are no UTF-8: as Python has them in a file's name, and as characters for private use, which are text."""
_BACK = {text: raw for raw, text in _RAW.items()}


def as_text(name: str | Path) -> str:
    """A file's name, whatever its bytes, as text that any library takes; `as_path` is its inverse."""
    return str(name).translate(_RAW)


def as_path(text: str | Path) -> Path:
    """The path that `as_text` has made a text of; any other text is the path it says."""
    return Path(str(text).translate(_BACK))


def find(name: str | Path, folder: str, suffix: str, field: str, relative_to: Path | None = None) -> Path:
    """Path of the file called `name`: a path as given, beside the scenario, or a packaged model by its name.

    Parameters
    ----------
    name
        A path, or the bare name of a packaged file with or without `suffix`.
    folder
        The folder under `models/` to look in; "" is `models/` itself.
    suffix
        The file's ending, with its dot.
    field
        What the error names: the key or argument that gave `name`.
    relative_to
        Folder of the file that mentions `name`, if any.
    """
    given = as_path(name).expanduser()
    packaged = MODELS / folder
    candidates = [given, packaged / given, packaged / f"{given}{suffix}"]
    if relative_to is not None:
        candidates.insert(0, relative_to / given)
    for candidate in candidates:
        if candidate.is_file():
            return candidate.resolve()
    names = ", ".join(sorted(path.stem for path in packaged.glob(f"*{suffix}"))) or "none"
    raise ConfigError(f"{field}: expected a {suffix} file or one of the packaged names ({names}), found {str(name)!r}")


def find_hand(name: str | Path, field: str) -> Path:
    """Path of the hand's model or facts called `name`: a path as given, a bundle's folder, or a packaged name."""
    bundled = as_path(name).expanduser() / "hand.xml"
    if bundled.is_file() and not field.endswith("facts"):
        return bundled.resolve()
    suffix = ".toml" if field.endswith("facts") else ".xml"
    packaged = MODELS / "hands" / f"{name}{suffix}"
    return packaged.resolve() if packaged.is_file() else find(name, "", suffix, field)
