"""The same solid relative to another origin.

Far from the origin float32 is too coarse: at 1e6 an ulp is 0.06. A distant solid seen by a nearby camera is therefore
described relative to an origin near the camera: translations are combined in float64, so that the remainder is small.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.node import const
from raymarch.expr.walk import find, run, topological
from raymarch.sdf.affine import affine
from raymarch.sdf.interaction import POSITION
from raymarch.sdf.node import Node, at_line_of, rederived
from raymarch.sdf.placement import affine_of, at_point, offset_of
from raymarch.sdf.placing import translate

Vector: TypeAlias = NDArray[np.float64]
Matrix: TypeAlias = NDArray[np.float64]
Request: TypeAlias = tuple[Node, tuple[float, ...]]
Work: TypeAlias = Generator[Request, Node, Node]


def shifted(node: Node, by: Vector) -> Node:
    """A solid whose field at p is that of `node` at p + by; by has shape (3,), float64.

    The shift is passed down through unions, blends, labels and whatever is placed, to translations and to shapes with a
    `Definition.shift`, which absorb it. Any other node is translated.
    """
    first: Request = (node, _key(by))
    return run(first, lambda each: _shift(each[0], np.array(each[1])), lambda each: (id(each[0]), each[1]), {})


def _shift(node: Node, by: Vector) -> Work:
    if not np.any(by):
        return node
    if _reads_place(node.label):
        return _translated(node, by)
    if (offset := offset_of(node)) is not None:
        if offset.is_constant:
            return (yield node.children[0], _key(by - np.asarray(offset.data)))
        return at_line_of(node, translate(node.children[0], offset - const(by)))
    rule = node.definition.shift
    if rule is not None and (found := rule(by, **node.params)) is not None:
        changed, rest = found
        made = rederived(node, node.children, {**node.params, **changed}) if changed else node
        return _translated(made, rest)
    if node.children and _pointwise(node):
        return (yield from _below(node, by))
    if (placed := affine_of(node)) is not None:
        return (yield from _placed(node, by, *placed))
    return _translated(node, by)


def _placed(node: Node, by: Vector, linear: Matrix, offset: Vector, factor: float) -> Work:
    """The child is shifted to where the node evaluates it; what is left is linear."""
    child = yield node.children[0], _key(at_point(node, by))
    if not np.any(offset):
        return rederived(node, (child,), node.params)
    return at_line_of(node, affine(child, np.linalg.inv(linear), linear, np.zeros(len(by)), factor))


def _below(node: Node, by: Vector) -> Work:
    """Pass the shift to all children."""
    children = []
    for child in node.children:
        children.append((yield child, _key(by)))
    return rederived(node, tuple(children), node.params)


def _key(by: Vector) -> tuple[float, ...]:
    return tuple(float(v) for v in by)


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
