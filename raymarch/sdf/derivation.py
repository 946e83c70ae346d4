"""Facts of nodes from those of their children: a definition states functions of them, which are traced once and
evaluated on intervals, for all nodes of one definition at once."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.convert import short
from raymarch.expr.evaluate import Program
from raymarch.expr.intervals import INTERVALS, Interval
from raymarch.expr.node import Expr, const, expr, var
from raymarch.expr.types import FLOAT, VECTORS, vector
from raymarch.expr.vocabulary import max as maximum
from raymarch.sdf.domain import interval_of_value
from raymarch.sdf.facts import Facts, worst
from raymarch.sdf.node import Node, called_by_nodes, children_first
from raymarch.sdf.regions import Motion, Regions
from raymarch.sdf.rules import stated
from raymarch.sdf.values import BOUND

if TYPE_CHECKING:
    from raymarch.sdf.definition import Definition

Member: TypeAlias = tuple[Sequence[Facts], Mapping[str, Any]]
"""The facts of a node's children, and its parameters."""


@dataclass(frozen=True, slots=True)
class ChildFacts:
    """The facts of a child, as an operator's functions of facts receive them: expressions in place of numbers.

    `box` stands for any point of the child's box at once, so `child.box + offset` is the moved box;
    `lower` and `upper` are its corners. `lipschitz` and `spread` are those of the field that the operator receives:
    the undivided one, whose constant may exceed 1, if the operator does more than scale and choose distances.
    `centre` is that of the box; `radii` and `swell` are those of `Facts`.
    """

    box: Expr
    lower: Expr
    upper: Expr
    lipschitz: Expr
    spread: Expr
    centre: Expr
    radii: Expr
    swell: Expr

    def within(self, margin: Any = 0.0) -> list[tuple[Expr, Expr]]:
        """Centre and radii about it that hold all points at which the child's field is no larger than a margin >= 0."""
        return [(self.centre, self.radii + self.swell * margin)]

    def grown(self, distance: Any) -> tuple[Expr, Expr]:
        """Corners of a box around all points at which the child's field is no larger than a distance >= 0."""
        margin = self.spread * distance
        return self.lower - margin, self.upper + margin


class Traced(NamedTuple):
    """The traced functions of facts.

    program : the corners, the Lipschitz constant, the spread and the others. declared : True if it gives the Lipschitz
    constant. discs : the number of radii.
    """

    program: Program
    declared: bool
    discs: int
    motion: Motion | None


def facts_program(definition: Definition, n_children: int, params: Mapping[str, Any]) -> Traced:
    """The traced functions of facts, for these static parameters."""
    key = (n_children, definition.statics(params))
    if key not in definition.programs:
        definition.programs.setdefault(key, _trace(definition, n_children, params))
    return definition.programs[key]


def _trace(definition: Definition, n_children: int, params: Mapping[str, Any]) -> Traced:
    symbols = {n: var(n, t) for n, t in definition.symbols()}
    box = vector(definition.child_dimension)
    inputs = list(symbols.values())
    children = []
    for i in range(n_children):
        facts = [var(f"{name} {i}", box) for name in ("box", "lower", "upper")]
        facts += [var(f"{name} {i}", FLOAT) for name in ("lipschitz", "spread")]
        facts += [var(f"centre {i}", box), var(f"radii {i}", VECTORS[4]), var(f"swell {i}", FLOAT)]
        inputs += facts if definition.radii is not None or definition.motion is not None else facts[:-3]
        children.append(ChildFacts(*facts))
    arguments = {**symbols, **dict(definition.statics(params))}
    extra: tuple[Any, ...] = (children,) if definition.arity == "many" else tuple(children)
    motion = stated(definition.motion, extra, arguments)
    straight = None if motion is None or motion.turns else motion
    discs = stated(definition.radii, extra, arguments)
    if straight is not None:
        discs = [(straight.carried(children[0].centre), straight.scaled(children[0].radii))]
        region = straight.carried(children[0].box)
    elif definition.bounds is not None:
        region = definition.bounds(*extra, **arguments)
    else:
        endless = np.full(definition.dimension, np.inf)
        region = (const(-endless), const(endless))
    corners = region if isinstance(region, tuple) else (region, region)
    if len(corners) != 2 or any(expr(corner).type is not vector(definition.dimension) for corner in corners):
        what = f"{definition.called}: bounds gives {short(region)}"
        raise SceneError(what, legal="the corners (lower, upper), such as cube(half)")
    lower, upper = corners
    steep, spread = stated(definition.lipschitz, extra, arguments), stated(definition.spread, extra, arguments)
    if straight is not None or (isinstance(spread, str) and spread == "keep"):
        spread = reduce(maximum, [child.spread for child in children])
    elif spread is None and definition.placing in ("rigid", "scale"):  # a turned box reaches farther along an axis
        spread = children[0].spread * math.sqrt(definition.dimension)
    roots = [*map(expr, (lower, upper, 0.0 if steep is None else steep, np.inf if spread is None else spread))]
    discs = [] if discs is None else discs if n_children else [(0.5 * (roots[0] + roots[1]), discs)]
    roots += [expr(part) for disc in discs for part in disc]
    if motion is not None:
        roots += motion.parts(definition.dimension)
    return Traced(Program(roots, inputs, INTERVALS), steep is not None, len(discs), motion)


