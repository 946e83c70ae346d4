"""Where the shader counts coordinates from. Usually the scene's own origin; a scene far away is described from nearby.

All that is far is combined in float64 before it reaches the shader, which then holds small numbers only: the camera,
the solids and the lights are given from the new origin, and the picture is the one of the scene at home.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.node import const
from raymarch.expr.raw import without_twin
from raymarch.scene.light import Light, PointLight
from raymarch.scene.parameter import Values, set_values
from raymarch.scene.scene import Scene
from raymarch.sdf.lower import lower
from raymarch.sdf.shifted import shifted

FAR = 64.0
"""How many times farther from the origin than the scene is large before another origin is chosen: 6 of float32's 24
bits are lost by then."""

ULP = 2.0**-23


def origin_of(scene: Scene) -> NDArray[np.float64]:
    """The point near the camera that coordinates are counted from, shape (3,), float64; 0 where the scene is not far.

    It is rounded to a power of two beyond the scene's size, so that a scene moved by a round number is the same text.
    """
    position, reach = _seen(scene, set_values(scene.parameters, {}, 0.0))
    if position is None or np.max(np.abs(position)) <= FAR * reach:
        return np.zeros(3)
    grid = 2.0 ** np.ceil(np.log2(reach))
    origin: NDArray[np.float64] = grid * np.rint(position / grid)
    return origin


def _seen(scene: Scene, values: Values) -> tuple[NDArray[np.float64] | None, float]:
    """Where the camera stands, and the size of what it sees from there."""
    try:
        position = scene.pose(values).position
    except SceneError:
        return None, 1.0  # degenerate as long as parameters have their defaults
    subject = scene.subject
    if subject is not None:
        middle = 0.5 * (subject.lower + subject.upper)
        return position, float(np.linalg.norm(position - middle) + np.linalg.norm(subject.size)) or 1.0
    return position, _nearest(scene, position, values) or 1.0


def _nearest(scene: Scene, position: NDArray[np.float64], values: Values) -> float | None:
    """How far from the camera the nearest surface is at least; None if only the GPU knows, or it touches the camera."""
    field = lower(scene.node)
    if without_twin(field.body):
        return None
    with bound(values.params, values.time):
        distance = evaluator([field.body], field.params)(position)[0]
    return abs(float(distance)) or None


def seen_from(scene: Scene, origin: NDArray[np.float64]) -> Scene:
    """The scene with its solids and lights given from an origin. Its camera is left where it was."""
    if not np.any(origin):
        return scene
    return scene.replace(
        node=shifted(scene.node, origin), lights=tuple(_light_from(light, origin) for light in scene.lights)
    )


def _light_from(light: Light, origin: NDArray[np.float64]) -> Light:
    if not isinstance(light, PointLight):
        return light
    return light.replace(position=light.position - const(origin))


def range_warning(scene: Scene, origin: NDArray[np.float64]) -> list[str]:
    """A sentence if float32 cannot hold what the quality promises, at the parameters' defaults and 1080 rows.

    A point is rounded by half a unit in the last place of its largest coordinate in each of some sums, 2 ulp in all.
    Where that is more than epsilon, hits are as exact as the rounding, not as the quality says.
    """
    values = set_values(scene.parameters, {}, 0.0)
    try:
        pose = scene.pose(values)
    except SceneError:
        return []  # degenerate as long as parameters have their defaults
    away = _nearest(scene, pose.position, values)
    if away is None:
        return []
    largest = float(np.max(np.abs(pose.position - origin))) + away
    rounding = 2.0 * ULP * largest
    if rounding <= scene.quality.near(scene.node.exactness != "estimate") * pose.pixel(1080) * away:
        return []
    pixels = rounding / (pose.pixel(1080) * away)
    return [
        f"coordinates reach {largest:.3g} and the nearest surface is {away:.3g} away: in float32 hits are within "
        f"{rounding:.2g}, {pixels:.2g} pixel widths, whatever the quality"
    ]
