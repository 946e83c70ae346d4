"""Parts of balls, and solids that are made of balls."""

from __future__ import annotations

import math
from typing import Any

from raymarch.expr.node import Expr, const
from raymarch.expr.vocabulary import (
    abs,
    cos,
    dot,
    length,
    max,
    min,
    sin,
    sqrt,
    vec2,
    vec3,
    where,
)
from raymarch.sdf.blends import smooth_min
from raymarch.sdf.definition import around_y, cube, shape
from raymarch.sdf.domain import (
    Fits,
    HalfTurn,
    Length,
    Positive,
    surely,
)
from raymarch.sdf.facts import Exactness
from raymarch.sdf.polyhedra import icosahedral_fold
from raymarch.sdf.rounds import about_y

__all__ = ["blob", "cut_hollow_sphere", "cut_sphere", "death_star", "solid_angle", "vesica"]


# Parts of balls


@shape(
    exactness="exact",
    bounds=lambda radius, half_angle: around_y(
        radius * where(half_angle < 0.5 * math.pi, sin(half_angle), 1.0), radius * min(cos(half_angle), 0.0), radius
    ),
    symmetry="xz",
    convex=lambda half_angle: surely(half_angle <= 0.5 * math.pi),
)
def solid_angle(p: Expr, radius: Positive = 1.0, half_angle: HalfTurn = 0.6) -> Expr:
    """Sector of a ball: its intersection with a cone with the tip at the origin, opening along +y.

    radius : of the ball, > 0. half_angle : between the axis and the side, > 0 and <= pi.

    Exact: the larger of the signed distances to the ball and to the straight side.
    """
    q = about_y(p)
    side = vec2(sin(half_angle), cos(half_angle))
    beyond = dot(q, vec2(side.y, -side.x))
    along = dot(q, side)
    past = max(-along, along - radius)
    to_side = where(past > 0.0, where(beyond < 0.0, -1.0, 1.0) * length(vec2(beyond, past)), beyond)
    return max(length(p) - radius, to_side)


def _rim(radius: Any, cut: Any) -> Expr:
    """Radius of the intersection of a sphere with a horizontal plane."""
    return sqrt((radius - cut) * (radius + cut))


@shape(
    exactness="exact",
    bounds=lambda radius, cut: around_y(where(cut < 0.0, radius, _rim(radius, cut)), cut, radius),
    symmetry="xz",
    check=Fits(lambda radius, cut: abs(cut) < radius, "-radius < cut < radius"),
    convex=True,
)
def cut_sphere(p: Expr, radius: Positive = 1.0, cut: Length = -0.3) -> Expr:
    """The part of a ball above a horizontal plane.

    radius : of the ball, > 0. cut : height of the plane, between -radius and radius.

    Exact: outside, the distance to the sphere for directions from the centre above the rim, else to the flat disc.
    """
    q = about_y(p)
    rim = _rim(radius, cut)
    ball = length(p) - radius
    inside = max(ball, cut - p.y)
    outside = where((ball > 0.0) & (cut * q.x <= rim * q.y), ball, length(vec2(max(q.x - rim, 0.0), cut - q.y)))
    return where(inside > 0.0, outside, inside)


def _cut_hollow_exactness(radius: Any, cut: Any, thickness: Any) -> Exactness:
    """If the wall is thicker than the opening is wide, the field is only a bound inside."""
    middle = radius - 0.5 * thickness
    return "exact" if surely(0.5 * thickness <= where(cut > 0.0, _rim(middle, cut), middle)) else "bound"


def _cut_hollow_bounds(radius: Any, cut: Any, thickness: Any) -> tuple[Expr, Expr]:
    middle = radius - 0.5 * thickness
    wide = where(cut < 0.0, _rim(middle, cut), middle) + 0.5 * thickness
    return around_y(wide, -radius, cut + 0.5 * thickness)


@shape(
    exactness=_cut_hollow_exactness,
    bounds=_cut_hollow_bounds,
    symmetry="xz",
    check=Fits(
        lambda radius, cut, thickness: abs(cut) < radius - 0.5 * thickness,
        "|cut| < radius - thickness / 2",
    ),
    spread=1.0,
)
def cut_hollow_sphere(p: Expr, radius: Positive = 1.0, cut: Length = 0.2, thickness: Positive = 0.1) -> Expr:
    """Bowl: the part of a spherical shell below a horizontal plane, with a rounded rim.

    radius : of the outside, > 0. thickness : full thickness of the wall, > 0.
    cut : height of the plane, which meets the sphere in the middle of the wall.

    Exact, unless the wall closes the opening; then exact outside only.
    """
    middle = radius - 0.5 * thickness
    q = about_y(p)
    rim = vec2(_rim(middle, cut), cut)
    beside = rim.y * q.x >= rim.x * q.y
    return where(beside, abs(length(p) - middle), length(q - rim)) - 0.5 * thickness


