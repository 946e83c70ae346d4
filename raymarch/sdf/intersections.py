"""Ray intersections in closed form: the part of a line that lies in a convex solid.

Each function takes the origin and the unit direction of a ray in the object space of a shape, and the parameters of the
shape. It returns the distances (enter, exit) at which the line enters and leaves the solid; enter > exit if the line
misses it. Distances before the origin are negative; those beyond `FARTHEST` are no hits.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from raymarch.expr.derivative import directional_derivatives
from raymarch.expr.function import FloatExpr, Function, Vec2Expr, Vec3Expr, function
from raymarch.expr.node import Expr, Operand, const
from raymarch.expr.vocabulary import abs, clamp, dot, length, max, min, sqrt, vec2, where
from raymarch.expr.walk import substitute
from raymarch.sdf.definition import Definition
from raymarch.sdf.facts import FARTHEST
from raymarch.sdf.node import Node
from raymarch.sdf.rounds import cone, ellipsoid
from raymarch.sdf.solids import box, capsule, cylinder, plane, sphere

TINY = 1e-20
"""Smallest rate at which a ray approaches a plane. A parallel ray meets the plane far away, on its side."""

MISS = (FARTHEST, -FARTHEST)


@function()
def nonzero(rate: FloatExpr) -> Expr:
    """A number that can be divided by: no closer to 0 than `TINY`, with the same sign."""
    return where(abs(rate) < TINY, where(rate < 0.0, -TINY, TINY), rate)


@function()
def overlap(a: Vec2Expr, b: Vec2Expr) -> Expr:
    """The part of a line in both of two convex solids."""
    return vec2(max(a.x, b.x), min(a.y, b.y))


@function()
def hull(a: Vec2Expr, b: Vec2Expr) -> Expr:
    """The part of a line in the union of two convex solids, if the union is convex."""
    both = vec2(min(a.x, b.x), max(a.y, b.y))
    return where(a.x > a.y, b, where(b.x > b.y, a, both))


@function()
def roots(half_b: FloatExpr, h: FloatExpr, c: FloatExpr) -> Expr:
    """The roots of t^2 + 2 half_b t + c, in order; h is the square root of half_b^2 - c.

    The larger in size is computed by a sum of two numbers with the same sign, the other as c divided by it, so neither
    loses digits (pbrt-v4, section 6.8; Numerical Recipes, 5.6).
    """
    q = where(half_b < 0.0, h - half_b, -h - half_b)
    other = c / nonzero(q)
    return vec2(min(q, other), max(q, other))


@function()
def ray_slab(o: FloatExpr, d: FloatExpr, low: FloatExpr, high: FloatExpr) -> Expr:
    """The part of a line between two parallel planes. A line in one of the planes is between them."""
    rate = nonzero(d)
    a, b = (low - o) / rate, (high - o) / rate
    on_plane = (abs(d) < TINY) & ((o - low) * (high - o) >= 0.0)
    return where(on_plane, vec2(-FARTHEST, FARTHEST), vec2(min(a, b), max(a, b)))


@function()
def ray_plane(o: Vec3Expr, d: Vec3Expr, normal: Vec3Expr, offset: FloatExpr) -> Expr:
    """The part of a line in a half-space."""
    rate = nonzero(dot(d, normal))
    t = (offset - dot(o, normal)) / rate
    return where(rate < 0.0, vec2(max(t, -FARTHEST), FARTHEST), vec2(-FARTHEST, min(t, FARTHEST)))


@function()
def ray_sphere(o: Vec3Expr, d: Vec3Expr, radius: FloatExpr) -> Expr:
    """The part of a line in a ball.

    The discriminant is computed from the point of the line closest to the centre (Hearn and Baker), whose distance
    from the centre is not a difference of large numbers.
    """
    half_b = dot(o, d)
    closest = length(o - half_b * d)
    size = length(o)
    h = sqrt(max((radius - closest) * (radius + closest), 0.0))
    return where(closest > radius, vec2(*MISS), roots(half_b, h, (size - radius) * (size + radius)))


@function()
def ray_box(o: Vec3Expr, d: Vec3Expr, size: Vec3Expr) -> Expr:
    """The part of a line in a box: that in all three slabs (Kay and Kajiya 1986)."""
    slabs = [ray_slab(o[i], d[i], -0.5 * size[i], 0.5 * size[i]) for i in range(3)]
    return overlap(overlap(slabs[0], slabs[1]), slabs[2])


@function()
def ray_tube(o: Vec3Expr, d: Vec3Expr, radius: FloatExpr) -> Expr:
    """The part of a line in an infinite cylinder.

    o, d : the origin and the direction without their components along the axis.
    """
    rate = length(d)
    parallel = rate < TINY
    u = d / max(rate, TINY)
    half_b = dot(o, u)
    size = length(o)
    closest = where(parallel, size, length(o - half_b * u))
    h = sqrt(max((radius - closest) * (radius + closest), 0.0))
    found = roots(half_b, h, (size - radius) * (size + radius)) / max(rate, TINY)
    inside = where(parallel, vec2(-FARTHEST, FARTHEST), found)
    return where(closest > radius, vec2(*MISS), inside)


@function()
def ray_cylinder(o: Vec3Expr, d: Vec3Expr, radius: FloatExpr, height: FloatExpr) -> Expr:
    """The part of a line in a capped cylinder about y."""
    side = ray_tube(o * (1.0, 0.0, 1.0), d * (1.0, 0.0, 1.0), radius)
    return overlap(side, ray_slab(o.y, d.y, -0.5 * height, 0.5 * height))


@function()
def ray_capsule(o: Vec3Expr, d: Vec3Expr, a: Vec3Expr, b: Vec3Expr, radius: FloatExpr) -> Expr:
    """The part of a line in a capsule: the hull of those in its cylinder and in the balls at its ends."""
    from_a, axis = o - a, b - a
    height = length(axis)
    w = axis / max(height, TINY)
    up, rise = dot(from_a, w), dot(d, w)
    side = overlap(ray_tube(from_a - up * w, d - rise * w, radius), ray_slab(up, rise, 0.0, height))
    return hull(side, hull(ray_sphere(from_a, d, radius), ray_sphere(o - b, d, radius)))


@function()
def ray_cone(o: Vec3Expr, d: Vec3Expr, radius: FloatExpr, height: FloatExpr, top: FloatExpr) -> Expr:
    """The part of a line in a cone or frustum about y.

    The line is measured from its point closest to the axis between the planes of the ends, so that all numbers are of
    the solid's size. On the line, the square of the cone's radius minus the square of the distance from the axis is a
    quadratic, positive inside. The other nappe of the cone is cut off by the ends of the frustum. Its discriminant is
    the difference of two squares: with the point p and the radius there, both change along the line by d and `rate`,
    |rate p - width d|^2 - |p x d|^2, and neither depends on the point.
    """
    half, heading = 0.5 * height, d.xz
    across = length(heading)
    ends = ray_slab(o.y, d.y, -half, half)
    nearest = clamp(-dot(o.xz, heading) / max(across * across, TINY), ends.x, ends.y)
    up, q = clamp(o.y + nearest * d.y, -half, half), o.xz + nearest * heading
    slope = (top - radius) / height
    width, rate = 0.5 * (radius + top) + slope * up, slope * d.y
    away = length(q)
    turn, lean = length(rate * q - width * heading), abs(q.x * heading.y - q.y * heading.x)
    a = nonzero((rate - across) * (rate + across))
    half_b = width * rate - dot(q, heading)
    h = sqrt(max((turn - lean) * (turn + lean), 0.0))
    larger = where(half_b < 0.0, h - half_b, -h - half_b)
    one, other = larger / a, (width - away) * (width + away) / nonzero(larger)
    first, last = min(one, other), max(one, other)
    steep = where(rate > 0.0, vec2(last, FARTHEST), vec2(-FARTHEST, first))  # through both nappes
    between = where(turn < lean, vec2(*MISS), vec2(first, last))
    side = where(a > 0.0, steep, between)
    straight = across + abs(rate) < TINY  # along the wall of a cylinder
    side = where(straight, where(away > width, vec2(*MISS), vec2(-FARTHEST, FARTHEST)), side)
    found = overlap(side, ray_slab(up, d.y, -half, half))
    beside = (abs(d.y) < TINY) & (abs(o.y) > half)
    # a part may be shorter than an ulp of the sum
    return where((found.x > found.y) | beside, vec2(*MISS), found + nearest)


@function()
def ray_ellipsoid(o: Vec3Expr, d: Vec3Expr, size: Vec3Expr) -> Expr:
    """The part of a line in an ellipsoid: that in the unit ball, in a space scaled by the half axes."""
    nearest = -dot(o, d)
    r = 0.5 * size
    across = d / r
    rate = length(across)
    return ray_sphere((o + nearest * d) / r, across / rate, 1.0) / rate + nearest


_SHAPES: dict[Definition, Function] = {
    made.definition: interval  # type: ignore[union-attr]
    for made, interval in (
        (plane, ray_plane),
        (sphere, ray_sphere),
        (box, ray_box),
        (cylinder, ray_cylinder),
        (capsule, ray_capsule),
        (cone, ray_cone),
        (ellipsoid, ray_ellipsoid),
    )
}
"""The shapes with a closed form."""

NAMES = tuple(definition.name for definition in _SHAPES)
"""The names of these shapes."""


def has_closed_form(node: Node) -> bool:
    """True if a ray's part in the solid is known in closed form: a shape of `NAMES` under rigid transforms and scaling
    by one factor."""
    while is_placed(node) or node.label is not None:
        node = node.children[0]
    return node.definition in _SHAPES


def is_placed(node: Node) -> bool:
    """True if a node is a rigid transform or a scaling by one factor of its child."""
    return node.placed_as in ("rigid", "scale")


def interval_of_ray(node: Node, o: Expr, d: Expr) -> Expr:
    """The distances at which a line enters and leaves a solid of which `has_closed_form` is true.

    o : origin of the ray. d : its direction, of length 1.
    """
    factors: list[Operand] = []
    while is_placed(node) or node.label is not None:
        if node.label is None:
            o, d, factor = _placed(node, o, d)
            factors += [] if factor is None else [factor]
        node = node.children[0]
    found: Expr = _SHAPES[node.definition](o, d, *node.params.values())
    for factor in factors:
        found = found * factor
    return found


_Moved: TypeAlias = tuple[Expr, Expr, Operand | None]
"""A ray in the space of a child, and the length of a unit of that space; None is 1."""


def _placed(node: Node, o: Expr, d: Expr) -> _Moved:
    """The point at which the child is evaluated is affine in the point: directions change by its derivative."""
    point, child, factor = node.definition.placement(node.params)
    (start,) = substitute([child], {point: o})
    if child.op == "div" and child.args == (point, factor):
        return start, d, factor
    (along,) = substitute(directional_derivatives(child, point, [d]), {point: const(np.zeros(point.type.size))})
    return start, along if factor is None else along * factor, factor
