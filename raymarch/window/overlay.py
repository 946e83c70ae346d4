"""Text over the picture: errors, notices, help. Drawn by Pillow, which rendering requires anyway."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from raymarch.gpu.scale import Scale, with_bar
from raymarch.gpu.screen import Screen
from raymarch.window.messages import Message

POINTS = 14
"""Height of the text at display scale 1, in pixels."""

SMALLEST = 8
"""Minimum height of text, in pixels."""

BACKGROUNDS = {"error": (92, 14, 14, 255), "note": (18, 20, 24, 215), "busy": (64, 50, 8, 225)}
"""Background colours by kind of message, RGBA."""

WHITE, FAINT = (255, 255, 255, 255), (176, 184, 194, 255)


BAR = 240
"""Width of a colour bar at display scale 1, in pixels."""


@dataclass(frozen=True, slots=True)
class Bar:
    """The colour bar of a scale, with its quantity and unit."""

    scale: Scale
    corner: str = "bottom right"


@dataclass(frozen=True, slots=True)
class Line:
    """The divider of a split picture."""

    corner: str = "divider"


class Overlay:
    """Caches the images of visible messages, and draws them over a screen."""

    def __init__(self, screen: Screen) -> None:
        self._screen = screen
        self._made: dict[tuple[Message | Bar | Line, tuple[int, int], float], Any] = {}

    def draw(self, messages: list[Message | Bar], density: float, left: int = 0, divider: int | None = None) -> None:
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


def picture_of(message: Message | Bar | Line, size: tuple[int, int], density: float) -> NDArray[np.uint8]:
    """A message as RGBA pixels, (H, W, 4), wrapped, and scaled down if necessary, to fit a window of `size`."""
    if isinstance(message, Line):
        line = np.full((size[1], 3 * max(1, round(density)), 4), 255, np.uint8)
        line[:, [0, -1], :3] = 40
        return line
    if isinstance(message, Bar):
        width = min(BAR, max(80, size[0] - 16))
        bar = with_bar(Image.new("RGB", (width, 1)), message.scale)
        bar = bar.crop((0, 1, *bar.size)).resize((round(width * density), round((bar.height - 1) * density)))
        return np.asarray(bar.convert("RGBA"), np.uint8)
    while True:
        made = _drawn(message, size[0], density)
        if made.shape[0] <= size[1] or density * POINTS <= SMALLEST:
            return made
        density *= 0.9


def _drawn(message: Message, width: int, density: float) -> NDArray[np.uint8]:
    font = _font(round(POINTS * density))
    pad, spacing = round(7 * density), round(4 * density)
    letter = max(1.0, float(font.getlength("n")))
    rows = [line.partition("\t")[::2] for line in message.text.splitlines()]
    column = max((font.getlength(left) for left, right in rows if right), default=0.0)
    column = round(column + 2 * pad) if column else 0
    most = max(12, int((width - 4 * pad) / letter))
    narrow = max(12, int((width - 4 * pad - column) / letter))
    lefts, rights = [], []
    for left, right in rows:
        parts = _wrapped(right, narrow) if right else _wrapped(left, most)
        lefts += [left, *[""] * (len(parts) - 1)] if right else parts
        rights += parts if right else [""] * len(parts)
    heads = [left if column and not right else "" for left, right in zip(lefts, rights, strict=True)]
    keys = [left if right or not column else "" for left, right in zip(lefts, rights, strict=True)]
    blocks = [(0, "\n".join(keys), FAINT if column else WHITE)]
    blocks += [(0, "\n".join(heads), WHITE)] if column else []
    blocks += [(column, "\n".join(rights), WHITE)] if column else []
    probe = ImageDraw.Draw(Image.new("L", (1, 1)))
    boxes = [probe.multiline_textbbox((at, 0), text, font=font, spacing=spacing) for at, text, _ in blocks]
    top, bottom = min(box[1] for box in boxes), max(box[3] for box in boxes)
    size = (max(1, int(max(box[2] for box in boxes))) + 2 * pad, max(1, int(bottom - top)) + 2 * pad)
    image = Image.new("RGBA", size, BACKGROUNDS[message.kind])
    draw = ImageDraw.Draw(image)
    for at, text, color in blocks:
        draw.multiline_text((pad + at, pad - top), text, color, font=font, spacing=spacing)
    return np.asarray(image, np.uint8)


def _wrapped(line: str, most: int) -> list[str]:
    indent = line[: len(line) - len(line.lstrip())]
    return textwrap.wrap(line, most, subsequent_indent=indent, break_long_words=True, replace_whitespace=False) or [""]


@lru_cache(8)
def _font(points: int) -> Any:
    """Pillow's own font. Without FreeType it is a bitmap of one size."""
    return ImageFont.load_default(points)
