"""The house's plan: imports between the wings of the package run one way, and no module is in a circle of imports."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import fingergait as fg

ROOT = Path(fg.__file__).resolve().parent

# Each wing may import those before it. Wings on one floor don't know each other.
FLOORS = [
    ["_core"],
    ["fields", "paths", "files", "stopping"],
    ["hand", "object"],
    ["scenario"],
    ["sim"],
    ["run"],
    ["synthesis", "view"],
    ["campaign", "reproduce", "bench", "adopt"],
    ["check", "catalogue"],
    ["_former_names"],
    ["cli"],
]
FLOOR = {wing: floor for floor, wings in enumerate(FLOORS) for wing in wings}


def modules() -> Iterator[tuple[str, Path]]:
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        if parts != ("__init__",):
            yield ".".join(parts).removesuffix(".__init__"), path


def imports(path: Path) -> Iterator[str]:
    """Modules of the package that the file imports, at its top or later, without the package's name."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (name.name.removeprefix("fingergait.") for name in node.names if "fingergait." in name.name)
        elif isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "fingergait":
            inside = node.module.removeprefix("fingergait").lstrip(".")
            for name in node.names:
                both = f"{inside}.{name.name}".lstrip(".")
                yield both if _exists(both) else inside


def _exists(module: str) -> bool:
    path = ROOT.joinpath(*module.split("."))
    return path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


def test_wings_import_downwards_only() -> None:
    wrong = []
    for module, path in modules():
        wing = module.split(".")[0]
        for other in imports(path):
            floor = other.split(".")[0]
            if not floor or floor == wing:
                continue
            if FLOOR[floor] >= FLOOR[wing]:
                wrong.append(f"{module} imports {other}")
    assert wrong == []


def test_no_circle_of_imports() -> None:
    names = {module for module, _ in modules()}
    graph = {
        module: {other for other in imports(path) if other in names and other != module} for module, path in modules()
    }
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the circle


def test_modules_keep_their_former_names() -> None:
    code = """
from fingergait.plant import MujocoPlant
from fingergait.simulate import load_controller
from fingergait.reference import Trajectory
from fingergait.hand import hand_json
from fingergait.scenario import Scenario
import fingergait
assert callable(fingergait.simulate) and MujocoPlant is fingergait.MujocoPlant
"""
    subprocess.run([sys.executable, "-c", code], check=True)
