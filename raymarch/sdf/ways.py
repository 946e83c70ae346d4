"""Lines below a field along a ray, and how far a ray is free by a line, a chord, a box or the border of a piece."""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

import numpy as np

from raymarch.expr.function import FloatExpr, Vec2Expr, Vec3Expr, function
from raymarch.expr.node import Expr, const
from raymarch.expr.vocabulary import abs, max, min, step, vec2, where
from raymarch.sdf.facts import FARTHEST, Facts

FLATTEST = 1e-20
"""In place of a rate of approach of 0."""


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
