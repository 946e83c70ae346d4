"""Fields from data: a grid of distances, a mesh file, a height map that raises a plane or any other surface.

Sampled distances are interpolated linearly, which makes the zero set a piecewise hyperbolic surface near the
true one; the field is a bound on the distance to that surface, because it is divided by its own steepest slope.
"""

from __future__ import annotations

import hashlib
import os
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from raymarch.errors import SceneError
from raymarch.expr.convert import file_path, holdable, integer, numbers, optional, real, short
from raymarch.expr.node import Expr, expr
from raymarch.expr.samples import Samples, sample
from raymarch.expr.vocabulary import clamp, length, max, min, vec2, vec3
from raymarch.sdf.definition import Child, ChildFacts, operator, shape
from raymarch.sdf.domain import Data, NonNegative, Scalar, Size2, Size3, Vec3, Vector
from raymarch.sdf.node import Node
from raymarch.sdf.registry import method

__all__ = ["displace_by_image", "grid", "heightmap", "mesh"]

Progress = Callable[[float], None]


def _texels(data: Samples) -> NDArray[np.float64]:
    """Cells along each axis."""
    return np.array(data.size, np.float64) - 1.0


def _steepness(data: Samples, size: Any) -> Expr:
    """The field is no steeper than its data where cells are smallest; outside the box it grows with the distance."""
    cell = expr(size) / tuple(_texels(data))
    return max(data.steepest / min(cell.x, min(cell.y, cell.z)), 1.0)


def _solid_box(data: Samples, size: Any, centre: Any) -> tuple[Expr, Expr]:
    """The cells that can hold some of the solid: those with a corner that is not outside."""
    inside = data.values <= 0.0
    if not inside.any():
        return expr(centre), expr(centre)
    where = np.nonzero(inside)[::-1]
    counts = np.array(data.size)
    low = np.array([np.maximum(w.min() - 1, 0) for w in where]) / (counts - 1)
    high = np.array([np.minimum(w.max() + 1, n - 1) for w, n in zip(where, counts, strict=True)]) / (counts - 1)
    lower = expr(centre) + expr(size) * tuple(low - 0.5)
    return lower, expr(centre) + expr(size) * tuple(high - 0.5)


def _some_grid() -> Samples:
    """A ball of radius 0.8 in a box of side 2: the specimen that `grid()` shows."""
    axis = np.linspace(-1.0, 1.0, 24)
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    return Samples(np.sqrt(x * x + y * y + z * z) - 0.8)


BALL = _some_grid()


@shape(
    exactness="bound",
    bounds=_solid_box,
    lipschitz=lambda data, size, centre: _steepness(data, size),
)
def sampled_grid(p: Expr, data: Data = BALL, size: Size3 = (2.0, 2.0, 2.0), centre: Vec3 = (0.0, 0.0, 0.0)) -> Expr:
    """Distances on a regular grid whose outermost samples lie on the faces of a box."""
    q = p - centre
    inside = clamp(q, -0.5 * size, 0.5 * size)
    value = sample(data, (inside / size + 0.5) * tuple(_texels(data)))
    # Every point x of the solid lies in the convex box, so with c the nearest point of the box
    # |p - x|^2 >= |p - c|^2 + |c - x|^2: the two distances add like the sides of a right triangle.
    return length(vec2(length(q - inside), max(value, 0.0))) + min(value, 0.0)


def grid(values: ArrayLike, size: Vector | Scalar = (2.0, 2.0, 2.0), centre: Vector = (0.0, 0.0, 0.0)) -> Node:
    """A solid from signed distances on a regular grid.

    Parameters
    ----------
    values : shape (nx, ny, nz), each 2 to 2048: values[i, j, k] is the distance at the i-th x, j-th y and k-th z.
        The outermost samples lie on the faces of the box and must not be inside the solid.
    size : full extents of the box, > 0. centre : its middle.

    Interpolated linearly. A bound: the field is divided by its steepest slope. Outside the box it is
    the distance to the box and the sample at the nearest point of it, taken together.
    """
    array = numbers("grid: values", values, "distances, (nx, ny, nz), each 2 to 2048")
    if array.ndim != 3:
        raise SceneError(f"grid: values of shape {array.shape}", legal="(nx, ny, nz)")
    data = Samples(array.transpose(2, 1, 0))
    faces = [array.take(end, axis=axis) for axis in range(3) for end in (0, -1)]
    if np.min([face.min() for face in faces]) < 0.0:
        raise SceneError(
            f"grid: the solid reaches the box, a distance on its faces is {np.min([f.min() for f in faces]):g}",
            legal="samples on the faces of the box >= 0: a larger box",
        )
    return sampled_grid(data, size, centre)


