"""How far along a ray an implicit surface is not met: the first root of the parabola below its function on a stretch.

The parabola is that of `raymarch.expr.stretch`, of the function where the ray enters the box. It needs no Lipschitz
constant and cannot pass the surface; near it the step is that of Newton's method.
"""

from __future__ import annotations

from functools import reduce

from raymarch.expr.function import Function
from raymarch.expr.node import Expr, var
from raymarch.expr.smooth import LEAST
from raymarch.expr.stretch import Unbounded, first_root, series_of
from raymarch.expr.types import FLOAT, VEC2, VEC3
from raymarch.expr.vocabulary import abs, max, min, vec3, where
from raymarch.sdf.facts import FARTHEST

CONE = 1e-4
"""A level that grows faster is the radius of a cone, and not the rounding error of a ray."""

SHELL = 1e-4
"""A level above this share of the box grows the box: then the function counts inside of the box only."""

NAMES = ("p", "d", "lower", "upper", "growing", "scales", "w")


def free_way(definition: Function, negated: bool) -> Function | None:
    """`float name(vec3 p, vec3 d, vec3 lower, vec3 upper, vec2 growing, vec3 scales, float w)`: the way that is free.

    p, d : a point and a direction of any length. lower, upper : the box that cuts the solid. growing : level and growth
    of what the field must exceed. scales : level, unit and steepest slope of the function. w : the stretch looked at.
    negated : for the complement. None if nothing is known of the function along a stretch.
    """
    return definition.once(("free way", negated), lambda: _made(definition, negated))


def _made(definition: Function, negated: bool) -> Function | None:
    types = (VEC3, VEC3, VEC3, VEC3, VEC2, VEC3, FLOAT)
    params = tuple(var(name, type) for name, type in zip(NAMES, types, strict=True))
    p, d, lower, upper, growing, scales, w = params
    level, growth = growing
    rate = _nowhere_0(d)
    ends = (lower - p) / rate, (upper - p) / rate
    first, last = max(*min(*ends)), min(*max(*ends))
    start = max(first, 0.0)
    try:
        reading, found = series_of(definition, p + start * d, d, min(w, max(last - start, LEAST)))
    except Unbounded:
        return None
    side, end = (-1.0, 1) if negated else (1.0, 0)
    # A cone needs the distance, of which the divided function is a bound. The rounding error of a ray is no distance:
    # where the function is flat, as at singular points, it is met far before its surface.
    grown = level > SHELL * max(*(upper - lower))
    factor = where(growth > CONE, scales.z / scales.y, where(grown, 1.0, 0.0))
    value = side * (found.c[0] - scales.x + found.jump[end]) / scales.y - factor * (level + growth * start)
    slope = side * (found.rate + found.slope[end]) / scales.y - factor * growth
    curve = side * reading.tail(found, 2)[end] / scales.y
    ahead = first_root(value, slope, curve, reading.w)
    inside = (first <= 0.0) & (last >= 0.0)
    if negated:
        body = where(inside, min(ahead, _exit(p, d, lower + level, upper - level, growth)), 0.0)
    else:
        missed = (last < start) | (start + ahead >= last)
        through = where(missed, FARTHEST, start + ahead)
        body = where(grown, where(inside, min(ahead, last), 0.0), through)
    return Function(f"{definition.name}_free{'_inside' * negated}", params, body, where=definition.where)


def _nowhere_0(d: Expr) -> Expr:
    """A direction without components of 0."""
    return vec3(*[where(abs(each) < LEAST, LEAST, each) for each in d])


def _exit(p: Expr, d: Expr, lower: Expr, upper: Expr, growth: Expr) -> Expr:
    """The way to where a point leaves a box that shrinks on all sides; 0 outside."""
    gaps = [*(upper - p), *(p - lower)]
    rates = [growth + sign * each for sign in (1.0, -1.0) for each in d]
    ways = [where(rate > LEAST, gap / max(rate, LEAST), FARTHEST) for gap, rate in zip(gaps, rates, strict=True)]
    return where(min(*gaps) > 0.0, max(reduce(min, ways), 0.0), 0.0)
