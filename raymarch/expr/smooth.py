"""Smooth functions of one number, with the ranges of their values and derivatives over a range, as expressions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from raymarch.expr import vocabulary as v
from raymarch.expr.node import Expr, const

ZERO, ONE = const(0.0), const(1.0)
LEAST = 1e-18
"""In place of smaller lengths and arguments of roots, whose derivatives would be infinite."""

Range: TypeAlias = tuple[Expr, Expr]
"""The least and the largest value."""

NOTHING: Range = (ZERO, ZERO)


# Ranges


def add(a: Range, b: Range) -> Range:
    return a[0] + b[0], a[1] + b[1]


def hull(*numbers: Expr) -> Range:
    low = high = numbers[0]
    for number in numbers[1:]:
        low, high = v.min(low, number), v.max(high, number)
    return low, high


def scaled(a: Range, factor: Expr) -> Range:
    if a is NOTHING or factor is ZERO:
        return NOTHING
    if a[0] is a[1]:
        return (a[0] * factor,) * 2
    if factor.op == "const":
        return (a[0] * factor, a[1] * factor) if float(factor.data) >= 0.0 else (a[1] * factor, a[0] * factor)
    return hull(a[0] * factor, a[1] * factor)


def times(a: Range, b: Range) -> Range:
    if a is NOTHING or b is NOTHING:
        return NOTHING
    if a[0] is a[1]:
        return scaled(b, a[0])
    if b[0] is b[1]:
        return scaled(a, b[0])
    return hull(*[x * y for x in a for y in b])


def squared(a: Range) -> Range:
    if a[0] is a[1]:
        return (a[0] * a[0],) * 2
    least, most = v.max(v.max(a[0], -a[1]), 0.0), v.max(-a[0], a[1])
    return least * least, most * most


def largest(a: Range) -> Expr:
    return abs(a[0]) if a[0] is a[1] else v.max(-a[0], a[1])


# Functions


@dataclass(frozen=True, slots=True)
class Rule:
    """A smooth function. value : it and its derivative at a number. within, rates, bends : the ranges of its value, its
    first and its second derivative, by the number at the start and the range over the stretch."""

    value: Callable[[Expr], tuple[Expr, Expr]]
    within: Callable[[Expr, Range], Range]
    rates: Callable[[Expr, Range], Range]
    bends: Callable[[Expr, Range], Range]


def _reach(x: Expr, a: Range) -> Expr:
    return v.max(a[1] - x, x - a[0])


def _rising(f: Callable[[Expr], Expr]) -> Callable[[Expr, Range], Range]:
    return lambda x, a: (f(a[0]), f(a[1]))


def _falling(f: Callable[[Expr], Expr]) -> Callable[[Expr, Range], Range]:
    return lambda x, a: (f(a[1]), f(a[0]))


def _least_at_0(f: Callable[[Expr], Expr]) -> Callable[[Expr, Range], Range]:
    """The range of a function that falls up to 0, where it is 1, and then rises."""
    return lambda x, a: (f(v.max(v.max(a[0], -a[1]), 0.0)), f(largest(a)))


def _about(f: Callable[[Expr], Expr], steepest: float, most: float) -> Callable[[Expr, Range], Range]:
    """The range of a function of at most `most` with a Lipschitz constant."""

    def rule(x: Expr, a: Range) -> Range:
        value, reach = f(x), steepest * _reach(x, a)
        return v.max(value - reach, -most), v.min(value + reach, most)

    return rule


def _positive(x: Expr) -> Expr:
    return v.max(x, LEAST)


def _root(x: Expr) -> tuple[Expr, Expr]:
    root = v.sqrt(x)
    return root, 0.5 / v.max(root, LEAST**0.5)


def _three_halves(x: Expr) -> Expr:
    return -0.25 / (_positive(x) * v.sqrt(_positive(x)))


def _wave(f: Callable[[Expr], Expr], d: Callable[[Expr], Expr]) -> Rule:
    """sin and cos, whose derivatives are waves, too."""
    return Rule(lambda x: (f(x), d(x)), _about(f, 1.0, 1.0), _about(d, 1.0, 1.0), _about(lambda x: -f(x), 1.0, 1.0))


def _logarithm(f: Callable[[Expr], Expr], factor: float) -> Rule:
    return Rule(
        lambda x: (f(x), factor / _positive(x)),
        _rising(f),
        _falling(lambda x: factor / _positive(x)),
        _rising(lambda x: -factor / (_positive(x) * _positive(x))),
    )


def _exponential(f: Callable[[Expr], Expr], factor: float) -> Rule:
    return Rule(
        lambda x: (f(x), factor * f(x)),
        _rising(f),
        _rising(lambda x: factor * f(x)),
        _rising(lambda x: factor**2 * f(x)),
    )


def _apart(a: Range) -> Range:
    """A range of one sign as the range of the absolute value."""
    return v.max(v.max(a[0], -a[1]), LEAST), largest(a)


def _bell(x: Expr) -> Expr:
    return 1.0 / (1.0 + x * x)


SMOOTH: Mapping[str, Rule] = {
    "sin": _wave(v.sin, v.cos),
    "cos": _wave(v.cos, lambda x: -v.sin(x)),
    "exp": _exponential(v.exp, 1.0),
    "exp2": _exponential(v.exp2, math.log(2)),
    "log": _logarithm(v.log, 1.0),
    "log2": _logarithm(v.log2, 1.0 / math.log(2)),
    "sqrt": Rule(_root, _rising(v.sqrt), _falling(lambda x: 0.5 / v.sqrt(_positive(x))), _rising(_three_halves)),
    "atan": Rule(
        lambda x: (v.atan(x), _bell(x)),
        _rising(v.atan),
        _about(_bell, 0.65, 1.0),
        _about(lambda x: -2.0 * x * _bell(x) * _bell(x), 2.0, 0.65),
    ),
    "tanh": Rule(
        lambda x: (v.tanh(x), 1.0 - v.tanh(x) * v.tanh(x)),
        _rising(v.tanh),
        _about(lambda x: 1.0 - v.tanh(x) * v.tanh(x), 0.77, 1.0),
        _about(lambda x: 2.0 * v.tanh(x) * (v.tanh(x) * v.tanh(x) - 1.0), 2.0, 0.77),
    ),
    "sinh": Rule(lambda x: (v.sinh(x), v.cosh(x)), _rising(v.sinh), _least_at_0(v.cosh), _rising(v.sinh)),
    "cosh": Rule(lambda x: (v.cosh(x), v.sinh(x)), _least_at_0(v.cosh), _rising(v.sinh), _least_at_0(v.cosh)),
    "reciprocal": Rule(
        lambda x: (1.0 / x, -1.0 / (x * x)),
        lambda x, a: _signed(x, 1.0 / _apart(a)[1], 1.0 / _apart(a)[0]),
        lambda x, a: (-1.0 / (_apart(a)[0] * _apart(a)[0]), -1.0 / (_apart(a)[1] * _apart(a)[1])),
        lambda x, a: _signed(x, *[2.0 / (end * end * end) for end in _apart(a)[::-1]]),
    ),
}
"""Of 1/x, the range must not hold 0; see `raymarch.expr.stretch`."""


def _signed(x: Expr, least: Expr, most: Expr) -> Range:
    """A range of absolute values with the sign of a number."""
    return v.where(x > 0.0, least, -most), v.where(x > 0.0, most, -least)
