"""Rules of operations that read data: hashes, tables, samples and textures; and of those that cannot be read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from raymarch.expr import hashing, raw, samples, tables, textures
from raymarch.expr.evaluate import Rule
from raymarch.expr.node import Expr
from raymarch.expr.types import BOOL, FLOAT, Type
from raymarch.proof import rounding as r
from raymarch.proof.components import jumping_slope
from raymarch.proof.rounding import Array, Interval
from raymarch.proof.span import Span, condition, now, spanned, still, without_bounds

TWIN = 1e-9
"""Error of a twin in NumPy, relative to its value and to the largest coordinate: far below a pixel."""


def _unknown(node: Expr, *_values: Any) -> Any:
    if node.type.fields:
        return tuple(_unknown_of(type) for _, type in node.type.fields)
    return _unknown_of(node.type)


def _unknown_of(type: Type) -> Span:
    if type is BOOL:
        return condition(np.asarray(False), np.asarray(True))
    wide = without_bounds(type.shape)
    return Span(*wide, wide, wide)


def _jump_free(given: Span, exact: Array, value: Array, otherwise: Interval) -> Span:
    """A value that is known where `exact` holds, else within an interval, with jumps. given : what it depends on."""
    known = np.asarray(exact)[(..., *(None,) * (np.ndim(value) - np.ndim(exact)))]
    low, high = np.where(known, value, otherwise[0]), np.where(known, value, otherwise[1])
    return Span(low, high, (low, high), None if given.slope is None else jumping_slope(low, high))


def limited(at: Interval, slope: Interval, steepest: float) -> Span:
    """A value that changes by at most a constant times the way of a point. slope : of the point, a vector."""
    square: Interval = r.total(r.square(slope))
    rise = r.up(steepest * r.root(square)[1])
    return spanned(*without_bounds(()), at, (-rise, rise))


def _raw(node: Expr, point: Span) -> Span:
    """GLSL of the user, by its twin in the middle of each place and by the Lipschitz constant that is stated."""
    function: raw.RawFunction = node.data
    steepest = raw.limit_of(function)
    if steepest == np.inf:
        return _unknown_of(node.type)
    low, high = (np.broadcast_to(end, (len(now.before), 3)) for end in point.at)
    middle = np.nan_to_num(0.5 * low + 0.5 * high)
    off = np.maximum(r.up(high - middle), r.up(middle - low))
    square: Interval = r.total(r.square((off, off)))
    value = raw.evaluate(node, middle)
    error = r.up(steepest * r.root(square)[1]) + TWIN * (np.abs(value) + np.abs(middle).max(axis=-1))
    at = r.outward(value - error, value + error)
    return still(at) if point.slope is None else limited(at, point.slope, steepest)


def _hash(node: Expr, cell: Span) -> Span:
    low, high = np.rint(cell.low), np.rint(cell.high)
    same = np.all(low == high, axis=-1)
    return _jump_free(cell, same, hashing.evaluate(node, low), (np.asarray(0.0), np.asarray(1.0)))


def _fetch(node: Expr, index: Span) -> Span:
    values = np.asarray(node.data.values, np.float64)
    ends = values.min(axis=0), values.max(axis=0)
    if node.type is FLOAT:
        ends = ends[0][0], ends[1][0]
    same = np.floor(index.low) == np.floor(index.high)
    return _jump_free(index, same, tables.evaluate(node, np.floor(index.low)), ends)


def _sample(node: Expr, at: Span) -> Span:
    """Linear interpolation: between the least and the greatest texel of the cells that are met, and as steep as the
    differences of the data allow."""
    data: samples.Samples = node.data
    middle = np.clip(0.5 * (at.at[0] + at.at[1]), 0.0, np.array(data.size) - 1.0)
    value = samples.evaluate(node, middle)
    slopes = _texel_slopes(data)
    axes = range(data.dimension)
    off = r.up(0.5 * (at.at[1] - at.at[0])) + 1e-15 * r.magnitude(at.at)
    error = np.sum([off[..., k] * max(-slopes[k][0], slopes[k][1]) for k in axes], axis=0)
    error = r.up(error) + 1e-14 * float(np.abs(data.values).max())
    least, most = _texels(data).between(at.low, at.high)
    centre = np.fmax(value - error, float(data.values.min())), np.fmin(value + error, float(data.values.max()))
    if at.slope is None:
        return still(r.meet((least, most), centre))
    own = at.slope
    parts = [
        r.mul((own[0][..., k], own[1][..., k]), (np.asarray(slopes[k][0]), np.asarray(slopes[k][1]))) for k in axes
    ]
    slope = parts[0]
    for part in parts[1:]:
        slope = r.add(slope, part)
    return spanned(least, most, centre, slope)


class _Texels:
    """The least and the greatest texel of boxes of cells, from a pyramid in which level k joins 2^k texels an axis."""

    def __init__(self, values: Array) -> None:
        self.shape = np.array(values.shape)
        self.low, self.high = [values.astype(np.float64)], [values.astype(np.float64)]
        while max(self.low[-1].shape) > 1:
            self.low.append(self._joined(self.low[-1], np.minimum))
            self.high.append(self._joined(self.high[-1], np.maximum))

    @staticmethod
    def _joined(level: Array, join: Callable[[Array, Array], Array]) -> Array:
        for axis in range(level.ndim):
            even = np.take(level, np.arange(0, level.shape[axis], 2), axis)
            odd = np.take(level, np.minimum(np.arange(1, level.shape[axis] + 1, 2), level.shape[axis] - 1), axis)
            level = join(even, odd)
        return level

    def between(self, low: Array, high: Array) -> Interval:
        """Over boxes of positions in texels, (N, dimension), x first."""
        last = (self.shape - 1)[::-1]
        first = np.clip(np.nan_to_num(np.floor(low)), 0, last).astype(np.int64)
        end = np.clip(np.nan_to_num(np.ceil(high), nan=0.0, posinf=1e9, neginf=-1e9), first, last).astype(np.int64)
        width = (end - first).max(axis=-1)
        levels = np.ceil(np.log2(np.maximum(width, 1))).astype(np.int64)
        least, most = np.full(levels.shape, np.inf), np.full(levels.shape, -np.inf)
        for k in np.unique(levels):
            rows = levels == k
            start, stop = first[rows] >> k, end[rows] >> k
            for corner in np.ndindex(*(2,) * first.shape[-1]):
                index = np.minimum(start + np.array(corner), stop)
                texel = tuple(index[..., axis] for axis in reversed(range(first.shape[-1])))
                least[rows] = np.minimum(least[rows], self.low[k][texel])
                most[rows] = np.maximum(most[rows], self.high[k][texel])
        return least, most


_PYRAMIDS: dict[str, tuple[_Texels, list[tuple[float, float]]]] = {}


def _pyramid(data: samples.Samples) -> tuple[_Texels, list[tuple[float, float]]]:
    if data.key not in _PYRAMIDS:
        wide = data.values.astype(np.float64)
        steps = [np.diff(wide, axis=axis) for axis in reversed(range(wide.ndim))]
        _PYRAMIDS.clear()
        _PYRAMIDS[data.key] = _Texels(data.values), [(float(s.min()), float(s.max())) for s in steps]
    return _PYRAMIDS[data.key]


def _texels(data: samples.Samples) -> _Texels:
    return _pyramid(data)[0]


def _texel_slopes(data: samples.Samples) -> list[tuple[float, float]]:
    """The least and the greatest difference of neighbours along each axis, and 0, where positions are clamped."""
    return [(min(low, 0.0), max(high, 0.0)) for low, high in _pyramid(data)[1]]


def _texture(node: Expr, *_values: Span) -> Span:
    low, high = textures.interval(node, *[None] * len(node.args))
    return Span(low, high, (low, high), without_bounds(node.type.shape))


RULES: Mapping[str, Rule] = {
    **dict.fromkeys(("raw_slope", "sample_slope", "sample_bend", "finite", "cell"), _unknown),
    "raw": _raw,
    "hash": _hash,
    "fetch": _fetch,
    "sample": _sample,
    "texture": _texture,
    "texture_in_atlas": _texture,
}
