"""Adjoints that are choices: products with 0 of the side that is not taken are left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import raymarch.expr.vocabulary as v
from raymarch.expr.choices import fold_choices, if_both, sides
from raymarch.expr.node import Expr
from raymarch.expr.partials import zero
from raymarch.expr.walk import attribute, topological

LEAVES = 256
"""Maximum number of nested choices that are examined."""


class Masks:
    """The adjoints that are 0 on a side of a choice.

    The side that is not taken has the adjoint 0, but derivatives there may be infinite, and the product is NaN.
    Derivatives are therefore multiplied by the other sides, and the choice is applied to the products.
    """

    def __init__(self) -> None:
        self._partly_zero: dict[Expr, bool] = {}
        self._large: set[Expr] = set()

    def of(self, adjoint: Expr) -> list[Expr]:
        """The nested choices of an adjoint and their leaves, arguments first; none if no leaf is 0 or all are."""
        if adjoint.op != "where" or not attribute(adjoint, self._partly_zero, self._is_partly_zero, sides):
            return []
        order = [] if any(side in self._large for side in sides(adjoint)) else topological([adjoint], sides, 2 * LEAVES)
        if not order:
            self._large.add(adjoint)
        return order

    def _is_partly_zero(self, value: Expr) -> bool:
        return any(self._partly_zero[side] for side in sides(value)) or value is zero(value.type)


def taken(adjoint: Expr, mask: Sequence[Expr]) -> Expr:
    """The choice between those leaves of an adjoint that are not 0."""
    nothing = zero(adjoint.type)
    inner = fold_choices(mask, lambda leaf: None if leaf is nothing else leaf, if_both(v.where))
    return nothing if inner is None else inner


def masked(term: Expr, adjoint: Expr, mask: Sequence[Expr]) -> Expr:
    """The term where an adjoint is not 0, else 0."""
    nothing, nowhere = zero(term.type), zero(adjoint.type)
    return fold_choices(mask, lambda leaf: nothing if leaf is nowhere else term, v.where)


def accumulate(adjoints: dict[Expr, Expr], node: Expr, term: Expr | None, adjoint: Expr, mask: Sequence[Expr]) -> None:
    if term is None:
        return
    if mask:
        term = masked(term, adjoint, mask)
    adjoints[node] = add_choices(adjoints[node], term) if node in adjoints else term


def map_choices(change: Callable[[Expr], Expr], tree: Expr) -> Expr:
    """A function of a value; of a choice, the choice between the function's values, unless there are too many."""
    order = topological([tree], sides, limit=2 * LEAVES)
    return fold_choices(order, change, v.where) if order else change(tree)


def add_choices(a: Expr, b: Expr) -> Expr:
    """a + b, as one choice where both are choices by the same condition."""
    outer: list[tuple[Expr, Expr | None, Expr | None]] = []
    while a.op == b.op == "where" and a.args[0] is b.args[0]:
        condition, nothing = a.args[0], zero(a.type)
        (yes, no), (yes_too, no_too) = a.args[1:], b.args[1:]
        if no is nothing or no_too is nothing:
            outer.append((condition, None, no_too if no is nothing else no))
            a, b = yes, yes_too
        else:
            outer.append((condition, add_choices(yes, yes_too), None))
            a, b = no, no_too
    total = a + b
    for condition, yes_sum, no_sum in reversed(outer):
        total = v.where(condition, total if yes_sum is None else yes_sum, total if no_sum is None else no_sum)
    return total
