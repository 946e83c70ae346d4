"""Solid shapes. Each is one short function of a point, with its facts in the decorator.

Those with flat faces mostly fold the point by their mirror planes until a single face, its edges and its corner remain.
The distance is then the length of the vector by which the point lies beyond them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.arrays import SMALLEST
from raymarch.expr.function import Vec3Expr, function
from raymarch.expr.node import Expr, expr
from raymarch.expr.vocabulary import (
    all_of,
    clamp,
    cross,
    dot,
    length,
    max,
    min,
    normalize,
    sqrt,
    vec2,
    vec3,
    vec4,
    where,
)
from raymarch.sdf.definition import cube, radii_about_y, shape
from raymarch.sdf.domain import Direction, Fits, Length, NonNegative, Positive, Size2, Size3, Vec3
from raymarch.sdf.facts import Exactness

__all__ = ["box", "capsule", "cylinder", "plane", "sphere", "torus"]
__all__ += ["box_frame", "hexagonal_prism", "pyramid", "rhombus", "rounded_box", "slab", "triangular_prism"]
__all__ += ["quad", "triangle"]


def from_faces(beyond: Expr) -> Expr:
    """Signed distance to faces at right angles, by how far a point lies beyond each."""
    return length(max(beyond, 0.0)) + min(max(*beyond), 0.0)


@shape(
    exactness="exact",
    bounds=lambda radius: cube(radius),
    symmetry="xyz",
    convex=True,
    radii=lambda radius: vec4(radius),
)
def sphere(p: Expr, radius: Positive = 1.0) -> Expr:
    """Sphere about the origin.

    radius : length, > 0.
    """
    return length(p) - radius


@shape(exactness="exact", bounds=lambda size: cube(0.5 * size), symmetry="xyz", convex=True)
def box(p: Expr, size: Size3 = (2.0, 2.0, 2.0)) -> Expr:
    """Box about the origin.

    size : full extents along x, y and z, each > 0; one number gives a cube.
    """
    q = abs(p) - 0.5 * size
    return length(max(q, 0.0)) + min(max(q.x, max(q.y, q.z)), 0.0)


def along_axes(normal: Any) -> list[tuple[Expr, Expr]]:
    """For each axis, whether a direction lies along it, and its component."""
    x, y, z = normal
    off_axis = (y * y + z * z, z * z + x * x, x * x + y * y)
    return [(off <= 0.0, n) for off, n in zip(off_axis, normal, strict=True)]


def _half_space_bounds(normal: Any, offset: Any) -> tuple[Expr, Expr]:
    """Bounded on one side where the normal lies along an axis."""
    lower = [where(along & (n < 0.0), -offset, -np.inf) for along, n in along_axes(normal)]
    return vec3(*lower), vec3(*[where(along & (n > 0.0), offset, np.inf) for along, n in along_axes(normal)])


def _half_space_shift(by: Any, normal: Expr, offset: Expr) -> tuple[dict[str, Any], Any] | None:
    """The half-space from another origin, with nothing left."""
    if not normal.is_constant:
        return None
    unit = np.asarray(normal.data, np.float64) / np.linalg.norm(normal.data)
    return {"offset": offset - float(np.dot(unit, by))}, np.zeros(3)


@shape(exactness="exact", bounds=_half_space_bounds, convex=True, shift=_half_space_shift)
def plane(p: Expr, normal: Direction = (0.0, 1.0, 0.0), offset: Length = 0.0) -> Expr:
    """Solid half-space dot(normal, p) <= offset.

    normal : direction out of the solid, any length but 0.
    offset : distance of the surface from the origin along the normal.
    """
    return dot(p, normal) - offset


@shape(
    exactness="exact",
    bounds=lambda major, minor: cube(vec3(major + minor, minor, major + minor)),
    symmetry="xyz",
    radii=lambda major, minor: radii_about_y(major + minor, minor, major + minor),
    check=Fits(lambda major, minor: minor <= major, "minor <= major"),
)
def torus(p: Expr, major: Positive = 1.0, minor: Positive = 0.25) -> Expr:
    """Torus about the y axis.

    major : radius of the centre line of the tube, > 0.
    minor : radius of the tube, > 0 and not above `major`.
    """
    return length(vec2(length(p.xz) - major, p.y)) - minor


@shape(
    exactness="exact",
    bounds=lambda radius, height: cube(vec3(radius, 0.5 * height, radius)),
    symmetry="xyz",
    convex=True,
    radii=lambda radius, height: radii_about_y(radius, 0.5 * height),
)
def cylinder(p: Expr, radius: Positive = 1.0, height: Positive = 2.0) -> Expr:
    """Capped cylinder about the y axis, centred at the origin.

    radius : length, > 0. height : full height, > 0.
    """
    return from_faces(vec2(length(p.xz) - radius, abs(p.y) - 0.5 * height))


def _capsule_radii(a: Any, b: Any, radius: Any) -> Expr:
    half = 0.5 * (b - a)
    return vec4(length(half.yz), length(half.xz), length(half.xy), length(half)) + radius


def _check_capsule(a: Any, b: Any, radius: Any) -> None:
    if a is b:
        raise SceneError(f"capsule: a and b are the same point {a.data}", legal="two points; one alone is a sphere")


@shape(
    exactness="exact",
    bounds=lambda a, b, radius: (min(a, b) - radius, max(a, b) + radius),
    convex=True,
    radii=_capsule_radii,
    check=_check_capsule,
)
def capsule(p: Expr, a: Vec3 = (0.0, -0.5, 0.0), b: Vec3 = (0.0, 0.5, 0.0), radius: Positive = 0.5) -> Expr:
    """All points within a radius of the segment from a to b.

    a, b : ends of the segment, distinct points. radius : length, > 0.
    """
    pa, ba = p - a, expr(b) - a
    h = clamp(dot(pa, ba) / max(dot(ba, ba), SMALLEST), 0.0, 1.0)  # two Params may meet, and 0/0 is NaN
    return length(pa - ba * h) - radius


def smallest(v: Expr) -> Expr:
    """The smallest component."""
    return min(*v)


def from_side(r: Expr) -> Expr:
    """The distance to an upright prism, by how far a point lies beyond a side, its ends and the height."""
    inside = max(r.x, r.z)
    return where(inside > 0.0, length(max(r, 0.0)), inside)


@shape(
    exactness="exact",
    bounds=lambda size: cube(0.5 * size),
    symmetry="xyz",
    convex=True,
    check=Fits(lambda size, rounding: 2.0 * rounding <= smallest(size), "rounding <= half the smallest extent"),
)
def rounded_box(p: Expr, size: Size3 = (2.0, 2.0, 2.0), rounding: NonNegative = 0.2) -> Expr:
    """Box about the origin with rounded edges and corners.

    size : full extents along x, y and z, rounding included, each > 0; one number gives a cube.
    rounding : radius of the edges, >= 0 and at most half the smallest extent.

    All points within that radius of a smaller box (Minkowski sum), so exact outside and inside.
    """
    return from_faces(abs(p) - 0.5 * size + rounding) - rounding


@shape(
    exactness="exact",
    bounds=lambda size: cube(0.5 * size),
    symmetry="xyz",
    check=Fits(lambda size, thickness: 2.0 * thickness <= smallest(size), "thickness <= half the smallest extent"),
)
def box_frame(p: Expr, size: Size3 = (2.0, 2.0, 2.0), thickness: Positive = 0.2) -> Expr:
    """The twelve edges of a box, as bars of square section.

    size : full extents along x, y and z, each > 0; one number gives a cube.
    thickness : full thickness of a bar, > 0 and at most half the smallest extent.

    Exact. Outside, the nearest of the three bars that meet in the octant of the point. Inside, the nearer of an outer
    face and one of the three square holes, which are infinite prisms. On the surface, where rounding may leave neither
    with a distance, the latter still has a gradient.
    """
    q = abs(p) - 0.5 * size
    beyond = max(q, 0.0)
    across = max(abs(q + 0.5 * thickness) - 0.5 * thickness, 0.0)
    bars = [vec3(*[beyond[i] if i == along else across[i] for i in range(3)]) for along in range(3)]
    outside = sqrt(min(*[dot(bar, bar) for bar in bars]))
    wall = q + thickness
    hole = min(*[from_faces(side) for side in (wall.xy, wall.yz, wall.zx)])
    return where(outside > 0.0, outside, max(*q, -hole))


def _slab_bounds(normal: Any, thickness: Any, offset: Any) -> tuple[Expr, Expr]:
    """Bounded along an axis that the normal lies along."""
    half = 0.5 * thickness
    lower = [where(along, n * offset - half, -np.inf) for along, n in along_axes(normal)]
    return vec3(*lower), vec3(*[where(along, n * offset + half, np.inf) for along, n in along_axes(normal)])


def _slab_symmetry(normal: Any, thickness: Any, offset: Any) -> str:
    """An axis within the slab, or the normal itself if the slab is centred."""
    if not normal.is_constant:
        return ""
    centred = offset.is_constant and not offset.data
    along = np.count_nonzero(normal.data) == 1 and centred
    return "".join(axis for axis, n in zip("xyz", normal.data, strict=True) if n == 0.0 or along)


@shape(exactness="exact", bounds=_slab_bounds, symmetry=_slab_symmetry, convex=True)
def slab(p: Expr, normal: Direction = (0.0, 1.0, 0.0), thickness: Positive = 1.0, offset: Length = 0.0) -> Expr:
    """All points between two parallel planes.

    normal : direction across the slab, any length but 0.
    thickness : full thickness, > 0.
    offset : distance of the middle plane from the origin along the normal.
    """
    return abs(dot(p, normal) - offset) - 0.5 * thickness


@function()
def triangle_squared(p: Vec3Expr, a: Vec3Expr, b: Vec3Expr, c: Vec3Expr) -> Expr:
    """Squared distance to a triangle: to its plane above its inside, else to the nearest edge."""
    n = normalize(cross(b - a, c - a))
    edges, inside = [], []
    for start, end in ((a, b), (b, c), (c, a)):
        along, away = end - start, p - start
        inside.append(dot(cross(n, along), away) > 0.0)
        away = away - along * clamp(dot(away, along) / max(dot(along, along), SMALLEST), 0.0, 1.0)
        edges.append(dot(away, away))
    above = dot(n, p - a)
    return where(all_of(*inside), above * above, min(*edges))


def _refuse_flat(name: str, *corners: Any) -> None:
    """SceneError for a triangle of constant corners on one line."""
    if not all(v.is_constant for v in corners):
        return
    a, b, c = (v.data for v in corners)
    sides = np.linalg.norm([b - a, c - b, a - c], axis=1)
    if np.linalg.norm(np.cross(b - a, c - a)) <= 1e-6 * np.max(sides) ** 2:
        given = ", ".join(str(tuple(v.tolist())) for v in (a, b, c))
        raise SceneError(f"{name}: the corners {given} lie on one line", legal="corners that span an area")


@shape(
    exactness="exact",
    bounds=lambda a, b, c, radius: (min(a, b, c) - radius, max(a, b, c) + radius),
    convex=True,
    check=lambda a, b, c: _refuse_flat("triangle", a, b, c),
)
def triangle(
    p: Expr,
    a: Vec3,
    b: Vec3,
    c: Vec3,
    radius: NonNegative = 0.05,
) -> Expr:
    """Flat triangle in space, grown by a radius on all sides.

    a, b, c : corners, not on one line.
    radius : length, >= 0; 0 gives a sheet without an inside.

    Exact: all points within the radius of a convex flat piece.
    """
    return sqrt(triangle_squared(p, a, b, c)) - radius


def _quad_exactness(a: Any, b: Any, c: Any, d: Any, radius: Any) -> Exactness:
    """Where two pieces meet at an angle, points within the crease are deeper than the field says."""
    if not all(v.is_constant for v in (a, b, c, d)):
        return "bound"
    first = np.cross(b.data - a.data, c.data - a.data)
    second = np.cross(c.data - a.data, d.data - a.data)
    flat = np.linalg.norm(np.cross(first, second)) <= 1e-9 * np.linalg.norm(first) * np.linalg.norm(second)
    third = np.cross(d.data - b.data, a.data - b.data)  # both ends of each diagonal on either side of the other
    fourth = np.cross(c.data - b.data, d.data - b.data)
    return "exact" if flat and first @ second > 0.0 and third @ fourth > 0.0 else "bound"


def _check_quad(a: Any, b: Any, c: Any, d: Any, radius: Any) -> None:
    _refuse_flat("quad", a, b, c)
    _refuse_flat("quad", a, c, d)


@shape(
    exactness=_quad_exactness,
    bounds=lambda a, b, c, d, radius: (min(a, b, c, d) - radius, max(a, b, c, d) + radius),
    spread=1.0,
    convex=lambda *corners, **named: _quad_exactness(*corners, **named) == "exact",
    check=_check_quad,
)
def quad(
    p: Expr,
    a: Vec3,
    b: Vec3,
    c: Vec3,
    d: Vec3,
    radius: NonNegative = 0.05,
) -> Expr:
    """Quadrilateral in space, grown by a radius on all sides: the triangles a b c and a c d.

    a, b, c, d : corners in order.
    radius : length, >= 0; 0 gives a sheet without an inside.

    Exact if the corners lie in one plane and form a convex quadrilateral; else exact outside only.
    """
    return sqrt(min(triangle_squared(p, a, b, c), triangle_squared(p, a, c, d))) - radius


@shape(
    exactness="exact",
    bounds=lambda diagonals, height: cube(vec3(0.5 * diagonals.x, 0.5 * height, 0.5 * diagonals.y)),
    symmetry="xyz",
    convex=True,
)
def rhombus(p: Expr, diagonals: Size2 = (2.0, 1.2), height: Positive = 0.5) -> Expr:
    """Upright prism over a rhombus, about the y axis.

    diagonals : full lengths along x and z, each > 0. height : full height, > 0.

    Exact: a quarter of it has one side; what counts is how far a point lies beyond that side, beyond its ends
    and beyond the height.
    """
    q = abs(p)
    corner = 0.5 * diagonals
    side = length(corner)
    from_corner = vec2(q.x - corner.x, q.z)
    beyond = dot(from_corner, vec2(corner.y, corner.x)) / side
    along = dot(from_corner, vec2(-corner.x, corner.y)) / side
    return from_side(vec3(beyond, max(-along, along - side), q.y - 0.5 * height))


_ROOT_3 = math.sqrt(3.0)


@shape(
    exactness="exact",
    bounds=lambda width, height: cube(vec3(width / _ROOT_3, 0.5 * height, 0.5 * width)),
    symmetry="xyz",
    convex=True,
)
def hexagonal_prism(p: Expr, width: Positive = 1.5, height: Positive = 1.0) -> Expr:
    """Upright prism over a regular hexagon, about the y axis, with two sides perpendicular to z.

    width : across the flats, > 0. height : full height, > 0.

    Exact: mirrored until one side remains, as `rhombus`.
    """
    q = abs(p)
    fold = vec2(-0.5 * _ROOT_3, 0.5)
    flat = vec2(q.x, q.z)
    flat = flat - 2.0 * min(dot(flat, fold), 0.0) * fold
    return from_side(vec3(flat.y - 0.5 * width, abs(flat.x) - 0.5 * width / _ROOT_3, q.y - 0.5 * height))


@shape(
    exactness="exact",
    bounds=lambda side, height: (
        vec3(-0.5 * side, -0.5 * height, -0.5 * side / _ROOT_3),
        vec3(0.5 * side, 0.5 * height, side / _ROOT_3),
    ),
    symmetry="xy",
    convex=True,
)
def triangular_prism(p: Expr, side: Positive = 1.6, height: Positive = 1.0) -> Expr:
    """Upright prism over an equilateral triangle, about the y axis, with a corner towards z.

    side : length of a side of the triangle, > 0; its centroid is at the origin. height : full height, > 0.

    Exact: mirrored until one side remains, as `rhombus`.
    """
    flat = vec2(abs(p.x), p.z)
    fold = vec2(0.5, 0.5 * _ROOT_3)
    flat = flat - 2.0 * max(dot(flat, fold), 0.0) * fold
    return from_side(vec3(-flat.y - 0.5 * side / _ROOT_3, abs(flat.x) - 0.5 * side, abs(p.y) - 0.5 * height))


@shape(
    exactness="exact",
    bounds=lambda width, height: cube(vec3(0.5 * width, 0.5 * height, 0.5 * width)),
    symmetry="xz",
    convex=True,
)
def pyramid(p: Expr, width: Positive = 1.6, height: Positive = 1.4) -> Expr:
    """Square pyramid, its tip up the y axis, its box centred at the origin.

    width : full side of the base, along x and z, > 0. height : from the base to the tip, > 0.

    Exact. Mirrored into the eighth below one half of a slanted face: outside, the nearer of that face with its
    edge and of the base; inside, the nearer of their planes.
    """
    half = 0.5 * width
    slant = length(vec2(half, height))
    edge = length(vec2(half, slant))
    q = where(abs(p.x) < abs(p.z), abs(p.xz), abs(p.zx))
    side, front = q
    up = p.y + 0.5 * height
    beyond = dot(vec2(up, front - half), vec2(half, height)) / slant
    climb = dot(vec2(up, front - half), vec2(height, -half)) / slant
    # In the plane of the face the edge runs from (half, 0) to the tip at (0, slant).
    over = dot(vec2(side - half, climb), vec2(slant, half)) / edge
    along = clamp(dot(vec2(side - half, climb), vec2(-half, slant)) / edge, 0.0, edge)
    to_edge = vec3(beyond, side - half + along * half / edge, climb - along * slant / edge)
    to_base = vec3(max(side - half, 0.0), max(front - half, 0.0), up)
    face = where((over <= 0.0) & (climb >= 0.0), beyond * beyond, dot(to_edge, to_edge))
    planes = max(beyond, -up)
    return where(planes > 0.0, sqrt(min(face, dot(to_base, to_base))), planes)
