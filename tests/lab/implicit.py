"""Implicit surfaces, held against tiny steps in float64, and their cost beside sphere tracing.

python -m tests.lab.implicit [--proofs] [--times] [NAME ...]     # twelve surfaces; see tests.support.surfaces
python -m tests.lab.implicit --forms                             # readings along a stretch: evaluations and operations

For each surface at 160x90: hits of the reference, missed and invented pixels, p50 and p99 of the distance of hits in
pixel footprints, evaluations a ray in the box, of the default and of sphere tracing with the least safe constant. This
is found by a search: the least constant with which at most one hit in a thousand is missed or late.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from tests.support.surfaces import Surface

SIZE = (160, 90)
STEPS = 3000
FOV = 45.0
TURNS = 9
Array = NDArray[Any]


def scene_of(surface: Surface, node: rm.Node, **quality: Any) -> rm.Scene:
    eye = tuple(np.array([1.5, 1.1, 2.2]) * surface.bounds)
    return rm.Scene(node, camera=rm.Camera(eye, (0, 0, 0), fov=FOV), quality=rm.Quality(**quality))


@dataclass(frozen=True)
class Rays:
    """The rays of a picture that meet the box, with their first change of sign, by tiny steps; inf for none."""

    origin: Array
    directions: Array
    inside: Array
    first: Array
    pixel: float
    size: tuple[int, int]

    def picture(self, values: Array, empty: float) -> Array:
        whole = np.full(len(self.inside), empty)
        whole[self.inside] = values
        return whole.reshape(self.size[1], self.size[0])


def rays_of(surface: Surface, size: tuple[int, int] = SIZE, steps: int = STEPS) -> Rays:
    """By a camera written anew. A hit is the box where the solid is cut, or a change of sign, bisected."""
    b, eye = surface.bounds, np.array([1.5, 1.1, 2.2]) * surface.bounds
    ahead = -eye / np.linalg.norm(eye)
    right = np.cross(ahead, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    half = np.tan(np.radians(FOV) / 2.0)
    x = (2.0 * np.arange(size[0]) + 1.0 - size[0]) / size[1] * half
    y = (size[1] - 1.0 - 2.0 * np.arange(size[1])) / size[1] * half
    d = ahead + x[None, :, None] * right + y[:, None, None] * np.cross(right, ahead)
    d = (d / np.linalg.norm(d, axis=-1, keepdims=True)).reshape(-1, 3)
    ends = (-b - eye) / d, (b - eye) / d
    near, far = np.minimum(*ends).max(axis=1), np.maximum(*ends).min(axis=1)
    inside = far > near
    d, near, far = d[inside], near[inside], far[inside]

    def value(t: Array, rows: Any = slice(None)) -> Array:
        return surface.function((eye + t[:, None] * d[rows]).T)

    first = np.where(value(near) < 0.0, near, np.inf)
    step = (far - near) / steps
    for k in range(1, steps + 1):
        rows = np.flatnonzero(np.isinf(first))
        places = near[rows] + k * step[rows]
        crossed = value(places, rows) < 0.0
        first[rows[crossed]] = places[crossed]
    rows = np.flatnonzero(np.isfinite(first) & (first > near))
    low, high = first[rows] - step[rows], first[rows]
    for _ in range(50):
        middle = 0.5 * (low + high)
        below = value(middle, rows) < 0.0
        low, high = np.where(below, low, middle), np.where(below, middle, high)
    first[rows] = high
    return Rays(eye, d, inside, first, 2.0 * half / size[1], size)


@dataclass(frozen=True)
class Row:
    """What a picture is worth."""

    hits: int
    missed: int
    invented: int
    p50: float
    p99: float
    evaluations: float
    most: int


def confirm(surface: Surface, depth: Array, rays: Rays) -> None:
    """Hits where tiny steps found none, but which a finer search confirms, become hits of the reference."""
    found = depth.ravel()[rays.inside]
    for row in np.flatnonzero(np.isfinite(found) & np.isinf(rays.first)):
        near = found[row] + rays.pixel * found[row] * np.linspace(-1.0, 1.0, 100_001)
        below = surface.function((rays.origin + near[:, None] * rays.directions[row]).T) < 0.0
        if below.any():
            rays.first[row] = near[np.argmax(below)]


def compared(surface: Surface, frame: Any, rays: Rays) -> Row:
    depth, evaluations = frame.array("depth"), frame.array("evaluations")
    confirm(surface, depth, rays)
    wanted = rays.picture(rays.first, np.inf)
    found, true = np.isfinite(depth) & (depth > 0.0), np.isfinite(wanted)
    both = found & true
    off = np.abs(depth[both] - wanted[both]) / (rays.pixel * wanted[both])
    inside = rays.inside.reshape(found.shape)
    p50, p99 = np.quantile(off, [0.5, 0.99]) if both.any() else (np.nan, np.nan)
    return Row(
        int(true.sum()),
        int((true & ~found).sum()),
        int((found & ~true).sum()),
        float(p50),
        float(p99),
        float(evaluations[inside].mean()),
        int(evaluations.max()),
    )
