"""The values of the reading of expressions along stretches of rays: ranges of value and slope."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from raymarch.expr.arrays import lift
from raymarch.expr.evaluate import Rule
from raymarch.expr.node import Expr
from raymarch.expr.types import Type
from raymarch.proof import rounding as r
from raymarch.proof.rounding import Array, Interval


class Span(NamedTuple):
    """A value along N stretches. All arrays have the shape (N, ...), or lack the first axis.

    low, high : range over the stretch. at : range of the value at the centre. slope : range of the change per length;
    None if the value is the same all along the stretch. Of a condition, low means "always" and high "sometimes".
    """

    low: Array
    high: Array
    at: Interval
    slope: Interval | None

    @property
    def range(self) -> Interval:
        return self.low, self.high


Value: TypeAlias = "Span | tuple[Any, ...]"


class Stretches(threading.local):
    """What is evaluated: how far the stretches go before and behind their centres, (N,) each."""

    before: Array = np.zeros(1)
    behind: Array = np.zeros(1)
    long: bool = False
    """Whether no such length is 0."""
    jumps: list[Array] | None = None
    """For each operation that may jump, in order: where it has two values, (N,) each. None: not asked."""
    sides: Array | None = None
    """For each such operation and each stretch: 0 the first value, 1 the second, -1 both; (operations, N)."""
    count: int = 0
    """The number of such operations so far."""


now = Stretches()


@contextmanager
def stretches(before: Array, behind: Array) -> Iterator[None]:
    """Evaluate stretches that begin `before` their centres and end `behind` them; lengths (N,), rounded up."""
    earlier = now.before, now.behind, now.long
    now.before, now.behind, now.long = before, behind, bool(np.all(before > 0.0) and np.all(behind > 0.0))
    try:
        with np.errstate(all="ignore"):
            yield
    finally:
        now.before, now.behind, now.long = earlier


@contextmanager
def jumping(sides: Array | None = None) -> Iterator[list[Array]]:
    """Ask one evaluation which operations jump; those of which a side is given do not."""
    now.jumps, now.sides, now.count = [], sides, 0
    try:
        yield now.jumps
    finally:
        now.jumps = now.sides = None


def sides_of(two: Array) -> Array | None:
    """The sides of an operation that has one of two values where `two` holds, in its shape; None if none are given."""
    if now.jumps is None:
        return None
    rows = len(now.before)
    wide = np.broadcast_to(two, (rows, *np.shape(two)[1:])) if np.ndim(two) else np.broadcast_to(two, rows)
    flat = wide.reshape(rows, -1)
    first, now.count = now.count, now.count + flat.shape[1]
    if now.sides is None:
        now.jumps += list(flat.T)
        return None
    given = now.sides[first : now.count]
    now.jumps += list(flat.T & (given < 0))
    return given.T.reshape(wide.shape)


def numbered(rule: Rule) -> Rule:
    """The rule of an operation that may jump. It has its numbers in each evaluation, also where it cannot jump."""

    def counted(node: Expr, *values: Any) -> Any:
        first = now.count
        found = rule(node, *values)
        if now.count == first:
            sides_of(np.zeros((1, *node.type.shape), bool))
        return found

    return counted


def still(value: Interval) -> Span:
    """A value that is the same all along the stretch."""
    return Span(*value, value, None)


def constant(value: Array) -> Span:
    return Span(value, value, (value, value), None)


def spanned(low: Array, high: Array, at: Interval, slope: Interval | None) -> Span:
    """A span whose range is met with that of the mean value theorem."""
    if slope is None:
        return Span(low, high, at, None)
    axes = (..., *(None,) * (np.ndim(slope[0]) - 1)) if np.ndim(slope[0]) > 1 else ...
    before, behind = now.before[axes], now.behind[axes]
    back = -slope[0]
    falls = np.maximum(np.maximum(_over(slope[1], before), _over(back, behind)), 0.0)
    rises = np.maximum(np.maximum(_over(back, before), _over(slope[1], behind)), 0.0)
    return Span(np.fmax(low, _beyond(at[0], falls, -1.0)), np.fmin(high, _beyond(at[1], rises, 1.0)), at, slope)


def _over(slope: Array, length: Array) -> Array:
    """The change over a length. A slope may be infinite or NaN, which is unknown."""
    return slope * length if now.long else np.where(length == 0.0, 0.0, slope * length)


def _beyond(x: Array, by: Array, side: float) -> Array:
    """Below or above x by at least a length, and by the errors of the length and of the result: half a unit in the last
    place each, and that of this sum."""
    margin = (np.abs(x) + by) * (2.0 * r.ULP) + by + r.TINY
    return x - margin if side < 0.0 else x + margin


def lifted(value: Span, own: Type, wanted: Type) -> Span:
    """A scalar over the components of a vector or matrix."""
    if own.shape or not wanted.shape:
        return value
    ends = [lift(end, own, wanted) for end in (value.low, value.high, *value.at)]
    slope = None if value.slope is None else (lift(value.slope[0], own, wanted), lift(value.slope[1], own, wanted))
    return Span(ends[0], ends[1], (ends[2], ends[3]), slope)


def condition(always: Array, sometimes: Array) -> Span:
    return Span(always, sometimes, (always, sometimes), None)


def without_bounds(shape: tuple[int, ...]) -> Interval:
    """Anything, for each stretch."""
    rows = (len(now.before), *shape)
    return np.full(rows, -np.inf), np.full(rows, np.inf)
