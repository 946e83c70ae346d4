"""Colour maps and scales of heat maps, and the bars and legends that show them.

Three of matplotlib's maps, as every fifth of their 256 colours: "viridis" and "inferno" are perceptually uniform: equal
steps of the value look equally large, also in grey (Smith and van der Walt 2015). "coolwarm" diverges from a neutral
middle (Moreland 2009).
"""

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
from raymarch.expr.function import Function
from raymarch.expr.node import var
from raymarch.expr.tables import Table, fetch
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import floor, mix, where
from raymarch.expr.vocabulary import min as smaller

MAPS = {
    "viridis": """
        440154 46085c 471063 481769 481d6f 482475 472a7a 46307e 453781 433d84 414287 3f4889 3d4e8a 3a538b 38598c 355e8d
        33638d 31688e 2e6d8e 2c718e 2a768e 297b8e 27808e 25848e 23898e 218e8d 20928c 1f978b 1e9c89 1fa188 21a585 24aa83
        28ae80 2eb37c 35b779 3dbc74 46c06f 50c46a 5ac864 65cb5e 70cf57 7cd250 89d548 95d840 a2da37 b0dd2f bddf26 cae11f
        d8e219 e5e419 f1e51d fde725
    """,
    "inferno": """
        000004 02020c 050417 0a0722 10092d 160b39 1e0c45 260c51 2f0a5b 380962 400a67 490b6a 510e6c 59106e 61136e 69166e
        71196e 781c6d 801f6c 88226a 902568 982766 a02a63 a82e5f b0315b b73557 bf3952 c63d4d cc4248 d34743 d94d3d df5337
        e45a31 e9612b ed6925 f1711f f47918 f78212 f98b0b fa9407 fb9d07 fca60c fcb014 fbba1f fac42a f8cd37 f6d746 f4e156
        f2ea69 f2f27d f5f992 fcffa4
    """,
    "coolwarm": """
        3b4cc0 4055c8 465ecf 4c66d6 536edd 5977e3 5f7fe8 6687ed 6c8ff1 7396f5 7a9df8 81a4fb 88abfd 8fb1fe 96b7ff 9dbdff
        a3c2fe aac7fd b1cbfc b7cff9 bed2f6 c4d5f3 cad8ef cfdaea d5dbe5 dadce0 dfdbd9 e4d9d2 e9d5cb edd2c3 f0cdbb f2c9b4
        f5c4ac f6bea4 f7b89c f7b194 f7aa8c f6a385 f59c7d f39475 f08b6e ed8366 e97a5f e57058 e16751 dc5d4a d65244 d0473d
        ca3b37 c32e31 bb1b2c b40426
    """,
}
"""Colours from the lowest to the highest value, evenly spaced, as RRGGBB in hexadecimal."""


SHARE = var("share", FLOAT)


@cache
def color_map(name: str) -> Function:
    """A map as a function of a number, which is clamped to [0, 1], NaN to 0: sRGB in [0, 1], in NumPy and in GLSL.

    name : a key of `MAPS`. Within 2/255 of matplotlib's map.
    """
    rows = [[int(color[i : i + 2], 16) / 255.0 for i in (0, 2, 4)] + [1.0] for color in MAPS[name].split()]
    table = Table(rows, name)
    at = where(SHARE > 0.0, smaller(SHARE, 1.0), 0.0) * float(len(rows) - 1)
    low = smaller(floor(at), float(len(rows) - 2))
    return Function(name, (SHARE,), mix(fetch(table, low).xyz, fetch(table, low + 1.0).xyz, at - low))


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
    colors : a key of `MAPS`.
    """

    quantity: str
    low: float
    high: float
    kind: Literal["linear", "log", "reciprocal"] = "linear"
    colors: str = "inferno"

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
