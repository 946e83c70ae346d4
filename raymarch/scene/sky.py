"""The sky, which rays that hit nothing see.

A sky is a function of the ray direction in the expression language. The shader and the reference use the same function.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location, SceneError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.colors import linear_color
from raymarch.expr.convert import called, switch
from raymarch.expr.function import Function, sum_of, unique_function
from raymarch.expr.node import Expr, Operand, expr, var
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import max
from raymarch.expr.walk import free_variables
from raymarch.scene.parameter import Values, as_color
from raymarch.scene.value import Value, value
from raymarch.sdf.domain import ColorLike, as_operand

DIRECTION = var("direction", VEC3)
"""The unit direction of a ray that reaches the sky."""


@value
class Sky(Value):
    """The background of a scene, which may also light it.

    Parameters
    ----------
    color : linear RGB, each >= 0; or a function of the unit direction that gives such a colour.
    light : whether the sky lights surfaces. Diffuse surfaces receive its cosine-weighted mean over their hemisphere
        (the first nine spherical harmonics, Ramamoorthi and Hanrahan 2001). Mirrors receive its colour in the direction
        of reflection, and rough surfaces a mix of both. Only `AmbientOcclusion` dims this light. False costs nothing.

    Notes
    -----
    Raises SceneError for a negative colour, or a function that does not give three numbers.
    """

    BELONGS: ClassVar[str] = "Scene(sky=...)"
    color: Expr
    light: bool

    def __init__(self, color: ColorLike | Callable[[Expr], Operand] = (0.5, 0.65, 0.85), light: bool = False) -> None:
        self._begin()
        self._set(light=switch(f"{type(self).__name__}: light", light), color=_radiance(color))

    def _identity(self) -> tuple[Any, ...]:
        return self.color, self.light

    @property
    def constant(self) -> bool:
        """True if the colour is the same in all directions."""
        return DIRECTION not in free_variables([self.radiance])

    @property
    def radiance(self) -> Expr:
        """Radiance, a vec3; an expression of DIRECTION unless `constant`."""
        return self.color

    @property
    def expressions(self) -> list[Expr]:
        """All values that may depend on parameters or time."""
        return [self.radiance]

    def radiance_along(self, directions: NDArray[Any], values: Values) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Radiance along unit directions, linear RGB, (N, 3) -> (N, 3), float64."""
        with bound(values.params, values.time):
            color = evaluator([self.radiance], [DIRECTION])(np.asarray(directions, np.float64))[0]
        return np.array(np.broadcast_to(color, np.shape(directions)), np.float64)

    def function(self, where: Location | None) -> Function:
        """The radiance as a function of the direction: `sky`. where : the user's line."""
        return unique_function("sky", (DIRECTION,), self.radiance, {}, where)

    def harmonics(self, values: Values) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The values of `HARMONICS`, (9, 3): coefficients of the mean light on a diffuse surface.

        They include the cosine lobe. Integrated over 4,096 evenly distributed directions.
        """
        n = 4096
        k = np.arange(n) + 0.5
        y, turn = 1.0 - 2.0 * k / n, k * math.pi * (3.0 - math.sqrt(5.0))
        s = np.sqrt(1.0 - y * y)
        directions = np.stack([s * np.cos(turn), y, s * np.sin(turn)], axis=1)
        basis = harmonics_at(directions)
        result: np.ndarray[Any, np.dtype[np.float64]] = _BANDS[:, None] * (
            basis.T @ self.radiance_along(directions, values) / n
        )
        return result


_BANDS = np.array([1.0] + [2.0 / 3.0] * 3 + [0.25] * 5)
"""The cosine lobe divided by pi, in each band of the harmonics. The harmonics have a mean square of 1."""


HARMONICS = tuple(var(f"u_sky_light[{k}]", VEC3) for k in range(9))
"""Coefficients of the sky's mean; an array of the shader, by the name that it has there."""


NORMAL = var("n", VEC3)


def _basis(x: Expr, y: Expr, z: Expr) -> list[Expr]:
    """The first nine real spherical harmonics of a unit vector, with a mean square of 1 each."""
    a, b, c = math.sqrt(3.0), math.sqrt(15.0), 0.5 * math.sqrt(5.0)
    second = [b * x * y, b * y * z, b * z * x, c * (3.0 * y * y - 1.0), 0.5 * b * (x * x - z * z)]
    return [expr(1.0), a * x, a * y, a * z, *second]


_BASIS = _basis(NORMAL.x, NORMAL.y, NORMAL.z)
MEAN = Function("sky_mean", (NORMAL,), max(sum_of([c * h for c, h in zip(HARMONICS, _BASIS, strict=True)]), 0.0))
"""The cosine-weighted mean of the sky over the hemisphere about a direction (Ramamoorthi and Hanrahan 2001)."""


def harmonics_at(n: NDArray[Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The basis at unit vectors, (N, 3) -> (N, 9)."""
    return np.stack(np.broadcast_arrays(*evaluator(_BASIS, [NORMAL])(n)), axis=1)


def _radiance(color: Any) -> Expr:
    """A colour, or a function of the direction, as an expression of DIRECTION."""
    legal = "linear RGB >= 0, or a function of a direction that gives such"
    if isinstance(color, Expr) and DIRECTION in free_variables([color]):
        made = color  # `replace` passes the expression of the sky
    elif not callable(color) or isinstance(color, Expr):
        return as_color("Sky: color", color)
    else:
        given = linear_color("Sky: color", called("Sky", color, DIRECTION, legal=legal))
        made = as_operand("Sky: the function gives", given, legal)
    if made.type is not VEC3:
        raise SceneError(f"Sky: the function gives a {made.type}", legal=legal)
    return made if made.op == "max" and made.args[1] is ZERO else max(made, 0.0)


ZERO = expr(0.0)
