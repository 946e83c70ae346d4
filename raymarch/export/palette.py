"""The 256 colours of a film: found in one picture, and kept while they fit the later ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

SAMPLED = 31
"""One of so many pixels tells how well the colours fit a picture."""

WORSE, ALLOWED = 1.25, 0.25
"""Colours are kept while the root mean square of their error, in 8-bit codes, is at most so many times that in the
picture in which they were found, plus so much. Below half a code more, no eye tells."""

BLOCK = 4096
"""Colours whose nearest ones are found at once."""


def packed(picture: Image.Image) -> NDArray[np.uint32]:
    """The colours of the pixels, (H, W), as integers of 24 bits with red in the lowest."""
    pixels = np.frombuffer(picture.convert("RGB").tobytes("raw", "RGBX"), "<u4")
    return np.asarray(pixels.reshape(picture.size[::-1]) & 0xFFFFFF)


class Palette:
    """Up to 256 colours, by median cut of a picture. A pixel has the nearest one by the distance in sRGB.

    Pixels that do not change keep their index from picture to picture, so they neither flicker nor take bytes.
    """

    def __init__(self, picture: Image.Image) -> None:
        self._table: list[int] = picture.convert("RGB").quantize().getpalette() or []
        self._colors = np.array(self._table, np.float32).reshape(-1, 3)
        self._nearest = np.zeros(1 << 24, np.uint16)
        """The index of the nearest one for each colour that occurred, plus 1. Pages without one take no memory."""
        self._most = np.inf
        pixels = packed(picture)
        self._most = WORSE * self._error(pixels, self._indices(pixels)) + ALLOWED

    def indices(self, pixels: NDArray[np.uint32]) -> NDArray[np.uint8] | None:
        """The index of the colour of each pixel; None if the colours fit the picture too badly."""
        found = self._indices(pixels)
        return found if self._error(pixels, found) <= self._most else None

    def image(self, indices: NDArray[np.uint8]) -> Image.Image:
        """A picture of mode P."""
        made = Image.fromarray(indices)
        made.putpalette(self._table)
        return made

    def _indices(self, pixels: NDArray[np.uint32]) -> NDArray[np.uint8]:
        found = self._nearest.take(pixels)
        unknown = np.unique(pixels[found == 0])
        if len(unknown):
            for first in range(0, len(unknown), BLOCK):
                some = unknown[first : first + BLOCK]
                self._nearest[some] = 1 + self._closest(some)
            found = self._nearest.take(pixels)
        return (found - 1).astype(np.uint8)

    def _closest(self, colors: NDArray[np.uint32]) -> NDArray[np.intp]:
        """The index of the nearest one for each of some colours. All sums are integers that float32 holds."""
        ours = self._colors
        return np.argmin((ours * ours).sum(axis=1) - 2.0 * (_channels(colors) @ ours.T), axis=1)

    def _error(self, pixels: NDArray[np.uint32], indices: NDArray[np.uint8]) -> float:
        """The root mean square of the error of a channel."""
        some, shown = pixels.ravel()[::SAMPLED], indices.ravel()[::SAMPLED]
        return float(np.sqrt(np.mean((_channels(some) - self._colors[shown]) ** 2)))


def _channels(colors: NDArray[np.uint32]) -> NDArray[np.float32]:
    return (colors[:, None] >> np.array([0, 8, 16], np.uint32) & 255).astype(np.float32)
