"""What is seen where nothing is hit, and what lies between the camera and the surface."""

from __future__ import annotations

from typing import Any

from raymarch.expr.node import Expr
from raymarch.scene.parameter import as_number, as_vec3


class Sky:
    """A sky of one colour: linear RGB, each >= 0."""

    __slots__ = ("color",)

    def __init__(self, color: Any = (0.5, 0.65, 0.85)) -> None:
        self.color = as_vec3("Sky: color", color, low=0.0)

    @property
    def expressions(self) -> list[Expr]:
        return [self.color]


class Fog:
    """Fog that lets exp(-density * distance) of the light through. It covers surfaces, not the sky.

    color : linear RGB, each >= 0. density : per unit of length, >= 0.
    """

    __slots__ = ("color", "density")

    def __init__(self, color: Any = (0.5, 0.65, 0.85), density: Any = 0.05) -> None:
        self.color = as_vec3("Fog: color", color, low=0.0)
        self.density = as_number("Fog: density", density, low=0.0)

    @property
    def expressions(self) -> list[Expr]:
        return [self.color, self.density]
