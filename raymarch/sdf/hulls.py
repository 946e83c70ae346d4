"""Convex hulls of points, in the plane and in space."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import holdable, numbers, short
from raymarch.sdf.booleans import intersection
from raymarch.sdf.flat import across, polygon
from raymarch.sdf.node import Node
from raymarch.sdf.solids import box, plane

__all__ = ["hull"]

Floats = NDArray[np.float64]

MOST_POINTS = 100
"""Of a hull in space: the planes through all triples of points are tried."""


@checked
def hull(points: Any) -> Node:
    """The convex hull of points: the smallest convex shape that holds them.

    Parameters
    ----------
    points : (N, 2) for a flat shape, N >= 3, or (N, 3) for a solid, 4 <= N <= 100, in scene units. Points inside of the
        hull have no effect. They are numbers and cannot be a `Param`.

    Returns
    -------
    Node
        A `polygon`, which is exact; or the intersection of a half-space for each face: exact inside, a bound outside.

    Raises
    ------
    SceneError : solids in place of points, another shape, or points that lie on one line or in one plane.

    Notes
    -----
    The hull of two balls is `round_cone_between`, and that of two equal ones `capsule`. For equal discs at points it is
    `hull(points).round(radius)`. In space, `round` of a hull moves its faces and keeps its edges sharp.

    Examples
    --------
    >>> wedge = rm.hull([(0, 0, 0), (2, 0, 0), (0, 0, 1), (2, 0, 1), (0, 1, 0), (0, 1, 1)])
    >>> plate = rm.hull([(0, 0), (3, 0), (1, 2)]).round(0.2).extrude(0.1)
    """
    legal = "points, an array of shape (N, 2) or (N, 3)"
    if isinstance(points, Node) or (isinstance(points, list | tuple) and any(isinstance(p, Node) for p in points)):
        cure = f"{legal}: the corners of the solids. Of two balls: rm.capsule or rm.round_cone_between"
        raise SceneError(f"hull of {short(points)}", legal=cure)
    given = numbers("hull: points", points, legal)
    if given.ndim != 2 or given.shape[1] not in (2, 3) or not holdable(given):
        raise SceneError(f"hull: points = {short(points)}", legal=legal)
    distinct = np.unique(given + 0.0, axis=0)
    if given.shape[1] == 2:
        return polygon(_flat_corners(distinct))
    if not 4 <= len(distinct) <= MOST_POINTS:
        raise SceneError(f"hull of {len(distinct)} different points", legal=f"4 to {MOST_POINTS} points in space")
    low, high = distinct.min(axis=0), distinct.max(axis=0)
    normals = _face_normals(distinct)
    if len(normals) < 4:
        raise SceneError("hull: the points lie in one plane", legal="points that enclose a volume")
    sides = [plane(tuple(n), float(np.max(distinct @ n))) for n in normals if np.max(np.abs(n)) < 1.0]
    whole = box(tuple(high - low)).translate(tuple(0.5 * (low + high)))
    return intersection(whole, *sides) if sides else whole


def _flat_corners(points: Floats) -> Floats:
    """The corners of the hull of points in order of x, y, counter-clockwise (Andrew 1979)."""
    size = float(np.max(np.ptp(points, axis=0))) if len(points) else 0.0
    chains = []
    for ordered in (points, points[::-1]):
        chain: list[Floats] = []
        for p in ordered:
            while len(chain) > 1 and across(chain[-1] - chain[-2], p - chain[-2]) <= 1e-12 * size * size:
                chain.pop()
            chain.append(p)
        chains += chain[:-1]
    if len(chains) < 3:
        raise SceneError(f"hull: {len(points)} different points on one line", legal="points that enclose an area")
    return np.array(chains)


def _face_normals(points: Floats) -> Floats:
    """The outward unit normals of the faces, (m, 3): planes through three points that have no point outside.

    Of triples in one face the widest gives the normal.
    """
    size = float(np.max(np.ptp(points, axis=0)))
    rows = np.array(list(combinations(range(len(points)), 3)))
    a, b, c = (points[rows[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    width = np.linalg.norm(across, axis=1)
    wide = width > 1e-9 * size * size
    order = np.argsort(-width[wide])
    normals, a = (across[wide] / width[wide, None])[order], a[wide][order]
    over = normals @ points.T - np.sum(normals * a, axis=1)[:, None]
    near = 1e-9 * size
    outward = np.concatenate([normals[np.all(over <= near, axis=1)], -normals[np.all(over >= -near, axis=1)]])
    kept: list[Floats] = []
    for n in outward:
        if all(np.linalg.norm(n - other) > 1e-6 for other in kept):
            kept.append(n)
    return np.array(kept).reshape(-1, 3)
