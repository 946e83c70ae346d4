"""A frame held against the float64 truth: every pixel must be explained by what a hit promises.

A hit lies where the true field is within a contact (and rounding); nothing is in front of it, unless the ray only
dips into that, by less than an epsilon: from there on the last steps follow the slope, and prove nothing. A ray that
ran out of steps may be a pixel's width off. What rounding adds is derived for the field at that point.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values
from raymarch.scene.quality import CONTACT, LAST_STEP
from raymarch.truth import silhouettes
from raymarch.truth.rays import camera_rays
from tests.hard.rounding import rounding_of
from tests.hard.world import EPSILON, ULP
from tests.support.analytic import around

PLACE = 4.0
"""Ulp of the largest coordinate that a point on a ray may be off: the direction's rotation and length, and t times it,
are ten roundings of half an ulp, of which the largest component has its share; two more put the point on the ray."""


@dataclass
class Referee:
    """The truth of a scene, and what a frame of it may differ by."""

    scene: rm.Scene
    size: tuple[int, int]

    @cached_property
    def known(self) -> Any:
        """The truth; costly where the field is an estimate, of which nothing needs it."""
        return rm.truth(self.scene, self.size, outputs=("depth", "normal"))

    @cached_property
    def pose(self) -> Pose:
        return self.scene.pose(Values({}), self.size[0] / self.size[1])

    @cached_property
    def direction(self) -> NDArray[np.float64]:
        """Unit rays, (H, W, 3)."""
        return camera_rays(self.pose, *self.size).directions.reshape(*self.size[::-1], 3)

    def at(self, depth: NDArray[Any]) -> NDArray[np.float64]:
        """Points at some depths, (H, W, 3); where a depth is infinite, the camera."""
        shift: NDArray[np.float64] = np.where(np.isfinite(depth), depth, 0.0)[..., None] * self.direction
        return self.pose.position + shift

    @cached_property
    def pixel(self) -> float:
        return self.pose.pixel(self.size[1])

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
        at = self.at(depth)
        above, allowed = np.zeros(depth.shape), np.zeros(depth.shape)
        above[hit] = np.abs(self.scene.node.distance(at[hit]))
        contact = self.contact(depth[hit], None if iterations is None else iterations[hit])
        last = LAST_STEP * EPSILON * self.pixel * depth[hit]
        allowed[hit] = (contact + last if certified else 8 * self.pixel * depth[hit]) + self._rounding(
            at[hit], depth[hit]
        )
        air = hit & (above > allowed)
        if air.sum() > (0 if certified else 0.02 * air.size):
            found.append(f"{air.sum()} hits in the air, {np.max(above[air] / allowed[air]):.3g} times what is allowed")
        if certified:
            found += self._missed(depth)
        return found

    def contact(self, t: NDArray[Any], iterations: NDArray[Any] | None = None) -> NDArray[Any]:
        """The size of the field that a hit may have; a pixel where a ray ran out of steps."""
        pixels = np.full(t.shape, CONTACT * EPSILON)
        if iterations is not None:
            pixels = np.where(iterations >= self.scene.quality.max_steps, 1.0, pixels)
        return np.asarray(pixels * self.pixel * t)

    def _rounding(self, at: NDArray[Any], t: NDArray[Any]) -> NDArray[Any]:
        """What float32 may make of the field at points at the distances t, (N, 3) and (N,)."""
        largest = np.maximum(np.abs(at).max(axis=-1), np.maximum(t, np.abs(self.pose.position).max()))
        return rounding_of(self.scene.node, at, PLACE * ULP * largest)

    def _missed(self, depth: NDArray[Any]) -> list[str]:
        through = self.through(depth, deeper=EPSILON)
        return [f"{through.sum()} rays go through a surface"] if through.any() else []

    def through(
        self, depth: NDArray[Any], known: NDArray[Any] | None = None, deeper: float = CONTACT * EPSILON
    ) -> NDArray[np.bool_]:
        """Rays that went through the first surface: those that are in it by more than a contact for a while.

        known : its depth in float64, inf where there is none; by default the truth's. deeper : in pixels.
        """
        known = self.known.depth if known is None else known
        first = np.where(np.isfinite(known), known, 0.0)
        found = np.isfinite(known) & ~(depth <= first * (1 + 1e-4) + 4 * self.pixel * first)
        if found.any():
            t = first[found]
            allowed = deeper * self.pixel * t + self._rounding(self.at(first)[found], t)
            found[found] = self.deepest(found, first, depth) > allowed
        return found

    def deepest(self, rows: NDArray[np.bool_], first: NDArray[Any], depth: NDArray[Any]) -> NDArray[np.float64]:
        """How far rays are in the solid between a first depth and the one drawn, at a sample a pixel for 64 pixels."""
        direction, t = self.direction[rows], first[rows]
        end = np.where(np.isfinite(depth[rows]), depth[rows], t + 64 * self.pixel * t)
        share = np.linspace(0, 1, 65)[1:]
        samples = t[:, None] + np.minimum(end - t, 64 * self.pixel * t)[:, None] * share
        at = self.pose.position + samples[..., None] * direction[:, None]
        values = self.scene.node.distance(at.reshape(-1, 3)).reshape(samples.shape)
        outside = float(self.scene.node.distance(self.pose.position[None])[0]) >= 0
        return np.asarray(np.max(-values if outside else values, axis=1))

    def _risen(self, rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Of some hits, those where the field has a slope at all, and so a normal. In a whole volume of zeros, as where
        a wave through the origin is elongated, it is 0 to the bit, and the truth's normal faces the eye."""
        return np.asarray(self.scene.node.gradient(self.at(self.known.depth)[rows]).any(axis=-1))

    def turned(self, frame: rm.Frame) -> list[str]:
        """Normals that point elsewhere, of hits away from edges."""
        if not np.all(np.isfinite(frame.normal)):
            return ["normals are not finite"]
        if self.scene.node.exactness == "estimate":
            return []
        both = self.calm & self.known.hit & np.isfinite(frame.depth)
        both &= np.abs(
            np.where(both, frame.depth, 0) - np.where(both, self.known.depth, 0)
        ) < 2 * self.pixel * self.known.depth.clip(0, 1e9)
        both[both] = self._risen(both)
        apart = np.linalg.norm(frame.normal[both] - self.known.normal[both], axis=-1)
        bad = int(np.sum(apart > 0.05))
        if bad <= max(3, 0.02 * apart.size):
            return []
        return [f"{bad} of {apart.size} normals are turned"]
