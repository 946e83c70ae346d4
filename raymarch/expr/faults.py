"""The fault reading: from expressions to the expression of their first fault.

The result is a vec2: a code, 0 without a fault, and the value at fault. Faults are:

- a value that is not finite, where an operation could hide it (`min`, a comparison, `exp`, ...) or where it leaves its
  node;
- an argument outside of its operation's domain by more than rounding errors. The vocabulary replaces it by the nearest
  legal value, so all values stay finite, but the replacement may be unintended. An explicit replacement is no fault,
  such as the root of `max(x, 0)`.

The side that a `where` does not take is ignored. `normalize(0)` and `atan2(0, 0)` are no faults: on an axis every
direction is as good as the others. A fault counts at its origin only, not in values computed from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple, TypeAlias

import raymarch.expr.vocabulary as v
from raymarch.expr.domains import HIDING, NOTHING, merged, not_finite, outside
from raymarch.expr.function import Function, Loop, close_loop
from raymarch.expr.node import Expr, construct, make, var
from raymarch.expr.types import STATE, VEC2
from raymarch.expr.walk import find, rebuild, topological

Role: TypeAlias = Literal["value", "point", "gradient"]


class Passage(NamedTuple):
    """The data of a `probe`: it marks a value that one node passes to another; its value is its first argument.

    role : kind of the value. site : number of the node that computed it, from 1. other : number of the node that
    receives it; 0 for none.
    """

    role: Role
    site: int
    other: int


KINDS: Final = (
    *("", "a value that is not finite", "a point that is not finite", "a gradient that is not finite"),
    *("a division by 0", "mod by 0", "the root of a negative number", "the logarithm of 0 or less"),
    *("a power of a negative number", "the arc sine of more than 1", "the arc cosine of more than 1"),
    *("a smoothstep without width", "a colour that is not finite"),
)
"""Kinds of faults. A code is an index into these, plus STRIDE times the number of the node."""

STRIDE: Final = 32

COLOR: Final = len(KINDS) - 1

_KIND_OF_ROLE = {"value": 1, "point": 2, "gradient": 3}
_KIND_OF_DOMAIN = {
    "div": 4,
    "mod": 5,
    "sqrt": 6,
    "log": 7,
    "log2": 7,
    "pow": 8,
    "asin": 9,
    "acos": 10,
    "smoothstep": 11,
}


def code(kind: int, site: int) -> float:
    """The code of a kind of fault at a node."""
    return float(kind + STRIDE * site)


def decoded(number: float) -> tuple[int, int]:
    """Kind and site of a code."""
    site, kind = divmod(round(number), STRIDE)
    return kind, site


def plain(definition: Function) -> Function:
    """The function without probes."""
    if not find(definition.inner, "probe"):
        return definition

    def make() -> Function:
        reading = _Reading(checks=False)
        (body,) = reading.read([definition.body], 0)
        names = {reading.values[e]: name for e, name in definition.names.items() if e in reading.values}
        return Function(definition.name, definition.params, body, names, definition.where)

    return definition.once("plain", make)


def faults_of(definition: Function) -> Function | None:
    """The function `vec2 name_faults(...)` of the same parameters; None if it has no possible fault.

    Codes from outside of any probe have the site 0; the caller replaces it by its own node.
    """

    def make() -> Function | None:
        found = first_fault([definition.body])
        name = f"{definition.name}_faults"
        return None if found is None else Function(name, definition.params, found, where=definition.where)

    return definition.once("faults", make)


def first_fault(roots: Sequence[Expr]) -> Expr | None:
    """The first fault in some expressions; None if none is possible."""
    reading = _Reading()
    reading.read(roots, 0)
    found = [reading.faults[root] for root in roots]
    ends = [not_finite(reading.values[root], code(1, 0)) for root in roots if root.op != "probe"]
    return merged([*found, *ends])


@dataclass(slots=True)
class _Reading:
    """One pass over expressions.

    values : each expression without probes; loops have their fault as additional state. faults : the fault of each
    expression.
    """

    checks: bool = True
    values: dict[Expr, Expr] = field(default_factory=dict)
    faults: dict[Expr, Expr | None] = field(default_factory=dict)
    _results: dict[Expr, tuple[Expr, ...]] = field(default_factory=dict)

    def read(self, roots: Sequence[Expr], owner: int) -> list[Expr]:
        """Read expressions that belong to the node `owner` unless a probe names another; returns their values."""
        order = topological(roots)
        owners = _owners(order, owner)
        for node in order:
            args = tuple(self.values[arg] for arg in node.args)
            if node.type is STATE:
                self._results[node], inside = self._loop(node, args, owners[node])
                self.values[node] = node
                self.faults[node] = merged([*(self.faults[arg] for arg in node.args), inside])
            elif node.op == "item":
                self.values[node] = self._results[node.args[0]][node.data]
                self.faults[node] = self.faults[node.args[0]]
            else:
                self.values[node] = self._value(node, args)
                self.faults[node] = self._fault(node, args, owners[node]) if self.checks else None
        return [self.values[root] for root in roots]

    def _value(self, node: Expr, args: tuple[Expr, ...]) -> Expr:
        if node.op == "probe":
            return args[0]
        if node.op == "call":
            return make("call", node.type, args, plain(node.data))
        return rebuild(node, args)

    def _fault(self, node: Expr, args: tuple[Expr, ...], site: int) -> Expr | None:
        before = [self.faults.get(arg) for arg in node.args]
        if node.op == "where":
            yes, no = (NOTHING if fault is None else fault for fault in before[1:])
            return merged([before[0], v.where(args[0], yes, no)])
        if node.op == "probe":
            data: Passage = node.data
            return merged([before[0], not_finite(args[0], code(_KIND_OF_ROLE[data.role], data.site))])
        found = before
        if node.op in HIDING:
            looked_at = args[1:] if node.op in ("div", "mod") else args
            found += [not_finite(arg, code(1, site)) for arg in looked_at]
        if node.op in _KIND_OF_DOMAIN:
            found.append(outside(node.op, args, code(_KIND_OF_DOMAIN[node.op], site)))
        if node.op == "call" and (inside := faults_of(node.data)) is not None:
            found.append(_adopted(inside(*args), site))
        return merged(found)

    def _loop(self, node: Expr, args: tuple[Expr, ...], site: int) -> tuple[tuple[Expr, ...], Expr | None]:
        """The results of a loop and its fault, from a loop with its first fault as additional state."""
        body: Loop = node.data
        n = len(body.state)
        inner = _Reading(self.checks)
        values = inner.read(body.inner, site)
        step, until = tuple(values[:n]), values[n] if body.until is not None else None
        around = dict(zip(body.captured, args[n:], strict=True))
        own: Expr | None = None
        if self.checks:
            ends = [not_finite(value, code(1, site)) for value in step]
            own = merged([*(inner.faults[e] for e in body.inner), *ends])
        if own is None:
            return close_loop(body.count, body.index, body.state, step, until, args[:n], around), None
        carried = var("fault", VEC2)
        results = close_loop(
            body.count,
            body.index,
            (*body.state, carried),
            (*step, v.where(carried.x > 0.0, carried, own)),
            until,
            (*args[:n], NOTHING),
            around,
        )
        return results[:n], results[n]


def _owners(order: Sequence[Expr], owner: int) -> dict[Expr, int]:
    """The node of each expression: that of the first probe that its value flows into."""
    owners: dict[Expr, int] = {}
    for node in reversed(order):
        owners.setdefault(node, owner)
        here = node.data.site if node.op == "probe" else owners[node]
        for arg in node.args:
            owners.setdefault(arg, here)
    return owners


def _adopted(fault: Expr, site: int) -> Expr:
    """A fault inside a function, as a fault of the node that calls it."""
    if site == 0:
        return fault
    unknown = (fault.x > 0.0) & (fault.x < float(STRIDE))
    return construct(v.where(unknown, fault.x + float(STRIDE * site), fault.x), fault.y)
