"""A grid of cells, each with the objects that can decide the field in it (Lipschitz pruning; Barbier et al. 2025).

In a cell with centre c and half diagonal R, object i can be the nearest only if f_i(c) - L_i R <= f_j(c) + L_j R for
every other object j. In a blend, one of two operands a, b decides alone if |a - b| > 2 R + reach at the centre. Cells
are halved level by level, and a cell inherits the list of its parent.

Values are needed near surfaces only. A hard union therefore lists only objects with f_i(c) <= cut + R: at a point p the
others are at least at the distance cut + R - |p - c|, which bounds the field where no listed object is nearer. A cell
without any such object stores a lower bound of f(c) only: f(p) >= f(c) - |p - c|.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import evaluator
from raymarch.expr.node import var
from raymarch.expr.types import FLOAT
from raymarch.plan.lists import (
    CORNERS,
    ENTRIES,
    MANY,
    PAIRS,
    Array,
    Indices,
    Level,
    Whole,
    crowded,
    folds,
    joined,
    parts,
    ranges,
    taken,
    write,
)
from raymarch.prices import STANDARD, Prices
from raymarch.sdf.blends import FAMILIES, REACH
from raymarch.sdf.rows import Rows

FINEST = 4
"""Maximum number of times that a cell of the grid is halved."""

FINEST_LIVE = 3
"""The same for objects that depend on parameters or time: each evaluation then descends as often as any could need."""

CELLS = 1 << 22
"""Number of cells beyond which none is halved."""

AROUND, AROUND_EACH = 4096, 64
"""Maximum number of cells of a grid, and of those for each object: where the field must be exact far from all objects,
cells are larger."""

CUT = 0.25
"""Values of a hard union are exact up to this fraction of the edge of a cell, at least. Measured: see docs/scale.md."""

ROUNDING = 2.0**-20
"""Allowance for float32, relative to the largest coordinate: a point may count to the neighbouring cell."""

BRANCH = 0.0
"""In the second channel of a cell: its children begin at the index in the first channel. Above 0 it is the number of
objects, and the first channel is the start of their list. Below 0 the first channel is the field at the centre."""
FAR = -1.0


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """A grid of cells.

    low : corner of the grid, shape (3,). size : edge of a cell. counts : cells along each axis.
    depth : number of times that cells are halved at most.
    texels : shape (n, 2), see `BRANCH`; the cells of the grid, x first, then blocks of eight children.
    starts : where the lists of those cells begin, in the order of their texels.
    lists : the objects of each list, as numbers of rows, ascending by form, or by their order in a blend.
    merges : for each entry of a list, the number of folds that follow it; empty for a hard union.
    most : length of the longest list. stack : number of values that a blend holds at once.
    unbounded : start and length of the list of all unbounded objects of a blend.
    inner_low, inner_high, steepness : outside the grid the field is at least the smaller of the blend of all unbounded
        objects and steepness * distance to this box - less.
    need, cut : in a cell of edge e whose objects are listed, objects that are not listed are at least at the distance
        need + cut * e - |p - c|, c the centre; infinite in a blend.
    """

    low: Array
    size: float
    counts: Whole
    depth: int
    texels: NDArray[np.float32]
    starts: Whole
    lists: NDArray[np.int32]
    merges: NDArray[np.uint8]
    most: int
    stack: int
    unbounded: tuple[int, int]
    inner_low: Array
    inner_high: Array
    steepness: float
    less: float
    need: float
    cut: float

    def widened(self, n: int) -> Cells:
        """The same cells with limits that hold wherever n bounded objects are."""
        stack = int(np.ceil(np.log2(max(n, 2)))) + 1 if self.stack else 0
        return replace(self, depth=FINEST_LIVE, most=n, stack=stack, unbounded=(0, 0))


class Builder:
    def __init__(self, rows: Rows, exact: float, prices: Prices = STANDARD) -> None:
        self.rows, self.prices = rows, prices
        self.forms = rows.forms
        self.firsts = np.cumsum([0, *map(len, rows.forms)])
        lower = np.concatenate([form.lower for form in self.forms])
        upper = np.concatenate([form.upper for form in self.forms])
        lipschitz = np.concatenate([form.lipschitz for form in self.forms])
        spread = np.concatenate([form.spread for form in self.forms])
        exactly = np.concatenate([np.full(len(form), form.exact) for form in self.forms])
        self.blended = bool(rows.family)
        self.finest = FINEST_LIVE if rows.live else FINEST
        self.bounded = np.all(np.isfinite(lower) & np.isfinite(upper), axis=1)
        self.reach, self.lowers = 0.0, 0.0
        if self.blended:
            self.reach = REACH[rows.family] * rows.k
            operands = 1 + max(int(form.order.max()) for form in rows.forms)  # of the tree, also those of other rows
            self.lowers = 0.25 * rows.k * np.ceil(np.log2(max(operands, 2)))
            a, b, k = var("a", FLOAT), var("b", FLOAT), var("k", FLOAT)
            folded = FAMILIES[rows.family](4).fold(a, b, k)
            self._fold = evaluator([folded], [a, b, k])
        low, high = lower[self.bounded].min(axis=0), upper[self.bounded].max(axis=0)
        extent = high - low
        edges = np.maximum(extent, 0.02 * extent.max())
        n = int(self.bounded.sum())
        self.steepness = (
            1.0 if bool(np.all(exactly[self.bounded])) else 1.0 / (np.sqrt(3.0) * float(spread[self.bounded].max()))
        )
        # An unbounded operand nearer than that decides alone, however the rest is blended.
        self.less = (self.reach + (2.0 if not self.bounded.all() else 1.0) * self.lowers) if self.blended else 0.0
        self.fine = n <= prices.fine_objects and not self.blended and not rows.live
        size = float(np.cbrt(np.prod(edges) / (n * (prices.fine_cells if self.fine else 1))))
        size = max(size, float(np.cbrt(np.prod(edges) / CELLS)), float(extent.max()) / 1024.0)
        # In smaller cells, rounding leaves all objects around a point in doubt.
        smallest = 8.0 * ROUNDING * float(np.abs([low, high]).max())
        size = max(size, smallest)
        self.need = exact
        most = min(CELLS, AROUND + AROUND_EACH * n)
        pad = 0.5 * size + (exact + self.less) / self.steepness
        self.inner_low, self.inner_high = low, high
        counts = np.ceil((extent + 2.0 * pad) / size).astype(np.int64)
        while np.prod(counts.astype(float)) > most:
            size *= 1.26
            counts = np.ceil((extent + 2.0 * pad) / size).astype(np.int64)
        self.size, self.counts = size, counts
        if size < smallest * 2.0**self.finest:
            self.finest = int(np.log2(size / smallest))
        self.low = 0.5 * (low + high) - 0.5 * size * counts
        self.largest = float(np.max(np.abs([self.low, self.low + size * counts])))
        self._read_objects(lower, spread, lipschitz, bool(np.all(exactly)))

    def _read_objects(self, lower: Array, spread: Array, lipschitz: Array, exact: bool) -> None:
        """What bounds the values of each object in a cell: its sphere, the value there, and its slopes."""
        held = self.bounded
        middle = np.zeros_like(lower)
        radii = np.full(len(held), np.inf)
        with np.errstate(invalid="ignore"):  # of unbounded objects
            balls = [form.spheres for form in self.forms]
        middle[held] = np.concatenate([centre for centre, _ in balls])[held]
        radii[held] = np.concatenate([radius for _, radius in balls])[held]
        self.spheres = np.concatenate([middle, radii[:, None]], axis=1).astype(np.float32)
        self.at_middle = self.values(middle, np.arange(len(self.rows))).astype(np.float32)
        self.all_exact = exact
        self.flatness = (1.0 / (np.sqrt(3.0) * spread)).astype(np.float32)
        self.slopes = lipschitz.astype(np.float32)
        self.sloped = bool(np.any(lipschitz != 1.0))
        self.lipschitz = lipschitz if self.sloped else np.ones(0)
        if self.blended:
            self.order = np.concatenate([form.order for form in self.forms])
            self.ranked = np.argsort(self.order, kind="stable")

    # Values

    def values(self, points: NDArray[Any], items: NDArray[np.integer], dtype: Any = np.float64) -> Array:
        """The distance of each point to its object; in float32 the error is below `ROUNDING`."""
        result = np.empty(len(items), dtype)
        for begin in range(0, len(items), PAIRS):
            some = slice(begin, begin + PAIRS)
            at, rows = points[some], items[some]
            if len(self.forms) == 1:
                result[some] = self.forms[0].columns.distance(at, rows, dtype)
                continue
            form_of = np.searchsorted(self.firsts, rows, side="right") - 1
            for i, form in enumerate(self.forms):
                mine = np.nonzero(form_of == i)[0]
                if len(mine):
                    result[begin + mine] = form.columns.distance(at[mine], rows[mine] - self.firsts[i], dtype)
        return result

    def radius(self, size: float) -> float:
        """Half the diagonal of a cell, with an allowance for rounding."""
        return float(0.5 * np.sqrt(3.0) * size + ROUNDING * self.largest)

    def far_from(self, size: float) -> float:
        """The value at the centre from which a cell is far."""
        radius = self.radius(size)
        return max(2.0 * radius, self.need + radius) if self.blended else self.need + CUT * size + radius

    def listed_to(self, size: float, last: bool) -> float:
        """The value at the centre up to which a cell of a hard union lists objects. Cells above the grid list more, so
        that the bounds of far cells below them are large."""
        return self.far_from(size) + (0.0 if last else 2.0 * self.radius(size))

    # Levels

    def run(self) -> Cells:
        halvings = max(0, int(np.ceil(np.log2(max(1, self.counts.max())))) - 1)
        items = self.ranked if self.blended else np.arange(len(self.rows))
        level = Level(np.zeros((1, 3), np.int32), np.array([0, len(items)]), items.astype(np.int32))  # one cell of all
        texels = np.zeros((int(np.prod(self.counts)), 2), np.float32)
        for left in reversed(range(halvings + 1)):
            limit = np.ceil(self.counts / 2**left).astype(np.int64)
            below, _, cells, _, value = self.divided(level, self.size * 2**left, limit, last=left == 0)
            if left < halvings and crowded(below, level, self.prices.halved):
                return self.coarser(left + 1).run()
            level = below
            self.paint(texels, cells, value, left)
        grid_level = [level]
        del below, level
        return self.refined(texels, grid_level.pop())  # which frees it: its lists are long

    def coarser(self, halvings: int) -> Builder:
        """The same builder, of a grid whose cells are halved so many times less often."""
        self.size *= 2**halvings
        self.counts = np.ceil(self.counts / 2**halvings).astype(np.int64)
        self.largest = float(np.max(np.abs([self.low, self.low + self.size * self.counts])))
        return self

    def paint(self, texels: NDArray[np.float32], far: Indices, value: Array, left: int) -> None:
        """Store the bound of far cells in all cells of the grid that they cover."""
        width = 2**left
        extents = np.minimum(width, self.counts)  # the grid may be thinner than the cell
        covered = int(np.prod(extents))
        for first in range(0, covered, PAIRS):
            some = np.arange(first, min(first + PAIRS, covered))
            offsets = np.stack(np.unravel_index(some, extents.tolist()), axis=-1)
            distance = self.size * np.linalg.norm(offsets + 0.5 - 0.5 * width, axis=1)
            block = max(1, PAIRS // len(offsets))
            for i in range(0, len(far), block):
                cells = far[i : i + block, None, :] * width + offsets
                bound = self.rounded_down(value[i : i + block, None] - distance)
                inside = np.all(cells < self.counts, axis=2)
                index = self.index(cells[inside])
                texels[index, 0] = bound[inside]
                texels[index, 1] = FAR

    def rounded_down(self, bound: Array) -> Array:
        return bound - (2.0**-22 * np.abs(bound) + 2.0**-22 * self.largest)

    def index(self, cells: NDArray[np.integer[Any]]) -> Whole:
        return cells[..., 0] + self.counts[0] * (cells[..., 1] + self.counts[1] * cells[..., 2])

    def divided(
        self, level: Level, size: float, limit: Whole | None, last: bool
    ) -> tuple[Level, Whole, Indices, Whole, Array]:
        """The children of cells: the near ones, with shorter lists, and their numbers among all children; the far ones
        of the grid, their numbers, and a lower bound of the field at the centre of each. Those beyond the limit are
        neither.

        limit : number of cells along each axis; None below the grid. last : True for the cells of the grid and below.
        """
        near, far = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        near_cells, far_cells = [np.empty((0, 3), np.int32)], [np.empty((0, 3), np.int32)]
        lengths, items, values = [np.empty(0, np.int64)], [np.empty(0, np.int32)], [np.empty(0)]
        count = 0
        # Objects that the parent does not list are at least so far from the centre of a child.
        unlisted = np.inf if self.blended else self.listed_to(2.0 * size, limit is None) - self.radius(size)
        for part in parts(level):
            below = (2 * part.cells[:, None, :] + CORNERS).reshape(-1, 3)
            inside = np.ones(len(below), bool) if limit is None else np.all(below < limit, axis=1)
            centres = self.low + size * (below + 0.5)
            counts, kept, floor = (self.pruned if self.blended else self.children)(part, size, inside)
            if last and not self.blended:
                owner = np.repeat(np.arange(len(below)), counts)
                counts, kept, floor = self.decided(owner, counts, kept, centres, size, floor)
            floor = np.minimum(floor, unlisted)
            lonely = inside & (floor >= self.far_from(size))
            listed = inside & ~lonely
            near.append(count + np.nonzero(listed)[0])
            far.append(count + np.nonzero(lonely)[0])
            values.append(floor[lonely])
            items.append(kept[np.repeat(listed, counts)])
            lengths.append(counts[listed])
            near_cells.append(below[listed])
            if limit is not None:  # below the grid, their numbers are enough
                far_cells.append(below[lonely])
            count += len(below)
        starts = np.concatenate([[0], np.cumsum(joined(lengths))]).astype(np.int64)
        made = Level(joined(near_cells), starts, joined(items))
        return made, joined(near), joined(far_cells), joined(far), joined(values)

    def pruned(self, part: Level, size: float, inside: NDArray[np.bool_]) -> tuple[Whole, NDArray[np.int32], Array]:
        """As `children`, for the operands of a blend."""
        counts = np.where(inside, np.repeat(np.diff(part.starts), 8), 0)
        items = part.items[ranges(np.repeat(part.starts[:-1], 8), counts, np.concatenate([[0], np.cumsum(counts)]))]
        owner = np.repeat(np.arange(len(counts)), counts)
        centres = self.low + size * ((2 * part.cells[:, None, :] + CORNERS).reshape(-1, 3) + 0.5)
        kept, value = self.deciding(items, owner, self.values(centres[owner], items), self.radius(size))
        floor = np.full(len(counts), np.inf)
        floor[counts > 0] = value
        return np.bincount(owner[kept], minlength=len(counts)), items[kept], floor

    def children(self, part: Level, size: float, inside: NDArray[np.bool_]) -> tuple[Whole, NDArray[np.int32], Array]:
        """The lists of the eight children of cells by bounds from spheres: lengths, items, and a lower bound of the
        field at each centre.

        With a from the parent's centre to that of the object, and a child's centre at h s, s a corner of the cube:
        |a - h s|^2 = |a|^2 - 2 h a s + 3 h^2. So the arrays are gathered once for all children.
        """
        first, parents = part.starts[:-1], len(part.cells)
        owner = np.repeat(np.arange(parents), np.diff(part.starts))
        spheres = self.spheres[part.items]
        middles = (self.low + 2.0 * size * (part.cells + 0.5)).astype(np.float32)
        away = np.ascontiguousarray((spheres[:, :3] - middles[owner]).T)
        radii, at_middle, h = spheres[:, 3], self.at_middle[part.items], np.float32(0.5 * size)
        squares = (away * away).sum(axis=0) + 3.0 * h * h
        allowance = np.float32(2e-3 * size + 4.0 * ROUNDING * self.largest)
        slopes = self.slopes[part.items] if self.sloped else np.float32(1.0)
        slack = slopes * np.float32(self.radius(size)) + allowance
        listed_to = np.float32(self.listed_to(size, False)) + allowance
        counts = np.empty((parents, 8), np.int64)
        floors = np.empty((parents, 8))
        chosen = []
        for k, (x, y, z) in enumerate(CORNERS):
            along = sum((axis if s else -axis) for axis, s in zip(away, (x, y, z), strict=True))
            reach = np.sqrt(np.maximum(squares - (2.0 * h) * along, 0.0))
            lower = reach - radii
            if not self.all_exact:
                lower = np.where(lower > 0.0, lower * self.flatness[part.items], -np.inf).astype(np.float32)
            limit = np.minimum.reduceat(reach * slopes + at_middle + slack, first)
            kept = (lower - slack <= limit[owner]) & (lower <= listed_to) & inside[8 * owner + k]
            chosen.append(np.nonzero(kept)[0])
            counts[:, k] = np.add.reduceat(kept, first)
            floors[:, k] = np.minimum.reduceat(lower, first) - allowance
        starts = np.concatenate([[0], np.cumsum(counts.ravel())])
        items = np.empty(starts[-1], np.int32)
        for k, rows in enumerate(chosen):
            before = np.cumsum(counts[:, k]) - counts[:, k]
            mine = owner[rows]
            items[starts[8 * mine + k] + np.arange(len(rows)) - before[mine]] = part.items[rows]
        return counts.ravel(), items, floors.ravel()

    def decided(
        self, owner: Whole, counts: Whole, items: NDArray[np.int32], centres: Array, size: float, floor: Array
    ) -> tuple[Whole, NDArray[np.int32], Array]:
        """Lists by the values at the centres: lengths, items, and the field at each centre; cells without a list keep
        their bound."""
        if not len(items):
            return counts, items, floor
        radius = self.radius(size)
        value = self.values(centres.astype(np.float32)[owner], items, np.float32)
        held = np.nonzero(counts)[0]
        first = (np.cumsum(counts) - counts)[held]
        slack: Any = self.lipschitz[items] * radius if self.sloped else radius
        limit = np.full(len(counts), np.inf)
        limit[held] = np.minimum.reduceat(value + slack, first) + 2.0 * ROUNDING * self.largest
        kept = (value - slack <= limit[owner]) & (value <= self.listed_to(size, True) + 2.0 * ROUNDING * self.largest)
        floor = floor.copy()
        nearest = np.minimum.reduceat(value, first) - ROUNDING * self.largest
        floor[held] = np.minimum(nearest, self.listed_to(size, False))  # `children` does not list others
        return np.bincount(owner[kept], minlength=len(counts)), items[kept], floor

    def deciding(
        self, items: NDArray[np.int32], owner: Whole, value: Array, radius: float
    ) -> tuple[NDArray[np.bool_], Array]:
        """Which entries can decide the blend in their cell, and a lower bound of the field at each centre: the losing
        side of each fold of the balanced tree is left out.

        owner : the cell of each entry, ascending.
        """
        alive = np.ones(len(owner), bool)
        entry = np.arange(len(owner))
        cell, rank, current = owner, self.order[items], value
        held = len(np.unique(owner))
        margin = 2.0 * radius + self.reach + ROUNDING * self.largest
        k = np.asarray(self.rows.k)
        while len(cell) > held:
            rank = rank >> 1
            left = np.nonzero((rank[1:] == rank[:-1]) & (cell[1:] == cell[:-1]))[0]
            if not len(left):
                continue
            a, b = current[left], current[left + 1]
            dead = np.zeros(len(cell), bool)
            dead[left] = a - b > margin
            dead[left + 1] = b - a > margin
            alive &= ~dead[entry]
            current = current.copy()
            current[left] = self._fold(a, b, k)[0]
            stays = np.ones(len(cell), bool)
            stays[left + 1] = False
            moved = np.cumsum(stays) - 1
            entry = moved[entry]
            cell, rank, current = cell[stays], rank[stays], current[stays]
        return alive, current

    # Refinement and storage

    def refined(self, texels: NDArray[np.float32], level: Level) -> Cells:
        """Halve crowded cells, and store all lists."""
        place = self.index(level.cells)
        blocks: list[NDArray[np.float32]] = [texels]
        written: list[tuple[Whole, Whole, NDArray[np.int32]]] = []
        total, depth, entries = len(texels), 0, len(level.items)
        while True:
            counts = np.diff(level.starts)
            most = self.prices.crowded if entries < MANY else 2 * self.prices.crowded
            too_many = counts > most << (depth + 2 * self.fine)
            if depth == self.finest or not too_many.any() or total >= CELLS or entries >= ENTRIES:
                written.append((place, counts, level.items))
                break
            depth += 1
            parents = np.nonzero(too_many)[0]
            crowd = taken(level, parents)
            near, near_at, _, far_at, value = self.divided(crowd, self.size * 0.5**depth, None, last=True)
            del crowd
            lengths = np.zeros(8 * len(parents), np.int64)
            lengths[near_at] = np.diff(near.starts)
            gain = lengths.reshape(-1, 8).mean(axis=1) <= self.prices.halved * counts[parents]
            split = np.zeros(len(counts), bool)
            split[parents[gain]] = True
            block = np.zeros((8 * len(parents), 2), np.float32)
            block[far_at, 0] = self.rounded_down(value)
            block[far_at, 1] = FAR
            wins = np.repeat(gain, 8)
            blocks.append(block[wins])
            del block, far_at, value, lengths
            at = total + np.cumsum(wins) - 1
            write(blocks[:-1], place[parents[gain]], np.stack([at[::8][gain], np.zeros(int(gain.sum()))], axis=1))
            rest = taken(level, np.nonzero(~split)[0])
            written.append((place[~split], np.diff(rest.starts), rest.items))
            chosen = np.nonzero(wins[near_at])[0]
            level = taken(near, chosen)
            place = at[near_at[chosen]]
            del near, rest
            total += int(wins.sum())
            entries += len(level.items) - int(counts[split].sum())
        return self._stored(blocks, written, depth)

    def _stored(
        self, blocks: list[NDArray[np.float32]], written: list[tuple[Whole, Whole, NDArray[np.int32]]], depth: int
    ) -> Cells:
        """The cells with all lists. written : texels, lengths of lists, and their items, which are freed."""
        places = np.concatenate([w[0] for w in written])
        counts = np.concatenate([w[1] for w in written])
        items = np.empty(int(counts.sum()), np.int32)
        end = len(items)
        while written:  # the last first, each of which is freed
            some = written.pop()[2]
            items[end - len(some) : end] = some
            end -= len(some)
        starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        write(blocks, places, np.stack([starts[:-1], counts], axis=1))
        begins = starts[:-1][np.argsort(places)]
        merges, stack, unbounded = np.empty(0, np.uint8), 0, (len(items), 0)
        if self.blended:
            others = self.ranked[~self.bounded[self.ranked]]
            if len(others):
                unbounded = len(items), len(others)
                items, counts = np.concatenate([items, others.astype(np.int32)]), np.append(counts, len(others))
                starts = np.append(starts, len(items))
            merges, stack = folds(starts, items, self.order)
        return Cells(
            self.low,
            self.size,
            self.counts,
            depth,
            np.concatenate(blocks),
            begins,
            items,
            merges,
            int(counts.max(initial=0)),
            stack,
            unbounded,
            self.inner_low,
            self.inner_high,
            self.steepness,
            self.less,
            self.need,
            float("inf") if self.blended else CUT + 0.5 * float(np.sqrt(3.0)),
        )
