"""A frame held against the float64 truth: every pixel must be explained by what a hit promises.

A hit lies where the true field is within a contact (and rounding); nothing is in front of it, unless the ray only
touches that, by less than a contact. A ray that ran out of steps may be a pixel's width off.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from analytic import around
from numpy.typing import NDArray

import raymarch as rm
from raymarch.scene.parameter import Values
from raymarch.scene.quality import CONTACT
from raymarch.truth import silhouettes
from tests.hard.world import EPSILON, ULP

ROUNDING = 64.0
"""Units in the last place that a deep tree may lose in its field: chosen, not derived."""


@dataclass
class Referee:
    """The truth of a scene, and what a frame of it may differ by."""

    scene: rm.Scene
    size: tuple[int, int]

    @cached_property
    def known(self) -> Any:
        return rm.truth(self.scene, self.size, outputs=("depth", "normal"))

    @cached_property
    def pixel(self) -> float:
        return self.scene.pose(Values({}), self.size[0] / self.size[1]).pixel(self.size[1])

    @cached_property
    def calm(self) -> NDArray[np.bool_]:
        """Pixels without an edge in them or beside them."""
        return ~around(silhouettes(self.known))

    def unexplained(self, depth: NDArray[Any], iterations: NDArray[Any] | None = None) -> list[str]:
        """What is wrong with a picture of depths, in words; nothing if all is as promised."""
        certified = self.scene.node.exactness != "estimate"
        depth = depth.astype(np.float64)
        hit = np.isfinite(depth)
        found = []
        if np.isnan(depth).any():
            found.append(f"{np.isnan(depth).sum()} depths are NaN")
        at = self.known.position + np.where(hit, depth, 0)[..., None] * self.known.direction
        allowed = self._allowed(np.where(hit, depth, 0), at, iterations)
        above = np.zeros(depth.shape)
        above[hit] = np.abs(self.scene.node.distance(at[hit]))
        air = hit & (above > (allowed if certified else 8 * allowed / (CONTACT * EPSILON)))
        if air.sum() > (0 if certified else 0.02 * air.size):
            found.append(f"{air.sum()} hits in the air, {np.max(above[air] / allowed[air]):.3g} times what is allowed")
        if certified:
            found += self._missed(depth)
        return found

    def _allowed(self, t: NDArray[Any], at: NDArray[Any], iterations: NDArray[Any] | None) -> NDArray[Any]:
        """The size of the field that a hit may have."""
        largest = np.maximum(np.abs(at).max(axis=-1), np.maximum(t, np.abs(self.known.position).max()))
        pixels = np.full(t.shape, CONTACT * EPSILON)
        if iterations is not None:
            pixels = np.where(iterations >= self.scene.quality.max_steps, 1.0, pixels)
        return pixels * self.pixel * t + ROUNDING * ULP * largest

    def _missed(self, depth: NDArray[Any]) -> list[str]:
        through = self.through(depth)
        return [f"{through.sum()} rays go through a surface"] if through.any() else []

    def through(self, depth: NDArray[Any]) -> NDArray[np.bool_]:
        """Rays that went through the first surface: those that are in it by more than a contact for a while."""
        known = self.known
        first = np.where(known.hit, known.depth, 0.0)
        found = known.hit & ~(depth <= first * (1 + 1e-4) + 4 * self.pixel * first)
        if not found.any():
            return found
        origin, direction, t = known.position, known.direction[found], first[found]
        end = np.where(np.isfinite(depth[found]), depth[found], t + 64 * self.pixel * t)
        share = np.linspace(0, 1, 65)[1:]
        samples = t[:, None] + np.minimum(end - t, 64 * self.pixel * t)[:, None] * share
        at = origin + samples[..., None] * direction[:, None]
        values = self.scene.node.distance(at.reshape(-1, 3)).reshape(samples.shape)
        outside = float(self.scene.node.distance(np.asarray(origin)[None])[0]) >= 0
        deepest = np.max(-values if outside else values, axis=1)
        found[found] = deepest > self._allowed(t, at[:, 0], None)
        return found

    def turned(self, frame: rm.Frame) -> list[str]:
        """Normals that point elsewhere, of hits away from edges."""
        both = self.calm & self.known.hit & np.isfinite(frame.depth)
        both &= np.abs(
            np.where(both, frame.depth, 0) - np.where(both, self.known.depth, 0)
        ) < 2 * self.pixel * self.known.depth.clip(0, 1e9)
        apart = np.linalg.norm(frame.normal[both] - self.known.normal[both], axis=-1)
        if not np.all(np.isfinite(frame.normal)):
            return ["normals are not finite"]
        bad = int(np.sum(apart > 0.05))
        if self.scene.node.exactness == "estimate" or bad <= max(3, 0.02 * apart.size):
            return []
        return [f"{bad} of {apart.size} normals are turned"]
