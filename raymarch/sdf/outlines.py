"""The region inside closed outlines of lines and circular arcs: its exact distance, and whether they are simple.

A piece runs from a to b and is curved by its bulge, the tangent of a quarter of the angle through which it turns: 0 for
a line, 1 for a half circle to the left (the word of drawing exchange files). Lines and arcs have one formula. With the
curvature k, the chord's left normal n and its middle m, the vector v = k (p - m) - cos(angle / 2) n is k times that
from the centre. The power of the point times k, over |v| + 1, is the distance to the circle. The centre, which may be
far away, is not in it.
"""

from __future__ import annotations

import math
from functools import cached_property, reduce
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.function import FloatExpr, Vec2Expr, function, loop
from raymarch.expr.node import Expr, const, expr
from raymarch.expr.tables import Table, fetch
from raymarch.expr.vocabulary import dot, length, vec2, where
from raymarch.prices import STANDARD
from raymarch.sdf.definition import shape
from raymarch.sdf.domain import Domain
from raymarch.sdf.facts import FARTHEST
from raymarch.sdf.flat import across, edge, leftward, nearer

Floats = NDArray[np.float64]
Rows = tuple[tuple[float, ...], ...]
Pieces = Annotated[Any, Domain(None, holds=tuple, points=5, unit="length")]

NEAR = 1e-9
"""Of the size of an outline: points nearer than this are one point."""


