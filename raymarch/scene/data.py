"""Arrays of the user as values of materials: numbers in space, and the colours of numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import evaluator
from raymarch.expr.calls import checked
from raymarch.expr.color_maps import MAPS, SHARE, encoded, interpolated
from raymarch.expr.colors import linear_color
from raymarch.expr.convert import numbers, numbers_or_missing, short
from raymarch.expr.maths import of_vectors
from raymarch.expr.node import Expr, expr
from raymarch.expr.samples import Samples, sample
from raymarch.expr.srgb import srgb_to_linear
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import abs, where
from raymarch.expr.walk import topological
from raymarch.files import install
from raymarch.scene.parameter import as_number, as_vec3
from raymarch.sdf.domain import ColorLike, Domain, Scalar, Vector
from raymarch.sdf.sampled import finite_grid

MISSING = 3e38
"""What `sampled` gives where a value is missing. It is finite in float32, and scaled it stays beyond `BEYOND`."""
BEYOND = 1e30
ROWS = 103
"""Colours that are taken from a map of matplotlib. Linear interpolation errs by 3/255 in RdBu, by 6/255 in hsv."""


@checked
def sampled(
    values: ArrayLike, size: Vector | Scalar = (2.0, 2.0, 2.0), center: Vector = (0.0, 0.0, 0.0)
) -> Callable[[Any], Any]:
    """Numbers on a regular grid as a function of the point: a temperature, a charge, a speed, to colour a surface by.

    Parameters
    ----------
    values : shape (nx, ny, nz), each 2 to 2048: values[i, j, k] is that at the i-th x, j-th y and k-th z, in any unit.
        The outermost samples lie on the faces of the box, as those of `isosurface` and `grid`. Where a value is
        missing, NaN or masked, the function gives 3e38, which `colormap` shows in its colour for missing values.
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
    array = finite_grid("sampled", values, "numbers", missing=True)
    lacks = np.isnan(array)
    data, cells = Samples(_filled(array, lacks).transpose(2, 1, 0)), tuple(float(n - 1) for n in array.shape)
    gaps = Samples(lacks.astype(np.float64).transpose(2, 1, 0)) if lacks.any() else None
    whole = Domain(VEC3, low=0.0, open=True, stretch=True).accept("sampled", "size", size)
    middle = as_vec3("sampled: center", center)

    def value(p: Expr) -> Expr:
        if (at := expr(p)).type is not VEC3:
            raise SceneError(f"sampled at a {at.type}", legal="points (x, y, z)")
        place = ((at - middle) / whole + 0.5) * cells
        found = sample(data, place)
        return found if gaps is None else where(sample(gaps, place) > 0.5, MISSING, found)

    return of_vectors(value, "sampled")


def _filled(array: NDArray[np.float64], lacks: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Values in which each missing one is the mean of its known neighbours, layer by layer, so that interpolation near
    the border is by known values."""
    found, lacks = np.where(lacks, 0.0, array), lacks.copy()
    while lacks.any():
        total, count = np.zeros(array.shape), np.zeros(array.shape)
        for axis in range(3):
            known, sums, counts = (np.moveaxis(part, axis, 0) for part in (~lacks, total, count))
            values = np.moveaxis(found, axis, 0) * known
            for to, neighbour in ((slice(None, -1), slice(1, None)), (slice(1, None), slice(None, -1))):
                sums[to] += values[neighbour]
                counts[to] += known[neighbour]
        reached = lacks & (count > 0)
        found[reached] = total[reached] / count[reached]
        lacks &= ~reached
    return found


@checked
def colormap(
    value: Any,
    colors: str | Sequence[ColorLike] = "viridis",
    low: Scalar = 0.0,
    high: Scalar = 1.0,
    missing: ColorLike = (0.5, 0.5, 0.5),
) -> Any:
    """The colours of numbers: linear RGB.

    Parameters
    ----------
    value : an expression, a number, or an array of any shape.
    colors : "viridis", "inferno" or "coolwarm", or, where matplotlib is installed, any of its maps, such as "magma_r";
        or two or more colours at equal steps of the value, between which linear RGB is interpolated.
    low, high : the values of the first and of the last colour. Values beyond them have these colours.
    missing : the colour of NaN and masked elements of an array, and of what `sampled` gives where a value is missing.

    Returns
    -------
    Any
        A vec3 for an expression, else an array with the shape of `value` and a last axis of 3, as `Material` and
        `instances` take.

    Raises
    ------
    SceneError : arguments of another kind or outside their range.
    """
    legal = f"{', '.join(map(repr, MAPS))}, a map of matplotlib if it is installed, or two or more colours"
    if isinstance(colors, str):
        rows = srgb_to_linear(_map_of(colors, legal))
    else:
        listed: Any = np.asarray(colors) if hasattr(colors, "__array__") else colors
        if not isinstance(listed, Sequence | np.ndarray) or not np.iterable(listed):
            raise SceneError(f"colormap: colors = {short(colors)}", legal=legal)
        rows = numbers("colormap: colors", [linear_color("colormap: colors", color) for color in listed], legal)
        if rows.ndim != 2 or rows.shape[1] != 3 or len(rows) < 2 or not np.all(np.isfinite(rows)):
            raise SceneError(f"colormap: colors = {short(colors)}", legal=legal)
    absent = expr(linear_color("colormap: missing", missing))
    if absent.type is not VEC3 or not absent.is_constant:
        raise SceneError(f"colormap: missing = {short(missing)}", legal="a colour of numbers")
    first, last = as_number("colormap: low", low), as_number("colormap: high", high)
    if first.is_constant and last.is_constant and first.data == last.data:
        raise SceneError(f"colormap: low = high = {short(low)}", legal="two different numbers")
    made = interpolated(rows.tolist(), "color_map")
    if isinstance(value, Expr):
        mapped = made((value - first) / (last - first))
        return where(abs(value) < BEYOND, mapped, absent) if _may_lack(value) else mapped
    legal = "an expression, a number, or an array of numbers"
    legal = f"{legal}; of a function, lambda p: colormap(values(p))" if callable(value) else legal
    given = numbers_or_missing("colormap: value", value, legal)
    if not (first.is_constant and last.is_constant):
        raise SceneError("colormap of numbers between expressions", legal="low and high as numbers")
    lacks = np.isnan(given) | (np.abs(given) >= BEYOND) & np.isfinite(given)
    share = (np.where(lacks, 0.0, given) - first.data) / (np.asarray(last.data) - first.data)
    found = evaluator([made.body], [SHARE])(share.reshape(-1))[0]
    found = np.broadcast_to(found, (given.size, 3)).reshape((*given.shape, 3))
    return np.where(lacks[..., None], absent.data, found)


def _map_of(name: str, legal: str) -> NDArray[np.float64]:
    """The colours of a map, sRGB in [0, 1], (N, 3)."""
    if name in MAPS:
        return np.array(encoded(name))
    try:
        import matplotlib
    except ImportError:
        raise SceneError(f"colormap: colors = {short(name)}", legal=f"{legal}; {install('report')}") from None
    if name not in matplotlib.colormaps:
        raise SceneError(f"colormap: colors = {short(name)}", legal=legal)
    return np.asarray(matplotlib.colormaps[name](np.linspace(0.0, 1.0, ROWS)), np.float64)[:, :3]


def _may_lack(value: Expr) -> bool:
    """True if an expression reads samples of which some are missing."""
    return any(node.is_constant and node.type is FLOAT and node.data == MISSING for node in topological([value]))
