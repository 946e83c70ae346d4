"""Ties: kinks of the same difference take the same side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import NamedTuple, TypeAlias

import numpy as np

import raymarch.expr.vocabulary as v
from raymarch.expr.node import Expr
from raymarch.expr.partials import Partial, Partials, not_above
from raymarch.expr.types import BOOL

Terms: TypeAlias = frozenset[tuple[int, Expr]]
"""A sum of signed expressions."""


class _Side(NamedTuple):
    """Sign of a difference: one sign where a condition holds, also at 0, the other elsewhere."""

    condition: Expr
    sign: int

    def choose(self, negative: float, positive: float) -> Expr:
        """`negative` where the difference counts as negative, `positive` elsewhere."""
        yes, no = (negative, positive) if self.sign < 0 else (positive, negative)
        if self.condition.type is BOOL:
            return v.where(self.condition, yes, no)
        return no + (yes - no) * self.condition


def one_sided(order: Sequence[Expr], dependent: AbstractSet[Expr]) -> dict[Expr, Partials]:
    """Partial derivatives of kinks whose side of a tie differs from that in `PARTIALS`, by node.

    Where a = b, min(a, b) has the derivative of a, as if a < b. A sum of kinks of a - b is then right only if all take
    this side: abs(a - b) has the slope -1, and max(a, b) the derivative of b. The side is chosen by a comparison of a
    and b, else by the first min, else by the first max; these prefer an argument that depends on the variable. An abs
    alone keeps the slope 0, the mean of both sides.
    """
    kinks: dict[str, list[Expr]] = {op: [] for op in ("lt", "le", "min", "max", "abs")}
    for node in order:
        if node.op in kinks and node in dependent:
            kinks[node.op].append(node)
    found: dict[Terms, _Side] = {}
    for node in kinks["lt"] + kinks["le"]:
        if all(arg in dependent for arg in node.args):
            found.setdefault(_difference(node), _Side(node, -1))
    changed: dict[Expr, Partials] = {}
    for node in kinks["min"] + kinks["max"]:
        a, b = node.args
        taken = -1 if node.op == "min" else 1
        side = _known(_difference(node), found)
        if side is None:
            sign = taken if a in dependent else -taken
            side = _Side(not_above(a, b) if sign < 0 else not_above(b, a), sign)
            found[_difference(node)] = side
        if side.sign != taken:
            first = side.choose(1.0, 0.0) if taken < 0 else side.choose(0.0, 1.0)
            changed[node] = (_given(first), _given(1.0 - first))
    for node in kinks["abs"]:
        if side := _known(_difference(node), found):
            changed[node] = (_given(side.choose(-1.0, 1.0)),)
    return changed


def _given(slope: Expr) -> Partial:
    return lambda e: slope


def _known(terms: Terms, found: Mapping[Terms, _Side]) -> _Side | None:
    """The chosen side of a difference or of its negative."""
    if terms in found:
        return found[terms]
    side = found.get(frozenset((-sign, term) for sign, term in terms))
    return side and _Side(side.condition, -side.sign)


def _difference(kink: Expr) -> Terms:
    """The expression that is 0 at a kink: x for abs(x) and max(x, 0), a - b for min(a, b), max(a, b) and
    comparisons."""
    terms = [term for arg, sign in zip(kink.args, (1, -1), strict=False) for term in _term(arg, sign)]
    if len(terms) == 1 and terms[0][1].op in ("add", "sub"):
        sign, inner = terms[0]
        a, b = inner.args
        terms = [*_term(a, sign), *_term(b, sign if inner.op == "add" else -sign)]
    return frozenset(terms)


def _term(e: Expr, sign: int) -> Sequence[tuple[int, Expr]]:
    if e.op == "neg":
        return ((-sign, e.args[0]),)
    return () if e.op == "const" and not np.any(e.data) else ((sign, e),)
