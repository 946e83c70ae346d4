"""Errors as pictures."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.cost.errors import footprints
from raymarch.cost.flip import flip
from raymarch.cost.reference import Reference
from raymarch.errors import CostError

LOWEST, HIGHEST = 1e-4, 10.0
"""Footprints at the two ends of the colours."""
WRONG = (255, 0, 255)
"""Where a hit is missed or made up."""


def plotting() -> Any:
    """matplotlib, or what to install."""
    try:
        import matplotlib
    except ImportError:
        raise CostError("plots need matplotlib", legal="pip install 'raymarch[report]'") from None
    return matplotlib


def colored(values: NDArray[Any], low: float, high: float, log: bool = False) -> NDArray[np.uint8]:
    """Numbers as colours from black to yellow ("inferno"), (H, W) -> (H, W, 3); beyond the ends, the ends."""
    if log:
        values, low, high = np.log10(np.maximum(values, low)), float(np.log10(low)), float(np.log10(high))
    share = np.clip((values - low) / (high - low), 0.0, 1.0)
    pixels: NDArray[np.uint8] = plotting().colormaps["inferno"](share, bytes=True)[..., :3]
    return pixels


def footprint_map(known: Reference, depth: NDArray[Any]) -> NDArray[np.uint8]:
    """Distance from the true hit in footprints, logarithmic from 0.0001 to 10; missed and false hits in magenta."""
    apart = footprints(known, depth)
    pixels = colored(np.where(np.isfinite(apart), apart, HIGHEST), LOWEST, HIGHEST, log=True)
    pixels[~np.isfinite(apart)] = WRONG
    return pixels


def flip_map(known: Reference, color: NDArray[Any]) -> NDArray[np.uint8]:
    """FLIP against the true picture, 0 to 1."""
    return colored(flip(known.picture, color), 0.0, 1.0)
