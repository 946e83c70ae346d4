"""The solids of a scene that rays hit in closed form: operands of its outermost hard union.

They are solved once for each ray. Only the other operands are marched, between the ends of their boxes and up to the
nearest closed-form hit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

from raymarch.expr.function import Function
from raymarch.expr.node import const, var
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import min, where
from raymarch.plan.hoisting import Hoisting
from raymarch.prices import STANDARD, Prices
from raymarch.sdf.booleans import united
from raymarch.sdf.facts import FARTHEST, Facts, around
from raymarch.sdf.intersections import NAMES, has_closed_form, interval_of_ray, is_placed
from raymarch.sdf.labels import flattened
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node, replaced


@dataclass(frozen=True, slots=True)
class Analytic:
    """Which solids are solved in closed form, and why.

    solved, marched : the operands of the outermost union. boxes : those of the marched ones.
    hit : the distance at which a ray enters a solved solid first, a function of its origin, its unit direction, the
        distance from which on it enters solids, and that at which it begins in those that it is in already; 1e30 if it
        enters none. rest : the field of the marched operands. solved_distance :
        that of the solved ones. All are None if no solid is solved.
    """

    reason: str
    solved: tuple[Node, ...] = ()
    marched: tuple[Node, ...] = ()
    hit: Function | None = None
    rest: Function | None = None
    solved_distance: Function | None = None
    prices: Prices = STANDARD

    @property
    def used(self) -> bool:
        """True if some solid is solved."""
        return bool(self.solved)

    @property
    def boxes(self) -> list[Facts]:
        """The boxes outside of which nothing is marched; none if nothing is marched."""
        boxes = [node.facts for node in self.marched if not node.facts.empty]
        return boxes if len(boxes) <= self.prices.boxes else [around(boxes)]


def choose(
    root: Node, asked: bool | None, hidden: bool = False, edges: bool = False, prices: Prices = STANDARD
) -> Analytic:
    """Choose the solids to solve.

    root : the tree with its objects as rows. asked : see `Quality.analytic`. hidden : some solid is hidden from some
        kind of ray, so the outermost union depends on the ray. prices : of the device.
    """
    if hidden:
        return Analytic("a solid is hidden from some kind of ray")
    if asked is False:
        return Analytic("Quality(analytic=False)")
    operands = _operands(root)
    if asked is None and len(operands) < 2:
        return Analytic("the solid is no hard union")
    solved: list[Node] = []
    marched: list[Node] = []
    for node in operands:
        closed = has_closed_form(node) and not node.facts.empty and not (edges and node.facts.bounded)
        (solved if closed else marched).append(node)
    if not solved:
        return Analytic(f"no operand of the outermost hard union is one of {', '.join(NAMES)}, only rotated and moved")
    why = "Quality(analytic=True)" if asked else "rays meet them without steps"
    delay = f"{prices.closed_form * len(solved):.2g} s of the first frame, of {prices.patience:.2g}"
    if asked is None and len(solved) > prices.closed_forms:
        many = f"{len(solved)} solids have closed forms, and more than {prices.closed_forms} compile slowly: {delay}"
        marched += [node for node in solved if node.facts.bounded]
        solved = [node for node in solved if not node.facts.bounded]
        if not solved:
            return Analytic(many)
        why = f"the unbounded ones; {many}"
    elif asked is None:
        why += f", which takes {delay}"
    count = f"{len(solved)} of {len(solved) + len(marched)} operands of the outermost union"
    return Analytic(f"{count}: {why}", tuple(solved), tuple(marched), prices=prices)


def complete(made: Analytic, root: Node, field: Function, lowering: Lowering, hoist: Hoisting) -> Analytic:
    """A choice that solves some solids, with its functions. root, field : the whole solid and its field."""
    o, d, first, start = var("origin", VEC3), var("direction", VEC3), var("first", FLOAT), var("start", FLOAT)
    found = []
    for node in made.solved:
        ends = interval_of_ray(node, o, d)
        enter = where(ends.x >= first, ends.x, start)
        found.append(where((ends.x <= ends.y) & (ends.y >= enter), enter, FARTHEST))
        if node.where is not None:
            hoist.origins.setdefault(ends, node.where)
    hit = Function("solved_hit", (o, d, first, start), reduce(min, found))
    marched, solved = union_of(made.marched, root), union_of(made.solved, root)
    if marched is None:
        rest = Function("marched_field", (var("p", VEC3),), const(FARTHEST))
        distance = Function("solved_field", field.params, field(*field.params))
    else:
        rest = lowering.again().field(marched, "marched_field")
        assert solved is not None
        distance = lowering.again().field(solved, "solved_field")
    return replace(made, hit=hoist(hit), rest=hoist(rest), solved_distance=hoist(distance))


def union_of(nodes: Sequence[Node], whole: Node) -> Node | None:
    """The union of some operands of the whole solid; None of none."""
    return united(nodes, nodes[0].facts, whole.where) if len(nodes) > 1 else next(iter(nodes), None)


def _operands(root: Node) -> list[Node]:
    """The operands of the outermost hard unions, under labels too. A union under transforms that keep shapes is taken
    apart if all its operands can be solved: they are then transformed."""
    found: list[Node] = []
    pending = [root]
    while pending:
        node = pending.pop()
        inner = node
        while inner.label is not None:
            inner = inner.children[0]
        if inner.placed_as == "union":
            pending.extend(reversed(flattened(inner)))
        else:
            found += _apart(node)
    return found


def _apart(root: Node) -> list[Node]:
    """The operands of a union under transforms, each under them; the node itself if one of them cannot be solved."""
    found: list[Node] = []
    pending: list[tuple[Node, tuple[Node, ...]]] = [(root, ())]
    while pending:
        node, above = pending.pop()
        inner, placed = node, above
        while inner.label is not None or is_placed(inner):
            if inner.label is None:
                placed = (*placed, inner)
            inner = inner.children[0]
        if inner.placed_as == "union":
            pending.extend((child, placed) for child in reversed(flattened(inner)))
        elif not has_closed_form(inner):
            return [root]
        else:
            found.append(reduce(_under, reversed(above), node))
    return found if len(found) > 1 else [root]


def _under(node: Node, transform: Node) -> Node:
    """A node under a transform that another node has."""
    return replaced(transform, (node,), facts=transform.definition.derive((node,), transform.params))
