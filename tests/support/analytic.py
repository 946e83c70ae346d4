"""What a picture must show, from school geometry: rays, spheres and planes, in float64, without this package."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

ULP = float(np.finfo(np.float32).eps)
EPSILON = 0.1
"""Pixel widths within which a ray is taken to have hit: the default of Quality."""


@dataclass(frozen=True)
class View:
    """A camera by its own definition: right-handed, y up, looking along -z of its frame, vertical field of view."""

    position: Any
    target: Any
    fov: float
    size: tuple[int, int]
    up: Any = (0.0, 1.0, 0.0)

    @property
    def origin(self) -> NDArray[Any]:
        return np.asarray(self.position, np.float64)

    @property
    def slope(self) -> float:
        return float(np.tan(np.radians(self.fov) / 2))

    @property
    def pixel(self) -> float:
        """Width of a pixel at distance 1 along the axis."""
        return 2 * self.slope / self.size[1]

    @property
    def directions(self) -> NDArray[Any]:
        """Unit vectors (H, W, 3) through the pixels' centres; row 0 is the top, column 0 the left."""
        width, height = self.size
        ahead = unit(np.asarray(self.target, np.float64) - self.origin)
        right = unit(np.cross(ahead, np.asarray(self.up, np.float64)))
        above = np.cross(right, ahead)
        x = (np.arange(width) + 0.5 - width / 2) * self.pixel
        y = (height / 2 - np.arange(height) - 0.5) * self.pixel
        return unit(ahead + x[None, :, None] * right + y[:, None, None] * above)


def unit(v: ArrayLike) -> NDArray[Any]:
    return np.asarray(v, np.float64) / np.linalg.norm(v, axis=-1, keepdims=True)


def hit_sphere(origin: Any, directions: NDArray[Any], centre: Any, radius: float) -> NDArray[Any]:
    """Distances to the near side, inf for a miss; from inside, to the far side. Origins may be one or many."""
    away = np.asarray(origin) - np.asarray(centre, np.float64)
    b = np.sum(directions * away, axis=-1)
    c = np.sum(away * away, axis=-1) - radius * radius
    square = b * b - c
    root = np.sqrt(np.maximum(square, 0))
    t = np.where(c > 0, -b - root, -b + root)
    return np.where((square >= 0) & (t >= 0), t, np.inf)


def hit_plane(origin: Any, directions: NDArray[Any], height: float) -> NDArray[Any]:
    """Distances to the plane y = height, from either side, inf for a miss."""
    with np.errstate(divide="ignore"):
        t = (height - np.asarray(origin)[..., 1]) / directions[..., 1]
    return np.where(t >= 0, t, np.inf)


def points(origin: NDArray[Any], directions: NDArray[Any], t: NDArray[Any]) -> NDArray[Any]:
    """Where the rays are at distance t; at the origin where t is infinite."""
    return np.asarray(origin + np.where(np.isfinite(t), t, 0.0)[..., None] * directions)


def angles(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Angles between vectors in radians, exact for small ones too."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))


def around(mask: NDArray[Any]) -> NDArray[Any]:
    """The mask and its eight neighbours."""
    padded = np.pad(mask, 1)
    rows, columns = mask.shape
    return np.asarray(np.any([padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)], axis=0))


def edges(labels: NDArray[Any]) -> NDArray[Any]:
    """Pixels on both sides of a change of label."""
    changed = np.zeros(labels.shape, bool)
    for axis in (0, 1):
        differs = np.diff(labels, axis=axis) != 0
        first = [slice(None)] * 2
        second = [slice(None)] * 2
        first[axis], second[axis] = slice(None, -1), slice(1, None)
        changed[tuple(first)] |= differs
        changed[tuple(second)] |= differs
    return around(changed)
