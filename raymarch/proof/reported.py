"""The hits that a picture reports: its rays, how far they reach, and the tolerance of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from raymarch.proof.parts import Operands
from raymarch.proof.rays import Rays, Whole
from raymarch.proof.rounding import Array
from raymarch.proof.search import OPEN, Given, Verdict, judge
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.sdf.node import Node

SHORTEST = 2.0**-16
"""Length of a stretch that is not halved, in tolerances."""

TILE = 1 << 14
"""Rays that are judged together."""


class Solid:
    """A solid as camera rays see it, for those that start outside and for those that start inside, which seek the
    exit."""

    def __init__(self, node: Node, values: Values) -> None:
        self._node, self._values = node, values
        self.outside = Operands(node, values, "camera", whole=False)

    @cached_property
    def inside(self) -> Operands:
        return Operands(self._node, self._values, "camera", whole=True)


@dataclass(frozen=True, slots=True, eq=False)
class Reported:
    """Hits of N rays of a picture, (N,) each.

    start, end : of each ray. hit : distance of the reported hit, inf for none. within : the tolerance, a length.
    """

    rays: Rays
    start: Array
    end: Array
    hit: Array
    within: Array

    @classmethod
    def of(
        cls,
        scene: Scene,
        values: Values,
        pose: Pose,
        size: tuple[int, int],
        hit: Array,
        tolerance: tuple[float | None, float] = (0.05, 0.0),
        pixels: tuple[Whole, Whole] | None = None,
    ) -> Reported:
        """The rays through the centres of pixels.

        size : of the picture. hit : (N,), row by row. tolerance : a share of a pixel, or None and a length.
        pixels : the columns and rows that are asked for, (N,) each; None is all.
        """
        width, height = size
        columns, rows = pixels or (np.arange(width), np.arange(height)[:, None])
        rays = Rays(*(np.ascontiguousarray(v.reshape(-1, 3)) for v in pose.rays(columns, rows, size)))
        rate = rays.directions @ pose.view
        start = pose.near / rate if pose.near > 0.0 else np.zeros(hit.shape)
        end = np.minimum(scene.far(pose, values), pose.far / rate)
        reach = np.where(np.isfinite(hit), hit, end) if not pose.orthographic else np.ones(hit.shape)
        share, length = tolerance
        within = np.full(hit.shape, length) if share is None else share * pose.pixel(height) * reach
        return cls(rays, start, end, hit, within)

    def __len__(self) -> int:
        return len(self.hit)

    def given(self, operands: Operands, rows: Whole) -> Given:
        """Some of the rays, to judge."""
        within = self.within[rows]
        own = (self.rays[rows], self.start[rows], self.end[rows], self.hit[rows])
        return Given(operands, *own, within, SHORTEST * within)

    def proved(
        self, solid: Solid, progress: Callable[[float], None] | None = None
    ) -> tuple[Verdict, dict[str, int], NDArray[np.bool_]]:
        """The verdicts, what kept rays open with their number, and which rays start inside of the solid."""
        inside = solid.outside.holds(self.rays, self.start)
        result, reasons, done = Verdict.unknown(self.start), Counter[str](), 0
        for held in (False, True):
            chosen = np.flatnonzero(inside == held)
            for first in range(0, len(chosen), TILE):
                rows = chosen[first : first + TILE]
                operands = solid.inside if held else solid.outside
                part = self.given(operands, rows)
                found = judge(part, None if progress is None else _after(progress, done, len(rows), len(self)))
                done += len(rows)
                reasons.update(operands.reasons(part.rays, found.left, found.state == OPEN))
                for name in ("state", "grazing", "low", "high", "evaluations"):
                    getattr(result, name)[rows] = getattr(found, name)
                if progress is not None:
                    progress(done / len(self))
        return result, dict(reasons.most_common()), inside


def _after(progress: Callable[[float], None], done: int, count: int, whole: int) -> Callable[[float], None]:
    """The progress of `count` rays after others."""
    return lambda share: progress((done + share * count) / whole)
