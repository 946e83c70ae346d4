"""Lists of the objects of many cells, each level of cells with all its lists in one array."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Whole: TypeAlias = NDArray[np.int64]
Indices: TypeAlias = NDArray[np.int32]

MANY, ENTRIES = 1 << 22, 24 << 20
"""Number of entries in all lists beyond which only cells with twice as many objects are halved, and beyond which none
is, to limit memory."""

CORNERS = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.int32)
"""The children of a cell, in the order of their texels."""

PAIRS = 1 << 15
"""Pairs of a cell and an object that are evaluated at once."""


@dataclass(slots=True)
class Level:
    """Cells of one size: indices (n, 3), and the list of each, items[starts[i] : starts[i + 1]]."""

    cells: Indices
    starts: Whole
    items: NDArray[np.int32]


def folds(starts: Whole, items: Indices, order: Whole) -> tuple[NDArray[np.uint8], int]:
    """The folds after each entry: those nodes of the tree whose last operand it is; and the depth of the stack.

    The operands i and i + 1 of a list meet at the level of the highest bit in which their ranks differ.
    """
    counts = np.diff(starts)
    # A list may have millions of entries: ranks are below 2**31, and levels below 31.
    rank = order.astype(np.int32)[items]
    merges = np.zeros(len(items), np.uint8)
    most = int(counts.max(initial=1))
    # The open levels of a cell descend, so there are no more than bits in a rank.
    open_levels = np.zeros((len(counts), int(order.max()).bit_length() + 2), np.int8)
    height = np.zeros(len(counts), np.int8)
    deepest = 1
    for position in range(most):
        cells = np.nonzero(counts > position)[0]
        at = starts[cells] + position
        last = counts[cells] == position + 1
        following = np.minimum(at + 1, len(items) - 1)
        level = np.where(last, np.iinfo(np.int8).max, _bits(rank[at] ^ rank[following])).astype(np.int8)
        while True:
            top = open_levels[cells, np.maximum(height[cells] - 1, 0)]
            popping = (height[cells] > 0) & (top < level)
            if not popping.any():
                break
            merges[at[popping]] += 1
            height[cells[popping]] -= 1
        more = ~last
        open_levels[cells[more], height[cells[more]]] = level[more]
        height[cells[more]] += 1
        deepest = max(deepest, int(height.max(initial=0)))
    return merges, deepest


def _bits(numbers: Whole) -> Whole:
    """Number of bits of positive integers."""
    return np.frexp(numbers.astype(np.float64))[1].astype(np.int64)


def ranges(starts: Whole, counts: Whole, firsts: Whole) -> Whole:
    """The indices starts[i], ..., starts[i] + counts[i] - 1 for all i in order; firsts : running sum of the counts."""
    return np.arange(firsts[-1]) + np.repeat(starts - firsts[:-1], counts)


def joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """The parts as one array; they are freed."""
    made = np.concatenate(parts)
    parts.clear()
    return made


def taken(level: Level, chosen: Whole) -> Level:
    """Some cells of a level, in ascending order."""
    counts = np.diff(level.starts)
    mine = np.zeros(len(counts), bool)
    mine[chosen] = True
    starts = np.concatenate([[0], np.cumsum(counts[chosen])]).astype(np.int64)
    return Level(level.cells[chosen], starts, level.items[np.repeat(mine, counts)])


def parts(level: Level) -> Iterator[Level]:
    """The level in parts of a limited number of entries."""
    first = 0
    while first < len(level.cells):
        last = int(np.searchsorted(level.starts, level.starts[first] + PAIRS, side="right")) - 1
        last = min(max(last, first + 1), len(level.cells))
        begin, end = level.starts[first], level.starts[last]
        yield Level(level.cells[first:last], level.starts[first : last + 1] - begin, level.items[begin:end])
        first = last


def write(blocks: list[NDArray[np.float32]], places: Whole, values: Array) -> None:
    """Write texels by their index in the concatenated blocks."""
    first = 0
    for block in blocks:
        mine = (places >= first) & (places < first + len(block))
        block[places[mine] - first] = values[mine]
        first += len(block)


def crowded(level: Level, above: Level, halved: float) -> bool:
    """True if the cells of a level list too many objects in all, or many that are as long as those of the level above
    it: objects that nearly coincide stay together in the smallest cell. halved : see `Prices`."""
    entries = len(level.items)
    shorter = entries * len(above.cells) <= halved * len(above.items) * len(level.cells)
    return entries > ENTRIES or (entries > MANY and not shorter)
