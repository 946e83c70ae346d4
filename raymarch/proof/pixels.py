"""Bounds of the part of each pixel that the solid covers, by beams around all rays of a pixel or of a part of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from raymarch.proof.parts import Operands
from raymarch.proof.rays import Rays, Whole
from raymarch.proof.rounding import Array
from raymarch.proof.search import Given, Verdict, free
from raymarch.scene.camera import Pose

LEVELS = 4
"""Sizes of cells: whole pixels, quarters, and so on. An edge crosses 2 n - 1 of n x n cells at most: with three levels
and shorter stretches the bounds of pixels at edges are twice as far apart, for three quarters of the time."""

SHORT = 1.0
"""Length of a stretch that is not halved, in widths of its cell. A quarter gains a twentieth of the width of bounds."""

WIDER = 1e-9
"""Relative margin of a beam, far above the rounding of its directions."""


def coverage(
    operands: Operands,
    pose: Pose,
    size: tuple[int, int],
    near: Array,
    start: Array,
    end: Array,
    progress: Callable[[float], None] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The least and the greatest part of each pixel whose rays meet the solid, (H, W) each, 0 to 1.

    A cell is empty if the field is above 0 in its whole beam, and covered if it is below 0 on a section of the beam.

    near : (H, W), about the distance of the nearest surface, which decides how short stretches become. start, end :
    (H, W), of the rays through the centres.
    """
    width, height = size
    pixel = np.arange(width * height)
    columns, rows = (v.astype(np.float64) for v in (pixel % width, pixel // width))
    covered, empty = np.zeros(width * height), np.zeros(width * height)
    for level in range(LEVELS):
        half = 0.5 / 2**level
        state = _judged(operands, pose, size, (columns, rows, half), pixel, (near.ravel(), start.ravel(), end.ravel()))
        for total, wanted in ((covered, 1), (empty, -1)):
            np.add.at(total, pixel[state == wanted], 1.0 / 4**level)
        edge = np.flatnonzero(state == 0)
        pixel = np.repeat(pixel[edge], 4)
        columns = (columns[edge, None] + 0.5 * half * np.array([-1.0, 1.0, -1.0, 1.0])).ravel()
        rows = (rows[edge, None] + 0.5 * half * np.array([-1.0, -1.0, 1.0, 1.0])).ravel()
        if progress is not None:
            progress((level + 1) / LEVELS)
    return covered.reshape(height, width), 1.0 - empty.reshape(height, width)


def _judged(
    operands: Operands,
    pose: Pose,
    size: tuple[int, int],
    cells: tuple[Array, Array, float],
    pixel: Whole,
    along: tuple[Array, Array, Array],
) -> NDArray[np.int64]:
    """1 for cells that are covered, -1 for empty ones, 0 for others."""
    columns, rows, half = cells
    near, start, end = (v[pixel] for v in along)
    origins, directions = (np.ascontiguousarray(v.reshape(-1, 3)) for v in pose.rays(columns, rows, size))
    wide = (half * (1.0 + WIDER) + WIDER) * pose.pixel(size[1])
    off = wide * (np.abs(pose.frame[:, 0]) + np.abs(pose.frame[:, 1]))
    along_view = directions @ pose.view
    if pose.orthographic:
        rays = Rays(origins, directions, beside=np.broadcast_to(off, origins.shape))
    else:  # the plane of the picture at distance 1, scaled so that the ray through the centre is a unit vector
        rays = Rays(origins, directions, spread=off * along_view[:, None])
    slack = 1.0 + np.linalg.norm(off) * (not pose.orthographic)
    within = np.ones(len(near)) if pose.orthographic else np.minimum(near, end)
    shortest = SHORT * 2.0 * half * pose.pixel(size[1]) * within
    given = Given(operands, rays, start / slack, end * slack, end, shortest, shortest)
    verdict = Verdict.unknown(end / slack)  # rays beside the centre end elsewhere: the last part may be empty only
    free(given, operands.met(rays, given.start, end / slack), end / slack, shortest, verdict, slivers=False)
    rest = Verdict.unknown(given.end)
    free(given, operands.met(rays, end / slack, given.end), given.end, shortest, rest, slivers=False)
    empty = (verdict.low >= end / slack) & (rest.low >= given.end)
    return np.where(verdict.high <= end / slack, 1, np.where(empty, -1, 0))
