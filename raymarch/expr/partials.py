"""Partial derivatives of componentwise operations, finite at kinks and singular points."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import TypeAlias

import numpy as np

import raymarch.expr.vocabulary as v
from raymarch.errors import SceneError
from raymarch.expr.arrays import SMALLEST
from raymarch.expr.node import Expr, const
from raymarch.expr.types import BOOL, FLOAT, Type

Partial: TypeAlias = Callable[[Expr], Expr]
Partials: TypeAlias = tuple[Partial | None, ...]

ONE, ZERO = const(1.0), const(0.0)


def not_above(low: Expr, high: Expr) -> Expr:
    """Condition low <= high; for vectors 1 or 0 by component."""
    return low <= high if low.type is FLOAT and high.type is FLOAT else v.step(low, high)


def _indicator(low: Expr, high: Expr) -> Expr:
    """1 where low <= high, else 0; by component."""
    holds = not_above(low, high)
    return v.where(holds, 1.0, 0.0) if holds.type is BOOL else holds


def safe_inverse(x: Expr) -> Expr:
    """1 / x for x > 0, 0 at x = 0."""
    return v.sign(x) / v.max(x, SMALLEST)


def _inverse_where_positive(x: Expr) -> Expr:
    """1 / x for x > 0, else 0: the derivative of log, which is constant below its lower bound."""
    return safe_inverse(v.max(x, 0.0))


def _within(clamped: Expr) -> Expr:
    """1 where a clamped number is below its upper limit, or at it if the lower limit is known to be smaller; else 0.

    If both limits are equal, the derivative is 0.
    """
    x, low, high = clamped.args
    apart = low.op == high.op == "const" and bool(np.all(low.data < high.data))
    return _indicator(x, high) if apart else 1.0 - _indicator(high, x)


def _arg(i: int) -> Partial:
    return lambda e: e.args[i]


def _no_edges(e: Expr) -> Expr:
    raise SceneError("smoothstep's edges depend on the position", legal="edges that are the same for every point")


def _smoothstep_slope(e: Expr) -> Expr:
    low, high, x = e.args
    t = v.clamp((x - low) / (high - low), 0.0, 1.0)
    return 6.0 * t * (1.0 - t) / (high - low)


PARTIALS: Mapping[str, Partials] = {
    **dict.fromkeys("sign floor ceil round hash fetch".split(), (None,)),
    "add": (lambda e: ONE, lambda e: ONE),
    "sub": (lambda e: ONE, lambda e: -ONE),
    "mul": (_arg(1), _arg(0)),
    "div": (lambda e: 1.0 / e.args[1], lambda e: -e / e.args[1]),
    "mod": (lambda e: ONE, lambda e: -v.floor(e.args[0] / e.args[1])),
    "neg": (lambda e: -ONE,),
    "abs": (lambda e: v.sign(e.args[0]),),
    "fract": (lambda e: ONE,),
    "texture_in_atlas": (None,) * 6,
    "texture": (None, None, None, None),  # height maps are read as gradients, see `raymarch.scene.relief`
    "sqrt": (lambda e: 0.5 * safe_inverse(e),),
    "exp": (lambda e: e,),
    "exp2": (lambda e: math.log(2) * e,),
    "log": (lambda e: _inverse_where_positive(e.args[0]),),
    "log2": (lambda e: _inverse_where_positive(e.args[0]) / math.log(2),),
    "sin": (lambda e: v.cos(e.args[0]),),
    "cos": (lambda e: -v.sin(e.args[0]),),
    "tan": (lambda e: 1.0 + e * e,),
    "asin": (lambda e: safe_inverse(v.sqrt(1.0 - e.args[0] * e.args[0])),),
    "acos": (lambda e: -safe_inverse(v.sqrt(1.0 - e.args[0] * e.args[0])),),
    "atan": (lambda e: 1.0 / (1.0 + e.args[0] * e.args[0]),),
    "atan2": (
        lambda e: e.args[1] / v.max(e.args[0] * e.args[0] + e.args[1] * e.args[1], SMALLEST),
        lambda e: -e.args[0] / v.max(e.args[0] * e.args[0] + e.args[1] * e.args[1], SMALLEST),
    ),
    "sinh": (lambda e: v.cosh(e.args[0]),),
    "cosh": (lambda e: v.sinh(e.args[0]),),
    "tanh": (lambda e: 1.0 - e * e,),
    "pow": (lambda e: e.args[1] * e * _inverse_where_positive(e.args[0]), lambda e: e * v.log(e.args[0])),
    "min": (lambda e: _indicator(*e.args), lambda e: 1.0 - _indicator(*e.args)),
    "max": (lambda e: _indicator(*e.args[::-1]), lambda e: 1.0 - _indicator(*e.args[::-1])),
    "step": (None, None),
    "stop_gradient": (None,),
    "clamp": (
        lambda e: _indicator(e.args[1], e.args[0]) * _within(e),
        lambda e: 1.0 - _indicator(e.args[1], e.args[0]),
        lambda e: 1.0 - _within(e),
    ),
    "mix": (lambda e: 1.0 - e.args[2], lambda e: e.args[2], lambda e: e.args[1] - e.args[0]),
    "smoothstep": (_no_edges, _no_edges, _smoothstep_slope),
}
"""Componentwise operations: the partial derivative for each argument; None where it is zero everywhere."""

STILL = frozenset(op for op, partials in PARTIALS.items() if not any(partials))
"""Operations whose derivative is 0 everywhere."""


@cache
def zero(type: Type) -> Expr:
    """The constant 0 of a type."""
    return const([[0.0] * type.size] * type.size if type.is_matrix else [0.0] * type.size) if type.shape else ZERO
