"""Visualizations of a frame's arrays, for `--view` and the window. A view is a row of `ALL`."""

from __future__ import annotations

import builtins
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.expr.arrays import evaluator, row_blocks
from raymarch.expr.color_maps import color_map
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import abs, clamp, dot, fract, log2, max, mod, vec3, where
from raymarch.gpu.boxes import boxes_of, draw_boxes
from raymarch.gpu.display import HIGH, HIT, LOW, VALUE, VECTOR, display_of, is_worth
from raymarch.gpu.frame import Frame
from raymarch.gpu.scale import Scale
from raymarch.gpu.slices import SCALE as SLICE
from raymarch.gpu.slices import slice_picture, spacing
from raymarch.gpu.targets import Surface
from raymarch.scene.scene import Scene

COUNTS = {
    "iterations": "steps per ray",
    "evaluations": "field evaluations per pixel",
    "fallbacks": "undone steps per ray",
    "all_evaluations": "evaluations of a pixel by all rays",
    "shadow_evaluations": "evaluations of a pixel by shadow rays",
    "occlusion_evaluations": "evaluations of a pixel by samples of ambient occlusion",
    "bounce_evaluations": "evaluations of a pixel by bounces",
}

SMALLEST = 1e-9
"""Residuals at or below this value have the lowest colour."""


@dataclass(frozen=True, slots=True)
class View:
    """A visualization of arrays.

    outputs : the arrays that it needs; it shows the first.
    scale : the colour scale for the values of that array. None for a view without one.
    color : sRGB from 0 to 1, a function of the variables of `raymarch.gpu.display`. It is evaluated on the device, or
        by NumPy for arrays that are not there. None for a view that depends on more than the pixel.
    ends : the ends of the range of values, from the array; by default those of the scale.
    """

    outputs: tuple[str, ...]
    scale: Callable[[NDArray[Any]], Scale] | None = None
    color: Expr | None = None
    ends: Callable[[NDArray[Any]], tuple[Any, Any]] | None = None

    def range(self, frame: Frame, scale: Scale | None) -> tuple[Any, Any]:
        """The ends of the range of values in a frame, whose colour scale is known or is computed."""
        if self.ends is not None:
            return self.ends(frame.array(self.outputs[0]))
        if scale is None and self.scale is not None:
            scale = self.scale(frame.array(self.outputs[0]))
        return (0.0, 1.0) if scale is None else (scale.low, builtins.min(scale.high, 1e30))


def count_scale(quantity: str) -> Callable[[NDArray[Any]], Scale]:
    """The scale of counts: from 0 to the 99th percentile, so that a few extreme pixels do not darken the others; to the
    maximum if the percentile is 0."""

    def scale(counts: NDArray[Any]) -> Scale:
        most = _largest(counts)
        high = float(np.percentile(counts, 99)) or most or 1.0
        return Scale(quantity if most <= high else f"{quantity}, at most {most:.4g}", 0.0, high, whole=True)

    return scale


def _cycles(cycles: NDArray[Any]) -> Scale:
    return Scale("clock cycles per pixel", 0.0, float(np.percentile(cycles, 99)) or 1.0)


def _residual(residual: NDArray[Any]) -> Scale:
    largest = builtins.max(_largest(np.abs(residual)), 10 * SMALLEST)
    return Scale("absolute field value at the last sample, units of length", SMALLEST, largest, "log")


def _depth(depth: NDArray[Any]) -> Scale:
    hit = np.isfinite(depth)
    near = float(depth[hit].min()) if hit.any() else 1.0
    return Scale("distance along the ray, units of length", builtins.max(near, 1e-12), np.inf, "reciprocal", "viridis")


def _slice(values: NDArray[Any]) -> Scale:
    return replace(SLICE, quantity=f"{SLICE.quantity}; a line every {spacing(values[..., 0]):g}")


