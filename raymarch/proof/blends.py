"""Smooth blends of many operands: a stretch asks those alone that can change its value.

A blend is a tree of folds of two values. Where little has to be known, groups of operands bound it: see `groups` and
`folds`. Near the surface space is divided into cells, each half as wide as those of the level above. Operands whose
effect in a cell is nearly nothing are left out, and the error is counted. Where the enclosures of both values show that
a fold returns one of them, whatever the other is, the operands of the other are dropped, there and in all smaller
cells. So no box, reach or constant of a definition is taken for granted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.evaluate import Program
from raymarch.expr.function import Function
from raymarch.expr.node import Expr
from raymarch.expr.types import FLOAT
from raymarch.expr.walk import depends_on, substitute, topological
from raymarch.proof.enclosure import ENCLOSURES
from raymarch.proof.folds import SLACK, A, B, Fold, ends_of, span_of
from raymarch.proof.groups import Groups
from raymarch.proof.rays import Whole, picked
from raymarch.proof.rounding import ZERO, Array, Interval, down, up
from raymarch.proof.span import Span, constant, now, stretches
from raymarch.truth.large import numbered_forms

MANY = 32
"""Least number of operands of a blend that is divided into cells."""

FEW = 6
"""Operands of a cell that is not divided."""

MOST = 96
"""Operands of a cell whose stretches are not evaluated, but halved."""

DEEPEST = 10
"""Levels of cells."""

SHARED = 7
"""Levels of cells in which many rays meet. Finer ones are made in cells with more than `MOST` operands alone."""

ROWS = 1 << 12
"""Operands evaluated at once: their arrays then stay in the CPU cache."""

PAIRS = 1 << 15
"""Operands of all cells that are made at once, for the same reason."""

COARSER = 2
"""Levels by which the first cells are above those of edge / sqrt(n), which hold one of n operands of a surface each."""

FAINT = 16.0
"""Operands are left out of a cell if they are so many widths of the fold above the nearest one."""

NEARER = 0.8
"""Groups that lie this much nearer than an operand are divided, for bounds of the value."""

FOLDS = 1 << 30
"""A height above all folds."""


@dataclass(frozen=True, slots=True)
class Tree:
    """A tree of folds, whose leaves have the numbers 0 to n - 1 in order. A leaf has the height 0.

    fold : of a and b. leaves : n expressions. above : the height of the fold that joins leaves i and i + 1, as a table
    of maxima: row k over 2^k neighbours, (rows, n - 1).
    """

    fold: Expr
    leaves: Sequence[Expr]
    above: Whole

    @classmethod
    def of(cls, body: Expr, params: Sequence[Expr]) -> Tree | None:
        """The folds of one function at the top of an expression; None for another expression, and for few operands."""
        if body.op != "call" or len(body.args) < 2 or any(arg.type is not FLOAT for arg in body.args):
            return None
        fixed = body.args[2:]
        if not depends_on(fixed, params).isdisjoint(fixed):
            return None

        def inner(node: Expr) -> bool:
            return node.op == "call" and node.data is body.data and node.args[2:] == fixed

        leaves: list[Expr] = []
        gaps: list[int] = []  # the height of the fold that joins each leaf and the next one
        stack: list[tuple[Expr, int | None]] = [(body, None)]
        heights: list[int] = []
        while stack:
            node, last = stack.pop()
            if not inner(node):
                leaves.append(node)
                gaps.append(0)
                heights.append(0)
            elif last is None:  # the first argument, the number of its last leaf, the second one
                stack += [(node, -1), (node.args[1], None), (node, -2), (node.args[0], None)]
            elif last == -2:
                heights.append(len(leaves) - 1)
            else:
                right, gap, left = heights.pop(), heights.pop(), heights.pop()
                gaps[gap] = 1 + max(left, right)
                heights.append(gaps[gap])
        if not MANY <= len(leaves) <= len(topological([body])):  # an expression that is used twice is two leaves
            return None
        definition = body.data
        fold = substitute([definition.body], dict(zip(definition.params, (A, B, *fixed), strict=True)))[0]
        return cls(fold, leaves, _maxima(np.array(gaps[:-1])))

    def joined_at(self, first: Whole, second: Whole) -> Whole:
        """The height of the fold that joins some leaves with later ones."""
        row = np.frexp(second - first)[1] - 1
        return np.maximum(self.above[row, first], self.above[row, second - (1 << row)])


def _maxima(values: Whole) -> Whole:
    """Row k has the maxima of 2^k neighbours, from each on."""
    rows = [values]
    while 2 << (len(rows) - 1) <= len(values):
        step, last = 1 << (len(rows) - 1), rows[-1]
        rows.append(np.concatenate([np.maximum(last[:-step], last[step:]), last[-step:]]))
    return np.stack(rows)


class Blend:
    """The enclosures of a blend of many operands.

    lower, upper : corners of a box around the solid, (3,); cells are parts of a cube around it.
    """

    def __init__(self, tree: Tree, params: Sequence[Expr], lower: Array, upper: Array) -> None:
        self._tree = tree
        self._fold = Fold(tree.fold)
        fields = [Function("operand", tuple(params), leaf) for leaf in tree.leaves]
        found, self._form_of, self._row_of = numbered_forms(fields)
        self._forms = [
            (Program([body], own, ENCLOSURES), [np.asfortranarray(column) for column in columns])
            for body, own, columns in found
        ]
        leaves = [np.flatnonzero(self._form_of == number) for number in range(len(found))]
        self._groups = Groups([(*form, own) for form, own in zip(self._forms, leaves, strict=True)])
        self._corner, self._edge = lower, float(np.max(upper - lower))
        self._first = min(max(int(np.ceil(0.5 * np.log2(len(fields)))) - COARSER, 1), DEEPEST)
        fold, height = self._fold, int(tree.above.max())
        self._error = height * (fold.trace + (fold.excess if fold.excess < np.inf else 0.0)) + 1e-290
        self._sag, self._rise = height * fold.sag + self._error, height * fold.rise + self._error
        self._spare = FAINT * fold.width
        if np.isinf(fold.width):
            self._spare = height * (fold.reach + fold.sag) + self._error
        self._slack = SLACK ** (height + 1)
        self._numbers: list[dict[int, int]] = [{} for _ in range(DEEPEST + 1)]
        self._kept: list[Whole] = [np.zeros(0, np.int64)]
        self._ranges = np.array([[-np.inf, np.inf]])
        self._lost = np.zeros(1)
        self._count = np.array([FOLDS])  # of the cell that is all of space

    def enclose(self, points: Span) -> Span:
        """The value on some stretches. Those in cells with many operands have bounds by groups of them, and those in
        cells without a surface the range of their cell."""
        n, before, behind = len(now.before), now.before, now.behind
        jumps, now.jumps = now.jumps, None  # the operands depend on the stretches, and with them the jumps
        given = (points.low, points.high, *points.at, *(points.slope or ZERO))
        ends = [np.broadcast_to(end, (n, 3)) for end in given]
        cells = self._cells(ends[0], ends[1])
        low, high = self._ranges[cells].T
        result = np.stack([low, high, low, high, np.full(n, -np.inf), np.full(n, np.inf)])
        crossed, few = (low <= 0.0) & (high >= 0.0), self._count[cells] <= MOST
        far = np.flatnonzero(crossed & ~few)
        if len(far):
            result[:, far] = self._bounds([picked(end, far) for end in ends], before[far], behind[far])
        asked = np.flatnonzero(crossed & few)
        if len(asked):
            position, leaves = self._pairs(cells[asked])
            owner = asked[position]
            values = self._operands(ends, owner, leaves, before, behind)
            for first, second in self._climb(owner, leaves):
                rows = owner[first]
                values[:, first] = self._fold(values[:, first], values[:, second], before[rows], behind[rows])
            result[:, asked] = values[:, np.flatnonzero(np.diff(position, prepend=-1))]
        result[::2][:2] -= up(self._error + self._lost[cells])
        result[1::2][:2] += self._error
        np.fmax(result[0], low, out=result[0])
        np.fmin(result[1], high, out=result[1])
        now.jumps = jumps
        return span_of(result)

    def _bounds(self, ends: Sequence[Array], before: Array, behind: Array) -> Array:
        """The ends of the value by those of groups of operands, (6, N), or (2, N) of boxes."""
        n, done, middle = len(before), [], 2 % len(ends)
        high = np.full((len(ends), n), np.inf)

        def near(owner: Whole, values: Array, count: int) -> NDArray[np.bool_]:
            """Groups to divide: those that may reach the surface, and are much nearer than an operand is."""
            for k in {1, middle + 1}:
                np.minimum.at(high[k], owner, values[k])
            divided = (values[0] <= 4.0 * self._fold.sag) & (values[middle] < NEARER * high[middle + 1][owner])
            divided &= count > 1
            done.append((owner[~divided], values[:, ~divided], np.full((~divided).sum(), count)))
            return divided

        self._groups.walk(ends, before, behind, near)
        owner, values, count = (np.concatenate(each, axis=-1) for each in zip(*done, strict=True))
        result = high
        for k in {0, middle}:
            result[k] = down(self._joint(owner, values[k], count, n) - self._error)
            result[k + 1] = up(high[k + 1] + self._rise)
        for k, least in ((4, np.minimum), (5, np.maximum)) if len(ends) > 2 else ():
            result[k] = (np.inf, -np.inf)[k % 2]
            least.at(result[k], owner, values[k])
        return result

    def _joint(self, owner: Whole, least: Array, count: Array, n: int) -> Array:
        """A number below the blends of some groups of operands."""
        if np.isfinite(self._fold.width):
            return self._fold.joint(owner, least, count, n)
        found = np.full(n, np.inf)
        np.minimum.at(found, owner, least)
        return found - self._sag

    def _pairs(self, cells: Whole) -> tuple[Whole, Whole]:
        """The operands of cells: the position in `cells` and the operand of each."""
        kept = np.concatenate([self._kept[cell] for cell in cells])
        return np.repeat(np.arange(len(cells)), self._count[cells]), kept

    def _operands(self, ends: Sequence[Array], owner: Whole, operands: Whole, before: Array, behind: Array) -> Array:
        """The ends of the values of N operands, each on one of some stretches: as of `span_of`, (6, N); (2, N) if the
        stretches have two ends alone, which are those of a box.
        """
        result = np.empty((len(ends), len(operands)))
        form_of = self._form_of[operands]
        for number in np.flatnonzero(np.bincount(form_of)):
            program, columns = self._forms[number]
            chosen = np.flatnonzero(form_of == number)
            for i in range(0, len(chosen), ROWS):
                rows = chosen[i : i + ROWS]
                which, own = self._row_of[operands[rows]], owner[rows]
                numbers = [constant(picked(column, which)) for column in columns]
                with stretches(before[own], behind[own]):
                    found = program(span_of([picked(end, own) for end in ends]), *numbers)[0]
                result[:, rows] = ends_of(found, len(rows))[: len(result)]
        return result

    def _climb(self, owner: Whole, leaves: Whole) -> Iterator[tuple[Whole, Whole]]:
        """The folds of some operands of each owner, in order, from the leaves up: the positions of the first values and
        of the second ones. The value of a fold takes the place of its first one; that of an owner is at its first
        operand. A value without another passes through.
        """
        apart = owner[1:] != owner[:-1]
        level = np.full(len(apart), FOLDS)
        level[~apart] = self._tree.joined_at(leaves[:-1][~apart], leaves[1:][~apart])
        order = np.argsort(level, kind="stable")
        heights, begin = np.unique(level[order], return_index=True)
        head = np.arange(len(owner))  # of the last operand of each value: its first one
        tail = head.copy()  # of the first operand: the last one
        for height, gaps in zip(heights, np.split(order, begin)[1:], strict=True):
            if height == FOLDS:
                return
            first, last = head[gaps], tail[gaps + 1]
            head[last], tail[first] = first, last
            yield first, gaps + 1

    def _cells(self, low: Array, high: Array) -> Whole:
        """The smallest known cell, or one that is worth making, around each box; (N,)."""
        cell = np.zeros(len(low), np.int64)
        with np.errstate(divide="ignore", invalid="ignore"):
            levels = np.floor(np.log2(self._edge / np.max(high - low, axis=1)))
        for level in range(self._first, DEEPEST + 1):
            few = FEW if level <= max(SHARED, self._first + COARSER) else MOST
            ranges = self._ranges[cell]
            open_ = (levels >= level) & (self._count[cell] > few) & (ranges[:, 0] <= 0.0) & (ranges[:, 1] >= 0.0)
            rows = np.flatnonzero(open_)
            place = np.floor((low[rows] - self._corner) / (self._edge / 2**level))
            corner, end = self._box(level, place)
            inside = np.all(
                (place >= -2) & (place < 2**level + 2) & (corner <= low[rows]) & (high[rows] <= end), axis=1
            )
            rows, place = rows[inside], place[inside].astype(np.int64) + 2
            if not len(rows):
                break
            codes, which, of = np.unique(place @ CODE, return_index=True, return_inverse=True)
            new = np.array([code not in self._numbers[level] for code in codes], bool)
            codes_, places, parents = codes[new], place[which[new]] - 2.0, cell[rows[which[new]]]
            parts = np.cumsum(np.minimum(self._count[parents], MOST)) // PAIRS
            for some in np.split(np.arange(len(parents)), np.flatnonzero(np.diff(parts)) + 1):
                if len(some):
                    self._make(level, codes_[some], places[some], parents[some])
            cell[rows] = np.array([self._numbers[level][code] for code in codes])[of]
        return cell

    def _box(self, level: int, place: Array) -> Interval:
        """The corners of cells. They overlap: each box of half their edge lies in one of them."""
        edge = self._edge / 2**level
        corner = self._corner + place * edge
        return corner, corner + 2.0 * edge

    def _make(self, level: int, codes: Whole, place: Array, parents: Whole) -> None:
        """Cells of a level in some cells of the level above."""
        margin = 1e-6 * self._edge / 2**level  # half of that of the level above, so that each cell lies in its own
        box = [
            np.asfortranarray(end + off) for end, off in zip(self._box(level, place), (-margin, margin), strict=True)
        ]
        zero = np.zeros(len(parents))
        if level == self._first:
            bounds = self._bounds(box, zero, zero)
            crossed = np.flatnonzero(bounds[0] <= 0.0)
            owner, operands, values, lost = self._listed(box, crossed, bounds[1])
        else:
            bounds, crossed, lost = self._ranges[parents].T, np.arange(len(parents)), self._lost[parents]
            owner, operands = self._pairs(parents)
            values = self._operands(box, owner, operands, zero, zero)
        end, drops = np.arange(1, len(owner) + 1), np.zeros(len(owner) + 1, np.int64)
        for first, second in self._climb(owner, operands):
            a, b = values[:, first], values[:, second]
            for won, begin, behind in (
                (self._fold.drops(b, a), first, second),
                (self._fold.drops(a, b), second, end[second]),
            ):
                drops[begin[won]] += 1
                drops[behind[won]] -= 1
            values[:, first] = self._fold(a, b, zero[owner[first]], zero[owner[first]])
            end[first] = end[second]
        kept = np.cumsum(drops[:-1]) == 0
        counts = np.bincount(owner[kept], minlength=len(codes))
        self._numbers[level] |= zip(codes.tolist(), range(len(self._kept), len(self._kept) + len(codes)), strict=True)
        self._kept += np.split(operands[kept], np.cumsum(counts)[:-1])
        ranges = bounds[:2].T.copy()
        whole = values[:, np.flatnonzero(np.diff(owner, prepend=-1))]
        ranges[crossed, 0] = down(whole[0] - self._error - lost[crossed])
        ranges[crossed, 1] = up(whole[1] + self._error)
        self._ranges = np.concatenate([self._ranges, ranges])
        self._lost = np.concatenate([self._lost, lost])
        self._count = np.concatenate([self._count, counts])

    def _listed(self, box: Sequence[Array], some: Whole, most: Array) -> tuple[Whole, Whole, Array, Array]:
        """The operands that may have an effect in some boxes: the box of each, the operand and its ends there; and for
        each box by how much the others may lower the value. most : the value is nowhere above it.

        Let them rise to infinity together: the value rises by at most the sum of their weights, which shrink with the
        width of the fold. Of a fold without one, let m be the least value of an operand. Without all above
        T = m + `_spare`, a value of the tree is the same, or with and without them it is T - (reach + sag) or more for
        each level below it; but at the top it is m or less.
        """
        n, fold, zero = len(box[0]), self._fold, np.zeros(len(some))
        least, lost = np.full(n, np.inf), np.zeros(n)

        def near(owner: Whole, values: Array, count: int) -> NDArray[np.bool_]:
            rows = some[owner]
            np.minimum.at(least, rows, values[1])
            top = np.minimum(most, up(least + self._rise))[rows]
            kept = values[0] <= top + self._spare
            if np.isfinite(fold.width):
                weights = fold.weights(values[0, ~kept], top[~kept])
                lost[:] += np.bincount(rows[~kept], weights, n) * (count * fold.width * self._slack)
            return kept

        owner, operands, values = self._groups.walk([picked(end, some) for end in box], zero, zero, near)
        order = np.lexsort((operands, owner))
        order = order[near(owner[order], values[:, order], 1)]
        return some[owner[order]], operands[order], values[:, order], up(lost)


CODE = np.array([1, 1 << 20, 1 << 40])
"""Weights of the places of a cell, of which one number is made."""
