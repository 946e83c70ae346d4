"""Intervals rounded outwards, against numbers of 40 digits."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import floor
from typing import Any

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.proof import rounding as r
from raymarch.proof.span import _beyond

COUNT = 300
"""Arguments of each operation; `python -m tests.lab.rounding` tries more."""

L, RISES = 0.1 + 2.0**-50, (0.0, 1e6)
"""A number with many places, and changes along a stretch."""

ONE: dict[str, tuple[Callable[..., Any], Callable[..., Any], tuple[float, float]]] = {
    "root": (r.root, mpmath.sqrt, (0.0, 1e300)),
    "times": (lambda x: r.mul(x, (np.asarray(-L),) * 2), lambda x: -L * x, (-1e6, 1e6)),
    "square": (r.square, lambda x: x * x, (-1e6, 1e6)),
    "reciprocal": (r.reciprocal, lambda x: 1 / x, (1e-6, 1e6)),
    "exp": (r.exp, mpmath.exp, (-745.0, 709.0)),
    "exp2": (r.exp2, lambda x: mpmath.mpf(2) ** x, (-1074.0, 1023.0)),
    "log": (r.log, mpmath.log, (1e-30, 1e30)),
    "log2": (r.log2, lambda x: mpmath.log(x, 2), (1e-30, 1e30)),
    "sine": (r.sine, mpmath.sin, (-1e8, 1e8)),
    "cosine": (r.cosine, mpmath.cos, (-1e8, 1e8)),
    "tangent": (r.tangent, mpmath.tan, (-1e8, 1e8)),
    "arcsin": (r.arcsin, mpmath.asin, (-1.0, 1.0)),
    "arccos": (r.arccos, mpmath.acos, (-1.0, 1.0)),
    "arctan": (r.arctan, mpmath.atan, (-1e300, 1e300)),
    "sinh": (r.sinh, mpmath.sinh, (-710.0, 710.0)),
    "cosh": (r.cosh, mpmath.cosh, (-710.0, 710.0)),
    "tanh": (r.tanh, mpmath.tanh, (-400.0, 400.0)),
}
BOTH = (-1e6, 1e6)
TWO: dict[str, tuple[Callable[..., Any], Callable[..., Any], tuple[tuple[float, float], tuple[float, float]]]] = {
    "add": (r.add, lambda x, y: x + y, (BOTH, BOTH)),
    "near_sum": (r.near_sum, lambda x, y: x + y, (BOTH, BOTH)),
    "below by a rise": (lambda x, y: (_beyond(x[0], L * y[1], -1.0), x[1]), lambda x, y: x - L * y, (BOTH, RISES)),
    "above by a rise": (lambda x, y: (x[0], _beyond(x[1], L * y[1], 1.0)), lambda x, y: x + L * y, (BOTH, RISES)),
    "sub": (r.sub, lambda x, y: x - y, (BOTH, BOTH)),
    "mul": (r.mul, lambda x, y: x * y, (BOTH, BOTH)),
    "div": (r.div, lambda x, y: x / y, (BOTH, (1e-3, 1e6))),
    "power": (r.power, lambda x, y: x**y, ((1e-30, 1e6), (-12.0, 12.0))),
    "arctan2": (lambda y, x: r.arctan2(y, x)[0], mpmath.atan2, ((-1e3, 1e3), (-1e3, 1e3))),
}


def drawn(name: str, count: int, seed: int) -> list[NDArray[np.float64]]:
    """Arguments of an operation, one array each."""
    ends = TWO[name][2] if name in TWO else (ONE[name][2],)
    values = [arguments(each, count, seed + k) for k, each in enumerate(ends)]
    least = min(map(len, values))
    return [v[:least] for v in values]


def arguments(ends: tuple[float, float], count: int, seed: int) -> NDArray[np.float64]:
    """Even numbers, numbers even in their exponents, the ends, and numbers near multiples of pi / 2."""
    random = np.random.default_rng(seed)
    low, high = ends
    even = random.uniform(low, high, count)
    small = np.exp2(random.uniform(-30, np.log2(max(abs(low), abs(high))), count)) * random.choice([-1.0, 1.0], count)
    turns = np.round(random.uniform(low, high, count // 4) / (np.pi / 2)) * (np.pi / 2)
    found = np.concatenate([even, small, turns, np.nextafter(turns, np.inf), [low, high]])
    return np.asarray(found[(found >= low) & (found <= high)])


def outside(found: r.Interval, exact: Callable[..., Any], *given: NDArray[np.float64]) -> list[tuple[float, ...]]:
    """The arguments whose exact result is not in the interval."""
    bad = []
    with mpmath.workdps(40):
        for low, high, *numbers in zip(*found, *given, strict=True):
            true = exact(*(mpmath.mpf(float(n)) for n in numbers))
            if not mpmath.mpf(float(low)) <= true <= mpmath.mpf(float(high)):
                bad.append(tuple(map(float, numbers)))
    return bad


@pytest.mark.parametrize("name", [*ONE, *TWO])
def test_operations_on_numbers(name: str) -> None:
    rule, exact, _ = {**ONE, **TWO}[name]
    values = drawn(name, COUNT, 1)
    with np.errstate(all="ignore"):
        assert outside(rule(*((v, v) for v in values)), exact, *values) == []


@pytest.mark.parametrize("name", [*ONE, *TWO])
def test_intervals_hold_the_values_of_their_numbers(name: str) -> None:
    """Of random intervals, wide and narrow, at random numbers in them."""
    rule, exact, _ = {**ONE, **TWO}[name]
    ends = TWO[name][2] if name in TWO else (ONE[name][2],)
    random = np.random.default_rng(3)
    values = drawn(name, 100, 0)
    n = len(values[0])
    width = np.exp2(random.uniform(-40, 2, (len(values), n)))
    low = [np.clip(v - w * random.random(n), *e) for v, w, e in zip(values, width, ends, strict=True)]
    high = [np.clip(v + w * random.random(n), *e) for v, w, e in zip(values, width, ends, strict=True)]
    with np.errstate(all="ignore"):
        found = rule(*zip(low, high, strict=True))
    assert outside(found, exact, *values) == []


def test_one_unit_less_is_noticed() -> None:
    """The test can fail: without the widening, a third of all sums is outside."""
    x, y = (arguments((-1e6, 1e6), COUNT, seed) for seed in (1, 2))
    x, y = x[: min(len(x), len(y))], y[: min(len(x), len(y))]
    assert len(outside((x + y, x + y), lambda a, b: a + b, x, y)) > 50


def test_floors_of_quotients_are_exact() -> None:
    """Also where the rounded quotient is an integer and the true one is just below, which 1 - 2^-53 over 1 is."""
    random = np.random.default_rng(4)
    y = np.concatenate([random.uniform(-3.0, 3.0, 3000), random.integers(1, 5, 1000)])
    x = random.integers(-50, 50, 4000) * y
    x[:1000], x[1000:2000] = np.nextafter(x[:1000], np.inf), np.nextafter(x[1000:2000], -np.inf)
    low, high = r.whole_quotients((x, x), (y, y))
    right = [floor(Fraction(a) / Fraction(b)) for a, b in zip(x, y, strict=True)]
    assert np.array_equal(low, right) and np.array_equal(high, right)
    assert np.any(np.floor(x / y) != right)
    wide = np.nextafter(y, np.inf)  # divisors that are no one number
    low, high = r.whole_quotients((x, x), (y, wide))
    assert np.all((low <= right) & (right <= high))


def test_an_exact_sum_is_not_widened() -> None:
    low, high = r.add((np.array([3.0, 0.1]), np.array([3.0, 0.1])), (np.array([0.5, 0.2]), np.array([0.5, 0.2])))
    assert low[0] == high[0] == 3.5
    assert Fraction(low[1]) <= Fraction(0.1) + Fraction(0.2) <= Fraction(high[1]) and low[1] < high[1]


@pytest.mark.parametrize("value, exact", [(7.0, True), (-7.0, True), (7.5, False), (2.0**52 + 1.0, False)])
def test_products_of_whole_numbers_are_exact_below_a_limit(value: float, exact: bool) -> None:
    three, given = np.asarray(3.0), np.asarray(value)
    for low, high in (r.mul((three, three), (given, given)), r.mul((given, given), (three, three))):
        assert (low == high == 3.0 * value) if exact else low < high
