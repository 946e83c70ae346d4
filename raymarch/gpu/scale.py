"""Scales of heat maps, and the bars and legends that show them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.expr.arrays import evaluator, row_blocks
from raymarch.expr.color_maps import SHARE, color_map


def colored(share: NDArray[Any], name: str = "inferno") -> NDArray[np.float64]:
    """Map values in [0, 1], of any shape (...), to sRGB in [0, 1] of shape (..., 3), by `color_map`."""
    given = np.asarray(share, np.float64)
    found = _evaluator(name)(given.reshape(-1))[0]
    return np.asarray(np.broadcast_to(found, (given.size, 3)).reshape((*given.shape, 3)))


@cache
def _evaluator(name: str) -> Callable[..., tuple[Any, ...]]:
    return evaluator([color_map(name).body], [SHARE])


POINTS, MARGIN, THICKNESS = 11, 6, 10
"""Sizes in pixels: text, margin and thickness of the bar."""

INK, PAPER = (225, 225, 225), (24, 24, 26)


@dataclass(frozen=True, slots=True)
class Scale:
    """A mapping from values to colours.

    quantity : the name of the quantity, with its unit.
    low, high : the values at the two ends, low < high.
    kind : "linear"; "log", linear in the logarithm (low > 0); or "reciprocal", linear in the reciprocal (low > 0, high
        may be infinite), where `low` has the colour of the largest value.
    colors : a key of `color_maps.MAPS`.
    whole : whether the values are counts, so that ticks are whole numbers.
    """

    quantity: str
    low: float
    high: float
    kind: Literal["linear", "log", "reciprocal"] = "linear"
    colors: str = "inferno"
    whole: bool = False

    def normalized(self, values: Any) -> NDArray[np.float64]:
        """Normalized position of values in the range, 0 to 1, clamped."""
        with np.errstate(divide="ignore"):
            at, low, high = (self._measure(v) for v in (np.asarray(values, np.float64), self.low, self.high))
        return np.asarray(np.clip((at - low) / (high - low), 0.0, 1.0), np.float64)

    def _measure(self, value: Any) -> Any:
        if self.kind == "log":
            return np.log10(np.maximum(value, self.low))
        if self.kind == "reciprocal":
            return -1.0 / np.maximum(value, self.low)
        return value

    def colored(self, values: Any) -> NDArray[np.float64]:
        """Values of any shape (...) as sRGB in [0, 1], (..., 3)."""
        given = np.atleast_1d(values)
        made = np.empty((*given.shape, 3))
        for rows in row_blocks(given):
            share = self.normalized(given[rows])
            made[rows] = colored(1.0 - share if self.kind == "reciprocal" else share, self.colors)
        return made.reshape((*np.shape(values), 3))

    @property
    def ticks(self) -> list[float]:
        """Values of the tick marks, ascending: 1, 2 or 5 times powers of ten; powers of ten; or doublings."""
        if self.kind == "reciprocal":
            return [self.low, 2 * self.low, 4 * self.low, self.high]
        if self.kind == "log":
            first, last = math.ceil(math.log10(self.low) - 1e-9), math.floor(math.log10(self.high) + 1e-9)
            return [10.0**n for n in range(first, last + 1)]
        step = nice((self.high - self.low) / 5)
        step = max(step, 1.0) if self.whole else step
        first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
        return [n * step for n in range(first, last + 1)]


def nice(least: float) -> float:
    """The smallest of 1, 2 and 5 times a power of ten that is >= `least`, which is > 0."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= least * (1 - 1e-9))


def with_bar(image: Image.Image, scale: Scale) -> Image.Image:
    """The image with a colour bar below it: colours, tick marks and quantity of the scale."""
    font = _font()
    line = POINTS + 4
    words = _wrapped(scale.quantity, font, image.width - 2 * MARGIN)
    height = (len(words) + 1) * line + THICKNESS + 2 * MARGIN
    made = Image.new("RGB", (image.width, image.height + height), PAPER)
    made.paste(image, (0, 0))
    draw = _drawing(made)
    left, width = MARGIN, max(2, image.width - 2 * MARGIN)
    top = image.height + MARGIN
    for text in words:
        draw.text((left, top), text, INK, font=font)
        top += line
    made.paste(_strip(scale, width), (left, top))
    free = 0.0  # labels that would touch the previous one are omitted
    for value in scale.ticks:
        x = left + float(scale.normalized(value)) * (width - 1)
        text = _shown(value)
        wide = font.getlength(text)
        at = min(max(x - wide / 2, MARGIN / 2), image.width - wide - MARGIN / 2)
        if at >= free:
            draw.line([(x, top + THICKNESS), (x, top + THICKNESS + 2)], INK)
            draw.text((at, top + THICKNESS + 3), text, INK, font=font)
            free = at + wide + MARGIN
    return made


def with_legend(image: Image.Image, title: str, entries: Sequence[tuple[tuple[int, int, int], str]]) -> Image.Image:
    """The image with a legend below it: a title, and a line for each entry (colour, text)."""
    font = _font()
    line = POINTS + 4
    made = Image.new("RGB", (image.width, image.height + (len(entries) + 1) * line + MARGIN), PAPER)
    made.paste(image, (0, 0))
    draw = _drawing(made)
    top = image.height + MARGIN // 2
    draw.text((MARGIN, top), title, INK, font=font)
    for color, text in entries:
        top += line
        draw.rectangle([MARGIN, top + 2, MARGIN + POINTS - 2, top + POINTS], fill=color)
        draw.text((MARGIN + line, top), text, INK, font=font)
    return made


def _wrapped(text: str, font: Any, width: float) -> list[str]:
    """Wrap text to a width in pixels: up to three lines, at least one word in each."""
    lines: list[str] = []
    for word in text.split():
        if lines and font.getlength(f"{lines[-1]} {word}") <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines[:3]


def _strip(scale: Scale, width: int) -> Image.Image:
    share = np.linspace(0.0, 1.0, width)
    row = colored(1.0 - share if scale.kind == "reciprocal" else share, scale.colors)
    return Image.fromarray(np.asarray(np.rint(255 * np.tile(row, (THICKNESS, 1, 1))), np.uint8))


def _shown(value: float) -> str:
    if math.isinf(value):
        return "none"
    return f"{value:,.0f}" if 1000 <= abs(value) < 1e6 else f"{value:.3g}"


def _drawing(image: Image.Image) -> Any:
    from PIL import ImageDraw  # takes time, and few pictures have a scale

    return ImageDraw.Draw(image)


@cache
def _font() -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(POINTS)
