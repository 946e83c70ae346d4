"""Faults that can be seeded into a definition: into its formula, or into the facts that it promises.

A fault in a formula is one operation left out or turned round, anywhere in the traced expression, inside the functions
and loops that it calls too. Nothing here knows any node by name but the look-up parameters of repetitions.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from raymarch.expr.function import Function, Loop
from raymarch.expr.node import Expr, expr, make
from raymarch.expr.types import BOOL
from raymarch.expr.walk import find, rebuild, rewrite
from raymarch.sdf import Node
from raymarch.sdf.definition import ChildFacts, Definition
from raymarch.sdf.facts import Facts

Change = Callable[[Sequence[Expr]], Expr | None]

LOOK_UPS = {"both": 0, "guard": 0, "evaluated": 0}
"""Static parameters that choose how many copies are evaluated, and the value for the fewest."""


@dataclass(frozen=True)
class Fault:
    """Something wrong with a definition.

    Attributes
    ----------
    kind : "lipschitz", "margin", "look-up", "sign", "clamp", "factor", "claim".
    what : in words.
    seeded : context in which the definition has the fault.
    formula : True if it changes the field, not only what is promised.
    """

    definition: Definition
    kind: str
    what: str
    seeded: Callable[[], Any]
    formula: bool


# In the formula


def replaced(root: Expr, target: Expr, change: Change) -> Expr:
    """The expression with `change(arguments)` in place of one below it, wherever that stands."""
    made: dict[Any, Any] = {}

    def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
        if node is target:
            new = change(args)
            return rebuild(node, args) if new is None else new
        if node.op in ("call", "loop"):
            if node.data not in made:
                made[node.data] = inside(node.data)
            if made[node.data] is not node.data:
                return make(node.op, node.type, args, made[node.data])
        return rebuild(node, args)

    def inside(data: Function | Loop) -> Function | Loop:
        new = rewrite(data.inner, rule)
        inner = tuple(new[part] for part in data.inner)
        if inner == data.inner:
            return data
        if isinstance(data, Function):
            return Function(data.name, data.params, inner[0], where=data.where)
        n = len(data.step)
        return dataclasses.replace(data, step=inner[:n], until=inner[n] if data.until is not None else None)

    return rewrite([root], rule)[root]


def _argument(index: int, node: Expr) -> Change | None:
    """One argument in place of the whole, where the types allow it."""
    arg = node.args[index]
    if arg.type is node.type:
        return lambda args: args[index]
    if arg.type.shape == () and node.type.is_vector and arg.type is not BOOL:
        return lambda args: expr((args[index],) * node.type.size)
    return None


def _twin(op: str) -> Callable[[Expr], Change]:
    return lambda node: lambda args: (args[0] - args[1]) if op == "sub" else (args[0] + args[1])


def _keeping(kind: str, what: str, index: int) -> tuple[str, str, Callable[[Expr], Change | None]]:
    return kind, what, lambda node: _argument(index, node)


OPERATIONS: dict[str, list[tuple[str, str, Callable[[Expr], Change | None]]]] = {
    "max": [_keeping("clamp", "max keeps its first", 0), _keeping("clamp", "max keeps its second", 1)],
    "min": [_keeping("clamp", "min keeps its first", 0), _keeping("clamp", "min keeps its second", 1)],
    "clamp": [_keeping("clamp", "clamp left out", 0)],
    "abs": [_keeping("clamp", "abs left out", 0)],
    "neg": [_keeping("sign", "minus left out", 0)],
    "sub": [("sign", "minus is plus", _twin("add"))],
    "add": [("sign", "plus is minus", _twin("sub"))],
    "mul": [_keeping("factor", "first factor left out", 1), _keeping("factor", "second factor left out", 0)],
    "div": [_keeping("factor", "divisor left out", 0)],
}
"""For each operation: the kind of the fault, its name, and what makes it."""


@contextmanager
def patched(definition: Definition, **changes: Any) -> Iterator[None]:
    """The definition with other attributes, and nothing remembered."""
    changes |= {"_templates": {}, "_facts": {}}
    before = {name: getattr(definition, name) for name in changes}
    for name, value in changes.items():
        setattr(definition, name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            setattr(definition, name, value)


def _with_source(definition: Definition, change: Callable[[Expr], Expr]) -> Callable[[], Any]:
    original = definition.source

    def source(*args: Any, **kwargs: Any) -> Any:
        return change(expr(original(*args, **kwargs)))

    return lambda: patched(definition, source=source, associative=False)


def _with_parameters(definition: Definition, **fixed: Any) -> Callable[[], Any]:
    original = definition.source

    def source(*args: Any, **kwargs: Any) -> Any:
        return original(*args, **(kwargs | fixed))

    return lambda: patched(definition, source=source)


def formula_faults(definition: Definition, body: Expr) -> Iterator[Fault]:
    """Every single fault of the traced expression of one sample.

    In other samples, whose expression may differ, it is that of the operation of the same number.
    """
    for op, kinds in OPERATIONS.items():
        for number, place in enumerate(find([body], op)):
            for kind, what, maker in kinds:
                if maker(place) is None:
                    continue

                def change(root: Expr, op: str = op, number: int = number, maker: Any = maker) -> Expr:
                    places = find([root], op)
                    made = maker(places[number]) if number < len(places) else None
                    return root if made is None else replaced(root, places[number], made)

                yield Fault(definition, kind, f"{what} ({op} {number})", _with_source(definition, change), True)
    asked = find([body], "apply")
    if definition.arity == "one" and len(asked) > 1:
        for number in range(len(asked)):

            def again(root: Expr, number: int = number) -> Expr:
                places = find([root], "apply")
                if number >= len(places) or len(places) < 2:
                    return root
                other = places[number - 1]
                return replaced(root, places[number], lambda args: other)

            yield Fault(definition, "look-up", f"look-up {number} left out", _with_source(definition, again), True)
    for name, least in LOOK_UPS.items():
        if name in definition.domains:
            seeded = _with_parameters(definition, **{name: least})
            yield Fault(definition, "look-up", f"{name} = {least}", seeded, True)


# In the facts


def _with_facts(definition: Definition, change: Callable[[Facts], Facts]) -> Callable[[], Any]:
    """While it lasts, the definition derives other facts."""

    @contextmanager
    def seeded() -> Iterator[None]:
        original = Definition.derive

        def derive(self: Definition, children: Any, params: Any) -> Facts:
            facts = original(self, children, params)
            return change(facts) if self is definition else facts

        Definition.derive = derive  # type: ignore[method-assign]
        try:
            with patched(definition):
                yield
        finally:
            Definition.derive = original  # type: ignore[method-assign]

    return seeded


@contextmanager
def _no_margin(definition: Definition) -> Iterator[None]:
    original = ChildFacts.grown
    ChildFacts.grown = lambda self, distance: (self.lower, self.upper)  # type: ignore[method-assign]
    try:
        with patched(definition):
            yield
    finally:
        ChildFacts.grown = original  # type: ignore[method-assign]


def _shrunk(facts: Facts, axis: int, upper: bool) -> Facts:
    """A side of the box 3 % too near."""
    size = facts.size
    if not np.isfinite(size[axis]) or size[axis] <= 0:
        return facts
    low, high = facts.lower.copy(), facts.upper.copy()
    if upper:
        high[axis] -= 0.03 * size[axis]
    else:
        low[axis] += 0.03 * size[axis]
    return dataclasses.replace(facts, lower=low, upper=high)


def fact_faults(definition: Definition, nodes: Sequence[Node]) -> Iterator[Fault]:
    """Promises that go too far, where the samples do not make them already."""
    seen = [node.facts for node in nodes]

    def fault(kind: str, what: str, change: Callable[[Facts], Facts]) -> Fault:
        return Fault(definition, kind, what, _with_facts(definition, change), False)

    if any(f.divisor > 1 for f in seen):
        yield fault("lipschitz", "not divided", lambda f: dataclasses.replace(f, divisor=1.0))
    for axis in range(definition.dimension):
        for upper in (False, True):
            if any(np.isfinite(f.size[axis]) and f.size[axis] > 0 for f in seen):
                what = f"{'upper' if upper else 'lower'} side {'xyz'[axis]} of the box 3 % short"
                yield fault("margin", what, lambda f, axis=axis, upper=upper: _shrunk(f, axis, upper))
        name = "xyz"[axis]
        if not all(name in f.symmetry for f in seen):
            wider = lambda f, name=name: dataclasses.replace(f, symmetry="".join(sorted({*f.symmetry, name})))  # noqa: E731
            yield fault("claim", f"symmetric along {name}", wider)
    if definition.arity != "none":
        yield Fault(definition, "margin", "the box does not grow", lambda: _no_margin(definition), False)
    if any(1 < f.spread < np.inf for f in seen):
        yield fault("claim", "spread 1", lambda f: dataclasses.replace(f, spread=1.0))
    if any(f.exactness == "bound" for f in seen):
        yield fault("claim", "exact", lambda f: dataclasses.replace(f, exactness="exact", spread=1.0))
    if not all(f.convex for f in seen):
        yield fault("claim", "convex", lambda f: dataclasses.replace(f, convex=True))


def rebuilt(node: Node) -> Node:
    """The same tree, its facts derived anew."""
    children = tuple(rebuilt(child) for child in node.children)
    facts = node.definition.derive(children, node.params)
    return Node(node.definition, children, node.params, facts, node.label)
