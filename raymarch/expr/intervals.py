"""The interval reading: ranges of expressions over all values of the parameters.

A value is a pair (low, high) of float64 arrays, those of one interval or, with a first axis more, of many. Operations
without a rule return (-inf, inf), which is always valid. Bounds, Lipschitz constants and parameter domains are computed
this way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.expr import samples, tables, textures
from raymarch.expr.arrays import MAKERS, SHORTEST, SMALLEST, lift
from raymarch.expr.evaluate import Program, Rule
from raymarch.expr.function import Loop
from raymarch.expr.node import Expr
from raymarch.expr.types import BOOL
from raymarch.expr.walk import topological

Interval: TypeAlias = tuple[NDArray[Any], NDArray[Any]]


def _unknown(node: Expr, *_args: Interval) -> Interval:
    if node.type is BOOL:
        return np.asarray(False), np.asarray(True)
    return np.full(node.type.shape, -np.inf), np.full(node.type.shape, np.inf)


def _shaped(values: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """One number for each component."""
    given = np.shape(values)
    return values if given == shape else np.broadcast_to(values, np.broadcast_shapes(given, shape))


def _each(compute: Callable[..., Interval]) -> Rule:
    """Rule for an operation that works on each component. An interval of one number has the same array twice."""

    def rule(node: Expr, *values: Interval) -> Interval:
        type, shape = node.type, node.type.shape
        lifted = []
        for (low, high), a in zip(values, node.args, strict=True):
            one = lift(low, a.type, type)
            lifted.append((one, one if low is high else lift(high, a.type, type)))
        low, high = compute(*lifted)
        one = _shaped(low, shape)
        return one, one if low is high else _shaped(high, shape)

    return rule


def _rising(node: Expr, *values: Interval) -> Interval:
    """The ends of an operation that falls in no argument: its float64 values at the ends of the arguments."""
    compute = MAKERS[node.op](node)
    low = _shaped(compute(*[v[0] for v in values]), node.type.shape)
    if all(v[0] is v[1] for v in values):
        return low, low
    return low, _shaped(compute(*[v[1] for v in values]), node.type.shape)


def _times(x: Any, y: Any) -> Any:
    """Product with 0 times infinity = 0: the infinite end of an interval is not attained."""
    return np.where((x == 0) | (y == 0), 0.0, x * y)


def _mul(a: Interval, b: Interval) -> Interval:
    if a[0] is a[1] and b[0] is b[1]:
        product = _times(a[0], b[0])
        return product, product
    if a[0] is a[1] or b[0] is b[1]:
        (one, _), (low, high) = (a, b) if a[0] is a[1] else (b, a)
        x, y = _times(one, low), _times(one, high)
        return np.minimum(x, y), np.maximum(x, y)
    corners = [_times(x, y) for x in a for y in b]
    return np.minimum.reduce(np.broadcast_arrays(*corners)), np.maximum.reduce(np.broadcast_arrays(*corners))


_product = _each(_mul)


def _reciprocal(b: Interval) -> Interval:
    crosses = (b[0] <= 0) & (b[1] >= 0)
    return np.where(crosses, -np.inf, 1 / b[1]), np.where(crosses, np.inf, 1 / b[0])


def _abs(a: Interval) -> Interval:
    low, high = np.abs(a[0]), np.abs(a[1])
    return np.where((a[0] <= 0) & (a[1] >= 0), 0.0, np.minimum(low, high)), np.maximum(low, high)


def _wave(peak: float) -> Callable[[Interval], Interval]:
    """sin or cos; `peak` is the position of the maximum modulo 2 pi."""

    def rule(a: Interval) -> Interval:
        def reaches(where: float) -> Any:
            return np.floor((a[1] - where) / (2 * np.pi)) >= np.ceil((a[0] - where) / (2 * np.pi))

        known = np.isfinite(a[0]) & np.isfinite(a[1])
        ends = np.cos(np.where(known, a[0], 0) - peak), np.cos(np.where(known, a[1], 0) - peak)
        low = np.where(~known | reaches(peak + np.pi), -1.0, np.minimum(*ends))
        return low, np.where(~known | reaches(peak), 1.0, np.maximum(*ends))

    return rule


cosine = _wave(0.0)
"""The range of cos over a range of angles."""


def _components(a: Interval) -> list[Interval]:
    return [(a[0][..., i], a[1][..., i]) for i in range(a[0].shape[-1])]


def _square(a: Interval) -> Interval:
    magnitude = _abs(a)
    return magnitude[0] ** 2, magnitude[1] ** 2


def _dot(node: Expr, a: Interval, b: Interval) -> Interval:
    low, high = _square(a) if node.args[0] is node.args[1] else _mul(a, b)
    return np.sum(low, axis=-1), np.sum(high, axis=-1)


def _length(_node: Expr, a: Interval) -> Interval:
    low, high = _square(a)
    return np.sqrt(np.sum(low, axis=-1)), np.sqrt(np.sum(high, axis=-1))


def _normalize(_node: Expr, a: Interval) -> Interval:
    v = a[0] / np.maximum(np.sqrt(np.sum(a[0] * a[0], axis=-1)), SHORTEST)[..., None]
    known = a[0] is a[1] or np.all(a[0] == a[1], axis=-1)[..., None]
    if np.all(known):
        return v, v
    return np.where(known, v, -1.0), np.where(known, v, 1.0)


def _cross(_node: Expr, a: Interval, b: Interval) -> Interval:
    p, q = _components(a), _components(b)
    parts = [_sub(_mul(p[i], q[j]), _mul(p[j], q[i])) for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.stack([x[0] for x in parts], axis=-1), np.stack([x[1] for x in parts], axis=-1)


def _sub(a: Interval, b: Interval) -> Interval:
    low = a[0] - b[1]
    return low, low if a[0] is a[1] and b[0] is b[1] else a[1] - b[0]


def _difference(node: Expr, a: Interval, b: Interval) -> Interval:
    """x - floor(x) and x - min(floor(x), c) are those of one x."""
    x, y = node.args
    capped = y.op == "min" and y.args[1].op == "const"
    floor = y.args[0] if capped else y
    low, high = _each(_sub)(node, a, b)
    if floor.op == "floor" and floor.args[0] is x:
        last = y.args[1].data if capped else np.inf
        low, high = np.maximum(low, np.maximum(0.0, a[0] - last)), np.minimum(high, np.maximum(1.0, a[1] - last))
    return low, high


def _mix(a: Interval, b: Interval, t: Interval) -> Interval:
    """Linear in each argument, so its ends are at ends of t."""
    ends = [_add(_mul(a, (1.0 - at, 1.0 - at)), _mul(b, (at, at))) for at in t]
    return np.minimum(ends[0][0], ends[1][0]), np.maximum(ends[0][1], ends[1][1])


def _add(a: Interval, b: Interval) -> Interval:
    low = a[0] + b[0]
    return low, low if a[0] is a[1] and b[0] is b[1] else a[1] + b[1]


def _matmul(node: Expr, a: Interval, b: Interval) -> Interval:
    if node.type.is_vector:
        return matrix_product(a, b)
    low, high = _mul((a[0][..., :, :, None], a[1][..., :, :, None]), (b[0][..., None, :, :], b[1][..., None, :, :]))
    return low.sum(axis=-2), high.sum(axis=-2)


def matrix_product(a: Interval, v: Interval) -> Interval:
    """The range of a matrix times a vector, whose components do not depend on each other."""
    low, high = _mul(a, (v[0][..., None, :], v[1][..., None, :]))
    return low.sum(axis=-1), high.sum(axis=-1)


def _less(strict: bool) -> Rule:
    def rule(_node: Expr, a: Interval, b: Interval) -> Interval:
        never, always = (a[0] >= b[1], a[1] < b[0]) if strict else (a[0] > b[1], a[1] <= b[0])
        return np.asarray(always), ~np.asarray(never)

    return rule


def _where(node: Expr, condition: Interval, a: Interval, b: Interval) -> Interval:
    if np.all(condition[0]):
        return a
    if not np.any(condition[1]):
        return b
    always, possible = (lift(end, BOOL, node.type) for end in condition)
    low = np.where(always, a[0], np.where(possible, np.minimum(a[0], b[0]), b[0]))
    high = np.where(always, a[1], np.where(possible, np.maximum(a[1], b[1]), b[1]))
    return low, high


def _param(node: Expr) -> Interval:
    shape = node.type.shape
    low, high = node.data.min, node.data.max
    return (
        np.broadcast_to(-np.inf if low is None else np.asarray(low, np.float64), shape),
        np.broadcast_to(np.inf if high is None else np.asarray(high, np.float64), shape),
    )


def _pow(a: Interval, b: Interval) -> Interval:
    base = np.maximum(a[0], SMALLEST), np.maximum(a[1], SMALLEST)
    corners = [np.power(x, y) for x in base for y in b]
    return np.fmin.reduce(np.broadcast_arrays(*corners)), np.fmax.reduce(np.broadcast_arrays(*corners))


_RISING = "add min max clamp sign floor ceil round sqrt exp exp2 log log2 asin atan sinh tanh swizzle construct"
_UNKNOWN = "time tan sample_slope sample_bend raw raw_slope finite"

RULES: Mapping[str, Rule] = {
    **dict.fromkeys(_RISING.split(), _rising),
    **dict.fromkeys(_UNKNOWN.split(), _unknown),
    "param": _param,
    "cell": lambda node: (np.asarray(node.data.low, np.float64), np.asarray(node.data.high, np.float64)),
    "sub": _difference,
    "mul": lambda node, a, b: _square(a) if node.args[0] is node.args[1] else _product(node, a, b),
    "div": _each(lambda a, b: _mul(a, _reciprocal(b))),
    "neg": _each(lambda a: (low := -a[1], low if a[0] is a[1] else -a[0])),
    "abs": _each(_abs),
    "fract": _each(lambda a: (np.zeros_like(a[0]), np.ones_like(a[1]))),
    "mod": _each(lambda a, b: (np.minimum(b[0], 0.0), np.maximum(b[1], 0.0))),
    "sin": _each(_wave(np.pi / 2)),
    "cos": _each(cosine),
    "acos": _each(lambda a: (np.arccos(np.clip(a[1], -1, 1)), np.arccos(np.clip(a[0], -1, 1)))),
    "atan2": _each(lambda y, x: (np.full_like(y[0], -np.pi), np.full_like(y[1], np.pi))),
    "cosh": _each(lambda a: (np.cosh(_abs(a)[0]), np.cosh(_abs(a)[1]))),
    "pow": _each(_pow),
    "mix": _each(_mix),
    "step": _each(lambda edge, x: (np.where(x[0] >= edge[1], 1.0, 0.0), np.where(x[1] < edge[0], 0.0, 1.0))),
    "smoothstep": _each(lambda low, high, x: (np.zeros_like(x[0]), np.ones_like(x[1]))),
    "lt": _less(strict=True),
    "le": _less(strict=False),
    "and": lambda _node, a, b: (a[0] & b[0], a[1] & b[1]),
    "or": lambda _node, a, b: (a[0] | b[0], a[1] | b[1]),
    "not": lambda _node, a: (~a[1], ~a[0]),
    "where": _where,
    "dot": _dot,
    "length": _length,
    "normalize": _normalize,
    "cross": _cross,
    "columns": lambda _node, *columns: tuple(
        np.stack(np.broadcast_arrays(*[c[i] for c in columns]), axis=-1) for i in (0, 1)
    ),
    "matmul": _matmul,
    "transpose": lambda _node, m: (np.swapaxes(m[0], -1, -2), np.swapaxes(m[1], -1, -2)),
    "sample": samples.interval,
    "texture": textures.interval,
    "texture_in_atlas": textures.interval,
    "fetch": tables.interval,
    "probe": lambda _node, value, *_: value,
    "within": lambda _node, value: value,
    "stop_gradient": lambda _node, value: value,
    "hash": lambda _node, _cell: (np.zeros(()), np.ones(())),
}


class Intervals:
    """The interval reading; it has no state."""

    @property
    def rules(self) -> Mapping[str, Rule]:
        return RULES

    def leaf(self, node: Expr) -> Interval:
        return node.data, node.data

    def repeat(self, body: Loop, program: Program, first: list[Any], captured: list[Any]) -> tuple[Any, ...]:
        return tuple(_unknown(v) for v in body.state)


INTERVALS = Intervals()


def interval_of(node: Expr) -> Interval:
    """The range of an expression without variables over all legal parameter values and all times."""
    if node.op == "const":
        return node.data, node.data
    return _range_of(node)


ROUNDS, MOST = 40, 2048
"""Largest number of bisections of the sources of an expression, and of pieces."""


@lru_cache(512)
def _range_of(node: Expr) -> Interval:
    """Intervals take each use of a value as independent. Where a value is used more than once, the ranges of the
    sources are bisected wherever a piece may hold an end of the range."""
    with np.errstate(all="ignore"):
        low, high = _known(Program([node], [], INTERVALS)()[0])
        if not np.any(low < high) or not 0 < len(sources := _sources(node)) <= 3:
            return low, high
        program, sizes = Program([node], sources, INTERVALS), [source.type.size for source in sources]
        first = Program(sources, [], INTERVALS)()
        start, end = (np.concatenate([np.ravel(ends[side]) for ends in first])[None] for side in (0, 1))

        def over(start: NDArray[Any], end: NDArray[Any]) -> Interval:
            cuts = np.cumsum(sizes)[:-1]
            parts = zip(np.split(start, cuts, axis=1), np.split(end, cuts, axis=1), sizes, strict=True)
            inputs = [(a[:, 0], b[:, 0]) if size == 1 else (a, b) for a, b, size in parts]
            found = [end.reshape(len(end) if end.ndim > low.ndim else 1, -1) for end in _known(program(*inputs)[0])]
            return tuple(np.broadcast_to(end, (len(start), low.size)) for end in found)  # type: ignore[return-value]

        least, most = np.full(low.size, np.inf), np.full(low.size, -np.inf)  # of what is not bisected any more
        inner = least, most
        for _ in range(ROUNDS):
            bottom, top = over(start, end)
            middle = 0.5 * (start + end)
            values = over(middle, middle)
            inner = np.minimum(inner[0], values[0].min(axis=0)), np.maximum(inner[1], values[1].max(axis=0))
            near = 1e-7 * (inner[1] - inner[0])
            open_ = np.any(
                (bottom < np.minimum(inner[0], least) - near) | (top > np.maximum(inner[1], most) + near), axis=1
            )
            if open_.sum() > MOST or not np.any(np.isfinite(inner[1] - inner[0])):
                open_[:] = False
            least = np.minimum(least, bottom[~open_].min(axis=0, initial=np.inf))
            most = np.maximum(most, top[~open_].max(axis=0, initial=-np.inf))
            if not np.any(open_):
                break
            start, end, middle = start[open_], end[open_], middle[open_]
            bottom, top = bottom[open_], top[open_]
            widest = np.arange(start.shape[1]) == np.argmax(end - start, axis=1)[:, None]
            start, end = (
                np.concatenate([start, np.where(widest, middle, start)]),
                np.concatenate([np.where(widest, middle, end), end]),
            )
            bottom, top = np.tile(bottom, (2, 1)), np.tile(top, (2, 1))
        else:
            least, most = np.minimum(least, bottom.min(axis=0)), np.maximum(most, top.max(axis=0))
    return np.maximum(low, least.reshape(low.shape)), np.minimum(high, most.reshape(low.shape))


def _known(range: Interval) -> Interval:
    return np.where(np.isnan(range[0]), -np.inf, range[0]), np.where(np.isnan(range[1]), np.inf, range[1])


def _sources(root: Expr) -> list[Expr]:
    """The values of a bounded range on which an expression depends, if one of them, or one made of them, is used more
    than once; else none."""
    order = topological([root])
    ranges = dict(zip(order, Program(order, [], INTERVALS)(), strict=True)) if len(order) <= 400 else {}
    bounded = {node: node.type is not BOOL and bool(np.all(np.isfinite(ranges[node]))) for node in ranges}
    found: dict[Expr, None] = {}
    uses: dict[Expr, int] = {}
    pending, seen = [root], {root}
    while pending:
        node = pending.pop()
        if node.op == "const" or not ranges:
            continue
        if bounded[node] and (
            node.op in ("param", "cell", "hash") or not all(bounded.get(a, False) for a in node.args)
        ):
            found[node] = None
            continue
        if not node.args or node.op in ("loop", "item"):
            return []  # of an unbounded range
        for arg in node.args:
            uses[arg] = uses.get(arg, 0) + (arg.op != "const")
            if arg not in seen:
                seen.add(arg)
                pending.append(arg)
    return list(found) if any(count > 1 for count in uses.values()) else []
