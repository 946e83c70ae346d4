"""Long folds as loops, for devices whose compilers write out all calls: `nearer(f(row 11), nearer(f(row 10), ...))`.

A polygon of twelve corners is twelve calls of one function, which a compiler inlines at each place that evaluates the
field. As a loop over an array of constants the text is that of one call. The values are the same, bit for bit, because
the order is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence, Set
from dataclasses import replace
from functools import reduce
from itertools import pairwise

import numpy as np

from raymarch.expr.alike import FEWEST, LONGEST, Alike, groups_of, link, with_rows
from raymarch.expr.argmin import FARTHEST, SPARED, numbered
from raymarch.expr.branches import Branch, Leaf, Tree, roots_of
from raymarch.expr.function import close_loop
from raymarch.expr.node import Expr, const, construct, make, simplify, var
from raymarch.expr.operations import operations
from raymarch.expr.types import FLOAT, STATE, VEC2
from raymarch.expr.walk import substitute, topological

ENDS = {"min": FARTHEST, "max": -FARTHEST}
"""Folds that may take their values in any order, and the value before the first."""


def rolled(body: Expr) -> Expr:
    """The body of a function with long folds over rows of constants as loops."""
    if operations([body]) < SPARED:
        return body
    inner: set[Expr] = set()
    order = topological([body])
    shared = {node for node, n in Counter(arg for node in order for arg in node.args).items() if n > 1}
    for node in reversed(order):
        if node in inner:
            continue
        chain = _chain(node)
        made = None
        if len(chain) > FEWEST:
            inner.update(chain)
            made = _chain_as_loop(chain)
        elif node.op in ENDS and node.type in (FLOAT, VEC2):
            folds = _folds(node, shared)
            inner.update(folds)
            made = _tree_as_loops(node.op, [e for fold in folds for e in fold.args if e not in folds])
        if made is None:
            continue
        (new,) = substitute([body], {node: made})
        if operations([body], turns=False) - operations([new], turns=False) >= SPARED:
            return rolled(new)
    return body


def _folds(last: Expr, shared: Set[Expr]) -> list[Expr]:
    """The steps of a fold, the first ones first. shared : what several read, which is no step of another's fold."""

    def is_step(node: Expr) -> bool:
        return node is last or (node.op == last.op and node not in shared)

    return list(filter(is_step, topological([last], lambda node: node.args if is_step(node) else ())))


def rolled_tree(tree: Tree) -> Tree:
    """The same of functions that return from branches: all conditions and values together, so that they share loops."""
    whole = replace(tree, first=tree.first[-1:]) if isinstance(tree, Branch) else tree
    roots = roots_of(whole)
    told = numbered(roots)
    if told != roots:  # the steps to the number of the part are gone
        tree = _with(whole, roots, told)
    roots = roots_of(tree)
    return _with(tree, roots, rolled(make("record", STATE, tuple(roots))).args)


def _with(tree: Tree, roots: Sequence[Expr], new: Sequence[Expr]) -> Tree:
    """The tree with other expressions. roots : those of `roots_of`."""
    now = dict(zip(roots, new, strict=True))

    def changed(node: Tree) -> Tree:
        if isinstance(node, Leaf):
            return replace(node, values=tuple(map(now.__getitem__, node.values)))
        return Branch(now[node.condition], changed(node.yes), changed(node.no), tuple(map(now.__getitem__, node.first)))

    return changed(tree)


def _tree_as_loops(op: str, leaves: Sequence[Expr]) -> Expr | None:
    """The least or the largest of some values: of those that are alike in a loop. None if none are."""
    groups = groups_of(list(dict.fromkeys(leaves)))
    if not groups:
        return None
    inside = {value for group in groups for value in group.values}
    found = [leaf for leaf in dict.fromkeys(leaves) if leaf not in inside]
    end = const(np.full(leaves[0].type.shape, ENDS[op]))
    for group in groups:
        index, state = _variables(group)
        step = simplify(op, state.type, (group.at(index), state))
        found += close_loop(len(group.values), index, (state,), (step,), None, (end,), kept=True)
    return reduce(lambda x, y: simplify(op, x.type, (x, y)), found)


def _variables(group: Alike) -> tuple[Expr, Expr]:
    """The index and the state of a loop over values that are alike."""
    return var("index of the alike", FLOAT), var("least of the alike", group.values[0].type)


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
        step = link(found[-1], before)
        if step is None or (shape is not None and step.shape != shape):
            return found
        shape = step.shape
        found.append(before)


def _before(node: Expr) -> Expr | None:
    """The value that a step of a fold changes: for a choice or a minimum, the last argument of the same type."""
    if node.op not in ("where", "min", "max"):
        return None
    return node.args[-1] if node.args[-1].type is node.type and node.args[-1].op not in ("const", "var") else None


def _chain_as_loop(chain: Sequence[Expr]) -> Expr | None:
    """A fold as a loop over rows; None if rows would be too many, or all alike."""
    found = [link(node, before) for node, before in pairwise(chain)][::-1]
    rows = [of.constants for of in found if of is not None]
    first, opening = chain[-1], _opening(chain)
    if opening is not None:
        rows, first = [opening, *rows], const(FARTHEST)
    if len(set(rows)) == 1 or len(rows) > LONGEST:
        return None
    index, state = var("index of a fold", FLOAT), var("state of a fold", first.type)
    step = with_rows(chain[0], chain[1], rows, index, state)
    return close_loop(len(rows), index, (state,), (step,), None, (first,), kept=True)[0]


def _opening(chain: Sequence[Expr]) -> tuple[Expr, ...] | None:
    """The constants of the first value, where it is one that the steps compare, and nearer than what is far away."""
    node, before = chain[0], chain[1]
    if node.op != "where" or node.args[0].op != "lt":
        return None
    condition, value, _ = node.args
    sizes = condition.args
    if not all(size.op == "abs" and size.args == (of,) for size, of in zip(sizes, (value, before), strict=True)):
        return None
    one, first = link(value, before), link(chain[-1], before)
    return first.constants if one is not None and first is not None and one.shape == first.shape else None
