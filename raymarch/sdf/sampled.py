"""Fields from data: a grid of distances, a mesh file, a height map that displaces a plane or another surface.

Sampled distances are interpolated linearly, so the zero set is a piecewise hyperbolic surface near the true one. The
field is a bound on the distance to that surface, because it is divided by its steepest slope.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch import cache as disk
from raymarch.errors import SceneError, warn
from raymarch.expr.arrays import SMALLEST
from raymarch.expr.calls import checked
from raymarch.expr.convert import file_path, input_file, integer, numbers, optional, real, short
from raymarch.expr.function import sum_of
from raymarch.expr.images import opened
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import Expr, expr
from raymarch.expr.samples import Samples, sample
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import clamp, length, max, min, vec2, vec3
from raymarch.files import reading
from raymarch.sdf.definition import Child, operator, shape
from raymarch.sdf.deform import offset
from raymarch.sdf.domain import Data, Domain, NonNegative, Scalar, Size2, Size3, Vec3, Vector
from raymarch.sdf.mesh_files import LEGAL, Beside, read_mesh
from raymarch.sdf.nearest import Surface
from raymarch.sdf.node import Node, method
from raymarch.sdf.solids import box
from raymarch.sdf.values import with_bound

__all__ = ["grid", "heightmap", "isosurface", "mesh"]

Progress = Callable[[float], None]

MOST = 2048
"""Maximum number of samples along each axis."""


def _texels(data: Samples) -> NDArray[np.float64]:
    """Cells along each axis."""
    return np.array(data.size, np.float64) - 1.0


def _steepness(data: Samples, size: Any) -> Expr:
    """The field is no steeper than its data where cells are smallest; outside the box it grows with the distance."""
    cell = expr(size) / tuple(_texels(data))
    return max(data.steepest / min(cell.x, min(cell.y, cell.z)), 1.0)


def _solid_box(data: Samples, size: Any, centre: Any) -> tuple[Expr, Expr]:
    """The cells that may contain part of the solid: those with a corner that is not outside."""
    inside = data.values <= 0.0
    if not inside.any():
        return expr(centre), expr(centre)
    where = np.nonzero(inside)[::-1]
    counts = np.array(data.size)
    low = np.array([np.maximum(w.min() - 1, 0) for w in where]) / (counts - 1)
    high = np.array([np.minimum(w.max() + 1, n - 1) for w, n in zip(where, counts, strict=True)]) / (counts - 1)
    lower = expr(centre) + expr(size) * tuple(low - 0.5)
    return lower, expr(centre) + expr(size) * tuple(high - 0.5)


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
    cell = expr(size) / tuple(_texels(data))
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
)
def sampled_grid(p: Expr, data: Data = BALL, size: Size3 = (2.0, 2.0, 2.0), centre: Vec3 = (0.0, 0.0, 0.0)) -> Expr:
    """Distances on a regular grid whose outermost samples lie on the faces of a box."""
    q = p - centre
    inside = clamp(q, -0.5 * size, 0.5 * size)
    value = sample(data, (inside / size + 0.5) * tuple(_texels(data)))
    # Every point x of the solid lies in the convex box, so with c the nearest point of the box
    # |p - x|^2 >= |p - c|^2 + |c - x|^2: the two distances add like the sides of a right triangle.
    beyond, bound = length(q - inside), value / _steepness(data, size)
    # The sum of the two is right where the way out of the box is along the normal: at faces that the solid touches.
    return with_bound(beyond + value, length(vec2(beyond, max(bound, 0.0))) + min(bound, 0.0))


@checked
def grid(values: ArrayLike, size: Vector | Scalar = (2.0, 2.0, 2.0), centre: Vector = (0.0, 0.0, 0.0)) -> Node:
    """A solid from signed distances on a regular grid.

    Parameters
    ----------
    values : shape (nx, ny, nz), each 2 to 2048: values[i, j, k] is the distance at the i-th x, j-th y and k-th z, in
        any unit. The outermost samples lie on the faces of the box and must not be inside the solid.
    size : full extents of the box, > 0.
    centre : centre of the box.

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
    whole = Domain(VEC3, low=0.0, open=True, stretch=True).accept("grid", "size", size)
    return sampled_grid(_as_distances(array, interval_of(whole)[0]), whole, centre)


