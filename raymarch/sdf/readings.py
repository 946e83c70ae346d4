"""What a node answers along a ray, and how answers combine; see `raymarch.sdf.advance`.

The contract of a leaf
----------------------
A `Reading` has the value, a line below the field, and a function `ahead(level, growth)`.

- `line` is a value v and a slope m with f(p + s d) >= v + m s for all s >= 0: of a convex function the tangent, of a
  function with the Lipschitz constant L its value and -L |d|.
- `ahead` is the advance, an expression; 0 where f <= level. By default it is where the line meets the level.
- A leaf whose bounds hold on a stretch of the ray only, such as those from intervals of the slope, reads
  `raymarch.sdf.advance.STRETCH`: the stretch w > 0 that is looked at. It answers with a <= w, and a = w if all of it is
  free. The loop doubles w after a step of w, and else sets it to 1.5 a. Its line is that of the Lipschitz constant, or
  a line that falls at once if there is none.

Rules
-----
Union: the least advance. Intersection: the greatest. f + c: the level less c. c f: the level by c. A smooth minimum
lies at most k/4 below the least operand and is concave in its operands; a smooth maximum lies above the greatest and is
convex. docs/theory.md has proofs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from raymarch.expr.derivative import directional_derivatives
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const, var
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import max, min, where
from raymarch.expr.walk import substitute
from raymarch.sdf.blends import FAMILIES
from raymarch.sdf.ways import Line, chord

Ahead: TypeAlias = Callable[[Expr, Expr], Expr]


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """What a node answers along a ray; see the head of this module.

    straight : True if nothing but lines is known below the field.
    curve : for a smooth minimum, a concave function of the way s below the field, in place of the line.
    first : for that, the way to where the first of the operands' lines meets the level.
    signed : the advance, and inside of the solid, where -f > level + growth s up to s = a, -a; for a level >= 0.
    """

    value: Expr
    line: Line
    ahead: Ahead
    straight: bool = False
    curve: Callable[[Expr], Expr] | None = None
    first: Ahead | None = None
    signed: Ahead | None = None

    @property
    def whole(self) -> Ahead:
        """The advance, with its sign where that is known."""
        return self.ahead if self.signed is None else self.signed

    def below(self, s: Expr) -> Expr:
        """A concave function of the way s that is nowhere above the field."""
        return self.line.at(s) if self.curve is None else self.curve(s)

    def meets(self, level: Expr, growth: Expr) -> Expr:
        """The way to where the first line meets the level."""
        return self.line.way(level, growth) if self.first is None else self.first(level, growth)

    def shifted(self, value: Expr, offset: Expr) -> Reading:
        """The reading of the value plus a number that does not depend on the point."""
        line = Line(self.line.value + offset, self.line.slope)
        if self.straight and self.curve is None:
            return of_line(value, line)
        return Reading(
            value,
            line,
            lambda level, growth: self.ahead(level - offset, growth),
            self.straight,
            lambda s: self.below(s) + offset,
            lambda level, growth: self.meets(level - offset, growth),
        )

    def scaled(self, value: Expr, factor: Expr) -> Reading:
        """The reading of the value times a factor > 0 that does not depend on the point."""
        line = Line(self.line.value * factor, self.line.slope * factor)
        if self.straight and self.curve is None:
            return of_line(value, line)
        return Reading(
            value,
            line,
            lambda level, growth: self.ahead(level / factor, growth / factor),
            self.straight,
            lambda s: self.below(s) * factor,
            lambda level, growth: self.meets(level / factor, growth / factor),
            self.signed and (lambda level, growth: self.whole(level / factor, growth / factor)),
        )

    def beside(self, line: Line) -> Reading:
        """The same, where a further line lies below the value."""

        def signed(level: Expr, growth: Expr) -> Expr:
            way = self.whole(level, growth)
            return where(way < 0.0, way, max(way, line.way(level, growth)))

        return Reading(
            self.value,
            self.line,
            lambda *at: max(self.ahead(*at), line.way(*at)),
            signed=self.signed and signed,
        )


def of_line(value: Expr, line: Line) -> Reading:
    """The reading of a value of which a line is known."""
    return Reading(value, line, line.way, straight=True)


def union_of(value: Expr, a: Reading, b: Reading) -> Reading:
    """The reading of the smaller value."""
    line = Line(min(a.line.value, b.line.value), min(a.line.slope, b.line.slope))
    signed = a.signed or b.signed
    return Reading(
        value,
        line,
        lambda *at: min(a.ahead(*at), b.ahead(*at)),
        signed=signed and (lambda *at: min(a.whole(*at), b.whole(*at))),
    )


def intersection_of(value: Expr, a: Reading, b: Reading) -> Reading:
    """The reading of the larger value, which lies above the lines of both."""
    slope = where(a.line.value < b.line.value, b.line.slope, a.line.slope)
    line = Line(max(a.line.value, b.line.value), slope)
    signed = a.signed or b.signed
    return Reading(
        value,
        line,
        lambda *at: max(a.ahead(*at), b.ahead(*at)),
        signed=signed and (lambda *at: max(a.whole(*at), b.whole(*at))),
    )


UNIFORM = frozenset(FAMILIES[name](1).fold for name in "quadratic cubic quartic circular exponential root".split())
"""Smooth minima that lie at most k/4 below the smaller distance, whatever the distances are."""


def smooth_minimum_of(value: Expr, fold: Function, a: Reading, b: Reading, width: Expr) -> Reading:
    """The reading of a smooth minimum: concave in two distances that lie above lines, so it lies above its chord from
    here to where the first line meets the level."""

    straight = a.straight and b.straight

    def first(level: Expr, growth: Expr) -> Expr:
        return min(a.meets(level, growth), b.meets(level, growth))

    def curve(s: Expr) -> Expr:
        return fold(a.below(s), b.below(s), width)

    def ahead(level: Expr, growth: Expr) -> Expr:
        s = first(level, growth)
        found = chord(value - level, curve(s) - level - growth * s, s)
        if fold not in UNIFORM or straight:
            return found
        above = level + 0.25 * width
        return max(found, min(a.ahead(above, growth), b.ahead(above, growth)))

    slope = min(a.line.slope, b.line.slope)
    if fold not in UNIFORM:  # the partial derivatives add up to at most the root of 2
        slope = min(slope, math.sqrt(2.0) * slope)
    return Reading(value, Line(value, slope), ahead, straight, curve, first)


def smooth_maximum_of(value: Expr, fold: Function, a: Reading, b: Reading, width: Expr) -> Reading:
    """The reading of a smooth maximum, -fold(-a, -b): above both, convex in both, and falling in neither."""
    x, y = var("x", FLOAT), var("y", FLOAT)
    rates = [directional_derivatives(fold(x, y, width), one, [const(1.0)])[0] for one in (x, y)]
    rates = substitute(rates, {x: -a.line.value, y: -b.line.value})
    line = Line(value, rates[0] * a.line.slope + rates[1] * b.line.slope)
    if a.line.value is not a.value or b.line.value is not b.value:
        line = intersection_of(value, a, b).line
    return Reading(value, line, lambda *at: max(line.way(*at), max(a.ahead(*at), b.ahead(*at))))
