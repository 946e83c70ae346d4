"""Signed distances of points from a closed triangle mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

FIRST, AT_MOST = 6, 512
"""Pieces of the surface that are tried for each point: at first, and in the end."""
NEAR = 2.0
"""Distance in cells below which the nearest triangle is proved to be the nearest. Farther away the result may exceed
the distance by the curvature of the surface over a cell, which no longer changes where it is 0."""
ON_EDGE = 1e-9
"""Barycentric coordinate below which a point lies on the edge of a triangle."""


class Surface:
    """A mesh that is closed and wound outwards.

    solid : of trimesh. cell : pieces of the surface are about as large.

    centres, areas : of the pieces, (N, 3) and (N,).
    """

    def __init__(self, solid: Any, cell: float) -> None:
        from scipy.spatial import cKDTree
        from trimesh.remesh import subdivide_to_size

        vertices, faces, owner = subdivide_to_size(
            solid.vertices, solid.faces, max_edge=2.0 * cell, max_iter=20, return_index=True
        )
        corners = vertices[faces]
        centres = corners.mean(axis=1)
        self._reach = float(np.linalg.norm(corners - centres[:, None], axis=-1).max())
        self._tree, self._owner, self._near = cKDTree(centres), np.asarray(owner), NEAR * cell
        self.centres = centres
        self.areas = 0.5 * np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        self._triangles = np.asarray(solid.triangles)
        self._normals = _pseudonormals(self._triangles, np.asarray(solid.faces))

    def distances(self, points: Points) -> Points:
        """Distances of N points, negative inside.

        The sign is that of the pseudonormal at the nearest point (Baerentzen and Aanaes 2005): the normal of a face,
        the sum of those of an edge, or the sum of those of a vertex by their angles.
        """
        from trimesh.triangles import closest_point, points_to_barycentric

        nearest, face = np.empty_like(points), np.empty(len(points), np.intp)
        rows, count, pieces = np.arange(len(points)), min(FIRST, len(self._owner)), len(self._owner)
        while rows.size:
            away, piece = self._tree.query(points[rows], count)
            away, tried = away.reshape(len(rows), count), self._owner[piece].reshape(len(rows), count)
            at = closest_point(self._triangles[tried.ravel()], np.repeat(points[rows], count, axis=0))
            off = np.linalg.norm(at.reshape(-1, count, 3) - points[rows, None], axis=-1)
            best = np.argmin(off, axis=1)
            each = np.arange(len(rows))
            nearest[rows], face[rows] = at.reshape(-1, count, 3)[each, best], tried[each, best]
            unproved = (off[each, best] > away[:, -1] - self._reach) & (off[each, best] < self._near)
            if count == min(AT_MOST, pieces):
                break
            rows, count = rows[unproved], min(4 * count, AT_MOST, pieces)
        inside = points_to_barycentric(self._triangles[face], nearest) > ON_EDGE
        normal = self._normals[face, inside @ (1, 2, 4)]
        off = points - nearest
        return np.asarray(np.linalg.norm(off, axis=1) * np.sign(np.einsum("ij,ij->i", off, normal)))


def _pseudonormals(corners: Points, faces: NDArray[Any]) -> Points:
    """Normals of each face for nearest points on its corners, edges and inside, (faces, 8, 3).

    The second index has bit k if the barycentric coordinate of corner k is above 0.
    """
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    found = np.repeat(normal[:, None], 8, axis=1)
    of_vertex = np.zeros((faces.max() + 1, 3))
    for k in range(3):
        a, b = (corners[:, (k + i) % 3] - corners[:, k] for i in (1, 2))
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
        np.add.at(of_vertex, faces[:, k], normal * angle[:, None])
    edges = np.sort(np.concatenate([faces[:, (0, 1)], faces[:, (1, 2)], faces[:, (2, 0)]]), axis=1)
    pair = np.lexsort(edges.T).reshape(-1, 2)  # each edge has two triangles
    other = np.empty(len(edges), np.intp)
    other[pair], owner = pair[:, ::-1], np.tile(np.arange(len(faces)), 3)
    for k in range(3):
        found[:, 1 << k] = of_vertex[faces[:, k]]
        found[:, (1 << k) | (1 << (k + 1) % 3)] = normal + normal[owner[other[k * len(faces) : (k + 1) * len(faces)]]]
    return found
