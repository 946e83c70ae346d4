"""Rules of operations on vectors and matrices."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from raymarch.expr.arrays import SHORTEST
from raymarch.expr.evaluate import Rule
from raymarch.expr.node import Expr
from raymarch.expr.types import FLOAT
from raymarch.proof import rounding as r
from raymarch.proof.components import ADD, DIV, MAX, MUL, NEAR_ADD, ROOT, SQUARE, SUB, Typed, typed
from raymarch.proof.rounding import ZERO, Array
from raymarch.proof.span import Span, constant, spanned


def _part(v: Span, i: int) -> Span:
    slope = None if v.slope is None else (v.slope[0][..., i], v.slope[1][..., i])
    return Span(v.low[..., i], v.high[..., i], (v.at[0][..., i], v.at[1][..., i]), slope)


def _stacked(parts: Sequence[Span]) -> Span:
    """Components as a vector, or columns as a matrix, each component in one run."""

    def stack(arrays: Sequence[Array]) -> Array:
        return np.moveaxis(np.stack(np.broadcast_arrays(*arrays)), 0, -1)

    low, high = stack([p.low for p in parts]), stack([p.high for p in parts])
    at = stack([p.at[0] for p in parts]), stack([p.at[1] for p in parts])
    if all(p.slope is None for p in parts):
        return Span(low, high, at, None)
    slopes = [p.slope or ZERO for p in parts]
    slope = tuple(np.broadcast_to(stack([s[i] for s in slopes]), np.shape(low)) for i in (0, 1))
    return Span(low, high, at, (slope[0], slope[1]))


_SCALAR = Typed(FLOAT)


def _sum(parts: Sequence[Span], plus: Rule = ADD) -> Span:
    result = parts[0]
    for part in parts[1:]:
        result = typed(plus, _SCALAR, result, part)
    return result


def _size(node: Expr) -> int:
    return node.args[0].type.size


def _dot(node: Expr, a: Span, b: Span) -> Span:
    n = _size(node)
    if node.args[0] is node.args[1]:
        return _sum([typed(SQUARE, _SCALAR, _part(a, i)) for i in range(n)])
    return _sum([typed(MUL, _SCALAR, _part(a, i), _part(b, i)) for i in range(n)])


def _length(node: Expr, v: Span) -> Span:
    """The slope of a length is at most that of the vector."""
    squares = [typed(SQUARE, _SCALAR, _part(v, i)) for i in range(_size(node))]
    found = typed(ROOT, _SCALAR, _sum(squares, NEAR_ADD))
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
    divisor = typed(MAX, _SCALAR, length, shortest)
    parts = [typed(DIV, _SCALAR, _part(v, i), divisor) for i in range(_size(node))]
    return _stacked([p._replace(low=np.fmax(p.low, -1.0), high=np.fmin(p.high, 1.0)) for p in parts])


def _cross(_node: Expr, a: Span, b: Span) -> Span:
    def minor(i: int, j: int) -> Span:
        one = typed(MUL, _SCALAR, _part(a, i), _part(b, j))
        return typed(SUB, _SCALAR, one, typed(MUL, _SCALAR, _part(a, j), _part(b, i)))

    return _stacked([minor(1, 2), minor(2, 0), minor(0, 1)])


def _matmul(node: Expr, a: Span, b: Span) -> Span:
    n = _size(node)
    columns = [_part(a, j) for j in range(n)]  # the columns are the last axis

    def times(vector: Span) -> Span:
        entries = [[_part(column, i) for column in columns] for i in range(n)]
        parts = [_part(vector, j) for j in range(n)]
        return _stacked([_sum([typed(MUL, _SCALAR, e, p) for e, p in zip(row, parts, strict=True)]) for row in entries])

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


RULES: Mapping[str, Rule] = {
    "dot": _dot,
    "length": _length,
    "normalize": _normalize,
    "cross": _cross,
    "columns": lambda _node, *columns: _stacked(columns),
    "matmul": _matmul,
    "transpose": _moved(lambda m: np.swapaxes(m, -1, -2)),
    "swizzle": _swizzle,
    "construct": _construct,
}
