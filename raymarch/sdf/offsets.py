"""Offsets: a solid grown or shrunk along its normals, its shell, and its sum with a box (elongate); in 2D too."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import abs, clamp, max, min, vec2, vec3, where
from raymarch.sdf.definition import Child, ChildFacts, operator
from raymarch.sdf.domain import Domain, Length, NonNegative, Positive, shown
from raymarch.sdf.facts import Facts
from raymarch.sdf.node import method

Extent = Annotated[Any, Domain(VEC3, low=0.0, unit="length", stretch=True)]


def _stretched_bounds(child: ChildFacts, extent: Any) -> tuple[Expr, Expr]:
    """The box with its sides moved outwards; a side beyond the middle moves with its piece."""
    half = 0.5 * extent
    sides = list(zip(child.lower, child.upper, half, strict=True))
    lower = [low + where(low > 0.0, h, -h) for low, _, h in sides]
    upper = [high + where(high < 0.0, -h, h) for _, high, h in sides]
    return (vec2(*lower), vec2(*upper)) if len(sides) == 2 else (vec3(*lower), vec3(*upper))


def _stretched_spread(child: ChildFacts, extent: Any) -> Expr:
    """Small values lie near the child's box; for a box beyond the middle also near the other piece."""
    widest = child.spread
    for low, high, along in zip(child.lower, child.upper, extent, strict=True):
        gap = max(low, -high)
        widest = max(widest, where(gap > 0.0, child.spread * (1.0 + along / gap), child.spread))
    return widest


def _stretched_convex(child: Facts, extent: Expr) -> bool:
    """The slope at the cut continues beyond the extruded section, unless both pieces are symmetric."""
    longer = np.broadcast_to(interval_of(extent)[1], len(extent)) > 0.0
    return child.convex and all(axis in child.symmetry for axis, far in zip("xyz", longer, strict=False) if far)


@method
@operator(
    bounds=_stretched_bounds, symmetry="keep", spread=_stretched_spread, convex=_stretched_convex, dimension="any"
)
def elongate(p: Expr, child: Child, extent: Extent = (0.5, 0.0, 0.0)) -> Expr:
    """Elongate: cut at the planes through the origin, move the pieces apart, and extrude the section between them.

    extent : added length along each axis, each >= 0; one number is for all axes.

    A bound for an exact child: the map back to the child moves no two points apart, so the distance there is never
    larger. It is exact outside if the child is convex and symmetric along the elongated axes.
    Inside, a child that is thinner along such an axis than across it has its nearest surface in a direction
    in which the result has none.
    """
    half = 0.5 * extent
    q = p - clamp(p, -half, half)
    away = abs(p) - half
    core = min(max(*away), 0.0)
    value = child(q)
    return value + where(value < 0.0, core, 0.0)


@method
@operator(
    # what grows about a hollow may close it or meet itself, and what was its surface there is inside
    exactness=lambda child: "exact" if child.convex else "bound",
    bounds=lambda child, radius: child.grown(radius),
    symmetry="keep",
    spread="keep",
    convex=lambda child: child.convex and child.exactness == "exact",
    radii=lambda child, radius: child.within(radius),
    dimension="any",
    placing="offset",
)
def round(p: Expr, child: Child, radius: NonNegative) -> Expr:
    """Grow by a radius on all sides; convex edges become round.

    radius : length, >= 0.

    Exact for an exact, convex child. Other surfaces move by the radius over the slope of their field, before it is
    divided: by the radius for samples of distances, cuts and chamfers, by another one after a twist or an uneven scale.
    `raymarch explain` prints by how much.
    """
    return child(p) - radius


@method
@operator(
    bounds=lambda child, thickness: child.grown(0.5 * thickness),
    symmetry="keep",
    spread="keep",
    radii=lambda child, thickness: child.within(0.5 * thickness),
    dimension="any",
    placing="offset",
)
def shell(p: Expr, child: Child, thickness: Positive) -> Expr:
    """A shell about the surface, half of it outside.

    thickness : full thickness, a length > 0.

    A bound: within the shell along an edge, the nearest surface is not along the normals of the edge. The shell of a
    field that is not exact is as thick as `round` says.
    """
    return abs(child(p)) - 0.5 * thickness


def _offset_bounds(child: ChildFacts, distance: Any) -> tuple[Expr, Expr]:
    margin = where(distance > 0.0, child.spread, 1.0) * distance
    return child.lower - margin, child.upper + margin


def _check_offset(child: Facts, distance: Any) -> None:
    deepest = 0.5 * float(child.size.min())
    if not child.empty and -float(interval_of(distance)[1]) >= deepest:
        raise SceneError(f"offset: distance = {shown(distance)} leaves nothing", legal=f"distance > {-deepest:g}")


@method
@operator(
    # as for `round`; if it shrinks, sharp corners are farther from a point outside than the field
    exactness=lambda child, distance: "exact" if child.convex and interval_of(distance)[0] >= 0.0 else "bound",
    bounds=_offset_bounds,
    symmetry="keep",
    spread="keep",
    convex=lambda child: child.convex and child.exactness == "exact",
    check=_check_offset,
    dimension="any",
    placing="offset",
)
def offset(p: Expr, child: Child, distance: Length = 0.1) -> Expr:
    """Grow by a distance on all sides (as `round`), or shrink by a negative one.

    distance : length. It must exceed minus half the smallest extent, at which nothing is left.

    Exact if an exact, convex child grows, else a bound. See `round` for fields that are not exact.
    """
    return child(p) - distance
