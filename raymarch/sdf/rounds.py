"""Solids with curved surfaces beyond sphere, cylinder and torus: ellipsoids, cones, parts of balls and rings.

Most are solids of revolution about the y axis: the field depends on the distance of a point from the axis and on its
height. In this half-plane the outline consists of lines and arcs. The nearest piece is the one whose normals pass
through the point; if there is none, the nearest point is a corner between two pieces.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.function import FloatExpr, function, loop
from raymarch.expr.node import Expr
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import (
    abs,
    clamp,
    cos,
    dot,
    length,
    max,
    min,
    normalize,
    pow,
    sin,
    sqrt,
    vec2,
    vec3,
    vec4,
    where,
)
from raymarch.sdf.definition import around_y, cube, radii_about_y, shape
from raymarch.sdf.domain import (
    Acute,
    Domain,
    Fits,
    NonNegative,
    Positive,
    Size3,
    Turn,
    Vec3,
    shown,
    surely,
)
from raymarch.sdf.facts import Exactness
from raymarch.sdf.solids import from_faces

__all__ = ["ellipsoid", "superquadric"]
__all__ += ["capped_torus", "disc", "link"]
__all__ += ["cone", "infinite_cone", "infinite_cylinder", "line", "round_cone", "rounded_cylinder"]

Roundness = Annotated[Any, Domain(FLOAT, low=0.05, high=2.0)]


def about_y(p: Expr) -> Expr:
    """Distance of a point from the y axis, and its height."""
    return vec2(length(p.xz), p.y)


# Ellipsoids


def _ellipsoid_radii(size: Any) -> Expr:
    x, y, z = 0.5 * size
    return vec4(max(y, z), max(x, z), max(x, y), max(x, y, z))


@shape(exactness="exact", bounds=lambda size: cube(0.5 * size), symmetry="xyz", convex=True, radii=_ellipsoid_radii)
def ellipsoid(p: Expr, size: Size3 = (2.0, 1.2, 1.5)) -> Expr:
    """Ellipsoid about the origin.

    size : full extents along x, y and z, each > 0; one number gives a ball.

    Exact. With half axes r, the smallest of which is m, the nearest surface point is r^2 p / (u + r^2 - m^2) for the
    unique u > 0 for which it lies on the surface. In the form 1 / |r p / (u + r^2 - m^2)| = 1 this equation is concave
    in u, so Newton's method approaches its root from the left without overshooting (as in trust-region methods). It
    starts at the root for a single axis. It takes 2 to 4 iterations nearly everywhere; of 10^6 points none took more
    than 18, for axes up to 1 : 1000. The value is the height of p above the tangent plane with the resulting normal n,
    n.p - |r n|. For every n that is a lower bound of the signed distance (support function), so the field is safe
    outside after any number of iterations, and its error is quadratic in the error of the root.
    """
    r = 0.5 * size
    m = min(r.x, r.y, r.z)
    g = (r - m) * (r + m)
    q = max(abs(p), 1e-12 * m)  # off the planes of symmetry, where the root may be 0 and the normal undefined
    a = r * q
    start = max(a.x - g.x, a.y - g.y, a.z - g.z, length(a) - max(g.x, g.y, g.z))

    def newton(i: Expr, u: Expr, miss: Expr) -> list[Expr]:
        x = a / (u + g)
        over = length(x) - 1.0
        return [u + over * dot(x, x) / dot(x, x / (u + g)), abs(over)]

    u, _ = loop(24, [start, 1.0], newton, until=lambda i, u, miss: miss < 1e-6)
    n = normalize(q / (u + g))
    return dot(n, q) - length(r * n)


@function()
def norm2(a: FloatExpr, b: FloatExpr, e: FloatExpr) -> Expr:
    """(a^(2/e) + b^(2/e))^(e/2) for a, b >= 0, with the larger factored out, so that nothing overflows."""
    pair = where(a < b, vec2(b, a), vec2(a, b))
    return pair.x * pow(1.0 + pow(max(pair.y / max(pair.x, 1e-30), 1e-15), 2.0 / e), 0.5 * e)


def _steepest(a: Expr, b: Expr, e: Expr) -> Expr:
    """The largest value of norm2(a x, b y, e) on the unit circle (Hoelder's inequality)."""
    high, low = max(a, b), min(a, b)
    beyond = e - 1.0
    return where(beyond > 0.0, high * pow(1.0 + pow(low / high, 2.0 / max(beyond, 1e-6)), 0.5 * max(beyond, 0.0)), high)


@shape(exactness="bound", bounds=lambda size: cube(0.5 * size), symmetry="xyz", spread=1.0, convex=True)
def superquadric(
    p: Expr, size: Size3 = (1.6, 1.4, 1.6), north_south: Roundness = 0.4, east_west: Roundness = 0.6
) -> Expr:
    """Superellipsoid about the origin (Barr 1981): between box, cylinder, ellipsoid and octahedron.

    size : full extents along x, y and z, each > 0.
    north_south, east_west : Barr's exponents of the outlines in vertical planes and of the horizontal outline, 0.05 to
        2: square towards 0, round at 1, diamond-shaped at 2.

    A bound: up to an exponent of 2 the solid is the unit ball of a norm N. N rises at most by N(v) along a unit
    vector v, and the maximum L of N(v) has a closed form by Hoelder's inequality, so (N - 1) / L is 1-Lipschitz. The
    distance to the bounding box is a bound too; the larger of the two is used.
    """
    half = 0.5 * size
    a = abs(p) / half
    norm = norm2(norm2(a.x, a.z, east_west), a.y, north_south)
    steepest = _steepest(_steepest(1.0 / half.x, 1.0 / half.z, east_west), 1.0 / half.y, north_south)
    return max((norm - 1.0) / steepest, from_faces(abs(p) - half))


# Rings


def _half_angle_sine(angle: Any) -> Expr:
    """Sine of half the angle of an arc; 1 for up to half a circle, whose ends do not approach each other."""
    half = 0.5 * angle
    return where(half < 0.5 * math.pi, 1.0, sin(half))


def _capped_torus_exactness(major: Any, minor: Any, angle: Any) -> Exactness:
    """Where the two round ends overlap, the field is only a bound."""
    closed = surely(angle >= 2.0 * math.pi)
    return "exact" if closed or surely(minor <= major * _half_angle_sine(angle)) else "bound"


def _capped_torus_bounds(major: Any, minor: Any, angle: Any) -> tuple[Expr, Expr]:
    half = 0.5 * angle
    widest = major * where(half < 0.5 * math.pi, sin(half), 1.0)
    return (vec3(major * cos(half) - minor, -minor, -widest - minor), vec3(major + minor, minor, widest + minor))


@shape(
    exactness=_capped_torus_exactness,
    bounds=_capped_torus_bounds,
    symmetry="yz",
    check=Fits(lambda major, minor: minor <= major, "minor <= major"),
    spread=1.0,
)
def capped_torus(p: Expr, major: Positive = 0.8, minor: Positive = 0.2, angle: Turn = 4.0) -> Expr:
    """Part of a torus about the y axis, with round ends, centred on the +x axis.

    major : radius of the centre circle of the tube, > 0.
    minor : radius of the tube, > 0 and not above `major`.
    angle : full angle of the arc, > 0 and <= 2 pi.

    Exact, unless the ends overlap; then exact outside only.
    """
    half = 0.5 * angle
    flat = vec2(p.x, abs(p.z))
    end = vec2(cos(half), sin(half))
    beside = end.y * flat.x - end.x * flat.y >= 0.0
    return where(beside, length(vec2(length(p.xz) - major, p.y)), length(vec3(flat - major * end, p.y))) - minor


@shape(
    exactness="exact",
    bounds=lambda straight, major, minor: cube(vec3(major + minor, 0.5 * straight + major + minor, minor)),
    symmetry="xyz",
    check=Fits(lambda major, minor: minor <= major, "minor <= major"),
)
def link(p: Expr, straight: NonNegative = 0.6, major: Positive = 0.45, minor: Positive = 0.15) -> Expr:
    """Link of a chain: a torus about the z axis, elongated along y.

    straight : length of the two straight parts, >= 0.
    major : radius of the centre line of the bends, > 0. minor : radius of the wire, > 0 and not above `major`.
    """
    bend = vec2(p.x, max(abs(p.y) - 0.5 * straight, 0.0))
    return length(vec2(length(bend) - major, p.z)) - minor


# Cylinders and cones


@shape(exactness="exact", bounds=lambda radius: around_y(radius, -np.inf, np.inf), symmetry="xyz", convex=True)
def infinite_cylinder(p: Expr, radius: Positive = 0.5) -> Expr:
    """Infinite cylinder about the y axis.

    radius : length, > 0.
    """
    return length(p.xz) - radius


@shape(
    exactness="exact",
    bounds=lambda radius, height: cube(vec3(radius, 0.5 * height, radius)),
    symmetry="xyz",
    radii=lambda radius, height: radii_about_y(radius, 0.5 * height),
    check=Fits(
        lambda radius, height, rounding: rounding <= min(radius, 0.5 * height), "rounding <= radius and <= height / 2"
    ),
    convex=True,
)
def rounded_cylinder(p: Expr, radius: Positive = 1.0, height: Positive = 2.0, rounding: NonNegative = 0.2) -> Expr:
    """Cylinder about the y axis with rounded edges.

    radius : of the whole, > 0. height : full height, > 0.
    rounding : radius of the edges, >= 0, at most `radius` and half the height.
    """
    return from_faces(vec2(length(p.xz) - radius, abs(p.y) - 0.5 * height) + rounding) - rounding


@shape(
    exactness="exact",
    bounds=lambda radius, height, top: cube(vec3(max(radius, top), 0.5 * height, max(radius, top))),
    symmetry="xz",
    radii=lambda radius, height, top: radii_about_y(max(radius, top), 0.5 * height),
    check=Fits(lambda radius, top: max(radius, top) > 0.0, "one of them > 0"),
    convex=True,
)
def cone(p: Expr, radius: NonNegative = 1.0, height: Positive = 2.0, top: NonNegative = 0.0) -> Expr:
    """Cone or frustum about the y axis, centred at the origin.

    radius : of the base, at y = -height / 2. top : radius at y = height / 2, 0 for a tip. Each >= 0, not both 0.
    height : full height, > 0.

    Exact: the distance to the nearer of the slanted side and the nearer end; inside, to the nearer of their planes.
    """
    q = about_y(p)
    side = vec2(top - radius, height)
    from_base = q - vec2(radius, -0.5 * height)
    slant = length(side)
    beyond, along = dot(from_base, vec2(side.y, -side.x)) / slant, dot(from_base, side) / slant
    to_side = vec2(beyond, along - clamp(along, 0.0, slant))  # a multiple of the normal, of any length
    above = abs(p.y) - 0.5 * height
    to_end = vec2(max(q.x - where(p.y < 0.0, radius, top), 0.0), above)
    inside = max(beyond, above)
    return where(inside > 0.0, sqrt(min(dot(to_side, to_side), dot(to_end, to_end))), inside)


@shape(exactness="exact", bounds=lambda: around_y(np.inf, -np.inf, 0.0), symmetry="xz", convex=True)
def infinite_cone(p: Expr, half_angle: Acute = 0.5) -> Expr:
    """Infinite cone with its tip at the origin, opening along -y.

    half_angle : between the axis and the side, > 0 and <= pi / 2.
    """
    q = vec2(length(p.xz), -p.y)
    side = vec2(sin(half_angle), cos(half_angle))
    beyond = dot(q, vec2(side.y, -side.x))
    return where(beyond > 0.0, length(vec2(beyond, min(dot(q, side), 0.0))), beyond)


@shape(
    exactness="exact",
    bounds=lambda radius, height, top: around_y(max(radius, top), -0.5 * height - radius, 0.5 * height + top),
    symmetry="xz",
    check=Fits(
        lambda radius, height, top: abs(radius - top) < height,
        "radii that differ by less than the height; else one ball contains the other",
    ),
    convex=True,
)
def round_cone(p: Expr, radius: Positive = 0.6, height: Positive = 1.0, top: Positive = 0.25) -> Expr:
    """Convex hull of two balls on the y axis.

    radius, top : radii of the balls at y = -height / 2 and y = height / 2, each > 0.
    height : distance of the centres, greater than the difference of the radii.

    Exact: the distance to the slanted side where its normals meet the axis between the centres, else to a ball.
    """
    q = vec2(length(p.xz), p.y + 0.5 * height)
    lean = (radius - top) / height
    normal = vec2(sqrt(1.0 - lean * lean), lean)
    along = dot(q, vec2(-normal.y, normal.x))
    side = dot(q, normal) - radius
    ball = where(along < 0.0, length(q) - radius, side)
    return where(along > normal.x * height, length(q - vec2(0.0, height)) - top, ball)


def _check_line(a: Any, b: Any, radius: Any) -> None:
    if a is b:
        raise SceneError(f"line: a and b are the same point {shown(a)}", legal="two points")


def _line_bounds(a: Any, b: Any, radius: Any) -> tuple[Expr, Expr]:
    """The box of the two discs at the ends."""
    along = normalize(b - a)
    reach = radius * sqrt(1.0 - along * along)
    return min(a, b) - reach, max(a, b) + reach


@shape(exactness="exact", bounds=_line_bounds, check=_check_line, convex=True)
def line(p: Expr, a: Vec3, b: Vec3, radius: Positive = 0.2) -> Expr:
    """Cylinder from a to b with flat ends; `capsule` has round ends.

    a, b : centres of the ends, distinct points. radius : length, > 0.
    """
    axis = normalize(b - a)
    from_middle = p - 0.5 * (a + b)
    along = dot(from_middle, axis)
    return from_faces(vec2(length(from_middle - axis * along) - radius, abs(along) - 0.5 * length(b - a)))


@shape(
    exactness="exact",
    bounds=lambda radius, thickness: cube(vec3(radius, 0.5 * thickness, radius)),
    symmetry="xyz",
    convex=True,
    check=Fits(lambda radius, thickness: thickness <= 2.0 * radius, "thickness <= twice the radius"),
)
def disc(p: Expr, radius: Positive = 1.0, thickness: NonNegative = 0.1) -> Expr:
    """Round plate perpendicular to the y axis, with a rounded rim.

    radius : of the whole, the rim included, > 0.
    thickness : full thickness, >= 0 and at most twice the radius; 0 gives a sheet without an inside.
    """
    return length(vec2(max(length(p.xz) - (radius - 0.5 * thickness), 0.0), p.y)) - 0.5 * thickness
