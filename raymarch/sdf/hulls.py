"""Convex hulls of points, in the plane and in space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import holdable, numbers, short
from raymarch.sdf.affine import transform
from raymarch.sdf.booleans import intersection
from raymarch.sdf.convex_points import corners_in_order, face_normals
from raymarch.sdf.curves import round_cone_between
from raymarch.sdf.flat import polygon, rounded_rectangle
from raymarch.sdf.node import Node, solid
from raymarch.sdf.placing import orient, rotate, translate
from raymarch.sdf.profiles import extrude, revolve
from raymarch.sdf.rounded_hulls import Balls, Discs, balls_of, discs_of, rounded_hull
from raymarch.sdf.solids import box, capsule, plane, sphere

__all__ = ["hull"]

Floats = NDArray[np.float64]

KNOWN = (
    "spheres, boxes, capsules, polyhedra and the like, with one radius of their edges; two balls; cylinders and cones "
    "about one axis, or equal cylinders side by side; all of numbers, placed, and in unions. Else the corners: "
    "rm.hull(points)"
)

MOST_POINTS = 100
"""Of a hull in space: the planes through all triples of points are tried."""


@checked
def hull(points: Any, *others: Node) -> Node:
    """The convex hull of points, or of solids: the smallest convex shape that holds them.

    Parameters
    ----------
    points : (N, 2) for a flat shape, N >= 3, or (N, 3) for a solid, 4 <= N <= 100, in scene units. Points inside of the
        hull have no effect. They are numbers and cannot be a `Param`. Or a solid, or a list of solids.
    others : further solids.

    Returns
    -------
    Node
        A `polygon`, which is exact; or the intersection of a half-space for each face: exact inside, a bound outside.

    Raises
    ------
    SceneError : another shape, points that lie on one line or in one plane, or solids of other kinds.

    Notes
    -----
    Solids may be placed and stand in unions; of them the hull is known of:

    - spheres, boxes, rounded boxes, capsules, cones between balls, regular polyhedra and `rounded_hull`, all with one
      radius of their edges: `rounded_hull`, which is exact, or without a radius the hull of the corners.
    - two balls of any radii: `round_cone_between`, which is exact.
    - cylinders and capped cones about one axis, or cylinders of one size side by side. Exact.

    Materials of the solids are not kept. For equal discs at points it is `hull(points).round(radius)`. In space,
    `round` of a hull of points moves its faces and keeps its edges sharp: `rounded_hull(points, radius)` is exact.

    Examples
    --------
    >>> wedge = rm.hull([(0, 0, 0), (2, 0, 0), (0, 0, 1), (2, 0, 1), (0, 1, 0), (0, 1, 1)])
    >>> pill = rm.hull(rm.sphere(1), rm.sphere(1).translate((2, 0, 0)), rm.sphere(1).translate((0, 2, 0)))
    >>> plate = rm.hull([(0, 0), (3, 0), (1, 2)]).round(0.2).extrude(0.1)
    """
    legal = "points, an array of shape (N, 2) or (N, 3)"
    listed = list(points) if isinstance(points, list | tuple) else [points]
    if others or isinstance(points, Node) or any(isinstance(p, Node) for p in listed):
        return _of_solids([*listed, *others])
    given = numbers("hull: points", points, legal)
    if given.ndim != 2 or given.shape[1] not in (2, 3) or not holdable(given):
        raise SceneError(f"hull: points = {short(points)}", legal=legal)
    distinct = np.unique(given + 0.0, axis=0)
    if given.shape[1] == 2:
        corners = corners_in_order(distinct)
        if len(corners) < 3:
            raise SceneError(f"hull: {len(distinct)} different points on one line", legal="points that enclose an area")
        return polygon(distinct[corners])
    if not 4 <= len(distinct) <= MOST_POINTS:
        raise SceneError(f"hull of {len(distinct)} different points", legal=f"4 to {MOST_POINTS} points in space")
    low, high = distinct.min(axis=0), distinct.max(axis=0)
    normals = face_normals(distinct)
    if len(normals) < 4:
        raise SceneError("hull: the points lie in one plane", legal="points that enclose a volume")
    sides = [plane(tuple(n), float(np.max(distinct @ n))) for n in normals if np.max(np.abs(n)) < 1.0]
    whole = box(tuple(high - low)).translate(tuple(0.5 * (low + high)))
    return intersection(whole, *sides) if sides else whole


def _of_solids(parts: Sequence[Any]) -> Node:
    """The hull of solids of known kinds."""
    solids = [solid("hull", part) for part in parts]
    found = [balls_of(part) for part in solids]
    balls = [each for each in found if each is not None]
    made = None
    if len(balls) == len(solids):
        made = _of_balls(Balls(*map(np.concatenate, zip(*balls, strict=True))))
    else:
        discs = [each for part in solids if (each := discs_of(part)) is not None]
        if len(discs) == len(solids):
            made = _of_discs(Discs(*map(np.concatenate, zip(*discs, strict=True))))
    if made is None:
        raise SceneError(f"hull of {', '.join(part.name for part in solids)}", legal=KNOWN)
    return made


def _of_balls(given: Balls) -> Node | None:
    """The hull of balls of one radius, or of two balls; balls in others are left out."""
    centres, radii = given
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    holds = apart + radii[:, None] <= radii[None] * (1 + 1e-12)  # i lies in j
    holds &= ~(holds.T & (np.arange(len(radii))[:, None] <= np.arange(len(radii))))  # of equal balls the first stays
    kept = ~holds.any(axis=1)
    centres, radii = centres[kept], radii[kept]
    radius, size = float(radii[0]), float(np.max(np.ptp(centres, axis=0)))
    if len(radii) == 1:
        return None if radius == 0.0 else translate(sphere(radius), centres[0])
    if len(radii) == 2 and np.all(radii > 0.0) and radii[0] != radii[1]:
        return round_cone_between(tuple(centres[0]), tuple(centres[1]), float(radii[0]), float(radii[1]))
    if np.any(np.abs(radii - radius) > 1e-12 * max(radius, size)):
        return None
    if radius == 0.0:
        return hull(centres)
    along = np.linalg.svd(centres - centres.mean(axis=0))[2][0]
    ends = centres[[np.argmin(centres @ along), np.argmax(centres @ along)]]
    if np.linalg.matrix_rank(centres - centres[0], tol=1e-9 * size) == 1:
        return capsule(tuple(ends[0]), tuple(ends[1]), radius)
    return rounded_hull(tuple(map(tuple, centres.tolist())), radius) if len(centres) <= MOST_POINTS else None


def _of_discs(given: Discs) -> Node | None:
    """The hull of discs about one axis, or of those of equal cylinders side by side."""
    centres, axes, radii = given
    axis = axes[0]
    if np.any(np.abs(axes @ axis) < 1 - 1e-12):
        return None
    size = float(np.max(np.ptp(centres, axis=0)) + radii.max())
    levels = centres @ axis
    beside = centres - levels[:, None] * axis
    if np.all(np.linalg.norm(beside - beside[0], axis=1) <= 1e-9 * size):
        rims = np.concatenate([np.stack([side * radii, levels], axis=1) for side in (1.0, -1.0)])
        return translate(orient(revolve(hull(rims)), tuple(axis)), tuple(beside[0]))
    low, high = float(levels.min()), float(levels.max())
    bottom, top = (beside[np.abs(levels - end) <= 1e-9 * size] for end in (low, high))
    same = len(bottom) == len(top) and len(bottom) + len(top) == len(centres) and np.ptp(radii) <= 1e-12 * size
    if not same or np.any(np.linalg.norm(bottom[:, None] - top[None], axis=2).min(axis=1) > 1e-9 * size):
        return None
    u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    u /= np.linalg.norm(u)
    frame = np.stack([u, np.cross(axis, u), axis], axis=1)
    flat = bottom @ frame[:, :2]
    corners = flat[corners_in_order(flat)]
    radius = float(radii[0])
    if len(corners) == 2:
        middle, (x, y) = corners.mean(axis=0), corners[1] - corners[0]
        long = rounded_rectangle((float(np.hypot(x, y)) + 2 * radius, 2 * radius), radius)
        outline = translate(rotate(long, float(np.arctan2(y, x))), tuple(middle))
    else:
        outline = hull(corners).round(radius)
    placed = np.eye(4)
    placed[:3, :3], placed[3, :3] = frame.T, 0.5 * (low + high) * axis
    return transform(extrude(outline, high - low), placed)
