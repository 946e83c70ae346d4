"""Flat shapes with curved edges. Each is one short function of a vec2 in the xy plane.

Most consist of circular arcs. The normals at the ends of the arcs divide the plane into regions, each with a known
nearest arc or corner.
"""

from __future__ import annotations

import math
from typing import Any

from raymarch.expr.function import FloatExpr, Vec2Expr, function, loop
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import (
    abs,
    clamp,
    cos,
    dot,
    length,
    max,
    min,
    normalize,
    sin,
    sqrt,
    square,
    stop_gradient,
    vec2,
    where,
)
from raymarch.sdf.curves import bezier_bounds, bezier_exactness, to_bezier
from raymarch.sdf.definition import cube, shape
from raymarch.sdf.domain import Fits, Positive, Size2, Turn, Vec2, surely
from raymarch.sdf.facts import Exactness

__all__ = ["arc", "bezier", "egg", "ellipse", "flat_vesica", "heart", "moon", "pie", "ring"]


@function()
def shallow_arc(p: Vec2Expr, radius: FloatExpr, back: FloatExpr) -> Expr:
    """Distance to the circle about (-back, 0) through (radius, 0).

    Computed as (|c|^2 - r^2) / (|c| + r), because |c| - r would cancel for a flat arc with a distant centre.
    """
    span = radius + back
    return ((p.x - radius) * (p.x + span + back) + p.y * p.y) / (length(p + vec2(back, 0.0)) + span)


@shape(
    exactness="exact",
    bounds=lambda radius, thickness: cube(vec2(radius)),
    symmetry="xy",
    check=Fits(lambda radius, thickness: thickness <= radius, "thickness <= radius"),
    dimension=2,
)
def ring(p: Expr, radius: Positive = 1.0, thickness: Positive = 0.3) -> Expr:
    """The region between two circles about the origin.

    radius : of the outer circle, > 0. thickness : full width, > 0 and at most the radius.
    Exact.
    """
    return abs(length(p) - (radius - 0.5 * thickness)) - 0.5 * thickness


def _arc_bounds(radius: Any, angle: Any, thickness: Any) -> tuple[Expr, Expr]:
    half = min(0.5 * angle, math.pi)
    middle = radius - 0.5 * thickness
    wide = middle * where(half < 0.5 * math.pi, sin(half), 1.0) + 0.5 * thickness
    return vec2(-wide, middle * cos(half) - 0.5 * thickness), vec2(wide, radius)


def _exact_if_open(radius: Expr, angle: Expr, thickness: Expr) -> Exactness:
    """Where the round ends overlap, the field of the nearer end is only a bound."""
    apart = (angle <= math.pi) | ((2.0 * radius - thickness) * sin(0.5 * angle) >= thickness) | (angle >= 2.0 * math.pi)
    return "exact" if surely(apart) else "bound"


@shape(
    exactness=_exact_if_open,
    bounds=_arc_bounds,
    symmetry="x",
    spread=1.0,
    check=Fits(lambda radius, thickness: thickness <= radius, "thickness <= radius"),
    dimension=2,
)
def arc(p: Expr, radius: Positive = 1.0, angle: Turn = 4.0, thickness: Positive = 0.3) -> Expr:
    """A stroke along a circle about the origin, with round ends, open at the bottom.

    radius : of the outer edge, > 0. angle : of the whole arc, half of it on either side of the y axis, in (0, 2 pi].
    thickness : full width, > 0 and at most the radius.

    Exact: the distance to the circle within the angle of the arc, else to its end. A bound inside if the ends overlap.
    """
    middle = radius - 0.5 * thickness
    q = vec2(abs(p.x), p.y)
    end = vec2(max(sin(0.5 * angle), 0.0), cos(0.5 * angle))  # in float32, pi may be more than half a turn
    past = q.x * end.y - q.y * end.x > 0.0
    return where(past, length(q - middle * end), abs(length(q) - middle)) - 0.5 * thickness


def _pie_bounds(radius: Any, angle: Any) -> tuple[Expr, Expr]:
    half = min(0.5 * angle, math.pi)
    wide = radius * where(half < 0.5 * math.pi, sin(half), 1.0)
    return vec2(-wide, radius * min(cos(half), 0.0)), vec2(wide, radius)


