"""The footprint of a pixel on a surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIN_COSINE = 1e-4
"""Lower bound of the cosine of incidence: at a horizon the footprint would be unbounded."""


def footprint(normals: Array, directions: Array, width: Array) -> tuple[Array, Array]:
    """Full axes of the ellipses in which cones of round pixels meet the tangent planes, (N, 3) each.

    normals, directions : unit surface normals and ray directions, (N, 3). width : of the pixel at that depth, (N,).
    The first axis is perpendicular to the ray and as long as the pixel is wide. The second is longer by 1 / cosine.
    """
    minor = np.cross(normals, -directions)
    size = np.linalg.norm(minor, axis=1, keepdims=True)
    x, y, z = normals.T
    none = np.zeros_like(x)
    other = np.where(np.abs(normals[:, 1:2]) < 0.9, np.stack([z, none, -x], 1), np.stack([none, -z, y], 1))
    minor = np.where(size < 1e-4, other, minor)
    minor = minor * (width[:, None] / np.linalg.norm(minor, axis=1, keepdims=True))
    cosine = np.abs(np.einsum("ij,ij->i", normals, directions))[:, None]
    return minor, np.cross(normals, minor) / np.maximum(cosine, MIN_COSINE)