def _death_star_rim(radius: Any, bite: Any, distance: Any) -> tuple[Expr, Expr]:
    """Radius and height of the intersection circle of the two spheres."""
    height = 0.5 * ((radius - bite) * (radius + bite) / distance + distance)
    return sqrt((radius - height) * (radius + height)), height


def _death_star_bounds(radius: Any, bite: Any, distance: Any) -> tuple[Expr, Expr]:
    rim, height = _death_star_rim(radius, bite, distance)
    return around_y(where(height < 0.0, rim, radius), -radius, height)


@shape(
    exactness="exact",
    bounds=_death_star_bounds,
    symmetry="xz",
    check=Fits(
        lambda radius, bite, distance: (abs(radius - bite) < distance) & (distance < radius + bite),
        "spheres that intersect: |radius - bite| < distance < radius + bite",
    ),
)
def death_star(p: Expr, radius: Positive = 1.0, bite: Positive = 0.7, distance: Positive = 1.2) -> Expr:
    """Ball minus another ball above it on the y axis.

    radius : of the ball, > 0. bite : radius of the subtracted ball, > 0.
    distance : of the centres; the two spheres must intersect.

    Exact, unlike `difference` of two balls: outside, the distance to a sphere is used only where the nearest point of
    the sphere belongs to the surface, else the distance to the rim.
    """
    q = about_y(p)
    width, height = _death_star_rim(radius, bite, distance)
    rim = vec2(width, height)
    ball = length(p) - radius
    hollow = bite - length(q - vec2(0.0, distance))
    inside = max(ball, hollow)
    below_rim = rim.x * q.y <= rim.y * q.x
    in_bite = rim.x * (distance - q.y) >= (distance - rim.y) * q.x
    outside = where((hollow > 0.0) & in_bite, hollow, length(q - rim))
    return where(inside > 0.0, where((ball > 0.0) & below_rim, ball, outside), inside)


@shape(
    exactness="exact",
    bounds=lambda width, height: cube(0.5 * vec3(width, height, width)),
    symmetry="xyz",
    check=Fits(lambda width, height: width <= height, "width <= height"),
    convex=True,
)
def vesica(p: Expr, width: Positive = 1.0, height: Positive = 2.0) -> Expr:
    """Spindle: a solid of revolution of an arc about the y axis, pointed at both ends.

    width : full width in the middle, > 0 and at most the height; if equal, a ball. height : from tip to tip, > 0.

    Exact: beyond the last normal of the arc the tip is nearest, else the arc.
    """
    q = vec2(length(p.xz), abs(p.y))
    half = 0.5 * height
    beyond_axis = 0.25 * (height - width) * (height + width) / width  # position of the centre of the arc
    at_tip = beyond_axis * (q.y - half) > half * q.x
    to_arc = length(q + vec2(beyond_axis, 0.0)) - (beyond_axis + 0.5 * width)
    return where(at_tip, length(q - vec2(0.0, half)), to_arc)


_ICOSAHEDRON_AXIS = (0.0, math.sqrt(0.5 - 0.1 * math.sqrt(5.0)), math.sqrt(0.5 + 0.1 * math.sqrt(5.0)))


@shape(
    exactness="bound",
    bounds=lambda radius, knob, reach, k: cube(max(radius, _ICOSAHEDRON_AXIS[2] * reach + knob) + 0.25 * k),
    symmetry="xyz",
    spread=1.0,
)
def blob(p: Expr, radius: Positive = 0.65, knob: Positive = 0.3, reach: Positive = 0.65, k: Positive = 0.25) -> Expr:
    """Ball with twelve smoothly blended knobs, towards the vertices of an icosahedron.

    radius : of the ball, > 0. knob : radius of a knob, > 0.
    reach : distance of the knobs' centres from the origin, > 0.
    k : width of the quadratic blend between ball and knobs, > 0.

    A bound: a smooth minimum of distances is 1-Lipschitz. Points are reflected towards the nearest knob, so the knobs
    blend with the ball, not with each other.
    """
    to_knob = length(icosahedral_fold(p) - const(_ICOSAHEDRON_AXIS) * reach) - knob
    return smooth_min(length(p) - radius, to_knob, k)
