"""Transition from one solid to another along a line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import short
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import clamp, dot, length, max, min
from raymarch.expr.walk import find
from raymarch.sdf.booleans import balanced, hull, widest
from raymarch.sdf.definition import Child, combination
from raymarch.sdf.domain import Positive, Vec3, Vector, as_operand
from raymarch.sdf.facts import Facts
from raymarch.sdf.lower import lower as lower_field
from raymarch.sdf.node import Node, method

__all__ = ["transition"]


def _symmetry_across(*children: Facts, start: Expr, end: Expr, reach: Expr) -> str:
    """The weight is the same on both sides of a plane that contains the direction of the transition."""
    axis = end - start
    still = [name for name, step in zip("xyz", axis, strict=True) if step.is_constant and not step.data]
    return "".join(axis for axis in still if all(axis in child.symmetry for child in children))


@combination(
    bounds=hull,
    lipschitz=lambda children, start, end, reach: (
        balanced([c.lipschitz for c in children], max) + reach / length(end - start)
    ),
    spread=widest,
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

    a, b : bounded solids.
    start, end : distinct points. The solid is `a` up to the plane through `start`, and `b` from the plane through `end`
        on.

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
            raise SceneError(
                f"transition: {name} ({node.name}) is unbounded",
                legal="bounded solids: cut it first, as `node & box(...)`",
            )
    ends = tuple(as_operand(f"transition: {n}", v, "3 numbers") for n, v in (("start", start), ("end", end)))
    if ends[0] is ends[1]:
        raise SceneError(f"transition: start = end = {short(start)}", legal="two different points")
    return transition_between((a, b), start, end, largest_difference(a, b))


POINTS = 2**14
"""Points of the grid on which the two distances are compared, about."""


def largest_difference(a: Node, b: Node) -> float:
    """A bound of |b - a| where a and b differ in sign. Elsewhere a mix of both has their sign, whatever the difference.

    Both are 1-Lipschitz and no larger than the distance to the surface. A ball in one solid and the nearest point of
    the other lie in the box of both, so its diagonal is a bound. Values on a grid, if available, give a tighter one.
    """
    lower, upper = np.minimum(a.bounds[0], b.bounds[0]), np.maximum(a.bounds[1], b.bounds[1])
    diagonal = float(np.linalg.norm(upper - lower)) or 1.0
    edge = round(POINTS ** (1.0 / len(lower)))
    steps = [np.linspace(low, high, edge) for low, high in zip(lower, upper, strict=True)]
    points = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, len(lower))
    try:
        if find([lower_field(node).body for node in (a, b)], "param", "time"):
            return diagonal
        da, db = a.distance(points), b.distance(points)
    except SceneError:  # it depends on the index of a cell, or is GLSL without a twin
        return diagonal
    spacing = 0.5 * diagonal / (edge - 1)  # from any point of the box to the nearest of the grid
    mixed = (np.minimum(da, db) <= spacing) & (np.maximum(da, db) >= -spacing)
    largest = float(np.max(np.abs(db - da)[mixed], initial=0.0)) + 2.0 * spacing
    return float(np.minimum(largest, diagonal))
