"""Errors as pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from raymarch.cost.errors import apart, footprints
from raymarch.cost.reference import Reference
from raymarch.gpu.frame import Frame, srgb
from raymarch.gpu.scale import Scale, colored
from raymarch.scene.scene import Scene
from raymarch.truth import truth

LOWEST, HIGHEST = 1e-4, 10.0
"""Footprints at the two ends of the colour scale."""
WRONG = (255, 0, 255)
"""Colour of missed and false hits."""
BRIGHTEST = 0.35
"""Brightness of the picture under an error map."""
DARKEST = 0.25
"""Part of the colour scale that a map leaves out: it could not be told from the dimmed picture."""
BANDS = 20
"""Bands of the colour scales: four for each power of ten, or a twentieth of FLIP. A reader tells bands apart better
than shades, and they compress better."""
FOOTPRINT_SCALE = Scale("pixel footprints", LOWEST, HIGHEST, "log")
FLIP_SCALE = Scale("FLIP", 0.0, 1.0)
ERROR_SCALE = replace(FOOTPRINT_SCALE, quantity="pixel footprints from the true hit; magenta: a missed or false hit")


def under_map(known: Reference) -> NDArray[np.uint8]:
    """The reference picture in dark grey, (H, W, 3), which is seen where a map shows no error."""
    grey = BRIGHTEST * srgb(known.picture).mean(axis=-1)
    return np.repeat(np.rint(grey).astype(np.uint8)[..., None], 3, axis=-1)


def footprint_map(known: Reference, depth: NDArray[Any], under: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
    """Distance from the true hit in footprints, in bands from 0.0001 to 10. Missed and false hits are magenta. Where
    the error is smaller or there is no surface, the reference picture is seen in dark grey.

    under : the result of `under_map`, if it is known already.
    """
    off = footprints(known, depth)
    pixels = under_map(known) if under is None else under.copy()
    _draw_bands(pixels, FOOTPRINT_SCALE, np.where(np.isfinite(off), off, HIGHEST), off > LOWEST)
    pixels[~np.isfinite(off)] = WRONG
    return pixels


def flip_map(known: Reference, difference: NDArray[Any], under: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
    """FLIP (H, W) in bands from 0 to 1; where it is below 0.05, the reference picture in dark grey."""
    pixels = under_map(known) if under is None else under.copy()
    _draw_bands(pixels, FLIP_SCALE, difference, difference >= 1.0 / BANDS)
    return pixels


def band_colors(scale: Scale) -> NDArray[np.uint8]:
    """The colours of a scale's bands from low to high, (BANDS, 3); the darkest of its colours are left to the grey."""
    share = DARKEST + (1.0 - DARKEST) * (np.arange(BANDS) + 0.5) / BANDS
    return np.asarray(np.rint(255 * colored(share, scale.colors)), np.uint8)


def _draw_bands(pixels: NDArray[np.uint8], scale: Scale, values: NDArray[Any], shown: NDArray[np.bool_]) -> None:
    """Draw the bands of the shown values into a picture."""
    band = np.minimum(scale.normalized(values[shown]) * BANDS, BANDS - 1).astype(int)
    pixels[shown] = band_colors(scale)[band]


# The view of the errors of a frame


def errors_of(frame: Frame, scene: Scene, params: Mapping[str, Any] | None = None) -> NDArray[np.float64]:
    """abs(depth - reference) in pixel footprints, (H, W): inf where a hit is missed or false, 0 where neither hits.

    Traces the reference at the frame's time with the scene's own camera; params : those of the frame.
    """
    assert frame.pose is not None
    known = truth(scene, frame.size, frame.time, params, outputs=())
    return apart(frame.depth, known.depth, frame.pose.footprint(known.depth, frame.size[1]))


def error_picture(errors: NDArray[np.float64]) -> Image.Image:
    """The result of `errors_of` as an 8-bit image of the same size; missed and false hits are magenta."""
    pixels = np.asarray(np.rint(255 * ERROR_SCALE.colored(errors)), np.uint8)
    pixels[~np.isfinite(errors)] = WRONG
    return Image.fromarray(pixels)
