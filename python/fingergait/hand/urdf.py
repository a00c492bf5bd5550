"""A URDF as MuJoCo can read it: meshes found where ROS would find them, what is only seen left out."""

import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco

from fingergait._core import ConfigError

_MESHES = (".stl", ".obj", ".msh")


def urdf_spec(path: Path, shown: str) -> mujoco.MjSpec:
    """The model of a URDF. `package://` paths are sought in the folders around the file.

    Raises
    ------
    ConfigError
        Where a collision mesh isn't found or is of a kind that MuJoCo doesn't read.
    ValueError
        Where it is no URDF.
    """
    try:
        root = ET.fromstring(path.read_bytes())
    except ET.ParseError as error:
        raise ValueError(str(error)) from None
    meshdir = Path()
    for compiler in root.iterfind("mujoco/compiler"):
        meshdir = Path(compiler.attrib.pop("meshdir", ""))
        compiler.set("strippath", "true")
        compiler.attrib.pop("discardvisual", None)
    for link in root.iter("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    assets: dict[str, bytes] = {}
    names: dict[Path, str] = {}
    for mesh in root.iter("mesh"):
        given = mesh.get("filename", "")
        file = _found(given, path.parent, meshdir)
        if file is None:
            raise ConfigError(f"{shown}: expected the mesh {given!r} beside the file or in its package, found none")
        if file.suffix.lower() not in _MESHES:
            kinds = ", ".join(_MESHES)
            raise ConfigError(f"{shown}: expected collision meshes of the kinds {kinds}, found {given!r}; convert it")
        if file not in names:
            names[file] = f"mesh_{len(names)}{file.suffix.lower()}"
            assets[names[file]] = file.read_bytes()
        mesh.set("filename", names[file])
    return mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"), assets=assets)


def _found(name: str, folder: Path, meshdir: Path) -> Path | None:
    """The file that a URDF in `folder` means by `name`."""
    bare = name.removeprefix("file://")
    package, _, rest = bare.removeprefix("package://").partition("/")
    if not bare.startswith("package://"):
        candidates = [folder / meshdir / bare, folder / bare]
    else:
        around = [folder, *folder.absolute().parents]
        candidates = [place for parent in around for place in (parent / package / rest, parent / rest)]
    return next((place for place in candidates if place.is_file()), None)
