"""Long folds as loops, for devices whose compilers write out all calls: `nearer(f(row 11), nearer(f(row 10), ...))`.

A polygon of twelve corners is twelve calls of one function, which a compiler inlines at each place that evaluates the
field. As a loop over an array of constants the text is that of one call. The values are the same, bit for bit, because
the order is.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import count, pairwise
from typing import TypeAlias

import numpy as np

from raymarch.expr.branches import Branch, Leaf, Tree, roots_of
from raymarch.expr.function import close_loop
from raymarch.expr.node import Expr, const, construct, make, simplify, swizzle, var
from raymarch.expr.operations import operations
from raymarch.expr.pieces import literal
from raymarch.expr.tables import Table
from raymarch.expr.types import FLOAT, STATE
from raymarch.expr.walk import rebuild, substitute, topological

FEWEST = 6
"""Least number of turns of such a loop."""

LONGEST = 256
"""Largest number of rows of four numbers in an array of constants: some drivers refuse much longer ones."""

FARTHEST = 1e30
"""A distance farther than all."""

SPARED = 100
"""Least number of operations of the text that a loop must spare."""

Shape: TypeAlias = Hashable

ENDS = {"min": FARTHEST, "max": -FARTHEST}
"""Folds that may take their values in any order, and the value before the first."""

NOTHING = var("nothing", FLOAT)
"""In place of the value before a step, where there is none."""


class Rows(Table):
    """A table that is an array of constants in the text, four numbers in a row."""

    __slots__ = ()

    kind = "rows"

    @property
    def declaration(self) -> str:
        """The text of the array."""
        rows = [f"    vec4({', '.join(map(literal, row))})" for row in self.values]
        return f"const vec4 {self.name}[{len(rows)}] = vec4[](\n" + ",\n".join(rows) + ");"


@dataclass(frozen=True, slots=True)
class _Link:
    """One step of a fold: what it is but for its constants, and these in order."""

    shape: Shape
    constants: tuple[Expr, ...]


def rolled(body: Expr) -> Expr:
    """The body of a function with long folds over rows of constants as loops."""
    if operations([body]) < SPARED:
        return body
    inner: set[Expr] = set()
    for node in reversed(topological([body])):
        if node in inner:
            continue
        chain = _chain(node)
        made = None
        if len(chain) > FEWEST:
            inner.update(chain)
            made = _chain_as_loop(chain)
        elif node.op in ENDS and node.type is FLOAT:
            folds = _folds(node)
            inner.update(folds)
            made = _tree_as_loops(node.op, [e for fold in folds for e in fold.args if e.op != node.op])
        if made is None:
            continue
        (new,) = substitute([body], {node: made})
        if operations([body], turns=False) - operations([new], turns=False) >= SPARED:
            return rolled(new)
    return body


def _folds(node: Expr) -> list[Expr]:
    """The folds of one operation, arguments first, of which an expression is the last."""
    return [e for e in topological([node], lambda e: e.args if e.op == node.op else ()) if e.op == node.op]


def rolled_tree(tree: Tree) -> Tree:
    """The same of functions that return from branches: all conditions and values together, so that they share loops."""
    roots = roots_of(tree)
    new = dict(zip(roots, rolled(make("record", STATE, tuple(roots))).args, strict=True))

    def changed(node: Tree) -> Tree:
        if isinstance(node, Leaf):
            return replace(node, values=tuple(map(new.__getitem__, node.values)))
        first = tuple(map(new.__getitem__, node.first))
        return Branch(new[node.condition], changed(node.yes), changed(node.no), first)

    return changed(tree)


def _tree_as_loops(op: str, leaves: Sequence[Expr]) -> Expr | None:
    """The least or the largest of some values: of those that are alike in a loop. None if few are alike."""
    alike: dict[Hashable, list[tuple[Expr, tuple[Expr, ...]]]] = {}
    for leaf in leaves:
        link = _link(leaf, NOTHING) if leaf.op == "call" else None
        alike.setdefault(link.shape if link else leaf, []).append((leaf, link.constants if link else ()))
    apart, loops = list[Expr](), list[Expr]()
    for group in alike.values():
        of = group[0][0]

        def step(state: Expr, held: dict[int, Expr], of: Expr = of) -> Expr:
            return simplify(op, FLOAT, (_with(of, NOTHING, state, held), state))

        loop = _as_loop([row for _, row in group], const(ENDS[op]), step) if len(group) >= FEWEST else None
        if loop is None:
            apart += [leaf for leaf, _ in group]
        else:
            loops.append(loop)
    return reduce(lambda x, y: simplify(op, FLOAT, (x, y)), [*apart, *loops]) if loops else None


def paired(body: Expr) -> Expr:
    """A pair of minima as a minimum of pairs, so that what both read of an operand is not kept until the last."""
    if body.op != "construct" or len(body.args) != 2:
        return body
    first, second = body.args
    if first.op != "min" or second.op != "min" or first.type is not FLOAT or second.type is not FLOAT:
        return body
    sides = [paired(construct(a, b)) for a, b in zip(first.args, second.args, strict=True)]
    return simplify("min", body.type, tuple(sides))


def _chain(last: Expr) -> list[Expr]:
    """The values of a fold, the last first: as many steps as are alike, then the value before them."""
    found, shape = [last], None
    while True:
        before = _before(found[-1])
        if before is None:
            return found
        link = _link(found[-1], before)
        if link is None or (shape is not None and link.shape != shape):
            return found
        shape = link.shape
        found.append(before)


def _before(node: Expr) -> Expr | None:
    """The value that a step of a fold changes: for a choice or a minimum, the last argument of the same type."""
    if node.op not in ("where", "min", "max"):
        return None
    return node.args[-1] if node.args[-1].type is node.type and node.args[-1].op not in ("const", "var") else None


def _link(node: Expr, before: Expr) -> _Link | None:
    """A step from the value `before` to `node`; None if it reads something of a loop."""
    numbers: dict[Expr, int] = {before: -1}
    shape: list[Hashable] = []
    constants: list[Expr] = []
    for part in topological([node], lambda e: () if e is before or e.op == "const" else e.args):
        if part is before or part.op == "const":
            continue
        if part.op in ("loop", "item"):
            return None
        below: list[Hashable] = []
        for arg in part.args:
            if arg.op == "const" and arg.type.size <= 4 and not arg.type.is_matrix and arg is not before:
                below.append(arg.type)
                constants.append(arg)
            else:
                below.append(numbers.get(arg, arg))
        numbers[part] = len(numbers)
        shape.append((part.op, part.type, part.data, part if not part.args else None, tuple(below)))
    return _Link(tuple(shape), tuple(constants))


def _chain_as_loop(chain: Sequence[Expr]) -> Expr | None:
    """A fold as a loop over rows; None if rows would be too many."""
    found = [_link(node, before) for node, before in pairwise(chain)][::-1]
    constants = [link.constants for link in found if link is not None]
    first, opening = chain[-1], _opening(chain)
    if opening is not None:
        constants, first = [opening, *constants], const(FARTHEST)
    return _as_loop(constants, first, lambda state, held: _with(chain[0], chain[1], state, held))


def _as_loop(
    constants: Sequence[Sequence[Expr]], first: Expr, step: Callable[[Expr, dict[int, Expr]], Expr]
) -> Expr | None:
    """A loop over rows of constants; None if they are too many, or all alike.

    first : the state before. step : the state after a row, from that before, and what replaces constants by position.
    """
    varying = [k for k, column in enumerate(zip(*constants, strict=True)) if len(set(column)) > 1]
    if not varying or len(constants) > LONGEST:
        return None
    numbers = np.array([np.concatenate([np.ravel(row[k].data) for k in varying]) for row in constants], np.float32)
    filled = np.pad(numbers, ((0, 0), (0, -numbers.shape[1] % 4)))
    tables = [Rows(filled[:, at : at + 4], "rows of constants") for at in range(0, filled.shape[1], 4)]
    name = "rolled " + " ".join(table.key for table in tables)
    index, state = var(f"{name} index", FLOAT), var(f"{name} state", first.type)
    flat = [swizzle(make("fetch", table.type, (index,), table), part) for table in tables for part in "xyzw"]
    held: dict[int, Expr] = {}
    for k in varying:
        size = constants[0][k].type.size
        held[k] = flat[0] if size == 1 else construct(*flat[:size])
        del flat[:size]
    return close_loop(len(constants), index, (state,), (step(state, held),), None, (first,), kept=True)[0]


def _opening(chain: Sequence[Expr]) -> tuple[Expr, ...] | None:
    """The constants of the first value, where it is one that the steps compare, and nearer than what is far away."""
    node, before = chain[0], chain[1]
    if node.op != "where" or node.args[0].op != "lt":
        return None
    condition, value, _ = node.args
    sizes = condition.args
    if not all(size.op == "abs" and size.args == (of,) for size, of in zip(sizes, (value, before), strict=True)):
        return None
    one, first = _link(value, before), _link(chain[-1], before)
    return first.constants if one is not None and first is not None and one.shape == first.shape else None


def _with(node: Expr, before: Expr, state: Expr, held: dict[int, Expr]) -> Expr:
    """A step with the state in place of the value before, and some constants replaced by their position."""
    new: dict[Expr, Expr] = {before: state}
    position = count()
    for part in topological([node], lambda e: () if e is before or e.op == "const" else e.args):
        if part is before or part.op == "const":
            continue
        args = []
        for arg in part.args:
            if arg.op == "const" and arg.type.size <= 4 and not arg.type.is_matrix and arg is not before:
                args.append(held.get(next(position), arg))
            else:
                args.append(new.get(arg, arg))
        new[part] = rebuild(part, tuple(args))
    return new[node]
