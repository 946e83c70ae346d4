"""Fields from data: a grid of distances, a mesh file, a height map that displaces a plane or another surface.

Sampled distances are interpolated linearly, so the zero set is a piecewise hyperbolic surface near the true one. The
field is a bound on the distance to that surface, because it is divided by its steepest slope.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import SceneError, warn
from raymarch.expr.arrays import SMALLEST
from raymarch.expr.calls import checked
from raymarch.expr.convert import numbers, numbers_or_missing, short
from raymarch.expr.function import sum_of
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, expr
from raymarch.expr.samples import Samples, sample
from raymarch.expr.vocabulary import clamp, length, max, min, vec2
from raymarch.sdf.definition import shape
from raymarch.sdf.domain import Data, Number, Scalar, Size3, Vec3, Vector, domain_of
from raymarch.sdf.node import Node
from raymarch.sdf.offsets import offset
from raymarch.sdf.solids import box
from raymarch.sdf.values import with_bound

__all__ = ["grid", "isosurface"]

MOST = 2048
"""Maximum number of samples along each axis."""


def texels(data: Samples) -> NDArray[np.float64]:
    """Cells along each axis."""
    return np.array(data.size, np.float64) - 1.0


def _steepness(data: Samples, size: Any) -> Expr:
    """The field is no steeper than its data where cells are smallest; outside the box it grows with the distance."""
    cell = expr(size) / tuple(texels(data))
    return max(data.steepest / min(cell.x, min(cell.y, cell.z)), 1.0)


def _solid_box(data: Samples, size: Any, center: Any) -> tuple[Expr, Expr]:
    """The cells that may contain part of the solid: those with a corner that is not outside."""
    inside = data.values <= 0.0
    if not inside.any():
        return expr(center), expr(center)
    where = np.nonzero(inside)[::-1]
    counts = np.array(data.size)
    low = np.array([np.maximum(w.min() - 1, 0) for w in where]) / (counts - 1)
    high = np.array([np.minimum(w.max() + 1, n - 1) for w, n in zip(where, counts, strict=True)]) / (counts - 1)
    lower = expr(center) + expr(size) * tuple(low - 0.5)
    return lower, expr(center) + expr(size) * tuple(high - 0.5)


def _grid_spread(data: Samples, size: Any) -> Expr:
    """The largest ratio of a sample's distance to the box of the solid, along an axis, to its value; not less between
    samples, where both are interpolated. Outside the grid the distance to it is added, as in the field."""
    inside = data.values <= 0.0
    if not inside.any():
        return expr(np.inf)
    ratios = []
    for axis in (2, 1, 0):
        others = tuple({0, 1, 2} - {axis})
        within = np.nonzero(inside.any(axis=others))[0]
        at = np.arange(inside.shape[axis])
        cells = np.maximum(np.maximum(within.min() - 1 - at, at - within.max() - 1), 0)
        least = np.min(data.values, axis=others, where=~inside, initial=np.inf)
        ratios.append(float(np.max(cells / np.maximum(least, SMALLEST))))
    cell = expr(size) / tuple(texels(data))
    ratio = max(cell.x * ratios[0], max(cell.y * ratios[1], cell.z * ratios[2]))
    return length(vec2(1.0, ratio * _steepness(data, size)))


def _some_grid() -> Samples:
    """A ball of radius 0.8 in a box of side 2: the example that `grid()` shows."""
    axis = np.linspace(-1.0, 1.0, 24)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    return Samples(np.sqrt(x * x + y * y + z * z) - 0.8)


BALL = _some_grid()


@shape(
    exactness="bound",
    bounds=_solid_box,
    lipschitz=lambda data, size: length(vec2(1.0, _steepness(data, size))),
    spread=_grid_spread,
    called="grid",
)
def sampled_grid(p: Expr, data: Data = BALL, size: Size3 = (2.0, 2.0, 2.0), center: Vec3 = (0.0, 0.0, 0.0)) -> Expr:
    """Distances on a regular grid whose outermost samples lie on the faces of a box."""
    q = p - center
    inside = clamp(q, -0.5 * size, 0.5 * size)
    value = sample(data, (inside / size + 0.5) * tuple(texels(data)))
    # Every point x of the solid lies in the convex box, so with c the nearest point of the box
    # |p - x|^2 >= |p - c|^2 + |c - x|^2: the two distances add like the sides of a right triangle.
    beyond, bound = length(q - inside), value / _steepness(data, size)
    # The sum of the two is right where the way out of the box is along the normal: at faces that the solid touches.
    return with_bound(beyond + value, length(vec2(beyond, max(bound, 0.0))) + min(bound, 0.0))


@checked
def grid(values: ArrayLike, size: Vector | Scalar = (2.0, 2.0, 2.0), center: Vector = (0.0, 0.0, 0.0)) -> Node:
    """A solid from signed distances on a regular grid.

    Parameters
    ----------
    values : shape (nx, ny, nz), each 2 to 2048: values[i, j, k] is the distance at the i-th x, j-th y and k-th z, in
        any unit. The outermost samples lie on the faces of the box and must not be inside the solid.
    size : full extents of the box, > 0.
    center : centre of the box.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    Interpolated linearly. A bound: the values are divided by their steepest slope. Values away from the surface that
    are steeper than twice the steepest slope there, such as 1e10 for unknown ones, are reduced. Outside the box the
    field combines the distance to the box and the sample at the nearest point of the box.
    """
    array = finite_grid("grid", values, "distances")
    if (least := _least_on_faces(array)) < 0.0:
        raise SceneError(
            f"grid: the solid reaches the box, a distance on its faces is {least:g}",
            legal="samples on the faces of the box >= 0: a larger box, or grid(...) & box(...) of padded samples; "
            "rm.isosurface(values, level) for values that are no distances",
        )
    if array.min() > 0.0:
        warn(f"grid: no distance is negative, {array.min():g} at least: an empty solid (distances < 0 are inside)")
    whole = domain_of(Size3, None).accept("grid", "size", size)
    return sampled_grid(_as_distances(array, interval_of(whole)[0]), whole, center)


@checked
def isosurface(
    values: ArrayLike, level: Scalar, size: Vector | Scalar = (2.0, 2.0, 2.0), center: Vector = (0.0, 0.0, 0.0)
) -> Node:
    """The solid where values on a regular grid are at least a level: of a density, a CT scan, a potential.

    Parameters
    ----------
    values : shape (nx, ny, nz), each 2 to 2048: values[i, j, k] is that at the i-th x, j-th y and k-th z, in any unit.
        The outermost samples lie on the faces of the box. Where they are above the level, the solid ends at the box.
        Where a value is missing, NaN or masked, nothing is solid: it counts as the least value.
    level : a number in the unit of the values, or an expression of a `Param` with min and max, which changes without a
        recompile. `isosurface(-values, -level)` is the solid below a level.
    size : full extents of the box, numbers > 0.
    center : centre of the box.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : arguments of another kind or outside their range.

    Notes
    -----
    A bound. The values are mapped by an increasing function, so that each level has the slope 1 where it is steepest;
    then they are interpolated linearly. So a density that decays far away is marched as fast there as near its peak.
    """
    array = finite_grid("isosurface", values, "numbers", missing=True)
    array = np.where(np.isnan(array), np.nanmin(array), array)
    at = domain_of(Number, None).accept("isosurface", "level", level)
    whole = domain_of(Size3, None).accept("isosurface", "size", size)
    if not whole.is_constant:
        raise SceneError(f"isosurface: size = {short(size)}", legal="numbers, because slopes depend on them")
    extents = np.asarray(whole.data, np.float64)
    if not np.all(np.isfinite(interval_of(at))):
        raise SceneError("isosurface: level has no least and largest value", legal="rm.Param(name, value, min, max)")
    reach = float(np.ptp(array)) + 1.0
    lowest, highest = (float(np.clip(end, array.min() - reach, array.max() + reach)) for end in interval_of(at))
    values_at, heights = _evened(array, extents / (np.array(array.shape) - 1.0))
    if highest > array.max():
        exceeds = "exceeds" if at.is_constant else "can exceed"
        warn(f"isosurface: level = {short(level)} {exceeds} all values, {array.max():g} at most: an empty solid")
    if at.is_constant and highest < array.min():
        warn(f"isosurface: level = {short(level)} is below all values, {array.min():g} at least: all of the box")
    least = _mapped(lowest, values_at, heights) if at.is_constant else np.interp(lowest, values_at, heights)
    outside = least - np.interp(array, values_at, heights)
    if at.is_constant:
        solid = sampled_grid(_as_distances(outside, extents, "isosurface"), size, center)
    else:
        solid = sampled_grid(Samples(outside.transpose(2, 1, 0), "isosurface"), size, center)
        inner = values_at[(values_at > lowest) & (values_at < highest)]
        ends = np.clip([lowest, *inner, highest], values_at[0], values_at[-1])
        steps = np.diff(np.interp(ends, values_at, heights)) / np.maximum(np.diff(ends), np.finfo(float).tiny)
        pieces = [
            (clamp(at, low, high) - low) * step
            for (low, high), step in zip(pairwise(ends.tolist()), steps.tolist(), strict=True)
            if low < high
        ]
        solid = offset(solid, -max(sum_of(pieces), 0.0))
    return solid if _least_on_faces(outside) >= 0.0 else solid & box(extents).translate(center)


def finite_grid(what: str, values: ArrayLike, kind: str, missing: bool = False) -> NDArray[np.float64]:
    """Values on a grid of three axes, checked. missing : let NaN and masked values pass, but not all; they are NaN."""
    convert = numbers_or_missing if missing else numbers
    array = convert(f"{what}: values", values, f"{kind}, (nx, ny, nz), each 2 to 2048")
    if array.ndim != 3:
        raise SceneError(f"{what}: values of shape {array.shape}", legal="(nx, ny, nz)")
    if missing and not np.all(np.isnan(array)):
        refuse_broken(what, np.isinf(array), "values", "finite numbers, and NaN or masked where one is missing")
        return array
    refuse_broken(what, ~np.isfinite(array), "values", "finite numbers")
    return array


def refuse_broken(what: str, broken: NDArray[np.bool_], of: str, legal: str) -> None:
    """SceneError if some numbers are not finite, with how many."""
    if broken.any():
        raise SceneError(f"{what}: {np.sum(broken)} of {broken.size} {of} are not finite", legal=legal)


def _as_distances(array: NDArray[np.float64], size: Any, called: str = "") -> Samples:
    """Values in a box of that size as distances: the same surface, and the usual slope 1 there. called : see `Samples`.

    Cells that hold the surface keep their values. No other value exceeds what twice the steepest slope there allows.
    """
    cells = np.asarray(size, np.float64) / (np.array(array.shape) - 1.0)
    cell = np.min(cells)
    if not (array.min() <= 0.0 < array.max() and 0.0 < cell < np.inf):
        return Samples(array.transpose(2, 1, 0), called)
    values = array / np.abs(array).max()
    low, high, slopes = _cells(values)
    crossed = (low <= 0.0) & (high > 0.0)
    allowed = 4.0 * np.max(slopes, where=crossed, initial=0.0)
    if slopes.max() > allowed:
        kept = np.pad(crossed, 1)
        for axis in range(3):
            kept = _over_ends(np.logical_or, kept, axis)
        step = float(np.sqrt(allowed))
        values = np.where(kept, values, np.where(values > 0.0, _limited(values, step), -_limited(-values, step)))
    return Samples(values.transpose(2, 1, 0) / _usual_slope(values, crossed, cells), called)


def _usual_slope(values: NDArray[np.float64], crossed: NDArray[np.bool_], cell: NDArray[np.float64]) -> float:
    """The median slope in the middle of the cells that hold the surface."""
    square = np.zeros(values.shape - np.array(1))
    for axis in range(3):
        step = np.diff(values, axis=axis) / cell[axis]
        for other in {0, 1, 2} - {axis}:
            step = _over_ends(lambda a, b: 0.5 * (a + b), step, other)
        square += step**2
    return float(np.sqrt(np.median(square[crossed & (square > 0.0)]))) if np.any(crossed & (square > 0.0)) else 1.0


def _limited(values: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Values above 0, reduced so that none exceeds a neighbour by more than a step."""
    found = np.maximum(values, 0.0)
    for axis in range(3):
        along = np.moveaxis(found, axis, 0)
        rise = (step * np.arange(len(along)))[:, None, None]
        ahead = np.minimum.accumulate(along - rise) + rise
        behind = np.minimum.accumulate((along + rise)[::-1])[::-1] - rise
        limit = np.minimum(ahead, behind)
        along[...] = np.where(limit < along * (1.0 - 1e-12), limit, along)
    return found


