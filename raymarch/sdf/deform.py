"""Deformations. Each divides the field by its largest stretch of space over the box of its child.

A twist or bend stretches more the farther out it acts, so it is not evaluated beyond the reach of the child. There the
field combines two distances. Let c be the nearest point of the reach, which is convex: every point x of the solid has
|p - x|^2 >= |p - c|^2 + |c - x|^2. So the distance to the reach and the field at c add up like the sides of a right
triangle.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, expr
from raymarch.expr.vocabulary import abs, clamp, cos, length, max, min, sin, sqrt, vec2, vec3
from raymarch.sdf.definition import Child, ChildFacts, around_y, operator
from raymarch.sdf.domain import Length, NonNegative, Number, Positive, Scalar, Vec3, Vector, as_operand
from raymarch.sdf.facts import Facts
from raymarch.sdf.node import Node, method, solid


def _reach(node: Node, name: str, axes: str) -> float:
    """Largest distance of the child from the origin in the plane of some axes. SceneError if it is unbounded there."""
    solid(name, node)
    picks = ["xyz".index(axis) for axis in axes]
    corner = np.maximum(np.abs(node.facts.lower), np.abs(node.facts.upper))[picks]
    reach = float(np.linalg.norm(corner))
    if not np.isfinite(reach):
        raise SceneError(
            f"{name}: {node.name} is unbounded across {axes}, so its stretch has no limit",
            legal="a bounded solid; intersect it with a box first",
        )
    return reach if reach > 0.0 else 1.0


def _check_reach(axes: str) -> Any:
    """A check that the solid lies within the reach that is given to the definition."""

    def check(child: Facts, reach: Expr, **_: Any) -> None:
        corner = np.maximum(np.abs(child.lower), np.abs(child.upper))[["xyz".index(axis) for axis in axes]]
        known, least = float(interval_of(reach)[0]), float(np.linalg.norm(corner))
        if not least <= known * (1 + 1e-12):
            raise SceneError(
                f"reach = {known:g}, but the solid reaches {least:g} across {axes}", legal=f"reach >= {least:g}"
            )

    return check


def _joined(distance: Expr, value: Expr, slope: Scalar) -> Expr:
    """The distance to the reach combined with the field there, before the field is divided by `slope`."""
    return length(vec2(slope * distance, max(value, 0.0))) + min(value, 0.0)


def twist_slope(rate: Scalar, reach: Scalar) -> Expr:
    """Largest stretch of a twist: the larger singular value of its local shear at a radius."""
    m = abs(rate) * reach
    return 0.5 * (m + sqrt(m * m + 4.0))


@operator(
    bounds=lambda child, reach: around_y(reach, child.lower.y, child.upper.y),
    lipschitz=lambda child, rate, reach: child.lipschitz * twist_slope(rate, reach),
    spread=lambda child: max(child.spread, 1.0),
    check=_check_reach("xz"),
    called="twist",
)
def twist_about_y(p: Expr, child: Child, rate: Number, reach: Positive) -> Expr:
    """Twist about the y axis by an angle proportional to y."""
    radius = length(p.xz)
    held = p.xz * (reach / max(radius, reach))
    c, s = cos(rate * p.y), sin(rate * p.y)
    value = child(vec3(c * held.x - s * held.y, p.y, s * held.x + c * held.y))
    return _joined(radius - length(held), value, twist_slope(rate, reach))


@method
def twist(node: Node, rate: Scalar = 1.0) -> Node:
    """Twist about the y axis by `rate` radians per unit of y.

    A bound: divided by (m + sqrt(m^2 + 4)) / 2, where m is rate times the largest distance of the solid from the axis.
    The solid must be bounded along x and z.
    """
    return twist_about_y(node, rate, _reach(node, "twist", "xz"))


@operator(
    bounds=lambda child, reach: (vec3(-reach, -reach, child.lower.z), vec3(reach, reach, child.upper.z)),
    lipschitz=lambda child, rate, reach: child.lipschitz * (1.0 + abs(rate) * reach),
    spread=lambda child: max(child.spread, 1.0),
    check=_check_reach("xy"),
    called="bend",
)
def bend_about_z(p: Expr, child: Child, rate: Number, reach: Positive) -> Expr:
    """Bend about the z axis by an angle proportional to x."""
    radius = length(p.xy)
    held = p.xy * (reach / max(radius, reach))
    c, s = cos(rate * held.x), sin(rate * held.x)
    value = child(vec3(c * held.x + s * held.y, c * held.y - s * held.x, p.z))
    return _joined(radius - length(held), value, 1.0 + abs(rate) * reach)


@method
def bend(node: Node, rate: Scalar = 0.5) -> Node:
    """Bend about the z axis by `rate` radians per unit of x: a bar along x curls up.

    A bound: divided by 1 + rate times the largest distance of the solid from the z axis. The solid must be bounded
    along x and y.
    """
    return bend_about_z(node, rate, _reach(node, "bend", "xy"))


def _widest(rate: Scalar, low: Scalar, high: Scalar) -> Expr:
    """The larger factor of the two ends of a taper."""
    return max(1.0 + rate * low, 1.0 + rate * high)


def taper_slope(rate: Scalar, reach: Scalar, low: Scalar, high: Scalar) -> Expr:
    """Largest singular value of (x, y) -> (x / s(y), y), with x / s(y) up to reach times the widest over s."""
    bottom, top = 1.0 + rate * low, 1.0 + rate * high
    least, most = min(bottom, top), max(bottom, top)
    a, b = 1.0 / least, reach * most * abs(rate) / (least * least)
    square = a * a + b * b + 1.0
    return sqrt(0.5 * (square + sqrt(square * square - 4.0 * a * a)))


def _check_taper(child: Facts, rate: Expr, reach: Expr, low: Expr, high: Expr) -> None:
    _check_reach("xz")(child, reach=reach)
    if not (float(interval_of(low)[1]) <= child.lower[1] and child.upper[1] <= float(interval_of(high)[0])):
        raise SceneError(
            "taper: the solid extends beyond low or high", legal="low and high outside the bounds of the solid"
        )
    least = np.min([interval_of(1.0 + rate * end)[0] for end in (low, high)])
    if not least > 0.01:
        raise SceneError(
            f"taper: the solid shrinks to {float(least):g} of its width at one end",
            legal="a rate that leaves at least 0.01 of the width over the solid's height",
        )


@operator(
    bounds=lambda child, rate, reach, low, high: around_y(_widest(rate, low, high) * reach, low, high),
    lipschitz=lambda child, rate, reach, low, high: child.lipschitz * taper_slope(rate, reach, low, high),
    spread=lambda child, rate, low, high: max(child.spread, 1.0) * max(1.0, _widest(rate, low, high)),
    check=_check_taper,
    called="taper",
)
def taper_along_y(p: Expr, child: Child, rate: Number, reach: Positive, low: Length, high: Length) -> Expr:
    """Scale across the y axis by a factor that grows with y."""
    y = clamp(p.y, low, high)
    wide = _widest(rate, low, high) * reach
    radius = length(p.xz)
    held = p.xz * (wide / max(radius, wide))
    width = 1.0 + rate * y
    value = child(vec3(held.x / width, y, held.y / width))
    distance = length(vec2(radius - length(held), p.y - y))
    return _joined(distance, value, taper_slope(rate, reach, low, high))


@method
def taper(node: Node, rate: Scalar = 0.3) -> Node:
    """Taper along y: at height y the solid is scaled across y by the factor 1 + rate y.

    A bound: divided by the largest stretch over the solid's box. The solid must be bounded.
    """
    reach = _reach(node, "taper", "xz")
    low, high = float(node.facts.lower[1]), float(node.facts.upper[1])
    if not np.isfinite(low + high):
        raise SceneError(f"taper: {node.name} is unbounded along y", legal="a bounded solid")
    return taper_along_y(node, rate, reach, low, high)


def _waves_slope(child: ChildFacts, amplitude: Expr, frequency: Expr) -> Expr:
    """The gradient of sin(fx) sin(gy) sin(hz) is no longer than its largest frequency."""
    f = abs(frequency)
    return child.lipschitz + amplitude * max(f.x, max(f.y, f.z))


@operator(
    bounds=lambda child, amplitude: child.grown(amplitude),
    lipschitz=_waves_slope,
    spread=lambda child: child.spread,
    called="displace",
)
def displace_by_waves(
    p: Expr, child: Child, amplitude: NonNegative = 0.05, frequency: Vec3 = (10.0, 10.0, 10.0)
) -> Expr:
    """Displace by a product of three sines, which is added to the field."""
    waves = sin(frequency * p)
    return child(p) + amplitude * waves.x * waves.y * waves.z


@method
def displace(node: Node, amplitude: Scalar = 0.05, frequency: Vector | Scalar = 10.0) -> Node:
    """Displace by amplitude times sin(fx x) sin(fy y) sin(fz z), which is added to the field.

    amplitude : length >= 0.
    frequency : radians per unit of length, one number or three.

    A bound: divided by 1 + amplitude times the largest frequency.
    """
    each = as_operand("displace: frequency", frequency, "radians a unit of length, one number or three")
    return displace_by_waves(node, amplitude, each if each.type.is_vector else expr((each,) * 3))
