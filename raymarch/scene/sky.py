"""What is seen where nothing is hit, and what lies between the camera and the surface.

A sky is a function of the direction in which it is seen, written in the language of fields; the shader and the
truth read the same one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.convert import called, switch
from raymarch.expr.node import Expr, expr, var
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import max
from raymarch.expr.walk import free_variables
from raymarch.scene.parameter import Values, as_number, as_vec3
from raymarch.scene.value import Value, value
from raymarch.sdf.domain import as_operand

DIRECTION = var("direction", VEC3)
"""The unit vector along which a sky is seen."""


@value
class Sky(Value):
    """A sky.

    Parameters
    ----------
    color : linear RGB, each >= 0; or a function of the unit direction that gives such a colour.
    light : whether it lights surfaces: matte ones by its mean over their half of the sky (the first nine spherical
        harmonics, Ramamoorthi and Hanrahan 2001), mirrors by what they face, and all between by a mix. Nothing is in
        its way but `AmbientOcclusion`, if the scene has one. False costs nothing.
    """

    color: Expr
    light: bool

    def __init__(self, color: Any = (0.5, 0.65, 0.85), light: bool = False) -> None:
        self._begin()
        self._set(light=switch(f"{type(self).__name__}: light", light), color=_radiance(color))

    def _identity(self) -> tuple[Any, ...]:
        return self.color, self.light

    @property
    def constant(self) -> bool:
        """True if it is the same in all directions."""
        return DIRECTION not in free_variables([self.radiance])

    @property
    def radiance(self) -> Expr:
        """Its colour, a vec3; a function of DIRECTION unless it is constant."""
        return self.color

    @property
    def expressions(self) -> list[Expr]:
        """All that may depend on parameters or time."""
        return [self.radiance]

    def seen(self, directions: Any, values: Values) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Linear RGB along unit directions, (N, 3) -> (N, 3), float64."""
        with bound(values.params, values.time):
            color = evaluator([self.radiance], [DIRECTION])(np.asarray(directions, np.float64))[0]
        return np.array(np.broadcast_to(color, np.shape(directions)), np.float64)

    def harmonics(self, values: Values) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Nine colours, (9, 3): their sum weighted by `harmonics_at(normal)` is the mean light that a matte surface
        gets.

        For a constant sky that is the sky itself. Integrated over 4,096 even directions.
        """
        n = 4096
        k = np.arange(n) + 0.5
        y, turn = 1.0 - 2.0 * k / n, k * math.pi * (3.0 - math.sqrt(5.0))
        s = np.sqrt(1.0 - y * y)
        directions = np.stack([s * np.cos(turn), y, s * np.sin(turn)], axis=1)
        basis = harmonics_at(directions)
        result: np.ndarray[Any, np.dtype[np.float64]] = _BANDS[:, None] * (basis.T @ self.seen(directions, values) / n)
        return result


_BANDS = np.array([1.0] + [2.0 / 3.0] * 3 + [0.25] * 5)
"""The cosine lobe over pi in each band of the harmonics, which are normalised to a mean square of 1."""


def harmonics_at(n: Any) -> Any:
    """The first nine real spherical harmonics of unit vectors (N, 3), with a mean square of 1 each; (N, 9)."""
    x, y, z = n[:, 0], n[:, 1], n[:, 2]
    a, b = math.sqrt(3.0), math.sqrt(15.0)
    one = np.ones_like(x)
    second = [b * x * y, b * y * z, b * z * x, math.sqrt(5.0) / 2 * (3 * y * y - 1), b / 2 * (x * x - z * z)]
    return np.stack([one, a * x, a * y, a * z, *second], axis=1)


@value
class Fog(Value):
    """Fog that lets exp(-density * distance) of the light through. It covers surfaces, not the sky.

    color : linear RGB, each >= 0. density : per unit of length, >= 0.
    """

    color: Expr
    density: Expr

    def __init__(self, color: Any = (0.5, 0.65, 0.85), density: Any = 0.05) -> None:
        self._begin()
        self._set(color=as_vec3("Fog: color", color, low=0.0), density=as_number("Fog: density", density, low=0.0))

    @property
    def expressions(self) -> list[Expr]:
        return [self.color, self.density]


def _radiance(color: Any) -> Expr:
    """A colour, or a function of the direction, as an expression of DIRECTION."""
    legal = "linear RGB >= 0, or a function of a direction that gives such"
    if isinstance(color, Expr) and DIRECTION in free_variables([color]):
        made = color  # of another sky
    elif not callable(color) or isinstance(color, Expr):
        return as_vec3("Sky: color", color, low=0.0)
    else:
        made = as_operand("Sky: the function gives", called("Sky", color, DIRECTION, legal=legal), legal)
    if made.type is not VEC3:
        raise SceneError(f"Sky: the function gives a {made.type}", legal=legal)
    return made if made.op == "max" and made.args[1] is ZERO else max(made, 0.0)


ZERO = expr(0.0)