@checked
def isosurface(
    values: ArrayLike, level: Scalar, size: Vector | Scalar = (2.0, 2.0, 2.0), centre: Vector = (0.0, 0.0, 0.0)
) -> Node:
    """The solid where values on a regular grid are at least a level: of a density, a CT scan, a potential.

    Parameters
    ----------
    values : shape (nx, ny, nz), each 2 to 2048: values[i, j, k] is that at the i-th x, j-th y and k-th z, in any unit.
        The outermost samples lie on the faces of the box. Where they are above the level, the solid ends at the box.
    level : a number in the unit of the values, or an expression of a `Param` with min and max, which changes without a
        recompile. `isosurface(-values, -level)` is the solid below a level.
    size : full extents of the box, numbers > 0.
    centre : centre of the box.

    A bound. The values are mapped by an increasing function, so that each level has the slope 1 where it is steepest;
    then they are interpolated linearly. So a density that decays far away is marched as fast there as near its peak.
    """
    array = finite_grid("isosurface", values, "numbers")
    at = Domain(FLOAT).accept("isosurface", "level", level)
    whole = Domain(VEC3, low=0.0, open=True, stretch=True).accept("isosurface", "size", size)
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
    least = _mapped(lowest, values_at, heights) if at.is_constant else np.interp(lowest, values_at, heights)
    outside = least - np.interp(array, values_at, heights)
    if at.is_constant:
        solid = sampled_grid(_as_distances(outside, extents), size, centre)
    else:
        solid = sampled_grid(Samples(outside.transpose(2, 1, 0)), size, centre)
        inner = values_at[(values_at > lowest) & (values_at < highest)]
        ends = np.clip([lowest, *inner, highest], values_at[0], values_at[-1])
        steps = np.diff(np.interp(ends, values_at, heights)) / np.maximum(np.diff(ends), np.finfo(float).tiny)
        pieces = [
            (clamp(at, low, high) - low) * step
            for (low, high), step in zip(pairwise(ends.tolist()), steps.tolist(), strict=True)
            if low < high
        ]
        solid = offset(solid, -max(sum_of(pieces), 0.0))
    return solid if _least_on_faces(outside) >= 0.0 else solid & box(extents).translate(centre)


def finite_grid(what: str, values: ArrayLike, kind: str) -> NDArray[np.float64]:
    """Values on a grid of three axes, checked."""
    array = numbers(f"{what}: values", values, f"{kind}, (nx, ny, nz), each 2 to 2048")
    if array.ndim != 3:
        raise SceneError(f"{what}: values of shape {array.shape}", legal="(nx, ny, nz)")
    _refuse_broken(what, ~np.isfinite(array), "values", "finite numbers")
    return array


def _refuse_broken(what: str, broken: NDArray[np.bool_], of: str, legal: str) -> None:
    """SceneError if some numbers are not finite, with how many."""
    if broken.any():
        raise SceneError(f"{what}: {np.sum(broken)} of {broken.size} {of} are not finite", legal=legal)


def _as_distances(array: NDArray[np.float64], size: Any) -> Samples:
    """Values in a box of that size as distances: the same surface, and the usual slope 1 there.

    Cells that hold the surface keep their values. No other value exceeds what twice the steepest slope there allows.
    """
    cells = np.asarray(size, np.float64) / (np.array(array.shape) - 1.0)
    cell = np.min(cells)
    if not (array.min() <= 0.0 < array.max() and 0.0 < cell < np.inf):
        return Samples(array.transpose(2, 1, 0))
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
    return Samples(values.transpose(2, 1, 0) / _usual_slope(values, crossed, cells))


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


