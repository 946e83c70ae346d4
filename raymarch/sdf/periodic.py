"""Triply periodic surfaces, as walls of a given thickness.

Each is the zero set of a short sum f of products of sines and cosines of q = 2 pi p / period. A bound of the gradient
of f gives a field: if |grad f|^2 <= A (1 - f^2 / M^2), the function (M / sqrt A) asin(f / M) is 1-Lipschitz in q. So is
the sum of the first terms of the arc sine, which are all positive. The field is therefore a lower bound of the
distance, and nearly tight on the surface, where the gradient is largest. The wall has the stated thickness where the
gradient is largest, and is thicker elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec

from raymarch.expr.node import Expr, swizzle
from raymarch.expr.vocabulary import abs, cos, dot, sin, sqrt
from raymarch.sdf.definition import EVERYWHERE, shape
from raymarch.sdf.domain import Fits, Positive, Scalar
from raymarch.sdf.node import Node

__all__ = ["gyroid", "lidinoid", "neovius", "schwarz_d", "schwarz_p"]

P = ParamSpec("P")

_TURN = 2.0 * math.pi


def _level(f: Expr, steepest: float, largest: float) -> Expr:
    """The first terms of the arc sine: (M / sqrt A) (u + u^3/6 + 3 u^5/40), u = f / M, with A and M as above."""
    u = f / largest
    square = u * u
    return (largest / math.sqrt(steepest)) * u * (1.0 + square * (1.0 / 6.0 + square * 0.075))


def _wall(level: Expr, period: Scalar, thickness: Scalar) -> Expr:
    return abs(level) * (period / _TURN) - 0.5 * thickness


def periodic(limit: float, symmetry: str = "") -> Callable[[Callable[Concatenate[Any, P], Any]], Callable[P, Node]]:
    """Decorator: a function of a point, a period and a thickness becomes an unbounded wall.

    limit : the largest value of the level; thicker walls would fill all space, and are refused.
    """
    widest = math.floor(1000.0 * 2.0 * limit / _TURN) / 1000.0
    legal = f"thickness < {widest} period; a thicker wall fills all space"
    check = Fits(lambda thickness, period: thickness < widest * period, legal, "thickness = {} for period = {}")
    return shape(exactness="bound", bounds=lambda: EVERYWHERE, symmetry=symmetry, spread=1.0, check=check)


@periodic(1.075)
def gyroid(p: Expr, period: Positive = 1.0, thickness: Positive = 0.08) -> Expr:
    """Wall along Schoen's gyroid (1970), unbounded.

    period : edge of the cube that repeats, > 0. thickness : of the wall where it is thinnest, > 0, < 0.342 period.

    f = sin x cos y + sin y cos z + sin z cos x. A = 3, M = 3/2: by Lagrange's identity each squared slope
    (cos x cos y - sin x sin z)^2 is cos^2 y + sin^2 z minus (cos x sin z + sin x cos y)^2. The first terms sum to 3,
    and the three brackets sum to 2 f, so the sum of their squares is at least 4 f^2 / 3.
    """
    q = _TURN / period * p
    return _wall(_level(dot(sin(q), swizzle(cos(q), "yzx")), 3.0, 1.5), period, thickness)


@periodic(2.15, symmetry="xyz")
def schwarz_p(p: Expr, period: Positive = 1.0, thickness: Positive = 0.1) -> Expr:
    """Wall along Schwarz's primitive surface (1865), unbounded.

    period : edge of the cube that repeats, > 0. thickness : of the wall where it is thinnest, > 0, < 0.684 period.

    f = cos x + cos y + cos z. A = 3, M = 3: the squared slopes sum to 3 minus the squares of the cosines, whose
    sum is at least f^2 / 3.
    """
    x, y, z = cos(_TURN / period * p)
    return _wall(_level(x + y + z, 3.0, 3.0), period, thickness)


@periodic(1.013)
def schwarz_d(p: Expr, period: Positive = 1.0, thickness: Positive = 0.08) -> Expr:
    """Wall along Schwarz's diamond surface (1865), unbounded.

    period : edge of the cube that repeats, > 0. thickness : of the wall where it is thinnest, > 0, < 0.322 period.

    f = sin x sin y sin z + sin x cos y cos z + cos x sin y cos z + cos x cos y sin z. A = 3, M = sqrt 2: with
    a, b, c = sin 2x, sin 2y, sin 2z the squared slopes sum to 3 + ab + bc + ca - 3 f^2, and ab + bc + ca is 2 f^2
    minus twice the sum of the squares of the four terms of f, which is at least f^2 / 4.
    """
    q = _TURN / period * p
    s, c = sin(q), cos(q)
    f = s.x * (s.y * s.z + c.y * c.z) + c.x * (s.y * c.z + c.y * s.z)
    return _wall(_level(f, 3.0, math.sqrt(2.0)), period, thickness)


@periodic(1.758, symmetry="xyz")
def neovius(p: Expr, period: Positive = 1.4, thickness: Positive = 0.06) -> Expr:
    """Wall along Neovius' surface (1883), unbounded.

    period : edge of the cube that repeats, > 0. thickness : of the wall where it is thinnest, > 0, < 0.559 period. The
        wall is up to five times as thick where the surface is flat.

    f = 3 (cos x + cos y + cos z) + 4 cos x cos y cos z. The squared slope is a polynomial of the three cosines. Over
    the cube of their values it is at most 27.01 + 5 |f| (proven by interval arithmetic on subdivisions of the cube).
    The integral of 1 / sqrt(27.01 + 5 f), 2 f / (sqrt 27.01 + sqrt(27.01 + 5 |f|)), is therefore 1-Lipschitz in q.
    """
    x, y, z = cos(_TURN / period * p)
    f = 3.0 * (x + y + z) + 4.0 * x * y * z
    return _wall(2.0 * f / (math.sqrt(27.01) + sqrt(27.01 + 5.0 * abs(f))), period, thickness)


@periodic(0.44)
def lidinoid(p: Expr, period: Positive = 2.0, thickness: Positive = 0.06) -> Expr:
    """Wall along Lidin's surface (1990), in its usual approximation by sines and cosines, unbounded.

    period : edge of the cube that repeats, > 0. thickness : of the wall where it is thinnest, > 0, < 0.14 period; it is
        up to five times as thick where the surface is flat.

    f = half of (sin 2x cos y sin z + sin 2y cos z sin x + sin 2z cos x sin y) - (cos 2x cos 2y + cos 2y cos 2z +
    cos 2z cos 2x), plus 0.15. Its slope is less than 2.605: the squared slope is a trigonometric polynomial of degree
    4 in each angle, whose maximum is bounded by its values on a fine grid (Ehlich and Zeller 1964). The bound is tight
    to 0.3 %: the slope is 2.598 at f = -0.25, next to the surface. The median slope on the surface is less than half of
    that, so the wall is typically twice as thick as stated.
    """
    q = _TURN / period * p
    s, c = sin(q), cos(q)
    double = 1.0 - 2.0 * s * s
    ridges = dot(s * c, swizzle(c, "yzx") * swizzle(s, "zxy"))
    return _wall((ridges - 0.5 * dot(double, swizzle(double, "yzx")) + 0.15) / 2.605, period, thickness)
