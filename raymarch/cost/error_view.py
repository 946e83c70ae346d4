"""Depth errors of a frame as a picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.cost.errors import apart
from raymarch.cost.maps import HIGHEST, LOWEST, WRONG
from raymarch.gpu.frame import Frame
from raymarch.gpu.scale import Scale
from raymarch.scene.scene import Scene
from raymarch.truth import truth

Array = NDArray[np.float64]


def errors_of(frame: Frame, scene: Scene, params: Mapping[str, Any] | None = None) -> Array:
    """abs(depth - reference) in pixel footprints, (H, W): inf where a hit is missed or false, 0 where neither hits.

    Traces the reference at the frame's time with the scene's own camera; params : those of the frame.
    """
    assert frame.pose is not None
    known = truth(scene, frame.size, frame.time, params, outputs=())
    return apart(frame.depth, known.depth, frame.pose.footprint(known.depth, frame.size[1]))


def error_scale() -> Scale:
    """The colour scale of `error_picture`."""
    quantity = "pixel footprints from the true hit; magenta: a missed or false hit"
    return Scale(quantity, LOWEST, HIGHEST, "log")


def error_picture(errors: Array) -> Image.Image:
    """The result of `errors_of` as an 8-bit image of the same size; missed and false hits are magenta."""
    pixels = np.asarray(np.rint(255 * error_scale().colored(errors)), np.uint8)
    pixels[~np.isfinite(errors)] = WRONG
    return Image.fromarray(pixels)
