"""Families of smooth minima, and shaped joints such as chamfers and stairs.

A family is a fold of two distances. All but the shaped ones are normalised to the classic k: two equal distances a
blend to a - k/4 (the circular-geometric family, whose fillet depends on a, does so at a = 0). The slope of a fold is
bounded by its two partial derivatives: if they are not negative and sum to 1, its Lipschitz constant is the larger one
of its operands; if only their squares sum to 1, it is the root of the sum of the squares of the two constants.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from raymarch.expr.function import FloatExpr, function
from raymarch.expr.node import Expr, const, expr
from raymarch.expr.vocabulary import clamp, exp2, length, log2, max, min, mod, round, sqrt, vec2

Fold = Callable[..., Expr]

ROOT_HALF = math.sqrt(0.5)


@function()
def smooth_min(a: FloatExpr, b: FloatExpr, k: FloatExpr) -> Expr:
    """Quadratic smooth minimum: min(a, b) where |a - b| >= k, smooth_min(a, a, k) = a - k/4."""
    h = max(k - abs(a - b), 0.0) / k
    return min(a, b) - h * h * k * 0.25


@function()
def cubic_min(a: FloatExpr, b: FloatExpr, k: FloatExpr) -> Expr:
    """Twice differentiable; works within |a - b| < 1.5 k."""
    h = max(1.5 * k - abs(a - b), 0.0) / (1.5 * k)
    return min(a, b) - h * h * h * k * 0.25


@function()
def quartic_min(a: FloatExpr, b: FloatExpr, k: FloatExpr) -> Expr:
    """Twice differentiable with a shorter reach: |a - b| < 4 k / 3."""
    h = max(4.0 / 3.0 * k - abs(a - b), 0.0) / (4.0 / 3.0 * k)
    return min(a, b) - h * h * h * (4.0 - h) * k / 12.0


@function()
def circular_min(a: FloatExpr, b: FloatExpr, k: FloatExpr) -> Expr:
    """The curve of min(a, b) over a - b is an arc of a circle."""
    reach = k * (0.25 / (1.0 - ROOT_HALF))
    h = max(reach - abs(a - b), 0.0) / reach
    return min(a, b) - 0.5 * reach * (1.0 + h - sqrt(1.0 - h * (h - 2.0)))


@function()
def exponential_min(a: FloatExpr, b: FloatExpr, k: FloatExpr) -> Expr:
    """-log of a sum of powers of 2; the smaller distance is factored out, so that nothing overflows. It acts
    at all distances, and the order of the operands does not matter."""
    width = 0.25 * k
    return min(a, b) - width * log2(1.0 + exp2(-abs(a - b) / width))


@function()
def root_min(a: FloatExpr, b: FloatExpr, k: FloatExpr) -> Expr:
    """A branch of a hyperbola; it acts at all distances. The smaller distance is factored out: its sum with a large
    one would round it."""
    gap, width = abs(a - b), 0.5 * k
    return min(a, b) - 0.5 * width * (width / (length(vec2(gap, width)) + gap))


def _round_fold(a: Expr, b: Expr, radius: Expr) -> Expr:
    return max(radius, min(a, b)) - length(max(vec2(radius - a, radius - b), 0.0))


@function()
def circular_geometric_min(a: FloatExpr, b: FloatExpr, k: FloatExpr) -> Expr:
    """A true quarter of a circle where the surfaces meet at a right angle; the order does not matter."""
    return _round_fold(a, b, k * (0.25 / (math.sqrt(2.0) - 1.0)))


@function()
def round_min(a: FloatExpr, b: FloatExpr, k: FloatExpr) -> Expr:
    """A fillet whose radius is k where the surfaces meet at a right angle."""
    return _round_fold(a, b, k)


@function()
def chamfer_min(a: FloatExpr, b: FloatExpr, k: FloatExpr) -> Expr:
    """A bevel whose legs are k where the surfaces meet at a right angle."""
    return min(min(a, b), ROOT_HALF * (a + b - k))


def stairs(steps: int) -> Fold:
    """Steps up from one surface to the other."""

    @function()
    def stairs_min(a: FloatExpr, b: FloatExpr, k: FloatExpr) -> Expr:
        tread = k / float(steps)
        along = b - k - a
        return min(min(a, b), 0.5 * (b - k + a + abs(mod(along + tread, 2.0 * tread) - tread)))

    return stairs_min


def columns(count: int) -> Fold:
    """A row of half-round columns along the bevel."""

    @function()
    def columns_min(a: FloatExpr, b: FloatExpr, k: FloatExpr) -> Expr:
        radius = k * (ROOT_HALF / count)
        across, along = ROOT_HALF * (a + b - k) + radius, ROOT_HALF * (b - a)
        shift = 0.0 if count % 2 else 0.5
        index = clamp(round(along / (2.0 * radius) - shift), -float(count // 2), float((count - 1) // 2)) + shift
        column = length(vec2(across, along - 2.0 * radius * index)) - radius
        return min(min(a, b), min(across, column))

    return columns_min


def levels(n: int) -> int:
    """Depth of a balanced tree of n operands."""
    return math.ceil(math.log2(n))


@dataclass(frozen=True, slots=True)
class Family:
    """A family of blends.

    fold : the smooth minimum of two distances, with k.
    steepness : Lipschitz constant of a blend of two operands, of theirs; None if it is the larger one.
    margin : largest distance by which a blend of n operands exceeds their union, as a multiple of k.
    concave : True if the fold is a concave function of the two distances, and falls with neither.
    """

    fold: Fold
    steepness: Callable[[Expr, Expr], Expr] | None = None
    margin: Callable[[int], float] = lambda n: 0.25 * levels(n)
    concave: bool = True

    def reach(self, n: int, k: Any) -> Expr:
        """Largest distance by which a blend of n operands exceeds their union."""
        return expr(k) * const(self.margin(n))


def _hypotenuse(a: Expr, b: Expr) -> Expr:
    return length(vec2(a, b))


def _bevel(a: Expr, b: Expr) -> Expr:
    """In a chain of 1-Lipschitz operands it stays below 1 + sqrt(2)."""
    return max(max(a, b), ROOT_HALF * (a + b))


def _half(n: int) -> float:
    """In the joint a + b < k, so the nearer operand is within k/2; likewise at each level of the tree."""
    return 0.5 * levels(n)


FAMILIES: dict[str, Callable[[int], Family]] = {
    "quadratic": lambda steps: Family(smooth_min),
    "cubic": lambda steps: Family(cubic_min),
    "quartic": lambda steps: Family(quartic_min),
    "circular": lambda steps: Family(circular_min),
    "exponential": lambda steps: Family(exponential_min),
    "root": lambda steps: Family(root_min),
    "circular_geometric": lambda steps: Family(
        circular_geometric_min, _hypotenuse, lambda n: 0.25 * (math.sqrt(n) - 1.0) / (math.sqrt(2.0) - 1.0)
    ),
    "round": lambda steps: Family(round_min, _hypotenuse, lambda n: 1.0 - 1.0 / math.sqrt(n)),
    "chamfer": lambda steps: Family(chamfer_min, _bevel, _half),
    "stairs": lambda steps: Family(stairs(steps), margin=_half, concave=False),
    "columns": lambda steps: Family(columns(steps), _hypotenuse, _half, concave=False),
}
"""All families, by the value of `blend=`; stairs and columns depend on their number."""

REACH = {"quadratic": 1.0, "cubic": 1.5, "quartic": 4.0 / 3.0, "circular": 0.25 / (1.0 - ROOT_HALF)}
"""Difference of two distances, over k, from which on a blend is the smaller of the two. Families that are not listed
act at all distances."""
