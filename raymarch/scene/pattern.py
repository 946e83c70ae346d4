"""Procedural patterns: functions of a point, as values of a material."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.colors import linear_color
from raymarch.expr.convert import choice, integer, short
from raymarch.expr.derivative import directional_derivatives
from raymarch.expr.function import function
from raymarch.expr.node import Expr, construct, expr
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import abs, clamp, dot, floor, length, max, mix, mod, sin, vec2, where
from raymarch.scene.parameter import LEAST_LENGTH, as_number
from raymarch.sdf.domain import ColorLike, Scalar, as_operand
from raymarch.sdf.interaction import DPDX, DPDY, POSITION
from raymarch.sdf.noise import value_noise

Pattern: TypeAlias = Callable[[Expr], Expr]

AXES = ("x", "y", "z")


@checked
def checker(a: Scalar | ColorLike, b: Scalar | ColorLike, size: Scalar = 1.0, axis: str | None = None) -> Pattern:
    """A checkerboard of two values: of cubes, or with an axis of squares for floors and walls.

    Parameters
    ----------
    a, b : two numbers, or two colours; `a` is the value at the origin.
    size : edge of a cube or square, > 0.
    axis : None for cubes. "x", "y" or "z" for squares at right angles to this axis: "y" for floors. They are filtered:
        each pixel shows the mean over its footprint, so a floor shows no moire towards the horizon.

    Returns
    -------
    Pattern

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    The origin is a quarter of an edge inside its cube. So surfaces through the origin, or half an edge beside it, do
    not lie on the boundary of two cubes.

    The filter is a box along each of the two directions (Quilez, "Filtering the checkerboard pattern") for each of four
    pieces of the footprint.
    """
    first, second = _pair("checker", a, b)
    edge = as_number("checker: size", size, low=LEAST_LENGTH)
    if axis is not None:
        across = _across("checker", axis)

        def board(p: Expr) -> Expr:
            def sign(x: Expr, width: Expr) -> Expr:
                return 2.0 * line_coverage(x - 0.125, 0.5, width) - 1.0

            product = _over_footprint(p, across, 2.0 * edge, lambda x, y, w: sign(x, w.x) * sign(y, w.y))
            return mix(second, first, 0.5 + 0.5 * product)

        return board

    def pattern(p: Expr) -> Expr:
        cell = floor(p / edge + 0.25)
        return where(mod(cell.x + cell.y + cell.z, 2.0) < 0.5, first, second)

    return pattern


@checked
def grid_lines(
    a: Scalar | ColorLike,
    b: Scalar | ColorLike,
    size: Scalar = 1.0,
    width: Scalar = 0.05,
    axis: str = "y",
) -> Pattern:
    """A square grid of lines for floors and walls, filtered over the footprint of the pixel as `checker` is.

    Parameters
    ----------
    a, b : two numbers, or two colours: between the lines, and of the lines.
    size : distance of the lines, > 0. Two lines cross at the origin.
    width : width of a line, >= 0 and at most `size`.
    axis : "x", "y" or "z": the grid is at right angles to it.

    Returns
    -------
    Pattern

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    first, second = _pair("grid_lines", a, b)
    spacing = as_number("grid_lines: size", size, low=LEAST_LENGTH)
    thick = as_number("grid_lines: width", width, low=0.0)
    if spacing.is_constant and thick.is_constant and thick.data > spacing.data:
        raise SceneError(f"grid_lines: width = {short(width)} with size = {short(size)}", legal="at most the size")
    across = _across("grid_lines", axis)

    fraction = thick / spacing

    def gaps(x: Expr, y: Expr, w: Expr) -> Expr:
        return (1.0 - line_coverage(x, fraction, w.x)) * (1.0 - line_coverage(y, fraction, w.y))

    return lambda p: mix(second, first, _over_footprint(p, across, spacing, gaps))


@checked
def stripes(a: Scalar | ColorLike, b: Scalar | ColorLike, width: Scalar = 0.5, axis: str = "x") -> Pattern:
    """Alternating layers of two values at right angles to an axis.

    Parameters
    ----------
    a, b : two numbers, or two colours.
    width : thickness of a layer, > 0.
    axis : "x", "y" or "z".

    Returns
    -------
    Pattern

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    axis = choice("stripes: axis", axis, AXES, "'x', 'y' or 'z'")
    first, second = _pair("stripes", a, b)
    thick = as_number("stripes: width", width, low=LEAST_LENGTH)
    return lambda p: where(mod(floor(p["xyz".index(axis)] / thick), 2.0) < 0.5, first, second)


@checked
def noise(a: Scalar | ColorLike, b: Scalar | ColorLike, scale: Scalar = 1.0, octaves: int = 3) -> Pattern:
    """Fractal value noise between two values. About 95 % of the points are between them, the others have one of them.

    Parameters
    ----------
    a, b : two numbers, or two colours.
    scale : size of the largest features, > 0.
    octaves : number of layers, 1 to 8. Each has half the size and half the weight of the one before.

    Returns
    -------
    Pattern

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    octaves = integer("noise: octaves", octaves, 1, 8)
    first, second = _pair("noise", a, b)
    size = as_number("noise: scale", scale, low=LEAST_LENGTH)
    return lambda p: mix(first, second, clamp(0.5 + 0.25 * _fractal(p / size, octaves), 0.0, 1.0))


