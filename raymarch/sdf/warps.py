"""Orientation along a direction, shear, and wrapping around an axis."""

from __future__ import annotations

import math

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.convert import choice, short
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import abs as absolute
from raymarch.expr.vocabulary import atan2, clamp, columns, cross, dot, length, max, min, sqrt, transpose, vec3, where
from raymarch.sdf.definition import Child, around_y, at_least, operator
from raymarch.sdf.domain import Direction, Length, NonNegative, Scalar, Vec3, Vector, Whole, as_length
from raymarch.sdf.facts import Facts
from raymarch.sdf.node import Node, method, solid
from raymarch.sdf.placing import AXES, axis_vector
from raymarch.sdf.repetition import UNBOUNDED

# Orient


def turn_between(start: Expr, end: Expr) -> Expr:
    """The smallest rotation that takes one unit vector to another, for column vectors.

    Rodrigues' formula with sin and cos of the angle as the cross and dot products: R = c I + [v] + v v' / (1 + c).
    If the two are opposite, half a turn about a perpendicular axis.
    """
    v, c = cross(start, end), dot(start, end)
    opposite = c < -1.0 + 1e-6  # beyond this, 1 + c has only one or two significant bits in float32
    factor = 1.0 / where(opposite, 1.0, 1.0 + c)
    x, y, z = v
    turn = columns(
        vec3(c, z, -y) + factor * x * v,
        vec3(-z, c, x) + factor * y * v,
        vec3(y, -x, c) + factor * z * v,
    )
    across = where(absolute(start.x) < 0.7, vec3(0.0, start.z, -start.y), vec3(start.y, -start.x, 0.0))
    a = across / length(across)
    half = columns(2.0 * a.x * a - vec3(1, 0, 0), 2.0 * a.y * a - vec3(0, 1, 0), 2.0 * a.z * a - vec3(0, 0, 1))
    return where(opposite, half, turn)


@operator(
    exactness="exact",
    bounds=lambda child, axis, direction: turn_between(axis, direction) @ child.box,
    spread=lambda child: math.sqrt(3.0) * child.spread,
    convex=True,
    called="orient",
)
def oriented(p: Expr, child: Child, axis: Direction = (0.0, 1.0, 0.0), direction: Direction = (1.0, 1.0, 1.0)) -> Expr:
    """Rotate so that an axis points along a direction."""
    return child(transpose(turn_between(axis, direction)) @ p)


@method
def orient(node: Node, direction: Vector = (1.0, 1.0, 1.0), axis: Vector | str = "y") -> Node:
    """Rotate by the smallest angle that makes an axis of the solid point along a direction.

    direction : vec3 of any length but 0.
    axis : axis of the solid: "x", "y", "z" or a direction.
    """
    return oriented(solid("orient", node), axis_vector("orient", axis), direction)


# Shear


def shear_slope(amount: Expr) -> Expr:
    """The larger singular value of the matrix with rows (1, a) and (0, 1)."""
    a = absolute(amount)
    return 0.5 * (a + sqrt(a * a + 4.0))


@operator(
    bounds=lambda child, amount, axis, by: child.box + amount * axis * dot(by, child.box),
    lipschitz=lambda child, amount: child.lipschitz * shear_slope(amount),
    spread=lambda child, amount: child.spread * (1.0 + absolute(amount)),
    convex=True,
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

    amount : length per unit of length.
    axis, by : two of "x", "y", "z": the axis of the motion, and the axis whose coordinate counts.

    A bound: divided by (a + sqrt(a^2 + 4)) / 2 with a = |amount|, the largest stretch. The stretch is the same
    everywhere, so the solid may be unbounded.
    """
    legal = "two different ones of 'x', 'y' and 'z'"
    axis, by = choice("shear: axis", axis, tuple(AXES), legal), choice("shear: by", by, tuple(AXES), legal)
    if axis == by:
        raise SceneError(f"shear: axis = {short(axis)}, by = {short(by)}", legal=legal)
    return sheared(solid("shear", node), amount, AXES[axis], AXES[by])


# Wrap around

RELIEF = 0.125
"""Limit of distances inside the ring, as a fraction of its radius."""


def _check_wrapped(
    child: Facts, start: Expr, end: Expr, below: Expr, above: Expr, low: Expr, high: Expr, both: int
) -> None:
    """SceneError unless the slab fits its ring, leaves the axis free, and is evaluated twice if it is not symmetric."""
    bottom, top = np.maximum(child.lower[1], -UNBOUNDED), np.minimum(child.upper[1], UNBOUNDED)
    if not (interval_of(low)[1] <= bottom and top <= interval_of(high)[0]):
        raise SceneError(
            "wrapped: the solid extends beyond low or high", legal="low and high outside the bounds of the solid"
        )
    first, last, radius = interval_of(start)[1], interval_of(end)[0], interval_of((end - start) / math.tau)
    slack = 1e-9 * float(radius[1])
    if not (child.lower[0] >= first - slack and child.upper[0] <= last + slack and radius[0] > 0.0):
        raise SceneError(
            f"wrap_around: the solid reaches along x from {child.lower[0]:g} to {child.upper[0]:g}",
            legal="start and end around the solid; cut an unbounded solid, as `node & box(...)`",
        )
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
        to_seam = 0.5 * around - absolute(x - middle)
        value = min(value, at_least(child(vec3(other, p.y, rho - radius)), to_seam))
    limit = RELIEF * radius
    cut = clamp(value, -limit, limit + clamp(rho - radius, 0.0, 2.0 * radius))
    aside = max(radius - below - rho, rho - radius - above, low - p.y, p.y - high)
    return at_least(min(rho / radius, 1.0) * cut / (1.0 + RELIEF), aside)


@method
def wrap_around(node: Node, start: Scalar | None = None, end: Scalar | None = None) -> Node:
    """Wrap a slab along x once around the y axis to form a ring.

    start, end : the coordinates x that meet at the back, start < end; by default the ends of the solid's box. The solid
        must lie between them. z = 0 maps to the radius (end - start) / (2 pi), +z points outwards, y is unchanged.

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
