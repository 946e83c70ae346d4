"""Groups of objects that are small beside the box around all: each has a grid of its own.

One grid has at most some thousand cells along an axis, of which each is halved a few times. Where thousands of objects
lie in one of the smallest cells, as in two groups far apart, each evaluation in it would ask all of them.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raymarch.prices import STANDARD
from raymarch.sdf.blends import REACH
from raymarch.sdf.facts import beyond
from raymarch.sdf.rows import Form, Rows

ACROSS = 1 << 12
"""Smallest cells along the longest edge of the box of all objects."""

FINER = 64.0
"""The box of a group is at most this fraction of that of all, so that its cells are that much smaller."""

MOST = 8
"""Maximum number of groups."""


def groups(rows: Rows, exact: float, crowd: int = STANDARD.group) -> list[Rows]:
    """The rows as one or several; their union is the same solid.

    exact : distance to surfaces up to which the field is the same too. Objects of a blend are divided only if they are
    so far apart that none of one group takes part in blends of the other.
    crowd : see `Prices.group`.
    """
    lower = np.concatenate([form.lower for form in rows.forms])
    upper = np.concatenate([form.upper for form in rows.forms])
    if rows.live or len(rows) < 2 * crowd or not np.all(np.isfinite(lower) & np.isfinite(upper)):
        return [rows]
    margin = 0.0
    if rows.family:
        spread = float(np.max([form.spread.max() for form in rows.forms]))
        folds = np.ceil(np.log2(max(form.order.max() for form in rows.forms) + 1))
        margin = np.sqrt(3.0) * spread * (2.0 * exact + rows.k * (REACH[rows.family] + 0.5 * folds))
    number = np.zeros(len(rows), np.int64)
    pending = [0]
    while pending and number.max() + 1 < MOST:
        mine = np.nonzero(number == pending.pop())[0]
        for group in _compact(lower[mine], upper[mine], float(margin), crowd):
            if number.max() + 1 < MOST and len(group) < len(mine):
                number[mine[group]] = number.max() + 1
                pending.append(int(number.max()))
    found = np.unique(number)
    return [rows] if len(found) == 1 else [_part(rows, number == i) for i in found]


def _compact(
    lower: NDArray[np.float64], upper: NDArray[np.float64], margin: float, crowd: int
) -> list[NDArray[np.int64]]:
    """The groups of at least `crowd` objects in small boxes, as indices; other objects are farther than the margin."""
    low, extent = lower.min(axis=0), float((upper.max(axis=0) - lower.min(axis=0)).max())
    if extent == 0.0:
        return []
    cells = np.floor((0.5 * (lower + upper) - low) * (ACROSS / extent)).astype(np.int64)
    kinds, cell, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    cell = cell.reshape(-1)  # of shape (n, 1) in some versions of NumPy
    crowded = {tuple(kinds[i]) for i in np.nonzero(counts >= crowd // 8)[0].tolist()}
    made = []
    while crowded:
        near = [crowded.pop()]
        for at in near:  # grows while cells touch it
            for step in itertools.product((-1, 0, 1), repeat=3):
                beside = tuple(int(a) + b for a, b in zip(at, step, strict=True))
                if beside in crowded:
                    crowded.discard(beside)
                    near.append(beside)
        low_cell, high_cell = np.min(near, axis=0) - 1, np.max(near, axis=0) + 1
        inside = np.all((kinds >= low_cell) & (kinds <= high_cell), axis=1)[cell]
        box = lower[inside].min(axis=0), upper[inside].max(axis=0)
        if np.sum(inside) < crowd or counts[inside[_first(cell, len(kinds))]].max() < crowd:
            continue
        if float((box[1] - box[0]).max()) * FINER > extent:
            continue
        if not margin or np.all(np.linalg.norm(beyond(lower, upper, *box), axis=1)[~inside] > margin):
            made.append(np.nonzero(inside)[0])
    return made


def _first(cell: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """An object of each cell."""
    found = np.zeros(n, np.int64)
    found[cell[::-1]] = np.arange(len(cell))[::-1]
    return found


def _part(rows: Rows, chosen: NDArray[np.bool_]) -> Rows:
    """The chosen objects."""
    firsts = np.cumsum([0, *map(len, rows.forms)])
    some = [(form, chosen[a:b]) for form, a, b in zip(rows.forms, firsts[:-1], firsts[1:], strict=True)]
    return replace(rows, forms=tuple(_some(form, mine) for form, mine in some if mine.any()), given=None)


def _some(form: Form, mine: NDArray[np.bool_]) -> Form:
    own = ("slots", "order", "lower", "upper", "radius", "spread", "lipschitz")
    arrays = {name: getattr(form, name)[mine] for name in own}
    return replace(form, numbers=tuple(number[mine] for number in form.numbers), **arrays)
