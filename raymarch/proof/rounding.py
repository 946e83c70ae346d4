"""Interval arithmetic that is rounded outwards: each result contains all real results of its arguments' numbers.

An interval is a pair (low, high) of float64 arrays. NumPy rounds sums, differences, products, quotients and roots to
the nearest number, so the true result is within half a unit in the last place; `ULP` of the result is more than that.
Its other functions are within `CLOSE` of the result, which `tests/proof/test_rounding.py` compares with mpmath.

An end that is NaN says nothing. Only a low end of +inf or a high end of -inf, which no real number has, can become one.
"""

from __future__ import annotations

from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import SMALLEST

Array: TypeAlias = NDArray[Any]
Interval: TypeAlias = tuple[Array, Array]

ULP: Final = 2.0**-52
"""Relative widening of an operation that is rounded to the nearest number: at least one unit in the last place."""

CLOSE: Final = 2.0**-49
"""Relative widening of the other functions of NumPy, which err by at most four units in the last place."""

TINY: Final = 5e-324
"""Absolute widening: the distance of two numbers near 0."""

UNKNOWN: Final[Interval] = (np.asarray(-np.inf), np.asarray(np.inf))
ZERO: Final[Interval] = (np.asarray(0.0), np.asarray(0.0))


def down(x: Array, by: float = ULP) -> Array:
    """A number that is less by at least the rounding error of x."""
    return x - (np.abs(x) * by + TINY)


def up(x: Array, by: float = ULP) -> Array:
    """A number that is greater by at least the rounding error of x."""
    return x + (np.abs(x) * by + TINY)


def outward(low: Array, high: Array, by: float = ULP) -> Interval:
    return down(low, by), up(high, by)


def hull(a: Interval, b: Interval) -> Interval:
    return np.minimum(a[0], b[0]), np.maximum(a[1], b[1])


def meet(a: Interval, b: Interval) -> Interval:
    """The common part of two intervals that contain the same numbers. An end that is NaN does not count."""
    return np.fmax(a[0], b[0]), np.fmin(a[1], b[1])


def negative(a: Interval) -> Interval:
    return -a[1], -a[0]


def add(a: Interval, b: Interval) -> Interval:
    """Sums that are exact, such as those near 0 and of small integers and halves, are not widened."""
    low, high = a[0] + b[0], a[1] + b[1]
    return low - _error(low, a[0], b[0]), high + _error(high, a[1], b[1])


def _error(total: Array, a: Array, b: Array) -> Array:
    """At least the rounding error of a + b. The greater term's difference is exact (Dekker 1971)."""
    return np.abs(total) * ULP * ((total - a != b) | (total - b != a))


def sub(a: Interval, b: Interval) -> Interval:
    return add(a, negative(b))


def near_sum(a: Interval, b: Interval) -> Interval:
    """Sums, of which exact ones are widened too: in fewer operations."""
    low, high = a[0] + b[0], a[1] + b[1]
    return low - np.abs(low) * ULP, high + np.abs(high) * ULP


def _times(a: Interval, x: Array) -> Interval:
    """Multiples by one number. Those of one whole number by another, as rows of tables have, are exact below 2^53."""
    least, most = a if x > 0.0 else (a[1], a[0])
    low, high = least * x, most * x
    if np.ndim(low) == 0 and max(abs(low), abs(high)) < 2.0**53 and not any(v % 1.0 for v in (x, least, most)):
        return low, high
    low, high = outward(low, high)
    return np.where(least == 0.0, 0.0, low), np.where(most == 0.0, 0.0, high)


def mul(a: Interval, b: Interval) -> Interval:
    """0 times infinity is left out: an infinite end is not attained, and the other corners contain 0."""
    for one, other in ((a, b), (b, a)):
        if other[0] is other[1] and np.ndim(other[0]) == 0 and other[0] != 0.0:
            return _times(one, other[0])
    corners = a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]
    low = np.fmin(np.fmin(corners[0], corners[1]), np.fmin(corners[2], corners[3]))
    high = np.fmax(np.fmax(corners[0], corners[1]), np.fmax(corners[2], corners[3]))
    low, high = outward(low, high)
    if np.all(a[0]) and np.all(b[0]):
        return low, high
    zero = ((a[0] == 0.0) & (a[1] == 0.0)) | ((b[0] == 0.0) & (b[1] == 0.0))  # 0 times anything that is finite is 0
    return np.where(zero, 0.0, low), np.where(zero, 0.0, high)


