"""Weights of the labelled parts at a surface point. Materials are interpolated with them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

from raymarch.expr.adjoints import add_choices, map_choices
from raymarch.expr.derivative import partial_derivatives
from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.partials import ONE
from raymarch.expr.types import BOOL, VEC2
from raymarch.expr.vocabulary import abs, min, where
from raymarch.expr.walk import depends_on, find, topological


def weights_of(marked: Function) -> tuple[list[Expr], list[Expr]]:
    """The marks of a field with labels (see `Lowering.field`), and their weights, >= 0. The sum may differ from 1.

    The weight of a part is the absolute partial derivative of the field with respect to the part's distance. At the
    end caps of an extruded profile all derivatives are 0; there the nearest flat part gets the weight 1.
    """
    marks = find([marked.body], "mark")
    weights = [map_choices(abs, part) for part in partial_derivatives(marked.body, marks)]
    flat = [k for k, mark in enumerate(marks) if mark.args[1].type is VEC2]
    if flat:
        nearest = marks[flat[0]].args[0]
        for k in flat[1:]:
            nearest = min(nearest, marks[k].args[0])
        still = reduce(add_choices, weights) <= 0.0
        for k in flat:
            weights[k] = where(still & (marks[k].args[0] <= nearest), 1.0, weights[k])
    return marks, weights


UNSCALED = ("neg", "abs", "min", "max", "where")
"""Operations that select an argument or change its sign, but do not scale it."""


def distance_scale(body: Expr, children: Sequence[Expr]) -> Expr:
    """The factor by which an operator multiplies its child's distance: 1 unless it scales the solid.

    body : the field of the operator. children : the fields of its child, as they occur in the body.

    The weights of materials are partial derivatives with respect to the distances of the parts. This factor must not
    change them: a material that is set before `scale` gets the same weight as one that is set after it. The result is
    1 for an operator that does more than multiply the distance.
    """
    scales: dict[Expr, Expr] = dict.fromkeys(children, ONE)
    dependent = depends_on([body], children)
    for node in topological([body]):
        if node in scales or node not in dependent or node.type is BOOL:
            continue
        moving = [arg for arg in node.args if arg in dependent and arg.type is not BOOL]
        own = {scales[arg] for arg in moving if arg in scales}
        if len(own) != 1 or any(arg not in scales for arg in moving):
            break
        (scale,) = own
        if node.op in ("mul", "div") and len(moving) == 1 and moving[0] is node.args[0]:
            scales[node] = scale * abs(node.args[1]) if node.op == "mul" else scale / abs(node.args[1])
        elif node.op == "mul" and len(moving) == 1:
            scales[node] = scale * abs(node.args[0])
        elif node.op in UNSCALED or (node.op in ("add", "sub") and len(moving) == 1):
            scales[node] = scale
        else:
            break
    return scales.get(body, ONE)
