"""Ambient light that corners keep out."""

from __future__ import annotations

from typing import Any

from raymarch.expr.convert import integer
from raymarch.expr.node import Expr
from raymarch.scene.parameter import as_number
from raymarch.scene.value import Value, value


@value
class AmbientOcclusion(Value):
    """Ambient light is dimmed where the field rises more slowly along the normal than it would over a plane.

    Parameters
    ----------
    steps : samples along the normal, 1 to 32: evaluations a pixel.
    reach : distance of the last one, > 0.
    strength : factor of the dimming, >= 0.
    decay : weight of each sample over the one before, above 0 and up to 1. At 1 the light left is the mean of
        distance over length (as in "Signed Distance Field in Real-time Rendering"); at 0.5 near obstacles count most
        (Evans 2006).

    Ambient light is what a sky with `light` gives, and the `ambient` share of Phong's materials.
    """

    steps: int
    reach: Expr
    strength: Expr
    decay: Expr

    def __init__(self, steps: int = 5, reach: Any = 0.5, strength: Any = 1.0, decay: Any = 0.75) -> None:
        self._begin()
        self._set(
            steps=integer("AmbientOcclusion: steps", steps, 1, 32),
            reach=as_number("AmbientOcclusion: reach", reach, low=1e-6),
            strength=as_number("AmbientOcclusion: strength", strength, low=0.0),
            decay=as_number("AmbientOcclusion: decay", decay, 1e-3, 1.0),
        )

    @property
    def expressions(self) -> list[Expr]:
        return [self.reach, self.strength, self.decay]
