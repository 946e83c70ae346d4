"""Lights. A light casts a shadow only if it says so."""

from __future__ import annotations

from typing import Any

import numpy as np

from raymarch.errors import Location, SceneError, user_location
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import normalize
from raymarch.scene.parameter import as_number, as_vec3


class Light:
    """What all lights share: linear RGB colour >= 0, intensity >= 0, shadow on or off."""

    __slots__ = ("color", "intensity", "shadow", "where")

    def __init__(self, color: Any, intensity: Any, shadow: bool) -> None:
        name = type(self).__name__
        self.color = as_vec3(f"{name}: color", color, low=0.0)
        self.intensity = as_number(f"{name}: intensity", intensity, low=0.0)
        if not isinstance(shadow, bool):
            raise SceneError(f"{name}: shadow = {shadow!r}", legal="True or False")
        self.shadow = shadow
        self.where: Location | None = user_location()

    @property
    def radiance(self) -> Expr:
        """Colour times intensity, a vec3."""
        return self.color * self.intensity

    @property
    def expressions(self) -> list[Expr]:
        """All that may depend on parameters or time."""
        return [self.color, self.intensity]


class Sun(Light):
    """Light from infinitely far away.

    Parameters
    ----------
    direction : towards the sun, any length but 0.
    color : linear RGB, each >= 0. intensity : factor >= 0.
    shadow : whether it casts one; False costs nothing.
    """

    __slots__ = ("direction",)

    def __init__(
        self, direction: Any = (0.5, 1.0, 0.7), color: Any = (1.0, 1.0, 1.0), intensity: Any = 1.0, shadow: bool = False
    ) -> None:
        super().__init__(color, intensity, shadow)
        given = as_vec3("Sun: direction", direction)
        if given.is_constant and not np.any(given.data):
            raise SceneError(f"Sun: direction = {direction!r}", legal="3 numbers, not all zero")
        self.direction = normalize(given)

    @property
    def expressions(self) -> list[Expr]:
        return [*super().expressions, self.direction]


class PointLight(Light):
    """Light from one point; it falls off with the inverse square of the distance.

    Parameters
    ----------
    position : vec3.
    color : linear RGB, each >= 0. intensity : factor >= 0, the brightness at distance 1.
    shadow : whether it casts one; False costs nothing.
    """

    __slots__ = ("position",)

    def __init__(self, position: Any, color: Any = (1.0, 1.0, 1.0), intensity: Any = 1.0, shadow: bool = False) -> None:
        super().__init__(color, intensity, shadow)
        self.position = as_vec3("PointLight: position", position)

    @property
    def expressions(self) -> list[Expr]:
        return [*super().expressions, self.position]