class Outline:
    """Numbers of pieces (x, y, x, y, bulge), which form closed loops with the inside on their left.

    a, b, bulge : ends (n, 2), and bulges (n,), each from -1 to 1.
    """

    def __init__(self, pieces: Any) -> None:
        rows = np.array(pieces, np.float64).reshape(-1, 5)
        self.a, self.b, self.bulge = rows[:, :2], rows[:, 2:4], rows[:, 4]

    def __len__(self) -> int:
        return len(self.a)

    @cached_property
    def chord(self) -> Floats:
        return np.linalg.norm(self.b - self.a, axis=1)

    @cached_property
    def normal(self) -> Floats:
        """The left normal of each chord, (n, 2)."""
        return leftward(self.b - self.a) / self.chord[:, None]

    @cached_property
    def cosine(self) -> Floats:
        """Of half the angle of each piece."""
        return (1.0 - self.bulge**2) / (1.0 + self.bulge**2)

    @cached_property
    def curvature(self) -> Floats:
        """Positive to the left, 0 for a line."""
        return 4.0 * self.bulge / (self.chord * (1.0 + self.bulge**2))

    def tangents(self) -> tuple[Floats, Floats]:
        """Unit directions at the starts and at the ends, each (n, 2)."""
        along = -leftward(self.normal)
        sine = 2.0 * self.bulge / (1.0 + self.bulge**2)
        straight, across = self.cosine[:, None] * along, sine[:, None] * self.normal
        return straight - across, straight + across

    @cached_property
    def following(self) -> NDArray[np.int64]:
        """The number of the piece that starts where each ends."""
        found = np.arange(1, len(self) + 1)
        first = 0
        for i in range(len(self)):
            if np.array_equal(self.b[i], self.a[first]):
                found[i], first = first, i + 1
        return found

    @cached_property
    def cusps(self) -> NDArray[np.bool_]:
        """Whether the outline turns back at the end of each piece."""
        start, end = self.tangents()
        found: NDArray[np.bool_] = np.linalg.norm(end + start[self.following], axis=1) < 1e-6
        return found

    @cached_property
    def tapered(self) -> Floats:
        """At the end of each piece, how much a spike there bends apart, > 0; < 0 for the outside between two pieces."""
        return -(self.curvature + self.curvature[self.following])

    def corner_normals(self) -> tuple[Floats, Floats]:
        """At the start and at the end of each piece, a vector (n, 2) that points to the outside from its corner.

        It is the sum of the outward normals of the two pieces. Where they turn back it is along them.
        """
        tangents = self.tangents()
        start, end = (-leftward(t) for t in tangents)
        along = np.sign(self.tapered)[:, None] * tangents[1]
        at_end = np.where(self.cusps[:, None], along, end + start[self.following])
        at_start = np.empty_like(at_end)
        at_start[self.following] = at_end
        return at_start, at_end

    def middles(self) -> Floats:
        """The middle of each piece, (n, 2)."""
        middle: Floats = 0.5 * (self.a + self.b) - (0.5 * self.bulge * self.chord)[:, None] * self.normal
        return middle

    def _turning_points(self) -> Floats:
        """The points where arcs turn back along an axis, (m, 2)."""
        curved = np.abs(self.curvature) > 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            radius = 1.0 / self.curvature[curved]
        middle = 0.5 * (self.a + self.b)[curved]
        centre = middle + (radius * self.cosine[curved])[:, None] * self.normal[curved]
        steps = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
        points = centre[:, None] + np.abs(radius)[:, None, None] * steps
        on = np.stack([self.within(points[:, j], np.flatnonzero(curved)) for j in range(4)], axis=1)
        found: Floats = points[on]
        return found

    def within(self, points: Floats, rows: Any, slack: float = 0.0) -> NDArray[np.bool_]:
        """Whether points, one for each of some pieces, lie between the normals at the ends of theirs."""
        start, end = (t[rows] for t in self.tangents())
        past_start = np.sum((points - self.a[rows]) * start, axis=-1)
        past_end = np.sum((points - self.b[rows]) * end, axis=-1)
        same: NDArray[np.bool_] = (past_start >= -slack) & (past_end <= slack)
        return same

    @cached_property
    def box(self) -> tuple[Floats, Floats]:
        points = np.concatenate([self.a, self.b, self._turning_points()])
        return points.min(axis=0), points.max(axis=0)

    @cached_property
    def size(self) -> float:
        return float(np.max(self.box[1] - self.box[0]))

    def area(self) -> float:
        """The area enclosed, by Green's theorem: that of the polygons of the chords, and of a segment for each arc."""
        angle = 4.0 * np.arctan(self.bulge)
        with np.errstate(divide="ignore", invalid="ignore"):
            caps = np.where(self.bulge == 0.0, 0.0, (angle - np.sin(angle)) / self.curvature**2)
        return float(0.5 * np.sum(across(self.a, self.b) + caps))

    def mirrors(self) -> str:
        """The axes along which the outline is symmetric."""
        rows = np.column_stack([self.a, self.b, self.bulge]) + 0.0
        found = ""
        for axis, flip in zip("xy", ((-1.0, 1.0), (1.0, -1.0)), strict=True):
            image = np.column_stack([self.b * flip, self.a * flip, self.bulge]) + 0.0
            if set(map(tuple, rows.tolist())) == set(map(tuple, image.tolist())):
                found += axis
        return found

    def convex(self) -> bool:
        """True if one outline turns to the left all the way."""
        start, end = self.tangents()
        turn = across(end, start[self.following])
        one = len(self) > 0 and int(self.following[-1]) == 0
        return bool(one and np.all(self.bulge >= 0.0) and np.all(turn >= -NEAR) and not self.cusps.any())


# Where pieces meet


def turn(u: Floats, v: Floats) -> float:
    """The angle from one direction to another, left is positive."""
    return math.atan2(across(u, v), float(u @ v))


def first_meeting(outline: Outline) -> tuple[int, int, Floats] | None:
    """Two pieces that have more in common than the corner that they share, and a point of both; None for a simple
    outline."""
    near = NEAR * outline.size
    for i in range(len(outline) - 1):
        others = np.arange(i + 1, len(outline))
        points, met = _crossings(outline, i, others)
        for j in range(2):
            on = met[:, j] & outline.within(points[:, j], others, near)
            on &= outline.within(points[:, j], np.full(len(others), i), near)
            on &= ~_at_shared_corner(outline, i, others, points[:, j])
            if on.any():
                k = int(np.flatnonzero(on)[0])
                return i, int(others[k]), points[k, j]
        ends = outline.middles()[others]  # pieces of one circle or line do not cross
        lies = _lies_on(outline, i, ends, near)
        if lies.any():
            k = int(np.flatnonzero(lies)[0])
            return i, int(others[k]), ends[k]
    return None


