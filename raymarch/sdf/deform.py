"""Deformations. Each divides the field by its largest stretch of space over the box of its child.

A twist or bend stretches more the farther out it acts, so it is not evaluated beyond the reach of the child. There the
field combines two distances. Let c be the nearest point of the reach, which is convex: every point x of the solid has
|p - x|^2 >= |p - c|^2 + |c - x|^2. So the distance to the reach and the field at c add up like the sides of a right
triangle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.arrays import SMALLEST
from raymarch.expr.convert import choice, short
from raymarch.expr.degrees import suspect_degrees
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, Operand, expr
from raymarch.expr.vocabulary import abs, atan2, clamp, cos, dot, length, max, min, sin, sqrt, vec2, vec3, where
from raymarch.sdf.definition import Child, around_y, operator
from raymarch.sdf.domain import (
    Length,
    NonNegative,
    Number,
    Positive,
    Scalar,
    Vec3,
    Vector,
    Whole,
    as_length,
    as_operand,
)
from raymarch.sdf.facts import Facts
from raymarch.sdf.node import Node, method, solid
from raymarch.sdf.noise import displace_by
from raymarch.sdf.placing import AXES
from raymarch.sdf.repetition import UNBOUNDED
from raymarch.sdf.values import at_least


def _farthest(facts: Facts, axes: str) -> float:
    """The distance of the farthest corner of a box from the origin, in the plane of some axes."""
    corner = np.maximum(np.abs(facts.lower), np.abs(facts.upper))
    return float(np.linalg.norm(corner[["xyz".index(axis) for axis in axes]]))


def _reach(node: Node, name: str, axes: str) -> float:
    """Largest distance of the child from the origin in the plane of some axes. SceneError if it is unbounded there."""
    reach = _farthest(solid(name, node).facts, axes)
    if not np.isfinite(reach):
        what = f"{name}: {node.name} is unbounded across {axes}, so its stretch has no limit"
        raise SceneError(what, legal="a bounded solid; intersect it with a box first")
    return reach if reach > 0.0 else 1.0


def _check_reach(axes: str) -> Any:
    """A check that the solid lies within the reach that is given to the definition."""

    def check(child: Facts, reach: Expr, **_: Any) -> None:
        known, least = float(interval_of(reach)[0]), _farthest(child, axes)
        if not least <= known * (1 + 1e-12):
            what = f"reach = {known:g}, but the solid reaches {least:g} across {axes}"
            raise SceneError(what, legal=f"reach >= {least:g}")

    return check


BEYOND = 1e-4
"""By how much the region in which a solid is deformed is larger than its reach, relative to that. Beyond the region the
gradient is the region's. A hit, which may lie a little outside the solid, has the normal of the solid."""


def _joined(distance: Expr, value: Expr, slope: Scalar) -> Expr:
    """The distance to the reach combined with the field there, before the field is divided by `slope`."""
    return length(vec2(slope * distance, max(value, 0.0))) + min(value, 0.0)


def twist_slope(rate: Scalar, reach: Scalar) -> Expr:
    """Largest stretch of a twist: the larger singular value of its local shear at a radius."""
    m = abs(rate) * reach
    return 0.5 * (m + sqrt(m * m + 4.0))


@operator(
    bounds=lambda child, reach: around_y((1.0 + BEYOND) * reach, child.lower.y, child.upper.y),
    lipschitz=lambda child, rate, reach: child.lipschitz * twist_slope(rate, (1.0 + BEYOND) * reach),
    spread=lambda child: max(child.spread, 1.0),
    check=_check_reach("xz"),
    placing="deform",
    called="twist",
)
def twist_about_y(p: Expr, child: Child, rate: Number, reach: Positive) -> Expr:
    """Twist about the y axis by an angle proportional to y."""
    reach = (1.0 + BEYOND) * expr(reach)
    radius = length(p.xz)
    held = p.xz * (reach / max(radius, reach))
    c, s = cos(rate * p.y), sin(rate * p.y)
    value = child(vec3(c * held.x - s * held.y, p.y, s * held.x + c * held.y))
    return _joined(radius - length(held), value, twist_slope(rate, reach))


@method
def twist(node: Node, rate: Scalar = 1.0) -> Node:
    """Twist about the y axis by `rate` radians per unit of y.

    Parameters
    ----------
    rate : radians per unit of length, finite.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound: divided by (m + sqrt(m^2 + 4)) / 2, where m is rate times the largest distance of the solid from the axis.
    The solid must be bounded along x and z.
    """
    suspect_degrees("twist: rate", rate, "radians per unit")
    return twist_about_y(node, rate, _reach(node, "twist", "xz"))


