"""Weights of the labelled parts at a surface point, by which materials are mixed."""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.expr.derivative import ONE, sensitivities
from raymarch.expr.function import Function, sum_of
from raymarch.expr.node import Expr
from raymarch.expr.types import BOOL, VEC2
from raymarch.expr.vocabulary import abs, min, where
from raymarch.expr.walk import depends_on, find, topological


def weights_of(marked: Function) -> tuple[list[Expr], list[Expr]]:
    """The marks of a field with labels (see `Lowering.field`), and the share of each, >= 0; their sum may not be 1.

    The share is how much a part's distance moves the field. The ends of an extruded profile are moved by none: there
    the surface is of the flat part that is nearest.
    """
    marks = find([marked.body], "mark")
    weights = [abs(part) for part in sensitivities(marked.body, marks)]
    flat = [k for k, mark in enumerate(marks) if mark.args[1].type is VEC2]
    if flat:
        nearest = marks[flat[0]].args[0]
        for k in flat[1:]:
            nearest = min(nearest, marks[k].args[0])
        still = sum_of(weights) <= 0.0
        for k in flat:
            weights[k] = where(still & (marks[k].args[0] <= nearest), 1.0, weights[k])
    return marks, weights


KEEPING = ("neg", "abs", "min", "max", "where")
"""Operations that pass on the slope of what they choose, but for its sign."""


def gain_of(body: Expr, answers: Sequence[Expr]) -> Expr:
    """The factor by which an operator multiplies its child's distance: 1, but for a scaled solid and its like.

    Materials are blended by the partial derivatives with respect to the distances that enter the blend. This factor
    must not count: a solid that is painted and then scaled shows as much as one that is scaled and then painted. An
    operator that does more to the distance than to multiply it keeps its derivative as it is; the result is then 1.
    """
    gains: dict[Expr, Expr] = dict.fromkeys(answers, ONE)
    dependent = depends_on([body], answers)
    for node in topological([body]):
        if node in gains or node not in dependent or node.type is BOOL:
            continue
        moving = [arg for arg in node.args if arg in dependent and arg.type is not BOOL]
        own = {gains[arg] for arg in moving if arg in gains}
        if len(own) != 1 or any(arg not in gains for arg in moving):
            break
        (gain,) = own
        if node.op in ("mul", "div") and len(moving) == 1 and moving[0] is node.args[0]:
            gains[node] = gain * abs(node.args[1]) if node.op == "mul" else gain / abs(node.args[1])
        elif node.op == "mul" and len(moving) == 1:
            gains[node] = gain * abs(node.args[0])
        elif node.op in KEEPING or (node.op in ("add", "sub") and len(moving) == 1):
            gains[node] = gain
        else:
            break
    return gains.get(body, ONE)
