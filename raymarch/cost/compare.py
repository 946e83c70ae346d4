"""The errors of a frame of any renderer against the reference, from Python."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from raymarch.cost.errors import Errors, measure
from raymarch.cost.reference import reference
from raymarch.errors import CostError
from raymarch.expr.calls import checked
from raymarch.expr.convert import numbers, short
from raymarch.scene.parameter import ParamValue
from raymarch.scene.scene import Scene, as_scene
from raymarch.sdf.node import Node


@checked
def compare(
    scene: Scene | Node,
    frame: Any,
    time: float | None = None,
    params: Mapping[str, ParamValue] | None = None,
    samples: int = 0,
) -> Errors:
    """The errors of a frame against the float64 reference, as `raymarch cost` measures them: away from silhouettes.

    Parameters
    ----------
    scene : the scene, or a solid in a default one.
    frame : a Frame or a Truth; or any object with `depth`, (H, W), the distance along the ray and inf where nothing was
        hit, and optionally `normal`, (H, W, 3): of a renderer of your own, with one ray through the centre of a pixel.
    time, params : of the frame. None is the time of the frame, or 0.
    samples : 0 leaves out the picture. A square number up to 256 compares `color`, (H, W, 3), linear RGB, too: FLIP
        against the mean of so many reference rays per pixel.

    Returns Errors, such as `pixels_p99`, `depth_max`, `normal_p99`, `missed`, `false` and `flip_p99`, with
    `as_dict()` for JSON. The reference is cached.

    Raises CostError for arrays of another shape, SceneError as `raymarch.truth` does.
    """
    scene = as_scene("compare", scene)
    legal = "a Frame, or an object with depth (H, W)"
    depth = numbers("compare: depth", getattr(frame, "depth", None), legal)
    if depth.ndim != 2:
        raise CostError(f"compare: depth of shape {depth.shape}", legal=legal)
    if not isinstance(samples, int | np.integer) or not 0 <= samples <= 256 or round(samples**0.5) ** 2 != samples:
        raise CostError(f"compare: samples = {short(samples)}", legal="0, or a square number up to 256")
    height, width = depth.shape
    known = reference(scene, (width, height), getattr(frame, "time", 0.0) if time is None else time, params, samples)
    try:
        return measure(known, depth, getattr(frame, "normal", None), frame.color if samples else None)
    except (ValueError, AttributeError) as fault:
        raise CostError(f"compare: {fault}", legal="normal and color of shape (H, W, 3)") from None