@operator(
    bounds=lambda child, reach: (
        vec3(-(1.0 + BEYOND) * reach, -(1.0 + BEYOND) * reach, child.lower.z),
        vec3((1.0 + BEYOND) * reach, (1.0 + BEYOND) * reach, child.upper.z),
    ),
    lipschitz=lambda child, rate, reach: child.lipschitz * (1.0 + abs(rate) * (1.0 + BEYOND) * reach),
    spread=lambda child: max(child.spread, 1.0),
    check=_check_reach("xy"),
    placing="deform",
    called="bend",
)
def bend_about_z(p: Expr, child: Child, rate: Number, reach: Positive) -> Expr:
    """Bend about the z axis by an angle proportional to x."""
    reach = (1.0 + BEYOND) * expr(reach)
    radius = length(p.xy)
    held = p.xy * (reach / max(radius, reach))
    c, s = cos(rate * held.x), sin(rate * held.x)
    value = child(vec3(c * held.x + s * held.y, c * held.y - s * held.x, p.z))
    return _joined(radius - length(held), value, 1.0 + abs(rate) * reach)


@method
def bend(node: Node, rate: Scalar = 0.5) -> Node:
    """Bend about the z axis by `rate` radians per unit of x: a bar along x curls up.

    Parameters
    ----------
    rate : radians per unit of length, finite.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound: divided by 1 + rate times the largest distance of the solid from the z axis. The solid must be bounded
    along x and y.
    """
    suspect_degrees("bend: rate", rate, "radians per unit")
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


def _beyond(rate: Scalar, reach: Scalar, low: Scalar, high: Scalar) -> tuple[Expr, Expr, Expr]:
    """The reach and the ends of the region that a taper deforms. The narrower end keeps its width but for `BEYOND`."""
    narrow = min(1.0 + rate * low, 1.0 + rate * high)
    margin = BEYOND * min(expr(high) - low, narrow / max(abs(rate), SMALLEST))
    return (1.0 + BEYOND) * expr(reach), low - margin, high + margin


def _tapered_bounds(rate: Scalar, reach: Expr, low: Expr, high: Expr) -> tuple[Expr, Expr]:
    return around_y(_widest(rate, low, high) * reach, low, high)


def _check_taper(child: Facts, rate: Expr, reach: Expr, low: Expr, high: Expr) -> None:
    _check_reach("xz")(child, reach=reach)
    if not (float(interval_of(low)[1]) <= child.lower[1] and child.upper[1] <= float(interval_of(high)[0])):
        what = "taper: the solid extends beyond low or high"
        raise SceneError(what, legal="low and high outside the bounds of the solid")
    least = np.min([interval_of(1.0 + rate * end)[0] for end in (low, high)])
    if not least > 0.01:
        what = f"taper: the solid shrinks to {float(least):g} of its width at one end"
        raise SceneError(what, legal="a rate that leaves at least 0.01 of the width over the solid's height")


