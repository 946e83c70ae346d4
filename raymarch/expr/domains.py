"""Arguments outside the domain of an operation, as fault expressions: see `raymarch.expr.faults`."""

from __future__ import annotations

from collections.abc import Iterable

import raymarch.expr.vocabulary as v
from raymarch.expr.node import Expr, const, construct
from raymarch.expr.templates import is_nonnegative
from raymarch.expr.types import BOOL, FLOAT

ROUNDING = 2.0**-18
"""Tolerance for rounding: the argument of a root may be negative by this fraction of its terms, that of an arc sine too
large by this. 32 units in the last place of float32, the error of a chain of some ten operations."""

HIDING = frozenset(
    """
    min max clamp step smoothstep sign sqrt exp exp2 log log2 asin acos atan atan2 tanh pow lt le normalize sample
    sample_slope sample_bend texture hash raw raw_slope call div mod
    """.split()
)
"""Operations whose result may be finite although an argument is not; all others propagate it."""

_BOUNDED = HIDING - set("exp exp2 pow raw raw_slope call div mod".split()) | {"const", "var", "param", "time"}
"""Operations whose result is finite if their arguments are."""

_HANDING_ON = {
    *("neg", "abs", "swizzle", "construct", "where", "floor", "ceil", "fract", "sin", "cos"),
    *("mark", "within", "stop_gradient"),
}


NOTHING = const([0.0, 0.0])


def merged(faults: Iterable[Expr | None]) -> Expr | None:
    """The first fault of several that is not 0."""
    result: Expr | None = None
    for fault in dict.fromkeys(faults):
        if fault is not None and fault is not NOTHING:
            result = fault if result is None else v.where(result.x > 0.0, result, fault)
    return result


def _if(condition: Expr, number: float, value: Expr) -> Expr:
    return v.where(condition, construct(number, value), NOTHING)


def _parts(value: Expr) -> list[Expr]:
    return [value] if value.type is FLOAT else list(value)


def _known(e: Expr, depth: int = 6) -> bool:
    """True if the structure of an expression, to some depth, proves that it is finite or already checked."""
    if e.type is BOOL or e.type.is_matrix or e.op in _BOUNDED:
        return True
    if depth == 0 or e.op not in _HANDING_ON:
        return False
    return all(_known(arg, depth - 1) for arg in e.args)


def not_finite(value: Expr, number: float) -> Expr | None:
    while value.op in ("neg", "abs"):  # finite where their argument is
        value = value.args[0]
    if _known(value):
        return None
    parts = _parts(value)
    culprit = parts[-1]
    for part in parts[-2::-1]:
        culprit = v.where(v.finite(part), culprit, part)
    return _if(~v.finite(value), number, culprit)


def outside(op: str, args: tuple[Expr, ...], number: float) -> Expr | None:
    """The fault of arguments outside of the operation's domain."""
    if op in ("div", "mod"):
        return merged(None if _is_positive(d) else _if(abs(d) <= 0.0, number, d) for d in _parts(args[1]))
    if op == "smoothstep":
        pairs = zip(_parts(args[0]), _parts(args[1]), strict=True)
        return merged(None if a.is_constant and b.is_constant else _if(b <= a, number, b - a) for a, b in pairs)
    if op in ("asin", "acos"):
        return merged(_if(abs(x) > 1.0 + ROUNDING, number, x) for x in _parts(args[0]) if not x.is_constant)
    if op in ("log", "log2"):
        return merged(None if _is_positive(x) else _if(x <= 0.0, number, x) for x in _parts(args[0]))
    first = args[0]
    if is_nonnegative(first):
        return None
    terms = zip(*[_stretched(t, first) for t in first.args], strict=True) if first.op in ("add", "sub") else None
    least = [-ROUNDING * sum((abs(t) for t in pair[1:]), abs(pair[0])) for pair in terms] if terms else None
    parts = _parts(first)
    return merged(_if(x < limit, number, x) for x, limit in zip(parts, least or [0.0] * len(parts), strict=True))


def _stretched(value: Expr, over: Expr) -> list[Expr]:
    parts = _parts(value)
    return parts * over.type.size if len(parts) == 1 else parts


def _is_positive(e: Expr) -> bool:
    """True if the structure of an expression proves that it is larger than 0 (constants: not 0)."""
    match e.op:
        case "const":
            return e.type is not BOOL and bool((e.data != 0).all())
        case "max":
            return any(arg.op == "const" and bool((arg.data > 0).all()) for arg in e.args)
        case "clamp":
            return e.args[1].op == "const" and bool((e.args[1].data > 0).all())
        case "add":
            pairs = (e.args, e.args[::-1])
            return any(a.op == "const" and bool((a.data > 0).all()) and is_nonnegative(b) for a, b in pairs)
    return False
