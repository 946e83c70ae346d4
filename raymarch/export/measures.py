"""Measures of a part: extents, area and volume, thickness of walls, and the distance to another part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import SceneError
from raymarch.export.forms import Corner, triangulate
from raymarch.export.surface import Surface
from raymarch.expr.calls import checked
from raymarch.expr.convert import numbers, short
from raymarch.files import import_optional
from raymarch.scene.parameter import ParamValue
from raymarch.scene.scene import Scene, as_scene
from raymarch.sdf.node import Node
from raymarch.truth.raycast import raycast

Array = NDArray[np.float64]

NEAREST = 400
"""Vertices of each mesh, those nearest to the other mesh, whose distances to its triangles are found."""
PROJECTIONS = 32
"""Steps along the gradient that lead a point to the surface, at most."""


class Gap(NamedTuple):
    """The shortest way between two parts: its length, 0 where they overlap, and its ends (3,) on the two surfaces."""

    distance: float
    start: Array
    end: Array


@dataclass(frozen=True, eq=False, repr=False)
class Measures:
    """The measures of a part, in scene units. Those of the mesh are off by about its deviation.

    Attributes
    ----------
    mesh : the triangles that were measured. deviation : how far they were found to be from the surface.
    extent : (3,), along x, y and z. bounds : the corners (lower, upper).
    area, volume : numbers. centroid : (3,), centre of mass at an even density.
    """

    mesh: Surface
    scene: Scene
    time: float
    params: Mapping[str, ParamValue] | None

    @property
    def deviation(self) -> float:
        return self.mesh.deviation

    @property
    def bounds(self) -> tuple[Array, Array]:
        return self.mesh.bounds

    @property
    def extent(self) -> Array:
        lower, upper = self.mesh.bounds
        found: Array = upper - lower
        return found

    @property
    def area(self) -> float:
        return self.mesh.area

    @property
    def volume(self) -> float:
        return self.mesh.volume

    @property
    def centroid(self) -> Array:
        return self.mesh.centroid

    def __repr__(self) -> str:
        extent = " x ".join(f"{length:.6g}" for length in self.extent)
        return f"<Measures: {extent}, area {self.area:.6g}, volume {self.volume:.6g}, within {self.deviation:.2g}>"

    def thickness(self, points: ArrayLike) -> Array:
        """The thickness of the wall behind points of the surface: the way through the solid, against the normal.

        Parameters
        ----------
        points : (N, 3) or (3,), on the surface or near it. Each is first led to the surface along the gradient.

        Returns
        -------
        ndarray, (N,)
            From the field, in float64, not from the mesh. inf where the solid has no other side.

        Raises
        ------
        SceneError : no points, or points that lead to no surface.
        """
        p = numbers("thickness: points", points, "(N, 3) or (3,)")
        if p.ndim not in (1, 2) or p.shape[-1] != 3:
            raise SceneError(f"thickness: points of shape {p.shape}", legal="(N, 3) or (3,)")
        p = p.reshape(-1, 3)
        node, time, params = self.scene.node, self.time, self.params
        scale = float(np.max(np.abs(self.bounds))) + float(np.max(self.extent))
        for _ in range(PROJECTIONS):
            value = np.asarray(node.distance(p, time, params)).reshape(-1, 1)
            slope = np.asarray(node.gradient(p, time, params)).reshape(-1, 3)
            p = p - value * slope / np.maximum(np.sum(slope * slope, axis=1, keepdims=True), 1e-12)
        if np.any(np.abs(np.asarray(node.distance(p, time, params))) > 1e-6 * scale):
            raise SceneError("thickness: points that lead to no surface", legal="points on the surface, or near it")
        slope = np.asarray(node.gradient(p, time, params)).reshape(-1, 3)
        normal = slope / np.linalg.norm(slope, axis=1, keepdims=True)
        inwards = 1e-6 * scale
        hits = raycast(self.scene, p - inwards * normal, -normal, time=self.time, params=self.params)
        found: Array = hits.distance + inwards
        return found

    def distance(self, other: Measures) -> Gap:
        """The shortest way to another part, between the triangles of both.

        Parameters
        ----------
        other : the measures of the other part.

        Returns
        -------
        Gap
            Of distance 0 where the parts overlap. Off by the deviations of both meshes, and by less than a cell squared
            over the distance where two edges are nearest.

        Raises
        ------
        SceneError : what is no `Measures`. It needs the packages of the extra "mesh".
        """
        if not isinstance(other, Measures):
            raise SceneError(f"distance to {short(other)}", legal="what rm.measure(part) returns")
        import_optional("distance of two parts", "rtree", "mesh")
        trimesh = import_optional("distance of two parts", "trimesh", "mesh")
        near = []
        for one, two in ((self, other), (other, self)):
            depth = np.asarray(two.scene.node.distance(one.mesh.vertices, time=two.time, params=two.params))
            if np.any(depth < -(one.deviation + two.deviation)):
                within = one.mesh.vertices[int(np.argmin(depth))]
                return Gap(0.0, within, within)
            near.append(np.argsort(depth)[:NEAREST])
        gaps = []
        for i, (one, two) in enumerate(((self, other), (other, self))):
            some = one.mesh.vertices[near[i]]
            faces = two.mesh.faces[np.isin(two.mesh.faces, near[1 - i]).any(axis=1)]
            mesh = trimesh.Trimesh(two.mesh.vertices, faces, process=False)
            ends, lengths, _ = trimesh.proximity.closest_point(mesh, some)
            best = int(np.argmin(lengths))
            pair = (some[best], ends[best]) if one is self else (ends[best], some[best])
            gaps.append(Gap(float(lengths[best]), np.asarray(pair[0]), np.asarray(pair[1])))
        return min(gaps, key=lambda gap: gap.distance)


@checked
def measure(
    part: Scene | Node,
    *,
    tolerance: float | None = None,
    cells: int | None = None,
    box: tuple[Corner, Corner] | None = None,
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
) -> Measures:
    """Measure a part: extents, area, volume, thickness of walls, distance to another part.

    Parameters
    ----------
    part : a solid, or the Scene that it is in.
    tolerance, cells, box, time, params : of the mesh that is measured, see `export`.

    Returns
    -------
    Measures
        Its methods are `thickness(points)` and `distance(other)`.

    Raises
    ------
    SceneError : an unbounded solid without a box, a tolerance that no mesh keeps.

    Examples
    --------
    >>> round(rm.measure(rm.box((4, 2, 1)), cells=16).volume, 2)
    8.0
    """
    scene = as_scene("measure", part)
    mesh = triangulate(scene, time=time, params=params, cells=cells, tolerance=tolerance, box=box)
    return Measures(mesh, scene, time, params)
