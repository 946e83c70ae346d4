"""Corners and faces of the convex hulls of points."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from raymarch.sdf.flat import across

Floats = NDArray[np.float64]


def corners_in_order(points: Floats) -> list[int]:
    """The corners of the hull of points (n, 2) as indices, counter-clockwise (Andrew 1979); 2 for points on a line."""
    size = float(np.max(np.ptp(points, axis=0))) if len(points) else 0.0
    order = np.lexsort((points[:, 1], points[:, 0])).tolist()
    chains: list[int] = []
    for ordered in (order, order[::-1]):
        chain: list[int] = []
        for i in ordered:
            p = points[i]
            while len(chain) > 1:
                before, last = points[chain[-2]], points[chain[-1]]
                if across(last - before, p - before) > 1e-12 * size * size:
                    break
                chain.pop()
            chain.append(i)
        chains += chain[:-1]
    return chains


def face_normals(points: Floats) -> Floats:
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
