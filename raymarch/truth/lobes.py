"""The shader's random directions in float64, each beside the density that it is drawn with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sample_cosine(u: Array) -> Array:
    """Directions about z from two numbers in [0, 1), (N, 2) -> (N, 3); their density is cosine / pi."""
    r, turn = np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1]
    return np.stack([r * np.cos(turn), r * np.sin(turn), np.sqrt(1.0 - u[:, 0])], axis=1)


def sample_visible_normal(view: Array, alpha: float, u: Array) -> Array:
    """Normals of microfacets seen from a direction above z = 0, (3,) and (N, 2) -> (N, 3).

    GGX by spherical caps (Dupuy and Benyoub 2023); their density is that of `visible_facets`.
    """
    stretched = np.array([alpha * view[0], alpha * view[1], view[2]])
    stretched /= np.linalg.norm(stretched)
    turn = 2 * np.pi * u[:, 0]
    z = (1.0 - u[:, 1]) * (1.0 + stretched[2]) - stretched[2]
    s = np.sqrt(np.clip(1.0 - z * z, 0.0, 1.0))
    h = np.stack([s * np.cos(turn), s * np.sin(turn), z], axis=1) + stretched
    h = np.stack([alpha * h[:, 0], alpha * h[:, 1], np.maximum(h[:, 2], 1e-7)], axis=1)
    result: Array = h / np.linalg.norm(h, axis=1, keepdims=True)
    return result


def visible_facets(view: Array, alpha: float, h: Array) -> Array:
    """Density of the normals of facets seen from `view`: G1 max(v.h, 0) D / v.z; (N, 3) -> (N,)."""
    square = alpha * alpha
    masked = 2.0 * view[2] / (view[2] + np.sqrt(square + (1.0 - square) * view[2] ** 2))
    density = square / (np.pi * (h[:, 2] ** 2 * (square - 1.0) + 1.0) ** 2)
    result: Array = masked * np.maximum(h @ view, 0.0) * density / view[2]
    return result


def random_of_pixel(x: Any, y: Any, sample: Any, dimension: Any) -> NDArray[np.float32]:
    """The shader's numbers in [0, 1), bit for bit."""
    bits = _pcg(_u32(x) + _pcg(_u32(y) + _pcg(_u32(sample) + _pcg(_u32(dimension)))))
    return (bits >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24)


def _u32(value: Any) -> NDArray[np.uint32]:
    return np.atleast_1d(np.asarray(value)).astype(np.uint32)


def _pcg(v: NDArray[np.uint32]) -> NDArray[np.uint32]:
    v = v * np.uint32(747796405) + np.uint32(2891336453)
    v = ((v >> ((v >> np.uint32(28)) + np.uint32(4))) ^ v) * np.uint32(277803737)
    return (v >> np.uint32(22)) ^ v
