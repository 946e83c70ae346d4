"""The variables to which a scene file assigns nodes. They name functions and values in GLSL."""

from __future__ import annotations

import ast
import linecache
from functools import lru_cache
from typing import NamedTuple

from raymarch.errors import Location, is_users
from raymarch.sdf.node import Node


class Assignment(NamedTuple):
    """An assignment to one name, or a return, and its lines, counted from 1."""

    first: int
    last: int
    name: str


def assignment_of(node: Node) -> Assignment | None:
    """The assignment on whose lines a node was made, in the user's file; None for other statements."""
    where: Location | None = node.where
    if where is None or not is_users(where.file):
        return None
    lines = linecache.getlines(where.file)
    of, known = _known.get(where.file, (None, {}))
    if of is not lines:  # the file was read again
        known = {}
        _known[where.file] = lines, known
    if where.line not in known:
        found = [each for each in _assignments("".join(lines)) if each.first <= where.line <= each.last]
        known[where.line] = max(found, default=None)
    return known[where.line]


_known: dict[str, tuple[list[str], dict[int, Assignment | None]]] = {}
"""The assignments of the lines that were asked for, by file, each with the file's lines at that time."""


@lru_cache(maxsize=16)
def _assignments(source: str) -> tuple[Assignment, ...]:
    """The assignments of a file to a single name; what a function returns has the function's name."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):
        return ()
    found = []
    for each in ast.walk(tree):
        if isinstance(each, ast.Assign) and len(each.targets) == 1 and isinstance(each.targets[0], ast.Name):
            found.append(Assignment(each.lineno, each.end_lineno or each.lineno, each.targets[0].id))
        if isinstance(each, ast.FunctionDef):
            returns = [inner for inner in ast.walk(each) if isinstance(inner, ast.Return)]
            found += [Assignment(r.lineno, r.end_lineno or r.lineno, each.name) for r in returns]
    return tuple(found)
