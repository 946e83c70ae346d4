"""Operators that move the surface along its normals."""

from __future__ import annotations

from raymarch.expr.node import Expr
from raymarch.sdf.definition import Child, operator
from raymarch.sdf.domain import NonNegative, Positive
from raymarch.sdf.registry import method


@method
@operator(exactness="exact", bounds=lambda child, radius: (child.lower - radius, child.upper + radius), symmetry="keep")
def round(p: Expr, child: Child, radius: NonNegative) -> Expr:
    """Grown by a radius on all sides; convex edges become round.

    radius : length, >= 0. Exact on an exact child; on a bound the surface moves by the radius at most.
    """
    return child(p) - radius


@method
@operator(
    exactness="exact",
    bounds=lambda child, thickness: (child.lower - 0.5 * thickness, child.upper + 0.5 * thickness),
    symmetry="keep",
)
def shell(p: Expr, child: Child, thickness: Positive) -> Expr:
    """Only a skin about the surface, half of it outside.

    thickness : full thickness, a length > 0.
    """
    return abs(child(p)) - 0.5 * thickness
