"""Joints of two solids, transitions, and other ways to combine them, each a function of two distances.

Where a joint measures a and b like the sides of a right triangle, it is as steep as their diagonal, sqrt(2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import short
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import clamp, dot, length, max, min, mix, vec2
from raymarch.expr.walk import find
from raymarch.sdf.booleans import balanced, first, hull, spread_of_first
from raymarch.sdf.definition import EVERYWHERE, Child, ChildFacts, combination, operator
from raymarch.sdf.domain import Fraction, Positive, Scalar, Vec3, Vector, as_operand
from raymarch.sdf.evaluation import evaluate_undivided
from raymarch.sdf.evaluation import lower as lower_field
from raymarch.sdf.facts import Facts, lattice
from raymarch.sdf.node import Node, called_by_nodes, method
from raymarch.sdf.placing import unmoved

__all__ = ["engrave", "groove", "morph", "pipe", "tongue", "transition", "xor"]

DIAGONAL = math.sqrt(2.0)


def _near_both(children: Sequence[ChildFacts], radius: Expr) -> tuple[Expr, Expr]:
    corners = [child.grown(radius) for child in children[:2]]
    return balanced([lower for lower, _ in corners], max), balanced([upper for _, upper in corners], min)


@combination(bounds=_near_both, lipschitz=DIAGONAL, called="pipe")
def pipe_along(p: Expr, children: Sequence[Child], radius: Positive) -> Expr:
    """A tube along the line where two surfaces meet."""
    return length(vec2(children[0](p), children[1](p))) - radius


@combination(bounds=first, lipschitz=DIAGONAL, spread=spread_of_first, cuts=True, called="engrave")
def engraved(p: Expr, children: Sequence[Child], depth: Positive) -> Expr:
    """A V-shaped line cut into the first solid where the second surface meets it."""
    a, b = children[0](p), children[1](p)
    return max(a, math.sqrt(0.5) * (a + depth - abs(b)))


@combination(bounds=first, spread=spread_of_first, cuts=True, called="groove")
def grooved(p: Expr, children: Sequence[Child], depth: Positive, width: Positive) -> Expr:
    """A channel with upright walls cut into the first solid along the second surface."""
    a, b = children[0](p), children[1](p)
    return max(a, min(a + depth, 0.5 * width - abs(b)))


@combination(
    bounds=lambda children, height: children[0].grown(height), spread=spread_of_first, symmetry="", called="tongue"
)
def tongued(p: Expr, children: Sequence[Child], height: Positive, width: Positive) -> Expr:
    """A rib with upright walls raised on the first solid along the second surface."""
    a, b = children[0](p), children[1](p)
    return min(a, max(a - height, abs(b) - 0.5 * width))


@combination(bounds=hull, spread="keep", touches=True, called="xor")
def exclusive(p: Expr, children: Sequence[Child]) -> Expr:
    """Exclusive or: the points of one of two solids but not of both."""
    a, b = children[0](p), children[1](p)
    return max(min(a, b), -max(a, b))


@combination(bounds=hull, called="morph")
def between(p: Expr, children: Sequence[Child], amount: Fraction) -> Expr:
    """The mean of two fields: where it is not positive, one of them is not."""
    return mix(children[0](p), children[1](p), amount)


@method
@operator(exactness="exact", bounds=lambda child: EVERYWHERE, symmetry="keep")
def complement(p: Expr, child: Child) -> Expr:
    """The complement: inside and outside exchanged."""
    return -child(p)


@checked
def pipe(a: Node, b: Node, radius: Scalar = 0.1) -> Node:
    """A tube along the line where the surfaces of two solids meet. A bound.

    Parameters
    ----------
    a, b : two solids.
    radius : of the tube, a length > 0.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : a flat shape, or a radius that is not positive.
    """
    return pipe_along([a, b], radius)


@checked
def engrave(a: Node, b: Node, depth: Scalar = 0.1) -> Node:
    """The first solid with a V-shaped line where the second's surface meets it. A bound.

    Parameters
    ----------
    a, b : two solids.
    depth : of the line, a length > 0.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : a flat shape, or a depth that is not positive.
    """
    return engraved([a, b], depth)


@checked
def groove(a: Node, b: Node, depth: Scalar = 0.1, width: Scalar = 0.1) -> Node:
    """The first solid with a channel along the second's surface. A bound.

    Parameters
    ----------
    a, b : two solids.
    depth, width : of the channel, lengths > 0; the width is the full one.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : a flat shape, or a length that is not positive.
    """
    return grooved([a, b], depth, width)


@checked
def tongue(a: Node, b: Node, height: Scalar = 0.1, width: Scalar = 0.1) -> Node:
    """The first solid with a rib along the second's surface. A bound.

    Parameters
    ----------
    a, b : two solids.
    height, width : of the rib, lengths > 0; the width is the full one.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : a flat shape, or a length that is not positive.
    """
    return tongued([a, b], height, width)


@checked
@called_by_nodes
def xor(a: Node, b: Node) -> Node:
    """Exclusive or: the points of one of two solids but not of both. A bound.

    Parameters
    ----------
    a, b : two solids, or two flat shapes.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : a solid beside a flat shape.

    Examples
    --------
    >>> rm.xor(rm.sphere(1), rm.sphere(0.5)).distance((0, 0, 0))
    array(0.5)
    """
    return exclusive([a, b])


@checked
def morph(a: Node, b: Node, amount: Scalar = 0.5) -> Node:
    """A solid between two others. A bound.

    Parameters
    ----------
    a, b : two solids, or two flat shapes.
    amount : 0 is the first, 1 the second; a number from 0 to 1 or an expression.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : a number out of this range.
    """
    return between([a, b], amount)


# Along a line


def _symmetry_across(*children: Facts, start: Expr, end: Expr, reach: Expr) -> str:
    """The weight is the same on both sides of a plane that contains the direction of the transition."""
    common = set("xyz").intersection(*[child.symmetry for child in children])
    return unmoved("".join(common), end - start)


@combination(
    bounds=hull,
    lipschitz=lambda children, start, end, reach: (
        balanced([c.lipschitz for c in children], max) + reach / length(end - start)
    ),
    spread="keep",
    symmetry=_symmetry_across,
    called="transition",
)
def transition_between(
    p: Expr,
    children: Sequence[Child],
    start: Vec3 = (0.0, -1.0, 0.0),
    end: Vec3 = (0.0, 1.0, 0.0),
    reach: Positive = 2.0,
) -> Expr:
    """The first solid at one end, the second at the other end, and a mix between.

    start, end : where the first ends and the second begins. reach : the difference of the two distances is clamped to
    this, so that the weight, which changes over space, adds a bounded slope.
    """
    a, *others = (child(p) for child in children)
    b = balanced(others, min)
    axis = end - start
    weight = clamp(dot(p - start, axis) / dot(axis, axis), 0.0, 1.0)
    return a + weight * clamp(b - a, -reach, reach)


@checked
@method
def transition(a: Node, b: Node, start: Vector, end: Vector) -> Node:
    """Transition from one solid to another along a line.

    Parameters
    ----------
    a, b : bounded solids.
    start, end : distinct points. The solid is `a` up to the plane through `start`, and `b` from the plane through `end`
        on.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound. The weight s of b grows by 1/|end - start| per unit of length, so a + s (b - a) changes by at most
    1 + |b - a| / |end - start|. The size of |b - a| matters only where one distance is positive and the other is not:
    elsewhere the sum has the sign of both. There |b - a| is bounded by its values on a grid, plus twice the distance to
    the grid points. For solids with parameters it is bounded by the diagonal of the box of both. Larger differences are
    clamped.
    """
    for name, node in (("a", a), ("b", b)):
        if not isinstance(node, Node) or node.dimension != 3:
            raise SceneError(f"transition: {name} = {short(node)}", legal="a solid such as sphere()")
        if not node.facts.bounded:
            what = f"transition: {name} ({node.name}) is unbounded"
            raise SceneError(what, legal="bounded solids: cut it first, as `node & box(...)`")
    ends = tuple(as_operand(f"transition: {n}", v, "3 numbers") for n, v in (("start", start), ("end", end)))
    if ends[0] is ends[1]:
        raise SceneError(f"transition: start = end = {short(start)}", legal="two different points")
    return transition_between((a, b), start, end, largest_difference(a, b))


POINTS = 2**14
"""Points of the grid on which the two distances are compared, about."""


def largest_difference(a: Node, b: Node) -> float:
    """A bound of |b - a| where a and b differ in sign. Elsewhere a mix of both has their sign, whatever the difference.

    Undivided, both are no larger than the distance to the surface times their Lipschitz constant. A ball in one solid
    and the nearest point of the other lie in the box of both, so its diagonal, times the larger constant, is a bound.
    Values on a grid, if available, give a tighter one.
    """
    lower, upper = np.minimum(a.bounds[0], b.bounds[0]), np.maximum(a.bounds[1], b.bounds[1])
    steepest = float(np.maximum(a.facts.undivided, b.facts.undivided))
    diagonal = steepest * (float(np.linalg.norm(upper - lower)) or 1.0)
    edge = round(POINTS ** (1.0 / len(lower)))
    steps = [np.linspace(low, high, edge) for low, high in zip(lower, upper, strict=True)]
    points = lattice(steps)
    try:
        if find([lower_field(node).body for node in (a, b)], "param", "time"):
            return diagonal
        da, db = (evaluate_undivided(node, points) for node in (a, b))
    except SceneError:  # it depends on the index of a cell, or is GLSL without a twin
        return diagonal
    spacing = 0.5 * diagonal / (edge - 1)  # from any point of the box to the nearest of the grid
    mixed = (np.minimum(da, db) <= spacing) & (np.maximum(da, db) >= -spacing)
    largest = float(np.max(np.abs(db - da)[mixed], initial=0.0)) + 2.0 * spacing
    return float(np.minimum(largest, diagonal))
