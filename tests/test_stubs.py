"""The stub of the compiled module against the module, both ways."""

import ast
import subprocess
import sys
from pathlib import Path

import fingergait
from fingergait import _core

STUB = ast.parse((Path(fingergait.__file__).parent / "_core.pyi").read_text())


def members(body: list[ast.stmt]) -> set[str]:
    return {node.name for node in body if isinstance(node, ast.FunctionDef | ast.ClassDef)}


def public(names: list[str]) -> set[str]:
    return {name for name in names if not name.startswith("_")}


def test_stub_and_module_name_the_same_things() -> None:
    assert members(STUB.body) == public(dir(_core))
    for node in STUB.body:
        if isinstance(node, ast.ClassDef) and not node.name.endswith("Error"):
            found = {name for name in vars(getattr(_core, node.name)) if not name.startswith("_")}
            assert public(list(members(node.body))) == found, node.name


def test_signatures_agree() -> None:
    command = [sys.executable, "-m", "mypy.stubtest", "fingergait._core", "--ignore-disjoint-bases"]
    found = subprocess.run(command, capture_output=True, text=True)
    assert found.returncode == 0, found.stdout + found.stderr
