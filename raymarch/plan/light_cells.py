"""A grid of cells, each with the lights that reach it: those whose ball of light intersects the cell.

The grid is the content of one texture, so that lights that move compile nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raymarch.plan.cells import ROUNDING

CELLS = 1 << 14
"""Maximum number of cells."""

ENTRIES = 1 << 21
"""Maximum number of pairs of a cell and a light that may reach it, to limit time and memory."""

FINE = 0.25
"""Minimum edge of a cell, relative to the median radius of the balls: smaller cells leave out few more lights."""

WIDTH = 1024
"""Width of the texture in texels."""

HEAD = 3
"""Texels before those of the cells: the corner of the grid and cells a unit; the number of cells along each axis; the
list of points outside the grid."""


@dataclass(frozen=True, slots=True)
class LightCells:
    """The content of the texture, (rows, WIDTH, 4), and the length of the longest list, at least 1.

    The texels of cells hold the start and the length of a list. A texel of a list holds the number of a light. Lists
    ascend, so that a sum over them has the order of a sum over all lights.
    """

    texels: NDArray[np.float32]
    most: int


def build(balls: NDArray[np.float64], lower: NDArray[np.float64], upper: NDArray[np.float64]) -> LightCells:
    """The cells of some lights.

    balls : (n, 4), centre and radius of what each light reaches; the radius is infinite for a light without a limit.
    lower, upper : corners of a box of all surfaces, possibly infinite.
    """
    limited = np.isfinite(balls[:, 3])
    low, high = lower, upper
    centres, radii = balls[limited, :3], balls[limited, 3]
    if len(radii):
        low = np.maximum(low, (centres - radii[:, None]).min(axis=0))
        high = np.minimum(high, (centres + radii[:, None]).max(axis=0))
    if not len(radii) or np.any(low >= high):
        low, high = np.zeros(3), np.zeros(3)
    # A point may count to the neighbouring cell by rounding.
    margin = ROUNDING * float(np.max(np.abs([low, high])))
    low, high = low - margin, high + margin
    extent = np.maximum(high - low, 1e-30)
    size = max(float(np.cbrt(np.prod(extent) / CELLS)), FINE * float(np.median(radii)) if len(radii) else 1.0)
    while True:
        counts = np.ceil(extent / size).astype(np.int64)
        first, last = _spans(balls, limited, low, size, counts, margin)
        spans = np.maximum(last - first + 1, 0)
        if np.prod(counts.astype(float)) <= CELLS and np.prod(spans.astype(float), axis=1).sum() <= ENTRIES:
            break
        size *= 1.26
    light, cell = _pairs(first, spans)
    corner = low + size * cell
    near = np.clip(balls[light, :3], corner - margin, corner + size + margin)
    apart = np.linalg.norm(np.where(np.isfinite(near), near - balls[light, :3], 0.0), axis=1)
    reached = apart <= balls[light, 3] * (1.0 + ROUNDING)
    number = cell[reached] @ np.array([1, counts[0], counts[0] * counts[1]])
    order = np.argsort(number, kind="stable")
    many, begin = int(np.prod(counts)), HEAD + int(np.prod(counts))
    lengths = np.bincount(number, minlength=many)
    outside = np.flatnonzero(~limited)
    lists = np.concatenate([light[reached][order], outside])
    texels = np.zeros((begin + len(lists), 4))
    texels[0], texels[1, :3] = (*low, 1.0 / size), counts
    texels[2, :2] = begin + len(lists) - len(outside), len(outside)
    texels[HEAD:begin, 0] = begin + np.cumsum(lengths) - lengths
    texels[HEAD:begin, 1] = lengths
    texels[begin:, 0] = lists
    rows = no_power_of_two(-(-len(texels) // WIDTH))
    full = np.zeros((rows * WIDTH, 4), np.float32)
    full[: len(texels)] = texels
    return LightCells(full.reshape(rows, WIDTH, 4), max(int(lengths.max()), len(outside), 1))


def no_power_of_two(rows: int) -> int:
    """The least number from `rows` on that is no power of two: for software renderers, textures whose sizes are powers
    of two are another kind, for which they compile a program again."""
    while rows & (rows - 1) == 0:
        rows += 1
    return rows


def _spans(
    balls: NDArray[np.float64],
    limited: NDArray[np.bool_],
    low: NDArray[np.float64],
    size: float,
    counts: NDArray[np.int64],
    margin: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The first and last cell along each axis that the box of each ball touches, (n, 3)."""
    first = np.zeros((len(balls), 3), np.int64)
    last = np.broadcast_to(counts - 1, first.shape).copy()
    radii = balls[limited, 3:] * (1.0 + ROUNDING) + margin
    for found, at in ((first, balls[limited, :3] - radii), (last, balls[limited, :3] + radii)):
        found[limited] = np.clip(np.floor((at - low) / size), -1.0, counts.astype(float)).astype(np.int64)
    return np.maximum(first, 0), np.minimum(last, counts - 1)


def _pairs(first: NDArray[np.int64], spans: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All pairs of a light and a cell of its span: the numbers of lights (m,), ascending, and of cells (m, 3)."""
    each = np.prod(spans, axis=1)
    light = np.repeat(np.arange(len(each)), each)
    rank = np.arange(len(light)) - np.repeat(np.cumsum(each) - each, each)
    across, up = spans[light, 0], spans[light, 1]
    cell = np.stack([rank % across, rank // across % up, rank // (across * up)], axis=1)
    return light, first[light] + cell