def mesh(
    file: str | os.PathLike[str],
    extent: float | None = None,
    resolution: int = 64,
    progress: Progress | None = None,
    cache: str | os.PathLike[str] | None = None,
) -> Node:
    """A closed triangle mesh as a field, sampled once and kept.

    Parameters
    ----------
    file : what trimesh reads: STL, OBJ, PLY, GLB, ...
    extent : scale it so that its largest extent is this, centred at the origin; None keeps it where it is.
    resolution : samples along its largest extent, 8 to 256.
    progress : called with the share done, 0 to 1.
    cache : folder in which the samples are kept by content; default ~/.cache/raymarch, or RAYMARCH_CACHE.

    Needs the extra `mesh` (trimesh, rtree). Raises SceneError for a file that cannot be read or is not closed.
    """
    resolution = integer("mesh: resolution", resolution, 8, 256)
    extent = optional(_extent, "mesh: extent", extent)
    file = file_path("mesh: file", file, "a mesh file")
    folder = None if cache is None else file_path("mesh: cache", cache, "a folder")
    if progress is not None and not callable(progress):
        raise SceneError(f"mesh: progress = {short(progress)}", legal="a function of the share done, or None")
    try:
        content = Path(file).read_bytes()
    except OSError as fault:
        raise SceneError(f"mesh: cannot read '{file}': {fault.strerror or fault}", legal="a mesh file") from None
    key = hashlib.sha256(content + f"{extent} {resolution} 1".encode()).hexdigest()[:24]
    kept = _cache(folder)
    kept = kept and kept / f"mesh-{key}.npz"
    found = None if kept is None else _from_cache(kept)
    if found is not None:
        return found
    values, size, centre = _sample_mesh(_load_mesh(Path(file), extent), resolution, progress)
    if kept is not None:
        _to_cache(kept, values, size, centre)
    return sampled_grid(Samples(values), size, centre)


def _cache(folder: str | None) -> Path | None:
    """The folder of the cache; None where there is no home."""
    try:
        return Path(folder or os.environ.get("RAYMARCH_CACHE") or Path.home() / ".cache" / "raymarch")
    except RuntimeError:
        return None


def _from_cache(kept: Path) -> Node | None:
    """What an earlier run has sampled; None if there is nothing, or nothing whole."""
    try:
        with kept.open("rb") as file, np.load(file) as found:
            return sampled_grid(Samples(found["values"]), found["size"], found["centre"])
    except (
        OSError,
        EOFError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        zipfile.BadZipFile,
        zlib.error,
        SceneError,
    ):
        return None


def _to_cache(kept: Path, values: Any, size: Any, centre: Any) -> None:
    """Keep samples for the next run. A cache that cannot be written is only not used."""
    partial = kept.with_suffix(f".{os.getpid()}.part.npz")
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(partial, values=values, size=size, centre=centre)
        partial.replace(kept)
    except OSError:
        with suppress(OSError):
            partial.unlink(missing_ok=True)


def _extent(what: str, value: Any) -> float:
    return real(what, value, float(np.finfo(np.float32).tiny), legal="a number > 0, or None")


def _load_mesh(file: Path, extent: float | None) -> Any:
    try:
        import trimesh
    except ImportError:
        raise SceneError("mesh needs the package trimesh", legal="pip install 'raymarch[mesh]'") from None
    try:
        solid = trimesh.load(file, force="mesh")
    except Exception as fault:
        raise SceneError(f"mesh: cannot read '{file}': {fault}", legal="a mesh file that trimesh reads") from fault
    if len(solid.faces) == 0 or not solid.is_watertight:
        raise SceneError(f"mesh: '{file}' is not closed", legal="a watertight mesh, which has an inside")
    if extent is not None:
        solid.apply_translation(-solid.bounds.mean(axis=0))
        solid.apply_scale(extent / solid.extents.max())
    return solid


def _sample_mesh(solid: Any, resolution: int, progress: Progress | None) -> tuple[Any, Any, Any]:
    """Distances on a grid that leaves two cells of room on each side, slab by slab."""
    from trimesh.proximity import signed_distance

    cell = float(solid.extents.max()) / (resolution - 5)
    counts = np.ceil(solid.extents / cell).astype(int) + 5
    size = cell * (counts - 1)
    centre = solid.bounds.mean(axis=0)
    x, y, z = (c + np.linspace(-s / 2, s / 2, n) for c, s, n in zip(centre, size, counts, strict=True))
    values = np.empty(counts[::-1], np.float32)
    for k, height in enumerate(z):
        points = np.stack(np.broadcast_arrays(x[None, :], y[:, None], height), axis=-1).reshape(-1, 3)
        values[k] = -signed_distance(solid, points).reshape(len(y), len(x))
        if progress is not None:
            progress((k + 1) / len(z))
    return values, size, centre


