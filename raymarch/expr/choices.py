"""Calls on exclusive sides of a choice, as one call of chosen arguments.

`where(c, f(a), f(b))` is `f(where(c, a, b))`: one evaluation of f in place of two.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TypeAlias, TypeVar

from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.operations import operations
from raymarch.expr.vocabulary import where
from raymarch.expr.walk import attribute, rebuild, rewrite, substitute, topological

T = TypeVar("T")

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
    """Each tree of choices merged on its own."""
    return changed_inside_out(
        roots, lambda node: node.op == "call" and saving(node.data) > 0, lambda tree: _merge_in(tree, saving)
    )


def changed_inside_out(
    roots: Sequence[Expr], concerned: Callable[[Expr], bool], change: Callable[[Expr], Expr]
) -> list[Expr]:
    """The roots with each tree of choices above a concerned expression changed, those in the leaves of others first."""
    done: dict[Expr, Expr] = {}
    above: dict[Expr, bool] = {}

    def is_above(node: Expr) -> bool:
        return any(above[arg] for arg in node.args) or concerned(node)

    def chosen(value: Expr) -> Expr:
        if value.op != "where" or not attribute(value, above, is_above):
            return value
        if value not in done:
            done[value] = change(value)
        return done[value]

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        return rebuild(node, args if node.op == "where" else tuple(map(chosen, args)))

    new = rewrite(roots, rule)
    return [chosen(new[root]) for root in roots]


def sides(node: Expr) -> tuple[Expr, ...]:
    """The values between which a choice chooses; none of any other expression."""
    return node.args[1:] if node.op == "where" else ()


def fold_choices(order: Sequence[Expr], leaf: Callable[[Expr], T], choose: Callable[[Expr, T, T], T]) -> T:
    """The value of a tree of choices, from `leaf` of each leaf, and `choose(condition, yes, no)` of each choice.

    order : the choices and leaves of the tree, arguments first, as `topological([tree], sides)` returns them.
    """
    values: dict[Expr, T] = {}
    for node in order:
        if node.op == "where":
            condition, yes, no = node.args
            values[node] = choose(condition, values[yes], values[no])
        else:
            values[node] = leaf(node)
    return values[order[-1]]


def if_both(choose: Callable[[Expr, T, T], T]) -> Callable[[Expr, T | None, T | None], T | None]:
    """The same function for two sides of which one or both may be None: the other one is then taken."""
    return lambda condition, yes, no: no if yes is None else yes if no is None else choose(condition, yes, no)


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
        given = {leaf: call.args for leaf, call in by_leaf.items()}
        args = fold_choices(order, given.get, if_both(where_each))  # a leaf without the call takes any
        assert args is not None
        if _selections(args) >= (distinct - 1) * saving(definition):
            continue
        call = definition(*args)
        for leaf, old in by_leaf.items():
            new[leaf] = substitute([new[leaf]], {old: call})[0]
    return fold_choices(order, new.__getitem__, where)


def where_each(condition: Expr, yes: tuple[Expr, ...], no: tuple[Expr, ...]) -> tuple[Expr, ...]:
    return tuple(where(condition, a, b) for a, b in zip(yes, no, strict=True))


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
            known = {call: new for call in calls if call.data is definition}
            order = topological([tree], sides)
            leaves = [node for node in order if node.op != "where"]  # conditions keep their calls
            made = dict(zip(leaves, substitute(leaves, known), strict=True))
            tree = fold_choices(order, made.__getitem__, where)
    return tree


def _path_args(node: Expr, definition: Function, known: dict[Expr, bool], used: set[Expr]) -> tuple[Expr, ...] | bool:
    """The arguments of the only call below a tree of choices; False without a call, True with several.

    known : conditions on the path to the node. used : gets the calls.
    """
    if node.op != "where":
        calls = [each for each in topological([node], partial(taken_arguments, known)) if each.op == "call"]
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
        return where_each(condition, yes, no)
    return yes or no


def taken_arguments(known: Mapping[Expr, bool], node: Expr) -> tuple[Expr, ...]:
    """The arguments of an expression that count where some conditions are known."""
    if node.op == "where" and node.args[0] in known:
        return (node.args[1 if known[node.args[0]] else 2],)
    return node.args


def _selections(args: Sequence[Expr]) -> int:
    """Numbers that are chosen for some arguments."""
    return sum(node.type.size for node in topological(args, sides) if node.op == "where")
