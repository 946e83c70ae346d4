"""What intervals prove of a fold of two values, such as a smooth minimum: from which difference on it is the lesser,
and that it falls with neither.

Asked are folds that rise by as much as both values do. They are a + F(b - a), so all is a question of one number.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from raymarch.expr.evaluate import Program
from raymarch.expr.node import Expr, var
from raymarch.expr.types import FLOAT
from raymarch.expr.walk import topological
from raymarch.proof import rounding as r
from raymarch.proof.enclosure import ENCLOSURES
from raymarch.proof.rays import Whole
from raymarch.proof.rounding import ULP, ZERO, Array, Interval, up
from raymarch.proof.span import Span, spanned, still, stretches

A, B = var("a", FLOAT), var("b", FLOAT)
"""The two values of a fold."""

FAR = 1e30
"""A value beyond the reach of a fold that has one."""

TRACE = 2.0**-46
"""A fold that differs from the lesser value by at most this, over its difference for equal ones, is taken for it, and
the error is counted. So a fold that acts at all distances ends at one."""

SLACK = 1.01
"""Factor of the weights of values, for the width of the parts."""

CELLS = 2048
"""Parts of the reach in which the slope of F is enclosed."""


class Fold:
    """A fold of two values.

    reach : where b is above a by this or more, the fold is a up to the error `trace`, and likewise b; inf if none is
    known.
    sag, rise : the fold is at most so much below the lesser value, and above it; inf if unknown.
    width : of an exponential fold that is nowhere above this one, and of which no value is less in weight but for
    `SLACK`: one that a fold lowers by x has at most the weight exp(-x / width); inf if none is known.
    excess : up to this error the fold falls with neither value, and rises by no more than the one that rises more: the
    slope of F is 0 to 1. inf if unknown.
    """

    def __init__(self, fold: Expr) -> None:
        self._program = Program([fold], [A, B], ENCLOSURES)
        self.reach = self.sag = self.rise = self.width = self.excess = np.inf
        self.trace = 0.0
        if _rise(fold) != 1.0:
            return
        zero = np.zeros(1)
        equal = r.magnitude(self._at((zero, zero), (zero, zero)))[0]
        for self.trace in (1e-300, TRACE * float(equal)):
            self.reach = self._reached()
            if np.isfinite(self.reach):
                self._look()
                break
        if self.trace > 1e-300 and not np.isfinite(self.excess):  # the error might grow
            self.reach = np.inf

    def _at(self, a: Interval, b: Interval) -> Interval:
        zero = np.zeros(len(a[0]))
        with stretches(zero, zero):
            found = self._program(still(a), still(b))[0]
        return np.broadcast_to(found.low, zero.shape), np.broadcast_to(found.high, zero.shape)

    def _reached(self) -> float:
        """The least reach that is shown, of some."""
        tried = np.exp2(np.arange(-1280, 1280) / 16.0)
        for _ in range(6):
            far, zero = (tried, np.full(len(tried), FAR)), np.zeros(len(tried))
            size = [r.magnitude(self._at(*v)) for v in (((zero, zero), far), (far, (zero, zero)))]
            fails = np.flatnonzero(~np.all([each <= self.trace for each in size], axis=0))
            last = fails[-1] + 1 if len(fails) else 0
            if last in (0, len(tried)):
                return np.inf if last else float(tried[0])
            tried = np.linspace(tried[last - 1], tried[last], 65)
        return float(tried[last])

    def _look(self) -> None:
        """Enclose the fold of 0 and d, and of d and 0, on parts of the reach, and the slopes. The part at 0, where
        there is a kink, is as good as a point. The last part is divided towards the reach, where there may be one."""
        even = self.reach * np.linspace(0.0, 1.0, CELLS + 1)
        last = self.reach * (1.0 - np.exp2(-np.arange(11.5, 40.0)))
        edges = np.sort(np.concatenate([even, last, [1e-300]]))
        low, high = edges[:-1], edges[1:]
        middle, one, zero = 0.5 * (low + high), np.ones(len(low)), np.zeros(len(low))
        near, far = still((zero, zero)), Span(low, high, (middle, middle), (one, one))
        with stretches(up(middle - low), up(high - middle)):
            both = [self._program(*pair)[0] for pair in ((near, far), (far, near))]
        ends = np.array([ends_of(each, len(low))[[0, 1, 4, 5]] for each in both])
        self.sag = max(float(-ends[:, 0].min()), self.trace)
        self.rise = max(float(ends[:, 1].max()), self.trace)
        beyond = np.maximum(np.maximum(-ends[:, 2], ends[:, 3] - 1.0), 0.0)
        beyond[:, 0] += 2.0
        total = float(np.sum(beyond * (high - low))) * (1.0 + 1e-6)
        if not total <= TRACE * self.sag < np.inf:
            return
        self.excess, self.rise = total, min(self.rise, total + self.trace)  # F - min(0, d) falls towards 0
        self._find_width(high, ends)
        slopes = np.clip(ends[:, 2:], 0.0, 1.0)
        slopes[:, :, 0] = [1.0, 0.0]
        first = np.searchsorted(low, even[:-1])
        least, most = np.minimum.reduceat(slopes[:, 0], first, axis=1), np.maximum.reduceat(slopes[:, 1], first, axis=1)
        # over all parts up to each, and from each on; beyond the reach the slope is 1, then 0
        self._least = np.minimum.accumulate(np.concatenate([[1.0], 1.0 - most[1, ::-1], least[0], [0.0]]))
        self._most = np.maximum.accumulate(np.concatenate([[0.0], most[0, ::-1], 1.0 - least[1], [1.0]]))[::-1]

    def _find_width(self, high: Array, ends: Array) -> None:
        """The least `width`, of some. ends : of the fold of 0 and d, and of d and 0, and of its slopes in d, where d is
        at most `high`; (2, 4, n)."""
        for width in self.sag * 1.5 * 1.05 ** np.arange(40):
            above = ends[:, 0] >= -width * np.log1p(np.exp(-high / width)) * (1.0 - 1e-9)
            lesser, greater = 1.0 - np.clip(ends[:, 2], 0.0, 1.0), np.clip(ends[:, 3], 0.0, 1.0)
            most = np.stack([lesser * np.exp(-ends[:, 0] / width), greater * np.exp((high - ends[:, 0]) / width)])
            if np.all(above) and np.all(most[:, :, 1:] <= SLACK):
                self.width = float(width)
                return

    def joint(self, owner: Whole, least: Array, count: Array, n: int) -> Array:
        """A number below the folds of all operands of N owners, in any order; (N,), inf without an operand.

        least, count : groups of so many operands, none below `least`. The fold is above an exponential one, of which
        the order does not matter: -width log(sum exp(-value / width)).
        """
        nearest = np.full(n, np.inf)
        np.minimum.at(nearest, owner, least)
        total = np.bincount(owner, count * self.weights(least, nearest[owner]), n)
        return nearest - self.width * np.log(np.maximum(total, 1.0)) * (1.0 + 1e-9)

    def weights(self, values: Array, fold: Array) -> Array:
        """By at most so much a fold of many rises with one of them, over `SLACK` for each fold between: each fold that
        lowers a value by x passes at most exp(-x / width) of its slope on."""
        with np.errstate(invalid="ignore"):
            return np.nan_to_num(np.exp((fold - values) / self.width), nan=1.0)

    def drops(self, a: Array, b: Array) -> Array:
        """Where b, in a range, does not matter beside a; ends first, (2, N)."""
        return (up(a[1] + self.reach) <= b[0]) & (b[1] <= FAR)

    def __call__(self, a: Array, b: Array, before: Array, behind: Array) -> Array:
        """The fold of values, (2, N) or (6, N), as of `raymarch.proof.span.Span`: ends of the range, of the value at
        the centre and of the slope. before, behind : (N,), lengths of the stretches."""
        result = np.where(self.drops(a, b), a, b)
        rows = np.flatnonzero(~self.drops(a, b) & ~self.drops(b, a))
        if len(rows):
            result[:, rows] = self._folded(a[:, rows], b[:, rows], before[rows], behind[rows])
        return result

    def _folded(self, a: Array, b: Array, before: Array, behind: Array) -> Array:
        if not np.isfinite(self.excess):
            with stretches(before, behind):
                return ends_of(self._program(span_of(a), span_of(b))[0], a.shape[1])[: len(a)]
        shape = (min(len(a), 4), a.shape[1])
        x, y = a[: shape[0]].ravel(), b[: shape[0]].ravel()
        low, high = (end.reshape(shape) for end in self._at((x, x), (y, y)))
        low, high = low - up(self.excess + ULP * np.abs(low)), high + up(self.excess + ULP * np.abs(high))
        ends = np.where(np.arange(shape[0])[:, None] % 2, high, low)
        if len(a) == 2:
            return _known(ends)
        weights = self._least[self._part(b[1] - a[0], 1)], self._most[self._part(b[0] - a[1], -1)]
        slope = []
        for k, choose, side in ((4, np.minimum, -1.0), (5, np.maximum, 1.0)):
            mixed = [(1.0 - w) * a[k] + w * b[k] for w in weights]
            slope.append(choose(*mixed) + side * (np.abs(a[k]) + np.abs(b[k])) * (4.0 * ULP))
        with stretches(before, behind):
            return ends_of(spanned(ends[0], ends[1], (ends[2], ends[3]), (slope[0], slope[1])), shape[1])

    def _part(self, difference: Array, beside: int) -> Array:
        """The number of the part with a difference, or of its neighbour, for rounding."""
        place = np.nan_to_num((difference / self.reach + 1.0) * CELLS, nan=-beside * np.inf)
        return (np.clip(np.floor(place), -1, 2 * CELLS) + 1 + beside).clip(0, 2 * CELLS + 1).astype(np.int64)


def _rise(fold: Expr) -> float:
    """By how much an expression rises if both values rise by 1, for any values; NaN if that is not seen."""
    rises: dict[Expr, float] = {A: 1.0, B: 1.0}
    for node in topological([fold]):
        if node in rises:
            continue
        own = [rises[arg] for arg in node.args]
        rise = np.nan
        if not any(own):
            rise = 0.0
        elif node.op in ("min", "max") and own[0] == own[1]:
            rise = own[0]
        elif node.op in ("add", "sub"):
            rise = own[0] + own[1] if node.op == "add" else own[0] - own[1]
        elif node.op == "neg":
            rise = -own[0]
        elif node.op == "mul" and any(arg.op == "const" for arg in node.args):
            factor = next(arg for arg in node.args if arg.op == "const")
            rise = float(factor.data) * own[factor is node.args[0]]
        rises[node] = rise
    return rises[fold]


def span_of(ends: Sequence[Array] | Array) -> Span:
    """low, high, the two ends of the value at the centre, and those of the slope; without these it is the same all
    along."""
    if len(ends) == 2:
        return still((ends[0], ends[1]))
    return Span(ends[0], ends[1], (ends[2], ends[3]), (ends[4], ends[5]))


def ends_of(value: Span, n: int) -> Array:
    """The same of n stretches, (6, n). What is NaN is unknown."""
    return _known(np.stack([np.broadcast_to(end, n) for end in (*value.range, *value.at, *(value.slope or ZERO))]))


def _known(ends: Array) -> Array:
    for i, end in enumerate(ends):
        end[np.isnan(end)] = (-np.inf, np.inf)[i % 2]
    return ends
