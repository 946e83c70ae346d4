"""First intersections of rays with a field."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.sdf.facts import Facts
from raymarch.truth.field import Field
from raymarch.truth.march import Lines, Roots, first_crossing, first_root, first_root_of_estimate
from raymarch.truth.rays import Rays


def first_hits(field: Field, rays: Rays, lines: Lines, inside: bool) -> Roots:
    """First intersection of each ray with the surface.

    inside : the rays start in the solid, and the exit is searched for.

    Outside, planes of an outermost union are intersected in closed form, so the search in the rest need not creep along
    them. It ends at the root of the nearest plane.
    """
    search = first_root if field.certified else first_root_of_estimate
    if field.touches:
        search = partial(first_crossing, search)
    if inside:
        return search(lambda rows, t: -field.distance(rays.at(rows, t)), lines)
    plane = _planes(field, rays, lines)
    if not field.has_rest:
        nothing = np.zeros(plane.shape)
        return Roots(plane, nothing.astype(np.int64), nothing)
    shorter = Lines(lines.start, np.minimum(lines.end, plane), lines.size, lines.travelled)
    if field.rest_box is not None:
        box = rays.lines(field.rest_box, shorter.end)
        shorter = replace(shorter, start=np.maximum(box.start, shorter.start), end=box.end)
    roots = search(lambda rows, t: field.rest(rays.at(rows, t)), shorter)
    return Roots(np.minimum(roots.t, plane), roots.evaluations, roots.gap)


def _planes(field: Field, rays: Rays, lines: Lines) -> NDArray[np.float64]:
    """Distance to the first plane on each ray, inf if there is none; shape (N,)."""
    height = field.planes(rays.origins)
    sinking = -field.plane_normals @ rays.directions.T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(height <= 0.0, 0.0, np.where(sinking > 0.0, height / sinking, np.inf))
    first = np.min(t, axis=0, initial=np.inf)
    return np.where((first <= lines.end) & (lines.end > lines.start), first, np.inf)


def is_inside(field: Field, point: NDArray[Any]) -> bool:
    """Whether a point, of shape (3,), lies in the solid."""
    return bool(field.distance(point[None, :])[0] < 0.0)


def unblocked(
    field: Field, rays: Rays, box: Facts, end: NDArray[Any] | float, travelled: NDArray[Any], inside: bool
) -> NDArray[Any]:
    """Whether each ray is free up to `end`; booleans of shape (N,)."""
    lines = rays.lines(box, end, travelled)
    return ~np.isfinite(first_hits(field, rays, lines, inside).t)
