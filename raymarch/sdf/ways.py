"""How far a ray is free by a line below a field, a chord, a box or the border of a piece.

Points that fold, mirror and repeat space move along straight lines piece by piece: a function of the point that is made
of affine functions and of abs, min, max, round, floor and their like is affine along a ray up to the first border
between two of its pieces.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from raymarch.expr.curvature import Kinds
from raymarch.expr.derivative import directional_derivatives
from raymarch.expr.function import FloatExpr, Vec2Expr, Vec3Expr, function
from raymarch.expr.node import Expr, const
from raymarch.expr.partials import ZERO
from raymarch.expr.vocabulary import abs, floor, max, min, step, vec2, where
from raymarch.expr.walk import depends_on, topological
from raymarch.sdf.facts import FARTHEST, Facts

FLATTEST = 1e-20
"""In place of a rate of 0."""


@function("way")
def way_above(line: Vec2Expr, level: FloatExpr, growth: FloatExpr) -> Expr:
    """How far a line, a value and a slope, stays above a level that grows."""
    return min(max(line.x - level, 0.0) / max(growth - line.y, FLATTEST), FARTHEST)


@function()
def way_out(depth: FloatExpr, exit: FloatExpr, level: FloatExpr, growth: FloatExpr) -> Expr:
    """How far a point that is `depth` deep in a convex solid stays deeper than a level, where the ray leaves the solid
    at `exit`: the depth is concave, so it lies above its chord."""
    return min(way_above(vec2(depth, -depth / max(exit, FLATTEST)), level, growth), max(exit, 0.0))


@function()
def way_in_pieces(first: FloatExpr, border: FloatExpr, there: FloatExpr, steepest: FloatExpr) -> Expr:
    """The advance `first` of a field that is of the form read up to a border, where it is at least `there` above the
    level, and Lipschitz beyond."""
    return where(first < border, first, border + max(there, 0.0) / steepest)


@function()
def chord(here: FloatExpr, there: FloatExpr, s: FloatExpr) -> Expr:
    """Where the line from (0, here) to (s, there) is 0; s if it does not fall below 0 before."""
    return s * (max(here, 0.0) / max(here - min(there, 0.0), FLATTEST))


@function()
def way_to_box(p: Vec3Expr, d: Vec3Expr, half: Vec3Expr, growth: FloatExpr) -> Expr:
    """The way to a box about the origin that grows on all sides along the ray; far for a ray that misses it."""
    from_middle, rate = p * (1.0 - 2.0 * step(d, 0.0)), abs(d)
    enter = -(half + from_middle) / max(rate + growth, FLATTEST)
    leave = [
        where(growth < along, (side - at) / max(along - growth, FLATTEST), FARTHEST)
        for along, side, at in zip(rate, half, from_middle, strict=True)
    ]
    first, last = max(*enter), min(*leave)
    return where((last < 0.0) | (last < first), FARTHEST, max(first, 0.0))


class Line(NamedTuple):
    """A value and a slope: a line below a field along the ray."""

    value: Expr
    slope: Expr

    def way(self, level: Expr, growth: Expr) -> Expr:
        """How far the line stays above a level."""
        return way_above(vec2(self.value, self.slope), level, growth)

    def at(self, s: Expr) -> Expr:
        return self.value + self.slope * s


MARGIN = 1e-5
"""Share by which boxes are grown, so that rounding in float32 cannot cut off their solids."""


class Box(NamedTuple):
    """The box of a solid around a point q of its frame, seen along dq. Any of its six sides may be infinitely far.

    spread : a point where the field is v > 0 lies within the box grown by spread v on all sides.
    """

    facts: Facts
    spread: float
    q: Expr
    dq: Expr

    @property
    def middle(self) -> Expr:
        return const(0.5 * (self.facts.lower + self.facts.upper))

    @property
    def half(self) -> Expr:
        ends = np.stack([self.facts.lower, self.facts.upper])
        return const(0.5 * self.facts.size + MARGIN * np.abs(ends).max())

    def sides(self) -> list[Line]:
        """How far the point is outside of each side that is not infinitely far, and how that changes along the ray."""
        ends = np.stack([-self.facts.lower, self.facts.upper])
        margin = MARGIN * np.abs(ends[np.isfinite(ends)]).max()
        known = [(i, 2.0 * k - 1.0, ends[k, i] + margin) for k in (0, 1) for i in range(3) if np.isfinite(ends[k, i])]
        return [Line(sign * self.q[i] - float(end), sign * self.dq[i]) for i, sign, end in known]

    def way(self, level: Expr, growth: Expr) -> Expr:
        """The way to the box, grown by the spread of the level. Of a box that is bounded on some sides only, the ray
        enters the half-spaces of these."""
        grow, rate = self.spread * max(level, 0.0), self.spread * growth
        if self.facts.bounded:
            return way_to_box(self.q - self.middle, self.dq, self.half + grow, rate)
        return reduce(max, [side.way(grow, rate) for side in self.sides()])

    def least(self, s: Expr) -> Expr:
        """A number that the field is not less than at the way s."""
        if self.facts.bounded:
            aside = abs(self.q - self.middle + s * self.dq) - self.half
            return max(*aside) / self.spread
        return reduce(max, [side.at(s) for side in self.sides()]) / self.spread


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
    return where(gap * rate > 0.0, FARTHEST, min((abs(gap) + ON_BORDER) / max(abs(rate), FLATTEST), FARTHEST))


@function()
def way_to_integer(at: FloatExpr, rate: FloatExpr) -> Expr:
    """The way to where a number that is `at` here, and changes by `rate` along the ray, is the next integer. It is 0
    where the number has left an integer by less than its rounding error: it may be read on either side of it."""
    inside = at - floor(at)
    left = where(rate < 0.0, inside, 1.0 - inside)
    left = where((1.0 - left < ROUNDING * max(abs(at), 1.0)) & (abs(rate) > 0.0), 0.0, left)
    return min(left / max(abs(rate), FLATTEST), FARTHEST)


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