def _at_shared_corner(outline: Outline, i: int, others: NDArray[np.int64], points: Floats) -> NDArray[np.bool_]:
    """Whether points are the corner that the piece shares with another, to what a tangent meeting leaves of digits."""
    near, shared = 1e-6 * outline.size, np.zeros(len(others), bool)
    follows, precedes = others == outline.following[i], outline.following[others] == i
    for joined, corner in ((follows, outline.b[i]), (precedes, outline.a[i])):
        shared |= joined & (np.linalg.norm(points - corner, axis=1) <= near)
    return shared


def distance_to_circle(outline: Outline, i: Any, points: Floats) -> Floats:
    """The distance to the line or circle of one piece, or of each, positive to the right."""
    a, b, n = outline.a[i], outline.b[i], outline.normal[i]
    from_a, from_b = points - a, points - b
    k, c = outline.curvature[i], outline.cosine[i]
    v = np.asarray(k)[..., None] * 0.5 * (from_a + from_b) - np.asarray(c)[..., None] * n
    power = k * np.sum(from_a * from_b, axis=-1) - 2.0 * c * np.sum(from_a * n, axis=-1)
    found: Floats = power / (np.linalg.norm(v, axis=-1) + 1.0)
    return found


def _lies_on(outline: Outline, i: int, points: Floats, near: float) -> NDArray[np.bool_]:
    on: NDArray[np.bool_] = np.abs(distance_to_circle(outline, i, points)) <= near
    return on & outline.within(points, np.full(len(points), i), near)


def _crossings(outline: Outline, i: int, others: NDArray[np.int64]) -> tuple[Floats, NDArray[np.bool_]]:
    """Both points, (m, 2, 2), where the circle or line of a piece meets those of others, and whether there are any.

    From two of the functions k p.p + w.p + d, which are 0 on the circle or line, one follows that is linear. It is cut
    with the more curved of the two. The origin is at the start of the piece.
    """
    origin = outline.a[i]

    def coefficients(rows: Any) -> tuple[Any, Any, Any]:
        a, b = outline.a[rows] - origin, outline.b[rows] - origin
        k, c, n = outline.curvature[rows], outline.cosine[rows], outline.normal[rows]
        w = -np.asarray(k)[..., None] * (a + b) - 2.0 * np.asarray(c)[..., None] * n
        return k, w, k * np.sum(a * b, axis=-1) + 2.0 * c * np.sum(a * n, axis=-1)

    m = len(others)
    mine = [np.broadcast_to(v, (m, *np.shape(v))) for v in coefficients(i)]
    theirs = coefficients(others)
    mine_first = np.abs(mine[0]) >= np.abs(theirs[0])
    (k, w, d), (j, x, e) = (
        [np.where(mine_first.reshape(-1, *[1] * (np.ndim(u) - 1)), u, v) for u, v in zip(*pair, strict=True)]
        for pair in ((mine, theirs), (theirs, mine))
    )
    ratio = np.divide(j, k, out=np.zeros(m), where=k != 0.0)
    line, level = x - ratio[:, None] * w, e - ratio * d
    size = np.linalg.norm(line, axis=1)
    crossing = size > 1e-12
    line, level = line / np.where(crossing, size, 1.0)[:, None], level / np.where(crossing, size, 1.0)
    along, foot = leftward(line), -level[:, None] * line
    # k t^2 + 2 g t + h = 0 along the line
    g = 0.5 * np.sum(w * along, axis=1) + k * np.sum(foot * along, axis=1)
    h = k * np.sum(foot * foot, axis=1) + np.sum(w * foot, axis=1) + d
    inner = g * g - k * h
    crossing &= inner >= 0.0
    q = -(g + np.where(g < 0.0, -1.0, 1.0) * np.sqrt(np.maximum(inner, 0.0)))
    roots = []
    for top, bottom in ((h, q), (q, k)):
        there = np.abs(bottom) > 1e-14 * np.maximum(np.abs(top), 1e-300)
        roots.append((np.divide(top, bottom, out=np.zeros(m), where=there), crossing & there))
    points = np.stack([foot + t[:, None] * along for t, _ in roots], axis=1) + origin
    return points, np.stack([there for _, there in roots], axis=1)


# The shape


