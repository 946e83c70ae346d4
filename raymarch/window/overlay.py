"""Text over the picture: errors, notices, help. Drawn by Pillow, which rendering requires anyway."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from raymarch.gpu.scale import Scale, with_bar
from raymarch.gpu.screen import Screen
from raymarch.window.lettering import POINTS, lettered
from raymarch.window.messages import Message

SMALLEST = 8
"""Minimum height of text, in pixels."""

RING = 6
"""Radius of the ring around a picked point at display scale 1, in pixels."""

BAR = 240
"""Width of a colour bar at display scale 1, in pixels."""


@dataclass(frozen=True, slots=True)
class Bar:
    """The colour bar of a scale, with its quantity and unit."""

    scale: Scale
    corner: str = "bottom right"


@dataclass(frozen=True, slots=True)
class Mark:
    """A ring around a point: column and row in the picture."""

    column: int
    row: int
    corner: str = "point"


@dataclass(frozen=True, slots=True)
class Line:
    """The divider of a split picture."""

    corner: str = "divider"


Item: TypeAlias = Message | Bar | Mark | Line
"""What is drawn over the picture."""


class Overlay:
    """Caches the images of visible messages, and draws them over a screen."""

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        self._made: dict[tuple[Item, tuple[int, int], float], Any] = {}

    def draw(self, messages: Sequence[Item], density: float, left: int = 0, divider: int | None = None) -> None:
        """Draw messages over the picture, which begins at column `left`; messages of one corner are stacked.

        Frees the images of other messages. divider : column of the divider of a split picture, which is drawn.
        """
        width, height = self._screen.size
        split = [] if divider is None else [Line()]
        ends = {"left": (left, divider or width), "right": (divider or 0, width)}
        free = {m: ends.get(m.corner, (left, width)) for m in [*split, *messages]}
        wanted = {(m, (max(1, end - start), height), density): None for m, (start, end) in free.items()}
        for key in [key for key in self._made if key not in wanted]:
            self._screen.free(self._made.pop(key))
        margin = round(8 * density)
        used: dict[str, int] = {}
        for key in wanted:
            if key not in self._made:
                self._made[key] = self._screen.image(picture_of(*key))
            texture = self._made[key]
            (wide, high), corner = texture.size, key[0].corner
            if isinstance(key[0], Line):
                self._screen.lay(texture, (divider or 0) - wide // 2, 0)
                continue
            if isinstance(key[0], Mark):
                self._screen.lay(texture, left + key[0].column - wide // 2, key[0].row - high // 2)
                continue
            before = used.get(corner, margin)
            columns = {"right": (divider or 0) + margin, "left": (divider or 0) - wide - margin}
            x = columns.get(corner, left + margin if corner.endswith("left") else width - wide - margin)
            y = height - before - high if corner.startswith("bottom") else before
            if corner == "middle":
                x, y = left + (width - left - wide) // 2, (height - high) // 2
            self._screen.lay(texture, x, y)
            used["top " + corner if corner in columns else corner] = before + high + margin

    def release(self) -> None:
        for texture in self._made.values():
            self._screen.free(texture)
        self._made.clear()


def picture_of(message: Item, size: tuple[int, int], density: float) -> NDArray[np.uint8]:
    """A message as RGBA pixels, (H, W, 4), wrapped, and scaled down if necessary, to fit a window of `size`."""
    if isinstance(message, Line):
        line = np.full((size[1], 3 * max(1, round(density)), 4), 255, np.uint8)
        line[:, [0, -1], :3] = 40
        return line
    if isinstance(message, Mark):
        return _ring(density)
    if isinstance(message, Bar):
        width = min(BAR, max(80, size[0] - 16))
        bar = with_bar(Image.new("RGB", (width, 1)), message.scale)
        bar = bar.crop((0, 1, *bar.size)).resize((round(width * density), round((bar.height - 1) * density)))
        return np.asarray(bar.convert("RGBA"), np.uint8)
    while True:
        made = lettered(message, size, density)
        if made.shape[0] <= size[1] or density * POINTS <= SMALLEST:
            return made
        density *= 0.9


def _ring(density: float) -> NDArray[np.uint8]:
    """A white ring with dark edges, drawn at four times its size."""
    radius, factor = RING * density, 4
    edge = 2 * round(radius + 3 * density) + 1
    image = Image.new("RGBA", (factor * edge, factor * edge), (0, 0, 0, 0))
    draw, middle = ImageDraw.Draw(image), factor * edge / 2
    for color, wide in (((0, 0, 0, 200), 3.5), ((255, 255, 255, 255), 1.6)):
        outer = factor * (radius + wide * density / 2)
        ends = [middle - outer, middle - outer, middle + outer, middle + outer]
        draw.ellipse(ends, outline=color, width=max(1, round(factor * wide * density)))
    return np.asarray(image.resize((edge, edge), Image.Resampling.LANCZOS), np.uint8)
