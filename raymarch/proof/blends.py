"""Smooth blends of many operands: a stretch asks those alone that can change its value.

A blend is a tree of folds of two values. Space is divided into cells, each half as wide as those of the level above.
Where the enclosures of both values over a cell show that a fold returns one of them, whatever the other is, the
operands of the other are dropped, there and in all smaller cells. So nothing is left out that has an effect, and no
box, reach or constant of a definition is taken for granted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.evaluate import Program
from raymarch.expr.function import Function
from raymarch.expr.node import Expr, var
from raymarch.expr.types import FLOAT
from raymarch.expr.walk import depends_on, rebuild, rewrite, substitute, topological
from raymarch.proof.enclosure import ENCLOSURES
from raymarch.proof.rays import Whole
from raymarch.proof.rounding import ZERO, Array, Interval
from raymarch.proof.span import Span, constant, now, still, stretches
from raymarch.truth.large import numbered_forms

MANY = 32
"""Least number of operands of a blend that is divided into cells."""

FEW = 6
"""Operands of a cell that is not divided."""

MOST = 96
"""Operands of a cell whose stretches are not evaluated, but halved."""

DEEPEST = 10
"""Levels of cells."""

ROWS = 1 << 12
"""Operands evaluated at once: their arrays then stay in the CPU cache."""

PAIRS = 1 << 15
"""Operands of all cells that are made at once, for the same reason."""

FAR = 1e30
"""A value beyond the reach of a fold that has one."""

FOLDS = 1 << 30
"""A height above all folds."""

_A, _B = var("a", FLOAT), var("b", FLOAT)


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
        fold = substitute([definition.body], dict(zip(definition.params, (_A, _B, *fixed), strict=True)))[0]
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


class Winner:
    """Shows where a fold is one of its values, by the operands that its minima and maxima choose.

    first : True for a, False for b.
    """

    def __init__(self, fold: Expr, first: bool) -> None:
        self._choices = [node for node in topological([fold]) if node.op in ("min", "max")]
        ends = [arg for node in self._choices for arg in node.args]
        self._program = Program(ends, [_A, _B], ENCLOSURES)
        self._first = first
        low, high = np.zeros(1), np.full(1, FAR)
        a, b = (low, high) if first else (high, low)
        self._wins = np.zeros(len(self._choices), np.int64)
        chosen = self._chosen((a, a), (b, b))
        self._wins = 1 - np.all(chosen, axis=1) * 1
        number = {node: i for i, node in enumerate(self._choices)}

        def rule(node: Expr, args: tuple[Expr, ...]) -> Expr:
            return args[self._wins[number[node]]] if node in number else rebuild(node, args) if node.args else node

        left, own = rewrite([fold], rule)[fold], _A if first else _B
        if left.op == "sub" and left.args[0] is own and left.args[1] not in depends_on([left], [_A, _B]):
            rest = Program([left.args[1]], [], ENCLOSURES)()[0]
            left = own if np.all(rest.low == 0.0) and np.all(rest.high == 0.0) else left
        self.known = left is own

    def _chosen(self, a: Interval, b: Interval) -> NDArray[np.bool_]:
        """Whether each choice certainly falls on its operand, (choices, N)."""
        ends = self._program(still(a), still(b))
        found = []
        for i, node in enumerate(self._choices):
            pair = ends[2 * i : 2 * i + 2]
            one, other = (pair[k].range for k in (self._wins[i], 1 - self._wins[i]))
            found.append(one[1] <= other[0] if node.op == "min" else other[1] <= one[0])
        return np.array([np.broadcast_to(each, np.shape(a[0])) for each in found], bool).reshape(len(found), -1)

    def wins(self, a: Interval, b: Interval) -> NDArray[np.bool_]:
        """Where the fold of values in these ranges is certainly the one, (N,)."""
        if not self.known:
            return np.zeros(len(a[0]), bool)
        found = self._apart(a, b)
        rows = np.flatnonzero(found)
        with stretches(np.zeros(len(rows)), np.zeros(len(rows))):
            found[rows] = self._chosen((a[0][rows], a[1][rows]), (b[0][rows], b[1][rows])).all(axis=0)
        return found

    def _apart(self, a: Interval, b: Interval) -> NDArray[np.bool_]:
        """Where the one is below the other, as it must be in the case that was looked at."""
        return a[1] < b[0] if self._first else b[1] < a[0]


class Blend:
    """The enclosures of a blend of many operands.

    lower, upper : corners of a box around the solid, (3,); cells are parts of a cube around it.
    """

    def __init__(self, tree: Tree, params: Sequence[Expr], lower: Array, upper: Array) -> None:
        self._tree = tree
        self._fold = Program([tree.fold], [_A, _B], ENCLOSURES)
        self._winners = Winner(tree.fold, True), Winner(tree.fold, False)
        fields = [Function("operand", tuple(params), leaf) for leaf in tree.leaves]
        found, self._form_of, self._row_of = numbered_forms(fields)
        self._forms = [(Program([body], own, ENCLOSURES), columns) for body, own, columns in found]
        self._corner, self._edge = lower, float(np.max(upper - lower))
        self._numbers: list[dict[int, int]] = [{} for _ in range(DEEPEST + 1)]
        self._kept: list[Whole] = [np.arange(len(tree.leaves))]
        self._ranges = np.array([[-np.inf, np.inf]])
        self._count = np.array([len(tree.leaves)])

    def enclose(self, points: Span) -> Span:
        """The value on some stretches. Those with too many operands, and in cells without a surface, have the range of
        their cell."""
        n, before, behind = len(now.before), now.before, now.behind
        jumps, now.jumps = now.jumps, None  # the operands depend on the stretches, and with them the jumps
        ends = [np.broadcast_to(end, (n, 3)) for end in (points.low, points.high, *points.at, *(points.slope or ZERO))]
        cells = self._cells(ends[0], ends[1])
        low, high = self._ranges[cells].T
        result = np.stack([low, high, low, high, np.full(n, -np.inf), np.full(n, np.inf)])
        count = self._count[cells]
        asked = np.flatnonzero((low <= 0.0) & (high >= 0.0) & (count <= MOST))
        if len(asked):
            position, leaves = self._pairs(cells[asked])
            owner = asked[position]
            values = self._operands(ends, owner, leaves, before, behind)
            for first, second in self._climb(owner, leaves):
                rows = owner[first]
                with stretches(before[rows], behind[rows]):
                    values[:, first] = _ends(
                        self._fold(_span(values[:, first]), _span(values[:, second]))[0], len(rows)
                    )
            result[:, asked] = values[:, np.flatnonzero(np.diff(position, prepend=-1))]
            np.fmax(result[0], low, out=result[0])
            np.fmin(result[1], high, out=result[1])
        now.jumps = jumps
        return _span(result)

    def _pairs(self, cells: Whole) -> tuple[Whole, Whole]:
        """The operands of cells: the position in `cells` and the operand of each."""
        kept = np.concatenate([self._kept[cell] for cell in cells])
        return np.repeat(np.arange(len(cells)), self._count[cells]), kept

    def _operands(self, ends: Sequence[Array], owner: Whole, operands: Whole, before: Array, behind: Array) -> Array:
        """The ends of the values of N operands, each on one of some stretches: as of `_span`, (6, N); (2, N) if the
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
                numbers = [constant(column[which]) for column in columns]
                with stretches(before[own], behind[own]):
                    found = program(_span([end[own] for end in ends]), *numbers)[0]
                result[:, rows] = _ends(found, len(rows))[: len(result)]
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
        for level in range(1, DEEPEST + 1):
            ranges = self._ranges[cell]
            open_ = (levels >= level) & (self._count[cell] > FEW) & (ranges[:, 0] <= 0.0) & (ranges[:, 1] >= 0.0)
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
            parts = np.cumsum(self._count[parents]) // PAIRS
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
        owner, operands = self._pairs(parents)
        margin = 1e-6 * self._edge / 2**level  # half of that of the level above, so that each cell lies in its own
        low, high = (end + off for end, off in zip(self._box(level, place), (-margin, margin), strict=True))
        zero = np.zeros(len(parents))
        values = self._operands([low, high], owner, operands, zero, zero)
        end, drops = np.arange(1, len(owner) + 1), np.zeros(len(owner) + 1, np.int64)
        for first, second in self._climb(owner, operands):
            a, b = ((values[0, rows], values[1, rows]) for rows in (first, second))
            wins = [winner.wins(a, b) for winner in self._winners]
            values[:, first] = np.where(wins[0], a, b)
            rows = np.flatnonzero(~(wins[0] | wins[1]))
            with stretches(np.zeros(len(rows)), np.zeros(len(rows))):
                fold = self._fold(still((a[0][rows], a[1][rows])), still((b[0][rows], b[1][rows])))[0]
            values[:, first[rows]] = fold.range
            for won, begin, behind in ((wins[0], second, end[second]), (wins[1], first, second)):
                drops[begin[won]] += 1
                drops[behind[won]] -= 1
            end[first] = end[second]
        kept = np.cumsum(drops[:-1]) == 0
        counts = np.bincount(owner[kept], minlength=len(codes))
        self._numbers[level] |= zip(codes.tolist(), range(len(self._kept), len(self._kept) + len(codes)), strict=True)
        self._kept += np.split(operands[kept], np.cumsum(counts)[:-1])
        self._ranges = np.concatenate([self._ranges, values.T[np.diff(owner, prepend=-1) > 0]])
        self._count = np.concatenate([self._count, counts])


CODE = np.array([1, 1 << 20, 1 << 40])
"""Weights of the places of a cell, of which one number is made."""


def _span(ends: Sequence[Array] | Array) -> Span:
    """low, high, the two ends of the value at the centre, and those of the slope; without these it is the same all
    along."""
    if len(ends) == 2:
        return still((ends[0], ends[1]))
    return Span(ends[0], ends[1], (ends[2], ends[3]), (ends[4], ends[5]))


def _ends(value: Span, n: int) -> Array:
    """The same of n stretches, (6, n). What is NaN is unknown."""
    found = [np.broadcast_to(end, n) for end in (*value.range, *value.at, *(value.slope or ZERO))]
    return np.stack([np.where(np.isnan(end), (-np.inf, np.inf)[i % 2], end) for i, end in enumerate(found)])