@shape(
    # at a full turn the two edges coincide and bound nothing
    exactness=lambda angle: "exact" if surely(angle < 2.0 * math.pi) else "bound",
    bounds=_pie_bounds,
    symmetry="x",
    spread=1.0,
    convex=lambda angle: surely(angle <= math.pi),
    dimension=2,
)
def pie(p: Expr, radius: Positive = 1.0, angle: Turn = 2.0) -> Expr:
    """Sector of a disc about the origin, about the +y axis.

    radius : of the disc, > 0. angle : full opening of the sector, in (0, 2 pi].

    Exact: inside, the distance to the nearer of the circle and a straight edge; outside, to the edge beside it and to
    the circle in front of the arc. A bound at a full turn, where the straight edges vanish.
    """
    q = vec2(abs(p.x), p.y)
    edge = vec2(max(sin(0.5 * angle), 0.0), cos(0.5 * angle))  # in float32, pi may be more than half a turn
    along, over = dot(q, edge), q.x * edge.y - q.y * edge.x
    corner = length(q - edge * clamp(along, 0.0, radius)) * where(over > 0.0, 1.0, -1.0)
    return max(length(q) - radius, where((along > 0.0) & (along < radius), over, corner))


_HEART_TOP = 0.75 + math.sqrt(0.125)


@shape(
    exactness="exact",
    bounds=lambda height: cube(vec2((0.25 + math.sqrt(0.125)) / _HEART_TOP, 0.5) * height),
    symmetry="x",
    dimension=2,
)
def heart(p: Expr, height: Positive = 1.6) -> Expr:
    """A heart centred on its bounding box, tip down: a square on its corner and a half disc on each upper side.

    height : full height, > 0; the width is 1.094 times as much.

    Exact. With the square's diagonal as unit, tip at 0: above the line x + y = 1 the nearest point lies on the arc
    about (1/4, 3/4); below it on the straight side from the tip, or it is the notch at (0, 1).
    """
    unit = height / _HEART_TOP
    q = vec2(abs(p.x), p.y + 0.5 * height) / unit
    side = where(q.x + q.y > 0.0, (q.x - q.y) * math.sqrt(0.5), length(q))
    straight = max(side, -length(q - vec2(0.0, 1.0)))
    return unit * where(q.x + q.y > 1.0, length(q - vec2(0.25, 0.75)) - math.sqrt(0.125), straight)


@shape(
    exactness="exact",
    bounds=lambda width, height: cube(0.5 * vec2(width, height)),
    symmetry="xy",
    convex=True,
    check=Fits(lambda width, height: width <= height, "width <= height"),
    dimension=2,
)
def flat_vesica(p: Expr, width: Positive = 1.0, height: Positive = 2.0) -> Expr:
    """A pointed lens about the origin, upright: the intersection of two equal discs.

    width, height : full extents, 0 < width <= height; equal extents give a disc.

    Exact. With radius r = (w^2 + h^2) / 4w the arc's centre lies at (w/2 - r, 0) (a chord's sagitta); beyond the
    arc's normal at the tip the tip is nearest.
    """
    q, tip = abs(p), vec2(0.0, 0.5 * height)
    back = (height - width) * (height + width) / (4.0 * width)
    at_tip = (q.y - tip.y) * back > q.x * tip.y
    return where(at_tip, length(q - tip), shallow_arc(q, 0.5 * width, back))


@shape(exactness="exact", bounds=lambda size: cube(0.5 * size), symmetry="xy", convex=True, dimension=2)
def ellipse(p: Expr, size: Size2 = (2.0, 1.2)) -> Expr:
    """Ellipse about the origin.

    size : full extents along x and y, each > 0.

    Exact to rounding. The nearest point of an ellipse with half axes a >= b is (a^2 x / (t + a^2), b^2 y / (t + b^2))
    for the largest root t of (a x / (t + a^2))^2 + (b y / (t + b^2))^2 = N^2 = 1 (Lagrange). 1/N is concave in t and
    Newton's method on it approaches the root from the left without overshooting. The resulting normal n gives the
    distance as p.n minus the ellipse's support function |(a n_x, b n_y)|. It is stationary at the true n, so the error
    of the distance is quadratic in the error of the root.
    """
    wide = size.x >= size.y
    a, b = 0.5 * max(size.x, size.y), 0.5 * min(size.x, size.y)
    x = where(wide, abs(p.x), abs(p.y))
    y = max(where(wide, abs(p.y), abs(p.x)), 1e-15 * b)  # on the long axis the root coincides with the pole
    c = (a - b) * (a + b)

    def climb(s: Expr) -> Expr:
        u, v = a * x / (s + c), b * y / s
        squared = u * u + v * v
        return s + squared * (sqrt(squared) - 1.0) / (u * u / (s + c) + v * v / s)

    def arrived(i: Expr, s: Expr) -> Expr:
        return square(a * x / (s + c)) + square(b * y / s) < 1.0 + 1e-5

    (s,) = loop(24, [max(b * y, a * x - c)], lambda i, s: [climb(s)], until=arrived)  # s = t + b^2
    s = climb(s)  # the last step squares the remaining error
    n = normalize(stop_gradient(normalize(vec2(x / (s + c), y / s))))
    return dot(vec2(x, y), n) - length(vec2(a, b) * n)


