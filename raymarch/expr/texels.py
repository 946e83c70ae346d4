"""Texture data with mipmaps.

Texels are half floats, so that the reference and the GPU read the same numbers. Each mip level is the mean of the level
below in linear values, so all levels have the same mean.
"""

from __future__ import annotations

from typing import Any, Final, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import SceneError
from raymarch.expr.data import Data, digest

Array = NDArray[Any]
Wrap: TypeAlias = Literal["repeat", "mirror", "clamp"]

WRAPS: Final = ("repeat", "mirror", "clamp")
LARGEST = 4096
"""Maximum number of texels along an edge."""


class Texels(Data):
    """A texture of 1 to 3 channels with its mipmaps.

    levels : float16 (h, w, channels) each, level 0 first; row 0 is the bottom, v points upwards. Each level has half
        the texels of the previous one along each axis, rounded down; the last has one.
    wrap : values outside: "repeat", "mirror", or "clamp" to the edge.
    """

    __slots__ = ("levels", "wrap")

    kind = "texels"

    def __init__(self, values: ArrayLike, wrap: Wrap = "repeat", label: str = "") -> None:
        """values : (h, w) or (h, w, channels), linear, row 0 at the bottom; each side 1 to 4096, |value| <= 65504."""
        array = np.asarray(values, np.float32)
        array = array[..., None] if array.ndim == 2 else array
        if array.ndim != 3 or not 1 <= array.shape[2] <= 3 or not 1 <= min(array.shape) <= max(array.shape) <= LARGEST:
            raise SceneError(f"texels of shape {array.shape}", legal=f"(h, w, 1 to 3), sides from 1 to {LARGEST}")
        if not np.all(np.abs(array) <= np.finfo(np.float16).max):
            raise SceneError("texels hold values that half floats cannot", legal="numbers up to 65504 in size")
        self.levels = pyramid(array)
        self.wrap: Wrap = wrap
        self.label = label or f"an array of {array.shape[1]} x {array.shape[0]}"
        self.key = digest(f"{wrap} {array.shape}".encode(), self.levels[0].tobytes())

    @property
    def size(self) -> tuple[int, int]:
        """Texels along u and v."""
        height, width, _ = self.levels[0].shape
        return width, height

    @property
    def channels(self) -> int:  # type: ignore[override]
        """1 to 3."""
        return int(self.levels[0].shape[2])

    @property
    def nbytes(self) -> int:
        """Size of all levels in bytes."""
        return sum(level.nbytes for level in self.levels)


def pyramid(values: Array) -> tuple[Array, ...]:
    """All mip levels of some values, float16; (h, w, channels) each."""
    levels = [values]
    while max(levels[-1].shape[:2]) > 1:
        levels.append(_halved(_halved(levels[-1], 0), 1))
    rounded = tuple(np.ascontiguousarray(level, np.float16) for level in levels)
    for level in rounded:
        level.setflags(write=False)
    return rounded


def _halved(values: Array, axis: int) -> Array:
    """Reduce an axis to half its length, rounded down, by means over the covered intervals."""
    n = values.shape[axis]
    m = max(n // 2, 1)
    if n == m:
        return values
    first = np.moveaxis(values, axis, 0)
    if n == 2 * m:
        return np.moveaxis(0.5 * (first[0::2] + first[1::2]), 0, axis)
    total = np.concatenate([np.zeros_like(first[:1]), np.cumsum(first, axis=0, dtype=np.float64)])
    ends = np.arange(m + 1) * (n / m)
    base = np.minimum(ends.astype(int), n - 1)
    weight = (ends - base).reshape(-1, *(1,) * (first.ndim - 1))
    means = np.diff(total[base] + weight * first[base], axis=0) * (m / n)
    return np.moveaxis(means.astype(values.dtype), 0, axis)
