"""Procedural patterns: functions of a point, as values of a material."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from raymarch.errors import SceneError
from raymarch.expr.convert import choice, integer, short
from raymarch.expr.node import Expr, construct, expr
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import floor, mix, mod, where
from raymarch.scene.parameter import as_number
from raymarch.sdf.domain import ColorLike, Scalar, as_operand
from raymarch.sdf.noise import value_noise

Pattern: TypeAlias = Callable[[Expr], Expr]


def checker(a: Scalar | ColorLike, b: Scalar | ColorLike, size: Scalar = 1.0) -> Pattern:
    """A 3D checkerboard of two values.

    Parameters
    ----------
    a, b : two numbers, or two colours; `a` is the value at the origin.
    size : edge of a cube, > 0.

    Notes
    -----
    The origin is a quarter of an edge inside its cube. So surfaces through the origin, or half an edge beside it, do
    not lie on the boundary of two cubes.
    """
    first, second = _pair("checker", a, b)
    edge = as_number("checker: size", size, low=1e-6)

    def pattern(p: Expr) -> Expr:
        cell = floor(p / edge + 0.25)
        return where(mod(cell.x + cell.y + cell.z, 2.0) < 0.5, first, second)

    return pattern


def stripes(a: Scalar | ColorLike, b: Scalar | ColorLike, width: Scalar = 0.5, axis: str = "x") -> Pattern:
    """Alternating layers of two values at right angles to an axis.

    Parameters
    ----------
    a, b : two numbers, or two colours.
    width : thickness of a layer, > 0.
    axis : "x", "y" or "z".
    """
    axis = choice("stripes: axis", axis, ("x", "y", "z"), "'x', 'y' or 'z'")
    first, second = _pair("stripes", a, b)
    thick = as_number("stripes: width", width, low=1e-6)
    return lambda p: where(mod(floor(p["xyz".index(axis)] / thick), 2.0) < 0.5, first, second)


def noise(a: Scalar | ColorLike, b: Scalar | ColorLike, scale: Scalar = 1.0, octaves: int = 3) -> Pattern:
    """Fractal value noise between two values.

    Parameters
    ----------
    a, b : two numbers, or two colours.
    scale : size of the largest features, > 0.
    octaves : number of layers, 1 to 8. Each has half the size and half the weight of the one before.
    """
    octaves = integer("noise: octaves", octaves, 1, 8)
    first, second = _pair("noise", a, b)
    size = as_number("noise: scale", scale, low=1e-6)
    norm = 1.0 / (2.0 - 2.0 ** (1 - octaves))

    def pattern(p: Expr) -> Expr:
        total = expr(0.5)
        for i in range(octaves):
            total = total + 0.5 * norm * 0.5**i * value_noise(p * (2.0**i / size) + (17.3 * i, 5.8 * i, 29.5 * i))
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