def square(a: Interval) -> Interval:
    least, most = absolute(a)
    return np.maximum(down(least * least), 0.0), np.where(most == 0.0, 0.0, up(most * most))


def absolute(a: Interval) -> Interval:
    return np.maximum(np.maximum(a[0], -a[1]), 0.0), np.maximum(a[1], -a[0])


def magnitude(a: Interval) -> Array:
    return np.maximum(np.abs(a[0]), np.abs(a[1]))


def reciprocal(a: Interval) -> Interval:
    crosses = (a[0] <= 0.0) & (a[1] >= 0.0)
    low, high = outward(1.0 / a[1], 1.0 / a[0])
    return np.where(crosses, -np.inf, low), np.where(crosses, np.inf, high)


def div(a: Interval, b: Interval) -> Interval:
    """Unknown where the divisor may be 0."""
    crosses = (b[0] <= 0.0) & (b[1] >= 0.0)
    corners = a[0] / b[0], a[0] / b[1], a[1] / b[0], a[1] / b[1]
    low = np.fmin(np.fmin(corners[0], corners[1]), np.fmin(corners[2], corners[3]))
    high = np.fmax(np.fmax(corners[0], corners[1]), np.fmax(corners[2], corners[3]))
    low, high = outward(low, high)
    return np.where(crosses, -np.inf, low), np.where(crosses, np.inf, high)


def whole_quotients(a: Interval, b: Interval) -> tuple[Array, Array]:
    """The floors of the least and the greatest quotient. Of a divisor that is one number they are exact."""
    low, high = div(a, b)
    one = (b[0] == b[1]) & (b[0] != 0.0) & (magnitude((low, high)) < 2.0**52)
    first, last = np.where(b[0] > 0.0, a[0], a[1]), np.where(b[0] > 0.0, a[1], a[0])
    return (
        np.where(one, _whole_quotient(first, b[0]), np.floor(low)),
        np.where(one, _whole_quotient(last, b[0]), np.floor(high)),
    )


def _whole_quotient(x: Array, y: Array) -> Array:
    """The floor of x / y. A rounded quotient has the right one unless it was rounded up to an integer: then the
    remainder, which is exact, is nearly the divisor instead of nearly 0."""
    quotient = x / y
    rest = np.fmod(x, y)
    rest = np.where((rest != 0.0) & ((rest < 0.0) != (y < 0.0)), rest + y, rest)
    below = (quotient == np.floor(quotient)) & (np.abs(rest) > 0.5 * np.abs(y))
    return np.asarray(np.floor(quotient) - below)


def root(a: Interval) -> Interval:
    """The square root; of a negative number 0, as everywhere in the language."""
    low, high = np.sqrt(np.maximum(a[0], 0.0)), np.sqrt(np.maximum(a[1], 0.0))
    return np.maximum(down(low), 0.0), np.where(high == 0.0, 0.0, up(high))


def total(a: Interval) -> Interval:
    """The sum over the last axis."""
    result = a[0][..., 0], a[1][..., 0]
    for i in range(1, a[0].shape[-1]):
        result = add(result, (a[0][..., i], a[1][..., i]))
    return result


def rising(compute: Any, by: float = CLOSE, least: Any = -np.inf, most: Any = np.inf) -> Any:
    """The rule of a function that never falls. least, most : its range."""

    def rule(a: Interval) -> Interval:
        low, high = outward(compute(a[0]), compute(a[1]), by)
        return np.maximum(low, least), np.minimum(high, most)

    return rule


