"""Rules of operations on components: arithmetic, elementary functions, steps and cells."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from raymarch.expr.arrays import SMALLEST
from raymarch.expr.evaluate import Rule
from raymarch.expr.node import Expr
from raymarch.expr.types import Type
from raymarch.proof import rounding as r
from raymarch.proof.rounding import ZERO, Array, Interval
from raymarch.proof.span import Span, constant, lifted, numbered, sides_of, spanned, still

Range: TypeAlias = Callable[..., Interval]
Slope: TypeAlias = Callable[..., Interval]


def _each(range_of: Range, slope_of: Slope) -> Rule:
    """The rule of an operation on components.

    range_of : of intervals. slope_of : of the spans of the arguments and of the range of the result; called if one of
    the spans has a slope. Those of the others are None.
    """

    def rule(node: Expr, *values: Span) -> Span:
        if node.type.shape:  # the rule of a square takes one of the two arguments
            values = tuple(lifted(v, a.type, node.type) for v, a in zip(values, node.args, strict=False))
        low, high = range_of(*[(v.low, v.high) for v in values])
        if all(v.slope is None for v in values):
            return Span(low, high, (low, high), None)
        at = range_of(*[v.at for v in values])
        slope = slope_of(*values, (low, high))
        if sum(v.slope is not None for v in values) == 1:  # the mean value theorem has narrowed its range
            return Span(low, high, at, slope)
        return spanned(low, high, at, slope)

    return rule


def _plus(a: Interval | None, b: Interval | None) -> Interval:
    """The sum of two slopes, of which one may be None."""
    if a is None or b is None:
        found = b if a is None else a
        assert found is not None
        return found
    return r.near_sum(a, b)


def _scaled(slope: Interval | None, factor: Interval) -> Interval | None:
    return None if slope is None else r.mul(slope, factor)


def _of_one(derivative: Callable[[Interval, Interval], Interval]) -> Slope:
    """The slope of a function of one argument; derivative : of the ranges of the argument and of the result."""

    def slope(a: Span, result: Interval) -> Interval:
        assert a.slope is not None
        return r.mul(a.slope, derivative(a.range, result))

    return slope


def _minus(a: Span, b: Span, _result: Interval) -> Interval:
    return _plus(a.slope, None if b.slope is None else r.negative(b.slope))


def _product_slope(a: Span, b: Span, _result: Interval) -> Interval:
    return _plus(_scaled(a.slope, b.range), _scaled(b.slope, a.range))


def _quotient_slope(a: Span, b: Span, result: Interval) -> Interval:
    whole = _plus(a.slope, None if b.slope is None else r.negative(r.mul(b.slope, result)))
    return r.div(whole, b.range)


def _chosen(first: Array, second: Array, a: Interval | None, b: Interval | None) -> Interval:
    """The slope of a where `first` holds, of b where `second` does, else both."""
    one, other = a or ZERO, b or ZERO
    both = r.hull(one, other)
    return (
        np.where(first, one[0], np.where(second, other[0], both[0])),
        np.where(first, one[1], np.where(second, other[1], both[1])),
    )


def _least_slope(a: Span, b: Span, _result: Interval) -> Interval:
    return _chosen(a.high < b.low, b.high < a.low, a.slope, b.slope)


def _greatest_slope(a: Span, b: Span, _result: Interval) -> Interval:
    return _chosen(a.low > b.high, b.low > a.high, a.slope, b.slope)


def _abs_slope(a: Span, _result: Interval) -> Interval:
    assert a.slope is not None
    return _chosen(a.low >= 0.0, a.high <= 0.0, a.slope, r.negative(a.slope))


def jumping_slope(low: Array, high: Array) -> Interval:
    """The slope of a step function with these values at the ends: 0, or unknown if it may jump."""
    jumps = ~(low == high)
    return np.where(jumps, -np.inf, 0.0), np.where(jumps, np.inf, 0.0)


def _steps(compute: Callable[[Array], Array], before: Callable[[Interval], Interval] = lambda a: a) -> Rule:
    """A function of steps that never falls; `before` is done to the argument first."""

    def range_of(a: Interval) -> Interval:
        low, high = before(a)
        return compute(low), compute(high)

    def rule(_node: Expr, a: Span) -> Span:
        low, high = range_of(a.range)
        if a.slope is None:
            return Span(low, high, (low, high), None)
        at, sides = range_of(a.at), sides_of(high - low == 1.0)
        if sides is not None:
            value = np.where(sides == 1, high, low)
            low, high = (np.where(sides >= 0, value, end) for end in (low, high))
            at = np.where(sides >= 0, value, at[0]), np.where(sides >= 0, value, at[1])
        return Span(low, high, (at[0], at[1]), jumping_slope(low, high))

    return numbered(rule)


MIN, MAX = (
    _each(lambda a, b: (np.minimum(a[0], b[0]), np.minimum(a[1], b[1])), _least_slope),
    _each(lambda a, b: (np.maximum(a[0], b[0]), np.maximum(a[1], b[1])), _greatest_slope),
)
ADD = _each(r.add, lambda a, b, _result: _plus(a.slope, b.slope))
NEAR_ADD = _each(r.near_sum, lambda a, b, _result: _plus(a.slope, b.slope))
SUB, MUL, DIV = _each(r.sub, _minus), _each(r.mul, _product_slope), _each(r.div, _quotient_slope)
SQUARE = _each(r.square, _of_one(lambda a, _result: (2.0 * a[0], 2.0 * a[1])))


def _root_derivative(a: Interval, result: Interval) -> Interval:
    low, high = r.reciprocal((2.0 * result[0], 2.0 * result[1]))
    return np.where(a[0] > 0.0, low, 0.0), np.where(a[0] > 0.0, high, np.inf)


ROOT = _each(r.root, _of_one(_root_derivative))


def _clamp(node: Expr, x: Span, low: Span, high: Span) -> Span:
    least, most = (lifted(end, a.type, node.type) for end, a in zip((low, high), node.args[1:], strict=True))
    return typed(MIN, node, typed(MAX, node, lifted(x, node.args[0].type, node.type), least), most)


class Typed(NamedTuple):
    """What a rule reads of a node, for arguments that have the type of the result."""

    type: Type
    args: tuple[Typed, ...] = ()


def typed(rule: Rule, node: Any, *values: Span) -> Span:
    """An operation on components of values that all have the type of the node."""
    return rule(Typed(node.type, (Typed(node.type),) * len(values)), *values)


def _minus_clamped(node: Expr, a: Span, b: Span) -> Span:
    """x - y; of a number less what it is clamped to, what is above the greater end and what is below the lesser one."""
    clamped = node.args[1]
    if clamped.op != "clamp" or clamped.args[0] is not node.args[0] or any(v.op != "const" for v in clamped.args[1:]):
        return SUB(node, a, b)
    least, most = (lifted(constant(np.asarray(v.data, np.float64)), v.type, node.type) for v in clamped.args[1:])
    if not np.all(least.low <= most.low):
        return SUB(node, a, b)
    zero = constant(np.asarray(0.0))
    above = typed(MAX, node, typed(SUB, node, a, most), zero)
    return typed(ADD, node, above, typed(MIN, node, typed(SUB, node, a, least), zero))


def _mix(node: Expr, a: Span, b: Span, t: Span) -> Span:
    a, b, t = (lifted(v, arg.type, node.type) for v, arg in zip((a, b, t), node.args, strict=True))
    one = constant(np.asarray(1.0))
    by_weights = typed(ADD, node, typed(MUL, node, a, typed(SUB, node, one, t)), typed(MUL, node, b, t))
    by_difference = typed(ADD, node, a, typed(MUL, node, typed(SUB, node, b, a), t))
    return _met(by_weights, by_difference)


def _met(a: Span, b: Span) -> Span:
    """Two enclosures of one value."""
    slope = None if a.slope is None or b.slope is None else r.meet(a.slope, b.slope)
    return Span(*r.meet(a.range, b.range), r.meet(a.at, b.at), slope)


def _smooth(a: Interval) -> Interval:
    """3 t^2 - 2 t^3 of t from 0 to 1, which never falls."""

    def value(t: Array) -> Interval:
        return r.mul(r.square((t, t)), r.sub((np.asarray(3.0),) * 2, r.mul((np.asarray(2.0),) * 2, (t, t))))

    return np.maximum(value(np.clip(a[0], 0.0, 1.0))[0], 0.0), np.minimum(value(np.clip(a[1], 0.0, 1.0))[1], 1.0)


def _smooth_derivative(t: Interval, _result: Interval) -> Interval:
    """6 t (1 - t), which rises up to 1/2."""
    low, high = np.clip(t[0], 0.0, 1.0), np.clip(t[1], 0.0, 1.0)
    ends = [r.up(6.0 * end * (1.0 - end), 4.0 * r.ULP) for end in (low, high)]
    most = np.where((low <= 0.5) & (high >= 0.5), 1.5, np.maximum(*ends))
    return np.maximum(np.minimum(*ends) * (1.0 - 2.0**-40), 0.0), most


SMOOTH = _each(_smooth, _of_one(_smooth_derivative))


def _smoothstep(node: Expr, low: Span, high: Span, x: Span) -> Span:
    low, high, x = (lifted(v, arg.type, node.type) for v, arg in zip((low, high, x), node.args, strict=True))
    t = typed(DIV, node, typed(SUB, node, x, low), typed(SUB, node, high, low))
    bounded = typed(MIN, node, typed(MAX, node, t, constant(np.asarray(0.0))), constant(np.asarray(1.0)))
    return typed(SMOOTH, node, bounded)


FLOOR = _steps(np.floor)


def _split(first: Array, last: Array) -> tuple[Array, Array]:
    """The one cell of each stretch, and whether it is one: the only one, or the one of the side that is given."""
    known = (first == last) & np.isfinite(first)
    sides = sides_of(last - first == 1.0)
    if sides is None:
        return first, known
    return np.where(sides == 1, last, first), known | (sides >= 0)


def _within_cell(
    value: Callable[[Interval, Array], Interval], x: Span, cells: tuple[Array, Array], ends: Interval, slope: Interval
) -> Span:
    """A value less its cell. cells : as of `_split`; without a cell, the value is anything between `ends`."""
    cell, known = cells

    def chosen(inside: Interval) -> Interval:
        return np.where(known, inside[0], ends[0]), np.where(known, inside[1], ends[1])

    low, high = chosen(value(x.range, cell))
    jumps = np.where(known, slope[0], -np.inf), np.where(known, slope[1], np.inf)
    return spanned(low, high, chosen(value(x.at, cell)), jumps)


def _fract(_node: Expr, x: Span) -> Span:
    first, last = np.floor(x.low), np.floor(x.high)
    if x.slope is None:
        low, high = r.outward(x.low - first, x.high - first)
        same = first == last
        return still((np.where(same, np.maximum(low, 0.0), 0.0), np.where(same, np.minimum(high, 1.0), 1.0)))
    ends = np.asarray(0.0), np.asarray(1.0)
    return _within_cell(lambda a, k: r.outward(a[0] - k, a[1] - k), x, _split(first, last), ends, x.slope)


def _mod(node: Expr, x: Span, y: Span) -> Span:
    x, y = (lifted(v, a.type, node.type) for v, a in zip((x, y), node.args, strict=True))
    first, last = r.whole_quotients(x.range, y.range)
    ends = np.minimum(y.low, 0.0), np.maximum(y.high, 0.0)

    def less(a: Interval, cell: Array) -> Interval:
        return r.sub(a, r.mul(y.range, (cell, cell)))

    if x.slope is None and y.slope is None:
        low, high = r.meet(less(x.range, first), ends)
        same = (first == last) & np.isfinite(first)
        return still((np.where(same, low, ends[0]), np.where(same, high, ends[1])))
    cell, known = _split(first, last)
    slope = _plus(x.slope, None if y.slope is None else r.negative(r.mul(y.slope, (cell, cell))))
    return _within_cell(less, x, (cell, known), ends, slope)


def _atan2(node: Expr, y: Span, x: Span) -> Span:
    """Along the cut at the negative x axis the angle is continued to either side."""
    y, x = (lifted(v, a.type, node.type) for v, a in zip((y, x), node.args, strict=True))
    (low, high), free = r.arctan2(y.range, x.range)
    if y.slope is None and x.slope is None:
        return still((low, high))
    at = r.arctan2(y.at, x.at)[0]
    part = _plus(_scaled(y.slope, x.range), None if x.slope is None else r.negative(r.mul(x.slope, y.range)))
    slope = r.div(part, r.add(r.square(x.range), r.square(y.range)))
    sides = sides_of(~free & (x.high < 0.0))
    if sides is not None:
        turn = r.outward(np.where(sides == 1, np.pi, -np.pi), np.where(sides == 1, np.pi, -np.pi))
        given = sides >= 0
        across, middle = (
            r.add(r.arctan2(r.negative(b), r.negative(a))[0], turn) for b, a in ((y.range, x.range), (y.at, x.at))
        )
        low, high = np.where(given, across[0], low), np.where(given, across[1], high)
        at = np.where(given, middle[0], at[0]), np.where(given, middle[1], at[1])
        free = free | given
    return spanned(low, high, at, (np.where(free, slope[0], -np.inf), np.where(free, slope[1], np.inf)))


def _pow_slope(a: Span, b: Span, result: Interval) -> Interval:
    base = np.maximum(a.low, SMALLEST), np.maximum(a.high, SMALLEST)
    by_base = None
    if a.slope is not None:
        power = r.power(a.range, r.sub(b.range, (np.asarray(1.0),) * 2))
        low, high = r.mul(b.range, power)
        cut = a.low < SMALLEST
        by_base = r.mul(a.slope, (np.where(cut, np.minimum(low, 0.0), low), np.where(cut, np.maximum(high, 0.0), high)))
    return _plus(by_base, _scaled(b.slope, r.mul(result, r.log(base))))


def _log_derivative(a: Interval, _result: Interval) -> Interval:
    low, high = r.reciprocal((np.maximum(a[0], SMALLEST), np.maximum(a[1], SMALLEST)))
    return np.where(a[0] < SMALLEST, 0.0, low), high


def _arc_derivative(a: Interval, _result: Interval) -> Interval:
    """1 / sqrt(1 - x^2), and 0 beyond -1 and 1."""
    most, least = r.magnitude(a), r.absolute(a)[0]
    high = r.reciprocal(r.root(r.sub((np.asarray(1.0),) * 2, r.square((most, most)))))[1]
    low = r.reciprocal(r.root(r.sub((np.asarray(1.0),) * 2, r.square((least, least)))))[0]
    inside = most < 1.0
    return np.where(inside, low, 0.0), np.where(inside, high, np.inf)


def _times_two(a: Interval) -> Interval:
    return r.mul(a, (np.asarray(math.log(2.0)),) * 2)


RULES: Mapping[str, Rule] = {
    "add": ADD,
    "sub": _minus_clamped,
    "mul": lambda node, a, b: SQUARE(node, a) if node.args[0] is node.args[1] else MUL(node, a, b),
    "div": DIV,
    "neg": _each(r.negative, lambda a, _result: r.negative(a.slope)),
    "abs": _each(r.absolute, _abs_slope),
    "min": MIN,
    "max": MAX,
    "clamp": _clamp,
    "mix": _mix,
    "sqrt": ROOT,
    "exp": _each(r.exp, _of_one(lambda _a, result: result)),
    "exp2": _each(r.exp2, _of_one(lambda _a, result: _times_two(result))),
    "log": _each(r.log, _of_one(_log_derivative)),
    "log2": _each(
        r.log2, _of_one(lambda a, result: r.div(_log_derivative(a, result), (np.asarray(math.log(2.0)),) * 2))
    ),
    "sin": _each(r.sine, _of_one(lambda a, _result: r.cosine(a))),
    "cos": _each(r.cosine, _of_one(lambda a, _result: r.negative(r.sine(a)))),
    "tan": _each(r.tangent, _of_one(lambda _a, result: r.add((np.asarray(1.0),) * 2, r.square(result)))),
    "asin": _each(r.arcsin, _of_one(_arc_derivative)),
    "acos": _each(r.arccos, _of_one(lambda a, result: r.negative(_arc_derivative(a, result)))),
    "atan": _each(r.arctan, _of_one(lambda a, _result: r.reciprocal(r.add((np.asarray(1.0),) * 2, r.square(a))))),
    "atan2": numbered(_atan2),
    "sinh": _each(r.sinh, _of_one(lambda a, _result: r.cosh(a))),
    "cosh": _each(r.cosh, _of_one(lambda a, _result: r.sinh(a))),
    "tanh": _each(r.tanh, _of_one(lambda _a, result: r.sub((np.asarray(1.0),) * 2, r.square(result)))),
    "pow": _each(r.power, _pow_slope),
    "floor": FLOOR,
    "ceil": _steps(np.ceil),
    "sign": _steps(np.sign),
    "round": _steps(np.floor, lambda a: r.add(a, (np.asarray(0.5),) * 2)),
    "fract": numbered(_fract),
    "mod": numbered(_mod),
    "step": _each(
        lambda edge, x: (np.where(x[0] >= edge[1], 1.0, 0.0), np.where(x[1] < edge[0], 0.0, 1.0)),
        lambda _edge, _x, result: jumping_slope(*result),
    ),
    "smoothstep": _smoothstep,
}
