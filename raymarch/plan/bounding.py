"""Bounding volumes: costly operands of a hard union are evaluated only where their box is nearer than the best so far.

A point at which an operand has the value m > 0 lies in its box grown by spread * m. So m is at least the distance to
the box over the spread. Where that is not below the distance so far, the operand cannot be the smallest: leaving it out
changes no value of the union. Nearer boxes come first, because the best distance is then small early.
"""

from __future__ import annotations

import builtins
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location
from raymarch.expr.arrays import evaluator
from raymarch.expr.derivative import companion, state_gradient
from raymarch.expr.function import Function, changed_inside, loop
from raymarch.expr.node import Expr, const, construct, make, swizzle, var
from raymarch.expr.operations import operations
from raymarch.expr.partials import zero
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import abs, length, max, min, where
from raymarch.expr.walk import find, rebuild, substitute
from raymarch.plan.hoisting import Hoisting
from raymarch.prices import Prices
from raymarch.sdf.booleans import balanced
from raymarch.sdf.facts import FARTHEST, Facts
from raymarch.sdf.node import Node

SOME = 1e-30
"""A distance above 0, so that the bound inside of a box, 0, is less."""

GRID = 5
"""Points a side of the grid on which an operand is evaluated, to know how far it is at most."""

UNKNOWN = ("raw", "raw_slope")
"""Operations whose values are not known when a scene is planned."""

MARGIN = 1e-5
"""Share by which boxes are grown and their distances reduced, so that rounding in float32 cannot skip an operand."""

Carried: TypeAlias = Callable[[int, tuple[Expr, Expr]], Sequence[Expr]]
"""Further values of an operand: a function of its position, and of its distance and gradient."""


@dataclass(eq=False)
class BoundedUnion:
    """A hard union with operands that are evaluated in their boxes only.

    operands : the other operands together, if there are any, then those with boxes; each with its function.
    boxes : the facts of the latter. inner : points near the middle of boxes, and the values of their operands there.
    field : the distance, a function of the point; its companion is the gradient.
    """

    operands: list[tuple[list[Node], Function]]
    boxes: list[Facts]
    inner: list[tuple[NDArray[np.float64], float]]
    where: Location | None
    field: Function = field(init=False)

    def __post_init__(self) -> None:
        p = var("p", VEC3)
        names: dict[Expr, str] = {}
        (value,) = self.walk(p, None, names)
        self.field = Function("nearest", (p,), value, names, self.where)
        value, slope = self.walk(p, lambda _i, pair: (pair[1],), names)
        state_gradient(self.field, construct(slope, value))

    def walk(self, p: Expr, carried: Carried | None, names: dict[Expr, str] | None = None) -> tuple[Expr, ...]:
        """The distance, and what is carried of the nearest operand; None carries nothing.

        names : filled with the names of values in the shader.
        """
        beside = len(self.operands) - len(self.boxes)
        bounds = {var(f"bound {i}", FLOAT): distance_to_box(facts, p) for i, facts in enumerate(self.boxes)}
        limit = var("limit", FLOAT)
        nearest = [(1.0 + MARGIN) * (length(p - tuple(at)) + value) for at, value in self.inner]

        def values(i: int) -> list[Expr]:
            function = self.operands[i][1]
            if carried is None:
                return [function(p)]
            pair = value_and_gradient(function, p)
            return [pair[0], *carried(i, pair)]

        state: Sequence[Expr] = values(0)
        if not beside:
            state = none_of(state)
        for i, bound in enumerate(bounds):

            def evaluated(_turn: Expr, *best: Expr, i: int = i) -> Sequence[Expr]:
                return nearer(values(i + beside), best)

            def skipped(_turn: Expr, best: Expr, *_: Expr, bound: Expr = bound) -> Expr:
                reach = max(best, SOME)  # inside of its box, an operand may be less than any other
                return ~(bound < (min(reach, limit) if nearest else reach))

            state = loop(1, state, evaluated, skipped)
        known = bounds | ({limit: max(balanced(nearest, min), SOME)} if nearest else {})
        if names is not None:
            names |= {value: str(name.data).partition(" ")[0] for name, value in known.items()}
        return tuple(substitute(state, known))


def value_and_gradient(field: Function, *args: Expr) -> tuple[Expr, Expr]:
    """The value of a field and its gradient, computed together."""
    both = companion(field)(*args)
    return swizzle(both, "w"), swizzle(both, "xyz")


def none_of(values: Sequence[Expr]) -> list[Expr]:
    """The distance and what is carried of no object, from the values of any."""
    return [const(FARTHEST), *[zero(value.type) for value in values[1:]]]


def nearer(found: Sequence[Expr], best: Sequence[Expr]) -> list[Expr]:
    """The values of the nearer of two objects; distances come first."""
    is_nearer = found[0] < best[0]
    return [where(is_nearer, one, other) for one, other in zip(found, best, strict=True)]


def distance_to_box(facts: Facts, p: Expr) -> Expr:
    """A lower bound of a field by its box; 0 inside."""
    middle, half = 0.5 * (facts.lower + facts.upper), 0.5 * (facts.upper - facts.lower)
    half = half + MARGIN * np.maximum(np.abs(facts.lower), np.abs(facts.upper)).max()
    q = abs(p - tuple(middle)) - tuple(half)
    if facts.exactness == "exact":
        return (1.0 - MARGIN) * length(max(q, 0.0))
    return ((1.0 - MARGIN) / facts.spread) * max(max(q.x, q.y), max(q.z, 0.0))


