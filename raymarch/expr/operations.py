"""The number of arithmetic operations of an expression."""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.walk import topological

FREE = frozenset(
    {
        *("const", "var", "param", "time", "swizzle", "item", "construct", "columns", "record", "field"),
        *("within", "stop_gradient"),
    }
)


def operations(roots: Sequence[Expr], turns: bool = True) -> int:
    """Arithmetic operations of one evaluation; functions count at each call.

    turns : if True, a loop's body counts once per iteration; else once, as in the text.
    """
    outside, inside = _counted(roots, turns)
    return outside + sum(inside)


def operations_of(definition: Function) -> int:
    """Operations of one call, remembered."""
    outside, inside = _counted_once(definition, True)
    return outside + sum(inside)


def straight_lines(roots: Sequence[Expr]) -> list[int]:
    """Operations of each part of the text without branches, with functions written out at each call: the text outside
    of loops, and the body of each loop."""
    outside, inside = _counted(roots, False)
    return [outside, *inside]


READING = frozenset({"sample", "sample_slope", "sample_bend", "fetch"})
"""Operations that read a texel. Those of the same data at the same place read one together."""


def reads(roots: Sequence[Expr]) -> int:
    """Texels that one evaluation reads."""
    count, places = 0, set()
    for node in topological(roots):
        if node.op == "call":
            count += _reads_once(node.data)
        elif node.op == "loop":
            count += node.data.count * reads(node.data.inner)
        elif node.op in READING:
            places.add((node.data, *node.args))
    return count + len(places)


def _reads_once(definition: Function) -> int:
    return definition.once("reads", lambda: reads(definition.inner))


def _counted(roots: Sequence[Expr], turns: bool) -> tuple[int, list[int]]:
    """Operations outside of loops, and in each loop."""
    outside, inside = 0, list[int]()
    for node in topological(roots):
        if node.op == "call":
            count, loops = _counted_once(node.data, turns)
            outside += count
            inside += loops
        elif node.op == "loop":
            count, loops = _counted(node.data.inner, turns)
            times = node.data.count if turns else 1
            inside += [times * n for n in (count, *loops)]
        elif node.op not in FREE:
            outside += max([a.type.size for a in node.args]) if node.args else 1
    return outside, inside


def _counted_once(definition: Function, turns: bool) -> tuple[int, list[int]]:
    return definition.once(("operations", turns), lambda: _counted(definition.inner, turns))
