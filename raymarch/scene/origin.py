"""The origin of the shader's coordinates. Usually it is the origin of the scene; for a scene far away it is nearby.

Camera, solids and lights are moved to the new origin in float64, before they reach the shader. The shader then holds
small numbers only, and the picture is that of the same scene at the origin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.function import Function
from raymarch.expr.node import const
from raymarch.expr.raw import without_twin
from raymarch.scene.light import Light
from raymarch.scene.parameter import Values, set_values
from raymarch.scene.scene import Scene
from raymarch.sdf.lower import lower
from raymarch.sdf.shifted import shifted

FAR = 64.0
"""Ratio of distance from the origin to scene size above which another origin is chosen. At this ratio 6 of the 24 bits
of float32 are lost."""

ULP = 2.0**-23


def origin_of(scene: Scene) -> NDArray[np.float64]:
    """The origin of coordinates near the camera, shape (3,), float64; 0 if the scene is not far away.

    It is rounded to multiples of a power of two above the size of the scene. So a scene moved by a round number gives
    the same shader text.
    """
    position, reach = _view(scene, set_values(scene.parameters, {}, 0.0))
    if position is None or np.max(np.abs(position)) <= FAR * reach:
        return np.zeros(3)
    grid = 2.0 ** np.ceil(np.log2(reach))
    origin: NDArray[np.float64] = grid * np.rint(position / grid)
    return origin


def _view(scene: Scene, values: Values) -> tuple[NDArray[np.float64] | None, float]:
    """The position of the camera, and the size of the scene as seen from there."""
    try:
        position = scene.pose(values).position
    except SceneError:
        return None, 1.0  # degenerate as long as parameters have their defaults
    subject = scene.subject
    if subject is not None:
        middle = 0.5 * (subject.lower + subject.upper)
        return position, float(np.linalg.norm(position - middle) + np.linalg.norm(subject.size)) or 1.0
    return position, _nearest(lower(scene.node), position, values) or 1.0


def _nearest(field: Function, position: NDArray[np.float64], values: Values) -> float | None:
    """Lower bound of the distance from the camera to the nearest surface.

    None if only the GPU can evaluate the field, or if the surface touches the camera.
    """
    if without_twin(field.body):
        return None
    with bound(values.params, values.time):
        distance = evaluator([field.body], field.params)(position)[0]
    return abs(float(distance)) or None


def seen_from(scene: Scene, origin: NDArray[np.float64]) -> Scene:
    """The scene with its solids, lights and fog moved to an origin. The camera is unchanged."""
    if not np.any(origin):
        return scene
    return scene.replace(
        node=shifted(scene.node, origin),
        lights=tuple(_light_from(light, origin) for light in scene.lights),
        fog=None if scene.fog is None else scene.fog.replace(height=scene.fog.height - float(origin[1])),
    )


def _light_from(light: Light, origin: NDArray[np.float64]) -> Light:
    if not light.has_position:
        return light
    return light.replace(position=light.arguments()["position"] - const(origin))


def range_warning(scene: Scene, origin: NDArray[np.float64], field: Function) -> list[str]:
    """A warning if float32 cannot hold the epsilon of the quality, at default parameters and 1080 rows.

    field : the distance, as a function of the point relative to `origin`.

    Each of several sums rounds a point by half a unit in the last place of its largest coordinate, 2 ulp in total.
    If that exceeds epsilon, the error of hits is that of the rounding, not that of the quality.
    """
    values = set_values(scene.parameters, {}, 0.0)
    try:
        pose = scene.pose(values)
    except SceneError:
        return []  # degenerate as long as parameters have their defaults
    away = _nearest(field, pose.position - origin, values)
    if away is None:
        return []
    largest = float(np.max(np.abs(pose.position - origin))) + away
    rounding = 2.0 * ULP * largest
    if rounding <= scene.quality.near(scene.node.exactness != "estimate") * pose.footprint(away, 1080):
        return []
    pixels = rounding / pose.footprint(away, 1080)
    return [
        f"coordinates reach {largest:.3g} and the nearest surface is {away:.3g} away: in float32 hits are within "
        f"{rounding:.2g}, {pixels:.2g} pixel widths, whatever the quality"
    ]