def inner_point(function: Function, facts: Facts) -> tuple[NDArray[np.float64], float] | None:
    """A point c of the box and the value v of an operand there; None if the operand depends on parameters or time.

    No point p has a larger value than v + |p - c|, because the field is 1-Lipschitz. Of a grid of points, that one is
    chosen for which this is least far away.
    """
    if facts.exactness == "estimate" or find([function.body], "param", "time", *UNKNOWN):
        return None
    grid = np.stack(np.meshgrid(*np.linspace(facts.lower, facts.upper, GRID).T, indexing="ij"), -1).reshape(-1, 3)
    (values,) = evaluator([function.body], function.params)(grid)
    best = int(np.argmin(values + np.linalg.norm(grid - 0.5 * (facts.lower + facts.upper), axis=1)))
    return grid[best], float(values[best])


@dataclass(eq=False)
class BoundedUnions:
    """Chooses the operands that are evaluated in their boxes only; see `raymarch.sdf.lower.Bounding`.

    asked : see `Quality.bounding_volumes`. hoist : hoists the functions of operands. prices : of the device.
    made : the unions with operands in boxes. refused : why there are none. dearest : operations of the dearest operand
    that could have a box.
    """

    asked: bool | None
    hoist: Hoisting
    prices: Prices
    made: list[BoundedUnion] = field(default_factory=list)
    refused: str = ""
    dearest: int = 0
    _kept: dict[Function, Function] = field(default_factory=dict)

    def allowed(self, hidden: bool, rows: bool) -> bool:
        """Whether unions may have operands in boxes. hidden : some solid is hidden from some kind of ray.
        rows : objects are rows of a table."""
        if self.asked is False:
            self.refused = "Quality(bounding_volumes=False)"
        elif hidden:
            self.refused = "a solid is hidden from some kind of ray"
        elif rows:
            self.refused = "objects are found through cells"
        return not self.refused

    @property
    def used(self) -> bool:
        """True if some operand is evaluated in its box only."""
        return bool(self.made)

    @property
    def reason(self) -> str:
        """Why operands have boxes, or why none has."""
        if self.refused:
            return self.refused
        if not self.made:
            if self.asked:
                return "no operand of a hard union has a box and a certified lower bound"
            few, least = self.prices.operands, self._least
            dearest = f"; the dearest takes {self.prices.nanoseconds(self.dearest)}" if self.dearest else ""
            return f"no hard union has {few} operands with boxes that take {least}{dearest}"
        largest = builtins.max(self.made, key=lambda union: len(union.boxes))
        n, wanted = len(largest.boxes), "Quality(bounding_volumes=True)"
        why = wanted if self.asked else f"each takes {self._least}"
        return f"{n} operand{'s' * (n != 1)} of a hard union: {why}"

    @property
    def _least(self) -> str:
        """The price of a box: that of the operands from which it is worth it."""
        return f"{self.prices.skip:.0f} operations or more ({self.prices.nanoseconds(self.prices.skip)}, as a box does)"

    @property
    def _fewest(self) -> int:
        """Least number of operands of a union with boxes."""
        return 1 if self.asked else self.prices.operands

    def applies(self, node: Node, children: Sequence[Node]) -> bool:
        union = node.placed_as == "union" and len(children) > 1
        return union and sum(_has_bound(child.facts) for child in children) >= self._fewest

    def chosen(self, children: Sequence[Node], bodies: Sequence[Expr]) -> Sequence[int]:
        pairs = enumerate(zip(children, bodies, strict=True))
        found = [i for i, (child, body) in pairs if _has_bound(child.facts) and self._is_costly(body)]
        return found if len(found) >= self._fewest and not find(bodies, "cell") else []

    def bounded(self, node: Node, children: Sequence[Node], functions: Sequence[Function]) -> BoundedUnion | None:
        """The union with some operands in boxes, None if none is worth it."""
        chosen = self.chosen(children, [function.body for function in functions])
        if not chosen:
            return None
        pairs = list(zip(children, functions, strict=True))
        inside = [pairs[i] for i in chosen]
        beside = [pair for i, pair in enumerate(pairs) if i not in chosen]
        operands = []
        if beside:
            p = var("p", VEC3)
            body = balanced([f.inline(p) for _, f in beside], min)
            operands.append(([child for child, _ in beside], Function("beside", (p,), body, where=node.where)))
        operands += [([child], self._skippable(function)) for child, function in inside]
        hoisted = [(nodes, self.hoist(function)) for nodes, function in operands]
        boxes = [child.facts for child, _ in inside]
        costly = [function for _, function in hoisted[-len(boxes) :]]
        points = [inner_point(function, facts) for function, facts in zip(costly, boxes, strict=True)]
        made = BoundedUnion(hoisted, boxes, [point for point in points if point is not None], node.where)
        self.made.append(made)
        return made

    def _skippable(self, function: Function) -> Function:
        """The function with loops that are not unrolled, also in the functions that it calls."""
        return changed_inside(function, self._rolled, self._kept)

    def _rolled(self, node: Expr, args: tuple[Expr, ...]) -> Expr:
        if node.op == "call":
            return make("call", node.type, args, self._skippable(node.data))
        if node.op != "loop" or node.data.is_branch or operations([node]) < self.prices.unroll:
            return rebuild(node, args)
        return make("loop", node.type, args, node.data.changed(self._rolled, kept=True))

    def _is_costly(self, body: Expr) -> bool:
        needed = operations([body])
        self.dearest = builtins.max(self.dearest, needed)
        return self.asked is True or needed >= self.prices.skip


def _has_bound(facts: Facts) -> bool:
    """True if the box of a solid gives a certified lower bound of its field."""
    return facts.bounded and not facts.empty and bool(np.isfinite(facts.spread))
