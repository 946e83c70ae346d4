"""Values of definitions that are marked, and whether a value is scaled by a factor where those of its children are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from raymarch.expr.function import Function, Stated
from raymarch.expr.node import Expr, construct, make
from raymarch.expr.types import BOOL, FLOAT
from raymarch.expr.vocabulary import dot, length, max, where
from raymarch.expr.walk import topological

FLOOR = "floor"


BOUND = "bound"


def with_bound(value: Expr, bound: Expr) -> Expr:
    """The value of a definition, and a field of the same solid that is marched in place of the divided value.

    bound : no steeper than the steepest child. It is worth stating where it is larger than the divided value, such as
        far from the surface.
    """
    return make("max", FLOAT, (value, bound), BOUND)


SELECTS = ("neg", "abs", "min", "max", "where", "add", "sub")


def is_homogeneous(body: Expr) -> bool:
    """True if a definition's value is scaled by a factor where the distances of its children are scaled by it."""
    degree: dict[Expr, int] = {}
    for node in topological([body]):
        of = [degree[arg] for arg in node.args]
        known = {d for arg, d in zip(node.args, of, strict=True) if not _is_zero(arg)}
        if node.op == "apply":
            degree[node] = 1
        elif 1 not in known:
            degree[node] = 0
        elif node.data is BOUND:
            return False
        elif node.data is FLOOR or (known == {1} and node.op in (*SELECTS, "lt", "le", "gt", "ge")):
            degree[node] = 0 if node.type is BOOL else 1
        elif (
            (
                node.op == "where"
                and of[0] == 0
                and all(d == 1 or _is_zero(arg) for arg, d in zip(node.args[1:], of[1:], strict=True))
            )
            or (node.op == "mul" and sum(of) == 1)
            or (node.op == "div" and of == [1, 0])
        ):
            degree[node] = 1
        else:
            return False
    return degree[body] == 1


def _is_zero(value: Expr) -> bool:
    return value.op == "const" and value.type is not BOOL and not np.any(value.data)


def at_least(value: Expr, floor: Expr) -> Expr:
    """The larger of a field and a lower bound of the distance, such as the distance to the box.

    Where both are 0, as on a face that touches the box, the material is that of the field: materials ignore the lower
    bound.
    """
    return make("max", FLOAT, (value, floor), FLOOR)


def from_box(inside: Expr, gap: Expr) -> Expr:
    """An estimate at a point `gap` away from the nearest point of a box around the solid, where its value is `inside`.

    Estimates grow faster than the distance far from their solid. The box is convex, so any point s of it is at least
    sqrt(|gap|^2 + |s - q|^2) away, q being the nearest point: an estimate that is no larger than the distance at q
    gives one that is no larger at the point.
    """
    return where(dot(gap, gap) > 0.0, length(construct(gap, max(inside, 0.0))), inside)


def reading_of(template: Function, undivided: bool) -> Function:
    """A definition as it is written, or the bound that it states in place of its divided value."""
    if template.body.data is not BOUND:
        return template
    body = template.body.args[0 if undivided else 1]
    return template.once(("reading", undivided), lambda: replace(template, body=body, derived={}, stated=Stated()))
