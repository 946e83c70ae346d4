"""Rays and narrow beams, their stretches, and the boxes that they meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.proof.rounding import ULP, Array, Interval, add, down, mul, up
from raymarch.proof.span import Span

Whole = NDArray[np.int64]

FAR = 1e30
"""A length beyond all rays."""

BRANCHES = 8
"""Boxes in a box of the tree."""

AT_ONCE = 1 << 11
"""Rays whose boxes are found at once; this bounds the memory."""

ASIDE = 1e-12
"""Relative margin of the distances at which a ray enters and leaves a box: far above their rounding errors."""


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """Rays of direction `directions`, shape (N, 3), from `origins`, (N, 3).

    beside, spread : a beam is all rays whose origin and direction differ from these by at most so much on each axis,
    (N, 3); None for rays without width.
    """

    origins: NDArray[np.float64]
    directions: NDArray[np.float64]
    beside: NDArray[np.float64] | None = None
    spread: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.origins)

    def __getitem__(self, rows: Any) -> Rays:
        own = (self.origins, self.directions, self.beside, self.spread)
        return Rays(*(None if v is None else v[rows] for v in own))  # type: ignore[arg-type]

    def origin(self, rays: Whole) -> Interval:
        return _around(self.origins, self.beside, rays)

    def direction(self, rays: Whole) -> Interval:
        return _around(self.directions, self.spread, rays)

    def points(self, rays: Whole, start: Array, end: Array, centre: Array) -> Span:
        """The points of stretches from `start` to `end` on some rays."""
        origin, along = self.origin(rays), self.direction(rays)
        first, last, at = (add(origin, mul((t[:, None], t[:, None]), along)) for t in (start, end, centre))
        return Span(np.minimum(first[0], last[0]), np.maximum(first[1], last[1]), at, along)


def _around(middle: Array, half: Array | None, rows: Whole) -> Interval:
    own = picked(middle, rows)
    if half is None:
        return own, own
    return own - picked(half, rows), own + picked(half, rows)


def picked(values: Array, rows: Whole) -> Array:
    """Some rows of values (n, ...), each component in one run (Fortran order): NumPy picks them 8 times as fast, and
    works on a component twice as fast. The values should lie so too."""
    return np.asarray(np.take(values.T, rows, axis=-1).T)


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """Some stretches of rays, (n,) each: the operand, and where they start and end."""

    rays: Whole
    operands: Whole
    start: Array
    end: Array

    def __len__(self) -> int:
        return len(self.rays)

    def __getitem__(self, rows: Any) -> Stretch:
        return Stretch(self.rays[rows], self.operands[rows], self.start[rows], self.end[rows])

    def halved(self) -> Stretch:
        """The first halves, then the second ones."""
        middle = 0.5 * (self.start + self.end)
        first = Stretch(self.rays, self.operands, self.start, middle)
        return Stretch.joined([first, Stretch(self.rays, self.operands, middle, self.end)])

    def rest(self, centre: Array, value: Array, slope: Interval) -> Stretch:
        """What is left without the part around the centre that is free: there the least value at the centre is above 0,
        and the steepest fall from it does not reach 0. In pieces of at most half the length.
        """
        back, ahead = (_reach(value, fall) for fall in (slope[1], -slope[0]))
        before = Stretch(self.rays, self.operands, self.start, np.clip(up(centre - back), self.start, centre))
        behind = Stretch(self.rays, self.operands, np.clip(down(centre + ahead), centre, self.end), self.end)
        rest, half = Stretch.joined([before, behind]), np.tile(0.5 * (self.end - self.start), 2)
        length = rest.end - rest.start
        long = length > half * (1.0 + 4.0 * ULP)
        return Stretch.joined([rest[(length > 0.0) & ~long], rest[long].halved()])

    @staticmethod
    def joined(parts: Sequence[Stretch]) -> Stretch:
        names = ("rays", "operands", "start", "end")
        return Stretch(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def _reach(value: Array, fall: Array) -> Array:
    """A length over which a value that falls at most so fast stays above 0."""
    safe = value > 0.0
    reach = np.divide(value, fall, out=np.full(len(value), FAR), where=safe & (fall > 0.0))
    return np.where(safe, np.minimum(down(reach, 4.0 * ULP), FAR), 0.0)


class Boxes:
    """Boxes, found by a tree in which each box holds `BRANCHES` neighbours. Those without bounds are met by all rays.

    lower, upper : corners, (n, 3), infinite where nothing is known.
    """

    def __init__(self, lower: Array, upper: Array) -> None:
        bounded = np.isfinite(lower).all(axis=1) & np.isfinite(upper).all(axis=1)
        self._wide = np.flatnonzero(~bounded)
        finite = np.flatnonzero(bounded)
        self._order = finite[np.argsort(_places(0.5 * (lower[finite] + upper[finite])), kind="stable")]
        self._corners = lower, upper
        self._levels = [(lower[self._order], upper[self._order])]
        while len(self._levels[-1][0]) > BRANCHES:
            low, high = self._levels[-1]
            first = np.arange(0, len(low), BRANCHES)
            self._levels.append((np.minimum.reduceat(low, first), np.maximum.reduceat(high, first)))

    def met(self, rays: Rays, start: Array, end: Array) -> Stretch:
        """The parts of all rays, from start to end, in the boxes."""
        found = []
        for first in range(0, max(len(start), 1), AT_ONCE):
            rows = np.arange(first, min(first + AT_ONCE, len(start)))
            for wide in self._wide:
                enter, leave = _crossed(rays, rows, start[rows], end[rows], *(v[None, wide] for v in self._corners))
                meets = enter <= leave
                found.append(Stretch(rows[meets], np.full(meets.sum(), wide), enter[meets], leave[meets]))
            if len(self._order):
                found.append(self._bounded(rays, rows, start, end))
        return Stretch.joined(found)

    def _bounded(self, rays: Rays, rows: Whole, start: Array, end: Array) -> Stretch:
        boxes = np.zeros(len(rows), np.int64)
        for level in reversed(self._levels):
            rows = np.repeat(rows, BRANCHES)
            boxes = (boxes[:, None] * BRANCHES + np.arange(BRANCHES)).ravel()
            there = boxes < len(level[0])
            rows, boxes = rows[there], boxes[there]
            enter, leave = _crossed(rays, rows, start[rows], end[rows], *(corner[boxes] for corner in level))
            meets = enter <= leave
            rows, boxes, enter, leave = rows[meets], boxes[meets], enter[meets], leave[meets]
        return Stretch(rows, self._order[boxes], enter, leave)


def _places(middle: Array) -> Array:
    """Numbers that are close for close points: their binary places in turn (Morton 1966)."""
    if not len(middle):
        return np.zeros(0, np.int64)
    low, high = middle.min(axis=0), middle.max(axis=0)
    cells = ((middle - low) / np.where(high > low, high - low, 1.0) * 1023.0).astype(np.int64)
    return np.asarray(sum(((cells[:, axis] >> bit) & 1) << (3 * bit + axis) for bit in range(10) for axis in range(3)))


def _crossed(rays: Rays, rows: Whole, start: Array, end: Array, lower: Array, upper: Array) -> Interval:
    """Where rays enter and leave boxes; they leave before they enter where they pass by."""
    origin, along = rays.origin(rows), rays.direction(rows)
    enter, leave = start.copy(), end.copy()
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis in range(3):
            # the greatest coordinate is above the lower side, the least below the upper side
            _limit(along[1][:, axis], lower[:, axis] - origin[1][:, axis], enter, leave)
            _limit(-along[0][:, axis], origin[0][:, axis] - upper[:, axis], enter, leave)
    return enter, leave


def _limit(rate: Array, least: Array, enter: Array, leave: Array) -> None:
    """Keep of each stretch the part where rate * t >= least."""
    at = least / rate
    wide = np.abs(at) * ASIDE
    np.maximum(enter, np.where(rate > 0.0, at - wide, -np.inf), out=enter)
    np.minimum(leave, np.where(rate < 0.0, at + wide, np.inf), out=leave)
    np.copyto(enter, np.inf, where=(rate == 0.0) & (least > 0.0))
