"""Gaps and rods narrower than the disc of a light, of whose penumbras `penumbra="two-sided"` knows too little.

Points of the surface are found by Newton's method. From each, rays go along the normal to what faces it, through the
solid, to the light and away from it to the surface that the shadow falls on. So the width of a gap, or of a rod, is
compared with the radius of the light's disc there. A solid is a rod too if lines to the light pass it on both sides of
such a point, close by.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Doubt, SceneError
from raymarch.expr.arrays import value_of
from raymarch.expr.function import Function
from raymarch.expr.node import expr
from raymarch.expr.operations import operations_of
from raymarch.prices import STANDARD
from raymarch.scene.light import Light
from raymarch.scene.scene import Scene
from raymarch.sdf.evaluation import evaluate_both, in_blocks
from raymarch.sdf.levels import to_surface
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node
from raymarch.sdf.same import remembered

Array = NDArray[np.float64]

POINTS = 4096
"""Number of points of a scene's box from which its surface is looked for."""

ENOUGH = 4
"""Number of such points from which on a penumbra is doubted."""

SHARE = 0.3
"""The part of the points at the border of a shadow from which on what they find is doubted."""

OUTER, INNER = 0.25, 1.0
"""Parts of the disc's radius. A point is near the border of a shadow, and its solid is a rod, where nothing is on the
lines to the light so far outside and inside of it."""

CURE = "penumbra='sampled'"


def narrow(scene: Scene) -> list[Doubt]:
    """Doubts about two-sided penumbras of gaps that are narrower than the light's disc and of rods that are thinner."""
    lights = [light for light in scene.lights if light.soft and light.penumbra == "two-sided"]
    box = scene.subject
    if not lights or box is None or not box.bounded or operations_of(_field(scene.node)) > STANDARD.doubted:
        return []
    try:
        points, normals = _surface(scene.node, tuple(box.lower), tuple(box.upper))
        width = _Widths(scene.node, points, normals, float(np.linalg.norm(box.size)))
    except SceneError:  # GLSL without a NumPy function
        return []
    found: list[Doubt] = []
    for light in lights:
        gaps, rods = width.beside_disc(light)
        for count, what, error in (
            (gaps, "gaps between solids that are", "up to 0.23, and more behind fine slats"),
            (rods, "rods and edges of plates that are", "up to 0.14"),
        ):
            if count >= ENOUGH:
                what = f"the two-sided penumbra of {what} narrower than the light's disc is off by {error}"
                found.append(Doubt("plan", what, CURE, where=light.where))
    return [each for i, each in enumerate(found) if str(each) not in map(str, found[:i])]


@remembered
def _field(node: Node) -> Function:
    return Lowering(rays="shadow").field(node)


def _surface(node: Node, lower: tuple[float, ...], upper: tuple[float, ...]) -> tuple[Array, Array]:
    """Points of the surface in a box, with their normals."""
    low, high = np.array(lower), np.array(upper)
    size = float(np.linalg.norm(high - low))
    points, _ = to_surface(_field(node), np.random.default_rng(0).uniform(low, high, (POINTS, 3)), 10)
    value, slope = evaluate_both(_field(node), points)
    steep = np.linalg.norm(slope, axis=1)
    kept = (np.abs(value) <= 1e-5 * size) & (steep > 1e-3) & np.isfinite(points).all(axis=1)
    kept &= ((points >= low - 1e-3 * size) & (points <= high + 1e-3 * size)).all(axis=1)
    return points[kept], (slope / np.maximum(steep, 1e-9)[:, None])[kept]


