"""The same solid relative to another origin.

Far from the origin float32 is too coarse: at 1e6 an ulp is 0.06. A distant solid seen by a nearby camera is therefore
described relative to an origin near the camera: translations are combined in float64, so that the remainder is small.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import value_of
from raymarch.expr.node import Expr, const
from raymarch.expr.walk import find, run, topological
from raymarch.sdf.instancing import moved
from raymarch.sdf.labels import rows_of
from raymarch.sdf.lower import POSITION
from raymarch.sdf.node import Node, at_line_of, replaced
from raymarch.sdf.placing import rotation_matrix, translate
from raymarch.sdf.repetition import INFINITE

Vector: TypeAlias = NDArray[np.float64]
Request: TypeAlias = tuple[Node, tuple[float, ...]]
Work: TypeAlias = Generator[Request, Node, Node]


def shifted(node: Node, by: Vector) -> Node:
    """A solid whose field at p is that of `node` at p + by; by has shape (3,), float64.

    The shift is passed down through unions, blends, labels, rotations and even scales to translations and planes, which
    absorb it. Any other node is translated.
    """
    first: Request = (node, _key(by))
    return run(first, lambda each: _shift(each[0], np.array(each[1])), lambda each: (id(each[0]), each[1]), {})


def _shift(node: Node, by: Vector) -> Work:
    if not np.any(by):
        return node
    name, params = node.definition.name, node.params
    if _reads_place(node.label):
        return _translated(node, by)
    if name == "translate" and params["offset"].is_constant:
        return (yield node.children[0], _key(by - params["offset"].data))
    if name == "translate":
        return _again(node, node.children, {**params, "offset": params["offset"] - const(by)})
    if name == "plane" and params["normal"].is_constant:
        return _again(node, (), {**params, "offset": params["offset"] - float(np.dot(_unit(params["normal"]), by))})
    if name == "rotate_about" and all(params[n].is_constant for n in ("axis", "angle")):
        turn = np.asarray(value_of(rotation_matrix(params["axis"], params["angle"])), np.float64)
        return _again(node, ((yield node.children[0], _key(turn.T @ by)),), params)
    if name == "scale_evenly" and params["factor"].is_constant:
        return _again(node, ((yield node.children[0], _key(by / float(params["factor"].data))),), params)
    if (rows := rows_of(node)) is not None:
        return _again(node, (), {"rows": moved(rows, -by)})
    if name == "repeat_cells" and params["spacing"].is_constant:
        return _translated(node, _within_a_cell(params, by))
    if node.children and _pointwise(node):
        return (yield from _below(node, by))
    return _translated(node, by)


def _below(node: Node, by: Vector) -> Work:
    """Pass the shift to all children."""
    children = []
    for child in node.children:
        children.append((yield child, _key(by)))
    return _again(node, tuple(children), node.params)


def _key(by: Vector) -> tuple[float, ...]:
    return tuple(float(v) for v in by)


def _unit(direction: Expr) -> Vector:
    return np.asarray(direction.data, np.float64) / np.linalg.norm(direction.data)


def _within_a_cell(params: Any, by: Vector) -> Vector:
    """An infinite repetition is periodic: whole cells of the shift are dropped."""
    spacing = np.asarray(params["spacing"].data, np.float64)
    endless = np.array([params[n] == INFINITE for n in ("nx", "ny", "nz")])
    return np.where(endless, by - spacing * np.rint(by / spacing), by)


def _again(node: Node, children: tuple[Node, ...], params: Any) -> Node:
    """The node with other children and parameters, and the facts that follow."""
    return replaced(node, children, params, node.definition.derive(children, params))


def _translated(node: Node, by: Vector) -> Node:
    return at_line_of(node, translate(node, _key(-by))) if np.any(by) else node


def _reads_place(label: Any) -> bool:
    """True for a material that differs from point to point."""
    return POSITION in find(getattr(label, "expressions", ()), "var")


def _pointwise(node: Node) -> bool:
    """True if the definition evaluates its children at its own point and does not use the point otherwise."""
    template = node.definition.template(len(node.children), node.params)
    p = template.params[0]
    parts = topological([template.body])
    return all(part.args[0] is p if part.op == "apply" else p not in part.args for part in parts)
