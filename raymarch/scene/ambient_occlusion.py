"""Ambient occlusion: less ambient light in corners and creases."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar

from raymarch.expr.convert import integer, optional
from raymarch.expr.function import loop, sum_of
from raymarch.expr.node import Expr, var
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import clamp
from raymarch.scene.parameter import LEAST_LENGTH, as_number
from raymarch.scene.value import Part, value
from raymarch.sdf.domain import Scalar

POINT, NORMAL = var("p", VEC3), var("normal", VEC3)
"""A point of a surface, and the normal there."""


@value
class AmbientOcclusion(Part):
    """Ambient occlusion from samples of the field along the normal.

    Ambient light is dimmed where the field rises more slowly along the normal than it would above a plane.

    Parameters
    ----------
    steps : number of samples along the normal, 1 to 32. Each is one evaluation of the field per pixel.
    reach : distance of the last sample from the surface, in scene units, > 0. None follows the size of the scene: it is
        a quarter of the edge of a cube that has the diagonal of the box around all bounded solids, 0.5 for a ball of
        radius 1. Among many small solids, a reach as large as one of them shows more.
    strength : factor of the dimming, >= 0.
    decay : ratio of the weights of successive samples, above 0 and up to 1. At 1 the remaining light is the mean of
        field value over sample distance ("Signed Distance Field in Real-time Rendering"). At 0.5 near obstacles count
        most (Evans 2006).

    Raises
    ------
    SceneError : a value outside its range.

    Notes
    -----
    Ambient light is the light of a sky with `light=True` and the `ambient` term of Phong materials.
    """

    BELONGS: ClassVar[str] = "Scene(occlusion=...)"
    steps: int
    reach: Expr | None
    strength: Expr
    decay: Expr

    def __init__(
        self, steps: int = 5, reach: Scalar | None = None, strength: Scalar = 1.0, decay: Scalar = 0.75
    ) -> None:
        self._set(
            steps=integer("AmbientOcclusion: steps", steps, 1, 32),
            reach=optional(as_number, "AmbientOcclusion: reach", reach, LEAST_LENGTH),
            strength=as_number("AmbientOcclusion: strength", strength, low=0.0),
            decay=as_number("AmbientOcclusion: decay", decay, 1e-3, 1.0),
        )

    def within(self, diagonal: float) -> AmbientOcclusion:
        """The same with a reach, for a box around all bounded solids with a diagonal."""
        return self if self.reach is not None else self.replace(reach=max(diagonal / math.sqrt(48.0), LEAST_LENGTH))

    def visibility(self, field: Callable[[Expr], Expr], side: Expr) -> Expr:
        """Ambient visibility at POINT about NORMAL: 1 where the field rises as over a plane, less near other surfaces.

        field : signed distance at a point. side : -1 inside the solid, else 1.
        """

        def add(i: Expr, missing: Expr, weight: Expr) -> tuple[Expr, Expr]:
            return missing + weight * self.sample(field, side, i), weight * self.decay

        missing, _ = loop(self.steps, (0.0, 1.0), add)
        return self.remaining(missing)

    def sample(self, field: Callable[[Expr], Expr], side: Expr, i: Expr) -> Expr:
        """How much the field lacks at sample i from 0, 0 to 1. Parameters as of `visibility`."""
        assert self.reach is not None
        far = self.reach * ((i + 1.0) / float(self.steps))
        rise = side * field(POINT + far * NORMAL)
        return clamp(1.0 - rise / far, 0.0, 1.0)

    def remaining(self, missing: Expr) -> Expr:
        """Ambient visibility from the sum of all samples, of which sample i has the weight decay**i."""
        total = sum_of([self.decay**i for i in range(self.steps)])
        return clamp(1.0 - self.strength * missing / total, 0.0, 1.0)
