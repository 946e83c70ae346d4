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

_A, _B = var("a", FLOAT), var("b", FLOAT)


@dataclass(frozen=True, slots=True)
class Tree:
    """A tree of folds. Leaves have the numbers 0 to n - 1 in order, inner nodes follow.

    fold : of a and b. leaves : n expressions. parent : of each node, -1 for the root. height : 0 for leaves.
    """

    fold: Expr
    leaves: Sequence[Expr]
    parent: Whole
    height: Whole

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
        nodes: list[tuple[int, int]] = []  # left and right; leaves are ~number
        stack: list[tuple[Expr, bool]] = [(body, False)]
        made: list[int] = []
        while stack:
            node, done = stack.pop()
            if not inner(node):
                leaves.append(node)
                made.append(~(len(leaves) - 1))
            elif done:
                right, left = made.pop(), made.pop()
                nodes.append((left, right))
                made.append(len(nodes) - 1)
            else:
                stack += [(node, True), (node.args[1], False), (node.args[0], False)]
        if not MANY <= len(leaves) <= len(topological([body])):  # an expression that is used twice is two leaves
            return None
        n = len(leaves)
        parent, height = np.full(n + len(nodes), -1), np.zeros(n + len(nodes), np.int64)
        for number, pair in enumerate(nodes):
            below = [~each if each < 0 else n + each for each in pair]
            parent[below], height[n + number] = n + number, 1 + height[below].max()
        definition = body.data
        fold = substitute([definition.body], dict(zip(definition.params, (_A, _B, *fixed), strict=True)))[0]
        return cls(fold, leaves, parent, height)


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
            owner, leaves = self._pairs(cells[asked])
            owner = asked[owner]
            values = self._operands([end[owner] for end in ends], leaves, before[owner], behind[owner])
            for first, second, rest in self._climb(owner, leaves):
                rows = owner[first]
                with stretches(before[rows], behind[rows]):
                    values[:, first] = _ends(
                        self._fold(_span(values[:, first]), _span(values[:, second]))[0], len(rows)
                    )
                values, owner = values[:, rest], owner[rest]
            result[:, asked] = values
            np.fmax(result[0], low, out=result[0])
            np.fmin(result[1], high, out=result[1])
        now.jumps = jumps
        return _span(result)

    def _pairs(self, cells: Whole) -> tuple[Whole, Whole]:
        """The operands of cells: the position in `cells` and the operand of each."""
        kept = np.concatenate([self._kept[cell] for cell in cells])
        return np.repeat(np.arange(len(cells)), self._count[cells]), kept

    def _operands(self, ends: Sequence[Array], operands: Whole, before: Array, behind: Array) -> Array:
        """The ends of the values of N operands, each on a stretch of its own: as of `_span`, (6, N)."""
        result = np.empty((6, len(operands)))
        form_of = self._form_of[operands]
        for number in np.flatnonzero(np.bincount(form_of)):
            program, columns = self._forms[number]
            chosen = np.flatnonzero(form_of == number)
            for i in range(0, len(chosen), ROWS):
                rows = chosen[i : i + ROWS]
                numbers = [constant(column[self._row_of[operands[rows]]]) for column in columns]
                with stretches(before[rows], behind[rows]):
                    found = program(_span([end[rows] for end in ends]), *numbers)[0]
                result[:, rows] = _ends(found, len(rows))
        return result

    def _climb(self, owner: Whole, node: Whole) -> Iterator[tuple[Whole, Whole, NDArray[np.bool_]]]:
        """The folds of some operands of each owner, from the leaves up: the positions of the first values, of the
        second ones, and which values are left then. A value without another passes through."""
        parent, height = self._tree.parent, self._tree.height
        for level in range(1, int(height.max()) + 1):
            above = parent[node]
            rises = (above >= 0) & (height[above] == level)
            node = np.where(rises, above, node)
            pair = rises[1:] & (node[1:] == node[:-1]) & (owner[1:] == owner[:-1])
            first = np.flatnonzero(pair)
            rest = np.concatenate([[True], ~pair])
            yield first, first + 1, rest
            node, owner = node[rest], owner[rest]

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
        low, high = (end[owner] + off for end, off in zip(self._box(level, place), (-margin, margin), strict=True))
        zero = np.zeros(len(owner))
        values = self._operands([low, high, low, high], operands, zero, zero)[:2]
        begin, end, drops = np.arange(len(owner)), np.arange(1, len(owner) + 1), np.zeros(len(owner) + 1, np.int64)
        owners = owner
        for first, second, rest in self._climb(owner, operands):
            a, b = ((values[0, rows], values[1, rows]) for rows in (first, second))
            wins = [winner.wins(a, b) for winner in self._winners]
            values[:, first] = np.where(wins[0], a, b)
            rows = np.flatnonzero(~(wins[0] | wins[1]))
            with stretches(np.zeros(len(rows)), np.zeros(len(rows))):
                fold = self._fold(still((a[0][rows], a[1][rows])), still((b[0][rows], b[1][rows])))[0]
            values[:, first[rows]] = fold.range
            for won, lost in zip(wins, (second, first), strict=True):
                np.add.at(drops, begin[lost[won]], 1)
                np.add.at(drops, end[lost[won]], -1)
            end[first] = end[second]
            values, begin, end = values[:, rest], begin[rest], end[rest]
        kept = np.cumsum(drops[:-1]) == 0
        counts = np.bincount(owners[kept], minlength=len(codes))
        self._numbers[level] |= zip(codes.tolist(), range(len(self._kept), len(self._kept) + len(codes)), strict=True)
        self._kept += np.split(operands[kept], np.cumsum(counts)[:-1])
        self._ranges = np.concatenate([self._ranges, values.T])
        self._count = np.concatenate([self._count, counts])


CODE = np.array([1, 1 << 20, 1 << 40])
"""Weights of the places of a cell, of which one number is made."""


def _span(ends: Sequence[Array] | Array) -> Span:
    """low, high, the two ends of the value at the centre, and those of the slope; without these it is the same all
    along."""
    slope = (ends[4], ends[5]) if len(ends) > 4 else None
    return Span(ends[0], ends[1], (ends[2], ends[3]), slope)


def _ends(value: Span, n: int) -> Array:
    """The same of n stretches, (6, n). What is NaN is unknown."""
    found = [np.broadcast_to(end, n) for end in (*value.range, *value.at, *(value.slope or ZERO))]
    return np.stack([np.where(np.isnan(end), (-np.inf, np.inf)[i % 2], end) for i, end in enumerate(found)])
