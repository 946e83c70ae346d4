"""Functions of a point that paint: what a material's value may be in place of a number."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from raymarch.errors import SceneError
from raymarch.expr.convert import choice, integer, short
from raymarch.expr.node import Expr, construct, expr
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import floor, mix, mod, where
from raymarch.scene.parameter import as_number
from raymarch.sdf.domain import as_operand
from raymarch.sdf.noise import value_noise

Pattern: TypeAlias = Callable[[Expr], Expr]


def checker(a: Any, b: Any, size: Any = 1.0) -> Pattern:
    """Cubes of two values in turn.

    a, b : numbers, or colours; a is at the origin. size : edge of a cube, > 0. The origin is a quarter of an edge
    inside its cube, so that surfaces through it, or half an edge beside it, do not lie between two.
    """
    first, second = _pair("checker", a, b)
    edge = as_number("checker: size", size, low=1e-6)

    def pattern(p: Expr) -> Expr:
        cell = floor(p / edge + 0.25)
        return where(mod(cell.x + cell.y + cell.z, 2.0) < 0.5, first, second)

    return pattern


def stripes(a: Any, b: Any, width: Any = 0.5, axis: str = "x") -> Pattern:
    """Layers of two values in turn, across an axis.

    a, b : numbers, or colours. width : of a layer, > 0. axis : "x", "y" or "z".
    """
    axis = choice("stripes: axis", axis, ("x", "y", "z"), "'x', 'y' or 'z'")
    first, second = _pair("stripes", a, b)
    thick = as_number("stripes: width", width, low=1e-6)
    return lambda p: where(mod(floor(p["xyz".index(axis)] / thick), 2.0) < 0.5, first, second)


def noise(a: Any, b: Any, scale: Any = 1.0, octaves: int = 3) -> Pattern:
    """Clouds between two values.

    a, b : numbers, or colours. scale : size of the largest clouds, > 0. octaves : layers, 1 to 8, each of half the size
    and half the weight of the one before.
    """
    octaves = integer("noise: octaves", octaves, 1, 8)
    first, second = _pair("noise", a, b)
    size = as_number("noise: scale", scale, low=1e-6)
    share = 1.0 / (2.0 - 2.0 ** (1 - octaves))

    def pattern(p: Expr) -> Expr:
        total = expr(0.5)
        for i in range(octaves):
            total = total + 0.5 * share * 0.5**i * value_noise(p * (2.0**i / size) + (17.3 * i, 5.8 * i, 29.5 * i))
        return mix(first, second, total)

    return pattern


def _pair(name: str, a: Any, b: Any) -> tuple[Expr, Expr]:
    """Two values, both numbers or both colours."""
    first, second = (as_operand(name, value, "two numbers, or two colours") for value in (a, b))
    if first.type is FLOAT and second.type is not FLOAT:
        first = construct(first, first, first)
    if second.type is FLOAT and first.type is not FLOAT:
        second = construct(second, second, second)
    if first.type is not second.type:
        raise SceneError(f"{name}: {short(a)} and {short(b)}", legal="two numbers, or two colours")
    return first, second
