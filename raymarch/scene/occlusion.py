"""Ambient light that corners keep out."""

from __future__ import annotations

from typing import Any

from raymarch.errors import SceneError
from raymarch.expr.node import Expr
from raymarch.scene.parameter import as_number


class Occlusion:
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

    __slots__ = ("decay", "reach", "steps", "strength")

    def __init__(self, steps: int = 5, reach: Any = 0.5, strength: Any = 1.0, decay: Any = 0.75) -> None:
        if isinstance(steps, bool) or not isinstance(steps, int) or not 1 <= steps <= 32:
            raise SceneError(f"Occlusion: steps = {steps!r}", legal="an integer from 1 to 32")
        self.steps = steps
        self.reach = as_number("Occlusion: reach", reach, low=1e-6)
        self.strength = as_number("Occlusion: strength", strength, low=0.0)
        self.decay = as_number("Occlusion: decay", decay, 1e-3, 1.0)

    @property
    def expressions(self) -> list[Expr]:
        return [self.reach, self.strength, self.decay]