class _Widths:
    """Widths of the gap before each surface point and of the solid behind it, and the way to what is shaded there."""

    def __init__(self, node: Node, points: Array, normals: Array, size: float) -> None:
        self._field, self._size = _field(node), size
        self._points, self._normals = points, normals
        self.gap = self._free(points, normals, 1.0)
        self.thickness = self._free(points, -normals, -1.0)

    def _free(self, start: Array, way: Array, side: float, sizes: float = 2.0) -> Array:
        """How far rays from a surface go before they leave a side of it; infinite beyond so many sizes of it."""
        t = np.full(len(start), 1e-3 * self._size)
        first = side * in_blocks(self._field, start + t[:, None] * way, ())
        going = np.flatnonzero(first > 0.0)
        for _ in range(40):
            value = side * in_blocks(self._field, start[going] + t[going, None] * way[going], ())
            t[going] += np.maximum(value, 0.0)
            going = going[(value > 1e-4 * self._size) & (t[going] < sizes * self._size)]
            if not len(going):
                break
        return np.where(t >= sizes * self._size, np.inf, np.where(first > 0.0, t, 0.0))

    def beside_disc(self, light: Light) -> tuple[int, int]:
        """The number of points at a gap that is narrower than the disc, and of those at a rod or plate that is."""
        place = _now(light.position if light.has_position else light.sun_direction)  # type: ignore[attr-defined]
        wide = float(_now(light.softness))
        if not (np.isfinite(place).all() and np.isfinite(wide)):
            return 0, 0
        beside = self._points + 0.5 * np.where(np.isfinite(self.gap), self.gap, 0.0)[:, None] * self._normals
        to_light = place - beside if light.has_position else np.broadcast_to(place, beside.shape)
        far = np.linalg.norm(to_light, axis=1)
        to_light = to_light / np.maximum(far, 1e-12)[:, None]
        through = self._free(beside, -to_light, -1.0)  # the solid itself, where it is behind the point
        start = np.where(np.isfinite(through), through, 0.0) + 2e-3 * self._size
        behind = start + self._free(beside - start[:, None] * to_light, -to_light, 1.0, 1e4)
        shadowed = np.isfinite(behind)
        behind = np.where(shadowed, behind, 0.0)
        radius = wide * (behind / np.maximum(behind + far, 1e-12) if light.has_position else behind)
        cosine = (self._normals * to_light).sum(axis=1)
        seen = (np.abs(cosine) < 0.85) & shadowed & (self.thickness > 0.0)
        closed = self.gap < 2.5 * radius
        aside = self._normals - cosine[:, None] * to_light
        aside /= np.maximum(np.linalg.norm(aside, axis=1), 1e-9)[:, None]
        within = self._points + (self.gap + 0.2 * radius).clip(0, 1e9)[:, None] * self._normals
        wall = in_blocks(self._field, within, ()) < 0.0
        gaps = np.flatnonzero(seen & closed & wall & (self.thickness > 0.3 * radius))
        angle = wide / far if light.has_position else np.full(len(far), wide)
        gaps = gaps[self._passed(beside[gaps], to_light[gaps], aside[gaps], angle[gaps])]
        others = seen & ~closed
        sides = others & (np.abs(cosine) < 0.35)
        thin = sides & (self.thickness < 0.7 * radius)
        k = np.flatnonzero(others)
        outer, inner = (
            self._beside(self._points[k] + side * radius[k, None] * aside[k], to_light[k], 0.5 * behind[k])
            for side in (OUTER, -INNER)
        )
        counts = (int(thin.sum()), int(sides.sum())), (int((outer & inner).sum()), int(outer.sum()))
        return len(gaps), max(found if found > SHARE * of else 0 for found, of in counts)

    def _passed(self, start: Array, to_light: Array, aside: Array, angle: Array) -> NDArray[np.bool_]:
        """Whether a ray to the middle or the border of the disc leaves the scene; `aside` is across a gap."""
        ways = (to_light + side * angle[:, None] * aside for side in (0.0, 0.8, -0.8))
        return np.any([np.isinf(self._free(start, _unit(way), 1.0)) for way in ways], axis=0)

    def _beside(self, start: Array, to_light: Array, behind: Array) -> NDArray[np.bool_]:
        """Whether nothing is on a line: from points to the light, and so far behind them."""
        return np.isinf(self._free(start, to_light, 1.0)) & (self._free(start, -to_light, 1.0, 1e4) > behind)


def _unit(way: Array) -> Array:
    return np.asarray(way / np.linalg.norm(way, axis=1)[:, None])


def _now(value: Any) -> Array:
    """A value by the parameters and the time that are bound, or by their defaults."""
    return np.asarray(value_of(expr(value)), np.float64)
