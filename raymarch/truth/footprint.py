"""What a pixel covers of a surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LOWEST = 1e-4
"""Cosine under which a surface is taken to be seen at most: at a horizon a pixel covers all that lies beyond."""


def footprint(normals: Array, directions: Array, width: Array) -> tuple[Array, Array]:
    """The axes of the ellipses that round pixels cut from planes, as long as the ellipses are, (N, 3) each.

    normals, directions : unit vectors, of the surface and of the ray, (N, 3). width : of the pixel there, (N,).
    The first lies across the ray and is as long as the pixel is wide, the second is that over the cosine.
    """
    across = np.cross(normals, -directions)
    size = np.linalg.norm(across, axis=1, keepdims=True)
    x, y, z = normals.T
    none = np.zeros_like(x)
    other = np.where(np.abs(normals[:, 1:2]) < 0.9, np.stack([z, none, -x], 1), np.stack([none, -z, y], 1))
    across = np.where(size < 1e-4, other, across)
    across = across * (width[:, None] / np.linalg.norm(across, axis=1, keepdims=True))
    cosine = np.abs(np.einsum("ij,ij->i", normals, directions))[:, None]
    return across, np.cross(normals, across) / np.maximum(cosine, LOWEST)
