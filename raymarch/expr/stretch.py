"""Expressions along a stretch of a ray: operations on `raymarch.expr.series`; how far a function keeps its sign."""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from raymarch.expr import vocabulary as v
from raymarch.expr.arrays import SMALLEST
from raymarch.expr.derivative import companion
from raymarch.expr.function import Function, Loop, function
from raymarch.expr.node import Expr, const, construct, expr
from raymarch.expr.series import Reading, Series, at, trimmed
from raymarch.expr.smooth import LEAST, NOTHING, ONE, SMOOTH, ZERO, Range, largest
from raymarch.expr.types import BOOL, FLOAT
from raymarch.expr.walk import rebuild, topological

TURNS = 16
"""Largest number of turns of a loop that is written out."""

BIG = 1e12
"""In place of an infinite change, such as that of 1/x where x changes its sign."""


class Unbounded(Exception):
    """Nothing is known of an operation along a stretch."""


Condition: TypeAlias = tuple[Expr, Expr, Expr]
"""Whether it holds at the start, all along, and anywhere."""

Value: TypeAlias = "Series | list[Any] | Condition"
"""Of a scalar; of a vector, its components; of a matrix, its columns; of a condition."""


class Along:
    """Evaluates expressions along a stretch."""

    def __init__(self, reading: Reading) -> None:
        self.r = reading

    def of(self, root: Expr, known: Mapping[Expr, Value]) -> Value:
        """The value of an expression whose variables are known."""
        values: dict[Expr, Value] = dict(known)
        for node in topological([root]):
            if node not in values:
                values[node] = self._value(node, values)
        return values[root]

    def _value(self, node: Expr, values: Mapping[Expr, Value]) -> Value:
        args: list[Any] = [values[arg] for arg in node.args]
        if node.op in ("const", "param", "time", "var", "cell") or (all(map(_is_still, args)) and _plain(node)):
            return _still(node if not args else node_at_start(node, args))
        if node.op == "call":
            if node.data.stated.limits is not None:
                return _limited(self.r, node.data, *args)
            return self.of(node.data.body, dict(zip(node.data.params, args, strict=True)))
        if node.op == "loop":
            return self._loop(node.data, args)
        if node.op == "item":
            return args[0][node.data]
        if node.op in VECTORS:
            return VECTORS[node.op](self.r, node, *args)
        if node.op not in SCALARS:
            raise Unbounded(node.op)
        rule = SCALARS[node.op]
        if not node.type.is_vector:
            return rule(self.r, *args)
        spread = [arg if isinstance(arg, list) else [arg] * node.type.size for arg in args]
        return [rule(self.r, *each) for each in zip(*spread, strict=True)]

    def _loop(self, loop: Loop, args: Sequence[Value]) -> list[Value]:
        n = len(loop.state)
        if loop.count > TURNS:
            raise Unbounded(f"loop of {loop.count} turns")
        state, outer = list(args[:n]), dict(zip(loop.captured, args[n:], strict=True))
        done: Any = None
        for turn in range(loop.count):
            known = {loop.index: Series((const(float(turn)),)), **dict(zip(loop.state, state, strict=True)), **outer}
            after = [self.of(each, known) for each in loop.step]
            if loop.until is not None:
                leave: Any = self.of(loop.until, known)
                done = leave if done is None else tuple([x | y for x, y in zip(done, leave, strict=True)])
                after = [self._where(done, old, new) for old, new in zip(state, after, strict=True)]
            state = after
        return state

    def _where(self, condition: Any, a: Any, b: Any) -> Value:
        if isinstance(a, list):
            return [self._where(condition, x, y) for x, y in zip(a, b, strict=True)]
        return self.r.either(condition, a, b)


def _plain(node: Expr) -> bool:
    return bool(node.args) and node.op not in ("call", "loop", "item") and not node.type.is_matrix


def _is_still(value: Any) -> bool:
    if isinstance(value, list):
        return all(map(_is_still, value))
    return value.still if isinstance(value, Series) else value[0] is value[1]


