"""Who imports whom, by the syntax tree: at the top of modules, inside functions, and by name at run time."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
FILES = {
    ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): file
    for file in (ROOT / "raymarch").rglob("*.py")
}

FACE = "raymarch"
"""The public face. It knows all layers, and states where conveniences are carried out."""

BY_NAME = {
    "raymarch": "public names are imported when they are first used",
    "raymarch.conveniences": "methods whose functions the public face states",
    "raymarch.cli.commands": "a command imports its own module only",
    "raymarch.export.forms": "a form of text is one file",
    "raymarch.sdf.pickling": "definitions of users",
    "raymarch.files": "packages that are not required",
}
"""Modules that import by a name that is computed, and why."""


CALLS = ("import_module", "__import__")


def known(name: str) -> str | None:
    """The module of this package that an import of a name executes last."""
    while name and name not in FILES:
        name = name.rpartition(".")[0]
    return name or None


def imported(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Every module that is imported, with the line; not what type checkers alone import."""
    pending: list[Any] = [tree]
    while pending:
        node = pending.pop()
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            pending += node.orelse
            continue
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in CALLS:
            given = node.args[0]
            names = [given.value] if isinstance(given, ast.Constant) else [""]
        else:
            names = []
        yield from ((name, getattr(node, "lineno", 0)) for name in names)
        pending += ast.iter_child_nodes(node)


@cache
def imports_of(module: str) -> list[tuple[str, int]]:
    return list(imported(ast.parse(FILES[module].read_text())))


@cache
def edges() -> dict[str, dict[str, int]]:
    """For each module, those of this package that it imports, with a line."""
    found: dict[str, dict[str, int]] = {}
    for module in FILES:
        pairs = ((known(name), line) for name, line in imports_of(module))
        found[module] = {target: line for target, line in pairs if target not in (None, module, FACE)}
    return found


def layers() -> dict[str, int]:
    """The height of each package, from the contract of import-linter."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    rows = next(c["layers"] for c in contracts if c["name"] == "Layers import downwards only")
    return {name.strip(): -i for i, row in enumerate(rows) for name in row.split("|")}


def test_no_module_imports_one_of_a_layer_above() -> None:
    height = layers()

    def of(module: str) -> int | None:
        return next((height[name] for name in height if f"{module}.".startswith(f"{name}.")), None)

    upward = [
        f"{module}:{line} imports {target}"
        for module, targets in edges().items()
        if module != FACE
        for target, line in targets.items()
        if (mine := of(module)) is not None and (other := of(target)) is not None and other > mine
    ]
    assert upward == []


def test_no_modules_import_each_other() -> None:
    """Also through others: the modules can be put in an order in which each imports earlier ones only."""
    left = {module: set(targets) for module, targets in edges().items()}
    while ready := {module for module, targets in left.items() if not targets & left.keys()}:
        left = {module: targets for module, targets in left.items() if module not in ready}
    assert sorted(left) == [], "these are in a circle, or import one that is"


def test_modules_that_import_by_name_say_why() -> None:
    named = {
        module for module, file in FILES.items() if any(name == "" for name, _ in imported(ast.parse(file.read_text())))
    }
    assert named == BY_NAME.keys()


def test_the_test_sees_imports_of_all_kinds() -> None:
    code = """
import raymarch.sdf.node
def late():
    from raymarch.sdf import lower
    import_module("raymarch.gpu")
if TYPE_CHECKING:
    import raymarch.cost
"""
    assert {name for name, _ in imported(ast.parse(code))} == {
        "raymarch.sdf.node",
        "raymarch.sdf.lower",
        "raymarch.gpu",
    }
