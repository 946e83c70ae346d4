"""Intervals rounded outwards, against numbers of 40 digits."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import floor
from typing import Any, TypeAlias

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.expr import vocabulary as v
from raymarch.expr.evaluate import Program
from raymarch.expr.node import Expr, var
from raymarch.expr.types import FLOAT
from raymarch.expr.walk import find
from raymarch.proof import rounding as r
from raymarch.proof.enclosure import ENCLOSURES, RULES
from raymarch.proof.span import Span, _beyond, still, stretches

COUNT = 300
"""Arguments of each operation; `python -m tests.lab.rounding` tries more."""

L, RISES = 0.1 + 2.0**-50, (0.0, 1e6)
"""A number with many places, and changes along a stretch."""

Ends: TypeAlias = tuple[float, float]
Operation: TypeAlias = tuple[Callable[..., Any], Callable[..., Any], tuple[Ends, ...]]
"""The rule of intervals, the function of numbers, and the range of each argument."""

BOTH, TURNS, POSITIVE = (-1e6, 1e6), (-1e8, 1e8), (1e-30, 1e30)

ROUNDED: dict[str, Operation] = {
    "root": (r.root, mpmath.sqrt, ((0.0, 1e300),)),
    "times": (lambda x: r.mul(x, (np.asarray(-L),) * 2), lambda x: -L * x, (BOTH,)),
    "square": (r.square, lambda x: x * x, (BOTH,)),
    "reciprocal": (r.reciprocal, lambda x: 1 / x, ((1e-6, 1e6),)),
    "exp": (r.exp, mpmath.exp, ((-745.0, 709.0),)),
    "exp2": (r.exp2, lambda x: mpmath.mpf(2) ** x, ((-1074.0, 1023.0),)),
    "log": (r.log, mpmath.log, (POSITIVE,)),
    "log2": (r.log2, lambda x: mpmath.log(x, 2), (POSITIVE,)),
    "sine": (r.sine, mpmath.sin, (TURNS,)),
    "cosine": (r.cosine, mpmath.cos, (TURNS,)),
    "tangent": (r.tangent, mpmath.tan, (TURNS,)),
    "arcsin": (r.arcsin, mpmath.asin, ((-1.0, 1.0),)),
    "arccos": (r.arccos, mpmath.acos, ((-1.0, 1.0),)),
    "arctan": (r.arctan, mpmath.atan, ((-1e300, 1e300),)),
    "sinh": (r.sinh, mpmath.sinh, ((-710.0, 710.0),)),
    "cosh": (r.cosh, mpmath.cosh, ((-710.0, 710.0),)),
    "tanh": (r.tanh, mpmath.tanh, ((-400.0, 400.0),)),
    "add": (r.add, lambda x, y: x + y, (BOTH, BOTH)),
    "near_sum": (r.near_sum, lambda x, y: x + y, (BOTH, BOTH)),
    "below by a rise": (lambda x, y: (_beyond(x[0], L * y[1], -1.0), x[1]), lambda x, y: x - L * y, (BOTH, RISES)),
    "above by a rise": (lambda x, y: (x[0], _beyond(x[1], L * y[1], 1.0)), lambda x, y: x + L * y, (BOTH, RISES)),
    "sub": (r.sub, lambda x, y: x - y, (BOTH, BOTH)),
    "mul": (r.mul, lambda x, y: x * y, (BOTH, BOTH)),
    "div": (r.div, lambda x, y: x / y, (BOTH, (1e-3, 1e6))),
    "power": (r.power, lambda x, y: x**y, ((1e-25, 1e6), (-12.0, 12.0))),
    "arctan2": (lambda y, x: r.arctan2(y, x)[0], mpmath.atan2, ((-1e3, 1e3), (-1e3, 1e3))),
}
"""What `rounding` computes."""

EXACT = {"down", "up", "outward", "hull", "meet", "negative", "absolute", "magnitude", "total", "rising"}
"""Its functions that do not round, that widen, or that add and make others; quotients have a test of their own."""


def _read(build: Callable[..., Expr], exact: Callable[..., Any], *ends: Ends) -> Operation:
    """An expression of some numbers, in the reading of the proof."""
    params = [var(f"x{k}", FLOAT) for k in range(len(ends))]
    body = build(*params)
    program = Program([body], params, ENCLOSURES)

    def rule(*values: r.Interval) -> r.Interval:
        n = len(values[0][0])
        with stretches(np.zeros(n), np.zeros(n)):
            found: Span = program(*map(still, values))[0]
        return np.broadcast_to(found.low, n), np.broadcast_to(found.high, n)

    rule.body = body  # type: ignore[attr-defined]
    return rule, exact, ends


def _mod(x: Any, y: Any) -> Any:
    return x - y * mpmath.floor(x / y)


def _smooth(low: Any, high: Any, x: Any) -> Any:
    t = min(max((x - low) / (high - low), 0), 1)
    return t * t * (3 - 2 * t)


def _norm(*parts: Any) -> Any:
    return mpmath.sqrt(sum(x * x for x in parts))


UNIT, LOW, HIGH = (0.0, 1.0), (-2.0, -1.0), (1.0, 2.0)

LANGUAGE: dict[str, Operation] = {
    "add": _read(lambda x, y: x + y, lambda x, y: x + y, BOTH, BOTH),
    "sub": _read(lambda x, y: x - y, lambda x, y: x - y, BOTH, BOTH),
    "mul": _read(lambda x, y: x * y, lambda x, y: x * y, BOTH, BOTH),
    "div": _read(lambda x, y: x / y, lambda x, y: x / y, BOTH, (1e-3, 1e6)),
    "neg": _read(lambda x: -x, lambda x: -x, BOTH),
    "abs": _read(v.abs, abs, BOTH),
    "min": _read(v.min, min, BOTH, BOTH),
    "max": _read(v.max, max, BOTH, BOTH),
    "clamp": _read(v.clamp, lambda x, low, high: min(max(x, low), high), (-3.0, 3.0), LOW, HIGH),
    "mix": _read(v.mix, lambda a, b, t: a * (1 - t) + b * t, BOTH, BOTH, UNIT),
    "sqrt": _read(v.sqrt, lambda x: mpmath.sqrt(max(x, 0)), BOTH),
    "exp": _read(v.exp, mpmath.exp, (-700.0, 700.0)),
    "exp2": _read(v.exp2, lambda x: mpmath.mpf(2) ** x, (-1000.0, 1000.0)),
    "log": _read(v.log, mpmath.log, POSITIVE),
    "log2": _read(v.log2, lambda x: mpmath.log(x, 2), POSITIVE),
    "sin": _read(v.sin, mpmath.sin, TURNS),
    "cos": _read(v.cos, mpmath.cos, TURNS),
    "tan": _read(v.tan, mpmath.tan, TURNS),
    "asin": _read(v.asin, lambda x: mpmath.asin(min(max(x, -1), 1)), (-1.5, 1.5)),
    "acos": _read(v.acos, lambda x: mpmath.acos(min(max(x, -1), 1)), (-1.5, 1.5)),
    "atan": _read(v.atan, mpmath.atan, BOTH),
    "atan2": _read(v.atan2, mpmath.atan2, (-1e3, 1e3), (-1e3, 1e3)),
    "sinh": _read(v.sinh, mpmath.sinh, (-700.0, 700.0)),
    "cosh": _read(v.cosh, mpmath.cosh, (-700.0, 700.0)),
    "tanh": _read(v.tanh, mpmath.tanh, (-40.0, 40.0)),
    "pow": _read(v.pow, lambda x, y: x**y, (1e-25, 1e6), (-12.0, 12.0)),
    "floor": _read(v.floor, mpmath.floor, BOTH),
    "ceil": _read(v.ceil, mpmath.ceil, BOTH),
    "round": _read(v.round, lambda x: mpmath.floor(x + 0.5), BOTH),
    "sign": _read(v.sign, mpmath.sign, BOTH),
    "fract": _read(v.fract, lambda x: x - mpmath.floor(x), BOTH),
    "mod": _read(v.mod, _mod, BOTH, (1e-3, 1e3)),
    "step": _read(v.step, lambda edge, x: mpmath.mpf(x >= edge), (-1.0, 1.0), (-1.0, 1.0)),
    "smoothstep": _read(v.smoothstep, _smooth, LOW, HIGH, (-3.0, 3.0)),
    "lt": _read(lambda x, y: v.where(x < y, x, 2.0 * y), lambda x, y: x if x < y else 2 * y, BOTH, BOTH),
    "le": _read(lambda x, y: v.where(x <= y, x, 2.0 * y), lambda x, y: x if x <= y else 2 * y, BOTH, BOTH),
    "where": _read(lambda x, y: v.where(x > y, x, 2.0 * y), lambda x, y: x if x > y else 2 * y, BOTH, BOTH),
    "and": _read(lambda x, y: v.where((x > 0.0) & (y > 0.0), x, y), lambda x, y: x if min(x, y) > 0 else y, BOTH, BOTH),
    "or": _read(lambda x, y: v.where((x > 0.0) | (y > 0.0), x, y), lambda x, y: x if max(x, y) > 0 else y, BOTH, BOTH),
    "not": _read(lambda x, y: v.where(~(x > y) & (x > 0.0), x, y), lambda x, y: x if y >= x > 0 else y, BOTH, BOTH),
    "construct": _read(lambda x, y, z: v.length(v.vec3(x, y, z)), _norm, BOTH, BOTH, BOTH),
    "length": _read(lambda x, y: v.length(v.vec2(x, y)), _norm, BOTH, BOTH),
    "swizzle": _read(lambda x, y: (v.vec2(x, y) * x).yx.x, lambda x, y: y * x, BOTH, BOTH),
    "dot": _read(
        lambda x, y, z, w: v.dot(v.vec2(x, y), v.vec2(z, w)), lambda x, y, z, w: x * z + y * w, BOTH, BOTH, BOTH, BOTH
    ),
    "normalize": _read(lambda x, y, z: v.normalize(v.vec3(x, y, z)).y, lambda *p: p[1] / _norm(*p), BOTH, BOTH, BOTH),
    "cross": _read(
        lambda x, y, z, w: v.cross(v.vec3(x, y, z), v.vec3(w, x, y)).z,
        lambda x, y, _z, w: x * x - y * w,
        *(BOTH,) * 4,
    ),
    "columns": _read(
        lambda x, y, z: (v.columns(v.vec2(x, y), v.vec2(y, z)) * v.vec2(z, x)).x,
        lambda x, y, z: x * z + y * x,
        *(BOTH,) * 3,
    ),
    "matmul": _read(
        lambda x, y, z: (v.columns(v.vec2(x, y), v.vec2(y, z)) * v.vec2(z, x)).y,
        lambda x, y, z: y * z + z * x,
        *(BOTH,) * 3,
    ),
    "transpose": _read(
        lambda x, y, z: (v.transpose(v.columns(v.vec2(x, y), v.vec2(z, x))) * v.vec2(y, z)).x,
        lambda x, y, z: x * y + y * z,
        *(BOTH,) * 3,
    ),
}
"""Operations of the expression language, as the proof reads them."""

OF_DATA = {"cell", "fetch", "field", "finite", "hash", "probe", "raw", "raw_slope", "record", "sample", "sample_bend"}
OF_DATA |= {"sample_slope", "stop_gradient", "texture", "texture_in_atlas", "within"}
"""Operations that read data, pass a value on, or have no bounds: they have tests of their own, or need none."""

ALL = ROUNDED | {f"language: {name}": operation for name, operation in LANGUAGE.items()}


def drawn(name: str, count: int, seed: int) -> list[NDArray[np.float64]]:
    """Arguments of an operation, one array each."""
    values = [arguments(each, count, seed + k) for k, each in enumerate(ALL[name][2])]
    least = min(map(len, values))
    return [v[:least] for v in values]


def arguments(ends: Ends, count: int, seed: int) -> NDArray[np.float64]:
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


@pytest.mark.parametrize("name", ALL)
def test_operations_on_numbers(name: str) -> None:
    rule, exact, _ = ALL[name]
    values = drawn(name, COUNT, 1)
    with np.errstate(all="ignore"):
        assert outside(rule(*((v, v) for v in values)), exact, *values) == []


@pytest.mark.parametrize("name", ALL)
def test_intervals_hold_the_values_of_their_numbers(name: str) -> None:
    """Of random intervals, wide and narrow, at random numbers in them."""
    rule, exact, ends = ALL[name]
    random = np.random.default_rng(3)
    values = drawn(name, 100, 0)
    n = len(values[0])
    width = np.exp2(random.uniform(-40, 2, (len(values), n)))
    low = [np.clip(v - w * random.random(n), *e) for v, w, e in zip(values, width, ends, strict=True)]
    high = [np.clip(v + w * random.random(n), *e) for v, w, e in zip(values, width, ends, strict=True)]
    with np.errstate(all="ignore"):
        found = rule(*zip(low, high, strict=True))
    assert outside(found, exact, *values) == []


def test_all_operations_are_compared() -> None:
    """Each rule of the reading, by an expression that has the operation; each function that rounds."""
    assert set(LANGUAGE) | OF_DATA == set(RULES) and not set(LANGUAGE) & OF_DATA
    assert all(find([rule.body], name) for name, (rule, _, _) in LANGUAGE.items())  # type: ignore[attr-defined]
    functions = {name for name, each in vars(r).items() if getattr(each, "__module__", "") == r.__name__}
    left = {name for name in functions if not name.startswith("_")} - EXACT
    used = {name for rule, _, _ in ROUNDED.values() for name in (rule.__code__.co_names)} | set(ROUNDED)
    assert left - used == {"whole_quotients"}


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