@checked
def marble(
    a: Scalar | ColorLike,
    b: Scalar | ColorLike,
    scale: Scalar = 1.0,
    turbulence: Scalar = 0.5,
    axis: str = "x",
    octaves: int = 4,
) -> Pattern:
    """Veins of marble: waves between two values along an axis, displaced by noise (Perlin 1985).

    Parameters
    ----------
    a, b : two numbers, or two colours.
    scale : distance of two veins, > 0.
    turbulence : standard deviation of the displacement of the veins, in units of `scale`, >= 0.
    axis : "x", "y" or "z", across the veins.
    octaves : number of layers of the noise, 1 to 8.

    Returns
    -------
    Pattern

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    axis = choice("marble: axis", axis, AXES, "'x', 'y' or 'z'")
    octaves = integer("marble: octaves", octaves, 1, 8)
    first, second = _pair("marble", a, b)
    size = as_number("marble: scale", scale, low=LEAST_LENGTH)
    strength = as_number("marble: turbulence", turbulence, low=0.0)

    def pattern(p: Expr) -> Expr:
        q = p / size
        wave = sin(math.tau * (q["xyz".index(axis)] + strength * _fractal(q, octaves)))
        return mix(first, second, 0.5 + 0.5 * wave)

    return pattern


def _fractal(q: Expr, octaves: int) -> Expr:
    """The sum of octaves of noise, of mean 0 and variance 1.

    One octave has the variance 1/3 (3/4)^3: that of its corners, times the mean of w^2 + (1 - w)^2 for each axis.
    """
    variance = (0.75**3 / 3.0) * math.fsum(0.25**i for i in range(octaves))
    total = expr(0.0)
    for i in range(octaves):
        total = total + (0.5**i / math.sqrt(variance)) * value_noise(q * 2.0**i + (17.3 * i, 5.8 * i, 29.5 * i))
    return total


def _over_footprint(p: Expr, across: tuple[int, int], period: Expr, mean: Callable[[Expr, Expr, Expr], Expr]) -> Expr:
    """The mean of a pattern over the pixel footprint about a point.

    The longer axis of the footprint is cut into `PIECES`. Each is replaced by a rectangle along the axes of the pattern
    that has the same variance along each.

    across : the axes of the pattern. period : the length after which it repeats.
    mean : the mean over a rectangle from its centre (x, y) and its widths, a vec2, all in periods.
    """
    # If the pattern's point is moved, the footprint is transformed by the derivative of the motion.
    axes = (DPDX, DPDY) if p is POSITION else directional_derivatives(p, POSITION, (DPDX, DPDY))
    dpdx, dpdy, at = (vec2(v[across[0]], v[across[1]]) / period for v in (*axes, p))
    first_is_longer = dot(dpdx, dpdx) > dot(dpdy, dpdy)
    long, short_axis = where(first_is_longer, dpdx, dpdy), where(first_is_longer, dpdy, dpdx)
    piece = long / PIECES
    widths = vec2(length(vec2(piece.x, short_axis.x)), length(vec2(piece.y, short_axis.y)))
    total = expr(0.0)
    for i in range(PIECES):
        q = at + ((i + 0.5) / PIECES - 0.5) * long
        total = total + mean(q.x, q.y, widths)
    return total / PIECES


PIECES = 4
"""Pieces of a footprint. One alone would lose the contrast of a board that is seen along its diagonal."""


@function(x=FLOAT, fraction=FLOAT, width=FLOAT)
def line_coverage(x: Expr, fraction: Expr, width: Expr) -> Expr:
    """The fraction of the interval of a width about x that lines cover: one at each integer, a fraction of 1 wide."""
    nearest = x - floor(x + 0.5)
    # An interval that is narrower than a line and than a gap holds one edge at most. The distance to it has no rounding
    # errors, which the difference of integrals has in narrow intervals.
    divisor = max(width, 1e-30)
    one_edge = clamp((0.5 * fraction - abs(nearest)) / divisor + 0.5, 0.0, 1.0)
    high, low = (_length_of_lines(nearest + side * width, fraction) for side in (0.5, -0.5))
    return where((width < fraction) & (width < 1.0 - fraction), one_edge, (high - low) / divisor)


def _length_of_lines(x: Expr, fraction: Expr) -> Expr:
    """The length of the lines between 0 and x."""
    lines = floor(x + 0.5)
    return fraction * lines + clamp(x - lines, -0.5 * fraction, 0.5 * fraction)


def _across(name: str, axis: str) -> tuple[int, int]:
    """The two axes at right angles to one."""
    chosen = choice(f"{name}: axis", axis, AXES, "'x', 'y' or 'z'")
    first, second = (i for i in range(3) if AXES[i] != chosen)
    return first, second


def _pair(name: str, a: Any, b: Any) -> tuple[Expr, Expr]:
    """Two values, both numbers or both colours."""
    first, second = (as_operand(name, linear_color(name, v), "two numbers, or two colours") for v in (a, b))
    if first.type is FLOAT and second.type is not FLOAT:
        first = construct(first, first, first)
    if second.type is FLOAT and first.type is not FLOAT:
        second = construct(second, second, second)
    if first.type is not second.type:
        raise SceneError(f"{name}: {short(a)} and {short(b)}", legal="two numbers, or two colours")
    return first, second
