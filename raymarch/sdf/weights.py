"""Weights of the labelled parts at a surface point, by which materials are mixed."""

from __future__ import annotations

from raymarch.expr.derivative import sensitivities
from raymarch.expr.function import Function, sum_of
from raymarch.expr.node import Expr
from raymarch.expr.types import VEC2
from raymarch.expr.vocabulary import abs, min, where
from raymarch.expr.walk import find


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
