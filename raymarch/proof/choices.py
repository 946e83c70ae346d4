"""Rules of conditions and of choices between two values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from raymarch.expr.arrays import lift
from raymarch.expr.evaluate import Rule
from raymarch.expr.node import Expr
from raymarch.expr.types import BOOL, Type
from raymarch.proof.rounding import ZERO, Array
from raymarch.proof.span import Span, condition, numbered, sides_of


def _less(strict: bool) -> Rule:
    def rule(_node: Expr, a: Span, b: Span) -> Span:
        always, never = (a.high < b.low, a.low >= b.high) if strict else (a.high <= b.low, a.low > b.high)
        if a.slope is None and b.slope is None:
            return condition(always, ~never)
        sides = sides_of(~always & ~never)
        if sides is None:
            return condition(always, ~never)
        return condition(np.where(sides >= 0, sides == 1, always), np.where(sides >= 0, sides == 1, ~never))

    return numbered(rule)


def _where(node: Expr, choice: Span, a: Any, b: Any) -> Any:
    if node.type.fields:
        types = [type for _, type in node.type.fields]
        return tuple(selected(t, choice, one, other) for t, one, other in zip(types, a, b, strict=True))
    return selected(node.type, choice, a, b)


def selected(type: Type, choice: Span, a: Span, b: Span) -> Span:
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


RULES: Mapping[str, Rule] = {
    "lt": _less(strict=True),
    "le": _less(strict=False),
    "and": lambda _node, a, b: condition(a.low & b.low, a.high & b.high),
    "or": lambda _node, a, b: condition(a.low | b.low, a.high | b.high),
    "not": lambda _node, a: condition(~a.high, ~a.low),
    "where": _where,
}