@checked
def mesh(
    file: str | os.PathLike[str],
    extent: float | None = None,
    resolution: int = 64,
    progress: Progress | None = None,
    cache: str | os.PathLike[str] | None = None,
) -> Node:
    """A closed triangle mesh as a field, sampled once and cached.

    Parameters
    ----------
    file : a file that trimesh reads: STL, OBJ, PLY, GLB, ... Other files that it names must be in its folder.
    extent : scale the mesh to this largest extent and centre it at the origin. None keeps its coordinates.
    resolution : samples along its largest extent, 8 to 256.
    progress : called with the fraction done, 0 to 1.
    cache : folder of the cache, which is keyed by content; default $RAYMARCH_CACHE, or the user's cache.

    A mesh that is inside out, as a whole or in a part, is reversed. Triangles wound against their neighbours are
    reversed too. A SceneWarning reports both, and parts that are missing because they are thinner than the distance of
    samples. Lengths are used unchanged: files do not state their unit.

    Needs the extra `mesh` (trimesh, rtree, scipy). Raises SceneError for a file that cannot be read or holds no
    triangles, for vertices that are not finite, and for a mesh that is open, non-manifold, one-sided or flat, or cuts
    itself so that inside and outside are not clear.
    """
    resolution = integer("mesh: resolution", resolution, 8, 256)
    extent = optional(_extent, "mesh: extent", extent)
    file = input_file("mesh: file", file, "a mesh file")
    folder = None if cache is None else file_path("mesh: cache", cache, "a folder")
    if progress is not None and not callable(progress):
        raise SceneError(f"mesh: progress = {short(progress)}", legal="a function of the fraction done, or None")
    with reading("mesh", file, LEGAL):
        content = Path(file).read_bytes()
    key = hashlib.sha256(content + f"{extent} {resolution} {Path(file).suffix.lower()} 6".encode()).hexdigest()
    kept = disk.folder() if folder is None else Path(folder)
    kept = kept and kept / f"mesh-{key[:24]}.npz"
    found = None if kept is None else _from_cache(kept, Path(file))
    if found is None:
        beside = Beside(Path(file).parent)
        solid, unit, repairs = _load_mesh(Path(file), content, beside, extent)
        *sampled, missing = _sample_mesh(solid, resolution, progress, f"mesh: '{file}'")
        values, size, centre = (unit * part for part in sampled)
        if missing > 0.01:
            repairs.append(
                f"mesh: '{file}': {100 * missing:.2g} % of the surface bounds parts thinner than the distance of "
                f"samples, {size[0] / (values.shape[2] - 1):.3g}, and is missing: resolution={resolution} is too "
                "small for them"
            )
        if kept is not None:
            texts = {"repairs": repairs, "names": [*beside.digests], "digests": [*beside.digests.values()]}
            arrays = {"values": values, "size": size, "centre": centre}
            if lost := disk.save(kept, arrays | {n: np.array(t, np.str_) for n, t in texts.items()}, compressed=True):
                warn(f"mesh: the cache {lost}: nothing is kept")
        found = sampled_grid(Samples(values), size, centre), repairs
    for repair in found[1]:
        warn(repair)
    return found[0]


def _from_cache(kept: Path, file: Path) -> tuple[Node, list[str]] | None:
    """Samples of an earlier run and its repairs; None if there are none, or with a warning if they are damaged, or if
    another file that the mesh names has changed since."""
    if not kept.exists():
        return None
    if (found := disk.load(kept)) is None:
        warn(f"mesh: the cache file '{kept}' cannot be read: it is made anew")
        return None
    if not Beside(file.parent).holds(dict(zip(found["names"].tolist(), found["digests"].tolist(), strict=True))):
        return None
    return sampled_grid(Samples(found["values"]), found["size"], found["centre"]), found["repairs"].tolist()


def _extent(what: str, value: Any) -> float:
    return real(what, value, float(np.finfo(np.float32).tiny), legal="a number > 0, or None")


