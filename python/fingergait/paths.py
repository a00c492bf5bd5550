"""Where the packaged models are, and how a name in a scenario or on the command line becomes a file."""

from pathlib import Path

from fingergait._core import ConfigError

MODELS = Path(__file__).resolve().parent / "models"
"""The packaged models: in a checkout a link to `models/`, in a wheel a copy of it."""


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
    given = Path(name).expanduser()
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
    """Path of the hand's model or facts called `name`: a path as given, or a packaged name."""
    suffix = ".toml" if field.endswith("facts") else ".xml"
    packaged = MODELS / "hands" / f"{name}{suffix}"
    return packaged.resolve() if packaged.is_file() else find(name, "", suffix, field)
