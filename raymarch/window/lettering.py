"""Messages as images: text in two columns, source code with carets, swatches. Drawn by Pillow."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from raymarch.window.messages import Message
from raymarch.window.pick import SWATCH

POINTS = 14
"""Height of the text at display scale 1, in pixels."""

BACKGROUNDS = {"error": (92, 14, 14, 255), "note": (18, 20, 24, 215), "busy": (64, 50, 8, 225)}
"""Background colours by kind of message, RGBA."""

WHITE, FAINT, CARET = (255, 255, 255, 255), (176, 184, 194, 255), (255, 196, 120, 255)

MONOSPACED = ("DejaVuSansMono.ttf", "Consola.ttf", "Menlo.ttc", "LiberationMono-Regular.ttf", "cour.ttf")
"""Files of monospaced fonts of the systems."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of a line of text: its position in pixels, its colour, and whether it is source code."""

    x: int
    y: int
    text: str
    color: tuple[int, int, int, int]
    code: bool = False


def lettered(message: Message, size: tuple[int, int], density: float) -> NDArray[np.uint8]:
    """A message as RGBA pixels, (H, W, 4), wrapped to fit a width, and in two columns if it is higher than `size`."""
    points, pad = round(POINTS * density), round(7 * density)
    line = points + round(4 * density)
    width = size[0] - 4 * pad - round(2 * density)
    blocks = message.text.split("\n\n")
    pieces, right, bottom = _paragraphs(blocks, message, width, line)
    if bottom + 2 * pad > size[1] and len(blocks) > 1:
        half = (len(blocks) + 1) // 2
        pieces, right, bottom = _paragraphs(blocks[:half], message, width // 2 - 2 * pad, line)
        gap = right + 3 * pad
        others, wide, high = _paragraphs(blocks[half:], message, width - gap, line)
        pieces += [Piece(gap + p.x, p.y, p.text, p.color, p.code) for p in others]
        right, bottom = gap + wide, max(bottom, high)
    image = Image.new("RGBA", (max(right, 1) + 2 * pad, max(bottom, 1) + 2 * pad), BACKGROUNDS[message.kind])
    draw = ImageDraw.Draw(image)
    for piece in pieces:
        _write(draw, piece, (pad, pad), points, message.swatch)
    made = np.array(image, np.uint8)
    if message.opacity < 1.0:
        made[..., 3] = np.rint(message.opacity * made[..., 3])
    return made


def _paragraphs(blocks: list[str], message: Message, width: int, line: int) -> tuple[list[Piece], int, int]:
    """The pieces of some paragraphs, and the width and height that they take."""
    font = _font(line - line // 5)
    rows = [row.partition("\t")[::2] for row in "\n\n".join(blocks).split("\n")]
    pad = line // 2
    column = max((round(font.getlength(left)) + pad for left, right in rows if right), default=0)
    pieces: list[Piece] = []
    y = 0
    for number, (left, right) in enumerate(rows):
        if right:
            parts = _wrapped(right, width - column, font)
            pieces.append(Piece(0, y, left, FAINT))
            pieces += [Piece(column, y + i * line, part, WHITE) for i, part in enumerate(parts)]
        else:
            parts = _wrapped(left, width, font)
            color = FAINT if message.code is not None and number == 0 else WHITE
            pieces += [Piece(0, y + i * line, part, color) for i, part in enumerate(parts)]
        y += len(parts) * line
        if number == 0 and message.code is not None:
            cell = cell_of(line - line // 5)
            for i, text in enumerate(message.code.lines(int(width / cell))):
                pieces.append(Piece(0, y, text, CARET if i else WHITE, code=True))
                y += line if i == 0 else line * 2 // 3
    ends = [piece.x + _length(piece, line - line // 5) for piece in pieces]
    return pieces, round(max(ends, default=0)), y


def _write(draw: Any, piece: Piece, corner: tuple[int, int], points: int, swatch: tuple[int, int, int] | None) -> None:
    x, y, text = corner[0] + piece.x, corner[1] + piece.y, piece.text
    if text.startswith(SWATCH) and swatch is not None:
        draw.rectangle([x, y + 1, x + points - 1, y + points], fill=(*swatch, 255), outline=FAINT)
        x, text = x + points + points // 3, text[len(SWATCH) :].lstrip()
    if not piece.code:
        draw.text((x, y), text, piece.color, font=_font(points))
        return
    font, cell = monospaced(points) or _font(points), cell_of(points)
    for i, letter in enumerate(text):  # in cells: the font may have to be one of other widths
        if letter != " ":
            draw.text((x + i * cell, y), letter, piece.color, font=font)


def _length(piece: Piece, points: int) -> float:
    return cell_of(points) * len(piece.text) if piece.code else float(_font(points).getlength(piece.text))


def _wrapped(line: str, width: int, font: Any) -> list[str]:
    """A line in parts of a width in pixels, at least a few letters each, broken at spaces where there are some."""
    indent = line[: len(line) - len(line.lstrip())]
    least = max(width, 12 * round(font.getlength("n")))
    parts = [indent]
    for word in line.split(" ") if not indent else line.strip().split(" "):
        joined = f"{parts[-1]} {word}" if parts[-1].strip() else parts[-1] + word
        if font.getlength(joined) <= least:
            parts[-1] = joined
            continue
        parts += [indent] if parts[-1].strip() else []
        for letter in word:
            if font.getlength(parts[-1] + letter) > least:
                parts.append(indent)
            parts[-1] += letter
    return parts


@lru_cache(8)
def _font(points: int) -> Any:
    """Pillow's own font. Without FreeType it is a bitmap of one size."""
    return ImageFont.load_default(points)


@lru_cache(8)
def monospaced(points: int) -> Any:
    """A monospaced font of the system or of an installed package; None if there is none."""
    toolkit = importlib.util.find_spec("imgui_bundle")
    beside = () if toolkit is None else (_inconsolata(toolkit.origin or ""),)
    for name in (*MONOSPACED, *beside):
        try:
            return ImageFont.truetype(name, points)
        except (OSError, ImportError):
            continue
    return None


def _inconsolata(package: str) -> str:
    return str(Path(package).parent / "assets" / "fonts" / "Inconsolata-Medium.ttf")


@lru_cache(8)
def cell_of(points: int) -> float:
    """The width of a character of source code in pixels."""
    font = monospaced(points)
    return float(_font(points).getlength("m") if font is None else font.getlength("m"))
