"""Where rays meet solids, in closed form with NumPy in extended precision."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import raymarch as rm
from tests.lab.trials.row import WHITE, Array, drawn

Solid = Callable[[Array, Array], tuple[Array, Array]]
"""Origins (N, 3) and directions (N, 3) to where each line enters and leaves; infinity and minus infinity if never."""


def box(size: tuple[float, float, float], at: Array | tuple[float, float, float] = (0, 0, 0)) -> Solid:
    half, centre = 0.5 * np.asarray(size, np.longdouble), np.asarray(at, np.longdouble)

    def met(o: Array, d: Array) -> tuple[Array, Array]:
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (centre - half - o) / d, (centre + half - o) / d
        enter, leave = np.fmin(a, b).max(axis=1), np.fmax(a, b).min(axis=1)
        return np.where(enter <= leave, enter, np.inf), np.where(enter <= leave, leave, -np.inf)

    return met


def ellipsoid(size: tuple[float, float, float], at: tuple[float, float, float] = (0, 0, 0)) -> Solid:
    half, centre = 0.5 * np.asarray(size, np.longdouble), np.asarray(at, np.longdouble)

    def met(o: Array, d: Array) -> tuple[Array, Array]:
        p, w = (o - centre) / half, d / half
        a, b = (w * w).sum(axis=1), (p * w).sum(axis=1)
        nearest = p - (b / a)[:, None] * w
        square = 1 - (nearest * nearest).sum(axis=1)
        root = np.sqrt(np.maximum(square, 0) / a)
        return np.where(square >= 0, -b / a - root, np.inf), np.where(square >= 0, -b / a + root, -np.inf)

    return met


def frustum(low: float, height: float, high: float) -> Solid:
    """About the y axis: radius `low` at -height / 2, `high` at height / 2; a cone, a frustum or a cylinder."""
    slope, middle = np.longdouble(high - low) / height, np.longdouble(low + high) / 2

    def met(o: Array, d: Array) -> tuple[Array, Array]:
        slab = box((np.inf, height, np.inf))
        with np.errstate(invalid="ignore"):
            first, last = slab(np.where([True, False, True], 0, o), np.where([True, False, True], 1, d))
        first, last = np.maximum(first, -1e30), np.minimum(last, 1e30)
        r, w = middle + slope * o[:, 1], slope * d[:, 1]
        a = d[:, 0] ** 2 + d[:, 2] ** 2 - w * w
        b = o[:, 0] * d[:, 0] + o[:, 2] * d[:, 2] - r * w
        c = o[:, 0] ** 2 + o[:, 2] ** 2 - r * r
        square = b * b - a * c
        root = np.sqrt(np.maximum(square, 0))
        q = -(b + np.where(b >= 0, root, -root))
        with np.errstate(divide="ignore", invalid="ignore"):
            one, two = q / a, c / q
        near, far = np.fmin(one, two), np.fmax(one, two)
        between = (a > 0) & (square >= 0)
        enter = np.where(between, np.maximum(first, near), np.inf)
        leave = np.where(between, np.minimum(last, far), -np.inf)
        opened = a < 0  # the line is steeper than the side: it is inside before the first root or after the second
        inside = square < 0
        up = np.where(inside, first, np.maximum(first, far)), last
        down = first, np.where(inside, last, np.minimum(last, near))
        whole = np.where(down[0] <= down[1], down[0], up[0]), np.where(down[0] <= down[1], down[1], up[1])
        enter, leave = np.where(opened, whole[0], enter), np.where(opened, whole[1], leave)
        return np.where(enter <= leave, enter, np.inf), np.where(enter <= leave, leave, -np.inf)

    return met


@dataclass(frozen=True)
class View:
    """A camera with perspective; its rays are made here anew."""

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float = 45.0
    up: tuple[float, float, float] = (0, 1, 0)

    @property
    def camera(self) -> rm.Camera:
        return rm.Camera(self.position, self.target, up=self.up, fov=self.fov)

    def rays(self, size: tuple[int, int]) -> tuple[Array, Array]:
        """Origins and unit directions of all pixels, (H W, 3)."""
        o = np.asarray(self.position, np.longdouble)
        z = np.asarray(self.target, np.longdouble) - o
        z /= np.sqrt(z @ z)
        x = np.cross(z, np.asarray(self.up, np.longdouble))
        x /= np.sqrt(x @ x)
        y, tan = np.cross(x, z), np.tan(np.radians(np.longdouble(self.fov)) / 2)
        width, height = size
        i, j = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        u, v = (2 * i - width) / height * tan, (height - 2 * j) / height * tan
        d = z + u[..., None] * x + v[..., None] * y
        d = (d / np.sqrt((d * d).sum(axis=-1))[..., None]).reshape(-1, 3)
        return np.broadcast_to(o, d.shape), d


def first_hit(solids: list[Solid], o: Array, d: Array, floor: float | None = None) -> Array:
    """The depth at which rays from outside meet the first solid, or the half-space below a height; else infinity."""
    found = np.full(len(o), np.inf, np.longdouble)
    for solid in solids:
        enter, leave = solid(o, d)
        found = np.where((leave >= 0) & (enter < found), np.maximum(enter, 0), found)
    if floor is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (floor - o[:, 1]) / d[:, 1]
        found = np.where((t > 0) & (t < found), t, found)
    return found


def grown(mask: Array) -> Array:
    """A mask (H, W) with the pixels beside it."""
    wide = np.pad(mask, 1, mode="edge")
    return np.any([wide[i : i + mask.shape[0], j : j + mask.shape[1]] for i in range(3) for j in range(3)], axis=0)


def borders(depth: Array, step: float = 0.05) -> Array:
    """Where the depths (H, W) of pixels beside each other jump, and the pixels beside them."""
    value = np.where(np.isfinite(depth), depth, 1e9).astype(float)
    jump = np.zeros(value.shape, bool)
    for axis in (0, 1):
        apart = np.abs(np.diff(value, axis=axis)) > step * np.minimum(*_pairs(value, axis))
        pad = [(0, 0), (0, 0)]
        for side in ((1, 0), (0, 1)):
            pad[axis] = side
            jump |= np.pad(apart, pad)
    return grown(jump)


def _pairs(value: Array, axis: int) -> tuple[Array, Array]:
    first, last = [slice(None)] * 2, [slice(None)] * 2
    first[axis], last[axis] = slice(None, -1), slice(1, None)
    return value[tuple(first)], value[tuple(last)]


SUN = np.array((0.4, 1.0, 0.5)) / np.linalg.norm((0.4, 1.0, 0.5))


def wrong_pixels(
    node: rm.Node, solids: list[Solid], view: View, floor: float, size: tuple[int, int], **how: Any
) -> int:
    """Pixels off silhouettes and borders of shadows with a wrong depth, or with a floor that is wrongly lit or dark."""
    scene = rm.Scene(
        (node | rm.plane(offset=floor)).material(WHITE),
        view.camera,
        lights=[rm.Sun(tuple(SUN), shadow=True)],
        sky=(0, 0, 0),
        quality=rm.Quality(**how),
    )
    frame = drawn(scene, size)
    o, d = view.rays(size)
    right = first_hit(solids, o, d, floor)
    shape = size[::-1]
    edge = borders(right.reshape(shape))
    with np.errstate(invalid="ignore"):
        points = o + right[:, None] * d
        off = np.abs(frame.depth.reshape(-1) - right) > 1e-3 * right
    off |= np.isfinite(frame.depth.reshape(-1)) != np.isfinite(right)
    ground = np.isfinite(right) & (np.abs(points[:, 1] - floor) < 1e-9)
    start = np.where(ground[:, None], points, 0).astype(np.longdouble)
    dark = np.isfinite(first_hit(solids, start, np.broadcast_to(SUN, d.shape).astype(np.longdouble))).reshape(shape)
    blurred = grown(grown(dark) & grown(~dark)) | ~ground.reshape(shape)
    lit = frame.color[..., 0] > 0.5 * SUN[1]
    return int((off.reshape(shape) & ~edge).sum() + ((lit == dark) & ~blurred & ~edge).sum())
