"""Calls on exclusive sides of a choice, as one call of chosen arguments.

`where(c, f(a), f(b))` is `f(where(c, a, b))`: one evaluation of f in place of two.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.operations import operations
from raymarch.expr.vocabulary import where
from raymarch.expr.walk import attribute, rebuild, rewrite, substitute, topological

Saving: TypeAlias = Callable[[Function], int]
"""Operations that each avoided call of a function saves; 0 if its calls stay apart."""


def merge_calls(roots: Sequence[Expr], saving: Saving) -> list[Expr]:
    """The roots, with calls of one function on exclusive sides of a choice merged where this saves operations."""
    done: dict[Expr, Expr] = {}
    calling: dict[Expr, bool] = {}

    def calls(node: Expr) -> bool:
        return any(calling[arg] for arg in node.args) or (node.op == "call" and saving(node.data) > 0)

    def chosen(value: Expr) -> Expr:
        if value.op != "where" or not attribute(value, calling, calls):
            return value
        if value not in done:
            done[value] = _merge_in(value, saving)
        return done[value]

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        return rebuild(node, args if node.op == "where" else tuple(map(chosen, args)))

    new = rewrite(roots, rule)
    return [chosen(new[root]) for root in roots]


def sides(node: Expr) -> tuple[Expr, ...]:
    """The values between which a choice chooses; none of any other expression."""
    return node.args[1:] if node.op == "where" else ()


def _merge_in(tree: Expr, saving: Saving) -> Expr:
    """The same for the leaves of one tree of choices."""
    order = topological([tree], sides)
    leaves = [node for node in order if node.op != "where"]
    calls: dict[Function, dict[Expr, Expr]] = {}
    for leaf in leaves:
        for node in topological([leaf]):
            if node.op == "call" and saving(node.data) > 0:
                calls.setdefault(node.data, {}).setdefault(leaf, node)
    new = {leaf: leaf for leaf in leaves}
    for definition, by_leaf in calls.items():
        distinct = len(set(by_leaf.values()))
        if distinct < 2:
            continue
        args = _chosen_args(order, by_leaf)
        selects = [node for node in topological(args, sides) if node.op == "where"]
        if sum(node.type.size for node in selects) >= (distinct - 1) * saving(definition):
            continue
        call = definition(*args)
        for leaf, old in by_leaf.items():
            new[leaf] = substitute([new[leaf]], {old: call})[0]
    for node in order:
        if node.op == "where":
            new[node] = where(node.args[0], new[node.args[1]], new[node.args[2]])
    return new[tree]


def _chosen_args(order: Sequence[Expr], calls: dict[Expr, Expr]) -> tuple[Expr, ...]:
    """The arguments of the call in the leaf that is taken; any where that leaf has none."""
    args: dict[Expr, tuple[Expr, ...] | None] = {}
    for node in order:
        if node.op != "where":
            args[node] = calls[node].args if node in calls else None
            continue
        yes, no = args[node.args[1]], args[node.args[2]]
        if yes is None or no is None:
            args[node] = no if yes is None else yes
        else:
            args[node] = tuple(where(node.args[0], a, b) for a, b in zip(yes, no, strict=True))
    result = args[order[-1]]
    assert result is not None
    return result


def operations_of(definition: Function) -> int:
    """Operations of one call, remembered."""
    if "operations" not in definition.derived:
        definition.derived["operations"] = operations(definition.inner)
    result: int = definition.derived["operations"]
    return result
