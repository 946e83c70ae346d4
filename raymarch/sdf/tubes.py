"""Cones between two points, and tubes of varying radius, put together from solids about the y axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import integer, numbers, short
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import length
from raymarch.sdf.booleans import union
from raymarch.sdf.domain import Domain, Scalar, Vector
from raymarch.sdf.node import Node
from raymarch.sdf.placing import orient, translate
from raymarch.sdf.rounds import cone, round_cone
from raymarch.sdf.solids import sphere

__all__ = ["cone_between", "round_cone_between", "tube"]


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
    if apart <= abs(start - end) * (1.0 + 1e-9):
        return translate(sphere(float(start if start > end else end)), (a if start > end else b).tolist())
    return round_cone_between(a.tolist(), b.tolist(), float(start), float(end))
