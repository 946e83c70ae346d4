"""Flat shapes with straight edges, the disc, and strokes. Each is one short function of a vec2 in the xy plane.

If a shape has mirror lines, a point is first folded into one of the sectors between them: the nearest point of the
boundary of a symmetric shape lies in the same sector as the point.

Beside a straight edge the distance is a signed linear function. A square root would have no gradient on the edge
itself, where rays end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import reduce
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import SMALLEST
from raymarch.expr.function import Vec2Expr, function, loop
from raymarch.expr.node import Expr, expr
from raymarch.expr.tables import Table, fetch
from raymarch.expr.vocabulary import clamp, dot, length, max, min, normalize, sqrt, vec2, vec4, where
from raymarch.prices import STANDARD
from raymarch.sdf.definition import cube, shape
from raymarch.sdf.domain import Domain, Fits, NonNegative, Points2, Positive, Size2, Vec2, require, shown
from raymarch.sdf.facts import FARTHEST
from raymarch.sdf.solids import from_faces

__all__ = ["circle", "cross", "polyline", "rectangle", "rounded_rectangle", "stroke"]
__all__ += ["flat_triangle", "polygon", "regular_polygon", "star", "trapezoid"]

Sides = Annotated[int, Domain(None, low=3, high=65535, unit="count")]
Points = tuple[tuple[float, float], ...]


@shape(
    exactness="exact",
    bounds=lambda radius: cube(vec2(radius)),
    symmetry="xy",
    convex=True,
    radii=lambda radius: vec4(radius),
    dimension=2,
)
def circle(p: Expr, radius: Positive = 1.0) -> Expr:
    """Filled circle about the origin.

    radius : length, > 0. Exact.
    """
    return length(p) - radius


@shape(exactness="exact", bounds=lambda size: cube(0.5 * size), symmetry="xy", convex=True, dimension=2)
def rectangle(p: Expr, size: Size2 = (2.0, 2.0)) -> Expr:
    """Rectangle about the origin.

    size : full extents along x and y, each > 0; one number gives a square. Exact.
    """
    return from_faces(abs(p) - 0.5 * size)


@shape(
    exactness="exact",
    bounds=lambda size: cube(0.5 * size),
    symmetry="xy",
    convex=True,
    check=Fits(lambda size, rounding: 2.0 * rounding <= min(size.x, size.y), "rounding <= half the smaller extent"),
    dimension=2,
)
def rounded_rectangle(p: Expr, size: Size2 = (2.0, 2.0), rounding: NonNegative = 0.2) -> Expr:
    """Rectangle about the origin with rounded corners.

    size : full extents along x and y, rounding included, each > 0; one number gives a square.
    rounding : radius of the corners, >= 0 and at most half the smaller extent.

    All points within that radius of a smaller rectangle (Minkowski sum), so exact outside and inside.
    """
    return from_faces(abs(p) - 0.5 * size + rounding) - rounding


# Shapes given by their corners


@function()
def segment_squared(p: Vec2Expr, a: Vec2Expr, b: Vec2Expr) -> Expr:
    """Squared distance to the segment from a to b, which may be the same point."""
    along, w = b - a, p - a
    gap = w - along * clamp(dot(w, along) / max(dot(along, along), SMALLEST), 0.0, 1.0)
    return dot(gap, gap)


@function()
def edge(p: Vec2Expr, a: Vec2Expr, b: Vec2Expr, at_a: Vec2Expr, at_b: Vec2Expr) -> Expr:
    """Signed distance to the edge from a to b, which has the inside on its left.

    at_a, at_b : the normals at the corners, each the mean of the normals of the two edges there. If a corner is the
        nearest point, its normal gives the sign, at acute angles too.
    """
    along, from_a, from_b = b - a, p - a, p - b
    squared = max(dot(along, along), SMALLEST)
    t = dot(from_a, along)
    line = (from_a.x * along.y - from_a.y * along.x) / sqrt(squared)
    corner, normal = where(t < 0.0, from_a, from_b), where(t < 0.0, at_a, at_b)
    outside = where(dot(corner, normal) < 0.0, -1.0, 1.0)
    return where((t >= 0.0) & (t <= squared), line, outside * length(corner))


def nearer(first: Expr, second: Expr) -> Expr:
    """The signed distance of smaller absolute value."""
    return where(abs(second) < abs(first), second, first)


def outward(a: Any, b: Any) -> Expr:
    """The outward unit normal of an edge whose left side is inside."""
    along = expr(b) - a
    return normalize(vec2(along.y, -along.x))


def enclosed(p: Expr, corners: Sequence[Any]) -> Expr:
    """Signed distance to the region inside a closed, counter-clockwise polyline: that of the nearest edge."""
    if len(corners) > STANDARD.corners:
        return _enclosed_by_rows(p, np.array(corners))
    ends = [*corners[1:], corners[0]]
    normals = [outward(a, b) for a, b in zip(corners, ends, strict=True)]
    at_corners = [before + after for before, after in zip([normals[-1], *normals[:-1]], normals, strict=True)]
    rows = zip(corners, ends, at_corners, [*at_corners[1:], at_corners[0]], strict=True)
    return reduce(nearer, [edge(p, *row) for row in rows])


def _enclosed_by_rows(p: Expr, corners: NDArray[np.float64]) -> Expr:
    """As `enclosed`; a row of the table is a corner and the mean of the normals of its edges."""
    along = np.roll(corners, -1, axis=0) - corners
    normals = -leftward(along) / np.linalg.norm(along, axis=1, keepdims=True)
    rows = np.concatenate([corners, normals + np.roll(normals, 1, axis=0)], axis=1)
    table = Table(np.concatenate([rows, rows[:1]]), f"a polygon of {len(corners)} corners")

    def step(i: Expr, nearest: Expr, row: Expr) -> tuple[Expr, Expr]:
        following = fetch(table, i + 1.0)
        found = edge(p, vec2(row.x, row.y), vec2(following.x, following.y), *(vec2(r.z, r.w) for r in (row, following)))
        return nearer(nearest, found), following

    nearest, _ = loop(len(corners), [FARTHEST, fetch(table, 0.0)], step)
    return nearest


def mirrors(corners: NDArray[np.float64]) -> str:
    """The axes along which a closed polyline is symmetric."""
    found = ""
    for axis, flip in zip("xy", ((-1.0, 1.0), (1.0, -1.0)), strict=True):
        image = (corners * flip)[::-1]
        if any(np.array_equal(np.roll(image, k, axis=0), corners) for k in range(len(corners))):
            found += axis
    return found


def across(u: NDArray[Any], v: NDArray[Any]) -> Any:
    """The cross product of vectors (..., 2)."""
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def leftward(v: NDArray[Any]) -> NDArray[Any]:
    """Vectors (..., 2) turned by a quarter to the left."""
    return np.stack([-v[..., 1], v[..., 0]], axis=-1)


def _turns(a: NDArray[Any], b: NDArray[Any], c: NDArray[Any]) -> NDArray[Any]:
    """1 if a, b, c turn left, -1 if they turn right, 0 if they are collinear."""
    u, v = b - a, c - a
    first, second = u[..., 0] * v[..., 1], u[..., 1] * v[..., 0]
    rounding = 4 * np.finfo(np.float64).eps * (np.abs(first) + np.abs(second))
    return np.where(np.abs(first - second) <= rounding, 0, np.sign(first - second))


def _between(a: NDArray[Any], b: NDArray[Any], c: NDArray[Any]) -> NDArray[Any]:
    """True if c lies between a and b; all three are collinear."""
    return np.all((np.minimum(a, b) <= c) & (c <= np.maximum(a, b)), axis=-1)


def _check_polygon(points: Points) -> None:
    """SceneError if two edges meet elsewhere than in the corner that they share."""
    corners = np.array(points)
    n = len(corners)
    if n < 3:
        raise SceneError(f"polygon of {n} points", legal="three points or more")
    following = np.roll(corners, -1, axis=0)
    for i in range(n):
        if np.array_equal(corners[i], following[i]):
            raise SceneError(f"polygon: point {i} = {points[i]} is given twice in a row", legal="each corner once")
    for i in range(n):
        j = (i + 1) % n
        back = _turns(corners[i], corners[j], following[j]) == 0 and np.dot(
            corners[j] - corners[i], following[j] - corners[j]
        )
        if back < 0:
            raise SceneError(f"polygon: it turns back on itself at point {j} = {points[j]}", legal="a simple polygon")
        others = np.array([k for k in range(i + 2, n) if (k + 1) % n != i], dtype=int)
        met = others[_meet(corners[i], following[i], corners[others], following[others])]
        if len(met):
            raise SceneError(
                f"polygon: the edge from point {i} = {points[i]} meets the edge from point {met[0]} = {points[met[0]]}",
                legal="a simple polygon, one whose edges meet in its corners only",
            )


def _meet(a: NDArray[Any], b: NDArray[Any], c: NDArray[Any], d: NDArray[Any]) -> NDArray[Any]:
    """True if the segment from a to b has a point in common with those from c to d."""
    abc, abd, cda, cdb = _turns(a, b, c), _turns(a, b, d), _turns(c, d, a), _turns(c, d, b)
    across = (abc * abd < 0) & (cda * cdb < 0)
    touch = (abc == 0) & _between(a, b, c) | (abd == 0) & _between(a, b, d)
    touch |= (cda == 0) & _between(c, d, a) | (cdb == 0) & _between(c, d, b)
    return across | touch


def _bulges(corners: NDArray[np.float64]) -> bool:
    """True if a simple polygon is convex."""
    turns = _turns(np.roll(corners, 1, axis=0), corners, np.roll(corners, -1, axis=0))
    return bool(np.all(turns >= 0) or np.all(turns <= 0))


@shape(
    exactness="exact",
    bounds=lambda points: (expr(np.min(points, axis=0)), expr(np.max(points, axis=0))),
    symmetry=lambda points: mirrors(np.array(points)),
    convex=lambda points: _bulges(np.array(points)),
    check=_check_polygon,
    dimension=2,
)
def polygon(p: Expr, points: Points2) -> Expr:
    """The region inside a closed polyline.

    points : three or more corners (x, y) in order, clockwise or counter-clockwise; the last is joined to the first.
        They are numbers; more than 100 become a table, which a loop reads. Edges may meet only at corners.

    Exact: the distance to the nearest edge, which also gives the sign. If a corner is nearest, the mean of the normals
    there gives the sign. The cost grows with the number of corners.
    """
    x, y = np.array(points).T
    clockwise = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0.0
    return enclosed(p, points[::-1] if clockwise else points)


def _triangle_symmetry(a: Expr, b: Expr, c: Expr) -> str:
    fixed = a.is_constant and b.is_constant and c.is_constant
    return mirrors(np.array([a.data, b.data, c.data])) if fixed else ""


def _area(a: Expr, b: Expr, c: Expr) -> Expr:
    """Twice the area of a triangle, negative if it runs clockwise."""
    u, v = b - a, c - a
    return u.x * v.y - u.y * v.x


def _check_triangle(a: Any, b: Any, c: Any) -> None:
    what = f"flat_triangle: {shown(a)}, {shown(b)}, {shown(c)} lie on one line"
    area = _area(a, b, c)
    if area.is_constant:
        if _turns(a.data, b.data, c.data) == 0:
            raise SceneError(what, legal="three corners with an area")
    else:
        require((area > 0.0) | (area < 0.0), what, "three corners with an area")


@shape(
    exactness="exact",
    bounds=lambda a, b, c: (min(a, b, c), max(a, b, c)),
    symmetry=_triangle_symmetry,
    convex=True,
    check=_check_triangle,
    dimension=2,
)
def flat_triangle(p: Expr, a: Vec2, b: Vec2, c: Vec2) -> Expr:
    """Triangle.

    a, b, c : corners in any order, not collinear. Exact, as `polygon` is.
    """
    left = _area(a, b, c) > 0.0
    return enclosed(p, [a, where(left, b, c), where(left, c, b)])


@shape(
    exactness="exact",
    bounds=lambda width, height, top: cube(vec2(0.5 * max(width, top), 0.5 * height)),
    symmetry=lambda width, top: "xy" if width is top else "x",
    convex=True,
    check=Fits(lambda width, top: width + top > 0.0, "at least one of them > 0"),
    dimension=2,
)
def trapezoid(p: Expr, width: NonNegative = 2.0, height: Positive = 1.2, top: NonNegative = 1.0) -> Expr:
    """Trapezoid about the origin, symmetric about the y axis.

    width, top : lengths of the lower and the upper edge, >= 0, not both 0; 0 gives a triangle. height : > 0.

    Exact: the distance to the nearest of the horizontal edges and one slanted edge.
    """
    q = vec2(abs(p.x), p.y)
    low, high = vec2(0.5 * width, -0.5 * height), vec2(0.5 * top, 0.5 * height)
    over = vec2(q.x - where(q.y < 0.0, low.x, high.x), abs(q.y) - high.y)
    level = where(over.x > 0.0, length(over), over.y)
    slant = outward(low, high)
    return nearer(edge(q, low, high, slant + vec2(0.0, -1.0), slant + vec2(0.0, 1.0)), level)


# Shapes with many mirror lines


def fold(p: Expr, n: int) -> Expr:
    """A point reflected into the sector between the y axis and the line at pi/n from it, towards +x.

    The mirror lines of a regular n-gon bound 2n such sectors. Each reflection halves the number of sectors that can
    contain the point, rounded up, so log2(n) reflections replace trigonometry.
    """
    q, sectors = vec2(abs(p.x), p.y), n
    while sectors > 1:
        sectors = (sectors + 1) // 2
        angle = math.pi * sectors / n
        beyond = (0.0 if 2 * sectors == n else math.cos(angle), -math.sin(angle))
        q = q - 2.0 * max(dot(q, beyond), 0.0) * expr(beyond)
    return q


def _reach(n: int, shift: float = 0.0) -> tuple[tuple[float, float], tuple[float, float]]:
    """The box of n points on the unit circle, the first at an angle of `shift` steps from the y axis."""
    angles = 2 * np.pi * (np.arange(n) + shift) / n
    ends = [np.where(np.abs(f) < 1e-15, 0.0, f) for f in (np.sin(angles), np.cos(angles))]
    (x0, x1), (y0, y1) = [(float(f.min()), float(f.max())) for f in ends]
    return (x0, y0), (x1, y1)


@shape(
    exactness="exact",
    bounds=lambda sides, radius: tuple(radius * expr(end) for end in _reach(sides)),
    symmetry=lambda sides: "x" if sides % 2 else "xy",
    convex=True,
    dimension=2,
)
def regular_polygon(p: Expr, sides: Sides = 6, radius: Positive = 1.0) -> Expr:
    """Polygon of n equal sides about the origin, one corner up.

    sides : number of sides, an integer >= 3. radius : from the centre to a corner, > 0.

    Exact: folded along its mirror lines until one half of an edge is left.
    """
    half = math.pi / sides
    q = fold(p, sides)
    over = dot(q, (math.sin(half), math.cos(half))) - radius * math.cos(half)
    beside = dot(q, (-math.cos(half), math.sin(half))) - radius * math.sin(half)
    return where(over > 0.0, length(vec2(over, max(beside, 0.0))), over)


def _star_bounds(points: int, outer: Any, inner: Any) -> tuple[Expr, Expr]:
    (tips, hollows) = _reach(points), _reach(points, 0.5)
    return (min(outer * expr(tips[0]), inner * expr(hollows[0])), max(outer * expr(tips[1]), inner * expr(hollows[1])))


@shape(
    exactness="exact",
    bounds=_star_bounds,
    symmetry=lambda points: "x" if points % 2 else "xy",
    check=Fits(lambda outer, inner: inner < outer, "inner < outer"),
    dimension=2,
)
def star(p: Expr, points: Sides = 5, outer: Positive = 1.0, inner: Positive = 0.45) -> Expr:
    """Star about the origin, one tip up.

    points : number of tips, an integer >= 3. outer, inner : radii of tips and hollows, 0 < inner < outer.

    Exact: folded along its mirror lines until one edge is left.
    """
    q = fold(p, points)
    tip, hollow = vec2(0.0, outer), inner * expr((math.sin(math.pi / points), math.cos(math.pi / points)))
    slant = outward(hollow, tip)
    return edge(q, hollow, tip, slant, slant)  # in the sector, the sign follows from the side of the line alone


@shape(
    exactness="exact",
    bounds=lambda size: cube(vec2(0.5 * size)),
    symmetry="xy",
    check=Fits(lambda size, thickness: thickness < size, "thickness < size"),
    dimension=2,
)
def cross(p: Expr, size: Positive = 1.8, thickness: Positive = 0.6) -> Expr:
    """Two equal bars that cross at the origin, along x and y: a plus.

    size : full length of the bars, > 0. thickness : full width of the bars, > 0 and below `size`.

    Exact. Points are folded into the octant below y = x; it contains the end of a bar, its side and the corner
    between the bars.
    """
    q = abs(p)
    q = where(q.y > q.x, q.yx, q)
    over = q - 0.5 * vec2(size, thickness)
    short = 0.5 * thickness - q.x
    side = where(short > 0.0, -length(vec2(short, over.y)), over.y)
    return where(max(over.x, over.y) <= 0.0, max(over.x, side), length(max(over, 0.0)))


# Strokes


@shape(
    exactness="exact",
    bounds=lambda a, b, thickness: (min(a, b) - 0.5 * thickness, max(a, b) + 0.5 * thickness),
    convex=True,
    dimension=2,
)
def stroke(p: Expr, a: Vec2, b: Vec2, thickness: Positive = 0.3) -> Expr:
    """A line from a to b with round ends.

    a, b : ends; equal ends give a disc. thickness : full width, > 0. Exact.
    """
    return sqrt(segment_squared(p, a, b)) - 0.5 * thickness


@shape(
    exactness=lambda points: "exact" if len(points) == 2 else "bound",
    bounds=lambda points, thickness: (
        np.min(points, axis=0) - 0.5 * thickness,
        np.max(points, axis=0) + 0.5 * thickness,
    ),
    spread=1.0,
    convex=lambda points: len(points) == 2,
    dimension=2,
)
def polyline(p: Expr, points: Points2, thickness: Positive = 0.2) -> Expr:
    """A line through some points with round ends and joints.

    points : two or more, each (x, y); numbers, more than 100 of them a table. thickness : full width, > 0.

    Exact outside, a bound inside: on the inner side of a bend the field is less than the distance to the corner.
    """
    if len(points) <= STANDARD.corners:
        return sqrt(reduce(min, [segment_squared(p, a, b) for a, b in pairwise(points)])) - 0.5 * thickness
    table = Table(np.array(points), f"a line through {len(points)} points")
    return sqrt(nearest_piece(table, lambda a, b: segment_squared(p, a, b))) - 0.5 * thickness


def nearest_piece(table: Table, distance: Callable[[Expr, Expr], Expr]) -> Expr:
    """The smallest of the distances to the pieces between consecutive points of a table, by one loop."""

    def step(i: Expr, nearest: Expr, a: Expr) -> tuple[Expr, Expr]:
        b = fetch(table, i + 1.0)
        return min(nearest, distance(a, b)), b

    return loop(len(table.values) - 1, [FARTHEST, fetch(table, 0.0)], step)[0]