def _still(node: Expr) -> Value:
    if node.type is BOOL:
        return node, node, node
    if node.type.is_vector:
        return [Series((part,)) for part in node]
    if node.type.is_matrix:
        axes = [const(row) for row in np.eye(node.type.size)]
        return [[Series((part,)) for part in node @ axis] for axis in axes]
    return Series((node,))


def node_at_start(node: Expr, args: Sequence[Value]) -> Expr:
    """An operation on values that are the same all along, as an expression."""
    return rebuild(node, tuple(map(_at_start, args)))


def _at_start(value: Any) -> Expr:
    if isinstance(value, Series):
        return value.c[0]
    if isinstance(value, tuple):
        return expr(value[0])
    parts = [_at_start(part) for part in value]
    return v.columns(*parts) if parts[0].type.is_vector else construct(*parts)


def _less(r: Reading, a: Series, b: Series, strict: bool) -> Condition:
    (low, high), (least, most) = r.range(a), r.range(b)
    if strict:
        return a.c[0] < b.c[0], high < least, low < most
    return a.c[0] <= b.c[0], high <= least, low <= most


def _length(r: Reading, parts: Sequence[Series]) -> Series:
    """A norm; of an affine function it is convex."""
    squares = _total(r, [r.mul(part, part) for part in parts])
    root = r.apply(squares, "sqrt")
    if r.smooth and all(part.exact and len(part.c) <= 2 for part in parts):
        return Series(root.c, root.jump, root.slope, (v.max(root.curve[0], 0.0), v.max(root.curve[1], 0.0)))
    return root


def _total(r: Reading, parts: Sequence[Series]) -> Series:
    total = parts[0]
    for part in parts[1:]:
        total = r.add(total, part)
    return total


def _dot(r: Reading, a: Sequence[Series], b: Sequence[Series]) -> Series:
    return _total(r, [r.mul(x, y) for x, y in zip(a, b, strict=True)])


def _divided(r: Reading, a: Series, b: Series) -> Series:
    if b.still:
        return r.scale(a, 1.0 / b.c[0])
    low, high = r.range(b)
    apart = (low > 0.0) | (high < 0.0)
    unknown = Series((1.0 / b.c[0],), (const(-BIG), const(BIG)))
    return r.mul(a, r.chosen(apart, r.apply(b, "reciprocal"), unknown))


def _sub(r: Reading, a: Series, b: Series) -> Series:
    return r.add(a, r.neg(b))


def _greatest(r: Reading, a: Series, b: Series) -> Series:
    return r.neg(r.least(r.neg(a), r.neg(b)))


def _clamped(r: Reading, x: Series, low: Series, high: Series) -> Series:
    return r.least(_greatest(r, x, low), high)


def _mixed(r: Reading, a: Series, b: Series, t: Series) -> Series:
    return r.add(a, r.mul(_sub(r, b, a), t))


def _smoothstep(r: Reading, low: Series, high: Series, x: Series) -> Series:
    t = _clamped(r, _divided(r, _sub(r, x, low), _sub(r, high, low)), Series((ZERO,)), Series((ONE,)))
    return r.mul(r.mul(t, t), _sub(r, Series((const(3.0),)), r.scale(t, const(2.0))))


def _mod(r: Reading, x: Series, y: Series) -> Series:
    return _sub(r, x, r.mul(y, r.stepped(_divided(r, x, y), v.floor)))


def _power(r: Reading, x: Series, y: Series) -> Series:
    return r.apply(r.mul(y, r.apply(_greatest(r, x, Series((const(SMALLEST),))), "log")), "exp")


def _cross(r: Reading, node: Expr, a: Sequence[Series], b: Sequence[Series]) -> list[Series]:
    return [_sub(r, r.mul(a[i], b[j]), r.mul(a[j], b[i])) for i, j in ((1, 2), (2, 0), (0, 1))]


