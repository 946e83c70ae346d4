"""Fog in float64: the expressions of `raymarch.scene.fog`, evaluated for N rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import bound, evaluator
from raymarch.scene.fog import COLOR, LENGTH, ORIGIN, SKY_DISTANCE
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.scene.sky import DIRECTION

Array = NDArray[np.float64]


def fogged(
    scene: Scene,
    values: Values,
    color: Array,
    origins: Array,
    directions: Array,
    depth: Array,
    near: Array | float = 0.0,
) -> Array:
    """The radiance (N, 3) that arrives at the origins, (3,) or (N, 3), of a colour (N, 3) at distances (N,).

    near : the distances (N,) before which the camera sees no matter.
    """
    if scene.fog is None:
        return color
    if scene.fog.box is not None:
        near = np.broadcast_to(near, depth.shape)
        origins, depth = origins + near[:, None] * directions, depth - near
    evaluate = evaluator([scene.fog.applied(scene.sky, scene.lights, None)], [COLOR, ORIGIN, DIRECTION, LENGTH])
    with bound(values.params, values.time):
        (found,) = evaluate(color, np.broadcast_to(origins, color.shape), directions, depth)
    return np.array(np.broadcast_to(found, color.shape))


def sky_seen(scene: Scene, values: Values, origins: Array, directions: Array, near: Array, end: Array) -> Array:
    """Radiance of the sky along camera rays, behind the fog, (N, 3). near, end : distances of the clip planes, (N,)."""
    color = scene.sky.radiance_along(directions, values)
    if scene.fog is None or not scene.fog.covers_sky:
        return color
    end = np.minimum(end if scene.fog.box is not None else SKY_DISTANCE, np.full(len(color), SKY_DISTANCE))
    return fogged(scene, values, color, origins, directions, end, near)
