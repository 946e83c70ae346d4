"""Silhouettes at sub-pixel distance from a ray, for pictures with an edge in nearly every pixel."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.parameter import ParamValue, set_values
from raymarch.scene.scene import Scene
from raymarch.truth.edges import silhouettes
from raymarch.truth.rays import rays_through
from raymarch.truth.tracer import trace

BLOCK = 5
"""Side of the block of rays around a pixel's centre: `silhouettes` reads two neighbours on each side."""
AT_ONCE = 20_000
"""Blocks traced together; this bounds the memory."""


def silhouettes_within(
    scene: Scene,
    pixels: NDArray[np.bool_],
    spacing: float,
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
) -> NDArray[np.bool_]:
    """Mask of the requested pixels with an edge within `spacing` pixels of their centre.

    Parameters
    ----------
    scene, time, params : as for `raymarch.truth`.
    pixels : (H, W), the pixels to examine; the others are False in the result.
    spacing : pixels, above 0. At 1 the rule is that of `silhouettes`. Below 1 the same rule is applied to rays at this
        spacing, as in a picture of higher resolution.

    Returns
    -------
    (H, W) bool.
    """
    height, width = pixels.shape
    values = set_values(scene.parameters, params, time)
    pose = scene.pose(values, width / height)
    steps = (np.arange(BLOCK) - BLOCK // 2) * spacing
    found = np.zeros(pixels.shape, np.bool_)
    row, column = np.nonzero(pixels)
    for start in range(0, len(row), AT_ONCE):
        i, j = row[start : start + AT_ONCE], column[start : start + AT_ONCE]
        beside = j[:, None, None] + steps, i[:, None, None] + steps[:, None]
        rays = rays_through(pose, *beside, (width, height))
        blocks = trace(scene, values, pose, rays, (BLOCK * len(i), BLOCK), spacing * pose.pixel(height))
        found[i, j] = silhouettes(blocks)[BLOCK // 2 :: BLOCK, BLOCK // 2]
    return found
