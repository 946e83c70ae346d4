"""Operators that move the surface along its normals."""

from __future__ import annotations

from raymarch.expr.node import Expr
from raymarch.sdf.definition import Child, operator
from raymarch.sdf.domain import NonNegative, Positive
from raymarch.sdf.node import method


@method
@operator(
    # what grows about a hollow may close it or meet itself, and what was its surface there is inside
    exactness=lambda child: "exact" if child.convex else "bound",
    bounds=lambda child, radius: child.grown(radius),
    symmetry="keep",
    spread=lambda child: child.spread,
    convex=lambda child: child.convex and child.exactness == "exact",
    dimension="any",
)
def round(p: Expr, child: Child, radius: NonNegative) -> Expr:
    """Grow by a radius on all sides; convex edges become round.

    radius : length, >= 0.

    Exact for an exact, convex child. For a bound the surface moves by at least the radius.
    """
    return child(p) - radius


@method
@operator(
    bounds=lambda child, thickness: child.grown(0.5 * thickness),
    symmetry="keep",
    spread=lambda child: child.spread,
    dimension="any",
)
def shell(p: Expr, child: Child, thickness: Positive) -> Expr:
    """A shell about the surface, half of it outside.

    thickness : full thickness, a length > 0.

    A bound: within the shell along an edge, the nearest surface is not along the normals of the edge.
    """
    return abs(child(p)) - 0.5 * thickness
