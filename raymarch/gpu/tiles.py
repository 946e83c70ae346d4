"""Drawing in tiles, so that no single draw occupies the device for long."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

Tile = tuple[int, int, int, int]

EDGE = 128
"""Edge of the first tiles in pixels."""

WHOLE = 1 << 20
"""Pictures with at most this number of pixels are drawn at once, unless progress is reported."""

SHORT, LONG = 15.0, 60.0
"""Times of a tile in milliseconds: below the first, the following tiles grow; above the second, they shrink. Drivers
abort draws that take seconds, and other programs wait for the tile before they can draw."""


def split(size: tuple[int, int], edge: int) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Tiles of a picture by rows from the top: the upper left corner, (x, row), and the size of each. Tiles at the
    right and at the bottom may be smaller than `edge`."""
    for row in range(0, size[1], edge):
        for x in range(0, size[0], edge):
            yield (x, row), (min(edge, size[0] - x), min(edge, size[1] - row))


def tiles_of(size: tuple[int, int], edge: int = EDGE) -> Iterator[Tile]:
    """The same tiles as (x, y, width, height), from the lower left corner of the picture."""
    return ((x, size[1] - row - high, wide, high) for (x, row), (wide, high) in split(size, edge))


@dataclass(slots=True)
class Edge:
    """The edge of the next tile of a program in pixels: that which the last frame ended with."""

    pixels: int = field(default_factory=lambda: EDGE)


def draw_in_tiles(
    size: tuple[int, int], draw: Callable[[Tile], float], progress: Callable[[float], None], known: Edge | None = None
) -> float:
    """Draw a picture of size (width, height) in tiles, from the top row down.

    draw : draws one tile, (x, y, width, height) from the bottom left, and returns its time in milliseconds.
    progress : called with the fraction done after each tile.
    known : the edge to begin with, which is then that of the last tile; a fast pass is then one draw in later frames.
    Returns the total time in milliseconds.
    """
    width, height = size
    spent, edge, top = 0.0, EDGE if known is None else known.pixels, height
    while top > 0:
        bottom = max(top - edge, 0)
        longest = 0.0
        for x in range(0, width, edge):
            took = draw((x, bottom, min(edge, width - x), top - bottom))
            longest, spent = max(longest, took), spent + took
            done = (height - top) * width + min(x + edge, width) * (top - bottom)
            progress(done / (width * height))
        top = bottom
        if longest > LONG and edge > 16:
            edge //= 2
        elif longest < SHORT and edge < max(size):
            edge *= 2
    if known is not None:
        known.pixels = edge
    return spent
