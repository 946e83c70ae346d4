"""Sketches: flat shapes drawn piece by piece, as in CAD, with lines, arcs and splines, fillets, chamfers and holes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import holdable, numbers, short, switch
from raymarch.expr.peers import unknown_attribute
from raymarch.sdf.domain import NonNegative, Positive, domain_of
from raymarch.sdf.drawing import Cut, as_arcs, cut_corners, through
from raymarch.sdf.node import Node
from raymarch.sdf.outlines import NEAR, Outline, closed_outline, first_meeting, in_table, turn

__all__ = ["sketch"]

Floats = NDArray[np.float64]
Corners: TypeAlias = "int | str | Sequence[int | str] | None"


def _point(what: str, value: Any) -> Floats:
    legal = "two finite numbers (x, y); a sketch has no `Param`, but the node may be moved and scaled by one"
    found = numbers(what, value, legal)
    if found.shape != (2,) or not holdable(found):
        raise SceneError(f"{what} = {short(value)}", legal=legal)
    return found


def _length(what: str, name: str, value: Any, annotation: Any = Positive) -> float:
    given = domain_of(annotation, 0.0).accept(what, name, value)
    if not given.is_constant:
        raise SceneError(f"{what}: {name} = {short(value)}", legal="a number; a sketch has no `Param`")
    return float(given.data)


@dataclass(frozen=True, eq=False, repr=False)
class Sketch:
    """An outline that is not closed yet. Each method returns a new sketch, `close()` the flat shape.

    points : the ends of all pieces, the first is the start. bulges : of the pieces, see `raymarch.sdf.outlines`.
    corners : for each corner, in the order in which they were drawn, the number of its point. names : of corners.
    cuts : fillets and chamfers. holes : closed outlines inside.
    """

    points: tuple[tuple[float, float], ...]
    bulges: tuple[float, ...] = ()
    corners: tuple[int, ...] = (0,)
    names: tuple[str | None, ...] = (None,)
    cuts: tuple[tuple[str, float, Corners], ...] = ()
    holes: tuple[tuple[tuple[float, ...], ...], ...] = ()

    def __repr__(self) -> str:
        return f"<sketch of {len(self.bulges)} pieces, open: .close() makes the flat shape>"

    def __getattr__(self, name: str) -> NoReturn:
        if not name.startswith("_") and hasattr(Node, name):
            raise SceneError(f"sketch: .{name} of an open outline", legal=f".close().{name}(...)")
        raise unknown_attribute("a sketch", name, [n for n in dir(type(self)) if not n.startswith("_")])

    @property
    def _end(self) -> Floats:
        return np.array(self.points[-1])

    def _with(self, what: str, rows: Sequence[tuple[Any, float]], name: str | None) -> Sketch:
        """Further pieces, each its end and bulge, up to a new corner."""
        points, bulges = [*self.points], [*self.bulges]
        for end, bulge in rows:
            if abs(bulge) > 1.0:  # more than half a turn: two arcs
                half = math.tan(0.5 * math.atan(bulge))
                middle = Outline([(*points[-1], *end, bulge)]).middles()[0]
                points.append((float(middle[0]), float(middle[1])))
                bulges, bulge = [*bulges, half], half
            if tuple(end) == points[-1]:
                raise SceneError(f"sketch: {what} to {points[-1]}, where it starts", legal="a piece with a length")
            points.append((float(end[0]), float(end[1])))
            bulges.append(float(bulge))
        if name is not None and (not isinstance(name, str) or name in self.names):
            raise SceneError(f"sketch: {what}: name = {short(name)}", legal="a name that no corner has")
        corners = (*self.corners, len(points) - 1)
        return replace(self, points=tuple(points), bulges=tuple(bulges), corners=corners, names=(*self.names, name))

    def line_to(self, end: Any, *, name: str | None = None) -> Sketch:
        """A straight line.

        Parameters
        ----------
        end : (x, y) in scene units, where the line ends.
        name : of the corner there, for `fillet` and `chamfer`.

        Raises
        ------
        SceneError : a point that is not two finite numbers, or that is where the sketch is; a name given before.
        """
        return self._with("line", [(_point("sketch: line_to: end", end), 0.0)], name)

    def line_by(self, step: Any, *, name: str | None = None) -> Sketch:
        """A straight line by a step (x, y) in scene units; else as `line_to`."""
        return self._with("line", [(self._end + _point("sketch: line_by: step", step), 0.0)], name)

    def arc_to(self, end: Any, radius: float, *, large: bool = False, name: str | None = None) -> Sketch:
        """A circular arc with a radius.

        Parameters
        ----------
        end : (x, y) in scene units, where the arc ends.
        radius : length; the arc turns left if it is > 0, right if it is < 0. Its absolute value is at least half of the
            distance to the end.
        large : True for the larger of both arcs.
        name : of the corner at the end.

        Raises
        ------
        SceneError : a radius that is too small to reach the end, or other arguments that are not legal.
        """
        point = _point("sketch: arc_to: end", end)
        chord = float(np.linalg.norm(point - self._end))
        given = float(numbers("sketch: arc_to: radius", radius, "a number").reshape(-1)[0])
        if not 0.5 * chord <= abs(given) * (1.0 + NEAR) or not math.isfinite(given) or chord == 0.0:
            legal = (
                f"{0.5 * chord:g} or more (left), or {-0.5 * chord:g} or less (right): half of the distance to the end"
            )
            raise SceneError(f"sketch: arc_to {short(end)}: radius = {short(radius)}", legal=legal)
        half = math.asin(min(0.5 * chord / abs(given), 1.0))
        if switch("sketch: arc_to: large", large):
            half = math.pi - half
        return self._with("arc", [(point, math.copysign(math.tan(0.5 * half), given))], name)

    def arc_through(self, middle: Any, end: Any, *, name: str | None = None) -> Sketch:
        """The circular arc through a point.

        Parameters
        ----------
        middle : (x, y) in scene units, any point on the arc between its ends.
        end : (x, y) in scene units, where it ends.
        name : of the corner at the end.

        Raises
        ------
        SceneError : points that are equal, or that lie on a line in another order.
        """
        via, point = _point("sketch: arc_through: middle", middle), _point("sketch: arc_through: end", end)
        first, second = via - self._end, point - via
        angle = turn(first, second)
        if not (first.any() and second.any()) or np.array_equal(point, self._end) or abs(angle) > math.pi - 1e-9:
            what = f"sketch: no arc from {self.points[-1]} through {short(middle)} to {short(end)}"
            raise SceneError(what, legal="three points that differ, the second between the others")
        return self._with("arc", [(point, math.tan(0.5 * angle) if abs(angle) > 1e-12 else 0.0)], name)

    def tangent_arc_to(self, end: Any, *, name: str | None = None) -> Sketch:
        """The circular arc to (x, y) that goes on in the direction of the piece before it; else as `line_to`."""
        point = _point("sketch: tangent_arc_to: end", end)
        if not self.bulges:
            raise SceneError("sketch: tangent_arc_to without a piece before it", legal="a line or an arc first")
        angle = turn(self._direction, point - self._end)
        if abs(angle) > math.pi - 1e-9:
            what = f"sketch: tangent_arc_to {short(end)}, which lies straight behind"
            raise SceneError(what, legal="a point that an arc reaches")
        return self._with("arc", [(point, math.tan(0.5 * angle) if abs(angle) > 1e-12 else 0.0)], name)

    @property
    def _direction(self) -> Floats:
        """In which the last piece ends."""
        last: Floats = Outline([(*self.points[-2], *self.points[-1], self.bulges[-1])]).tangents()[1][0]
        return last

    def spline_to(
        self,
        points: Any,
        *,
        start: Any = None,
        end: Any = None,
        tolerance: float | None = None,
        name: str | None = None,
    ) -> Sketch:
        """A smooth curve through points: the cubic spline of Catmull and Rom (1974), its knots at the chords' lengths.

        Parameters
        ----------
        points : one or more, each (x, y) in scene units; the last is where the curve ends.
        start, end : directions (x, y) of the curve at its ends, of any length but 0. None is a free end.
        tolerance : length > 0, how far the arcs that replace the curve may be from it, and it from them. None is a
            ten-thousandth of its extent.
        name : of the corner at the end.

        Raises
        ------
        SceneError : points that repeat, or arguments that are not legal.
        """
        legal = "points, each two finite numbers (x, y)"
        given = np.atleast_2d(numbers("sketch: spline_to: points", points, legal))
        if given.ndim != 2 or given.shape[1:] != (2,) or not len(given) or not holdable(given):
            raise SceneError(f"sketch: spline_to: points = {short(points)}", legal=legal)
        known = np.vstack([self._end, given])
        if not np.all(np.linalg.norm(np.diff(known, axis=0), axis=1) > 0.0):
            raise SceneError("sketch: spline_to: a point is given twice in a row", legal="each point once")
        ways = [
            None if way is None else _point(f"sketch: spline_to: {side}", way)
            for side, way in (("start", start), ("end", end))
        ]
        return self._curved("spline_to", through(known, *ways), tolerance, name)

    def bezier_to(self, *points: Any, tolerance: float | None = None, name: str | None = None) -> Sketch:
        """A quadratic or cubic Bézier curve.

        Parameters
        ----------
        points : two or three, each (x, y) in scene units: the control points after the first, which is where the sketch
            is. The last is where the curve ends.
        tolerance, name : as for `spline_to`.

        Raises
        ------
        SceneError : another number of points, a curve with a cusp, or arguments that are not legal.
        """
        if len(points) not in (2, 3):
            raise SceneError(f"sketch: bezier_to of {len(points)} points", legal="two points or three")
        a, *rest = (self._end, *(_point("sketch: bezier_to: point", p) for p in points))
        if len(rest) == 2:
            b, c = rest
            rest = [a + (b - a) * (2.0 / 3.0), c + (b - c) * (2.0 / 3.0), c]
        return self._curved("bezier_to", [np.array([a, *rest])], tolerance, name)

    def _curved(self, what: str, curves: Sequence[Floats], tolerance: float | None, name: str | None) -> Sketch:
        extent = float(np.max(np.ptp(np.concatenate(curves), axis=0)))
        near = 1e-4 * extent if tolerance is None else _length(f"sketch: {what}", "tolerance", tolerance)
        rows = [row for curve in curves for row in as_arcs(curve, max(near, NEAR * extent))]
        return self._with(what, rows, name)

    def fillet(self, radius: float, at: Corners = None) -> Sketch:
        """Round corners by an arc that is tangent to both pieces.

        Parameters
        ----------
        radius : length >= 0; 0 keeps a corner sharp.
        at : a corner or a list of them: names, or numbers in the order in which corners were drawn, 0 for the start.
            None is all corners that have no fillet or chamfer of their own, also those drawn later.

        Raises
        ------
        SceneError : from `close()`, if the radius does not fit, with the largest that does; or for an unknown corner.
            At the end of a spline a fillet has to fit on the last of its arcs.
        """
        size = _length("sketch: fillet", "radius", radius, NonNegative)
        return replace(self, cuts=(*self.cuts, ("fillet", size, at)))

    def chamfer(self, length: float, at: Corners = None) -> Sketch:
        """Cut corners by a line.

        Parameters
        ----------
        length : >= 0, from the corner along each of its two pieces; 0 keeps a corner sharp.
        at : see `fillet`.

        Raises
        ------
        SceneError : as for `fillet`.
        """
        size = _length("sketch: chamfer", "length", length, NonNegative)
        return replace(self, cuts=(*self.cuts, ("chamfer", size, at)))

    def hole(self, other: Sketch) -> Sketch:
        """A hole: another sketch, which is closed by this and lies inside of this outline.

        Raises
        ------
        SceneError : an argument that is no sketch; from `close()`, a hole that meets the outline or another hole.
        """
        given: Any = other
        if not isinstance(given, Sketch):
            legal = "an open sketch. For a flat shape: sketch.close() - shape"
            raise SceneError(f"sketch: hole of {short(other)}", legal=legal)
        if other.holes:
            raise SceneError("sketch: a hole that has holes", legal="a hole without; add what is inside by a | b")
        return replace(self, holes=(*self.holes, other._loop(-1.0)))

    def _cut_at(self, closes: bool) -> dict[int, Cut]:
        """The cuts of single corners, by the number of the point. The last that names a corner counts."""
        found: dict[int, Cut] = {}
        last = len(self.corners) - closes  # the end of a closed sketch is its start
        for call, (kind, size, at) in enumerate(self.cuts):
            named = [] if at is None else [at] if isinstance(at, int | str) else list(at)
            for each in named:
                known = isinstance(each, str) and each in self.names
                number = self.names.index(each) if known else each
                if isinstance(number, int) and number == len(self.corners) - 1 and closes:
                    number = 0
                if not isinstance(number, int) or not 0 <= number < last:
                    names = ", ".join(f'"{n}"' for n in self.names if n) or "none has a name"
                    raise SceneError(
                        f"sketch: {kind} at corner {short(each)}", legal=f"0 to {last - 1}, or a name: {names}"
                    )
                found[self.corners[number]] = Cut(kind, size, call, True)
        for call, (kind, size, at) in reversed(list(enumerate(self.cuts))):
            if at is None:
                for corner in self.corners[:last]:
                    found.setdefault(corner, Cut(kind, size, call, False))
        return found

    def _loop(self, side: float) -> tuple[tuple[float, ...], ...]:
        """The closed outline with its corners cut, counter-clockwise for side = 1, clockwise for -1."""
        points, bulges = np.array(self.points), [*self.bulges]
        size = float(np.max(np.ptp(points, axis=0)))
        closes = len(points) > 1 and float(np.linalg.norm(points[-1] - points[0])) <= NEAR * size
        if closes:
            points = points[:-1]
        else:
            bulges.append(0.0)
        if len(points) < 2 or (len(points) == 2 and not any(bulges)):
            what = f"an outline of {len(bulges)} piece{'s'[: len(bulges) - 1]}"
            raise SceneError(f"sketch: {what} encloses nothing", legal="three lines, or an arc")
        names = {self.corners[i]: name for i, name in enumerate(self.names) if name}
        numbered = {point: number for number, point in reversed(list(enumerate(self.corners)))}
        rows = cut_corners(points, np.array(bulges), self._cut_at(closes), numbered, names)
        made = Outline(rows)
        if (made.area() > 0.0) != (side > 0.0):
            rows = np.column_stack([made.b, made.a, -made.bulge])[::-1]
        return tuple(map(tuple, rows.tolist()))

    def close(self) -> Node:
        """The flat shape inside: a line leads back to the start, unless the sketch ends there.

        Returns
        -------
        Node
            An exact distance, to extrude, revolve, combine or move. Splines are arcs within their tolerance.

        Raises
        ------
        SceneError : an outline that meets itself or encloses nothing, a fillet or chamfer that does not fit, with the
            largest that does, or a hole that is not inside.
        """
        loops = [self._loop(1.0), *self.holes]
        if in_table([row[4] for loop in loops for row in loop]):  # a table holds numbers of float32
            loops = [tuple(map(tuple, np.array(loop, np.float32).tolist())) for loop in loops]
        outline = Outline([row for loop in loops for row in loop])
        back = outline.cusps & (np.abs(outline.tapered) * outline.size < 1e-6)
        if back.any():
            where = short(tuple(outline.b[np.flatnonzero(back)[0]].tolist()))
            raise SceneError(f"sketch: it turns back on itself at {where}", legal="corners with an angle")
        met = first_meeting(outline)
        if met is not None:
            i, j, point = met
            ends = [f"{short(tuple(outline.a[k].tolist()))} to {short(tuple(outline.b[k].tolist()))}" for k in (i, j)]
            raise SceneError(
                f"sketch: the piece from {ends[0]} meets that from {ends[1]} at ({point[0]:.6g}, {point[1]:.6g})",
                legal="an outline whose pieces meet in its corners only",
            )
        for i, hole in enumerate(self.holes):
            others = [loops[0], *(h for j, h in enumerate(self.holes) if j != i)]
            if not float(closed_outline([row for loop in others for row in loop]).distance([hole[0][:2]])[0]) < 0.0:
                raise SceneError(
                    f"sketch: the hole at {hole[0][:2]} is not inside", legal="holes inside of the outline"
                )
        return closed_outline([row for loop in loops for row in loop])


@checked
def sketch(start: Any = (0.0, 0.0)) -> Sketch:
    """Draw a flat shape piece by piece, as in CAD: lines, arcs and splines, with fillets, chamfers and holes.

    Parameters
    ----------
    start : (x, y) in scene units, the first corner.

    Returns
    -------
    Sketch
        `line_to`, `line_by`, `arc_to`, `arc_through`, `tangent_arc_to`, `spline_to` and `bezier_to` go on from its end;
        `fillet`, `chamfer` and `hole` change it; `close()` gives the flat shape. Each returns a new sketch.

    Raises
    ------
    SceneError : a start that is not two finite numbers.

    Notes
    -----
    The shape is exact for lines and arcs. Splines become tangent arcs within a tolerance (biarcs, Bolton 1975). All
    coordinates are numbers. The cost grows with the number of pieces; more than 100 lines, or 33 arcs, become a table.

    Examples
    --------
    >>> plate = rm.sketch((0, 0)).line_to((4, 0)).line_to((4, 2)).arc_through((2, 3), (0, 2)).fillet(0.2).close()
    >>> bracket = plate.extrude(0.3)
    """
    point = _point("sketch: start", start)
    return Sketch(((float(point[0]), float(point[1])),))
