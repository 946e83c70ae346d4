"""Pictures drawn in parts, so that no part keeps the device for long."""

from __future__ import annotations

from collections.abc import Callable, Iterator

Tile = tuple[int, int, int, int]

EDGE = 128
"""Edge of the first tiles, in pixels."""

WHOLE = 1 << 20
"""Pixels of a picture that is drawn whole unless somebody watches its progress."""

SHORT, LONG = 15.0, 60.0
"""Milliseconds of a tile below which the next are larger, and above which they are smaller: drivers give up on work
that takes seconds, and whatever else is to be shown waits for the tile."""


def tiles_of(size: tuple[int, int], edge: int = EDGE) -> Iterator[Tile]:
    """A picture of (width, height) in tiles of one size, its top rows first."""
    width, height = size
    for top in range(height, 0, -edge):
        bottom = max(top - edge, 0)
        for x in range(0, width, edge):
            yield x, bottom, min(edge, width - x), top - bottom


def draw_in_tiles(size: tuple[int, int], draw: Callable[[Tile], float], progress: Callable[[float], None]) -> float:
    """Draw a picture of (width, height) in tiles, its top rows first.

    draw : draws one tile, (x, y, width, height) from the bottom left, and gives the milliseconds that it took.
    progress : called with the share done after each tile.
    Returns the milliseconds of all.
    """
    width, height = size
    spent, edge, top = 0.0, EDGE, height
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
        elif longest < SHORT:
            edge *= 2
    return spent