LEVELS = 33
"""Values between which an isosurface is mapped linearly: at equal shares of the samples, and as many at equal steps."""


def _evened(array: NDArray[np.float64], cell: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values, and the heights to which they are mapped so that no slope exceeds 1: the integral of 1 over the steepest
    slope of the cells that hold a value."""
    low, high, slopes = _cells(array, cell)
    share = np.linspace(0.0, 1.0, LEVELS)
    values = np.unique([np.quantile(array, share), array.min() + np.ptp(array) * share])
    if len(values) < 2:
        return np.array([values[0], values[0] + 1.0]), np.array([0.0, 1.0])
    steepest = np.sqrt([np.max(slopes, where=(high > a) & (low < b), initial=0.0) for a, b in pairwise(values)])
    heights = np.cumsum(np.diff(values) / np.maximum(steepest, 1e-6 * steepest.max()))
    return values, np.concatenate([[0.0], heights])


def _cells(array: NDArray[np.float64], cell: Any = (1.0, 1.0, 1.0)) -> tuple[NDArray[np.float64], ...]:
    """The least and the largest value of each cell, and the square of its steepest slope."""
    low, high, slopes = array, array, np.zeros(np.array(array.shape) - 1)
    for axis in range(3):
        step = np.abs(np.diff(array, axis=axis)) / cell[axis]
        for other in {0, 1, 2} - {axis}:
            step = _over_ends(np.maximum, step, other)
        slopes += step**2
        low, high = _over_ends(np.minimum, low, axis), _over_ends(np.maximum, high, axis)
    return low, high, slopes


def _over_ends(choose: Any, array: NDArray[Any], axis: int) -> NDArray[Any]:
    """The larger or smaller of the two ends of each cell along an axis."""
    ends = np.moveaxis(array, axis, 0)
    return np.moveaxis(choose(ends[:-1], ends[1:]), 0, axis)


def _mapped(value: float, values: NDArray[np.float64], heights: NDArray[np.float64]) -> float:
    """A value mapped; beyond the samples the map continues with the slope of its end."""
    end = 0 if value < values[0] else -2
    beyond = value - np.clip(value, values[0], values[-1])
    slope = (heights[end + 1] - heights[end]) / (values[end + 1] - values[end])
    return float(np.interp(value, values, heights) + beyond * slope)


def _least_on_faces(array: NDArray[np.float64]) -> float:
    return float(np.min([array.take(end, axis=axis).min() for axis in range(3) for end in (0, -1)]))
