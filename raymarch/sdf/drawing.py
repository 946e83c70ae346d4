"""What a sketch is drawn with: cubic curves as tangent arcs, and fillets and chamfers of corners.

A span of a curve is two arcs (a biarc), halved until they are near enough. A fillet's centre is where the two pieces,
moved by the radius to the inner side of the corner, meet. What a cut takes from each piece is a length along it. The
cuts at both ends of a piece must fit on it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.sdf.flat import across, leftward
from raymarch.sdf.outlines import NEAR, Outline, distance_to_circle, turn

Floats = NDArray[np.float64]
Arcs = list[tuple[Floats, float]]

MOST_HALVINGS = 16
_T = np.linspace(0.0, 1.0, 33)
_POWERS = np.stack([(1 - _T) ** 3, 3 * _T * (1 - _T) ** 2, 3 * _T**2 * (1 - _T), _T**3], axis=1)


def through(points: Floats, start: Floats | None, end: Floats | None) -> list[Floats]:
    """The control points of the cubic spans of a spline through points (n, 2).

    At an inner point the direction is that of the parabola through it and its neighbours, with the chords' lengths as
    steps. At a free end the second derivative is 0.
    """
    chords = np.diff(points, axis=0)
    steps = np.linalg.norm(chords, axis=1)[:, None]
    slopes = chords / steps
    inner = (steps[1:] * slopes[:-1] + steps[:-1] * slopes[1:]) / (steps[:-1] + steps[1:])
    ways = np.vstack([slopes[:1], inner, slopes[-1:]])
    for side, given, near, slope in ((0, start, 1, slopes[0]), (-1, end, -2, slopes[-1])):
        if given is None:
            ways[side] = 1.5 * slope - 0.5 * ways[near] if len(points) > 2 else slope
        elif not given.any():
            raise SceneError("sketch: spline_to: a direction of length 0", legal="two numbers, not both 0")
        else:
            ways[side] = given / np.linalg.norm(given)
    third = steps / 3.0
    return list(
        np.stack([points[:-1], points[:-1] + ways[:-1] * third, points[1:] - ways[1:] * third, points[1:]], axis=1)
    )


def as_arcs(curve: Floats, tolerance: float, halvings: int = 0) -> Arcs:
    """Ends and bulges of lines and arcs within a tolerance of a cubic curve with the control points (4, 2)."""
    a, b, c, d = curve
    if _is_straight(curve):
        return [(d, 0.0)]
    arcs = _biarc(a, _way(curve), d, -_way(curve[::-1]))
    if arcs is not None and _farthest(curve, arcs) <= tolerance:
        return arcs
    if halvings == MOST_HALVINGS:
        what = f"sketch: a curve turns too fast near {tuple(np.round(a, 6).tolist())}"
        raise SceneError(what, legal="a curve without a cusp, or a larger tolerance")
    ab, bc, cd = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + d)
    left, right = 0.5 * (ab + bc), 0.5 * (bc + cd)
    middle = 0.5 * (left + right)
    first = as_arcs(np.array([a, ab, left, middle]), tolerance, halvings + 1)
    return first + as_arcs(np.array([middle, right, cd, d]), tolerance, halvings + 1)


def _is_straight(curve: Floats) -> bool:
    """True if the control points lie on the segment between the ends, in order."""
    along = curve[3] - curve[0]
    size = float(np.linalg.norm(along))
    if size == 0.0:
        return False
    over = curve - curve[0]
    t = over @ along / size
    aside = np.abs(across(over, along)) / size
    return bool(np.all(aside <= 1e-12 * size) and np.all(np.diff(t) >= -1e-12 * size))


def _way(curve: Floats) -> Floats:
    """The unit direction at the start of a curve."""
    for other in curve[1:]:
        step: Floats = other - curve[0]
        if np.linalg.norm(step) > 1e-12 * np.max(np.abs(curve - curve[0])):
            return step / np.linalg.norm(step)
    raise SceneError(f"sketch: a curve without length at {tuple(curve[0].tolist())}", legal="points that differ")


def _bulge(way: Floats, chord: Floats) -> float | None:
    """Of the arc that starts in a direction and has a chord; None for more than half a turn."""
    angle = turn(way, chord)
    return math.tan(0.5 * angle) if abs(angle) <= 0.5 * math.pi else None


def _biarc(a: Floats, start: Floats, b: Floats, end: Floats) -> Arcs | None:
    """Two arcs from a to b with the given directions, joined where both have equal tangent lengths (Bolton 1975)."""
    chord = b - a
    squared, along, spare = float(chord @ chord), float(chord @ (start + end)), 1.0 - float(start @ end)
    root = math.sqrt(max(along * along + 2.0 * spare * squared, 0.0)) + along
    if squared == 0.0 or root <= 1e-9 * math.sqrt(squared):
        return None
    length = squared / root
    joint = 0.5 * (a + b + length * (start - end))
    first, second = _bulge(start, joint - a), _bulge(-end, joint - b)
    return None if first is None or second is None else [(joint, first), (b, -second)]


def _farthest(curve: Floats, arcs: Arcs) -> float:
    """A bound of the distance of a curve's points from arcs between the same ends.

    The distance to one circle, at a step h between samples, is at most that at both of them and h^2 / 8 of its second
    derivative along the curve, |C'|^2 k + |C''|. The arcs have no other points far from the curve: it goes from end to
    end, and so do its nearest points on the arcs.
    """
    starts = [curve[0], arcs[0][0]]
    outline = Outline([(*a, *b, bulge) for a, (b, bulge) in zip(starts, arcs, strict=True)])
    points = _POWERS @ curve
    speed = 3.0 * float(np.max(np.linalg.norm(np.diff(curve, axis=0), axis=1)))
    bend = 6.0 * float(np.max(np.linalg.norm(np.diff(curve, 2, axis=0), axis=1)))
    found = []
    for i in range(2):
        apart = np.abs(distance_to_circle(outline, i, points))
        between = (speed**2 * abs(float(outline.curvature[i])) + bend) * (_T[1] ** 2 / 8.0)
        found.append(np.maximum(apart[:-1], apart[1:]) + between)
    return float(np.max(np.minimum(*found)))


class Cut(NamedTuple):
    """A fillet or a chamfer of a corner.

    kind : "fillet" or "chamfer". size : radius, or length along both pieces. call : its number in the sketch.
    named : whether its corner was named, rather than all.
    """

    kind: str
    size: float
    call: int
    named: bool


class Ray(NamedTuple):
    """A piece as seen from one of its ends, which is a corner.

    corner : (2,). way : unit direction from the corner along the piece. curvature : to the left of that direction.
    length : of the piece.
    """

    corner: Floats
    way: Floats
    curvature: float
    length: float

    def at(self, s: float) -> tuple[Floats, Floats]:
        """The point and the direction at a length along the piece."""
        angle = self.curvature * s
        sine, versed = (
            (s, 0.0) if angle == 0.0 else (math.sin(angle) / self.curvature, (1.0 - math.cos(angle)) / self.curvature)
        )
        left = leftward(self.way)
        return self.corner + sine * self.way + versed * left, math.cos(angle) * self.way + math.sin(angle) * left

    def foot(self, point: Floats) -> float:
        """The length along the piece to the point of its line or circle that is nearest to another one."""
        over = point - self.corner
        along, left = float(over @ self.way), float(across(self.way, over))
        if self.curvature == 0.0:
            return along
        k = self.curvature
        angle = math.atan2(k * along, 1.0 - k * left) if k > 0.0 else math.atan2(-k * along, 1.0 - k * left)
        return (angle % math.tau) / abs(k)


def cut_corners(
    points: Floats, bulges: Floats, cuts: Mapping[int, Cut], numbers: Mapping[int, int], names: Mapping[int, str]
) -> Floats:
    """The pieces (n, 5) of a closed outline with its corners cut.

    points : the corners (n, 2). bulges : of the piece that starts at each. cuts : by corner. numbers, names : of
        corners, for messages.

    Raises SceneError with the largest legal size for a cut that does not fit.
    """
    outline = Outline(np.column_stack([points, np.roll(points, -1, axis=0), bulges]))
    if not np.all(outline.chord > NEAR * outline.size):
        where = tuple(points[int(np.argmin(outline.chord))].tolist())
        raise SceneError(f"sketch: a piece without length at {where}", legal="pieces with a length")
    sharp = {}
    for corner, cut in cuts.items():
        if cut.size > 0.0:
            if abs(_turn_at(outline, corner)) > 1e-6:
                sharp[corner] = cut
            elif cut.named:
                what = f"sketch: {cut.kind} at corner {_called(points, corner, numbers, names)}, where it is smooth"
                raise SceneError(what, legal="a corner with an angle")
    trims = _trims(outline, sharp)
    failed = _misfit(outline, trims)
    if failed is not None:
        cut = sharp[failed]
        largest = _largest(outline, sharp, cut)
        word = "radius" if cut.kind == "fillet" else "length"
        what = f"sketch: {cut.kind} of {word} {cut.size:g} at corner {_called(points, failed, numbers, names)}"
        raise SceneError(what, legal=f"{word} <= {largest:.6g} there")
    return _joined(outline, sharp, trims)


def _called(points: Floats, corner: int, numbers: Mapping[int, int], names: Mapping[int, str]) -> str:
    name = f' "{names[corner]}"' if corner in names else ""
    return f"{numbers.get(corner, corner)}{name} = {tuple(points[corner].tolist())}"


def _turn_at(outline: Outline, corner: int) -> float:
    """The angle by which the outline turns at a corner, positive to the left."""
    start, end = outline.tangents()
    return turn(end[corner - 1], start[corner])


def _lengths(outline: Outline) -> Floats:
    angle = 4.0 * np.arctan(outline.bulge)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(angle == 0.0, outline.chord, angle / outline.curvature)


def _rays(outline: Outline, corner: int) -> tuple[Ray, Ray]:
    """The piece before a corner, backwards, and the piece after it."""
    start, end = outline.tangents()
    length, k = _lengths(outline), outline.curvature
    before = Ray(outline.a[corner], -end[corner - 1], -float(k[corner - 1]), float(length[corner - 1]))
    return before, Ray(outline.a[corner], start[corner], float(k[corner]), float(length[corner]))


Trims = dict[int, tuple[float, float]]


def _trims(outline: Outline, cuts: Mapping[int, Cut]) -> Trims:
    """What each cut takes from the piece before its corner and from that after it; infinite where it cannot be."""
    return {
        corner: (cut.size, cut.size) if cut.kind == "chamfer" else _filleted(*_rays(outline, corner), cut.size)
        for corner, cut in cuts.items()
    }


def _filleted(before: Ray, after: Ray, radius: float) -> tuple[float, float]:
    """The lengths to the points where a circle touches both pieces, the nearest to the corner."""
    side = (
        1.0 if across(before.way, after.way) < 0.0 else -1.0
    )  # 1 if the inner side is left of the piece after the corner
    curves = []
    for ray, left in ((before, -side), (after, side)):
        normal = leftward(ray.way)
        if ray.curvature == 0.0:
            curves.append((ray.corner + left * radius * normal, ray.way, 0.0))
        elif 1.0 - ray.curvature * left * radius > 0.0:
            own = 1.0 / ray.curvature
            curves.append((ray.corner + own * normal, ray.way, abs(own - left * radius)))
        else:
            return math.inf, math.inf
    best = (math.inf, math.inf)
    for centre in _common(*curves):
        found = before.foot(centre), after.foot(centre)
        if min(found) >= 0.0 and found[0] <= before.length * (1 + NEAR) and found[1] <= after.length * (1 + NEAR):
            best = min(best, found, key=sum)
    return best


Curve = tuple[Floats, Floats, float]
"""A point and a direction of a line, and 0; or the centre of a circle, any direction, and the radius."""


def _common(first: Curve, second: Curve) -> list[Floats]:
    """The points that two lines or circles have in common."""
    (p, u, r), (q, v, s) = first, second
    if r == 0.0 == s:
        area = float(across(u, v))
        return [] if area == 0.0 else [p + u * float(across(q - p, v)) / area]
    if r == 0.0:
        foot, half, along = p + u * float((q - p) @ u), 0.0, u
        half = s * s - float((foot - q) @ (foot - q))
    elif s == 0.0:
        return _common(second, first)
    else:
        over = q - p
        apart = float(np.linalg.norm(over))
        if apart == 0.0:
            return []
        share = 0.5 * (apart * apart + (r - s) * (r + s)) / apart
        foot, half, along = p + over / apart * share, r * r - share * share, leftward(over) / apart
    if half < -1e-12 * max(r, s) ** 2:
        return []
    root = math.sqrt(max(half, 0.0))
    return [foot + root * along, foot - root * along]


def _misfit(outline: Outline, trims: Trims) -> int | None:
    """A corner whose cut does not fit on a piece, the one that takes more of it; None if all fit."""
    lengths, n = _lengths(outline), len(outline)
    for corner, taken in trims.items():
        if not math.isfinite(sum(taken)):
            return corner
    for i in range(n):
        first, second = trims.get(i, (0.0, 0.0))[1], trims.get((i + 1) % n, (0.0, 0.0))[0]
        if first + second > lengths[i] + NEAR * outline.size:
            return i if first >= second else (i + 1) % n
    return None


def _largest(outline: Outline, cuts: Mapping[int, Cut], changed: Cut) -> float:
    """The largest size with which the cuts of one call fit, the others as they are."""
    low, high = 0.0, changed.size
    for _ in range(60):
        size = 0.5 * (low + high)
        tried = {corner: cut._replace(size=size) if cut.call == changed.call else cut for corner, cut in cuts.items()}
        low, high = (size, high) if _misfit(outline, _trims(outline, tried)) is None else (low, size)
    return low


def _joined(outline: Outline, cuts: Mapping[int, Cut], trims: Trims) -> Floats:
    """The pieces shortened, and the arcs and lines of the cuts between them."""
    n, near, lengths = len(outline), NEAR * outline.size, _lengths(outline)
    rows: list[list[Any]] = []
    for i in range(n):
        before, after = _rays(outline, i)
        first, second = trims.get(i, (0.0, 0.0))
        start, way = after.at(second)
        if i in cuts:
            leave, back = before.at(first)
            rows.append([leave, start, math.tan(0.25 * turn(-back, way)) if cuts[i].kind == "fillet" else 0.0])
        left = lengths[i] - second - trims.get((i + 1) % n, (0.0, 0.0))[0]
        if left > near:
            bulge = math.tan(math.atan(outline.bulge[i]) * left / lengths[i])
            rows.append([start, after.at(second + left)[0], bulge])
    for k, row in enumerate(rows):  # one point for each corner
        rows[k - 1][1] = row[0]
    return np.array([[*a, *b, bulge] for a, b, bulge in rows], dtype=np.float64)
