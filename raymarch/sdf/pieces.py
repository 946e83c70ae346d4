"""Points that move along straight lines piece by piece: folds, mirrors and cells of repetition.

A function of the point that is made of affine functions and of abs, min, max, round, floor and their like is affine
along a ray up to the first border between two of its pieces.
"""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.expr.curvature import Kinds
from raymarch.expr.derivative import directional_derivatives
from raymarch.expr.function import FloatExpr, function
from raymarch.expr.node import Expr
from raymarch.expr.partials import ZERO
from raymarch.expr.vocabulary import floor, max, min, where
from raymarch.expr.walk import depends_on, topological
from raymarch.sdf.facts import FARTHEST

STEEPEST = 1e-20
"""In place of a rate that is 0."""

ON_BORDER = 1e-18
"""A way that is nearly 0, over a rate of 0: a ray in a border stays there."""

ROUNDING = 5e-7
"""Relative error of a number that counts cells, in float32."""

_KEEPS = frozenset("add sub neg swizzle construct within".split())
"""Operations that give affine functions of affine ones, without a border."""

_GRIDS = {"round": 0.5, "floor": 0.0, "fract": 0.0, "ceil": 0.0}
"""Operations with a border at each integer plus this number."""


@function()
def way_to_kink(gap: FloatExpr, rate: FloatExpr) -> Expr:
    """The way to where a number that is `gap` here, and changes by `rate` along the ray, is 0; far if it was 0."""
    return where(gap * rate > 0.0, FARTHEST, min((abs(gap) + ON_BORDER) / max(abs(rate), STEEPEST), FARTHEST))


@function()
def way_to_integer(at: FloatExpr, rate: FloatExpr) -> Expr:
    """The way to where a number that is `at` here, and changes by `rate` along the ray, is the next integer. It is 0
    where the number has left an integer by less than its rounding error: it may be read on either side of it."""
    inside = at - floor(at)
    left = where(rate < 0.0, inside, 1.0 - inside)
    left = where((1.0 - left < ROUNDING * max(abs(at), 1.0)) & (abs(rate) > 0.0), 0.0, left)
    return min(left / max(abs(rate), STEEPEST), FARTHEST)


def borders(root: Expr, point: Expr, direction: Expr, known: dict[Expr, Kinds]) -> list[Expr] | None:
    """The ways along a direction to each border of the pieces of an expression; None if it is not made of pieces.

    point : the variable. known : the kinds of the variables, see `raymarch.expr.curvature.kinds_of`.
    """
    moving = depends_on([root], [point])
    found: dict[Expr, None] = {}
    for e in topological([root]):
        if e not in moving or e is point or e.op in _KEEPS:
            continue
        args = [arg for arg in e.args if arg in moving]
        if e.op in ("mul", "dot", "matmul") and len(args) == 1:
            continue
        if e.op == "div" and args == [e.args[0]]:
            continue
        gaps = _gaps(e)
        if gaps is None:
            return None
        for gap, offset in gaps:
            rates = directional_derivatives(gap, point, [direction])[0]
            for one, rate in zip(_each(gap), _each(rates), strict=True):
                if rate is ZERO:  # a number of a piece, such as the index of a cell
                    continue
                if offset is None:
                    found[way_to_kink(one, rate)] = None
                else:
                    found[way_to_integer(one - offset if offset else one, rate)] = None
    return list(found)


def _each(value: Expr) -> Sequence[Expr]:
    return list(value) if value.type.is_vector else [value]


def _gaps(e: Expr) -> list[tuple[Expr, float | None]] | None:
    """What is 0, or the next integer plus a number, at the borders of an operation; None for an unknown one."""
    if e.op in ("abs", "sign"):
        return [(e.args[0], None)]
    if e.op in ("min", "max", "step", "lt", "le"):
        return [(e.args[0] - e.args[1], None)]
    if e.op == "clamp":
        return [(e.args[0] - e.args[1], None), (e.args[0] - e.args[2], None)]
    if e.op in _GRIDS:
        return [(e.args[0], _GRIDS[e.op])]
    if e.op == "mod":
        return [(e.args[0] / e.args[1], 0.0)]
    if e.op in ("where", "and", "or", "not"):
        return []
    return None
