"""Tubes along curves: all points within a radius of a polyline, a quadratic Bezier curve or a helix; cones between two
points, and tubes of varying radius, put together from solids about the y axis.

Outside, the distance of a tube is that of its curve less the radius. Inside, too, as long as the radius is at most the
curve's reach (Federer): its smallest radius of curvature, and half of how near it comes to itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import SMALLEST
from raymarch.expr.calls import checked
from raymarch.expr.convert import integer, numbers, short
from raymarch.expr.function import Vec3Expr, function, loop
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, const
from raymarch.expr.tables import Table
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import (
    abs,
    atan2,
    ceil,
    clamp,
    cos,
    dot,
    floor,
    length,
    max,
    min,
    round,
    sin,
    sqrt,
    stop_gradient,
    vec2,
    vec3,
    where,
)
from raymarch.prices import STANDARD
from raymarch.sdf.booleans import balanced, union
from raymarch.sdf.definition import shape
from raymarch.sdf.domain import Domain, Points3, Positive, Scalar, Vec3, Vector, shown
from raymarch.sdf.facts import Exactness
from raymarch.sdf.flat import nearest_piece
from raymarch.sdf.node import Node
from raymarch.sdf.placing import orient, translate
from raymarch.sdf.rounds import cone, round_cone
from raymarch.sdf.solids import sphere

__all__ = ["bezier_tube", "helix", "polyline_tube"]
__all__ += ["cone_between", "round_cone_between", "tube"]

Turns = Annotated[Any, Domain(FLOAT, low=0.0, open=True, unit="turns")]


@function()
def segment_squared(p: Vec3Expr, a: Vec3Expr, b: Vec3Expr) -> Expr:
    """Squared distance to the segment from a to b, which are distinct."""
    away, along = p - a, b - a
    away = away - along * clamp(dot(away, along) / dot(along, along), 0.0, 1.0)
    return dot(away, away)


def _distinct(points: Sequence[Sequence[float]]) -> list[Sequence[float]]:
    """The points, those that repeat the one before them left out."""
    return [p for i, p in enumerate(points) if i == 0 or p != points[i - 1]]


def _check_polyline(points: Any, radius: Any) -> None:
    if len(_distinct(points)) < 2:
        raise SceneError(f"polyline_tube: points = {points}", legal="two distinct points or more")


def _is_segment(points: Any, radius: Any) -> bool:
    return len(_distinct(points)) == 2


@shape(
    exactness=lambda points, radius: "exact" if _is_segment(points, radius) else "bound",
    bounds=lambda points, radius: (const(np.min(points, axis=0)) - radius, const(np.max(points, axis=0)) + radius),
    spread=1.0,
    convex=_is_segment,
    check=_check_polyline,
)
def polyline_tube(
    p: Expr,
    points: Points3,
    radius: Positive = 0.12,
) -> Expr:
    """Round tube along straight pieces, with round joints and ends.

    points : two or more points, each three numbers. If the last equals the first, the tube is closed. They are
        numbers and cannot be a `Param`; more than 100 become a table. Each piece costs one distance to a segment.
    radius : radius of the tube, > 0.

    Exact outside. A bound inside, because on the inner side of a bend a point is deeper than the field says.
    """
    corners = _distinct(points)
    if len(corners) <= STANDARD.corners:
        return sqrt(balanced([segment_squared(p, a, b) for a, b in pairwise(corners)], min)) - radius
    rows = np.concatenate([corners, np.zeros((len(corners), 1))], axis=1)
    table = Table(rows, f"a tube through {len(corners)} points")
    return sqrt(nearest_piece(table, lambda a, b: segment_squared(p, a.xyz, b.xyz))) - radius


# The quadratic Bezier curve, in space and in the plane


def _turn(a: Any, b: Any, c: Any) -> Expr:
    """The points of the curve where it turns back along an axis, or an end."""
    bend = a - 2.0 * b + c
    t = clamp((a - b) * bend / max(bend * bend, SMALLEST), 0.0, 1.0)
    return clamp(a + 2.0 * t * (b - a) + t * t * bend, min(a, b, c), max(a, b, c))


def bezier_bounds(a: Any, b: Any, c: Any, radius: Any) -> tuple[Expr, Expr]:
    """Bounds of all points within a radius of a curve: on each axis it turns back at most once."""
    turn = _turn(a, b, c)
    return min(a, c, turn) - radius, max(a, c, turn) + radius


def bezier_exactness(a: Any, b: Any, c: Any, radius: Any) -> Exactness:
    """A bound if a radius of curvature is below the radius: the inner side of the bend then overlaps itself."""
    if not all(v.is_constant for v in (a, b, c)):
        return "bound"
    speed, bend = b.data - a.data, a.data - 2.0 * b.data + c.data
    slowest = speed + bend * np.clip(-speed @ bend / np.maximum(bend @ bend, SMALLEST), 0, 1)
    turned = np.outer(speed, bend) - np.outer(bend, speed)  # each component of the cross product, twice
    turn = float(np.linalg.norm(turned)) * math.sqrt(0.5)
    tightest = 2.0 * float(np.linalg.norm(slowest)) ** 3  # radius of curvature times `turn`
    return "exact" if float(interval_of(radius)[1]) * turn <= tightest else "bound"


def to_bezier(p: Expr, a: Expr, b: Expr, c: Expr) -> Expr:
    """Distance to the curve from a to c whose tangents at both ends pass through b.

    Half the derivative of the squared distance is a cubic in the curve's parameter with a positive leading coefficient,
    so it is concave before its inflection and convex after it. Each side has at most one minimum, which Newton's method
    reaches from the outer end without overshooting, also for straight and folded curves.
    """
    w, first, bend = a - p, b - a, a - 2.0 * b + c
    k0, k1, k2, k3 = dot(w, first), 2.0 * dot(first, first) + dot(w, bend), 3.0 * dot(first, bend), dot(bend, bend)
    inflection = clamp(-k2 / max(3.0 * k3, SMALLEST), 0.0, 1.0)

    def newton(i: Expr, t: Expr, step: Expr) -> list[Expr]:
        value = ((k3 * t + k2) * t + k1) * t + k0
        slope = (3.0 * k3 * t + 2.0 * k2) * t + k1
        rise = max(vec2(-value.x, value.y), 0.0)
        step = rise / max(slope, rise, SMALLEST)
        after = vec2(min(t.x + step.x, inflection), max(t.y - step.y, inflection))
        return [after, max(*abs(after - t))]

    found, _ = loop(32, [vec2(0.0, 1.0), 1.0], newton, until=lambda i, t, step: step < 1e-5)
    apart = [w + (2.0 * first + bend * t) * t for t in stop_gradient(found)]
    return sqrt(min(*[dot(v, v) for v in apart]))


def _check_bezier(a: Any, b: Any, c: Any, radius: Any) -> None:
    if a is b and b is c:
        raise SceneError(f"bezier_tube: all three points are {shown(a)}", legal="points that are not all equal")


@shape(exactness=bezier_exactness, bounds=bezier_bounds, spread=1.0, check=_check_bezier)
def bezier_tube(
    p: Expr,
    a: Vec3,
    b: Vec3,
    c: Vec3,
    radius: Positive = 0.15,
) -> Expr:
    """Round tube along a quadratic Bezier curve, with round ends.

    a, c : ends of the curve. b : control point; the curve leaves a and reaches c in its direction.
    radius : of the tube, > 0.

    Exact outside, and inside if the radius is at most the smallest radius of curvature of the curve.
    """
    return to_bezier(p, a, b, c) - radius


def _helix_exactness(major: Any, minor: Any, pitch: Any, turns: Any) -> Exactness:
    """The reach of a helix: its radius of curvature, or half of how near a turn comes to the next."""
    if not all(v.is_constant for v in (major, minor, pitch, turns)):
        return "bound"
    radius, rise = float(major.data), float(pitch.data) / (2.0 * math.pi)
    s = np.linspace(math.pi, 2.0 * math.pi, 4001)
    chords = np.sqrt(2.0 * radius**2 * (1.0 - np.cos(s)) + (rise * s) ** 2)[s <= 2.0 * math.pi * turns.data]
    reach = np.min(0.5 * chords, initial=(radius**2 + rise**2) / radius)
    return "exact" if minor.data <= 0.9999 * reach else "bound"


def _helix_bounds(major: Any, minor: Any, pitch: Any, turns: Any) -> tuple[Expr, Expr]:
    """A helix of half a turn to either side or more goes all the way round."""
    half = math.pi * turns
    back = where(half < math.pi, cos(half), -1.0)
    side = major * where(half < 0.5 * math.pi, sin(half), 1.0) + minor
    high = 0.5 * pitch * turns + minor
    return vec3(major * back - minor, -high, -side), vec3(major + minor, high, side)


@shape(exactness=_helix_exactness, bounds=_helix_bounds, spread=1.0)
def helix(p: Expr, major: Positive = 0.7, minor: Positive = 0.12, pitch: Positive = 0.5, turns: Turns = 3.0) -> Expr:
    """Helix: a round tube that rises about the y axis as a right-handed screw, with round ends.

    major : distance of the tube's middle from the axis, > 0. minor : radius of the tube, > 0.
    pitch : height of one turn, > 0. turns : how many, > 0, any number; half of them on either side of the x axis.

    Exact outside, and inside if neighbouring turns do not touch and the tube is thinner than its bend.

    The curve's nearest point, seen from the turn nearest in height, is at the root of a function that is concave
    on the way there (the sine of at most half a turn and a line), so Newton's method reaches it without passing it.
    Beyond an end of the curve, the last turn and both ends are evaluated as well.
    """
    rise, whole = pitch / (2.0 * math.pi), 2.0 * math.pi
    last = math.pi * turns
    level, angle = p.y / rise, atan2(-p.z, p.x)
    pull = length(p.xz) * major
    nearest = angle + whole * round((level - angle) / whole)
    top, bottom = angle + whole * floor((last - angle) / whole), angle + whole * ceil((-last - angle) / whole)
    first = vec2(nearest, where(nearest > last, top, where(nearest < -last, bottom, nearest)))
    lift = rise * rise * abs(level - first)

    def newton(i: Expr, s: Expr, step: Expr) -> list[Expr]:
        slope = max(pull * cos(s) + rise * rise, 1e-3 * rise * rise)
        after = clamp(s + max(lift - pull * sin(s) - rise * rise * s, 0.0) / slope, 0.0, math.pi)
        return [after, max(*(after - s))]

    s, _ = loop(24, [vec2(0.0), 1.0], newton, until=lambda i, s, step: step < 1e-6)
    turned = first + s * vec2(*[where(level < start, -1.0, 1.0) for start in first])
    found = stop_gradient(clamp(turned, -last, last))
    away = [p - vec3(major * cos(t), rise * t, -major * sin(t)) for t in (found.x, found.y, last, -last)]
    return sqrt(min(*[dot(v, v) for v in away])) - minor


def _ends(name: str, a: Any, b: Any) -> tuple[Expr, Expr, Expr]:
    """Both points, and their distance."""
    start, end = (Domain(VEC3).accept(name, which, value) for which, value in (("a", a), ("b", b)))
    apart = length(end - start)
    if not interval_of(apart)[1] > 0.0:
        raise SceneError(f"{name}: a and b are the same point {short(a)}", legal="two points")
    return start, end, apart


def _between(solid: Node, a: Expr, b: Expr) -> Node:
    """A solid about the y axis, centred, moved so that it leads from a to b."""
    way = b - a
    if not (way.is_constant and way.data[0] == 0.0 == way.data[2] and way.data[1] > 0.0):
        solid = orient(solid, way)
    return translate(solid, 0.5 * (a + b))


@checked
def cone_between(a: Vector, b: Vector, radius: Scalar = 0.5, top: Scalar = 0.0) -> Node:
    """A cone or frustum from one point to another, with flat ends.

    Parameters
    ----------
    a, b : the centres of its ends.
    radius, top : radii at a and at b, each >= 0, not both 0.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : equal points, radii outside their range.

    Notes
    -----
    Exact.

    Examples
    --------
    >>> float(rm.cone_between((0, 0, 0), (4, 0, 0), 1, 1).distance((2, 3, 0)))
    2.0
    """
    start, end, apart = _ends("cone_between", a, b)
    return _between(cone(radius, apart, top), start, end)


@checked
def round_cone_between(a: Vector, b: Vector, radius: Scalar = 0.5, top: Scalar = 0.25) -> Node:
    """The convex hull of two balls.

    Parameters
    ----------
    a, b : the centres of the balls.
    radius, top : their radii at a and at b, each > 0, which differ by less than the distance of the centres.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : equal points, radii outside their range.

    Notes
    -----
    Exact.

    Examples
    --------
    >>> rm.round_cone_between((0, 0, 0), (0, 2, 0), 0.5, 0.25).exactness
    'exact'
    """
    start, end, apart = _ends("round_cone_between", a, b)
    return _between(round_cone(radius, apart, top), start, end)


@checked
def tube(points: Sequence[Vector] | ArrayLike, radius: Scalar | ArrayLike = 0.1, segments: int = 1) -> Node:
    """A round tube along points, with a radius of its own at each: a horn, a root, a vein.

    Parameters
    ----------
    points : (N, 3), two or more, each different from the one before.
    radius : at all points, or at each, (N,), > 0. Between points it changes evenly.
    segments : pieces between two points, 1 to 32. With 1 the tube has straight pieces; with more they follow the
        centripetal Catmull-Rom curve through the points (Yuksel et al. 2011).

    Returns
    -------
    Node

    Raises
    ------
    SceneError : points or radii of another shape, or outside their range; more than 2,000 pieces.

    Notes
    -----
    The union of the convex hulls of each two neighbouring balls: exact outside, a bound inside.

    Examples
    --------
    >>> rm.tube([(0, 0, 0), (1, 0, 0), (1, 1, 0)], radius=(0.3, 0.2, 0.1)).bounds[1].tolist()
    [1.2, 1.1, 0.3]
    """
    legal = "(N, 3), two or more points of numbers, each different from the one before"
    p = numbers("tube: points", points, legal)
    shaped = p.ndim == 2 and p.shape[1] == 3 and len(p) > 1 and bool(np.all(np.isfinite(p)))
    if not shaped or not np.diff(p, axis=0).any(axis=1).all():
        raise SceneError(f"tube: points = {short(points)}", legal=legal)
    wide = numbers("tube: radius", radius, f"a number > 0, or {len(p)} of them")
    if wide.shape not in ((), (len(p),)) or not np.all((wide > 0.0) & np.isfinite(wide)):
        raise SceneError(f"tube: radius = {short(radius)}", legal=f"a number > 0, or {len(p)} of them")
    pieces = integer("tube: segments", segments, 1, 32)
    if pieces * (len(p) - 1) > 2000:
        raise SceneError(f"tube: {pieces * (len(p) - 1)} pieces", legal="up to 2,000: fewer points or segments")
    share = np.linspace(0.0, 1.0, pieces, endpoint=False)
    places = np.concatenate([*[_curve(p, i, share) for i in range(len(p) - 1)], p[-1:]]) if pieces > 1 else p
    at = np.linspace(0.0, len(p) - 1.0, len(places))
    radii = np.interp(at, np.arange(len(p)), np.broadcast_to(wide, len(p)))
    solids = [_piece(*ends) for ends in zip(places[:-1], places[1:], radii[:-1], radii[1:], strict=True)]
    return solids[0] if len(solids) == 1 else union(*solids)


def _curve(p: NDArray[np.float64], i: int, share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of the centripetal Catmull-Rom curve from point i to the next (Barry and Goldman 1988)."""
    before = p[i - 1] if i > 0 else 2.0 * p[i] - p[i + 1]
    after = p[i + 2] if i + 2 < len(p) else 2.0 * p[i + 1] - p[i]
    c = np.stack([before, p[i], p[i + 1], after])
    t = np.concatenate([[0.0], np.cumsum(np.sqrt(np.linalg.norm(np.diff(c, axis=0), axis=1)))])
    u = (t[1] + share * (t[2] - t[1]))[:, None]

    def mix(a: Any, b: Any, low: int, high: int) -> Any:
        return ((t[high] - u) * a + (u - t[low]) * b) / (t[high] - t[low])

    first, second, third = (mix(c[k], c[k + 1], k, k + 1) for k in range(3))
    found: NDArray[np.float64] = mix(mix(first, second, 0, 2), mix(second, third, 1, 3), 1, 2)
    return found


def _piece(a: NDArray[np.float64], b: NDArray[np.float64], start: float, end: float) -> Node:
    """The convex hull of two balls, which may be one of them."""
    apart = float(np.linalg.norm(b - a))
    if apart <= math.fabs(start - end) * (1.0 + 1e-9):
        return translate(sphere(float(start if start > end else end)), (a if start > end else b).tolist())
    return round_cone_between(a.tolist(), b.tolist(), float(start), float(end))
