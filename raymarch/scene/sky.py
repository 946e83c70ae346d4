"""The sky, which rays that hit nothing see, and fog between the camera and the surface.

A sky is a function of the ray direction in the expression language. The shader and the reference use the same function.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.convert import called, switch
from raymarch.expr.node import Expr, Operand, expr, var
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import max
from raymarch.expr.walk import free_variables
from raymarch.scene.color import as_color
from raymarch.scene.parameter import Values, as_number
from raymarch.scene.value import Value, value
from raymarch.sdf.domain import ColorLike, Scalar, as_operand

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

    def harmonics(self, values: Values) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Nine colours, (9, 3). Their sum weighted by `harmonics_at(normal)` is the mean light on a diffuse surface.

        For a constant sky the sum is the colour of the sky. Integrated over 4,096 evenly distributed directions.
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


def harmonics_at(n: Any) -> Any:
    """The first nine real spherical harmonics of unit vectors (N, 3), with a mean square of 1 each; (N, 9)."""
    x, y, z = n[:, 0], n[:, 1], n[:, 2]
    a, b = math.sqrt(3.0), math.sqrt(15.0)
    one = np.ones_like(x)
    second = [b * x * y, b * y * z, b * z * x, math.sqrt(5.0) / 2 * (3 * y * y - 1), b / 2 * (x * x - z * z)]
    return np.stack([one, a * x, a * y, a * z, *second], axis=1)


@value
class Fog(Value):
    """Homogeneous fog with transmittance exp(-density * distance). It covers surfaces, not the sky.

    Parameters
    ----------
    color : colour of the fog, linear RGB, each >= 0. None is the sky's radiance in the direction of the ray: far
        surfaces fade into the sky, without a seam at the horizon.
    density : extinction per unit of length, >= 0.

    Notes
    -----
    Raises SceneError for a negative value.
    """

    color: Expr | None
    density: Expr

    def __init__(self, color: ColorLike | None = (0.5, 0.65, 0.85), density: Scalar = 0.05) -> None:
        self._begin()
        self._set(
            color=None if color is None else as_color("Fog: color", color),
            density=as_number("Fog: density", density, low=0.0),
        )

    @property
    def expressions(self) -> list[Expr]:
        return [self.density] if self.color is None else [self.color, self.density]


def _radiance(color: Any) -> Expr:
    """A colour, or a function of the direction, as an expression of DIRECTION."""
    legal = "linear RGB >= 0, or a function of a direction that gives such"
    if isinstance(color, Expr) and DIRECTION in free_variables([color]):
        made = color  # `replace` passes the expression of the sky
    elif not callable(color) or isinstance(color, Expr):
        return as_color("Sky: color", color)
    else:
        made = as_operand("Sky: the function gives", called("Sky", color, DIRECTION, legal=legal), legal)
    if made.type is not VEC3:
        raise SceneError(f"Sky: the function gives a {made.type}", legal=legal)
    return made if made.op == "max" and made.args[1] is ZERO else max(made, 0.0)


ZERO = expr(0.0)
