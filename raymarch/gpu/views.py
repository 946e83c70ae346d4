"""Visualizations of a frame's arrays, for `--view` and the window."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.gpu.boxes import boxes_of, draw_boxes
from raymarch.gpu.frame import Frame
from raymarch.gpu.scale import Scale
from raymarch.gpu.slices import SCALE as SLICE
from raymarch.gpu.slices import slice_picture, spacing
from raymarch.scene.scene import Scene

VIEWS: Mapping[str, tuple[str, ...]] = {
    "final": ("color",),
    "depth": ("depth",),
    "normal": ("normal",),
    "iterations": ("iterations",),
    "evaluations": ("evaluations",),
    "fallbacks": ("fallbacks",),
    "residual": ("residual",),
    "material": ("material",),
    "slice": ("slice",),
    "boxes": ("color", "depth"),
    "cycles": ("cycles",),
}
"""The arrays that each view needs."""

COUNTS = {
    "iterations": "steps per ray",
    "evaluations": "field evaluations per pixel",
    "fallbacks": "undone steps per ray",
}

SMALLEST = 1e-9
"""Residuals at or below this value have the lowest colour."""


def picture(frame: Frame, view: str, scene: Scene) -> Image.Image:
    """A view as an 8-bit image of the frame's size.

    depth: close is bright, a miss is black. normal: x, y, z from -1 to 1 as red, green, blue.
    iterations, evaluations, fallbacks, cycles: from 0 to the 99th percentile of the pixels, so that a few extreme
    pixels do not darken the others; to the maximum if the percentile is 0. residual: logarithmic.
    material: a colour for each index. slice: see `raymarch.gpu.slices.slice_picture`.
    boxes: the picture with the bounding box of the scene in red, and those of its operands.
    `scale_of` returns the scale of the colours.
    """
    if view == "final":
        return frame.image()
    if view == "boxes":
        return _bytes(_with_boxes(np.asarray(frame.image().convert("RGB")) / 255.0, frame, scene))
    values = frame.array(view)
    if view == "normal":
        lit = np.any(values != 0, axis=-1, keepdims=True)
        return _bytes(np.where(lit, 0.5 + 0.5 * values, 0.0))
    if view == "slice":
        return _bytes(slice_picture(values[..., 0], values[..., 1]))
    if view == "material":
        return _bytes(_colors(values))
    scale = scale_of(frame, view)
    assert scale is not None
    shown = scale.colored(np.abs(values))
    if view == "depth":
        shown[~np.isfinite(values)] = 0.0
    return _bytes(shown)


def scale_of(frame: Frame, view: str) -> Scale | None:
    """The colour scale of a view; None for views without one."""
    if view in COUNTS:
        counts = frame.array(view)
        most = _largest(counts)
        high = float(np.percentile(counts, 99)) or most or 1.0
        return Scale(COUNTS[view] if most <= high else f"{COUNTS[view]}, at most {most:.4g}", 0.0, high)
    if view == "cycles":
        return Scale("clock cycles per pixel", 0.0, float(np.percentile(frame.array(view), 99)) or 1.0)
    if view == "residual":
        largest = _largest(np.abs(frame.array(view)))
        return Scale(
            "absolute field value at the last sample, units of length", SMALLEST, max(largest, 10 * SMALLEST), "log"
        )
    if view == "depth":
        depth = frame.array(view)
        hit = np.isfinite(depth)
        near = float(depth[hit].min()) if hit.any() else 1.0
        return Scale("distance along the ray, units of length", max(near, 1e-12), np.inf, "reciprocal", "viridis")
    if view == "slice":
        step = spacing(frame.array(view)[..., 0])
        return replace(SLICE, quantity=f"{SLICE.quantity}; a line every {step:g}")
    return None


def light(frame: Frame, view: str, scene: Scene) -> NDArray[np.float32]:
    """A view as numbers, (H, W, 3) in float32: linear colour, or the values of an array; a scalar is repeated three
    times."""
    if view == "boxes":
        return _with_boxes(frame.color, frame, scene).astype(np.float32)
    values = np.asarray(frame.color if view == "final" else frame.array(view), np.float32)
    if view == "slice":  # the third number is 0
        return np.concatenate([values, np.zeros_like(values[..., :1])], axis=-1)
    return values if values.ndim == 3 else np.repeat(values[..., None], 3, axis=-1)


def _with_boxes(picture: NDArray[Any], frame: Frame, scene: Scene) -> NDArray[np.float64]:
    if frame.pose is None:
        raise ValueError("boxes: the frame has no camera pose")
    return draw_boxes(picture, frame.depth, frame.pose, boxes_of(scene), scene.far(frame.pose))


def _largest(values: NDArray[Any]) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else 0.0


def _bytes(values: NDArray[Any]) -> Image.Image:
    return Image.fromarray(np.asarray(np.rint(255 * np.clip(values, 0, 1)), np.uint8))


def _colors(index: NDArray[Any]) -> NDArray[Any]:
    """Hues a golden angle apart, so that neighbouring indices differ; black for a miss."""
    hue = (index * 0.618033988749895) % 1.0
    rgb = np.stack([np.abs((hue * 6 + shift) % 6 - 3) - 1 for shift in (0, 4, 2)], axis=-1)
    return np.where((index >= 0)[..., None], 0.25 + 0.65 * np.clip(rgb, 0, 1), 0.0)
