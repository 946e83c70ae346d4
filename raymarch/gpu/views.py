"""Pictures of arrays other than colour: what `--view` and the window show."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.gpu.frame import Frame
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
}
"""The arrays that each view needs."""


def picture(frame: Frame, view: str, scene: Scene) -> Image.Image:
    """A view as an 8-bit image.

    depth: near is bright, what was not hit is black. normal: x, y, z from -1 to 1 as red, green, blue.
    iterations, evaluations, fallbacks: black is 0, white the largest of the picture. residual: logarithmic.
    material: a colour for each index.
    """
    if view == "final":
        return frame.image()
    values = frame.array(view)
    if view == "normal":
        lit = np.any(values != 0, axis=-1, keepdims=True)
        return _bytes(np.where(lit, 0.5 + 0.5 * values, 0.0))
    if view == "depth":
        return _bytes(_nearness(values))
    if view == "material":
        return _bytes(_colors(values))
    if view == "residual":
        return _bytes(_stretched(np.log10(np.maximum(np.abs(values), 1e-9)) + 9))
    return _bytes(_stretched(values.astype(np.float64)))


def light(frame: Frame, view: str) -> NDArray[np.float32]:
    """A view as it is, (H, W, 3) in float32: linear colour, or an array's own numbers, one number three times."""
    values = np.asarray(frame.color if view == "final" else frame.array(view), np.float32)
    return values if values.ndim == 3 else np.repeat(values[..., None], 3, axis=-1)


def _bytes(values: NDArray[Any]) -> Image.Image:
    return Image.fromarray(np.asarray(np.rint(255 * np.clip(values, 0, 1)), np.uint8))


def _stretched(values: NDArray[Any]) -> NDArray[Any]:
    largest = float(values.max())
    return values / largest if largest > 0 else values


def _nearness(depth: NDArray[Any]) -> NDArray[Any]:
    hit = np.isfinite(depth)
    if not hit.any():
        return np.zeros(depth.shape)
    near = float(depth[hit].min())
    safe = np.where(hit, depth, 1.0)
    return np.where(hit, max(near, 1e-12) / np.maximum(safe, 1e-12), 0.0)


def _colors(index: NDArray[Any]) -> NDArray[Any]:
    """Hues a golden angle apart, so that neighbouring indices differ; black for no hit."""
    hue = (index * 0.618033988749895) % 1.0
    rgb = np.stack([np.abs((hue * 6 + shift) % 6 - 3) - 1 for shift in (0, 4, 2)], axis=-1)
    return np.where((index >= 0)[..., None], 0.25 + 0.65 * np.clip(rgb, 0, 1), 0.0)
