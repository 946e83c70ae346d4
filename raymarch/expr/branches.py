"""Functions whose value is a choice, as branches: for devices that skip the side that is not taken.

The value of a hard union at a hit is a tree of choices between its parts. Where devices execute both sides of a branch,
each part is evaluated and the values are selected. Here the number of the part is found first, from values of fields
alone, and then one part is evaluated. Parts that call the same function stay together: it is called once, with chosen
arguments.

The number is chosen along the tree, the inner choices first, as the least distance is. So a compiler keeps one number
and one distance of what is done, in place of all distances and conditions until they are read.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from typing import TypeAlias

from raymarch.expr.choices import taken_arguments
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const, make, var
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
"""Operations that a part may compute again, rather than keep, as a multiple of those of all conditions."""

READS = ("texture", "texture_in_atlas", "sample", "sample_slope", "sample_bend", "raw_slope", "fetch")
"""Operations that read memory, or that cost unknown time."""

MOST = 256
"""Maximum number of leaves of a tree."""

PARTED = ("record", "construct")
"""Operations that make a whole of parts."""

UNSEEN = var("u_unseen", FLOAT)
"""A number that is 0, which no compiler knows. A function of `p + UNSEEN` is evaluated again: else compilers would keep
what all conditions computed until a part is chosen, in hundreds of registers."""

NUMBER = var("number_of_part", FLOAT)
"""The number of the chosen part, until a tree is finished."""

KEPT = ("loop", "item", *READS)
"""Operations that are not computed again."""


@dataclass(frozen=True, eq=False, slots=True)
class Branch:
    """`yes` where the condition holds, else `no`.

    first : what is computed before, in order. values : the chosen values, as selections; () if they are not known.
    """

    condition: Expr
    yes: Tree
    no: Tree
    first: tuple[Expr, ...] = ()
    values: tuple[Expr, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class Leaf:
    """The values of one part, or of several that are selected.

    known : the conditions that are known where the leaf is reached. heavy : the costly expressions that it needs, but
    no condition. text : its operations, besides those of conditions. parts : their numbers.
    """

    values: tuple[Expr, ...]
    known: Mapping[Expr, bool]
    heavy: frozenset[Expr] = frozenset()
    text: int = 0
    parts: frozenset[int] = frozenset()


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
    return made.finished(tree, whole, function.params) if isinstance(tree, Branch) else None


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
    """What a tree computes first, its conditions and its values."""
    first = tree.first if isinstance(tree, Branch) else ()
    return [*first, *conditions(tree), *(value for leaf in leaves(tree) for value in leaf.values)]


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
    """The tree of choices at the root of some values.

    asked : what its conditions need. known : of each part, the conditions that are known where it is chosen. number :
    that of the chosen part. first : the numbers in each branch, the inner ones first.
    """

    def __init__(self, values: Sequence[Expr]) -> None:
        self.known: list[Mapping[Expr, bool]] = []
        self.first: list[Expr] = []
        tree = self._grown(tuple(values), {})
        self.conditions = set(conditions(tree))
        self.asked = set(topological(self.conditions))
        self.text = sum(map(_cost, self.asked))
        self.number = self._numbered(tree)
        self.tree = self._weighed(tree) if len(self.known) < MOST else Leaf(tuple(values), {})

    def _grown(self, values: tuple[Expr, ...], known: dict[Expr, bool]) -> Tree:
        chosen = tuple(_chosen(value, known) for value in values)
        condition = next((value.args[0] for value in chosen if value.op == "where"), None)
        if condition is None or len(self.known) >= MOST:
            self.known.append(known)
            return Leaf(chosen, known, parts=frozenset([len(self.known) - 1]))
        yes, no = (self._grown(chosen, {**known, condition: side}) for side in (True, False))
        return Branch(condition, yes, no, values=chosen)

    def _numbered(self, tree: Tree) -> Expr:
        """The number of the part that is chosen in a tree."""
        if isinstance(tree, Leaf):
            return const(float(min(tree.parts)))
        self.first.append(where(tree.condition, self._numbered(tree.yes), self._numbered(tree.no)))
        return self.first[-1]

    def _weighed(self, tree: Tree) -> Tree:
        if isinstance(tree, Branch):
            return replace(self._branch(self._weighed(tree.yes), self._weighed(tree.no)), values=tree.values)
        return self._leaf(tree.values, tree.known, tree.parts)

    def _branch(self, yes: Tree, no: Tree) -> Branch:
        return Branch(self._among(_parts(yes), _parts(no)), yes, no)

    def _among(self, these: Set[int], others: Set[int]) -> Expr:
        """Whether the chosen part is one of these, rather than one of the others."""
        order = sorted(these | others)
        runs = [list(run) for mine, run in groupby(order, these.__contains__) if mine]
        found = None
        for run in runs:
            above = None if run[0] == order[0] else run[0] - 0.5 < NUMBER
            below = None if run[-1] == order[-1] else run[-1] + 0.5 > NUMBER
            inside = below if above is None else above if below is None else above & below
            assert inside is not None
            found = inside if found is None else found | inside
        assert found is not None
        return found

    def _leaf(self, values: tuple[Expr, ...], known: Mapping[Expr, bool], parts: frozenset[int]) -> Leaf:
        def arguments(node: Expr) -> tuple[Expr, ...]:
            return () if node in self.asked else taken_arguments(known, node)

        needed = [node for node in topological(values, arguments) if node not in self.asked]
        costs = {node: _cost(node) for node in needed}
        heavy = frozenset(node for node, cost in costs.items() if _is_heavy(node, cost))
        return Leaf(values, known, heavy, sum(costs.values()), parts)

    def selected(self, tree: Tree) -> Leaf:
        """The tree as a leaf whose values are selected."""
        if isinstance(tree, Leaf):
            return tree
        yes, no = self.selected(tree.yes), self.selected(tree.no)
        selections = tuple(where(tree.condition, a, b) for a, b in zip(yes.values, no.values, strict=True))
        values = tree.values or selections
        return self._leaf(values, dict(yes.known.items() & no.known.items()), yes.parts | no.parts)

    def apart(self, tree: Tree) -> Tree:
        """The tree with branches where the sides need different expressions, and selections elsewhere."""
        if isinstance(tree, Leaf):
            return tree
        sides = [frozenset[Expr]().union(*(leaf.heavy for leaf in leaves(side))) for side in (tree.yes, tree.no)]
        if not sides[0] & sides[1]:
            return self._worth(self._branch(self.apart(tree.yes), self.apart(tree.no)))
        components = _components(tree)
        if len(components) == 1:
            return self.selected(tree)
        *others, last = components
        found = self.apart(self._restricted(tree, last))
        for component in reversed(others):
            found = self._worth(self._branch(self.apart(self._restricted(tree, component)), found))
        return found

    def _restricted(self, tree: Tree, component: set[Leaf]) -> Tree:
        """The tree where only some leaves are reached."""
        found = self._pruned(tree, component)
        assert found is not None
        return found

    def _pruned(self, tree: Tree, component: set[Leaf]) -> Tree | None:
        if isinstance(tree, Leaf):
            return tree if tree in component else None
        yes, no = self._pruned(tree.yes, component), self._pruned(tree.no, component)
        return no if yes is None else yes if no is None else self._branch(yes, no)

    def _worth(self, tree: Branch) -> Tree:
        together = self.selected(tree)
        sides = [sum(leaf.text for leaf in leaves(side)) for side in (tree.yes, tree.no)]
        longest = max(leaf.text for leaf in leaves(tree))
        least = max(WORTH, SHARE * (self.text + together.text))
        spares = together.text - longest >= least and sum(sides) <= TWICE * together.text
        return tree if spares else together

    def finished(self, tree: Branch, whole: Expr, params: Sequence[Expr]) -> Branch:
        """The same tree, with the value of the whole in each leaf.

        Leaves compute again what they need of the conditions, where it is little, at a point that compilers do not know
        to be the same: so it need not be kept. The conditions themselves are not computed again: they would differ.
        """
        moved = {p: p + UNSEEN for p in params if p.type in (VEC2, VEC3)}

        def finish(node: Tree) -> Tree:
            if isinstance(node, Branch):
                (condition,) = substitute([node.condition], {NUMBER: self.number})
                return Branch(condition, finish(node.yes), finish(node.no))
            values = _specialised(node.values, node.known)
            value = rebuild(whole, values) if whole.op in PARTED else values[0]
            return Leaf((self._moved(value, node.parts, moved),), node.known, node.heavy, parts=node.parts)

        made = finish(tree)
        assert isinstance(made, Branch)
        return replace(made, first=tuple(self.first))

    def _moved(self, value: Expr, parts: Set[int], moved: Mapping[Expr, Expr]) -> Expr:
        """A value with conditions told by the number of the part, and the rest computed again, if it is little."""
        told = self._told(value, parts)
        kept = {node.args[0] for node in topological([value]) if node.op == "where"} & self.asked
        now: dict[Expr, Expr] = {**{node: node for node in kept}, **told}
        needed = topological([value], lambda node: () if node in now else node.args)
        both = [node for node in needed if node in self.asked and node not in now]
        again = math.inf if any(node.op in KEPT for node in both) else sum(map(_cost, both))
        now |= moved if again <= AGAIN * self.text else {node: node for node in self.asked - told.keys()}
        chosen = self._selected_by_number(value, sorted(parts), told, now)
        return substitute([chosen], {NUMBER: self.number})[0]

    def _selected_by_number(
        self, value: Expr, parts: Sequence[int], told: Mapping[Expr, Expr], now: Mapping[Expr, Expr]
    ) -> Expr:
        """A value whose choices by conditions that the number tells are choices by the number, as shallow as they can
        be. now : what replaces other expressions."""

        def taken(node: Expr) -> dict[int, Expr]:
            """The value of a choice for each part that reads it."""
            found = {}
            for part in parts:
                known, side = self.known[part], node
                while side not in now and side.op == "where" and side.args[0] in told and side.args[0] in known:
                    side = side.args[1 if known[side.args[0]] else 2]
                if side is not node:
                    found[part] = side
            return found

        def arguments(node: Expr) -> tuple[Expr, ...]:
            if node in now:
                return ()
            chosen = node.op == "where" and node.args[0] in told
            return tuple(dict.fromkeys(taken(node).values())) if chosen else node.args

        new: dict[Expr, Expr] = {}
        for node in topological([value], arguments):
            if node in now:
                new[node] = now[node]
            elif node.op == "where" and node.args[0] in told:
                new[node] = _by_number([(part, new[side]) for part, side in taken(node).items()])
            else:
                new[node] = rebuild(node, tuple(new[arg] for arg in node.args))
        return new[value]

    def _told(self, value: Expr, parts: Set[int]) -> dict[Expr, Expr]:
        """The conditions in a value that the number of the part tells, for all parts that read them."""
        unknown: set[Expr] = set()
        for part in parts:
            known = self.known[part]
            read = topological([value], partial(taken_arguments, known))
            unknown.update(node.args[0] for node in read if node.op == "where" and node.args[0] not in known)
        told = {}
        for condition in self.conditions - unknown:
            yes, no = ({part for part in parts if self.known[part].get(condition) is side} for side in (True, False))
            if yes and no:
                told[condition] = self._among(yes, no)
        return told


def _by_number(choices: Sequence[tuple[int, Expr]]) -> Expr:
    """The value of the chosen part, from those of all parts in order."""
    runs = [(part, value) for k, (part, value) in enumerate(choices) if k == 0 or value is not choices[k - 1][1]]
    if len(runs) == 1:
        return runs[0][1]
    middle = len(runs) // 2
    return where(runs[middle][0] - 0.5 > NUMBER, _by_number(runs[:middle]), _by_number(runs[middle:]))


def _parts(tree: Tree) -> frozenset[int]:
    """The numbers of the parts of a tree."""
    return frozenset[int]().union(*(leaf.parts for leaf in leaves(tree)))


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
