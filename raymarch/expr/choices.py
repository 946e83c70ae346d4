"""Calls on exclusive sides of a choice, as one call of chosen arguments.

`where(c, f(a), f(b))` is `f(where(c, a, b))`: one evaluation of f in place of two.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TypeAlias

from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.operations import operations
from raymarch.expr.vocabulary import where
from raymarch.expr.walk import attribute, rebuild, rewrite, substitute, topological

Saving: TypeAlias = Callable[[Function], int]
"""Operations that each avoided call of a function saves; 0 if its calls stay apart."""


MOST = 64
"""Maximum number of choices of an expression, and of choices and leaves of a tree, whose paths are followed. Paths may
be many more."""


def merge_calls(roots: Sequence[Expr], saving: Saving) -> list[Expr]:
    """The roots, with calls of one function on exclusive sides of a choice merged where this saves operations."""
    roots = list(roots)
    order = topological(roots)
    choices = [node for node in order if node.op == "where"]
    calls = [node.data for node in order if node.op == "call" and saving(node.data) > 0]
    if not choices or len(calls) == len(set(calls)):
        return roots
    merged = _merged_inside_out(roots, saving)
    if len(choices) > MOST:
        return merged
    inner = {side for choice in choices for side in sides(choice)}
    whole = {choice: _merge_paths(choice, saving) for choice in choices if choice not in inner}
    if all(new is old for old, new in whole.items()):
        return merged
    other = _merged_inside_out(substitute(roots, whole), saving)
    return other if operations(other) < operations(merged) else merged


def _merged_inside_out(roots: Sequence[Expr], saving: Saving) -> list[Expr]:
    """Each tree of choices merged on its own, those in the leaves of others first."""
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
        if _selections(args) >= (distinct - 1) * saving(definition):
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


def _merge_paths(tree: Expr, saving: Saving) -> Expr:
    """A tree of choices with one call of each function, where each path through its choices needs at most one.

    A leaf may choose again by the same conditions: on a path these are known.
    """
    if len(topological([tree], sides, limit=MOST)) == 0:
        return tree
    calls = [node for node in topological([tree]) if node.op == "call" and saving(node.data) > 0]
    for definition in dict.fromkeys(call.data for call in calls):
        used: set[Expr] = set()
        args = _path_args(tree, definition, {}, used)
        if isinstance(args, tuple) and _selections(args) < (len(used) - 1) * saving(definition):
            new = definition(*args)  # calls that no path needs become this one too
            tree = _with_leaves(tree, {call: new for call in calls if call.data is definition})
    return tree


def _path_args(node: Expr, definition: Function, known: dict[Expr, bool], used: set[Expr]) -> tuple[Expr, ...] | bool:
    """The arguments of the only call below a tree of choices; False without a call, True with several.

    known : conditions on the path to the node. used : gets the calls.
    """
    if node.op != "where":
        calls = [each for each in topological([node], partial(_taken, known)) if each.op == "call"]
        calls = [call for call in calls if call.data is definition]
        used.update(calls)
        return calls[0].args if len(calls) == 1 else bool(calls)
    condition, *pair = node.args
    if condition in known:
        return _path_args(pair[not known[condition]], definition, known, used)
    found = []
    for value, side in zip((True, False), pair, strict=True):
        known[condition] = value
        found.append(_path_args(side, definition, known, used))
        del known[condition]
        if found[-1] is True:
            return True
    yes, no = found
    if isinstance(yes, tuple) and isinstance(no, tuple):
        return tuple(where(condition, a, b) for a, b in zip(yes, no, strict=True))
    return yes or no


def _taken(known: Mapping[Expr, bool], node: Expr) -> tuple[Expr, ...]:
    """The arguments of an expression that count where some conditions are known."""
    if node.op == "where" and node.args[0] in known:
        return (node.args[1 if known[node.args[0]] else 2],)
    return node.args


def _with_leaves(tree: Expr, calls: Mapping[Expr, Expr]) -> Expr:
    """A tree of choices with calls replaced in its leaves, not in its conditions."""
    new: dict[Expr, Expr] = {}
    for node in topological([tree], sides):
        if node.op == "where":
            new[node] = where(node.args[0], new[node.args[1]], new[node.args[2]])
        else:
            new[node] = substitute([node], calls)[0]
    return new[tree]


def _selections(args: Sequence[Expr]) -> int:
    """Numbers that are chosen for some arguments."""
    return sum(node.type.size for node in topological(args, sides) if node.op == "where")


def operations_of(definition: Function) -> int:
    """Operations of one call, remembered."""
    if "operations" not in definition.derived:
        definition.derived["operations"] = operations(definition.inner)
    result: int = definition.derived["operations"]
    return result
