"""Where values are read for the last time, so that a text computes early what ends more than it begins.

Compilers of graphics cards keep the order of a text. A value in a variable, read by an expression that is written at
the end, stays in a register until then.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Mapping, Sequence
from fractions import Fraction

from raymarch.expr.node import Expr


class LastReads:
    """The variables that each unnamed expression reads.

    uses : the number of readers of each expression.
    """

    def __init__(self, uses: Mapping[Expr, int]) -> None:
        self.uses = uses
        self._read: dict[Expr, dict[Expr, Fraction]] = {}

    def ends(self, node: Expr, names: Container[Expr]) -> bool:
        """True if nothing reads the variables of an expression after it, and they are larger than its value.

        To be asked of each expression once, after its arguments. names : the expressions that have variables.
        """
        found: dict[Expr, Fraction] = {}
        for arg in node.args:
            if arg in names:
                read = {arg: Fraction(1)} if arg.args else {}
            else:  # what several read is written, and reads, in each
                read = {variable: share / self.uses[arg] for variable, share in self._read.get(arg, {}).items()}
            for variable, share in read.items():
                found[variable] = found.get(variable, Fraction(0)) + share
        ended = sum(_size(variable) for variable, share in found.items() if share == self.uses[variable])
        ends = ended > _size(node)
        self._read[node] = {} if ends else found
        return ends


def eager(order: Sequence[Expr], arguments: Callable[[Expr], tuple[Expr, ...]]) -> list[Expr]:
    """The same order, but with each expression as soon as it is known that ends as much as it begins.

    order : arguments before their readers. arguments : what an expression reads of the order.
    """
    readers: dict[Expr, list[Expr]] = {}
    left = {node: len(set(arguments(node))) for node in order}
    unread: Counter[Expr] = Counter()
    for node in order:
        for arg in dict.fromkeys(arguments(node)):
            readers.setdefault(arg, []).append(node)
            unread[arg] += 1
    found: dict[Expr, None] = {}

    def ends_enough(node: Expr) -> bool:
        ended = [arg for arg in set(arguments(node)) if unread[arg] == 1 and arg.args]
        return sum(map(_size, ended)) >= _size(node)

    for first in order:
        waiting = [first] if first not in found else []
        while waiting:
            node = waiting.pop()
            if node in found:
                continue
            found[node] = None
            for arg in set(arguments(node)):
                unread[arg] -= 1
            ready = []
            for reader in readers.get(node, ()):
                left[reader] -= 1
            for arg in (node, *arguments(node)):  # readers of arguments may now be the last
                ready += [r for r in readers.get(arg, ()) if r not in found and not left[r] and ends_enough(r)]
            waiting += dict.fromkeys(reversed(ready))
    return list(found)


def _size(node: Expr) -> int:
    """Numbers of a value. A condition is kept apart, for all pixels at once."""
    if node.type.fields:
        return sum(of.size for _, of in node.type.fields)
    return 0 if node.type.name == "bool" else node.type.size ** (2 if node.type.is_matrix else 1)
