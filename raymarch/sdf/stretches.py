"""How far along a stretch of a ray an implicit surface or a height map is not met.

An implicit surface: up to the first root of the parabola below its function on the stretch. The parabola is that of
`raymarch.expr.stretch`, of the function where the ray enters the box. It needs no Lipschitz constant and cannot pass
the surface; near it the step is that of Newton's method.

A height map: by the heights and slopes of the blocks that the ray may cross. A stretch of a ray crosses a block of
cells whose side is a power of two. A table holds the largest height and the steepest slope of each block, so that one
texel answers for the stretch; after Tevs, Ihrke and Seidel, "Maximum mipmaps for fast, accurate, and scalable dynamic
height field rendering" (2008). Within a cell heights are bilinear, so above a ray they are a parabola, and the first
root of it is the hit.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, reduce

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.function import Function
from raymarch.expr.node import Expr, const, expr, var
from raymarch.expr.samples import Samples, sample, sample_bend, sample_slope
from raymarch.expr.series import Reading
from raymarch.expr.smooth import LEAST
from raymarch.expr.stretch import Unbounded, first_root, free_of, series_of
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
    vec2,
    vec3,
    where,
)
from raymarch.sdf.facts import FARTHEST
from raymarch.sdf.ways import MARGIN, Line, way_to_box

RAY, CONE = 1.5e-6, 1e-4
"""A level that grows less is the rounding error of a ray; one that grows more is the radius of a cone."""

SHELL = 1e-4
"""A level above this share of the box grows the box: then the function counts inside of the box only. A ray that is
nearer to the box is read from where it enters; in a tree of nothing but unions, also one that is farther."""

SHARES = (1.0, 0.5)
"""Shares of the stretch that are looked at where a function has limits; the longest way counts. Of octaves of noise,
all but the way is the same for all shares, and two take a quarter fewer evaluations and less time. On polynomials they
cost as much as they save."""

NAMES = ("p", "d", "lower", "upper", "growing", "scales", "w")


def free_way(definition: Function, negated: bool, plain: bool = False, far: bool = False) -> Function | None:
    """`vec2 name(vec3 p, vec3 d, vec3 lower, vec3 upper, vec2 growing, vec3 scales, float w)`: the value of the
    function less its level, at the nearest point of the box, and the way that is free.

    p, d : a point and a direction of any length. lower, upper : the box that cuts the solid. growing : level and growth
    of what the field must exceed. scales : level, unit and steepest slope of the function. w : the stretch looked at.
    negated : for the complement. plain : True if the level is that of the ray or cone itself, and so not negative: then
    the way has the sign of the function, and is as long as that stays. far : True if the value may be a lower bound of
    it from outside of the box: then the way goes through the box at once. None if nothing is known of the function
    along a stretch.
    """
    return definition.once(("free way", negated, plain, far), lambda: _free_way(definition, negated, plain, far))


def _free_way(definition: Function, negated: bool, plain: bool, far: bool) -> Function | None:
    types = (VEC3, VEC3, VEC3, VEC3, VEC2, VEC3, FLOAT)
    params = tuple(var(name, type) for name, type in zip(NAMES, types, strict=True))
    p, d, lower, upper, growing, scales, w = params
    level, growth = growing
    rate = 1.0 / _nowhere_0(d)
    ends = (lower - p) * rate, (upper - p) * rate
    first, last = max(*min(*ends)), min(*max(*ends))
    met = last >= max(first, 0.0)
    shell = SHELL * max(*(upper - lower))
    begin = const(0.0) if negated else where(met if far else met & (first < shell), max(first, 0.0), 0.0)
    at = clamp(p + begin * d, lower, upper)
    # A cone needs the distance, of which the divided function is a bound. The rounding error of a ray is no distance:
    # where the function is flat, as at singular points, it is met far before its surface.
    grown = (growth > RAY) & (level > shell) if plain else level > shell
    factor = where(growth > CONE, scales.z / scales.y, where(grown, 1.0, 0.0))
    in_box = met & (first <= 0.0)

    def free_on(stretch: Expr) -> tuple[Reading, Expr, Expr, Expr]:
        end = max(last - begin, LEAST)
        reading, found = series_of(definition, at, d, min(stretch, end))
        here = found.c[0] - scales.x
        inside = in_box & (here < 0.0) if plain else expr(negated)
        line = factor * (level + growth * begin), factor * growth
        found = replace(found, c=(here, *found.c[1:]))
        return reading, here, inside, free_of(reading, found, inside, scales.y, line, end)

    try:
        reading, here, inside, ahead = free_on(w)
    except Unbounded:
        return None
    if reading.limited:
        ahead = max(*[free_on(share * w)[-1] for share in SHARES])
    leaving = where(grown, _exit(p, d, lower + level, upper - level, growth), last)
    to_end = where(in_box, min(ahead, leaving), 0.0)
    half, more = 0.5 * (upper - lower), max(level, 0.0)
    to_grown = way_to_box(p - lower - half, d, half + (more + MARGIN * max(*max(abs(lower), abs(upper)))), growth)
    through = where(begin + ahead < last, begin + ahead, FARTHEST)
    to_box = where(met, through if far else where(begin < first, first, through), FARTHEST)
    outside = where(grown, where(in_box, min(ahead, last), to_grown), to_box)
    way = where(inside, -to_end, outside) if plain else to_end if negated else outside
    fallen = scales.z * begin * dot(abs(d), (1.0, 1.0, 1.0))
    name = f"{definition.name}_free{'_of_level' * (not plain)}{'_inside' * negated}"
    return Function(name, params, vec2(here - fallen, way), where=definition.where)


def _nowhere_0(d: Expr) -> Expr:
    """A direction without components of 0."""
    return vec3(*[where(abs(each) < LEAST, LEAST, each) for each in d])


def _exit(p: Expr, d: Expr, lower: Expr, upper: Expr, growth: Expr) -> Expr:
    """The way to where a point leaves a box that shrinks on all sides; 0 outside."""
    gaps = [*(upper - p), *(p - lower)]
    rates = [growth + sign * each for sign in (1.0, -1.0) for each in d]
    ways = [where(rate > LEAST, gap / max(rate, LEAST), FARTHEST) for gap, rate in zip(gaps, rates, strict=True)]
    return where(min(*gaps) > 0.0, max(reduce(min, ways), 0.0), 0.0)


CELL_MARGIN = 1e-3
"""By how much a stretch is longer on both sides, in cells, so that rounding in float32 moves it to no other block."""

Array = NDArray[np.float64]


@lru_cache(maxsize=8)
def free_over(data: Samples) -> Function:
    """`float name(vec3 p, vec3 d, vec2 growing, vec2 size, float height, float w)`: the way that is free.

    p, d : a point and a direction of any length. growing : level and growth of what the height above the map must
    exceed. size, height : of the map. w : the stretch looked at; the way is not longer.
    """
    p, d, growing, size = var("p", VEC3), var("d", VEC3), var("growing", VEC2), var("size", VEC2)
    height, w = var("height", FLOAT), var("w", FLOAT)
    level, growth = growing
    last = tuple(float(n - 1) for n in data.size)
    at, rate = (p.xz / size + 0.5) * last, d.xz / size * last
    block = _block(data, at, rate, w)
    here = sample(data, at)
    above, slope = p.y - height * here, d.y - height * dot(sample_slope(here), rate)
    bend = -height * sample_bend(here) * rate.x * rate.y  # within a cell the height above the map is a parabola
    border = min(w, min(*(abs(step(0.0, rate) - fract(at)) / max(abs(rate), LEAST))))
    first, falls, bent = above - level, (slope - growth) * border, bend * border * border
    there = first + falls + bent
    root = first_root(first, falls, bent, const(1.0))
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
    low = min(at, at + ahead) - CELL_MARGIN
    wide = max(*abs(ahead)) + 2.0 * CELL_MARGIN
    level = clamp(ceil(log2(wide)), 1.0, float(levels))
    side, across = floor(exp2(level) + 0.5), floor(exp2(levels - level) + 0.5)
    cell = floor(clamp(low, 0.0, tuple(n - 1.0 - CELL_MARGIN for n in data.size)) / side)
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
