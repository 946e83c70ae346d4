"""The convex hull of equal balls, and what solids are hulls of equal balls: boxes are of balls of radius 0."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import SMALLEST, evaluator
from raymarch.expr.function import Vec3Expr, function, loop
from raymarch.expr.node import Expr, const, expr
from raymarch.expr.tables import Table, fetch
from raymarch.expr.vocabulary import clamp, cross, dot, max, min, normalize, sqrt, vec2, where
from raymarch.sdf.convex_points import corners_in_order, face_normals
from raymarch.sdf.definition import shape
from raymarch.sdf.domain import Points3, Positive
from raymarch.sdf.facts import FARTHEST
from raymarch.sdf.node import Node
from raymarch.sdf.polyhedra import SOLIDS

__all__ = ["rounded_hull"]

Floats = NDArray[np.float64]


@function()
def triangle(p: Vec3Expr, a: Vec3Expr, b: Vec3Expr, c: Vec3Expr) -> Expr:
    """Squared distance to a triangle whose area is not 0, and the height over its plane: a vec2."""
    normal = normalize(cross(b - a, c - a))
    above, edges = expr(True), []
    for start, end in ((a, b), (b, c), (c, a)):
        along, away = end - start, p - start
        above = above & (dot(cross(normal, along), away) >= 0.0)
        gap = away - along * clamp(dot(along, away) / max(dot(along, along), SMALLEST), 0.0, 1.0)
        edges.append(dot(gap, gap))
    height = dot(normal, p - a)
    return vec2(where(above, height * height, min(min(edges[0], edges[1]), edges[2])), height)


def triangles(points: Floats) -> Floats:
    """The faces of the hull of points, (m, 3, 3), each counter-clockwise from outside. A flat hull has two sides."""
    size = float(np.max(np.ptp(points, axis=0)))
    found = []
    for n in face_normals(points):
        heights = points @ n
        face = points[heights >= heights.max() - 1e-7 * size]
        u = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
        u /= np.linalg.norm(u)
        flat = corners_in_order(face @ np.stack([u, np.cross(n, u)], axis=1))
        ring = face[flat]
        found += [(ring[0], ring[i], ring[i + 1]) for i in range(1, len(ring) - 1)]
    return np.array(found).reshape(-1, 3, 3)


def _stored(points: tuple[tuple[float, ...], ...]) -> Floats:
    """The points as the table has them, in float32."""
    return np.array(points, np.float32).astype(np.float64)


def _check(points: tuple[tuple[float, ...], ...], radius: Any) -> None:
    """SceneError for points on one line."""
    given = np.array(points)
    if len(given) < 3 or np.linalg.matrix_rank(given - given[0], tol=1e-9 * max_extent(given)) < 2:
        raise SceneError("rounded_hull: points on one line", legal="three points or more; of two, rm.capsule")
    if len(given) > MOST_POINTS:
        raise SceneError(f"rounded_hull of {len(given)} points", legal=f"up to {MOST_POINTS}")


MOST_POINTS = 100


def max_extent(points: Floats) -> float:
    """The largest extent of points along an axis; above 0."""
    return float(np.max(np.ptp(points, axis=0), initial=1e-30))


@shape(
    exactness="exact",
    bounds=lambda points, radius: (
        const(_stored(points).min(axis=0)) - radius,
        const(_stored(points).max(axis=0)) + radius,
    ),
    convex=True,
    check=_check,
)
def rounded_hull(
    p: Expr,
    points: Points3 = ((-0.6, -0.4, -0.4), (0.7, -0.4, -0.5), (0.0, -0.4, 0.7), (0.1, 0.6, 0.0)),
    radius: Positive = 0.2,
) -> Expr:
    """The convex hull of equal balls: all points within a radius of the convex hull of points.

    points : 3 to 100 points, each three numbers, which do not lie on one line. They cannot be a `Param`.
    radius : of the balls, > 0.

    Exact. The faces of the hull of the points are a table, and each evaluation asks all of them.
    """
    faces = triangles(_stored(points))
    rows = np.concatenate([faces, np.zeros((*faces.shape[:2], 1))], axis=2)
    table = Table(rows.reshape(-1, 4), f"{len(faces)} triangles of a hull")

    def step(i: Expr, nearest: Expr, highest: Expr) -> tuple[Expr, Expr]:
        a, b, c = (fetch(table, 3.0 * i + float(k)).xyz for k in range(3))
        squared, height = triangle(p, a, b, c)
        return min(nearest, squared), max(highest, height)

    nearest, highest = loop(len(faces), [FARTHEST, -FARTHEST], step)
    return where(highest > 0.0, sqrt(nearest), highest) - radius


# Solids as hulls of equal balls


class Balls(NamedTuple):
    """Centres, (n, 3), and their radii, (n,)."""

    centres: Floats
    radii: Floats


_SIGNS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def balls_of(node: Node) -> Balls | None:
    """Balls with the convex hull of a solid; None for a solid that is no hull of finitely many, or is no constant."""
    if not all(isinstance(v, tuple) or getattr(v, "is_constant", False) for v in node.params.values()):
        return None
    if node.placed_as == "union":
        parts = [balls_of(child) for child in node.children]
        known = [part for part in parts if part is not None]
        return Balls(*map(np.concatenate, zip(*known, strict=True))) if len(known) == len(parts) else None
    if node.placed_as in ("rigid", "scale", "stretch"):
        return _placed(node)
    given = {n: v if isinstance(v, tuple) else np.asarray(v.data, np.float64) for n, v in node.params.items()}
    if node.definition.name == "round":
        inner = balls_of(node.children[0])
        return None if inner is None else Balls(inner.centres, inner.radii + given["radius"])
    centres, radius = _shape(node.definition.name, given)
    return None if centres is None else Balls(centres, np.broadcast_to(radius, len(centres)))


def _shape(name: str, given: dict[str, Any]) -> tuple[Floats | None, Any]:
    """Centres and radii of a shape."""
    if name in SOLIDS:
        return SOLIDS[name].vertices() * given["radius"], 0.0
    match name:
        case "sphere":
            return np.zeros((1, 3)), given["radius"]
        case "box":
            return _SIGNS * given["size"], 0.0
        case "rounded_box":
            return _SIGNS * (given["size"] - 2.0 * given["rounding"]), given["rounding"]
        case "capsule":
            return np.stack([given["a"], given["b"]]), given["radius"]
        case "round_cone":
            half = 0.5 * given["height"]
            return np.array([(0.0, -half, 0.0), (0.0, half, 0.0)]), np.array([given["radius"], given["top"]])
        case "rounded_hull":
            return np.array(given["points"]), given["radius"]
    return None, 0.0


def _moved(node: Node) -> tuple[Floats, Floats, float]:
    """The matrix and the offset by which a placed node moves its child's points, and the factor of its distances."""
    p, q, factor = node.definition.placement(node.params)
    origin, *ends = (evaluator([q], [p])(corner[None])[0][0] for corner in np.eye(4, 3, -1))
    back = np.linalg.inv(np.stack([end - origin for end in ends], axis=1))
    return back, -back @ origin, 1.0 if factor is None else float(factor.data)