# Height maps


def luminance(source: str | os.PathLike[str] | ArrayLike, what: str) -> NDArray[np.float64]:
    """Heights from 0 to 1 of an image file (its luminance), or an array as it is; shape (rows, columns)."""
    if isinstance(source, str | os.PathLike):
        source = file_path(f"{what}: source", source, "an image file")
        try:
            with Image.open(source) as picture:
                return np.asarray(picture.convert("F"), np.float64) / (65535.0 if "16" in picture.mode else 255.0)
        except OSError as fault:
            raise SceneError(f"{what}: cannot read '{source}': {fault}", legal="an image file") from None
    legal = "an image file, or heights (rows, columns), finite, at least 2x2"
    array = numbers(f"{what}: source", source, legal)
    if array.ndim != 2 or np.min(array.shape) < 2 or not holdable(array):
        raise SceneError(f"{what}: heights of shape {array.shape}", legal=legal)
    return array


def _carpet(data: Samples, size: Any, height: Any) -> Expr:
    cell = expr(size) / tuple(_texels(data))
    return data.steepest * height / min(cell.x, cell.y)


def _some_hills() -> Samples:
    """Gentle hills, the specimen."""
    y, x = np.mgrid[0:1:32j, 0:1:32j]
    return Samples(0.5 + 0.5 * np.sin(2 * np.pi * x) * np.cos(2 * np.pi * y))


HILLS = _some_hills()


def _raised(child: ChildFacts, data: Samples, size: Any, height: Any) -> tuple[Expr, Expr]:
    return child.grown(max(float(data.values.max()), 0.0) * height)


@operator(
    bounds=_raised,
    lipschitz=lambda child, data, size, height: child.lipschitz + _carpet(data, size, height),
    spread=lambda child, data, size, height: child.spread,
)
def displace_by_samples(
    p: Expr, child: Child, data: Data = HILLS, size: Size2 = (2.0, 2.0), height: NonNegative = 0.2
) -> Expr:
    """A surface raised along its normals by data laid over the xz plane; the edge's value goes on outside."""
    at = (p.xz / size + 0.5) * tuple(_texels(data))
    return child(p) - height * sample(data, at)


@method
def displace_by_image(
    node: Node,
    source: str | os.PathLike[str] | ArrayLike,
    size: Vector | Scalar = (2.0, 2.0),
    height: Scalar = 0.2,
) -> Node:
    """A surface raised along its normals by an image laid over the xz plane.

    Parameters
    ----------
    source : image file (its luminance, 0 to 1), or heights of shape (rows, columns); row 0 lies at the far side, -z.
    size : extents of the image along x and z, > 0. height : length that the value 1 raises the surface by, >= 0.

    The slope of the data adds to the Lipschitz constant, so steep maps are marched in smaller steps.
    """
    return displace_by_samples(node, Samples(luminance(source, "displace_by_image")), size, height)


@shape(
    exactness="bound",
    bounds=lambda data, size, height, base: (
        vec3(-0.5 * size.x, -base, -0.5 * size.y),
        vec3(0.5 * size.x, height * float(np.max(data.values)), 0.5 * size.y),
    ),
    lipschitz=lambda data, size, height, base: _terrain(data, size, height),
    spread=1.0,
)
def terrain(
    p: Expr,
    data: Data = HILLS,
    size: Size2 = (2.0, 2.0),
    height: NonNegative = 0.4,
    base: NonNegative = 0.2,
) -> Expr:
    """A block whose top follows sampled heights."""
    at = (p.xz / size + 0.5) * tuple(_texels(data))
    over = p.y - height * sample(data, at)
    q = abs(vec2(p.x, p.z)) - 0.5 * size
    return max(over, max(-p.y - base, max(q.x, q.y)))


def _terrain(data: Samples, size: Any, height: Any) -> Expr:
    """The gradient of y - h(x, z) is (-h_x, 1, -h_z)."""
    return length(vec2(1.0, _carpet(data, size, height)))


def heightmap(
    source: str | os.PathLike[str] | ArrayLike,
    size: Vector | Scalar = (2.0, 2.0),
    height: Scalar = 0.4,
    base: Scalar = 0.2,
) -> Node:
    """A block whose top follows an image: a landscape.

    Parameters
    ----------
    source : image file (its luminance, 0 to 1), or heights of shape (rows, columns); row 0 lies at the far side, -z.
    size : extents along x and z, > 0. height : length of the value 1, >= 0. base : how far it reaches below y = 0.

    A bound: divided by the steepest slope of the map.
    """
    return terrain(Samples(luminance(source, "heightmap")), size, height, base)
