"""The number of arithmetic operations of an expression."""

from __future__ import annotations

from collections.abc import Sequence

from raymarch.expr.node import Expr
from raymarch.expr.walk import topological

FREE = frozenset(
    {"const", "var", "param", "time", "swizzle", "item", "construct", "columns", "within", "record", "field"}
)


def operations(roots: Sequence[Expr], turns: bool = True) -> int:
    """Arithmetic operations of one evaluation; functions count at each call.

    turns : if True, a loop's body counts once per iteration; else once, as in the text.
    """
    costs: dict[object, int] = {}

    def cost(roots: Sequence[Expr]) -> int:
        total = 0
        for node in topological(roots):
            if node.op == "call":
                if node.data not in costs:
                    costs[node.data] = cost(node.data.inner)
                total += costs[node.data]
            elif node.op == "loop":
                total += (node.data.count if turns else 1) * cost(node.data.inner)
            elif node.op not in FREE:
                total += max(a.type.size for a in node.args) if node.args else 1
        return total

    return cost(roots)
