"""Parts and gaps of a solid that fall between the points of a grid, and that a mesh from the grid therefore lacks.

The surface of a part that is thinner than a cell is nearer to some point of the grid than half the diagonal of a cell,
although no edge of the grid changes sign there. From such points the gradient leads to the surface.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Blocks = Iterable[tuple[Array, NDArray[np.float32]]]
Linear = Callable[[Array], tuple[Array, Array]]
"""The values at some points in cells, and the unit gradients there; both points and values as in the grid."""

REACH = 0.5 * 3.0**0.5
"""No point of space is farther from the nearest point of the grid, in cells."""

STEPS = 6
"""Steps along the gradient that lead a point to the surface."""

FOUND = 1e-3
"""A point is on the surface if its distance is at most this, in cells."""

DEPTHS = 0.5 ** np.arange(1, 10)
"""Depths below the surface, in cells, one of which lies within a part: thinner films come from faces that touch."""

NEIGHBOURS = np.array(list(product((-1, 0, 1), repeat=3)))


def watched(blocks: Blocks, lipschitz: float, found: list[Array]) -> Iterator[tuple[Array, NDArray[np.float32]]]:
    """The same blocks. Into `found` go their points (N, 4), indices and values, near a surface without a change of sign
    around them."""
    for first, values in blocks:
        near = np.abs(values) <= REACH * lipschitz
        if near.any():
            inside = values < 0.0
            near &= ~_beside(inside) | ~_beside(~inside)
            at = np.argwhere(near)
            if len(at):
                found.append(np.column_stack([first + at, values[near]]))
        yield first, values


def _beside(marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The points that are marked, or have a marked one among the 26 around them."""
    found = marked.copy()
    for axis in range(3):
        before = np.moveaxis(found.copy(), axis, 0)
        to = np.moveaxis(found, axis, 0)
        to[1:] |= before[:-1]
        to[:-1] |= before[1:]
    return found


def left_out(points: list[Array], vertices: Array, linear: Linear) -> NDArray[np.float64]:
    """Points of the surface (N, 3) that are at least a cell away from the mesh; all in cells.

    points : from `watched`. vertices : of the mesh.
    """
    if not points:
        return np.empty((0, 3))
    start = np.unique(np.concatenate(points), axis=0)
    side, at = np.sign(start[:, 3]), start[:, :3].copy()
    for _ in range(STEPS):
        value, normal = linear(at)
        at -= value[:, None] * normal
    value, normal = linear(at)
    on = (np.abs(value) <= FOUND) & (np.linalg.norm(at - start[:, :3], axis=1) <= 2.0 * REACH)
    on[on] = ~_near(np.floor(at[on]).astype(np.int64), np.floor(vertices).astype(np.int64))
    at, side, normal = at[on], side[on], normal[on]
    behind = np.zeros(len(at), bool)
    for depth in DEPTHS:
        behind |= side * linear(at - (side * depth)[:, None] * normal)[0] < -FOUND
    return np.asarray(at[behind], np.float64)


def _near(cells: Array, taken: Array) -> NDArray[np.bool_]:
    """True for cells that are, or touch, one of those that are taken."""
    if not len(taken) or not len(cells):
        return np.zeros(len(cells), bool)
    low = np.minimum(cells.min(axis=0), taken.min(axis=0)) - 1
    size = np.maximum(cells.max(axis=0), taken.max(axis=0)) + 2 - low
    keys = np.unique(np.ravel_multi_index((taken - low).T, size))
    found = np.zeros(len(cells), bool)
    for shift in NEIGHBOURS:
        found |= np.isin(np.ravel_multi_index((cells + shift - low).T, size), keys)
    return found
