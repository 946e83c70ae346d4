"""The reading of loops: as many turns as some stretch may take, and turns of points as sharp as Newton's method is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from raymarch.expr.function import Loop
from raymarch.expr.types import BOOL, Type
from raymarch.expr.walk import topological
from raymarch.proof import rounding as r
from raymarch.proof.choices import selected
from raymarch.proof.rounding import Array, Interval
from raymarch.proof.span import Span, condition, constant, now, still, stretches

Turn: TypeAlias = Callable[..., Sequence[Any]]
"""The next state and, last, the exit condition if there is one; of the number of the turn, the state and captured
values."""


def repeated(body: Loop, turn: Turn, first: list[Any], captured: list[Any]) -> tuple[Any, ...]:
    """The last state of a loop. The states of stretches that may have ended are kept apart from those that go on, which
    are sharper so: the next turn is read of these alone.
    """
    state, ended, going = first, first, condition(np.asarray(True), np.asarray(True))
    n, jumps = len(first), now.jumps
    now.jumps = None  # the number of turns depends on the stretches, and with it that of operations

    def either(choice: Span, a: list[Any], b: list[Any]) -> list[Any]:
        return [selected(v.type, choice, x, y) for v, x, y in zip(body.state, a, b, strict=True)]

    for number in range(body.count):
        index = constant(np.asarray(float(number)))
        points = _are_points(body, [*state, *captured])
        after = _by_parts(body, turn, index, state, captured) if points else turn(index, *state, *captured)
        if body.until is not None:
            done = after[n]
            ended = either(condition(going.low & done.high, going.high & done.high), state, ended)
            going = condition(going.low & ~done.high, going.high & ~done.low)
            if not np.any(going.high):
                break
        state = list(after[:n])
    now.jumps = jumps
    return tuple(either(going, state, ended))


def _are_points(body: Loop, values: Sequence[Any]) -> bool:
    """Whether values do not vary along the stretches, and all of the state are numbers or vectors."""
    numbers = all(not v.type.fields and v.type is not BOOL for v in body.state)
    return numbers and all(isinstance(v, Span) and v.slope is None for v in values)


def _by_parts(body: Loop, turn: Turn, index: Span, state: list[Span], captured: list[Span]) -> Sequence[Span]:
    """One turn by the mean value theorem: its value at the middle of the state, and for each component of the state the
    turn's slope in it, times how far the component is from its middle. So the error of a root shrinks from turn to turn
    of Newton's method, where that of a quotient of ranges grows.

    All are read at once: N rows with the middles, then N for each component, on stretches in its direction.
    """
    n = len(now.before)
    wide = [_rows(value.range, v.type, n) for value, v in zip(state, body.state, strict=True)]
    needed = set(topological(body.step))  # others serve the exit condition alone
    unsure = [k for k, v in enumerate(body.state) if v in needed and not np.all(wide[k][0] == wide[k][1])]
    parts = [(k, part) for k in unsure for part in np.ndindex(body.state[k].type.shape)]
    if not parts:
        return turn(index, *state, *captured)
    blocks = len(parts) + 1
    lengths = np.zeros((2, blocks, n))
    read = []
    for k, (low, high) in enumerate(wide):
        middle = np.clip(0.5 * low + 0.5 * high, low, high)
        ends, at = ([np.stack([middle, *[end] * len(parts)]) for end in (low, high)] for _ in range(2))
        slope = np.zeros_like(ends[0])
        for number, (owner, part) in enumerate(parts, 1):
            if owner == k:
                here = (slice(None), *part)
                at[0][number][here] = at[1][number][here] = middle[here]
                slope[number][here] = 1.0
                lengths[:, number] = r.up(middle - low)[here], r.up(high - middle)[here]
        low, high, first, last, slope = (_flat(each) for each in (*ends, *at, slope))
        read.append(Span(low, high, (first, last), (slope, slope)))
    with stretches(*lengths.reshape(2, -1)):
        many = [_again(value, v.type, blocks) for value, v in zip(captured, body.captured, strict=True)]
        found = turn(index, *read, *many)
    types = [each.type for each in body.inner]
    return [_joined(value, type, lengths) for value, type in zip(found, types, strict=True)]


def _rows(ends: Interval, type: Type, n: int) -> Interval:
    """Both ends for each of n rows."""
    shape = (n, *type.shape)
    return np.broadcast_to(ends[0], shape), np.broadcast_to(ends[1], shape)


def _flat(blocks: Array) -> Array:
    return blocks.reshape(-1, *blocks.shape[2:])


def _again(value: Span, type: Type, blocks: int) -> Span:
    """A value with its rows once for each block."""
    if np.ndim(value.low) == len(type.shape):
        return value
    low, high = (np.concatenate([end] * blocks) for end in value.range)
    return Span(low, high, (low, high), None)


def _joined(value: Span, type: Type, lengths: Array) -> Span:
    """What all blocks say of one value. lengths : of the stretches of each, before and behind, (2, blocks, N)."""
    _, blocks, n = lengths.shape
    low, high = (end.reshape(blocks, n, *type.shape) for end in _rows(value.range, type, blocks * n))
    if type is BOOL:
        return condition(np.any(low[1:], axis=0), np.all(high[1:], axis=0))
    ends = np.fmax.reduce(low[1:]), np.fmin.reduce(high[1:])
    if value.slope is None:
        return still(ends)
    slope = [end.reshape(blocks, n, *type.shape) for end in _rows(value.slope, type, blocks * n)]
    back, ahead = lengths[(..., *(None,) * len(type.shape))]
    by_slope = low[0], high[0]
    for k in range(1, blocks):
        by_slope = r.add(by_slope, r.mul((slope[0][k], slope[1][k]), (-back[k], ahead[k])))
    return still(r.meet(ends, by_slope))
