"""Pictures and error maps of a page, as data URIs of lossless WebP."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.cost.maps import WRONG

Pixels = NDArray[np.uint8]

MOST = 2_000_000
"""Bytes of all pictures of a page; WebP as text is a third longer."""
SMALLEST = 0.125
"""Least size of a picture that had to be reduced, as a fraction of its width."""


@dataclass(slots=True)
class _Picture:
    pixels: Pixels
    important: bool
    reduce: Callable[[Pixels, float], Pixels]
    size: float = 1.0
    data: bytes = b""


class Pictures:
    """The pictures of a page, each kept once; less important ones are reduced until all fit into `most` bytes."""

    def __init__(self, most: int = MOST) -> None:
        self._most = most
        self._found: dict[bytes, int] = {}
        self._kept: list[_Picture] = []

    def add(self, pixels: Pixels, important: bool = True, peaks: bool = False) -> int:
        """The number of a picture (H, W, 3). peaks : a reduced picture shows the brightest of its pixels, so that no
        error disappears; otherwise their mean."""
        key = pixels.tobytes()
        if key not in self._found:
            self._found[key] = len(self._kept)
            self._kept.append(_Picture(pixels, important, _peaks if peaks else _mean, data=_webp(pixels)))
        number = self._found[key]
        self._kept[number].important |= important
        return number

    def uris(self) -> list[str]:
        """The data URI of each picture, by its number."""
        for only_others in (True, False):
            size = 0.5
            while sum(len(p.data) for p in self._kept) > self._most and size >= SMALLEST:
                for picture in self._kept:
                    if not (only_others and picture.important):
                        picture.data = _webp(picture.reduce(picture.pixels, size))
                size /= 2
        return [f"data:image/webp;base64,{base64.b64encode(p.data).decode()}" for p in self._kept]


def _webp(pixels: Pixels) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "WEBP", lossless=True, quality=30, method=2)  # 4 takes twice as long, for 3 %
    return stream.getvalue()


def _mean(pixels: Pixels, size: float) -> Pixels:
    width, height = (max(1, round(n * size)) for n in (pixels.shape[1], pixels.shape[0]))
    return np.asarray(Image.fromarray(pixels).resize((width, height), Image.Resampling.BOX))


def _peaks(pixels: Pixels, size: float) -> Pixels:
    """The pixel with the largest error of each block: a missed hit, else the brightest colour of the scale."""
    block = round(1 / size)
    height, width = (max(n // block, 1) for n in pixels.shape[:2])
    cut = pixels[: height * block, : width * block].reshape(height, -1, width, min(block, pixels.shape[1]), 3)
    cells = cut.swapaxes(1, 2).reshape(height, width, -1, 3)
    wrong = np.all(cells == WRONG, axis=-1)
    best = (cells.sum(axis=-1, dtype=np.int64) + 1000 * wrong).argmax(axis=-1)
    found: Any = np.take_along_axis(cells, best[..., None, None], axis=2)[:, :, 0]
    return np.asarray(found, np.uint8)
