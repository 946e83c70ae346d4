"""The reading of expressions along stretches of rays: ranges of value and slope, rounded outwards.

A value is a `Span`. For each of N stretches it has the range of the value, its value at one point of the stretch (the
centre), and the range of its slope, the change per unit of length. Each operation has three results: the range of its
arguments' ranges, the value at the centre, and the slope by the chain rule. By the mean value theorem the range also
lies within centre + slope x (distance from the centre); the common part of both is kept. So ranges of a smooth function
are as wide as the stretch at first, and their excess shrinks with its square.

Where a value may jump (a floor, a condition, the cut of an angle), the slope is unknown, and its range counts alone.
Kinks (min, abs) have the slopes of both sides (Clarke 1983, the mean value theorem of functions with kinks).

A short stretch over a jump has two values only, such as two neighbouring cells. Each is evaluated on the whole stretch
(`sides`): both are smooth, and at each point the field is one of them. So their hull holds the field.

This reading is apart from `raymarch.expr.intervals` and from `raymarch.expr.derivative`, whose results it judges.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np

from raymarch.expr import hashing, samples, tables, textures
from raymarch.expr.arrays import FLOAT64, SHORTEST, SMALLEST, lift
from raymarch.expr.evaluate import Program, Rule, program_of
from raymarch.expr.function import Function, Loop
from raymarch.expr.node import Expr
from raymarch.expr.types import BOOL, FLOAT, Type
from raymarch.proof import rounding as r
from raymarch.proof.rounding import ZERO, Array, Interval


class Span(NamedTuple):
    """A value along N stretches. All arrays have the shape (N, ...), or lack the first axis.

    low, high : range over the stretch. at : range of the value at the centre. slope : range of the change per length;
    None if the value is the same all along the stretch. Of a condition, low means "always" and high "sometimes".
    """

    low: Array
    high: Array
    at: Interval
    slope: Interval | None

    @property
    def range(self) -> Interval:
        return self.low, self.high


Value: TypeAlias = "Span | tuple[Any, ...]"


class _Stretches(threading.local):
    """What is evaluated: how far the stretches go before and behind their centres, (N,) each."""

    before: Array = np.zeros(1)
    behind: Array = np.zeros(1)
    jumps: list[Array] | None = None
    """For each operation that may jump, in order: where it has two values, (N,) each. None: not asked."""
    sides: Array | None = None
    """For each such operation and each stretch: 0 the first value, 1 the second, -1 both; (operations, N)."""
    count: int = 0
    """The number of such operations so far."""


_now = _Stretches()


@contextmanager
def stretches(before: Array, behind: Array) -> Iterator[None]:
    """Evaluate stretches that begin `before` their centres and end `behind` them; lengths (N,), rounded up."""
    earlier = _now.before, _now.behind
    _now.before, _now.behind = before, behind
    try:
        with np.errstate(all="ignore"):
            yield
    finally:
        _now.before, _now.behind = earlier


@contextmanager
def jumping(sides: Array | None = None) -> Iterator[list[Array]]:
    """Ask one evaluation which operations jump, or give each its side."""
    _now.jumps, _now.sides, _now.count = [], sides, 0
    try:
        yield _now.jumps
    finally:
        _now.jumps = _now.sides = None


def _sides_of(two: Array) -> Array | None:
    """The sides of an operation that has one of two values where `two` holds, in its shape; None if none are given."""
    if _now.jumps is None:
        return None
    rows = len(_now.before)
    wide = np.broadcast_to(two, (rows, *np.shape(two)[1:])) if np.ndim(two) else np.broadcast_to(two, rows)
    flat = wide.reshape(rows, -1)
    first, _now.count = _now.count, _now.count + flat.shape[1]
    if _now.sides is None:
        _now.jumps += list(flat.T)
        return None
    return _now.sides[first : _now.count].T.reshape(wide.shape)


def still(value: Interval) -> Span:
    """A value that is the same all along the stretch."""
    return Span(*value, value, None)


def constant(value: Array) -> Span:
    return Span(value, value, (value, value), None)


def spanned(low: Array, high: Array, at: Interval, slope: Interval | None) -> Span:
    """A span whose range is met with that of the mean value theorem."""
    if slope is None:
        return Span(low, high, at, None)
    axes = (..., *(None,) * (np.ndim(slope[0]) - 1)) if np.ndim(slope[0]) > 1 else ...
    before, behind = _now.before[axes], _now.behind[axes]
    falls = np.maximum(np.maximum(_over(slope[1], before), _over(-slope[0], behind)), 0.0)
    rises = np.maximum(np.maximum(_over(-slope[0], before), _over(slope[1], behind)), 0.0)
    return Span(np.fmax(low, r.down(at[0] - r.up(falls))), np.fmin(high, r.up(at[1] + r.up(rises))), at, slope)


def _over(slope: Array, length: Array) -> Array:
    """The change over a length. A slope may be infinite or NaN, which is unknown."""
    return np.where(length == 0.0, 0.0, slope * length)


def lifted(value: Span, own: Type, wanted: Type) -> Span:
    """A scalar over the components of a vector or matrix."""
    if own.shape or not wanted.shape:
        return value
    ends = [lift(end, own, wanted) for end in (value.low, value.high, *value.at)]
    slope = None if value.slope is None else (lift(value.slope[0], own, wanted), lift(value.slope[1], own, wanted))
    return Span(ends[0], ends[1], (ends[2], ends[3]), slope)


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
        return spanned(low, high, at, slope_of(*values, (low, high)))

    return rule


def _plus(a: Interval | None, b: Interval | None) -> Interval:
    """The sum of two slopes, of which one may be None."""
    if a is None or b is None:
        found = b if a is None else a
        assert found is not None
        return found
    return r.add(a, b)


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


def _jumping(low: Array, high: Array) -> Interval:
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
        at, sides = range_of(a.at), _sides_of(high - low == 1.0)
        if sides is not None:
            value = np.where(sides == 1, high, low)
            low, high = (np.where(sides >= 0, value, end) for end in (low, high))
            at = np.where(sides >= 0, value, at[0]), np.where(sides >= 0, value, at[1])
        return Span(low, high, (at[0], at[1]), _jumping(low, high))

    return rule


MIN, MAX = (
    _each(lambda a, b: (np.minimum(a[0], b[0]), np.minimum(a[1], b[1])), _least_slope),
    _each(lambda a, b: (np.maximum(a[0], b[0]), np.maximum(a[1], b[1])), _greatest_slope),
)
ADD = _each(r.add, lambda a, b, _result: _plus(a.slope, b.slope))
SUB, MUL, DIV = _each(r.sub, _minus), _each(r.mul, _product_slope), _each(r.div, _quotient_slope)
SQUARE = _each(r.square, _of_one(lambda a, _result: (2.0 * a[0], 2.0 * a[1])))


def _root_derivative(a: Interval, result: Interval) -> Interval:
    low, high = r.reciprocal((2.0 * result[0], 2.0 * result[1]))
    return np.where(a[0] > 0.0, low, 0.0), np.where(a[0] > 0.0, high, np.inf)


ROOT = _each(r.root, _of_one(_root_derivative))


def _clamp(node: Expr, x: Span, low: Span, high: Span) -> Span:
    least, most = (lifted(end, a.type, node.type) for end, a in zip((low, high), node.args[1:], strict=True))
    return _typed(MIN, node, _typed(MAX, node, lifted(x, node.args[0].type, node.type), least), most)


class _Typed(NamedTuple):
    """What a rule reads of a node, for arguments that have the type of the result."""

    type: Type
    args: tuple[_Typed, ...] = ()


def _typed(rule: Rule, node: Any, *values: Span) -> Span:
    """An operation on components of values that all have the type of the node."""
    return rule(_Typed(node.type, (_Typed(node.type),) * len(values)), *values)


def _mix(node: Expr, a: Span, b: Span, t: Span) -> Span:
    a, b, t = (lifted(v, arg.type, node.type) for v, arg in zip((a, b, t), node.args, strict=True))
    one = constant(np.asarray(1.0))
    by_weights = _typed(ADD, node, _typed(MUL, node, a, _typed(SUB, node, one, t)), _typed(MUL, node, b, t))
    by_difference = _typed(ADD, node, a, _typed(MUL, node, _typed(SUB, node, b, a), t))
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
    t = _typed(DIV, node, _typed(SUB, node, x, low), _typed(SUB, node, high, low))
    bounded = _typed(MIN, node, _typed(MAX, node, t, constant(np.asarray(0.0))), constant(np.asarray(1.0)))
    return _typed(SMOOTH, node, bounded)


FLOOR = _steps(np.floor)


def _split(first: Array, last: Array) -> tuple[Array, Array]:
    """The one cell of each stretch, and whether it is one: the only one, or the one of the side that is given."""
    known = (first == last) & np.isfinite(first)
    sides = _sides_of(last - first == 1.0)
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
    quotient = r.div(x.range, y.range)
    first, last = np.floor(quotient[0]), np.floor(quotient[1])
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
    sides = _sides_of(~free & (x.high < 0.0))
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


# Vectors


def _part(v: Span, i: int) -> Span:
    slope = None if v.slope is None else (v.slope[0][..., i], v.slope[1][..., i])
    return Span(v.low[..., i], v.high[..., i], (v.at[0][..., i], v.at[1][..., i]), slope)


def _stacked(parts: Sequence[Span], axis: int = -1) -> Span:
    """Components as a vector, or columns as a matrix."""

    def stack(arrays: Sequence[Array]) -> Array:
        return np.stack(np.broadcast_arrays(*arrays), axis=axis)

    low, high = stack([p.low for p in parts]), stack([p.high for p in parts])
    at = stack([p.at[0] for p in parts]), stack([p.at[1] for p in parts])
    if all(p.slope is None for p in parts):
        return Span(low, high, at, None)
    slopes = [p.slope or ZERO for p in parts]
    slope = tuple(np.broadcast_to(stack([s[i] for s in slopes]), np.shape(low)) for i in (0, 1))
    return Span(low, high, at, (slope[0], slope[1]))


_SCALAR = _Typed(FLOAT)


def _sum(parts: Sequence[Span]) -> Span:
    result = parts[0]
    for part in parts[1:]:
        result = _typed(ADD, _SCALAR, result, part)
    return result


def _size(node: Expr) -> int:
    return node.args[0].type.size


def _dot(node: Expr, a: Span, b: Span) -> Span:
    n = _size(node)
    if node.args[0] is node.args[1]:
        return _sum([_typed(SQUARE, _SCALAR, _part(a, i)) for i in range(n)])
    return _sum([_typed(MUL, _SCALAR, _part(a, i), _part(b, i)) for i in range(n)])


def _length(node: Expr, v: Span) -> Span:
    """The slope of a length is at most that of the vector."""
    found = _typed(ROOT, _SCALAR, _sum([_typed(SQUARE, _SCALAR, _part(v, i)) for i in range(_size(node))]))
    if v.slope is None or found.slope is None:
        return found
    parts = [r.square((v.slope[0][..., i], v.slope[1][..., i])) for i in range(_size(node))]
    most = parts[0]
    for part in parts[1:]:
        most = r.add(most, part)
    speed = r.root(most)[1]
    return spanned(found.low, found.high, found.at, r.meet(found.slope, (-speed, speed)))


def _normalize(node: Expr, v: Span) -> Span:
    length = _length(node, v)
    shortest = constant(np.asarray(SHORTEST))
    divisor = _typed(MAX, _SCALAR, length, shortest)
    parts = [_typed(DIV, _SCALAR, _part(v, i), divisor) for i in range(_size(node))]
    return _stacked([p._replace(low=np.fmax(p.low, -1.0), high=np.fmin(p.high, 1.0)) for p in parts])


def _cross(_node: Expr, a: Span, b: Span) -> Span:
    def minor(i: int, j: int) -> Span:
        one = _typed(MUL, _SCALAR, _part(a, i), _part(b, j))
        return _typed(SUB, _SCALAR, one, _typed(MUL, _SCALAR, _part(a, j), _part(b, i)))

    return _stacked([minor(1, 2), minor(2, 0), minor(0, 1)])


def _matmul(node: Expr, a: Span, b: Span) -> Span:
    n = _size(node)
    columns = [_part(a, j) for j in range(n)]  # the columns are the last axis

    def times(vector: Span) -> Span:
        entries = [[_part(column, i) for column in columns] for i in range(n)]
        parts = [_part(vector, j) for j in range(n)]
        return _stacked(
            [_sum([_typed(MUL, _SCALAR, e, p) for e, p in zip(row, parts, strict=True)]) for row in entries]
        )

    if node.type.is_vector:
        return times(b)
    return _stacked([times(_part(b, k)) for k in range(n)])


def _moved(compute: Callable[[Array], Array]) -> Rule:
    """A rule that only rearranges components."""

    def rule(_node: Expr, v: Span) -> Span:
        slope = None if v.slope is None else (compute(v.slope[0]), compute(v.slope[1]))
        return Span(compute(v.low), compute(v.high), (compute(v.at[0]), compute(v.at[1])), slope)

    return rule


def _swizzle(node: Expr, v: Span) -> Span:
    picks = ["xyzw".index(c) for c in node.data]
    pick = picks[0] if len(picks) == 1 else picks
    return _moved(lambda x: x[..., pick])(node, v)


def _construct(node: Expr, *parts: Span) -> Span:
    numbers: list[Span] = []
    for arg, part in zip(node.args, parts, strict=True):
        numbers += [part] if arg.type is FLOAT else [_part(part, i) for i in range(arg.type.size)]
    return _stacked(numbers)


# Conditions and choices


def condition(always: Array, sometimes: Array) -> Span:
    return Span(always, sometimes, (always, sometimes), None)


def _less(strict: bool) -> Rule:
    def rule(_node: Expr, a: Span, b: Span) -> Span:
        always, never = (a.high < b.low, a.low >= b.high) if strict else (a.high <= b.low, a.low > b.high)
        if a.slope is None and b.slope is None:
            return condition(always, ~never)
        sides = _sides_of(~always & ~never)
        if sides is None:
            return condition(always, ~never)
        return condition(np.where(sides >= 0, sides == 1, always), np.where(sides >= 0, sides == 1, ~never))

    return rule


def _where(node: Expr, choice: Span, a: Any, b: Any) -> Any:
    if node.type.fields:
        types = [type for _, type in node.type.fields]
        return tuple(_selected(t, choice, one, other) for t, one, other in zip(types, a, b, strict=True))
    return _selected(node.type, choice, a, b)


def _selected(type: Type, choice: Span, a: Span, b: Span) -> Span:
    """One of two values. Where either may be chosen, the value may jump."""
    always, sometimes = (lift(end, BOOL, type) for end in (choice.low, choice.high))
    if np.all(always):
        return a
    if not np.any(sometimes):
        return b

    def pick(one: Array, other: Array, both: Callable[[Array, Array], Array]) -> Array:
        return np.where(always, one, np.where(sometimes, both(one, other), other))

    if type is BOOL:
        return condition(pick(a.low, b.low, np.logical_and), pick(a.high, b.high, np.logical_or))
    low, high = pick(a.low, b.low, np.minimum), pick(a.high, b.high, np.maximum)
    at = pick(a.at[0], b.at[0], np.minimum), pick(a.at[1], b.at[1], np.maximum)
    known = always | ~sometimes
    if np.all(known) and a.slope is None and b.slope is None:
        return Span(low, high, at, None)
    one, other = a.slope or ZERO, b.slope or ZERO
    slope = tuple(
        np.broadcast_to(np.where(known, np.where(always, one[i], other[i]), unknown), np.shape(low))
        for i, unknown in ((0, -np.inf), (1, np.inf))
    )
    return Span(low, high, at, (slope[0], slope[1]))


# Data


def _unknown(node: Expr, *_values: Any) -> Any:
    if node.type.fields:
        return tuple(_unknown_of(type) for _, type in node.type.fields)
    return _unknown_of(node.type)


def _unknown_of(type: Type) -> Span:
    if type is BOOL:
        return condition(np.asarray(False), np.asarray(True))
    wide = _without_bounds(type.shape)
    return Span(*wide, wide, wide)


def _without_bounds(shape: tuple[int, ...]) -> Interval:
    """Anything, for each stretch."""
    rows = (len(_now.before), *shape)
    return np.full(rows, -np.inf), np.full(rows, np.inf)


def _jump_free(given: Span, exact: Array, value: Array, otherwise: Interval) -> Span:
    """A value that is known where `exact` holds, else within an interval, with jumps. given : what it depends on."""
    known = np.asarray(exact)[(..., *(None,) * (np.ndim(value) - np.ndim(exact)))]
    low, high = np.where(known, value, otherwise[0]), np.where(known, value, otherwise[1])
    return Span(low, high, (low, high), None if given.slope is None else _jumping(low, high))


def _hash(node: Expr, cell: Span) -> Span:
    low, high = np.floor(r.down(cell.low + 0.5)), np.floor(r.up(cell.high + 0.5))
    same = np.all(low == high, axis=-1)
    return _jump_free(cell, same, hashing.evaluate(node, low), (np.asarray(0.0), np.asarray(1.0)))


def _fetch(node: Expr, index: Span) -> Span:
    values = np.asarray(node.data.values, np.float64)
    ends = values.min(axis=0), values.max(axis=0)
    if node.type is FLOAT:
        ends = ends[0][0], ends[1][0]
    same = np.floor(index.low) == np.floor(index.high)
    return _jump_free(index, same, tables.evaluate(node, np.floor(index.low)), ends)


def _sample(node: Expr, at: Span) -> Span:
    """Linear interpolation: between the least and the greatest texel of the cells that are met, and as steep as the
    differences of the data allow."""
    data: samples.Samples = node.data
    middle = np.clip(0.5 * (at.at[0] + at.at[1]), 0.0, np.array(data.size) - 1.0)
    value = samples.evaluate(node, middle)
    slopes = _texel_slopes(data)
    axes = range(data.dimension)
    off = r.up(0.5 * (at.at[1] - at.at[0])) + 1e-15 * r.magnitude(at.at)
    error = np.sum([off[..., k] * max(-slopes[k][0], slopes[k][1]) for k in axes], axis=0)
    error = r.up(error) + 1e-14 * float(np.abs(data.values).max())
    least, most = _texels(data).between(at.low, at.high)
    centre = np.fmax(value - error, float(data.values.min())), np.fmin(value + error, float(data.values.max()))
    if at.slope is None:
        return still(r.meet((least, most), centre))
    own = at.slope
    parts = [
        r.mul((own[0][..., k], own[1][..., k]), (np.asarray(slopes[k][0]), np.asarray(slopes[k][1]))) for k in axes
    ]
    slope = parts[0]
    for part in parts[1:]:
        slope = r.add(slope, part)
    return spanned(least, most, centre, slope)


class _Texels:
    """The least and the greatest texel of boxes of cells, from a pyramid in which level k joins 2^k texels an axis."""

    def __init__(self, values: Array) -> None:
        self.shape = np.array(values.shape)
        self.low, self.high = [values.astype(np.float64)], [values.astype(np.float64)]
        while max(self.low[-1].shape) > 1:
            self.low.append(self._joined(self.low[-1], np.minimum))
            self.high.append(self._joined(self.high[-1], np.maximum))

    @staticmethod
    def _joined(level: Array, join: Callable[[Array, Array], Array]) -> Array:
        for axis in range(level.ndim):
            even = np.take(level, np.arange(0, level.shape[axis], 2), axis)
            odd = np.take(level, np.minimum(np.arange(1, level.shape[axis] + 1, 2), level.shape[axis] - 1), axis)
            level = join(even, odd)
        return level

    def between(self, low: Array, high: Array) -> Interval:
        """Over boxes of positions in texels, (N, dimension), x first."""
        last = (self.shape - 1)[::-1]
        first = np.clip(np.nan_to_num(np.floor(low)), 0, last).astype(np.int64)
        end = np.clip(np.nan_to_num(np.ceil(high), nan=0.0, posinf=1e9, neginf=-1e9), first, last).astype(np.int64)
        width = (end - first).max(axis=-1)
        levels = np.ceil(np.log2(np.maximum(width, 1))).astype(np.int64)
        least, most = np.full(levels.shape, np.inf), np.full(levels.shape, -np.inf)
        for k in np.unique(levels):
            rows = levels == k
            start, stop = first[rows] >> k, end[rows] >> k
            for corner in np.ndindex(*(2,) * first.shape[-1]):
                index = np.minimum(start + np.array(corner), stop)
                texel = tuple(index[..., axis] for axis in reversed(range(first.shape[-1])))
                least[rows] = np.minimum(least[rows], self.low[k][texel])
                most[rows] = np.maximum(most[rows], self.high[k][texel])
        return least, most


_PYRAMIDS: dict[str, tuple[_Texels, list[tuple[float, float]]]] = {}


def _pyramid(data: samples.Samples) -> tuple[_Texels, list[tuple[float, float]]]:
    if data.key not in _PYRAMIDS:
        wide = data.values.astype(np.float64)
        steps = [np.diff(wide, axis=axis) for axis in reversed(range(wide.ndim))]
        _PYRAMIDS.clear()
        _PYRAMIDS[data.key] = _Texels(data.values), [(float(s.min()), float(s.max())) for s in steps]
    return _PYRAMIDS[data.key]


def _texels(data: samples.Samples) -> _Texels:
    return _pyramid(data)[0]


def _texel_slopes(data: samples.Samples) -> list[tuple[float, float]]:
    """The least and the greatest difference of neighbours along each axis, and 0, where positions are clamped."""
    return [(min(low, 0.0), max(high, 0.0)) for low, high in _pyramid(data)[1]]


def _texture(node: Expr, *_values: Span) -> Span:
    low, high = textures.interval(node, *[None] * len(node.args))
    return Span(low, high, (low, high), _without_bounds(node.type.shape))


UNREADABLE = "raw raw_slope sample_slope finite cell"

RULES: Mapping[str, Rule] = {
    **dict.fromkeys(UNREADABLE.split(), _unknown),
    "add": ADD,
    "sub": SUB,
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
    "atan2": _atan2,
    "sinh": _each(r.sinh, _of_one(lambda a, _result: r.cosh(a))),
    "cosh": _each(r.cosh, _of_one(lambda a, _result: r.sinh(a))),
    "tanh": _each(r.tanh, _of_one(lambda _a, result: r.sub((np.asarray(1.0),) * 2, r.square(result)))),
    "pow": _each(r.power, _pow_slope),
    "floor": FLOOR,
    "ceil": _steps(np.ceil),
    "sign": _steps(np.sign),
    "round": _steps(np.floor, lambda a: r.add(a, (np.asarray(0.5),) * 2)),
    "fract": _fract,
    "mod": _mod,
    "step": _each(
        lambda edge, x: (np.where(x[0] >= edge[1], 1.0, 0.0), np.where(x[1] < edge[0], 0.0, 1.0)),
        lambda _edge, _x, result: _jumping(*result),
    ),
    "smoothstep": _smoothstep,
    "lt": _less(strict=True),
    "le": _less(strict=False),
    "and": lambda _node, a, b: condition(a.low & b.low, a.high & b.high),
    "or": lambda _node, a, b: condition(a.low | b.low, a.high | b.high),
    "not": lambda _node, a: condition(~a.high, ~a.low),
    "where": _where,
    "dot": _dot,
    "length": _length,
    "normalize": _normalize,
    "cross": _cross,
    "columns": lambda _node, *columns: _stacked(columns),
    "matmul": _matmul,
    "transpose": _moved(lambda m: np.swapaxes(m, -1, -2)),
    "swizzle": _swizzle,
    "construct": _construct,
    "record": lambda _node, *values: values,
    "field": lambda node, value: value[[name for name, _ in node.args[0].type.fields].index(node.data)],
    "hash": _hash,
    "fetch": _fetch,
    "sample": _sample,
    "texture": _texture,
    "texture_in_atlas": _texture,
    "probe": lambda _node, value, *_: value,
    "within": lambda _node, value: value,
    "stop_gradient": lambda _node, value: value,
}


SOLVED: WeakKeyDictionary[Function, float] = WeakKeyDictionary()
"""Functions of a point that solve an equation in a loop, with their Lipschitz constants, which are assumed."""


def _solved(program: Callable[..., Any], steepest: float, point: Span, *params: Span) -> Span | None:
    """The value at the centre, and a slope of at most the constant times the speed; None for parameters that vary.

    Newton's method on intervals diverges, although the root hardly moves.
    """
    if point.slope is None or any(v.slope is not None for v in params):
        return None
    at = program(still(point.at), *[still(v.at) for v in params])[0].range
    square: Interval = r.total(r.square(point.slope))
    rise = r.up(steepest * r.root(square)[1])
    wide = _without_bounds(())
    return spanned(*wide, at, (-rise, rise))


def _call(node: Expr) -> Rule:
    """The step of a call."""
    definition: Function = node.data
    program = program_of(definition, ENCLOSURES)

    def step(*values: Any) -> Any:
        steepest = SOLVED.get(definition)
        found = None if steepest is None else _solved(program, steepest, *values)
        return program(*values)[0] if found is None else found

    return step


class Enclosures:
    """The reading; its state is that of `stretches`. Parameters and time have the values that `bound` set."""

    makers: Mapping[str, Callable[[Expr], Rule]] = {"call": _call}

    @property
    def rules(self) -> Mapping[str, Rule]:
        return {
            **RULES,
            "param": lambda node: constant(FLOAT64._param(node)),
            "time": lambda node: constant(FLOAT64._time(node)),
        }

    def leaf(self, node: Expr) -> Span:
        if node.type is BOOL:
            return condition(np.asarray(node.data), np.asarray(node.data))
        return constant(np.asarray(node.data, np.float64))

    def repeat(self, body: Loop, program: Program, first: list[Any], captured: list[Any]) -> tuple[Any, ...]:
        """As many turns as some stretch may take. A stretch that may have ended keeps both states."""
        state, alive = first, condition(np.asarray(True), np.asarray(True))
        n, jumps = len(first), _now.jumps
        _now.jumps = None  # the number of turns depends on the stretches, and with it that of operations
        for turn in range(body.count):
            after = program(constant(np.asarray(float(turn))), *state, *captured)
            if body.until is not None:
                done = after[n]
                alive = condition(alive.low & ~done.high, alive.high & ~done.low)
                if not np.any(alive.high):
                    break
            state = [
                _selected(v.type, alive, new, old) for v, new, old in zip(body.state, after[:n], state, strict=True)
            ]
        _now.jumps = jumps
        return tuple(state)


ENCLOSURES = Enclosures()
