"""Errors as pictures."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.cost.errors import footprints
from raymarch.cost.flip import flip
from raymarch.cost.reference import Reference
from raymarch.errors import CostError
from raymarch.gpu.scale import Scale

LOWEST, HIGHEST = 1e-4, 10.0
"""Footprints at the two ends of the colour scale."""
WRONG = (255, 0, 255)
"""Colour of missed and false hits."""
FOOTPRINT_SCALE = Scale("pixel footprints", LOWEST, HIGHEST, "log")
FLIP_SCALE = Scale("FLIP", 0.0, 1.0)


def plotting() -> Any:
    """Import matplotlib. CostError with the command to install it."""
    try:
        import matplotlib
    except ImportError:
        raise CostError("plots need matplotlib", legal="pip install 'raymarch[report]'") from None
    return matplotlib


def footprint_map(known: Reference, depth: NDArray[Any]) -> NDArray[np.uint8]:
    """Distance from the true hit in footprints, logarithmic from 0.0001 to 10; missed and false hits in magenta."""
    apart = footprints(known, depth)
    pixels = _pixels(FOOTPRINT_SCALE, np.where(np.isfinite(apart), apart, HIGHEST))
    pixels[~np.isfinite(apart)] = WRONG
    return pixels


def flip_map(known: Reference, color: NDArray[Any]) -> NDArray[np.uint8]:
    """FLIP against the reference picture, 0 to 1."""
    return _pixels(FLIP_SCALE, flip(known.picture, color))


def _pixels(scale: Scale, values: NDArray[Any]) -> NDArray[np.uint8]:
    return np.asarray(np.rint(255 * scale.colored(values)), np.uint8)
