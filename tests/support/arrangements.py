"""Places of many objects that fill space unevenly: a line, a plane, a shell, clusters, far groups, one place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ARRANGEMENTS = ("line", "plane", "shell", "clusters", "one cluster", "two groups", "one place")
RADIUS = 0.01
"""A radius for spheres at these places: some overlap."""


def arranged(name: str, n: int, seed: int = 0) -> NDArray[np.float64]:
    """n places, (n, 3)."""
    random = np.random.default_rng(seed)
    numbers, normal = np.arange(n), random.normal(size=(n, 3))
    match name:
        case "line":
            return np.stack([RADIUS * numbers, 0.0 * numbers, 0.0 * numbers], axis=1)
        case "plane":
            rows, columns = np.divmod(numbers, int(np.sqrt(n)))
            return 1.5 * RADIUS * np.stack([rows, columns, 0 * rows], axis=1)
        case "shell":
            return normal / np.linalg.norm(normal, axis=1, keepdims=True)
        case "clusters":
            return random.uniform(-10.0, 10.0, (20, 3))[numbers % 20] + 5.0 * RADIUS * normal
        case "one cluster":
            return normal * np.where(numbers < 10, 10.0, 0.1 * RADIUS)[:, None]
        case "one place":
            return 0.1 * RADIUS * normal
        case "two groups":
            return random.uniform(-1.0, 1.0, (n, 3)) + np.outer(numbers % 2, [1e6, 0.0, 0.0])
    raise ValueError(name)