class _Evaluated(NamedTuple):
    """The values of the traced functions for some nodes: corners, Lipschitz constants, spreads and the others."""

    lower: Any
    upper: Any
    steepest: list[float]
    widest: list[float]
    others: Any


def _evaluated(
    definition: Definition, traced: Traced, members: Sequence[Member], lipschitz: str, spread: str, swell: str
) -> _Evaluated:
    """The values for some nodes, from those facts of their children."""
    inputs: list[Interval] = [
        _stacked([interval_of_value(own[name]) for _, own in members])
        for name, domain in definition.domains.items()
        if domain.type is not None
    ]
    for column in zip(*[below for below, _ in members], strict=True):
        lower, upper = (np.array([getattr(f, side) for f in column]) for side in ("lower", "upper"))
        inputs += [(lower, upper), (lower, lower), (upper, upper)]
        facts = [[getattr(f, name) for f in column] for name in (lipschitz, spread)]
        if traced.discs or traced.motion is not None:
            with np.errstate(invalid="ignore"):
                centre = np.nan_to_num(0.5 * (lower + upper), nan=0.0, posinf=0.0, neginf=0.0)
            facts += [centre, [f.reach for f in column], [getattr(f, swell) for f in column]]
        inputs += [(numbers, numbers) for numbers in map(np.array, facts)]
    with np.errstate(all="ignore"):
        low, high, steep, wide, *others = traced.program(*inputs)
    n = len(members)
    lowest = np.broadcast_to(np.where(np.isnan(low[0]), -np.inf, low[0]), (n, definition.dimension))
    highest = np.broadcast_to(np.where(np.isnan(high[1]), np.inf, high[1]), (n, definition.dimension))
    steepest, widest = (np.broadcast_to(value[1], n).tolist() for value in (steep, wide))
    return _Evaluated(lowest, highest, steepest, widest, others)


