"""Meshes of files and of arrays, sampled as distances."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch import cache as disk
from raymarch.errors import SceneError, warn
from raymarch.expr.calls import checked
from raymarch.expr.convert import file_path, input_file, integer, numbers, optional, real, short
from raymarch.expr.samples import Samples
from raymarch.files import reading
from raymarch.sdf.mesh_files import LEGAL, Beside, of_arrays, read_mesh
from raymarch.sdf.nearest import Surface
from raymarch.sdf.node import Node
from raymarch.sdf.sampled import refuse_broken, sampled_grid

__all__ = ["mesh"]

Progress = Callable[[float], None]


@checked
def mesh(
    source: str | os.PathLike[str] | tuple[Any, Any],
    extent: float | None = None,
    resolution: int = 64,
    progress: Progress | None = None,
    cache: str | os.PathLike[str] | None = None,
) -> Node:
    """A closed triangle mesh as a field, sampled once and cached.

    Parameters
    ----------
    source : name of a file that trimesh reads: STL, OBJ, PLY, GLB, ... Other files that it names must be in its folder.
        Or a pair of arrays, vertices (V, 3) and the vertices of triangles (F, 3), or an object with `vertices` and
        `faces`, such as a Trimesh.
    extent : scale the mesh to this largest extent and centre it at the origin. None keeps its coordinates.
    resolution : samples along its largest extent, 8 to 256.
    progress : called with the fraction done, 0 to 1.
    cache : folder of the cache, which is keyed by content; default $RAYMARCH_CACHE, or the user's cache.

    Returns
    -------
    Node

    Raises
    ------
    SceneError : a file that cannot be read or holds no triangles, for vertices that are not finite, and for a mesh that
        is open, non-manifold, one-sided or flat, or cuts itself so that inside and outside are not clear.

    Notes
    -----
    A mesh that is inside out, as a whole or in a part, is reversed. Triangles wound against their neighbours are
    reversed too. A SceneWarning reports both, and parts that are missing because they are thinner than the distance of
    samples. Lengths are used unchanged: files do not state their unit.

    Needs the extra `mesh` (trimesh, rtree, scipy).
    """
    resolution = integer("mesh: resolution", resolution, 8, 256)
    extent = optional(_extent, "mesh: extent", extent)
    given = _source(source)
    folder = None if cache is None else file_path("mesh: cache", cache, "a folder")
    if progress is not None and not callable(progress):
        raise SceneError(f"mesh: progress = {short(progress)}", legal="a function of the fraction done, or None")
    key = hashlib.sha256(given.content + f"{extent} {resolution} {given.kind} 6".encode()).hexdigest()
    kept = disk.folder() if folder is None else Path(folder)
    kept = kept and kept / f"mesh-{key[:24]}.npz"
    found = None if kept is None else _from_cache(kept, given.beside)
    if found is None:
        solid, unit, repairs = _load_mesh(given, extent)
        *sampled, missing = _sample_mesh(solid, resolution, progress, given.what)
        values, size, centre = (unit * part for part in sampled)
        if missing > 0.01:
            repairs.append(
                f"{given.what}: {100 * missing:.2g} % of the surface bounds parts thinner than the distance of "
                f"samples, {size[0] / (values.shape[2] - 1):.3g}, and is missing: resolution={resolution} is too "
                "small for them"
            )
        if kept is not None:
            texts = {"repairs": repairs, "names": [*given.beside.digests], "digests": [*given.beside.digests.values()]}
            arrays = {"values": values, "size": size, "centre": centre}
            if lost := disk.save(kept, arrays | {n: np.array(t, np.str_) for n, t in texts.items()}, compressed=True):
                warn(f"mesh: the cache {lost}: nothing is kept")
        found = sampled_grid(Samples(values, "mesh"), size, centre), repairs
    for repair in found[1]:
        warn(repair)
    return found[0]


@dataclass(frozen=True)
class _Source:
    """A mesh before it is read. what : its name in messages. content : its bytes. kind : the suffix of a file, or the
    shapes of arrays. arrays : vertices (V, 3) and triangles (F, 3), of a mesh that is no file."""

    what: str
    content: bytes
    kind: str
    beside: Beside
    file: Path = Path()
    arrays: tuple[NDArray[np.float64], NDArray[np.int64]] | None = None


def _source(source: Any) -> _Source:
    pair = (source.vertices, source.faces) if hasattr(source, "vertices") and hasattr(source, "faces") else source
    if isinstance(pair, tuple | list) and len(pair) == 2:
        vertices = numbers("mesh: vertices", pair[0], "(V, 3) numbers")
        faces = numbers("mesh: triangles", pair[1], "(F, 3) numbers of vertices")
        for what, array in (("vertices", vertices), ("triangles", faces)):
            if array.ndim != 2 or array.shape[1] != 3 or not len(array):
                raise SceneError(f"mesh: {what} of shape {array.shape}", legal="(N, 3), of three numbers each")
        wrong = faces[(faces != np.rint(faces)) | (faces < 0) | (faces >= len(vertices))]
        if len(wrong):
            legal = f"whole numbers from 0 to {len(vertices) - 1}, of the vertices"
            raise SceneError(f"mesh: a triangle has the vertex {wrong[0]:.15g}", legal=legal)
        content, kind = vertices.tobytes() + faces.tobytes(), f"{len(vertices)} {len(faces)}"
        arrays = np.array(vertices, np.float64), faces.astype(np.int64)
        return _Source("mesh: the mesh of arrays", content, kind, Beside(Path()), arrays=arrays)
    file = Path(input_file("mesh: source", source, "the name of a mesh file, or a pair of arrays"))
    with reading("mesh", str(file), LEGAL):
        content = file.read_bytes()
    return _Source(f"mesh: '{file}'", content, file.suffix.lower(), Beside(file.parent), file)


def _from_cache(kept: Path, beside: Beside) -> tuple[Node, list[str]] | None:
    """Samples of an earlier run and its repairs; None if there are none, or with a warning if they are damaged, or if
    another file that the mesh names has changed since."""
    if not kept.exists():
        return None
    if (found := disk.load(kept)) is None:
        warn(f"mesh: the cache file '{kept}' cannot be read: it is made anew")
        return None
    if not beside.holds(dict(zip(found["names"].tolist(), found["digests"].tolist(), strict=True))):
        return None
    return sampled_grid(Samples(found["values"], "mesh"), found["size"], found["centre"]), found["repairs"].tolist()


def _extent(what: str, value: Any) -> float:
    return real(what, value, float(np.finfo(np.float32).tiny), legal="a number > 0, or None")


def _load_mesh(given: _Source, extent: float | None) -> tuple[Any, float, list[str]]:
    """The mesh, closed and with outward normals; the unit of its coordinates, about its size; and the repairs."""
    solid = of_arrays(*given.arrays) if given.arrays else read_mesh(given.file, given.content, given.beside)
    refuse_broken(given.what, ~np.isfinite(solid.vertices).all(axis=1), "vertices", "numbers")
    middle, largest = solid.bounds.mean(axis=0), float(solid.extents.max())
    unit = float(2.0 ** np.rint(np.log2(largest))) if largest > 0.0 else 1.0
    solid.apply_scale(1.0 / unit)  # first: the tolerances of trimesh are lengths, and it ignores small translations
    solid.apply_translation(-middle / unit)
    solid.merge_vertices(merge_tex=True, merge_norm=True)
    solid.update_faces(solid.nondegenerate_faces() & solid.unique_faces())
    if not len(solid.faces):
        raise SceneError(f"{given.what}: no triangle has an area", legal="a mesh that has an inside")
    repairs = [f"{given.what}: {repair}" for repair in _closed(solid, given.what)]
    if extent is None:
        solid.apply_translation(middle / unit)
    else:
        unit = extent * unit / largest
    return solid, unit, repairs


def _closed(solid: Any, name: str) -> list[str]:
    """Orient the triangles of a mesh outwards; returns the repairs. SceneError if that is impossible."""
    edges, counts = np.unique(solid.edges_sorted, axis=0, return_counts=True)
    for wrong, what in ((counts < 2, "is not closed: {} edges have one triangle"), (counts > 2, _NON_MANIFOLD)):
        if wrong.any():
            cure = "a watertight mesh, which has an inside: close it in a modeller, or with trimesh.repair"
            raise SceneError(f"{name} {what.format(int(wrong.sum()))} of {len(edges)}", legal=cure)
    turned, part = _wound_alike(solid.faces)
    if turned is None:
        raise SceneError(f"{name} has one side only", legal="a mesh with an inside")
    original = solid.faces.copy()
    solid.faces = np.where(turned[:, None], original[:, ::-1], original)
    turned ^= _inside_out(solid, part, name)
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


def _inside_out(solid: Any, part: NDArray[Any], name: str) -> NDArray[np.bool_]:
    """Triangles of the parts whose normals point to the wrong side: into a part, or out of a cavity that one has."""
    import trimesh

    corners = solid.triangles
    each = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    volumes = np.bincount(part, each)
    if np.any(np.abs(volumes) <= 1e-12 * np.bincount(part, solid.area_faces)):
        raise SceneError(f"{name} has a part without volume", legal="parts that have an inside")
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
