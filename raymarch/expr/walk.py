"""Traversal of expression graphs without recursion, for any depth."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Generator, Hashable, Iterable, Mapping, Sequence
from typing import Any, TypeVar, overload

from raymarch.expr.node import Expr, make, simplify

Below = TypeVar("Below")
Request = TypeVar("Request")
REMEMBERED = 1000
"""Largest number of expressions whose order an expression remembers. It bounds the memory of deep expressions."""
_UNSIMPLIFIED = {"const", "var", "param", "time", "call", "loop", "item", "apply", "mark", "probe"}


@overload
def topological(roots: Iterable[Expr]) -> list[Expr]: ...
@overload
def topological(
    roots: Iterable[Below], arguments: Callable[[Below], tuple[Below, ...]], limit: float = ...
) -> list[Below]: ...
def topological(
    roots: Iterable[Any], arguments: Callable[[Any], tuple[Any, ...]] | None = None, limit: float = math.inf
) -> list[Any]:
    """All expressions below the roots (or other graph nodes), each once, arguments before their users.

    An empty list if there are more than `limit` of them.
    """
    stack: list[Any] = list(roots)
    single = stack[0] if arguments is None and len(stack) == 1 else None
    if single is not None and single.below is not None:
        return [*single.below, single]
    order: list[Any] = []
    seen: set[Any] = set()
    stack.reverse()
    while stack:
        node = stack.pop()
        if node is None:  # the arguments of the node below are done
            order.append(stack.pop())
        elif node not in seen:
            seen.add(node)
            if arguments is None:
                below = node.args
            else:
                below = arguments(node)
                if len(seen) > limit:
                    return []
            if not below:
                order.append(node)
            elif len(below) == 1:
                stack += (node, None, below[0])
            else:
                stack += (node, None, *below[::-1])
    if single is not None and len(order) <= REMEMBERED:
        single.below = tuple(order[:-1])  # without itself: a circle would be freed late
    return order


def attribute(
    node: Expr,
    known: dict[Expr, Below],
    rule: Callable[[Expr], Below],
    arguments: Callable[[Expr], tuple[Expr, ...]] = lambda node: node.args,
) -> Below:
    """What `rule` says of an expression, asked of its arguments first; `known` keeps all answers for the next call."""
    stack = [node]
    while stack:
        top = stack[-1]
        missing = [] if top in known else [arg for arg in arguments(top) if arg not in known]
        if missing:
            stack.extend(missing)
        else:
            stack.pop()
            if top not in known:
                known[top] = rule(top)
    return known[node]


def run(
    root: Request,
    start: Callable[[Request], Generator[Request, Below, Below]],
    key: Callable[[Request], Hashable],
    known: dict[Any, Below],
) -> Below:
    """The result of a generator that yields requests for other results and returns its own. Works at any depth.

    start : the generator of a request. known : the results by the keys of their requests; each is made once.
    """
    stack = [(root, start(root))]
    value: Any = None
    while stack:
        try:
            request = stack[-1][1].send(value)
        except StopIteration as stop:
            done, _ = stack.pop()
            value = known[key(done)] = stop.value
            continue
        value = known.get(key(request))
        if value is None:
            stack.append((request, start(request)))
    return value


def rebuild(node: Expr, args: tuple[Expr, ...]) -> Expr:
    """The same operation on other arguments, simplified again."""
    if args == node.args:
        return node
    if node.op in _UNSIMPLIFIED:
        return make(node.op, node.type, args, node.data)
    return simplify(node.op, node.type, args, node.data)


def rewrite(roots: Iterable[Expr], rule: Callable[[Expr, tuple[Expr, ...]], Expr]) -> dict[Expr, Expr]:
    """Replace bottom-up: `rule(node, new arguments)` returns the replacement of each node."""
    new: dict[Expr, Expr] = {}
    replaced = new.__getitem__
    for node in topological(roots):
        new[node] = rule(node, tuple(map(replaced, node.args)))
    return new


def substitute(roots: Iterable[Expr], replacements: Mapping[Expr, Expr]) -> list[Expr]:
    """The roots with some expressions (usually variables) replaced."""
    roots = list(roots)
    order = topological(roots)
    if replacements.keys().isdisjoint(order):
        return roots
    new: dict[Expr, Expr] = {}
    replaced = new.__getitem__
    for node in order:
        found = replacements.get(node)
        new[node] = rebuild(node, tuple(map(replaced, node.args))) if found is None else found
    return [new[root] for root in roots]


def depends_on(roots: Iterable[Expr], variables: Iterable[Expr]) -> set[Expr]:
    """Every expression below the roots whose value changes with one of the variables."""
    dependent = set(variables)
    for node in topological(roots):
        if not dependent.isdisjoint(node.args):
            dependent.add(node)
    return dependent


def free_variables(roots: Iterable[Expr]) -> list[Expr]:
    """The `var` leaves below the roots. Functions and loops are closed: they read their arguments only."""
    return [node for node in topological(roots) if node.op == "var"]


def direct_calls(roots: Sequence[Expr]) -> list[Expr]:
    """The calls of functions below the roots, also those in loops."""
    calls: list[Expr] = []
    pending = list(roots)
    while pending:
        nodes, pending = topological(pending), []
        for node in nodes:
            if node.op == "call":
                calls.append(node)
            elif node.op == "loop":
                pending += node.data.inner
    return calls


def find(roots: Iterable[Expr], *ops: str, outside: Container[object] = ()) -> list[Expr]:
    """The distinct expressions of some operations below the roots, also inside called functions and loops.

    outside : functions that are not looked into.
    """
    found: dict[Expr, None] = {}
    pending: list[Sequence[Expr]] = [topological(roots)]
    seen = set[object]()
    while pending:
        inner: list[Sequence[Expr]] = []
        for nodes in pending:
            for node in nodes:
                op = node.op
                if op in ops:
                    found[node] = None
                if op in ("call", "loop") and node.data not in seen and node.data not in outside:
                    seen.add(node.data)
                    inner.append(inner_order(node.data))
        pending = inner
    return list(found)


def inner_order(owner: Any) -> Sequence[Expr]:
    """The expressions of a function, which remembers their order, or of a loop; arguments before their users."""
    known: dict[Any, Sequence[Expr]] | None = getattr(owner, "derived", None)
    if known is None:
        return topological(owner.inner)
    if "order" not in known:
        known["order"] = tuple(topological(owner.inner))
    return known["order"]