def _load_mesh(file: Path, content: bytes, beside: Beside, extent: float | None) -> tuple[Any, float, list[str]]:
    """The mesh, closed and with outward normals; the unit of its coordinates, about its size; and the repairs."""
    solid = read_mesh(file, content, beside)
    _refuse_broken(f"mesh: '{file}'", ~np.isfinite(solid.vertices).all(axis=1), "vertices", "numbers")
    middle, largest = solid.bounds.mean(axis=0), float(solid.extents.max())
    unit = float(2.0 ** np.rint(np.log2(largest))) if largest > 0.0 else 1.0
    solid.apply_scale(1.0 / unit)  # first: the tolerances of trimesh are lengths, and it ignores small translations
    solid.apply_translation(-middle / unit)
    solid.merge_vertices(merge_tex=True, merge_norm=True)
    solid.update_faces(solid.nondegenerate_faces() & solid.unique_faces())
    if not len(solid.faces):
        raise SceneError(f"mesh: '{file}' holds no triangles with an area", legal="a mesh that has an inside")
    repairs = [f"mesh: '{file}': {repair}" for repair in _closed(solid, file)]
    if extent is None:
        solid.apply_translation(middle / unit)
    else:
        unit = extent * unit / largest
    return solid, unit, repairs


def _closed(solid: Any, file: Path) -> list[str]:
    """Orient the triangles of a mesh outwards; returns the repairs. SceneError if that is impossible."""
    edges, counts = np.unique(solid.edges_sorted, axis=0, return_counts=True)
    for wrong, what in ((counts < 2, "is not closed: {} edges have one triangle"), (counts > 2, _NON_MANIFOLD)):
        if wrong.any():
            cure = "a watertight mesh, which has an inside: close it in a modeller, or with trimesh.repair"
            raise SceneError(f"mesh: '{file}' {what.format(int(wrong.sum()))} of {len(edges)}", legal=cure)
    turned, part = _wound_alike(solid.faces)
    if turned is None:
        raise SceneError(f"mesh: '{file}' has one side only", legal="a mesh with an inside")
    original = solid.faces.copy()
    solid.faces = np.where(turned[:, None], original[:, ::-1], original)
    turned ^= _inside_out(solid, part, file)
    solid.faces = np.where(turned[:, None], original[:, ::-1], original)
    inverted = np.bincount(part, turned) == np.bincount(part)
    repairs = []
    if inverted.any():
        which = "it is" if inverted.all() else f"{inverted.sum()} of its {len(inverted)} parts are"
        repairs.append(f"{which} inside out; the triangles are turned")
    others = int(np.sum(turned & ~inverted[part]))
    if others:
        repairs.append(f"{others} of {len(turned)} triangles are wound against the others; they are turned")
    return repairs


_NON_MANIFOLD = "is not manifold: {} edges have more than two triangles"


