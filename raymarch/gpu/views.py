"""Visualizations of a frame's arrays, for `--view` and the window. A view is a row of `ALL`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.expr.arrays import row_blocks
from raymarch.gpu.boxes import boxes_of, draw_boxes
from raymarch.gpu.frame import Frame
from raymarch.gpu.scale import Scale
from raymarch.gpu.slices import SCALE as SLICE
from raymarch.gpu.slices import slice_picture, spacing
from raymarch.scene.scene import Scene

COUNTS = {
    "iterations": "steps per ray",
    "evaluations": "field evaluations per pixel",
    "fallbacks": "undone steps per ray",
}

SMALLEST = 1e-9
"""Residuals at or below this value have the lowest colour."""


@dataclass(frozen=True, slots=True)
class View:
    """A visualization of arrays.

    Attributes
    ----------
    outputs : the arrays that it needs; it shows the first.
    scale : the colour scale for the values of that array. None for a view without one.
    colored : sRGB from 0 to 1, (H, W, 3), from the array. None colours the absolute values by the scale,
        and is black where they are not finite.
    """

    outputs: tuple[str, ...]
    scale: Callable[[NDArray[Any]], Scale] | None = None
    colored: Callable[[NDArray[Any]], NDArray[Any]] | None = None


def _count(quantity: str) -> Callable[[NDArray[Any]], Scale]:
    """From 0 to the 99th percentile, so that a few extreme pixels do not darken the others; to the maximum if the
    percentile is 0."""

    def scale(counts: NDArray[Any]) -> Scale:
        most = _largest(counts)
        high = float(np.percentile(counts, 99)) or most or 1.0
        return Scale(quantity if most <= high else f"{quantity}, at most {most:.4g}", 0.0, high)

    return scale


def _cycles(cycles: NDArray[Any]) -> Scale:
    return Scale("clock cycles per pixel", 0.0, float(np.percentile(cycles, 99)) or 1.0)


def _residual(residual: NDArray[Any]) -> Scale:
    largest = max(_largest(np.abs(residual)), 10 * SMALLEST)
    return Scale("absolute field value at the last sample, units of length", SMALLEST, largest, "log")


def _depth(depth: NDArray[Any]) -> Scale:
    hit = np.isfinite(depth)
    near = float(depth[hit].min()) if hit.any() else 1.0
    return Scale("distance along the ray, units of length", max(near, 1e-12), np.inf, "reciprocal", "viridis")


def _slice(values: NDArray[Any]) -> Scale:
    return replace(SLICE, quantity=f"{SLICE.quantity}; a line every {spacing(values[..., 0]):g}")


def _colored_normal(normal: NDArray[Any]) -> NDArray[Any]:
    """x, y, z from -1 to 1 as red, green, blue."""
    return np.where(np.any(normal != 0, axis=-1, keepdims=True), 0.5 + 0.5 * normal, 0.0)


def _colored_position(position: NDArray[Any]) -> NDArray[Any]:
    """x, y, z as red, green, blue, each from its least to its largest value in the picture; black for a miss."""
    hit = np.isfinite(position[..., 0])
    low, high = (end(position[hit], axis=0) if hit.any() else np.zeros(3) for end in (np.min, np.max))
    shares = (np.where(hit[..., None], position, low) - low) / np.maximum(high - low, 1e-30)
    return np.where(hit[..., None], shares, 0.0)


def _colored_material(index: NDArray[Any]) -> NDArray[Any]:
    """Hues a golden angle apart, so that neighbouring indices differ; black for a miss."""
    hue = (index * 0.618033988749895) % 1.0
    rgb = np.stack([np.abs((hue * 6 + shift) % 6 - 3) - 1 for shift in (0, 4, 2)], axis=-1)
    return np.where((index >= 0)[..., None], 0.25 + 0.65 * np.clip(rgb, 0, 1), 0.0)


ALL: Mapping[str, View] = {
    "final": View(("color",)),
    "depth": View(("depth",), _depth),
    "normal": View(("normal",), colored=_colored_normal),
    **{name: View((name,), _count(quantity)) for name, quantity in COUNTS.items()},
    "residual": View(("residual",), _residual),
    "material": View(("material",), colored=_colored_material),
    "position": View(("position",), colored=_colored_position),
    "slice": View(("slice",), _slice, lambda values: slice_picture(values[..., 0], values[..., 1])),
    "boxes": View(("color", "depth")),
    "cycles": View(("cycles",), _cycles),
}
"""The views by name."""

VIEWS: Mapping[str, tuple[str, ...]] = {name: view.outputs for name, view in ALL.items()}
"""The arrays that each view needs."""


def picture(frame: Frame, view: str, scene: Scene) -> Image.Image:
    """A view as an 8-bit image of the frame's size.

    boxes: the picture with the bounding box of the scene in red, and those of its operands. `scale_of` returns the
    scale of the colours.
    """
    if view == "final":
        return frame.image()
    if view == "boxes":
        return _bytes(_with_boxes(np.asarray(frame.image().convert("RGB")) / 255.0, frame, scene))
    shown, values = ALL[view], frame.array(VIEWS[view][0])
    if shown.colored is not None:
        return _bytes(shown.colored(values))
    assert shown.scale is not None
    scale, finite = shown.scale(values), np.isfinite(values)
    return _bytes(np.where(finite[..., None], scale.colored(np.where(finite, np.abs(values), scale.low)), 0.0))


def scale_of(frame: Frame, view: str) -> Scale | None:
    """The colour scale of a view; None for views without one."""
    scale = ALL[view].scale
    return None if scale is None else scale(frame.array(VIEWS[view][0]))


def light(frame: Frame, view: str, scene: Scene) -> NDArray[np.float32]:
    """A view as numbers, (H, W, 3) in float32: linear colour, or the values of an array; a scalar is repeated three
    times, and missing channels are 0."""
    if view == "boxes":
        return _with_boxes(frame.color, frame, scene).astype(np.float32)
    values = np.asarray(frame.array(VIEWS[view][0]), np.float32)
    if values.ndim == 2:
        return np.repeat(values[..., None], 3, axis=-1)
    return np.pad(values, ((0, 0), (0, 0), (0, 3 - values.shape[-1])))


def _with_boxes(picture: NDArray[Any], frame: Frame, scene: Scene) -> NDArray[np.float64]:
    if frame.pose is None:
        raise ValueError("boxes: the frame has no camera pose")
    return draw_boxes(picture, frame.depth, frame.pose, boxes_of(scene), scene.far(frame.pose))


def _largest(values: NDArray[Any]) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else 0.0


def _bytes(values: NDArray[Any]) -> Image.Image:
    made = np.empty(values.shape, np.uint8)
    for rows in row_blocks(values):
        made[rows] = np.rint(255 * np.clip(values[rows], 0, 1))
    return Image.fromarray(made)
