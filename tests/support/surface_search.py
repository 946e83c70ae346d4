"""Searches on a field: its slope by differences, its lowest value on a plane, the nearest point of its surface.

They know values and gradients alone, so that they can be held against what a node promises.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tests.support.node_samples import Field


def smooth_differences(
    field: Field, points: NDArray[np.float64], h: float, jump: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Central differences, and where they mean something: where the slope does not jump from one side to the other."""
    at = field.value(points)
    parts, smooth = [], np.ones(len(points), bool)
    for axis in np.eye(field.dimension):
        after, before = field.value(points + h * axis), field.value(points - h * axis)
        parts.append((after - before) / (2 * h))
        smooth &= np.abs(after - 2 * at + before) <= jump * h
    return np.stack(parts, axis=-1), smooth


def length(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lengths of the last axis; for axes of three in a fifth of the time of `np.linalg.norm`."""
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return vectors / np.maximum(length(vectors)[..., None], 1e-30)


def lowest_on_plane(field: Field, axis: int, at: float) -> float:
    """The smallest value on an axis-aligned plane, by a grid that closes in."""
    low, high = field.low.copy(), field.high.copy()
    best = np.inf
    for _ in range(5):
        sides = [np.array([at]) if k == axis else np.linspace(low[k], high[k], 33) for k in range(field.dimension)]
        grid = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, field.dimension)
        values = field.value(grid)
        middle = grid[np.argmin(values)]
        best = min(best, float(values.min()))
        half = 0.15 * (high - low)
        low, high = middle - half, middle + half
    return best


def nearest_distance(
    field: Field,
    random: np.random.Generator,
    cloud: NDArray[np.float64],
    queries: NDArray[np.float64],
    enough: NDArray[np.float64] | float = -np.inf,
) -> NDArray[np.float64]:
    """Distances to the surface: from the nearest known points of it, by trying others around them.

    A search ends once it has found a distance of at most `enough`.
    """
    found, index = cKDTree(cloud).query(queries)
    enough = np.broadcast_to(enough, found.shape)
    nearest = cloud[index]
    radius = 0.06 * field.size
    for _ in range(12):
        noise = random.normal(size=(6, *nearest.shape))  # for all, so that no search depends on when others end
        searched = found > enough
        if not np.any(searched):
            break
        at, best, asked = nearest[searched], found[searched], queries[searched]
        slope = field.gradient(at)
        normal = slope / np.maximum(length(slope), 1e-6)[:, None]
        away = asked - at
        along = away - (away * normal).sum(axis=1)[:, None] * normal  # what slides it nearer
        steps = [share * along for share in (1.0, 0.5, 0.2)]
        steps += [radius * part[searched] for part in noise]
        tried, distances = projected(field, at[:, None] + np.stack(steps, axis=1), asked[:, None])
        chosen = np.argmin(distances, axis=1)
        rows = np.arange(len(at))
        better = distances[rows, chosen] < best
        found[searched] = np.where(better, distances[rows, chosen], best)
        nearest[searched] = np.where(better[:, None], tried[rows, chosen], at)
        radius *= 0.6
    return found


def projected(
    field: Field, points: NDArray[np.float64], queries: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points moved onto the surface by Newton steps, and their distances from queries; infinite where that failed."""
    for _ in range(3):
        whole = field.whole(points)
        slope = whole[..., :-1]
        points = points - (whole[..., -1] / np.maximum((slope**2).sum(axis=-1), 1e-6))[..., None] * slope
    distances = length(points - queries)
    return points, np.where(np.abs(field.value(points)) < 1e-9 * field.size, distances, np.inf)


def thorough_distance(field: Field, random: np.random.Generator, query: NDArray[np.float64], reach: float) -> float:
    """The nearest of many points of the surface, tried all around a query."""
    around = random.normal(size=(4000, field.dimension))
    around *= (reach * random.uniform(0.5, 1.1, 4000) / np.linalg.norm(around, axis=1))[:, None]
    points, distances = projected(field, query + around, query)
    start = points[np.argsort(distances)[:20]]
    return float(nearest_distance(field, random, start, np.broadcast_to(query, start.shape)).min())