def facts_of_members(definition: Definition, members: Sequence[Member]) -> list[Facts]:
    """Facts of some nodes at once. They have equally many children and equal static parameters."""
    first, params = members[0]
    traced = facts_program(definition, len(first), params)
    divided = _evaluated(definition, traced, members, "lipschitz", "spread", "swell")
    undivided, corners = divided, divided
    adds = definition.adds(len(first), params)
    if any(facts.divided for below, _ in members for facts in below):
        undivided = _evaluated(definition, traced, members, "undivided", "undivided_spread", "undivided_swell")
        corners = undivided if adds else divided
    with np.errstate(all="ignore"):
        box = (corners.lower, corners.upper)
        regions = Regions([below for below, _ in members], box, corners.others, traced.discs, traced.motion)
    bounded = definition.template(len(first), params).body.data is BOUND
    found = []
    for i, (below, own) in enumerate(members):
        steep, whole = _slopes(below, traced.declared, divided.steepest[i], undivided.steepest[i])
        wide, undivided_wide = (
            regions.spread(i, divided.widest[i]),
            regions.spread(i, undivided.widest[i], undivided=True),
        )
        swell, undivided_swell = regions.swell(i, wide), regions.swell(i, undivided_wide, undivided=True)
        if adds:
            steep, wide, swell = whole, undivided_wide, undivided_swell
        if bounded:
            steep = max([facts.lipschitz for facts in below] + [facts.undivided for facts in below], default=1.0)
        if not 0 < steep < np.inf:
            what = f"{definition.called} has no finite Lipschitz bound here ({steep})"
            raise SceneError(what, legal="a bounded child, and parameters with a finite range")
        exactness = worst(stated(definition.exactness, below, own), *[facts.exactness for facts in below])
        spreads = (wide * max(steep, 1.0), undivided_wide, swell * max(steep, 1.0), undivided_swell)
        if exactness == "exact":
            spreads = (1.0, 1.0, 1.0, 1.0)
        found.append(
            Facts(
                exactness,
                min(steep, 1.0),
                regions.lower[i],
                regions.upper[i],
                _symmetry(definition, below, own),
                max(steep, 1.0),
                spreads[0],
                _is_convex(definition, below, own),
                whole,
                spreads[1],
                regions.radii[i],
                *spreads[2:],
                regions.placed[i],
                regions.far[i],
            )
        )
    return found


def _slopes(below: Sequence[Facts], declared: bool, steepest: float, undivided: float) -> tuple[float, float]:
    """The Lipschitz constant of a definition's value, and that without any division."""
    largest = max((facts.lipschitz for facts in below), default=1.0)
    whole = max([largest, *[facts.undivided for facts in below]])
    if not declared:
        return largest, whole
    # one that is no larger is a constant for children that are 1-Lipschitz
    return steepest, undivided * max(whole, 1.0) if undivided <= steepest else undivided


def _symmetry(definition: Definition, children: Sequence[Facts], params: Mapping[str, Any]) -> str:
    if definition.symmetry == "keep":
        return "".join(sorted(set("xyz").intersection(*[c.symmetry for c in children])))
    return str(stated(definition.symmetry, children, params))


def _is_convex(definition: Definition, children: Sequence[Facts], params: Mapping[str, Any]) -> bool:
    found = bool(stated(definition.convex, children, params))
    return found and (callable(definition.convex) or all(facts.convex for facts in children))


@called_by_nodes
def derive_facts(root: Node) -> None:
    """Derives the facts of a node and of all below it that have none yet: those of equal definition at once."""
    missing = children_first(root, lambda node: node.known_facts is None)
    height: dict[int, int] = {}
    groups: dict[tuple[Any, ...], list[Node]] = {}
    for node in missing:
        level = height[id(node)] = 1 + max((height.get(id(child), 0) for child in node.children), default=0)
        key = (level, node.definition, len(node.children), node.definition.statics(node.params))
        groups.setdefault(key, []).append(node)
    for key in sorted(groups, key=itemgetter(0)):
        nodes = groups[key]
        found = facts_of_members(nodes[0].definition, [([c.facts for c in n.children], n.params) for n in nodes])
        for node, facts in zip(nodes, found, strict=True):
            node.known_facts = facts


def divisor_of(node: Node) -> float | None:
    """The number by which the field of a node is divided; None if parts of it are divided by different numbers."""
    if not node.facts.divided:
        return 1.0
    definition, n = node.definition, len(node.children)
    if definition.template(n, node.params).body.data is BOUND:
        return None
    if not n or definition.adds(n, node.params):
        return node.facts.divisor
    below = {divisor_of(child) for child in node.children}
    (one,) = below if len(below) == 1 else (None,)
    return None if one is None else one * node.facts.divisor


def _stacked(intervals: Sequence[Interval]) -> Interval:
    """Intervals of equal type as one; those of one number stay such."""
    low = np.array([interval[0] for interval in intervals])
    if all(interval[0] is interval[1] for interval in intervals):
        return low, low
    return low, np.array([interval[1] for interval in intervals])