def in_table(bulges: Any) -> bool:
    """Whether pieces are rows of a table rather than text; an arc has three times the operations of a line."""
    return bool(np.sum(np.where(np.asarray(bulges) == 0.0, 1, 3)) > STANDARD.corners)


@function()
def piece(p: Vec2Expr, a: Vec2Expr, b: Vec2Expr, bulge: FloatExpr, at_a: Vec2Expr, at_b: Vec2Expr) -> Expr:
    """Signed distance to a line or an arc of at most half a turn from a to b, which has the inside on its left.

    at_a, at_b : see `flat.edge`. The tangents are the chord's direction turned by half the angle to either side.
    """
    from_a, from_b, chord = p - a, p - b, length(b - a)
    along = (b - a) / chord
    n, whole = vec2(-along.y, along.x), 1.0 + bulge * bulge
    c, s = (1.0 - bulge * bulge) / whole, 2.0 * bulge / whole
    k = 2.0 * s / chord
    beside = (dot(from_a, c * along - s * n) >= 0.0) & (dot(from_b, c * along + s * n) <= 0.0)
    over = (k * dot(from_a, from_b) - 2.0 * c * dot(from_a, n)) / (length(0.5 * k * (from_a + from_b) - c * n) + 1.0)
    first = dot(from_a + from_b, along) < 0.0
    corner, normal = where(first, from_a, from_b), where(first, at_a, at_b)
    return where(beside, over, where(dot(corner, normal) < 0.0, -1.0, 1.0) * length(corner))


def _check_outline(pieces: Rows) -> None:
    outline = Outline(pieces)
    if not np.all(outline.chord > 0.0) or not np.all(np.abs(outline.bulge) <= 1.0):
        raise SceneError("sketch: a piece without length, or of more than half a turn", legal="what rm.sketch makes")
    if sorted(outline.following.tolist()) != list(range(len(outline))):
        raise SceneError("sketch: pieces that do not join", legal="what rm.sketch makes")


@shape(
    exactness="exact",
    bounds=lambda pieces: tuple(map(expr, Outline(pieces).box)),
    symmetry=lambda pieces: Outline(pieces).mirrors(),
    convex=lambda pieces: Outline(pieces).convex(),
    check=_check_outline,
    dimension=2,
    called="sketch",
)
def closed_outline(p: Expr, pieces: Pieces) -> Expr:
    """The region inside closed outlines of lines and arcs, which `rm.sketch` makes.

    pieces : rows (x, y, x, y, bulge), in order: the two ends of a piece and the tangent of a quarter of its angle, from
        -1 to 1, positive if it turns left. The inside is on the left. More than 100 lines, or 33 arcs,
        become a table, which a loop reads.

    Exact: the distance to the nearest piece, which also gives the sign. If a corner is nearest, the mean of the normals
    there gives the sign, and the direction of the pieces where these turn back.
    """
    outline = Outline(pieces)
    at_a, at_b = outline.corner_normals()
    if not in_table(outline.bulge):
        found = []
        for a, b, bulge, *normals in zip(outline.a, outline.b, outline.bulge.tolist(), at_a, at_b, strict=True):
            sides = [const(a), const(b)], [const(v) for v in normals]
            found.append(edge(p, *sides[0], *sides[1]) if bulge == 0.0 else piece(p, *sides[0], bulge, *sides[1]))
        return reduce(nearer, found)
    bulges = np.column_stack([outline.bulge, np.zeros((len(outline), 3))])
    texels = [np.column_stack([outline.a, outline.b]), np.column_stack([at_a, at_b]), bulges]
    table = Table(np.stack(texels, axis=1).reshape(-1, 4), f"a sketch of {len(outline)} pieces")

    def step(i: Expr, nearest: Expr) -> tuple[Expr]:
        ends, normals, bulge = (fetch(table, 3.0 * i + float(j)) for j in range(3))
        sides = [vec2(row[m], row[m + 1]) for row in (ends, normals) for m in (0, 2)]
        return (nearer(nearest, piece(p, *sides[:2], bulge.x, *sides[2:])),)

    (nearest,) = loop(len(outline), [FARTHEST], step)
    return nearest
