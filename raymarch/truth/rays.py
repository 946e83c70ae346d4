"""Rays: one through each pixel, where they meet a box, and the footprint of a pixel on a surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.camera import Pose
from raymarch.scene.relief import footprint_axis
from raymarch.sdf.facts import Facts
from raymarch.truth.bsdf import values_of
from raymarch.truth.march import Lines

BOX_MARGIN = 1e-9
"""Relative margin of a box, over its largest coordinate: above rounding errors, far below a pixel."""

MIN_COSINE = 1e-4
"""Lower bound of the cosine of incidence: at a horizon the footprint would be unbounded."""


@dataclass(frozen=True, slots=True)
class Rays:
    """Rays of unit direction.

    origins, directions : shape (N, 3); all rays may share one origin of shape (1, 3).
    """

    origins: NDArray[np.float64]
    directions: NDArray[np.float64]

    def at(self, rows: NDArray[Any], t: NDArray[Any]) -> NDArray[np.float64]:
        """Points at the distances t on some of the rays, shape (n, 3)."""
        origins = self.origins if len(self.origins) == 1 else self.origins[rows]
        points: NDArray[np.float64] = origins + t[:, None] * self.directions[rows]
        return points

    def lines(self, box: Facts, end: NDArray[Any] | float, travelled: NDArray[Any] | float = 0.0) -> Lines:
        """The intervals of the rays inside the bounding box of the scene, up to `end`."""
        n = len(self.directions)
        enter, leave = _slabs(self, box)
        size = np.linalg.norm(self.origins, axis=1)
        return Lines(
            start=np.maximum(enter, 0.0),
            end=np.minimum(leave, end),
            size=np.broadcast_to(size, (n,)),
            travelled=np.broadcast_to(np.asarray(travelled, np.float64), (n,)),
        )


def camera_rays(pose: Pose, width: int, height: int, rows: range | None = None) -> Rays:
    """Rays through the centres of all pixels, row by row from the top of the picture; `rows` selects some rows."""
    return rays_through(
        pose, np.arange(width), np.array(range(height) if rows is None else rows)[:, None], (width, height)
    )


def rays_through(pose: Pose, columns: NDArray[Any], rows: NDArray[Any], size: tuple[int, int]) -> Rays:
    """The rays of `Pose.rays` in one list."""
    origins, directions = (v.reshape(-1, 3) for v in pose.rays(columns, rows, size))
    return Rays(origins if pose.orthographic else pose.position[None, :], directions)


def lens_rays(pose: Pose, centre: Rays, points: NDArray[np.float64]) -> Rays:
    """Rays of the camera from other points of the lens.

    centre : N rays from the centre of the lens. points : (2,), or one of each ray, (N, 2): radii to the right and up.
    """
    in_focus = centre.at(np.arange(len(centre.directions)), pose.focus / (centre.directions @ pose.view))
    beside = (pose.aperture * points) @ pose.frame[:, :2].T
    origins = centre.origins + beside
    return Rays(origins, unit(in_focus - origins))


def unit(vectors: NDArray[Any]) -> NDArray[np.float64]:
    """Normalize vectors of shape (N, 3); a zero vector stays zero."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    result: NDArray[np.float64] = vectors / np.where(lengths > 0.0, lengths, 1.0)
    return result


def _slabs(rays: Rays, box: Facts) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distances at which rays enter and leave a box, each of shape (N,); infinite sides do not clip."""
    if box.empty:
        return np.full(len(rays.directions), np.inf), np.full(len(rays.directions), -np.inf)
    ends = np.concatenate([box.lower, box.upper])
    margin = BOX_MARGIN * np.max(np.abs(ends[np.isfinite(ends)]), initial=0.0)
    o, d = rays.origins, rays.directions
    lower, upper = box.lower - margin - o, box.upper + margin - o
    with np.errstate(divide="ignore", invalid="ignore"):
        first, last = lower / d, upper / d
    beside = (lower > 0.0) | (upper < 0.0)
    near = np.where(d == 0.0, np.where(beside, np.inf, -np.inf), np.fmin(first, last))
    far = np.where(d == 0.0, np.where(beside, -np.inf, np.inf), np.fmax(first, last))
    return near.max(axis=1), far.min(axis=1)


def footprint(
    normals: NDArray[np.float64], directions: NDArray[np.float64], width: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Full axes of the ellipses in which cones of round pixels meet the tangent planes, (N, 3) each.

    normals, directions : unit surface normals and ray directions, (N, 3). width : of the pixel at that depth, (N,).
    The first axis is perpendicular to the ray and as long as the pixel is wide. The second is longer by 1 / cosine.
    """
    minor = values_of(footprint_axis, normals, -directions, width)
    cosine = np.abs(np.einsum("ij,ij->i", normals, directions))[:, None]
    return minor, np.cross(normals, minor) / np.maximum(cosine, MIN_COSINE)