exp = rising(np.exp, least=0.0)
exp2 = rising(np.exp2, least=0.0)
arctan = rising(np.arctan, least=down(np.asarray(-np.pi / 2)), most=up(np.asarray(np.pi / 2)))
sinh = rising(np.sinh)
tanh = rising(np.tanh, least=-1.0, most=1.0)
arcsin = rising(lambda x: np.arcsin(np.clip(x, -1.0, 1.0)))
log = rising(lambda x: np.log(np.maximum(x, SMALLEST)))
log2 = rising(lambda x: np.log2(np.maximum(x, SMALLEST)))


def arccos(a: Interval) -> Interval:
    low, high = outward(np.arccos(np.clip(a[1], -1.0, 1.0)), np.arccos(np.clip(a[0], -1.0, 1.0)), CLOSE)
    return np.maximum(low, 0.0), high


def cosh(a: Interval) -> Interval:
    low, high = absolute(a)
    return np.maximum(down(np.cosh(low), CLOSE), 1.0), up(np.cosh(high), CLOSE)


FAR: Final = 1e8
"""Angles beyond this have an unknown sine: the position within a turn has an error."""


def sine(a: Interval, peak: float = np.pi / 2) -> Interval:
    """The sine, or the cosine if the maximum is at 0. peak : the position of the maximum, modulo 2 pi."""
    known = magnitude(a) <= FAR
    margin = 1e-15 * magnitude(a) + 1e-15  # of the position of the extrema

    def reaches(where: float) -> Array:
        below = np.floor((a[1] + margin - where) / (2.0 * np.pi) + 1e-15)
        return below >= np.ceil((a[0] - margin - where) / (2.0 * np.pi) - 1e-15)

    compute = np.sin if peak else np.cos
    first, last = (compute(np.where(known, end, 0.0)) for end in a)
    low, high = outward(np.minimum(first, last), np.maximum(first, last), CLOSE)
    low = np.where(~known | reaches(peak + np.pi), -1.0, np.maximum(low, -1.0))
    return low, np.where(~known | reaches(peak), 1.0, np.minimum(high, 1.0))


def cosine(a: Interval) -> Interval:
    return sine(a, 0.0)


def tangent(a: Interval) -> Interval:
    """Unknown where the interval may contain a pole."""
    low, high = a[0] - (1e-15 * np.abs(a[0]) + 1e-15), a[1] + (1e-15 * np.abs(a[1]) + 1e-15)
    branch = np.floor((low + np.pi / 2) / np.pi - 1e-15) == np.floor((high + np.pi / 2) / np.pi + 1e-15)
    known = branch & (magnitude(a) <= FAR)
    first, last = outward(np.tan(a[0]), np.tan(a[1]), 2.0 * CLOSE)
    return np.where(known, first, -np.inf), np.where(known, last, np.inf)


def arctan2(y: Interval, x: Interval) -> tuple[Interval, Array]:
    """The angle, and whether the box of the point (x, y) avoids 0 and the cut along the negative x axis."""
    free = (y[0] > 0.0) | (y[1] < 0.0) | (x[0] > 0.0)
    corners = [np.arctan2(b, a) for a in x for b in y]
    low, high = outward(
        np.minimum(np.minimum(corners[0], corners[1]), np.minimum(corners[2], corners[3])),
        np.maximum(np.maximum(corners[0], corners[1]), np.maximum(corners[2], corners[3])),
        CLOSE,
    )
    return (np.where(free, low, down(np.asarray(-np.pi))), np.where(free, high, up(np.asarray(np.pi)))), free


def power(a: Interval, b: Interval) -> Interval:
    """The power of a base that is at least `SMALLEST`: extreme in the corners."""
    base = np.maximum(a[0], SMALLEST), np.maximum(a[1], SMALLEST)
    corners = [np.power(x, y) for x in base for y in b]
    low, high = outward(
        np.minimum(np.minimum(corners[0], corners[1]), np.minimum(corners[2], corners[3])),
        np.maximum(np.maximum(corners[0], corners[1]), np.maximum(corners[2], corners[3])),
        CLOSE,
    )
    return np.maximum(low, 0.0), high
