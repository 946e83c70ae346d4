"""Solid shapes. Each is one short function of a point, with its facts in the decorator."""

from __future__ import annotations

from typing import Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.arrays import SMALLEST
from raymarch.expr.node import Expr, expr
from raymarch.expr.vocabulary import clamp, dot, length, max, min, vec2, vec3, vec4, where
from raymarch.sdf.definition import cube, radii_about_y, shape
from raymarch.sdf.domain import Direction, Fits, Length, Positive, Size3, Vec3

__all__ = ["box", "capsule", "cylinder", "plane", "sphere", "torus"]


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
