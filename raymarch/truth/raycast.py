"""Where rays of one's own meet a solid, in float64."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import numbers, real
from raymarch.scene.legal import warn_of_values
from raymarch.scene.parameter import ParamValue, set_values
from raymarch.scene.scene import HORIZON, Scene, as_scene
from raymarch.sdf.node import Node
from raymarch.truth.field import BLOCK
from raymarch.truth.large import field_of
from raymarch.truth.march import Roots
from raymarch.truth.rays import Rays, unit
from raymarch.truth.visibility import first_hits

AT_ONCE = 16 * BLOCK
"""Rays that are traced together; this bounds the memory."""


@dataclass(frozen=True, eq=False, repr=False)
class Hits:
    """Where N rays meet a solid, in float64.

    Attributes
    ----------
    distance : (N,), along the ray of unit direction; inf where nothing was hit.
    hit : (N,) bool. position : (N, 3), the points; nan where nothing was hit.
    normal : (N, 3), unit outward normals, also of rays that start inside; 0 where nothing was hit.
    material : (N,) int, index into `scene.materials`; -1 where nothing was hit.
    gap : (N,), length before the end of the ray that was not proved free; inf for an estimate.
    """

    distance: NDArray[np.float64]
    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    material: NDArray[np.int64]
    gap: NDArray[np.float64]

    @property
    def hit(self) -> NDArray[np.bool_]:
        """(N,), whether the ray meets the solid."""
        return np.isfinite(self.distance)

    def __repr__(self) -> str:
        return f"<Hits: {int(self.hit.sum())} of {len(self.distance)} rays hit>"


@checked
def raycast(
    scene: Scene | Node,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    far: float = np.inf,
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
) -> Hits:
    """The first points where rays meet a solid, in float64 on the CPU, by the steps of `truth`.

    Parameters
    ----------
    scene : a solid, or the Scene that it is in.
    origins : (N, 3) or (3,), one point for all rays.
    directions : (N, 3) or (3,), of any length but 0. A ray that starts in the solid meets the surface where it leaves.
    far : largest distance, > 0. inf is beyond the solid's box, or beyond the horizon of an unbounded solid.
    time, params : of the frame, see `render`.

    Returns
    -------
    Hits
        Hits.

    Raises
    ------
    SceneError : arrays of another shape, a direction of length 0, or values that are not finite.

    Notes
    -----
    No surface of a certified field is passed, however thin.

    Examples
    --------
    >>> rm.raycast(rm.sphere(1), [(0, 0, 5), (0, 3, 5)], (0, 0, -1)).distance
    array([ 4., inf])
    """
    made = as_scene("raycast", scene)
    start, along = _vectors("raycast: origins", origins), _vectors("raycast: directions", directions)
    count = len(along) if len(start) == 1 else len(start)
    if len(along) not in (1, count):
        raise SceneError(f"raycast: {len(start)} origins, {len(along)} directions", legal="as many, or one for all")
    lengths = np.linalg.norm(along, axis=1)
    if not np.all(lengths > 0.0):
        raise SceneError("raycast: directions hold (0, 0, 0)", legal="any length but 0")
    limit = real("raycast: far", far, 0.0, np.inf, "a length > 0")
    values = set_values(made.parameters, params, time)
    warn_of_values(made.node, values.params, values.time)
    field, facts = field_of(made, values), made.node.facts
    start, along = np.broadcast_to(start, (count, 3)), np.broadcast_to(unit(along), (count, 3))
    if not facts.bounded:
        middle, scale = made.middle
        limit = min(limit, HORIZON * (scale + float(np.linalg.norm(start - middle, axis=1).max(initial=0.0))))
    distance, gap = np.full(count, np.inf), np.zeros(count)
    normal, material = np.zeros((count, 3)), np.full(count, -1)
    for first in range(0, count, AT_ONCE):
        part = slice(first, min(first + AT_ONCE, count))
        found = _first(field, Rays(start[part], along[part]), facts, limit)
        distance[part], gap[part] = found.t, found.gap
        rows = first + np.flatnonzero(np.isfinite(found.t))
        points = start[rows] + distance[rows, None] * along[rows]
        if len(rows):
            slope = field.gradient(points)
            normal[rows] = unit(np.where(slope.any(axis=1, keepdims=True), slope, -along[rows]))
            material[rows] = np.argmax(field.material_weights(points), axis=1)
    with np.errstate(invalid="ignore"):
        position = np.where(np.isfinite(distance)[:, None], start + distance[:, None] * along, np.nan)
    return Hits(distance, position, normal, material, gap)


def material_at(
    scene: Scene | Node, points: ArrayLike, time: float = 0.0, params: Mapping[str, ParamValue] | None = None
) -> NDArray[np.int64]:
    """The material with the largest weight at points: indices into `scene.materials`; see `Node.material_at`."""
    made = as_scene("material_at", scene)
    values = set_values(made.parameters, params, time)
    warn_of_values(made.node, values.params, values.time)
    at, field = _vectors("material_at: points", points), field_of(made, values)
    found = np.zeros(len(at), np.int64)
    for first in range(0, len(at), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        found[part] = np.argmax(field.material_weights(at[part]), axis=1)
    return found.reshape(np.shape(points)[:-1])


def _vectors(what: str, given: ArrayLike) -> NDArray[np.float64]:
    found = numbers(what, given, "(N, 3) or (3,)")
    if found.ndim not in (1, 2) or found.shape[-1] != 3:
        raise SceneError(f"{what} of shape {found.shape}", legal="(N, 3) or (3,)")
    if not np.all(np.isfinite(found)):
        raise SceneError(f"{what} hold values that are not finite", legal="finite numbers")
    return found.reshape(-1, 3)


def _first(field: Any, rays: Rays, facts: Any, limit: float) -> Roots:
    """The first hits of rays that start outside or inside of the solid."""
    inside = field.distance(rays.origins) < 0.0
    count = len(rays.directions)
    found = Roots(np.full(count, np.inf), np.zeros(count, np.int64), np.zeros(count))
    for side in (False, True):
        rows = np.flatnonzero(inside == side)
        if rows.size:
            part = Rays(rays.origins[rows], rays.directions[rows])
            roots = first_hits(field, part, part.lines(facts, limit), side)
            found.t[rows], found.evaluations[rows], found.gap[rows] = roots.t, roots.evaluations, roots.gap
    return found
