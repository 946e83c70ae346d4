"""Calls on exclusive sides of a choice, as one call of chosen arguments, and look-ups of pictures, as one look-up.

`where(c, f(a), f(b))` is `f(where(c, a, b))`: one evaluation of f in place of two. `where(c, read(a), read(b))` is one
read, at a chosen place, in an atlas that holds both pictures: drivers inline the look-up of each picture, with its
loop, and the time that they take to compile grows faster than the number of look-ups.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TypeAlias, TypeVar

from raymarch.expr.atlas import Atlas, Place, shelved
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const
from raymarch.expr.operations import operations
from raymarch.expr.textures import texture_in_atlas
from raymarch.expr.vocabulary import vec2, vec4, where
from raymarch.expr.walk import attribute, find, rebuild, rewrite, substitute, topological

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


# Look-ups of pictures


FEW = 8
"""Up to this number of pictures, each keeps its own texture: texture units filter it in hardware, and a look-up of each
takes the drivers less than 0.2 s to compile."""


def merge_reads(roots: Sequence[Expr]) -> list[Expr]:
    """The roots, with look-ups of many pictures on exclusive sides of a choice merged into one for each atlas."""
    pictures = dict.fromkeys(node.data for node in find(roots, "texture"))
    places = shelved(pictures) if len(pictures) > FEW else {}
    if not places:
        return list(roots)
    return changed_inside_out(
        roots, lambda node: node.op == "texture" and node.data.name in places, lambda tree: _merged(tree, places)
    )


def _merged(tree: Expr, places: Mapping[str, Place]) -> Expr:
    """A tree of choices with as many look-ups in an atlas as the leaf that has the most."""
    order = topological([tree], sides)
    leaves = [node for node in order if node.op != "where"]
    slots: dict[tuple[Atlas, int], dict[Expr, Expr]] = {}
    for leaf in leaves:
        counts: Counter[Atlas] = Counter()
        for node in topological([leaf], _without_conditions):
            if node.op == "texture" and node.data.name in places:
                atlas = places[node.data.name].atlas
                slots.setdefault((atlas, counts[atlas]), {})[leaf] = node
                counts[atlas] += 1
    new: dict[Expr, dict[Expr, Expr]] = {leaf: {} for leaf in leaves}
    for (atlas, _), by_leaf in slots.items():
        if len({read.data for read in by_leaf.values()}) > 1:
            read = _one_read(order, atlas, by_leaf, places)
            for leaf, old in by_leaf.items():
                new[leaf][old] = read
    made = {leaf: substitute([leaf], new[leaf])[0] if new[leaf] else leaf for leaf in leaves}
    return fold_choices(order, made.__getitem__, where)


def _one_read(order: Sequence[Expr], atlas: Atlas, by_leaf: Mapping[Expr, Expr], places: Mapping[str, Place]) -> Expr:
    """The look-up that stands for one of each leaf. It has the weight 0 at the leaves that have none."""

    def args(leaf: Expr) -> tuple[Expr, ...] | None:
        if leaf not in by_leaf:
            return None
        place, given = places[by_leaf[leaf].data.name], by_leaf[leaf].args[:3]
        return vec4(*place.corner, *place.picture.size), vec2(*place.kind), *given

    def weight(leaf: Expr) -> Expr:
        return by_leaf[leaf].args[3] if leaf in by_leaf else const(0.0)

    def weighed(condition: Expr, yes: Expr, no: Expr) -> Expr:
        return where(condition, _where_known(yes, condition, True), _where_known(no, condition, False))

    found = fold_choices(order, args, if_both(where_each))
    assert found is not None
    place, kind, at, duvdx, duvdy = found
    return texture_in_atlas(atlas, place, kind, at, duvdx, duvdy, fold_choices(order, weight, weighed))


def _without_conditions(node: Expr) -> tuple[Expr, ...]:
    return sides(node) or node.args


def _where_known(value: Expr, condition: Expr, holds: bool) -> Expr:
    """A value where a condition is known: a weight that says which part is seen becomes 1."""
    new: dict[Expr, Expr] = {}
    for node in topological([value], _without_conditions):
        if node.op == "where":
            if node.args[0] is condition:
                new[node] = new[node.args[1 if holds else 2]]
            else:
                new[node] = where(node.args[0], *(new[side] for side in sides(node)))
        else:
            new[node] = rebuild(node, tuple(new[arg] for arg in node.args))
    return new[value]
