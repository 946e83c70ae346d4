"""Pickles of nodes: a table with one row per node, children first, each with the name of its definition.

A row holds no facts. On unpickling, parameters are checked again, so that a hand-made table cannot
give a node that the definition would refuse.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import FunctionType
from typing import TYPE_CHECKING, Any

from raymarch.errors import Location, SceneError
from raymarch.expr.convert import short
from raymarch.sdf.node import Node, called_by_nodes, children_first

if TYPE_CHECKING:
    from raymarch.sdf.definition import Definition


# Definitions by name


def name_of(definition: Definition) -> tuple[str, str, bool]:
    """Module, name in it, and whether the flat twin is meant; SceneError if the definition is not to be found there."""
    module, name = definition.source.__module__, definition.source.__qualname__
    found = _defined(sys.modules.get(module), name)
    if found is None or definition not in (found, found.flat):
        what = f"pickle: the definition '{definition.name}' ({definition.where}) is not found as {module}.{name}"
        raise SceneError(what, legal="a definition at the top level of a module that can be imported")
    return module, name, definition is not found


def _named(module: Any, name: str) -> Any:
    """The object of a qualified name in a module; None if there is none."""
    found = module
    for part in name.split("."):
        found = getattr(found, part, None)
    return found


def _defined(module: Any, name: str) -> Definition | None:
    return getattr(_named(module, name), "definition", None)


def _definition(name: Any) -> Definition:
    """The definition of a name that `name_of` gave."""
    try:
        module, path, flat = name
        found = _defined(import_module(module), path)
    except (ImportError, TypeError, ValueError, AttributeError):
        found, flat = None, False
    made = found.flat if found is not None and flat else found
    if made is None:
        what = f"unpickling: no definition {short(name)}"
        raise SceneError(what, legal="a definition at the top level of a module that is here")
    return made


def check_name(function: FunctionType, what: str) -> None:
    """SceneError for a Python function that is not to be found by its name."""
    if _named(sys.modules.get(function.__module__), function.__qualname__) is not function:
        legal = "a function at the top level of a module that can be imported"
        raise SceneError(f"pickle: {what} {short(function)} is not found by its name", legal=legal)


# Tables


@called_by_nodes
def reduced(root: Node) -> tuple[Any, ...]:
    """What pickle makes of a node."""
    return remake, (pickled(root),)


def pickled(root: Node) -> list[tuple[Any, ...]]:
    """The rows of a tree, the root last."""
    numbers: dict[int, int] = {}
    rows: list[tuple[Any, ...]] = []
    for node in children_first(root):
        numbers[id(node)] = len(rows)
        for name, value in node.params.items():
            for each in (value, *getattr(value, "functions", ())):
                if isinstance(each, FunctionType):
                    check_name(each, f"{node.name}: {name} =")
        children = tuple(numbers[id(child)] for child in node.children)
        rows.append((name_of(node.definition), children, dict(node.params), node.label, node.where))
    return rows


def remake(rows: Any) -> Node:
    """The tree of some rows, its parameters checked."""
    made: list[Node] = []
    try:
        for name, below, params, label, where in rows:
            definition = _definition(name)
            children = tuple(made[i] for i in below)
            plain = definition.make(children, (), params)
            node = Node(plain.definition, plain.children, plain.params, plain.known_facts, label)
            if not isinstance(where, Location | None):
                raise ValueError(f"where = {where!r}")
            node.where = where
            made.append(node)
        return made[-1]
    except (TypeError, ValueError, IndexError, AttributeError) as fault:
        raise SceneError(f"unpickling a node: {fault}", legal="what pickle made of a node") from fault