def _matmul(r: Reading, node: Expr, a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    if isinstance(b[0], list):
        return [_matmul(r, node, a, column) for column in b]
    return [_dot(r, [column[i] for column in a], b) for i in range(len(b))]


def _constructed(r: Reading, node: Expr, *args: Any) -> list[Series]:
    return [part for arg in args for part in (arg if isinstance(arg, list) else [arg])]


def _swizzled(r: Reading, node: Expr, value: Sequence[Series]) -> Value:
    parts = [value["xyzw".index(c)] for c in node.data]
    return parts if len(parts) > 1 else parts[0]


def _chosen(r: Reading, node: Expr, condition: Condition, a: Any, b: Any) -> Value:
    return Along(r)._where(condition, a, b)


def _unit(r: Reading, node: Expr, value: Sequence[Series]) -> list[Series]:
    norm = _length(r, value)
    return [_divided(r, part, norm) for part in value]


SCALARS: Mapping[str, Callable[..., Series]] = {
    "add": Reading.add,
    "sub": _sub,
    "mul": Reading.mul,
    "div": _divided,
    "neg": Reading.neg,
    "abs": Reading.absolute,
    "min": Reading.least,
    "max": _greatest,
    "clamp": _clamped,
    "mix": _mixed,
    "smoothstep": _smoothstep,
    "step": lambda r, edge, x: r.either(_less(r, x, edge, True), Series((ZERO,)), Series((ONE,))),
    "sign": lambda r, x: r.stepped(x, v.sign),
    "floor": lambda r, x: r.stepped(x, v.floor),
    "ceil": lambda r, x: r.stepped(x, v.ceil),
    "round": lambda r, x: r.stepped(x, v.round),
    "fract": lambda r, x: _sub(r, x, r.stepped(x, v.floor)),
    "mod": _mod,
    "pow": _power,
    "tan": lambda r, x: _divided(r, r.apply(x, "sin"), r.apply(x, "cos")),
    "within": lambda r, x: x,
    "stop_gradient": lambda r, x: x,
    **{name: lambda r, x, name=name: r.apply(x, name) for name in SMOOTH if name != "reciprocal"},
}

VECTORS: Mapping[str, Callable[..., Any]] = {
    "lt": lambda r, node, a, b: _less(r, a, b, True),
    "le": lambda r, node, a, b: _less(r, a, b, False),
    "and": lambda r, node, a, b: tuple([x & y for x, y in zip(a, b, strict=True)]),
    "or": lambda r, node, a, b: tuple([x | y for x, y in zip(a, b, strict=True)]),
    "not": lambda r, node, a: (~a[0], ~a[2], ~a[1]),
    "where": _chosen,
    "dot": lambda r, node, a, b: _dot(r, a, b),
    "length": lambda r, node, a: _length(r, a),
    "normalize": _unit,
    "cross": _cross,
    "swizzle": _swizzled,
    "construct": _constructed,
    "matmul": _matmul,
    "columns": lambda r, node, *columns: list(columns),
    "transpose": lambda r, node, m: [[column[i] for column in m] for i in range(len(m))],
}


def _limited(r: Reading, definition: Function, q: Sequence[Series], *more: Series) -> Series:
    """A function with `raymarch.expr.lattice.Limits`.

    Along a straight line, the parabola of its slope at the start and its bend; else its steepest slope. Where these
    leave its range within the stretch, the range.
    """
    r.limited, limits = True, definition.stated.limits
    here = construct(*[part.c[0] for part in q])
    rest = [part.c[0] for part in more]
    straight = r.smooth and all(part.exact and len(part.c) <= 2 for part in q) and all(part.still for part in more)
    if straight and limits.bend < math.inf:
        direction = construct(*[part.rate for part in q])
        both = companion(definition)(here, *rest)
        value, rate = both.w, v.dot(both.xyz, direction)
        bend = (0.5 * limits.bend) * v.dot(direction, direction)
        found = Series((value, rate), NOTHING, NOTHING, (-bend, bend))
    else:
        if not all(part.still for part in more):
            raise Unbounded(definition.name)
        value = definition(here, *rest)
        speed = v.length(construct(*[largest(r.change(part)) for part in q]))
        steep = limits.steepest * speed
        found = Series((value,), NOTHING, (-steep, steep))
    change = r.over(r.change(found))
    least, most = limits.low - value, limits.high - value
    below, above = change[0] < least, change[1] > most

    return Series(
        found.c,
        (v.where(below, least, 0.0), v.where(above, most, 0.0)),
        (v.where(below, -found.rate, found.slope[0]), v.where(above, -found.rate, found.slope[1])),
        (v.where(below, 0.0, found.curve[0]), v.where(above, 0.0, found.curve[1])),
        (const(limits.low), const(limits.high)),
    )


def series_of(definition: Function, point: Expr, direction: Expr, w: Expr, **form: bool) -> tuple[Reading, Series]:
    """The value of a function of a point along a ray. Unbounded if nothing is known of an operation."""
    reading = Reading(w, **form)
    line = [Series(trimmed((point[i], direction[i]))) for i in range(len(point))]
    value = Along(reading).of(definition.body, {definition.params[0]: line})
    assert isinstance(value, Series)
    return reading, value


@function(f=FLOAT, g=FLOAT, h=FLOAT, w=FLOAT)
def first_root(f: Expr, g: Expr, h: Expr, w: Expr) -> Expr:
    """The first root of f + g s + h s^2, at most w; 0 if f is not above 0."""
    inside = g * g - 4.0 * h * f
    root = v.sqrt(v.max(inside, 0.0))
    falling = v.where(inside < 0.0, w, 2.0 * f / v.max(root - g, LEAST))
    rising = v.where(h < 0.0, (root + g) / v.max(-2.0 * h, LEAST), w)
    return v.where(f > 0.0, v.min(v.where(g < 0.0, falling, rising), w), 0.0)


STEPS = 2
"""Steps along a polynomial each time that its coefficients are found. Two take two thirds of the evaluations of one."""


def first_root_of(c: Sequence[Expr], w: Expr, end: Expr) -> Expr:
    """How far the polynomial c[0] + c[1] s + ... stays above 0: at most `end`, and less if that is not known; 0 if
    c[0] is not above 0.

    A step goes to the first root of a parabola below the polynomial, on a stretch that is w at first. The polynomial is
    then taken about that place, by Horner's scheme. Of a parabola the root is that of the polynomial itself.
    """
    c = [*c, ZERO, ZERO][: builtins.max(len(c), 3)]
    steps = STEPS if len(c) > 3 else 1
    w = v.min(w, end) if steps > 1 else end
    total = ZERO
    for step in range(steps):
        curve = c[-1]
        for coefficient in c[-2:1:-1]:
            curve = coefficient + w * v.min(curve, 0.0)
        root = first_root(c[0], c[1], curve, w)
        total = total + root
        if step + 1 < steps:
            w = v.min(v.where(root < w, 1.5 * root, 2.0 * w), end - total)
            for low in range(len(c) - 1):
                for k in range(len(c) - 2, low - 1, -1):
                    c[k] = c[k] + root * c[k + 1]
    return v.min(total, end)


def free_of(reading: Reading, found: Series, below: Expr, unit: Expr, line: tuple[Expr, Expr], end: Expr) -> Expr:
    """How far the value of a series divided by a unit, or its negative, stays above line[0] + line[1] s. The way is not
    longer than the stretch of the reading; along a polynomial, than `end`.

    below : whether it is the negative.
    """
    if found.exact:
        side = v.where(below, -1.0, 1.0) / unit
        return first_root_of([side * at(found.c, k) - at(line, k) for k in range(len(found.c))], reading.w, end)

    def least(ends: Range) -> Expr:
        return v.where(below, -ends[1], ends[0]) / unit

    f, g = (least((c + ends[0], c + ends[1])) for c, ends in ((found.c[0], found.jump), (found.rate, found.slope)))
    return first_root(f - line[0], g - line[1], least(reading.tail(found, 2)), reading.w)


def free_along(
    definition: Function, point: Expr, direction: Expr, level: Expr, w: Expr, end: Expr | None = None, **form: bool
) -> Expr:
    """(value - level, the length of a stretch on which it keeps its sign), a vec2.

    Up to the first root of the parabola below the function; above it, if it is negative. After Aydinlilar and Zanni
    2023, who bound value and slope over the next stretch. The stretch is at most w; along a polynomial, at most `end`.
    Unbounded if nothing is known of an operation.
    """
    reading, found = series_of(definition, point, direction, w, **form)
    value = found.c[0] - level
    found = replace(found, c=(value, *found.c[1:]))
    return construct(value, free_of(reading, found, value < 0.0, ONE, (ZERO, ZERO), w if end is None else end))