@shape(
    exactness="exact",
    bounds=lambda width, height: cube(0.5 * vec2(width, height)),
    symmetry="x",
    convex=True,
    check=Fits(
        lambda width, height, tip: (width <= height) & (2.0 * tip < width), "width <= height, and tip < half the width"
    ),
    dimension=2,
)
def egg(p: Expr, width: Positive = 1.2, height: Positive = 1.6, tip: Positive = 0.3) -> Expr:
    """An egg centred on its bounding box, the narrow end up.

    width, height : full extents, 0 < width <= height. tip : radius of the narrow end, > 0 and below half the width.

    Exact. Four kinds of arcs that join smoothly: a half circle of radius R = width / 2 below, the tip's circle of
    radius r about (0, h), and on each side an arc about (-c, 0) of radius R + c that touches both, for which
    c^2 + h^2 = (R + c - r)^2.
    """
    radius = 0.5 * width
    rise = height - radius - tip
    back = (rise * rise - square(radius - tip)) / (2.0 * (radius - tip))
    q = vec2(abs(p.x), p.y + 0.5 * height - radius)
    at_tip = back * q.y > rise * (q.x + back)
    upper = where(at_tip, length(vec2(q.x, q.y - rise)) - tip, shallow_arc(q, radius, back))
    return where(q.y < 0.0, length(q) - radius, upper)


def _horn(radius: Any, bite: Any, distance: Any) -> tuple[Any, Any]:
    """The intersection of the two circles: x, and y >= 0."""
    x = (radius * radius - bite * bite + distance * distance) / (2.0 * distance)
    return x, sqrt(max((radius - x) * (radius + x), 0.0))


def _moon_bounds(radius: Any, bite: Any, distance: Any) -> tuple[Expr, Expr]:
    x, y = _horn(radius, bite, distance)
    high = where(x < 0.0, min(y, radius), radius)
    return vec2(-radius, -high), vec2(clamp(x, -radius, radius), high)


@shape(
    exactness="exact",
    bounds=_moon_bounds,
    symmetry="y",
    check=Fits(
        lambda radius, bite, distance: (distance < radius + bite) & (abs(radius - bite) < distance),
        "circles that cross: |radius - bite| < distance < radius + bite",
    ),
    dimension=2,
)
def moon(p: Expr, radius: Positive = 1.0, bite: Positive = 0.8, distance: Positive = 0.6) -> Expr:
    """A crescent: a disc about the origin minus another disc on the +x axis.

    radius : of the disc, > 0. bite : radius of the subtracted disc, > 0. distance : of the centres. The two
    circles must intersect, so it lies between the difference and the sum of the radii.

    Exact. Between the normals of the two arcs at a horn the horn is nearest; elsewhere the hard difference is exact.
    """
    x, y = _horn(radius, bite, distance)
    q = vec2(p.x, abs(p.y))
    at_horn = q.x * y - q.y * x > distance * max(y - q.y, 0.0)
    apart = max(length(q) - radius, bite - length(q - vec2(distance, 0.0)))
    return where(at_horn, length(q - vec2(x, y)), apart)


# The quadratic Bézier curve


@shape(
    exactness=lambda a, b, c, thickness: bezier_exactness(a, b, c, 0.5 * thickness),
    bounds=lambda a, b, c, thickness: bezier_bounds(a, b, c, 0.5 * thickness),
    spread=1.0,
    dimension=2,
)
def bezier(p: Expr, a: Vec2, b: Vec2, c: Vec2, thickness: Positive = 0.25) -> Expr:
    """A stroke along a quadratic Bézier curve, with round ends.

    a, b, c : the control points; the curve runs from a to c, and its tangents at both ends pass through b.
    thickness : full width, > 0.

    Exact if no radius of curvature is below half the thickness, else a bound inside.
    """
    return to_bezier(p, a, b, c) - 0.5 * thickness