@operator(
    bounds=lambda child, rate, reach, low, high: _tapered_bounds(rate, *_beyond(rate, reach, low, high)),
    lipschitz=lambda child, rate, reach, low, high: (
        child.lipschitz * taper_slope(rate, *_beyond(rate, reach, low, high))
    ),
    spread=lambda child, rate, low, high: max(child.spread, 1.0) * max(1.0, _widest(rate, low, high)),
    check=_check_taper,
    placing="deform",
    called="taper",
)
def taper_along_y(p: Expr, child: Child, rate: Number, reach: Positive, low: Length, high: Length) -> Expr:
    """Scale across the y axis by a factor that grows with y."""
    reach, low, high = _beyond(rate, reach, low, high)
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

    Parameters
    ----------
    rate : change of the factor per unit of length; it must stay above 0 in the solid's box.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : an unbounded solid, or a rate that is too large for it.

    Notes
    -----
    A bound: divided by the largest stretch over the solid's box.
    """
    reach = _reach(node, "taper", "xz")
    low, high = float(node.facts.lower[1]), float(node.facts.upper[1])
    if not np.isfinite(low + high):
        raise SceneError(f"taper: {node.name} is unbounded along y", legal="a bounded solid")
    return taper_along_y(node, rate, reach, low, high)


@operator(
    bounds=lambda child, amplitude: child.grown(amplitude),
    # the gradient of sin(fx) sin(gy) sin(hz) is no longer than its largest frequency
    lipschitz=lambda child, amplitude, frequency: child.lipschitz + amplitude * max(*abs(frequency)),
    spread="keep",
    called="displace",
)
def displace_by_waves(
    p: Expr, child: Child, amplitude: NonNegative = 0.05, frequency: Vec3 = (10.0, 10.0, 10.0)
) -> Expr:
    """Displace by a product of three sines, which is added to the field."""
    waves = sin(frequency * p)
    return child(p) + amplitude * waves.x * waves.y * waves.z


@method
def displace(
    node: Node, amplitude: Scalar | Callable[[Expr], Operand] = 0.05, frequency: Vector | Scalar = 10.0
) -> Node:
    """Displace by amplitude times sin(fx x) sin(fy y) sin(fz z), which is added to the field.

    Parameters
    ----------
    amplitude : length >= 0; or a function of the point, for `displace_by`: `lambda p: 0.1 * rm.fbm(p)`.
    frequency : radians per unit of length, one number or three.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound: divided by 1 + amplitude times the largest frequency.
    """
    if callable(amplitude):
        return displace_by(node, amplitude)
    each = as_operand("displace: frequency", frequency, "radians a unit of length, one number or three")
    return displace_by_waves(node, amplitude, each if each.type.is_vector else expr((each,) * 3))


def shear_slope(amount: Expr) -> Expr:
    """The larger singular value of the matrix with rows (1, a) and (0, 1)."""
    a = abs(amount)
    return 0.5 * (a + sqrt(a * a + 4.0))


@operator(
    bounds=lambda child, amount, axis, by: child.box + amount * axis * dot(by, child.box),
    lipschitz=lambda child, amount: child.lipschitz * shear_slope(amount),
    spread=lambda child, amount: child.spread * (1.0 + abs(amount)),
    placing="stretch",
    called="shear",
)
def sheared(
    p: Expr, child: Child, amount: Length = 0.5, axis: Vec3 = (1.0, 0.0, 0.0), by: Vec3 = (0.0, 1.0, 0.0)
) -> Expr:
    """Shear along one axis in proportion to the coordinate along another."""
    return child(p - amount * axis * dot(by, p))


@method
def shear(node: Node, amount: Scalar = 0.5, axis: str = "x", by: str = "y") -> Node:
    """Shear along one axis by `amount` times the coordinate along another.

    Parameters
    ----------
    amount : length per unit of length.
    axis, by : two of "x", "y", "z": the axis of the motion, and the axis whose coordinate counts.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound: divided by (a + sqrt(a^2 + 4)) / 2 with a = |amount|, the largest stretch. The stretch is the same
    everywhere, so the solid may be unbounded.
    """
    legal = "two different ones of 'x', 'y' and 'z'"
    axis, by = choice("shear: axis", axis, tuple(AXES), legal), choice("shear: by", by, tuple(AXES), legal)
    if axis == by:
        raise SceneError(f"shear: axis = {short(axis)}, by = {short(by)}", legal=legal)
    return sheared(solid("shear", node), amount, AXES[axis], AXES[by])


RELIEF = 0.125
"""Limit of distances inside the ring, as a fraction of its radius."""


def _check_wrapped(
    child: Facts, start: Expr, end: Expr, below: Expr, above: Expr, low: Expr, high: Expr, both: int
) -> None:
    """SceneError unless the slab fits its ring, leaves the axis free, and is evaluated twice if it is not symmetric."""
    bottom, top = np.maximum(child.lower[1], -UNBOUNDED), np.minimum(child.upper[1], UNBOUNDED)
    if not (interval_of(low)[1] <= bottom and top <= interval_of(high)[0]):
        what = "wrapped: the solid extends beyond low or high"
        raise SceneError(what, legal="low and high outside the bounds of the solid")
    first, last, radius = interval_of(start)[1], interval_of(end)[0], interval_of((end - start) / math.tau)
    slack = 1e-9 * float(radius[1])
    if not (child.lower[0] >= first - slack and child.upper[0] <= last + slack and radius[0] > 0.0):
        what = f"wrap_around: the solid reaches along x from {child.lower[0]:g} to {child.upper[0]:g}"
        raise SceneError(what, legal="start and end around the solid; cut an unbounded solid, as `node & box(...)`")
    if not (-child.lower[2] <= interval_of(below)[0] and child.upper[2] <= interval_of(above)[0]) or not (
        radius[0] > interval_of(below)[1]
    ):
        raise SceneError(
            f"wrap_around: the solid reaches along z from {child.lower[2]:g} to {child.upper[2]:g}, the radius of the "
            f"ring is {float(radius[0]):g}",
            legal="a solid bounded along z that leaves the axis free, or a larger end - start",
        )
    if not both and not _is_centred(child, start, end):
        raise SceneError("wrapped: this solid must be evaluated at both ends", legal="both=1")


def _is_centred(child: Facts, start: Expr, end: Expr) -> bool:
    """True if the slab is symmetric about the middle of its ring."""
    ends = start + end
    return "x" in child.symmetry and ends.is_constant and float(ends.data) == 0.0


@operator(
    bounds=lambda child, start, end, above: around_y((end - start) / math.tau + above, child.lower.y, child.upper.y),
    lipschitz=1.0,
    spread=1.0,
    check=_check_wrapped,
    called="wrap_around",
)
def wrapped(
    p: Expr,
    child: Child,
    start: Length = -3.0,
    end: Length = 3.0,
    below: NonNegative = 0.8,
    above: NonNegative = 0.8,
    low: Length = -0.5,
    high: Length = 0.5,
    both: Whole = 1,
) -> Expr:
    """Wrap a slab in the xy plane around the y axis.

    start, end : the coordinates x that meet at the seam. below, above : extent of the slab along z. low, high : its
    extent along y. both : 1 to evaluate the other end of the slab too, across the seam at the back.

    At the distance rho from the axis, a unit of the circumference is radius / rho units of x. Inside the radius the
    field c is therefore weighted by rho / radius. Along the circumference the weighted field has the slope of c; along
    rho the slope is larger by |c| / radius. With |c| clamped to a fraction f of the radius, the slope is at most 1 + f.
    Near the axis, where the weight tends to 0, the distance to the ring is used instead, since it is larger. The field
    of the other end is at least the distance to the seam. Opposite the seam, where the ends are exchanged, that is
    more than the clamp.
    """
    radius, middle = (end - start) / math.tau, 0.5 * (start + end)
    rho = length(p.xz)
    x = middle + radius * atan2(p.x, p.z)
    value = child(vec3(x, p.y, rho - radius))
    if both:
        around = end - start
        other = where(x < middle, x + around, x - around)
        to_seam = 0.5 * around - abs(x - middle)
        value = min(value, at_least(child(vec3(other, p.y, rho - radius)), to_seam))
    limit = RELIEF * radius
    cut = clamp(value, -limit, limit + clamp(rho - radius, 0.0, 2.0 * radius))
    aside = max(radius - below - rho, rho - radius - above, low - p.y, p.y - high)
    return at_least(min(rho / radius, 1.0) * cut / (1.0 + RELIEF), aside)


@method
def wrap_around(node: Node, start: Scalar | None = None, end: Scalar | None = None) -> Node:
    """Wrap a slab along x once around the y axis to form a ring.

    Parameters
    ----------
    start, end : the coordinates x that meet at the back, start < end; by default the ends of the solid's box. The solid
        must lie between them. z = 0 maps to the radius (end - start) / (2 pi), +z points outwards, y is unchanged.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound: inside the radius the field is weighted by the distance from the axis, and the result is divided by 1.125.
    Evaluates the slab once if it is symmetric about the middle of start and end, which must be 0, else twice.
    """
    lower, upper = solid("wrap_around", node).bounds
    for name, value, edge in (("start", start, lower[0]), ("end", end, upper[0])):
        if value is None and not np.isfinite(edge):
            raise SceneError(f"wrap_around: {node.name} is unbounded along x", legal=f"a number as {name}")
    legal = "a number, or None for the end of the solid's box"
    first = as_length("wrap_around: start", float(lower[0]) if start is None else start, legal)
    last = as_length("wrap_around: end", float(upper[0]) if end is None else end, legal)
    if not float(interval_of(last - first)[0]) > 0.0:
        raise SceneError(f"wrap_around: start = {short(start)}, end = {short(end)}", legal="numbers, start < end")
    below, above = (float(np.clip(reach, 0.0, UNBOUNDED)) for reach in (-lower[2], upper[2]))
    low, high = (float(np.clip(end, -UNBOUNDED, UNBOUNDED)) for end in (lower[1], upper[1]))
    return wrapped(node, first, last, below, above, low, high, 0 if _is_centred(node.facts, first, last) else 1)
