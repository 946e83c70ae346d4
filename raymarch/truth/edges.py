"""Silhouettes of the reference: there the smallest offset of a ray decides which of two surfaces it hits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.truth.tracer import Truth

JUMP = 0.25
"""Tolerated distance from each other's tangent plane without curvature, in pixels at that depth."""
CREASE = 3.0
"""The normal turns at least this many times more across a crease than beside it."""
TURN = np.radians(1.0)
"""Smaller turns of the normal are never a crease: half a step of an 8-bit colour."""
CORNER = np.radians(30.0)
"""Larger turns from one pixel to the next are always a crease: a sphere with a radius of two pixels turns as much."""


def silhouettes(truth: Truth, width: int = 1) -> NDArray[np.bool_]:
    """Mask of the pixels within `width` pixels of an edge in the picture; bools of shape (H, W).

    An edge runs between two of eight neighbours where only one hits, the material changes, the normal has a crease,
    or the depth jumps. The depth jumps where neither point lies near the tangent plane of the other. `width` 1 gives
    the pixels on both sides of an edge. Each further unit adds a ring around them. 0 gives none.

    Raises ValueError for a negative width.
    """
    if width < 0:
        raise ValueError(f"silhouettes: width = {width} (an integer >= 0)")
    mask = np.zeros(truth.hit.shape, np.bool_)
    if width == 0:
        return mask
    for a, b, before, after in _neighbours(truth.hit.shape):
        border = truth.material[a] != truth.material[b]  # that of a miss is -1
        turn = _turn(truth, a, b)
        beside = np.maximum(_turn(truth, before, a), _turn(truth, b, after))
        crease = (turn > CORNER) | (turn > TURN + CREASE * beside)
        edge = border | crease | _jump(truth, a, b, turn)
        mask[a] |= edge
        mask[b] |= edge
    for _ in range(width - 1):
        grown = mask.copy()
        for a, b, _before, _after in _neighbours(mask.shape):
            grown[a] |= mask[b]
            grown[b] |= mask[a]
        mask = grown
    return mask


Window = tuple[NDArray[Any], NDArray[Any]]
STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))


def _neighbours(shape: tuple[int, ...]) -> Iterator[tuple[Window, Window, Window, Window]]:
    """Indices of all pairs of neighbours (a, b), and of the pixels before a and after b on the same line.

    Beyond the border of the picture, a and b themselves replace the pixels before and after.
    """
    rows, columns = np.indices(shape)
    for down, right in STEPS:
        fits = (rows + down < shape[0]) & (columns + right >= 0) & (columns + right < shape[1])
        i, j = rows[fits], columns[fits]

        def moved(k: int, i: Any = i, j: Any = j, down: int = down, right: int = right) -> Window:
            y, x = i + k * down, j + k * right
            there = (y >= 0) & (y < shape[0]) & (x >= 0) & (x < shape[1])
            home = max(0, min(k, 1))
            return np.where(there, y, i + home * down), np.where(there, x, j + home * right)

        yield moved(0), moved(1), moved(-1), moved(2)


def _jump(truth: Truth, a: Window, b: Window, turn: Any) -> NDArray[np.bool_]:
    """Whether both points are farther from each other's tangent plane than one smooth surface allows.

    If the normal turns by `turn` over a pixel of width w, viewed at an angle of cosine c, the surface departs from the
    tangent plane by turn w / (2 c^2) along the ray. Twice that is tolerated.
    """
    both = truth.hit[a] & truth.hit[b]
    depth_a, depth_b = np.where(both, truth.depth[a], 1.0), np.where(both, truth.depth[b], 1.0)
    along = [np.einsum("ij,ij->i", truth.direction[i], truth.normal[i]) for i in (a, b)]
    apart = np.minimum(_off_plane(truth, a, depth_a, b, depth_b), _off_plane(truth, b, depth_b, a, depth_a))
    near = np.minimum(depth_a, depth_b)[..., None]
    between = truth.origin[a] - truth.origin[b] + near * (truth.direction[a] - truth.direction[b])
    pixel = np.linalg.norm(between, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        bend = turn / np.minimum(*np.square(along))
    result: NDArray[np.bool_] = both & (apart > pixel * (JUMP + np.where(turn > 0.0, bend, 0.0)))
    return result


def _off_plane(truth: Truth, a: Window, depth_a: Any, b: Window, depth_b: Any) -> NDArray[np.float64]:
    """Distance of b from the tangent plane of a, measured along the ray of b."""
    normal = truth.normal[a]
    along_a = np.einsum("ij,ij->i", truth.direction[a], normal)
    along_b = np.einsum("ij,ij->i", truth.direction[b], normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = np.einsum("ij,ij->i", truth.origin[a] - truth.origin[b], normal)
        expected = (apart + depth_a * along_a) / along_b
    return np.where(along_a * along_b > 0.0, np.abs(depth_b - expected), np.inf)


def _turn(truth: Truth, a: Window, b: Window) -> NDArray[np.float64]:
    """Angle between the normals where both pixels hit, else 0."""
    return np.where(truth.hit[a] & truth.hit[b], angle(truth.normal[a], truth.normal[b]), 0.0)


def angle(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.float64]:
    """Angle between vectors of any length, in radians, accurate for small angles too."""
    result: NDArray[np.float64] = np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.einsum("ij,ij->i", a, b))
    return result


def shaped(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """An array as float64. ValueError if it has not the shape of the reference. name : in the message."""
    array = np.asarray(values, np.float64)
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}, the reference {shape}")
    return array