def _placed(node: Node) -> Balls | None:
    """The balls of the child, moved. A stretched ball is none."""
    inner = balls_of(node.children[0])
    if inner is None or (node.placed_as == "stretch" and np.any(inner.radii > 0.0)):
        return None
    matrix, offset, factor = _moved(node)
    return Balls(inner.centres @ matrix.T + offset, inner.radii * (0.0 if node.placed_as == "stretch" else factor))


class Discs(NamedTuple):
    """Centres and unit axes, (n, 3) each, and radii, (n,)."""

    centres: Floats
    axes: Floats
    radii: Floats


def discs_of(node: Node) -> Discs | None:
    """Discs with the convex hull of a solid, the ends of cylinders and cones; None for others."""
    if not all(getattr(v, "is_constant", False) for v in node.params.values()):
        return None
    if node.placed_as == "union":
        known = [part for child in node.children if (part := discs_of(child)) is not None]
        return Discs(*map(np.concatenate, zip(*known, strict=True))) if len(known) == len(node.children) else None
    if node.placed_as in ("rigid", "scale"):
        inner = discs_of(node.children[0])
        if inner is None:
            return None
        matrix, offset, factor = _moved(node)
        return Discs(inner.centres @ matrix.T + offset, inner.axes @ matrix.T / factor, inner.radii * factor)
    if node.definition.name not in ("cylinder", "cone"):
        return None
    half, radius = 0.5 * float(node.params["height"].data), float(node.params["radius"].data)
    top = float(node.params["top"].data) if "top" in node.params else radius
    return Discs(np.array([(0, -half, 0), (0, half, 0)]), np.array([(0.0, 1, 0)] * 2), np.array([radius, top]))
