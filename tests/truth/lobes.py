"""The shader's random numbers in NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.hashing import pcg


def random_of_pixel(x: Any, y: Any, sample: Any, dimension: Any) -> NDArray[np.float32]:
    """The shader's random numbers in [0, 1), bit for bit."""
    bits = pcg(_u32(x) + pcg(_u32(y) + pcg(_u32(sample) + pcg(_u32(dimension)))))
    return (bits >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24)


def _u32(value: Any) -> NDArray[np.uint32]:
    return np.atleast_1d(np.asarray(value)).astype(np.uint32)
