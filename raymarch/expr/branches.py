"""Functions whose value is a choice, as branches: for devices that skip the side that is not taken.

The value of a hard union at a hit is a tree of choices between its parts. Where devices execute both sides of a branch,
each part is evaluated and the values are selected. Here the conditions are evaluated first, from values of fields
alone, and then one part. Parts that call the same function stay together: it is called once, with chosen arguments.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

from raymarch.expr.choices import taken_arguments
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, make, var
from raymarch.expr.operations import FREE, operations, straight_lines
from raymarch.expr.partials import zero
from raymarch.expr.types import FLOAT, VEC2, VEC3
from raymarch.expr.vocabulary import where
from raymarch.expr.walk import find, rebuild, rewrite, substitute, topological

WORTH = 24
"""Least number of operations that a branch must spare: GPUs select from fewer without one."""

SHARE = 0.08
"""Share of the operations of all conditions and sides that a branch must spare."""

TWICE = 1.25
"""Maximum factor by which a branch may lengthen the text of its sides, because both contain what they share."""

LARGEST = 0.5
"""Share of all operations from which a gradient is evaluated before the choice: its value is needed anyway."""

AGAIN = 0.5
"""Operations that the sides on a path may compute again, rather than keep, as a multiple of those of all conditions."""

CHOSEN = 400
"""Maximum number of operations of the arguments of a call that are computed again once they are chosen."""

READS = ("texture", "texture_in_atlas", "sample", "sample_slope", "raw_slope", "fetch")
"""Operations that read memory, or that cost unknown time."""

MOST = 256
"""Maximum number of leaves of a tree."""

PARTED = ("record", "construct")
"""Operations that make a whole of parts."""

UNSEEN = var("u_unseen", FLOAT)
"""A number that is 0, which no compiler knows. A function of `p + UNSEEN` is evaluated again: else compilers would keep
what all conditions computed until a part is chosen, in hundreds of registers."""


@dataclass(frozen=True, eq=False, slots=True)
class Branch:
    """`yes` where the condition holds, else `no`."""

    condition: Expr
    yes: Tree
    no: Tree


@dataclass(frozen=True, eq=False, slots=True)
class Leaf:
    """The values of one part, or of several that are selected.

    known : the conditions that are known where the leaf is reached. heavy : the costly expressions that it needs, but
    no condition. text : its operations, besides those of conditions.
    """

    values: tuple[Expr, ...]
    known: Mapping[Expr, bool]
    heavy: frozenset[Expr] = frozenset()
    text: int = 0


Tree: TypeAlias = Branch | Leaf


def branched(function: Function) -> Branch | None:
    """The body of a function as branches; None if none is worth it. Leaves have one value: that of the body.

    Only functions that are called at hits have branches: those that return structs or gradients.
    """
    if not function.type.fields and function.stated.gradient_of is None:
        return None
    gradients = {call: call.data for call in find([function.body], "call") if call.data.stated.gradient_of is not None}
    total = sum(map(_text, gradients.values()))
    shared = {call for call, of in gradients.items() if _text(of) > LARGEST * total}
    others = [of for call, of in gradients.items() if call not in shared]
    spared = sum(_text(of) - _text(of.stated.gradient_of) for of in others)
    if others and spared <= max(map(_text, others)):
        shared.update(gradients)
    whole = _fields_first(function.body, shared)
    made = _Made(whole.args if whole.op in PARTED else (whole,))
    tree = made.apart(made.tree) if isinstance(made.tree, Branch) else made.tree
    return _finished(tree, whole, function.params) if isinstance(tree, Branch) else None


def leaves(tree: Tree) -> Iterator[Leaf]:
    """The leaves of a tree, from left to right."""
    pending = [tree]
    while pending:
        node = pending.pop()
        if isinstance(node, Leaf):
            yield node
        else:
            pending += [node.no, node.yes]


def conditions(tree: Tree) -> list[Expr]:
    """The conditions of a tree, the outer ones first."""
    found, pending = list[Expr](), [tree]
    while pending:
        node = pending.pop()
        if isinstance(node, Branch):
            found.append(node.condition)
            pending += [node.no, node.yes]
    return found


def roots_of(tree: Tree) -> list[Expr]:
    """The conditions and values of a tree."""
    return [*conditions(tree), *(value for leaf in leaves(tree) for value in leaf.values)]


def _text(function: Function) -> int:
    """Operations of the text of a function, with those that it calls."""
    return function.once("text of branches", lambda: sum(straight_lines(function.inner)))


def _fields_first(body: Expr, shared: Set[Expr]) -> Expr:
    """The body with the values of fields taken from their own functions, not from those of their gradients. shared :
    the calls that keep theirs."""

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        if node.op == "stop_gradient":
            return args[0]
        if node.op == "sub" and args[0] is args[1]:  # a value whose derivative was wanted, without its value
            return zero(node.type)
        call = args[0] if node.op == "swizzle" else None
        plain: Function | None = call.data.stated.gradient_of if call is not None and call.op == "call" else None
        if call is None or plain is None or node.args[0] in shared or node.data != "xyzw"[call.type.size - 1]:
            return rebuild(node, args)
        return make("call", plain.type, call.args, plain)

    return rewrite([body], rule)[body]


def _specialised(values: Sequence[Expr], known: Mapping[Expr, bool]) -> tuple[Expr, ...]:
    """The values where some conditions are known."""
    arguments = partial(taken_arguments, known)
    new: dict[Expr, Expr] = {}
    for node in topological(values, arguments):
        args = tuple(new[arg] for arg in arguments(node))
        new[node] = args[0] if node.op == "where" and len(args) == 1 else rebuild(node, args)
    return tuple(new[value] for value in values)


class _Made:
    """The tree of choices at the root of some values. asked : what its conditions need."""

    def __init__(self, values: Sequence[Expr]) -> None:
        self.count = 0
        self.asked: set[Expr] = set()
        tree = self._grown(tuple(values), {})
        self.asked = set(topological(conditions(tree)))
        self.text = sum(map(_cost, self.asked))
        self.tree = self._weighed(tree) if self.count < MOST else Leaf(tuple(values), {})

    def _grown(self, values: tuple[Expr, ...], known: dict[Expr, bool]) -> Tree:
        chosen = tuple(_chosen(value, known) for value in values)
        condition = next((value.args[0] for value in chosen if value.op == "where"), None)
        if condition is None or self.count >= MOST:
            self.count += 1
            return Leaf(chosen, known)
        yes, no = (self._grown(chosen, {**known, condition: side}) for side in (True, False))
        return Branch(condition, yes, no)

    def _weighed(self, tree: Tree) -> Tree:
        if isinstance(tree, Branch):
            return Branch(tree.condition, self._weighed(tree.yes), self._weighed(tree.no))
        return self._leaf(tree.values, tree.known)

    def _leaf(self, values: tuple[Expr, ...], known: Mapping[Expr, bool]) -> Leaf:
        def arguments(node: Expr) -> tuple[Expr, ...]:
            return () if node in self.asked else taken_arguments(known, node)

        needed = [node for node in topological(values, arguments) if node not in self.asked]
        costs = {node: _cost(node) for node in needed}
        heavy = frozenset(node for node, cost in costs.items() if _is_heavy(node, cost))
        return Leaf(values, known, heavy, sum(costs.values()))

    def selected(self, tree: Tree) -> Leaf:
        """The tree as a leaf whose values are selected."""
        if isinstance(tree, Leaf):
            return tree
        yes, no = self.selected(tree.yes), self.selected(tree.no)
        values = tuple(where(tree.condition, a, b) for a, b in zip(yes.values, no.values, strict=True))
        return self._leaf(values, dict(yes.known.items() & no.known.items()))

    def apart(self, tree: Tree) -> Tree:
        """The tree with branches where the sides need different expressions, and selections elsewhere."""
        if isinstance(tree, Leaf):
            return tree
        sides = [frozenset[Expr]().union(*(leaf.heavy for leaf in leaves(side))) for side in (tree.yes, tree.no)]
        if not sides[0] & sides[1]:
            return self._worth(Branch(tree.condition, self.apart(tree.yes), self.apart(tree.no)))
        parts = _components(tree)
        if len(parts) == 1:
            return self.selected(tree)
        *others, last = parts
        found = self.apart(_restricted(tree, last))
        for part in reversed(others):
            condition = _condition(tree, part)
            assert isinstance(condition, Expr)
            found = self._worth(Branch(condition, self.apart(_restricted(tree, part)), found))
        return found

    def _worth(self, tree: Branch) -> Tree:
        together = self.selected(tree)
        sides = [sum(leaf.text for leaf in leaves(side)) for side in (tree.yes, tree.no)]
        longest = max(leaf.text for leaf in leaves(tree))
        least = max(WORTH, SHARE * (self.text + together.text))
        spares = together.text - longest >= least and sum(sides) <= TWICE * together.text
        return tree if spares else together


def _chosen(value: Expr, known: Mapping[Expr, bool]) -> Expr:
    while value.op == "where" and value.args[0] in known:
        value = value.args[1 if known[value.args[0]] else 2]
    return value


def _cost(node: Expr) -> int:
    """Operations of an expression, without its arguments."""
    if node.op == "call":
        return _text(node.data)
    if node.op == "loop":
        return operations(node.data.inner, turns=False)
    return 0 if node.op in FREE else max([arg.type.size for arg in node.args], default=1)


def _is_heavy(node: Expr, cost: int) -> bool:
    return node.op in READS or (cost >= WORTH and node.op in ("call", "loop"))


def _components(tree: Tree) -> list[set[Leaf]]:
    """The leaves, those together that share a heavy expression. Leaves without any are one part, the last."""
    parts: list[tuple[set[Leaf], set[Expr]]] = []
    light: set[Leaf] = set()
    for leaf in leaves(tree):
        if not leaf.heavy:
            light.add(leaf)
            continue
        joined: tuple[set[Leaf], set[Expr]] = ({leaf}, set(leaf.heavy))
        for other in [part for part in parts if part[1] & leaf.heavy]:
            parts.remove(other)
            joined = (joined[0] | other[0], joined[1] | other[1])
        parts.append(joined)
    return [found for found, _ in parts] + ([light] if light else [])


def _restricted(tree: Tree, part: set[Leaf]) -> Tree:
    """The tree where only some leaves are reached."""
    found = _pruned(tree, part)
    assert found is not None
    return found


def _pruned(tree: Tree, part: set[Leaf]) -> Tree | None:
    if isinstance(tree, Leaf):
        return tree if tree in part else None
    yes, no = _pruned(tree.yes, part), _pruned(tree.no, part)
    return no if yes is None else yes if no is None else Branch(tree.condition, yes, no)


def _condition(tree: Tree, part: set[Leaf]) -> Expr | bool:
    """The condition under which some leaves are reached."""
    if isinstance(tree, Leaf):
        return tree in part
    yes, no, c = _condition(tree.yes, part), _condition(tree.no, part), tree.condition
    if isinstance(yes, bool) and isinstance(no, bool):
        return yes if yes == no else c if yes else ~c
    if isinstance(no, bool):
        return ~c | yes if no else c & yes
    if isinstance(yes, bool):
        return c | no if yes else ~c & no
    return (c & yes) | (~c & no)


class _Finished:
    """The same tree, with the value of the whole in each leaf.

    Sides compute again what they need of the conditions above, where it is little, at a point that compilers do not
    know to be the same: so it need not be kept. The conditions themselves are not computed again: they would differ.
    """

    def __init__(self, tree: Tree, whole: Expr, params: Sequence[Expr]) -> None:
        self.whole = whole
        self.atoms = {node.args[0] for node in topological(roots_of(tree)) if node.op == "where"} | set(
            conditions(tree)
        )
        self.points = [p for p in params if p.type in (VEC2, VEC3)]

    def tree(self, node: Tree) -> Tree:
        """The tree with the values of leaves where the conditions of their paths are known."""
        if isinstance(node, Branch):
            return Branch(node.condition, self.tree(node.yes), self.tree(node.no))
        values = _specialised(node.values, node.known)
        return Leaf((rebuild(self.whole, values) if self.whole.op in PARTED else values[0],), node.known, node.heavy)

    def seen(self, node: Tree, now: Mapping[Expr, Expr], above: Set[Expr], budget: float) -> Tree:
        """The tree with expressions replaced. now : what replaces each. above : what is computed before it.
        budget : operations that may be computed again."""
        if isinstance(node, Leaf):
            return self._leaf(node, now)
        here = set(topological([node.condition]))
        known = {**now, **{atom: substitute([atom], now)[0] for atom in self.atoms & here}}
        sides = []
        for side in (node.yes, node.no):
            cost = self._again(side, known.keys() - self.points, above | here)
            moved, left = (self._moved(known), budget - cost) if cost <= budget else (known, budget)
            sides.append(self.seen(side, moved, set() if cost <= budget else above | here, left))
        return Branch(substitute([node.condition], now)[0], *sides)

    def _moved(self, now: Mapping[Expr, Expr]) -> dict[Expr, Expr]:
        return {**now, **{p: now.get(p, p) + UNSEEN for p in self.points}}

    def _again(self, side: Tree, kept: Set[Expr], above: Set[Expr]) -> float:
        """Operations that a side would compute again of the conditions above; infinite if they are not arithmetic."""
        needed = topological(roots_of(side), lambda node: () if node in kept else node.args)
        both = [node for node in needed if node in above and node not in kept]
        if any(node.op in ("loop", "item", *READS) for node in both):
            return math.inf
        return sum(map(_cost, both))

    def _leaf(self, leaf: Leaf, now: Mapping[Expr, Expr]) -> Leaf:
        """The leaf, where calls of chosen arguments compute these again."""
        order = topological(leaf.values)
        asked = {node.args[0]: substitute([node.args[0]], now)[0] for node in order if node.op == "where"}
        moved, calls = {**self._moved(now), **asked}, dict[Expr, Expr]()
        for node in order:
            merged = node in leaf.heavy and node.op == "call" and find(node.args, "where")
            if merged and not find(node.args, "loop", *READS) and operations(node.args) <= CHOSEN:
                calls[node] = make("call", node.type, tuple(substitute(node.args, moved)), node.data)
        return Leaf(tuple(substitute(leaf.values, {**now, **calls})), leaf.known)


def _finished(tree: Branch, whole: Expr, params: Sequence[Expr]) -> Branch:
    """The tree with the value of the whole in each leaf; see `_Finished`."""
    made = _Finished(tree, whole, params)
    start = made.tree(tree)
    budget = AGAIN * sum(map(_cost, topological(conditions(tree))))
    found = made.seen(start, {}, set(), budget)
    assert isinstance(found, Branch)
    return found
