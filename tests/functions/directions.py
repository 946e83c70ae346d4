"""Directions for functions of light, about the normal z."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def slanted(cosines: ArrayLike, turn: float = 0.0) -> NDArray[np.float64]:
    """Unit vectors of the given cosines to z, on one side of it."""
    c = np.asarray(cosines, np.float64)
    s = np.sqrt(1 - c * c)
    return np.stack([s * np.cos(turn), s * np.sin(turn), c], axis=-1)
