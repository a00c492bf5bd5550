"""Every public name says what it is, and the stub of the compiled module says the same as the module."""

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import fingergait as fg
from fingergait import _core

STUB = ast.parse((Path(fg.__file__).parent / "_core.pyi").read_text())


def public() -> Iterator[tuple[str, Any]]:
    """Every name of `__all__`, here and in `synthesis`, with the public members that its class defines itself."""
    for prefix, module in (("", fg), ("synthesis.", fg.synthesis)):
        for name in module.__all__:
            if name == "__version__":
                continue
            value = getattr(module, name)
            yield prefix + name, value
            if inspect.isclass(value):
                for member, inner in vars(value).items():
                    if not member.startswith("_") and not _is_field(value, member):
                        yield f"{prefix}{name}.{member}", inner


def _is_field(owner: type, member: str) -> bool:
    """Fields of dataclasses and pydantic models are in their class's docstring."""
    fields = (*getattr(owner, "__dataclass_fields__", ()), *getattr(owner, "model_fields", ()), "model_config")
    return member in fields


@pytest.mark.parametrize("name", sorted(name for name, _ in public()))
def test_public_names_have_docstrings(name: str) -> None:
    value = dict(public())[name]
    text = inspect.getdoc(value) or ""
    assert len(text) > 5, name


def stub_docs(body: list[ast.stmt], prefix: str = "") -> Iterator[tuple[str, str]]:
    for node in body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name != "__new__":
            yield prefix + node.name, inspect.cleandoc(ast.get_docstring(node) or "")
            if isinstance(node, ast.ClassDef):
                yield from stub_docs(node.body, f"{node.name}.")


@pytest.mark.parametrize(("name", "text"), list(stub_docs(STUB.body)))
def test_the_stub_says_what_the_module_says(name: str, text: str) -> None:
    value: Any = _core
    for part in name.split("."):
        value = getattr(value, part)
    assert text and inspect.cleandoc(value.__doc__ or "") == text


@pytest.mark.parametrize(
    "name", ["simulate", "hand_json", "Scenario.load", "DualStagePlanner", "ForceOptimizer", "gait_lp"]
)
def test_what_can_fail_says_how(name: str) -> None:
    value: Any = fg
    for part in name.split("."):
        value = getattr(value, part)
    assert "Raises\n------" in (inspect.getdoc(value) or "")


def test_the_package_is_typed() -> None:
    assert (Path(fg.__file__).parent / "py.typed").is_file()
