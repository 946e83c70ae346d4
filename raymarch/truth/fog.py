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


def fogged(scene: Scene, values: Values, color: Array, origins: Array, directions: Array, depth: Array) -> Array:
    """The radiance (N, 3) that arrives at the origins, (3,) or (N, 3), of a colour (N, 3) at distances (N,)."""
    if scene.fog is None:
        return color
    evaluate = evaluator([scene.fog.applied(scene.sky, scene.lights, None)], [COLOR, ORIGIN, DIRECTION, LENGTH])
    with bound(values.params, values.time):
        (found,) = evaluate(color, np.broadcast_to(origins, color.shape), directions, depth)
    return np.array(np.broadcast_to(found, color.shape))


def sky_seen(scene: Scene, values: Values, origins: Array, directions: Array) -> Array:
    """Radiance of the sky along camera rays, behind the fog, (N, 3)."""
    color = scene.sky.radiance_along(directions, values)
    if scene.fog is None or not scene.fog.covers_sky:
        return color
    return fogged(scene, values, color, origins, directions, np.full(len(color), SKY_DISTANCE))
