"""Where a placed operator evaluates its child, in the forms that others ask for; see `definition.PLACED`."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import evaluator, value_of
from raymarch.expr.node import Expr, const
from raymarch.expr.walk import free_variables, substitute
from raymarch.sdf.definition import PLACED
from raymarch.sdf.node import Node, has_constants

Array: TypeAlias = NDArray[np.float64]


def offset_of(node: Node) -> Expr | None:
    """The vec3 by which a node moves its child, if it does nothing else; None for any other node."""
    return _other_side(node, "sub", 0)


def turn_of(node: Node) -> Array | None:
    """The matrix by which a rotation or reflection about the origin moves its child, for column vectors; None for any
    other node, and for one that depends on parameters or time."""
    turned = _other_side(node, "matmul", 1)
    return None if turned is None or not turned.is_constant else np.asarray(value_of(turned), np.float64).T


def _other_side(node: Node, op: str, side: int) -> Expr | None:
    """The other argument of the operation by which a rigid node changes its point; None for one of another form."""
    if node.label is not None or node.placed_as != "rigid":
        return None
    template = node.definition.template(1, node.params)
    point, moved = template.params[0], template.body.args[0] if template.body.args else template.body
    if moved.op != op or moved.args[side] is not point or point in free_variables([moved.args[1 - side]]):
        return None
    (found,) = substitute([moved.args[1 - side]], node.definition.named(template, node.params))
    return found


def affine_of(node: Node) -> tuple[Array, Array, float] | None:
    """Of a placed node with constant numbers: the matrix and the offset of the map to the child's point, and the factor
    of the child's value. None for any other node."""
    if node.placed_as not in PLACED or not has_constants(node):
        return None
    point, moved, factor = node.definition.placement(node.params)
    run = evaluator([moved, const(1.0) if factor is None else factor], [point])
    size = point.type.size
    at, scale = run(np.concatenate([np.zeros((1, size)), np.eye(size)]))
    at = np.broadcast_to(at, (size + 1, size))
    return (at[1:] - at[0]).T, at[0], float(np.max(scale))


def at_point(node: Node, point: Any) -> Array:
    """The point at which a placed node with constant numbers evaluates its child; point has shape (d,)."""
    symbol, moved, _ = node.definition.placement(node.params)
    (found,) = evaluator([moved], [symbol])(np.asarray(point, np.float64)[None])
    return np.broadcast_to(found, (1, symbol.type.size))[0]
