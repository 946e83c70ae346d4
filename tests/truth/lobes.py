"""Directions that the shader samples, in float64, with their probability densities."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.hashing import pcg

Array = NDArray[np.float64]


def sample_cosine(u: Array) -> Array:
    """Sample directions about z from two numbers in [0, 1), (N, 2) -> (N, 3); with the density cosine / pi."""
    r, phi = np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1]
    return np.stack([r * np.cos(phi), r * np.sin(phi), np.sqrt(1.0 - u[:, 0])], axis=1)


def sample_visible_normal(view: Array, alpha: float, u: Array) -> Array:
    """Sample visible GGX microfacet normals for a view direction above z = 0, (3,) and (N, 2) -> (N, 3).

    Spherical caps (Dupuy and Benyoub 2023). The density is `pdf_visible_normal`.
    """
    stretched = np.array([alpha * view[0], alpha * view[1], view[2]])
    stretched /= np.linalg.norm(stretched)
    phi = 2 * np.pi * u[:, 0]
    z = (1.0 - u[:, 1]) * (1.0 + stretched[2]) - stretched[2]
    s = np.sqrt(np.clip(1.0 - z * z, 0.0, 1.0))
    h = np.stack([s * np.cos(phi), s * np.sin(phi), z], axis=1) + stretched
    h = np.stack([alpha * h[:, 0], alpha * h[:, 1], np.maximum(h[:, 2], 1e-7)], axis=1)
    result: Array = h / np.linalg.norm(h, axis=1, keepdims=True)
    return result


def pdf_visible_normal(view: Array, alpha: float, h: Array) -> Array:
    """Density of visible GGX normals: G1 max(v.h, 0) D / v.z; (N, 3) -> (N,)."""
    alpha2 = alpha * alpha
    g1 = 2.0 * view[2] / (view[2] + np.sqrt(alpha2 + (1.0 - alpha2) * view[2] ** 2))
    d_ggx = alpha2 / (np.pi * (h[:, 2] ** 2 * (alpha2 - 1.0) + 1.0) ** 2)
    result: Array = g1 * np.maximum(h @ view, 0.0) * d_ggx / view[2]
    return result


def random_of_pixel(x: Any, y: Any, sample: Any, dimension: Any) -> NDArray[np.float32]:
    """The shader's random numbers in [0, 1), bit for bit."""
    bits = pcg(_u32(x) + pcg(_u32(y) + pcg(_u32(sample) + pcg(_u32(dimension)))))
    return (bits >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24)


def _u32(value: Any) -> NDArray[np.uint32]:
    return np.atleast_1d(np.asarray(value)).astype(np.uint32)