def _position_ends(position: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """The smallest and the largest coordinates in the picture."""
    hit = np.isfinite(position[..., 0])
    low, high = (end(position[hit], axis=0) if hit.any() else np.zeros(3) for end in (np.min, np.max))
    return low, high


BLACK = vec3(0.0, 0.0, 0.0)

_COUNT = color_map("inferno")(abs(VALUE) / HIGH.x)

_RESIDUAL = color_map("inferno")((log2(max(abs(VALUE), LOW.x)) - log2(LOW.x)) / (log2(HIGH.x) - log2(LOW.x)))

_DEPTH = where(HIT > 0.0, color_map("viridis")(LOW.x / max(VALUE, LOW.x)), BLACK)
"""Close is bright, a miss is black."""

_NORMAL = where(dot(abs(VECTOR), vec3(1.0, 1.0, 1.0)) > 0.0, 0.5 + 0.5 * VECTOR, BLACK)
"""x, y, z from -1 to 1 as red, green, blue."""

_POSITION = where(HIT > 0.0, (VECTOR - LOW) / max(HIGH - LOW, 1e-30), BLACK)
"""x, y, z as red, green, blue, each from its least to its largest value in the picture; black for a miss."""

_SHIFTED = 6.0 * fract(VALUE * 0.618033988749895) + vec3(0.0, 4.0, 2.0)
_MATERIAL = where(VALUE >= 0.0, 0.25 + 0.65 * clamp(abs(mod(_SHIFTED, 6.0) - 3.0) - 1.0, 0.0, 1.0), BLACK)
"""Hues a golden angle apart, so that neighbouring indices differ; black for a miss."""

ALL: Mapping[str, View] = {
    "final": View(("color",)),
    "depth": View(("depth",), _depth, _DEPTH),
    "normal": View(("normal",), color=_NORMAL),
    "shading_normal": View(("shading_normal",), color=_NORMAL),
    **{name: View((name,), count_scale(quantity), _COUNT) for name, quantity in COUNTS.items()},
    "residual": View(("residual",), _residual, _RESIDUAL),
    "material": View(("material",), color=_MATERIAL),
    "position": View(("position",), color=_POSITION, ends=_position_ends),
    "slice": View(("slice",), _slice),
    "boxes": View(("color", "depth")),
    "cycles": View(("cycles",), _cycles, _COUNT),
}
"""The views by name."""

VIEWS: Mapping[str, tuple[str, ...]] = {name: view.outputs for name, view in ALL.items()}
"""The arrays that each view needs."""


def picture(frame: Frame, view: str, scene: Scene, scale: Scale | None = None) -> Image.Image:
    """A view as an 8-bit image of the frame's size.

    scale : that of `scale_of`, if it is known.

    boxes: the picture with the bounding box of the scene in red, and those of its operands.
    """
    if view == "final":
        return frame.image()
    if view == "boxes":
        return _bytes(_with_boxes(np.asarray(frame.image().convert("RGB")) / 255.0, frame, scene))
    name = VIEWS[view][0]
    shown = ALL[view]
    if shown.color is None:
        values = frame.array(name)
        return _bytes(slice_picture(values[..., 0], values[..., 1]))
    ends, unread = shown.range(frame, scale), frame.on_device(name)
    if unread is not None:
        with unread.texture() as target:
            if target is not None and is_worth(target):
                return display_of(target.context).image(target, unread.chosen.outputs[name], shown.color, ends)
    return _bytes(_colored(shown.color, frame.array(name), ends))


def fill(surface: Surface, frame: Frame, view: str, scale: Scale | None = None) -> bool:
    """Fill a surface with the linear colours of a view on the device. False if the view is not coloured there."""
    name = VIEWS[view][0]
    shown, unread = ALL[view], frame.on_device(name)
    if shown.color is None or unread is None:
        return False
    ends = shown.range(frame, scale)
    with unread.texture() as target:
        if target is None:
            return False
        display_of(target.context).fill(surface, target, unread.chosen.outputs[name], shown.color, ends)
    return True


def _colored(color: Expr, values: NDArray[Any], ends: tuple[Any, Any]) -> NDArray[np.float64]:
    vector = values.ndim == 3
    compute = _evaluator(color, vector)
    made = np.empty((*values.shape[:2], 3))
    low, high = (np.broadcast_to(np.asarray(end, np.float64), 3) for end in ends)
    for rows in row_blocks(values):
        some = values[rows].reshape((-1, 3) if vector else -1)
        hit = np.isfinite(some[:, 0] if vector else some).astype(np.float64)
        made[rows] = np.reshape(compute(some, hit, low, high)[0], made[rows].shape)
    return made


@cache
def _evaluator(color: Expr, vector: bool) -> Callable[..., tuple[Any, ...]]:
    return evaluator([color], [VECTOR if vector else VALUE, HIT, LOW, HIGH])


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
    if np.isfinite(largest := float(values.max())):
        return largest
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else 0.0


def _bytes(values: NDArray[Any]) -> Image.Image:
    made = np.empty(values.shape, np.uint8)
    for rows in row_blocks(values):
        made[rows] = np.rint(255 * np.fmin(np.fmax(values[rows], 0.0), 1.0))  # of NaN and 0 it takes 0
    return Image.fromarray(made)
