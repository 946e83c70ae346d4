"""Lower bound on the number of field evaluations that decide what a ray hits.

For a 1-Lipschitz field f, t - f(t) and t + f(t) never decrease along a ray. Let the ray be proved free up to the
front e. A sample at c proves the interval from c - f(c) to c + f(c) free. The best next sample is therefore the largest
c with c - f(c) <= e: it moves the front to c + f(c). This greedy choice is optimal, because a farther front is never
worse. A real tracer does not know this c. Here bisection finds it, and its evaluations are not counted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.scene.parameter import ParamValue, set_values
from raymarch.scene.scene import Scene, as_scene
from raymarch.sdf.node import Node
from raymarch.truth.large import field_of
from raymarch.truth.rays import camera_rays
from raymarch.truth.tracer import checked_size
from raymarch.truth.visibility import is_inside

BISECTIONS = 40
LIMIT = 20_000


@checked
def floor_evaluations(
    scene: Scene | Node,
    size: tuple[int, int] = (160, 90),
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
) -> NDArray[np.int64]:
    """N*, the least number of field evaluations by which values alone decide a ray, for each pixel, in float64.

    Parameters
    ----------
    scene : a Scene, or a solid, whose field is certified ("exact" or "bound"); its Quality defines the hit distance.
    size : (width, height) in pixels.
    time, params : of the frame, see `render`.

    Returns
    -------
    ndarray of int, (height, width)
        0 for a ray that misses the scene's bounding box between the clip planes. Rays that share work may need fewer,
        and tracers that know more than values.

    Raises
    ------
    SceneError : a field that is only an estimate.

    Examples
    --------
    >>> int(rm.floor_evaluations(rm.sphere(), size=(3, 3))[1, 1])
    2
    """
    scene = as_scene("floor_evaluations", scene)
    if scene.node.exactness == "estimate":
        raise SceneError("floor_evaluations: the field is only an estimate", legal="a field that is 'exact' or 'bound'")
    width, height = checked_size(size)
    values = set_values(scene.parameters, params, time)
    pose = scene.pose(values, width / height)
    field = field_of(scene, values)
    rays = camera_rays(pose, width, height)
    rate = rays.directions @ pose.view
    lines = rays.lines(scene.node.facts, np.minimum(scene.far(pose, values), pose.far / rate))
    lines = replace(lines, start=np.maximum(lines.start, pose.near / rate))
    side = np.ones(width * height)
    if len(rays.origins) == 1 and pose.near == 0.0:
        side[:] = -1.0 if is_inside(field, pose.position) else 1.0
    else:
        side[field.distance(rays.at(np.arange(len(side)), pose.near / rate)) < 0.0] = -1.0
    near = scene.quality.near(refined=True)

    def evaluate(rows: NDArray[Any], t: NDArray[Any]) -> NDArray[np.float64]:
        return side[rows] * field.distance(rays.at(rows, t))

    counts = np.zeros(width * height, np.int64)
    rows = np.flatnonzero(lines.end > lines.start)
    front = lines.start[rows]
    for _ in range(LIMIT):
        if not rows.size:
            break
        end = lines.end[rows]
        low, high = front.copy(), np.maximum(end, front)
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            reaches = middle - evaluate(rows, middle) <= front
            low, high = np.where(reaches, middle, low), np.where(reaches, high, middle)
        reaches = end - evaluate(rows, end) <= front
        best = np.where(reaches, end, low)
        value = evaluate(rows, best)
        counts[rows] += 1
        front = np.maximum(front, best + value)
        going = (value >= near * pose.footprint(best, height)) & (front < end)
        rows, front = rows[going], front[going]
    return counts.reshape(height, width)
