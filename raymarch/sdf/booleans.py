"""Unions, intersections and differences, hard and smooth.

`k` is normalised so that two equal distances a blend to a - k/4. A smooth operation folds its operands in a balanced
tree. At each level the quadratic blend lowers the field by at most k/4, which the bounds include.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from raymarch.errors import Location, SceneError
from raymarch.expr.convert import choice, described, short
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import max, min
from raymarch.expr.walk import free_variables
from raymarch.sdf.blends import FAMILIES, REACH
from raymarch.sdf.definition import Child, ChildFacts, combination, definition_of
from raymarch.sdf.domain import Count, Positive, Scalar, Word, as_operand
from raymarch.sdf.facts import Exactness, Facts, disjoint, worst
from raymarch.sdf.node import Node, method

__all__ = ["difference", "intersection", "union"]

Fold = Callable[[Expr, Expr], Expr]

LEAST_WIDTH = 1e-18
"""In place of a width that a parameter may make 0. Its square is a float32, so no blend divides by 0; blends of this
width are hard."""


def balanced(values: Sequence[Expr], fold: Fold) -> Expr:
    """Fold a sequence pairwise, so that no operand passes through more than log2(n) folds."""
    row = list(values)
    while len(row) > 1:
        row = [fold(*row[i : i + 2]) if i + 1 < len(row) else row[i] for i in range(0, len(row), 2)]
    return row[0]


def hull(children: Sequence[ChildFacts], **_: Any) -> tuple[Expr, Expr]:
    """The box around all operands."""
    return balanced([c.lower for c in children], min), balanced([c.upper for c in children], max)


def _overlap(children: Sequence[ChildFacts]) -> tuple[Expr, Expr]:
    return balanced([c.lower for c in children], max), balanced([c.upper for c in children], min)


def _grown(children: Sequence[ChildFacts], margin: Expr) -> tuple[Expr, Expr]:
    """The box around all points at which a field of an operand is no larger than a margin."""
    corners = [child.grown(margin) for child in children]
    return balanced([lower for lower, _ in corners], min), balanced([upper for _, upper in corners], max)


def first(children: Sequence[ChildFacts], **_: Any) -> tuple[Expr, Expr]:
    """The box of the first operand."""
    return children[0].lower, children[0].upper


def spread_of_first(children: Sequence[ChildFacts], **_: Any) -> Expr:
    """The spread of the first operand: a subtracted solid never makes the field smaller."""
    return children[0].spread


def _exact_if_apart(*children: Facts) -> Exactness:
    """Inside overlapping solids, the nearest surface of one may lie inside another."""
    if len(children) > 2:  # pairs would cost n^2; a fold of two at a time finds the same
        return "bound"
    return worst(*[c.exactness for c in children]) if disjoint(*children) else "bound"


def within(children: Sequence[ChildFacts], margin: Any = 0.0) -> list[tuple[Expr, Expr]]:
    """The radii of all operands, at which a field is no larger than a margin."""
    return [pair for child in children for pair in child.within(margin)]


@combination(
    bounds=hull,
    exactness=_exact_if_apart,
    spread="keep",
    radii=within,
    associative=True,
    placing="union",
    dimension="any",
    called="union",
)
def hard_union(p: Expr, children: Sequence[Child]) -> Expr:
    """Union of solids."""
    return balanced([child(p) for child in children], min)


@combination(
    bounds=_overlap,
    spread="keep",
    convex=True,
    associative=True,
    cuts=True,
    placing="select",
    dimension="any",
    called="intersection",
)
def hard_intersection(p: Expr, children: Sequence[Child]) -> Expr:
    """Intersection of solids."""
    return balanced([child(p) for child in children], max)


@combination(
    bounds=first,
    spread=spread_of_first,
    radii=lambda children: children[0].within(),
    cuts=True,
    placing="select",
    dimension="any",
    called="difference",
)
def hard_difference(p: Expr, children: Sequence[Child]) -> Expr:
    """Difference: the first solid without the others."""
    return max(children[0](p), -balanced([child(p) for child in children[1:]], min))


# Smooth: one definition for each operation, the family is a static parameter.


def _slope(children: Sequence[ChildFacts], family: str, steps: int) -> Expr | None:
    fold = FAMILIES[family](steps).steepness
    return None if fold is None else balanced([child.lipschitz for child in children], fold)


def _slope_of_difference(children: Sequence[ChildFacts], family: str, steps: int) -> Expr | None:
    fold = FAMILIES[family](steps).steepness
    if fold is None:
        return None
    return fold(children[0].lipschitz, balanced([child.lipschitz for child in children[1:]], fold))


def _fold(k: Scalar, family: str, steps: int) -> Fold:
    fold = FAMILIES[family](steps).fold
    return lambda a, b: fold(a, b, k)


@combination(
    bounds=lambda children, k, family, steps: _grown(children, FAMILIES[family](steps).reach(len(children), k)),
    radii=lambda children, k, family, steps: within(children, FAMILIES[family](steps).reach(len(children), k)),
    lipschitz=_slope,
    spread="keep",
    placing="blend",
    dimension="any",
    called="union",
)
def smooth_union(p: Expr, children: Sequence[Child], k: Positive, family: Word, steps: Count) -> Expr:
    """Smooth union of solids, joined by a fillet or another shape."""
    return balanced([child(p) for child in children], _fold(k, family, steps))


@combination(bounds=_overlap, lipschitz=_slope, spread="keep", cuts=True, dimension="any", called="intersection")
def smooth_intersection(p: Expr, children: Sequence[Child], k: Positive, family: Word, steps: Count) -> Expr:
    """Smooth intersection of solids: new edges are rounded, or shaped."""
    return -balanced([-child(p) for child in children], _fold(k, family, steps))


@combination(
    bounds=first,
    lipschitz=_slope_of_difference,
    spread=spread_of_first,
    cuts=True,
    dimension="any",
    called="difference",
)
def smooth_difference(p: Expr, children: Sequence[Child], k: Positive, family: Word, steps: Count) -> Expr:
    """Smooth difference: the first solid without the others, new edges rounded, or shaped."""
    fold = _fold(k, family, steps)
    return -fold(-children[0](p), balanced([child(p) for child in children[1:]], fold))


def _no_node(name: str, given: object) -> SceneError:
    """The error for an operand that is no node; a number is taken for the width of a blend."""
    width = isinstance(given, float)
    legal = f"k={given} to blend the nodes" if width else f"nodes such as sphere(); of a list, {name}(*nodes)"
    return SceneError(f"{name} of {described(given)}", legal=legal)


@dataclass(frozen=True, slots=True)
class Blend:
    """A smooth union whose operands do not act beyond a distance.

    width : k. family : its name. reach : operands whose values differ by more do not change each other, in widths.
    """

    width: Expr
    family: str

    @property
    def reach(self) -> float:
        return REACH[self.family]


def blend_of(node: Node) -> Blend | None:
    """The blend of a node; None for another node, and for a blend that acts at all distances."""
    if node.placed_as != "blend" or node.params["family"] not in REACH:
        return None
    return Blend(node.params["k"], node.params["family"])


def united(nodes: Sequence[Node], facts: Facts, where: Location | None) -> Node:
    """The hard union of two or more solids with these facts, at a line of the user."""
    made = Node(definition_of(hard_union), tuple(nodes), {}, facts)
    made.where = where
    return made


def _choose(name: str, nodes: tuple[Node, ...], k: Any, blend: str, steps: int, hard: Any, smooth: Any) -> Node:
    if len(nodes) < 1:
        raise SceneError(f"{name} of no nodes", legal="one node or more")
    blend = choice(f"{name}: blend", blend, tuple(FAMILIES))
    width = as_operand(f"{name}: k", k, "a number >= 0; 0 gives the hard operation")
    if width.is_constant and width.type is FLOAT and not float(width.data) >= 0.0:
        raise SceneError(f"{name}: k = {short(k)}", legal="a number >= 0; 0 gives the hard operation")
    varies = width.type is FLOAT and not width.is_constant and not free_variables([width])
    if varies and interval_of(width)[0] == 0.0:
        k = max(width, LEAST_WIDTH)
    for node in nodes:
        if not isinstance(node, Node):
            raise _no_node(name, node)
    sharp = width.is_constant and width.type is FLOAT and float(width.data) == 0.0
    if sharp and hard is not hard_difference:  # the union of a solid with itself is the solid
        nodes = tuple({id(node): node for node in nodes}.values())
    if len(nodes) == 1:
        return nodes[0]
    return hard(nodes) if sharp else smooth(nodes, k, blend, steps)


@method
def union(*nodes: Node, k: Scalar = 0.0, blend: str = "quadratic", steps: int = 4) -> Node:
    """Union: `a | b`, or with a fillet for k > 0.

    Parameters
    ----------
    nodes : one or more.
    k : width of the blend, a length >= 0. Surfaces whose distances differ by more than k do not change each other;
        where two distances are equal to a, the result is a - k/4.
    blend : "quadratic" (reaches k), "cubic" (1.5 k), "quartic" (1.33 k), "circular" (0.85 k), "exponential", "root"
        (both everywhere), "circular_geometric"; or a joint, for which k is its size: "round" (radius), "chamfer"
        (legs), "stairs", "columns".
    steps : number of stairs or columns, >= 1.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : no nodes, solids beside flat shapes, or a value out of its range.

    Notes
    -----
    Exact outside if the operands are exact. A "bound" as a whole, because inside overlapping solids it is not exact.

    Examples
    --------
    >>> rm.union(rm.sphere(1), rm.box(1).translate((2, 0, 0))).bounds[1]
    array([2.5, 1. , 1. ])
    """
    return _choose("union", nodes, k, blend, steps, hard_union, smooth_union)


@method
def intersection(*nodes: Node, k: Scalar = 0.0, blend: str = "quadratic", steps: int = 4) -> Node:
    """Intersection: `a & b`, or with rounded new edges for k > 0.

    Parameters
    ----------
    nodes : one or more solids, or flat shapes.
    k, blend, steps : see `union`.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : as for `union`.

    Notes
    -----
    A bound.

    Examples
    --------
    >>> rm.intersection(rm.sphere(1), rm.box(1)).bounds[1]
    array([0.5, 0.5, 0.5])
    """
    return _choose("intersection", nodes, k, blend, steps, hard_intersection, smooth_intersection)


@method
def difference(*nodes: Node, k: Scalar = 0.0, blend: str = "quadratic", steps: int = 4) -> Node:
    """Difference: `a - b`, the first solid without the others, or with rounded new edges for k > 0.

    Parameters
    ----------
    nodes : one or more solids, or flat shapes.
    k, blend, steps : see `union`.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : as for `union`.

    Notes
    -----
    A cut surface has the material of the subtracted solid if it has one, else that of the first solid.

    A bound.

    Examples
    --------
    >>> rm.difference(rm.box(2), rm.sphere(1)).distance((0, 0, 0))
    array(1.)
    """
    return _choose("difference", nodes, k, blend, steps, hard_difference, smooth_difference)
