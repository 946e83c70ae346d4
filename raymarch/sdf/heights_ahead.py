"""How far along a ray a height map is not met: by the heights and slopes of the blocks that the ray may cross.

A stretch of a ray crosses a block of cells whose side is a power of two. A table holds the largest height and the
steepest slope of each block, so that one texel answers for the stretch; after Tevs, Ihrke and Seidel, "Maximum mipmaps
for fast, accurate, and scalable dynamic height field rendering" (2008). Within a cell heights are bilinear, so above a
ray they are a parabola, and the first root of it is the hit.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const, var
from raymarch.expr.samples import Samples, sample, sample_slope
from raymarch.expr.smooth import LEAST
from raymarch.expr.stretch import first_root
from raymarch.expr.tables import Table, fetch
from raymarch.expr.types import FLOAT, VEC2, VEC3
from raymarch.expr.vocabulary import (
    abs,
    all_of,
    ceil,
    clamp,
    dot,
    exp2,
    floor,
    fract,
    length,
    log2,
    max,
    min,
    step,
    where,
)
from raymarch.sdf.ways import Line

MARGIN = 1e-3
"""By how much a stretch is longer on both sides, in cells, so that rounding in float32 moves it to no other block."""

Array = NDArray[np.float64]


def free_over(data: Samples) -> Function:
    """`float name(vec3 p, vec3 d, vec2 growing, vec2 size, float height, float w)`: the way that is free.

    p, d : a point and a direction of any length. growing : level and growth of what the height above the map must
    exceed. size, height : of the map. w : the stretch looked at; the way is not longer.
    """
    return _made(data)


@lru_cache(maxsize=8)
def _made(data: Samples) -> Function:
    p, d, growing, size = var("p", VEC3), var("d", VEC3), var("growing", VEC2), var("size", VEC2)
    height, w = var("height", FLOAT), var("w", FLOAT)
    level, growth = growing
    last = tuple(float(n - 1) for n in data.size)
    at, rate = (p.xz / size + 0.5) * last, d.xz / size * last
    block = _block(data, at, rate, w)
    here = sample(data, at)
    above, slope = p.y - height * here, d.y - height * dot(sample_slope(here), rate)
    border = min(w, min(*(abs(step(0.0, rate) - fract(at)) / max(abs(rate), LEAST))))
    there = p.y + border * d.y - height * sample(data, at + border * rate) - level - growth * border
    first, falls = above - level, (slope - growth) * border
    root = first_root(first, falls, there - first - falls, const(1.0))
    beyond = max(there, 0.0) / max(growth + height * block.y * length(rate) - d.y, LEAST)
    inside = all_of(at.x >= 0.0, at.y >= 0.0, at.x <= last[0], at.y <= last[1])
    way = border * root + where(root < 1.0, 0.0, beyond)
    highest = Line(p.y - height * block.x, d.y).way(level, growth)
    body = min(max(highest, where(inside, way, 0.0)), w)
    return Function("way_over_heights", (p, d, growing, size, height, w), body)


def _block(data: Samples, at: Expr, rate: Expr, w: Expr) -> Expr:
    """The largest height and the steepest slope, in cells, of the block that a stretch crosses."""
    levels, table = _table(data)
    ahead = w * rate
    low = min(at, at + ahead) - MARGIN
    wide = max(*abs(ahead)) + 2.0 * MARGIN
    level = clamp(ceil(log2(wide)), 1.0, float(levels))
    side, across = floor(exp2(level) + 0.5), floor(exp2(levels - level) + 0.5)
    cell = floor(clamp(low, 0.0, tuple(n - 1.0 - MARGIN for n in data.size)) / side)
    return fetch(table, (across * across - 1.0) / 3.0 + cell.y * across + cell.x + 0.5)


@lru_cache(maxsize=8)
def _table(data: Samples) -> tuple[int, Table]:
    """The number of levels, and the blocks of all levels, coarse to fine: from each cell of a level on, two cells along
    each axis. A cell of the level k has a side of 2^k cells of the data."""
    heights = data.values.astype(np.float64)
    highest = _pairs(_pairs(heights, 0), 1)
    slopes = np.hypot(_pairs(np.abs(np.diff(heights, axis=1)), 0), _pairs(np.abs(np.diff(heights, axis=0)), 1))
    levels = next(k for k in range(1, 12) if 1 << k >= np.max(slopes.shape))
    padding = [(0, (1 << levels) - n) for n in slopes.shape]
    cells = np.stack([np.pad(highest, padding, constant_values=heights.min()), np.pad(slopes, padding)], axis=-1)
    blocks: list[Array] = []
    while len(cells) > 1:
        cells = np.max([cells[i::2, j::2] for i in (0, 1) for j in (0, 1)], axis=0)
        ended = np.pad(cells, [(0, 1), (0, 1), (0, 0)], mode="edge")
        blocks.append(_pairs(_pairs(ended, 0), 1).reshape(-1, 2))
    above = np.nextafter(np.concatenate(blocks[::-1]).astype(np.float32), np.float32(np.inf))
    return levels, Table(above, f"blocks of {data.label}")


def _pairs(values: Array, axis: int) -> Array:
    """The larger ones of neighbours along an axis."""
    low, high = [slice(None)] * values.ndim, [slice(None)] * values.ndim
    low[axis], high[axis] = slice(None, -1), slice(1, None)
    return np.maximum(values[tuple(low)], values[tuple(high)])