def _wound_alike(faces: NDArray[Any]) -> tuple[NDArray[np.bool_] | None, NDArray[Any]]:
    """The triangles of a closed mesh whose orientation differs from the first of their part, and the part of each.

    Each triangle is two nodes of a graph, one for each orientation. Neighbours of equal orientation traverse their
    common edge in opposite directions. The first result is None for a one-sided mesh, such as a Klein bottle.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(faces)
    edges = np.concatenate([faces[:, (0, 1)], faces[:, (1, 2)], faces[:, (2, 0)]])
    order = np.lexsort(np.sort(edges, axis=1).T)
    (a, b), owner = (order[0::2], order[1::2]), np.tile(np.arange(n), 3)
    against = edges[a, 0] == edges[b, 0]
    i, j = owner[a], owner[b]
    rows, columns = np.concatenate([i, i + n]), np.concatenate([j + n * against, j + n * ~against])
    graph = coo_array((np.ones(2 * len(i), bool), (rows, columns)), shape=(2 * n, 2 * n))
    label = connected_components(graph, directed=False)[1]
    part = connected_components(coo_array((np.ones(len(i), bool), (i, j)), shape=(n, n)), directed=False)[1]
    if np.any(label[:n] == label[n:]):
        return None, part
    first = np.unique(part, return_index=True)[1]
    return label[:n] != label[first][part], part


def _inside_out(solid: Any, part: NDArray[Any], file: Path) -> NDArray[np.bool_]:
    """Triangles of the parts whose normals point to the wrong side: into a part, or out of a cavity that one has."""
    import trimesh

    corners = solid.triangles
    each = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    volumes = np.bincount(part, each)
    if np.any(np.abs(volumes) <= 1e-12 * np.bincount(part, solid.area_faces)):
        raise SceneError(f"mesh: '{file}' has a part without volume", legal="parts that have an inside")
    parts = [trimesh.Trimesh(solid.vertices, solid.faces[part == k]) for k in range(len(volumes))]
    around = [[j for j, other in enumerate(parts) if j != k and _holds(other, one)] for k, one in enumerate(parts)]
    outer = [volumes[k] < 0.0 and len(around[k]) % 2 == 0 for k in range(len(parts))]
    # A part inside an odd number of others is a cavity, and was turned along with the part around it.
    wrong = [outer[k] or (volumes[k] > 0.0 and any(outer[j] for j in around[k])) for k in range(len(parts))]
    return np.array(wrong)[part]


def _holds(other: Any, one: Any) -> bool:
    """True if one part lies in another."""
    boxed = np.all(other.bounds[0] < one.bounds[0]) and np.all(one.bounds[1] < other.bounds[1])
    return bool(boxed and other.ray.contains_points(one.vertices[:64]).all())


def _sample_mesh(solid: Any, resolution: int, progress: Progress | None, what: str) -> tuple[Any, Any, Any, float]:
    """Distances on a grid that leaves two cells of room on each side, slab by slab; its extents and its centre.

    The last result is the share of the surface that has no sample inside within a cell or so.
    """
    cell = float(solid.extents.max()) / (resolution - 5)
    counts = np.ceil(solid.extents / cell).astype(int) + 5
    size = cell * (counts - 1)
    centre = solid.bounds.mean(axis=0)
    x, y, z = (c + np.linspace(-s / 2, s / 2, n) for c, s, n in zip(centre, size, counts, strict=True))
    surface = Surface(solid, cell)
    values = np.empty(counts[::-1], np.float32)
    for k, height in enumerate(z):
        points = np.stack(np.broadcast_arrays(x[None, :], y[:, None], height), axis=-1).reshape(-1, 3)
        values[k] = surface.distances(points).reshape(len(y), len(x))
        if progress is not None:
            progress((k + 1) / len(z))
    jumps = np.max([np.abs(np.diff(values, axis=axis)).max() for axis in range(3)])
    if jumps > 1.25 * cell or values[0, 0, 0] < 0.0:
        legal = "a mesh that does not cut itself, no part of which lies in another but a cavity"
        raise SceneError(f"{what}: inside and outside are not clear", legal=legal)
    inside = np.pad(values <= 0.0, 1)
    for axis in range(3):
        inside |= np.roll(inside, 1, axis) | np.roll(inside, -1, axis)
    nearest = tuple(np.rint((surface.centres - centre + 0.5 * size) / cell).astype(int)[:, ::-1].T + 1)
    missing = float(surface.areas[~inside[nearest]].sum() / surface.areas.sum())
    if missing == 1.0:
        thin = f"every part of the mesh is thinner than the distance of samples, {cell:.3g}"
        raise SceneError(f"{what}: resolution = {resolution}: {thin}", legal="more samples, up to 256")
    return values, size, centre, missing


# Height maps


def luminance(source: str | os.PathLike[str] | ArrayLike, what: str) -> NDArray[np.float64]:
    """Heights from 0 to 1 of an image file (its luminance), or an array as it is; shape (rows, columns)."""
    legal = f"from 2 x 2 to {MOST} x {MOST} finite numbers"
    if isinstance(source, str | os.PathLike):
        source = input_file(f"{what}: source", source, "an image file")
        with opened(what, source, MOST, least=2) as picture:
            array = np.asarray(picture.convert("F"), np.float64) / (65535.0 if "16" in picture.mode else 255.0)
    else:
        array = numbers(f"{what}: source", source, f"an image file, or heights {legal}")
        if array.ndim != 2 or not 2 <= np.min(array.shape) <= np.max(array.shape) <= MOST:
            raise SceneError(f"{what}: heights of shape {array.shape}", legal=f"(rows, columns), {legal}")
    _refuse_broken(what, ~np.isfinite(array), "heights", legal)
    return array


def _carpet(data: Samples, size: Any, height: Any) -> Expr:
    cell = expr(size) / tuple(_texels(data))
    return data.steepest * height / min(cell.x, cell.y)


def _some_hills() -> Samples:
    """Gentle hills, for the example."""
    y, x = np.mgrid[0:1:32j, 0:1:32j]
    return Samples(0.5 + 0.5 * np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y))


HILLS = _some_hills()


@operator(
    bounds=lambda child, data, height: child.grown(max(float(data.values.max()), 0.0) * height),
    lipschitz=lambda child, data, size, height: child.lipschitz + _carpet(data, size, height),
    spread=lambda child: child.spread,
    called="displace_by_image",
)
def displace_by_samples(
    p: Expr, child: Child, data: Data = HILLS, size: Size2 = (2.0, 2.0), height: NonNegative = 0.2
) -> Expr:
    """Displace a surface along its normals by data over the xz plane; outside the data the edge values continue."""
    at = (p.xz / size + 0.5) * tuple(_texels(data))
    return child(p) - height * sample(data, at)


@method
def displace_by_image(
    node: Node, source: str | os.PathLike[str] | ArrayLike, size: Vector | Scalar = (2.0, 2.0), height: Scalar = 0.2
) -> Node:
    """Displace a surface along its normals by an image over the xz plane.

    Parameters
    ----------
    source : image file (its luminance, 0 to 1), or heights of shape (rows, columns); row 0 lies at the far side, -z.
    size : extents of the image along x and z, > 0. height : displacement for the value 1, a length >= 0.

    The slope of the data adds to the Lipschitz constant, so steep maps are marched in smaller steps.
    """
    return displace_by_samples(node, Samples(luminance(source, "displace_by_image")), size, height)


@shape(
    exactness="bound",
    bounds=lambda data, size, height, base: (
        vec3(-0.5 * size.x, -base, -0.5 * size.y),
        vec3(0.5 * size.x, height * float(np.max(data.values)), 0.5 * size.y),
    ),
    # the gradient of y - h(x, z) is (-h_x, 1, -h_z)
    lipschitz=lambda data, size, height: length(vec2(1.0, _carpet(data, size, height))),
    spread=1.0,
    called="heightmap",
)
def terrain(
    p: Expr, data: Data = HILLS, size: Size2 = (2.0, 2.0), height: NonNegative = 0.4, base: NonNegative = 0.2
) -> Expr:
    """A block whose top follows sampled heights."""
    at = (p.xz / size + 0.5) * tuple(_texels(data))
    over = p.y - height * sample(data, at)
    q = abs(vec2(p.x, p.z)) - 0.5 * size
    return max(over, max(-p.y - base, max(q.x, q.y)))


@checked
def heightmap(
    source: str | os.PathLike[str] | ArrayLike,
    size: Vector | Scalar = (2.0, 2.0),
    height: Scalar = 0.4,
    base: Scalar = 0.2,
) -> Node:
    """Terrain: a block whose top follows a height map.

    Parameters
    ----------
    source : image file (its luminance, 0 to 1), or heights of shape (rows, columns); row 0 lies at the far side, -z.
    size : extents along x and z, > 0. height : length of the value 1, >= 0. base : depth of the block below y = 0.

    A bound: divided by the steepest slope of the map.
    """
    return terrain(Samples(luminance(source, "heightmap")), size, height, base)
