"""Arrays of the user as values of materials: numbers in space, and the colours of numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from raymarch.errors import SceneError
from raymarch.expr.arrays import evaluator
from raymarch.expr.calls import checked
from raymarch.expr.color_maps import MAPS, SHARE, encoded, interpolated
from raymarch.expr.colors import linear_color
from raymarch.expr.convert import numbers, short
from raymarch.expr.maths import of_vectors
from raymarch.expr.node import Expr, expr
from raymarch.expr.samples import Samples, sample
from raymarch.expr.srgb import srgb_to_linear
from raymarch.expr.types import VEC3
from raymarch.scene.parameter import as_number, as_vec3
from raymarch.sdf.domain import ColorLike, Domain, Scalar, Vector
from raymarch.sdf.sampled import finite_grid


@checked
def sampled(
    values: ArrayLike, size: Vector | Scalar = (2.0, 2.0, 2.0), center: Vector = (0.0, 0.0, 0.0)
) -> Callable[[Any], Any]:
    """Numbers on a regular grid as a function of the point: a temperature, a charge, a speed, to colour a surface by.

    Parameters
    ----------
    values : shape (nx, ny, nz), each 2 to 2048: values[i, j, k] is that at the i-th x, j-th y and k-th z, in any unit.
        The outermost samples lie on the faces of the box, as those of `isosurface` and `grid`.
    size : full extents of the box, numbers > 0.
    center : centre of the box.

    Returns
    -------
    Callable[[Any], Any]
        A function of a point, for values of materials, skies and lights, and for arrays of points (..., 3).

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    It interpolates linearly; outside of the box the value is that of the nearest point of the box. A function that is
    given to `displace_by` with it needs `lipschitz`.
    """
    array = finite_grid("sampled", values, "numbers")
    data, cells = Samples(array.transpose(2, 1, 0)), tuple(float(n - 1) for n in array.shape)
    whole = Domain(VEC3, low=0.0, open=True, stretch=True).accept("sampled", "size", size)
    middle = as_vec3("sampled: center", center)

    def value(p: Expr) -> Expr:
        if (at := expr(p)).type is not VEC3:
            raise SceneError(f"sampled at a {at.type}", legal="points (x, y, z)")
        return sample(data, ((at - middle) / whole + 0.5) * cells)

    return of_vectors(value, "sampled")


@checked
def colormap(value: Any, colors: str | Sequence[ColorLike] = "viridis", low: Scalar = 0.0, high: Scalar = 1.0) -> Any:
    """The colours of numbers: linear RGB.

    Parameters
    ----------
    value : an expression, a number, or an array of any shape.
    colors : "viridis", "inferno" or "coolwarm", which are maps of matplotlib; or two or more colours at equal steps of
        the value, between which linear RGB is interpolated.
    low, high : the values of the first and of the last colour. Values beyond them have these colours.

    Returns
    -------
    Any
        A vec3 for an expression, else an array with the shape of `value` and a last axis of 3, as `Material` and
        `instances` take.

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    legal = f"{', '.join(map(repr, MAPS))}, or two or more colours"
    if isinstance(colors, str):
        if colors not in MAPS:
            raise SceneError(f"colormap: colors = {short(colors)}", legal=legal)
        rows = srgb_to_linear(np.array(encoded(colors)))
    else:
        if not isinstance(colors, Sequence | np.ndarray) or not np.iterable(colors):
            raise SceneError(f"colormap: colors = {short(colors)}", legal=legal)
        rows = numbers("colormap: colors", [linear_color("colormap: colors", color) for color in colors], legal)
        if rows.ndim != 2 or rows.shape[1] != 3 or len(rows) < 2 or not np.all(np.isfinite(rows)):
            raise SceneError(f"colormap: colors = {short(colors)}", legal=legal)
    first, last = as_number("colormap: low", low), as_number("colormap: high", high)
    if first.is_constant and last.is_constant and first.data == last.data:
        raise SceneError(f"colormap: low = high = {short(low)}", legal="two different numbers")
    made = interpolated(rows.tolist(), "color_map")
    if isinstance(value, Expr):
        return made((value - first) / (last - first))
    given = numbers("colormap: value", value, "an expression, a number, or an array of numbers")
    if not (first.is_constant and last.is_constant):
        raise SceneError("colormap of numbers between expressions", legal="low and high as numbers")
    share = (given - first.data) / (np.asarray(last.data) - first.data)
    found = evaluator([made.body], [SHARE])(share.reshape(-1))[0]
    return np.broadcast_to(found, (given.size, 3)).reshape((*given.shape, 3)).copy()
