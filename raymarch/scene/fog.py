"""What lies between the camera and the surfaces, and fog, as functions of the expression language."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Self

from raymarch.errors import Location
from raymarch.expr.arrays import SMALLEST
from raymarch.expr.convert import optional
from raymarch.expr.node import Expr, var
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import abs, exp, max, min, mix, normalize, vec3, where
from raymarch.scene.light import Light
from raymarch.scene.parameter import as_color, as_number, is_zero
from raymarch.scene.sky import DIRECTION, Sky
from raymarch.scene.value import Part, value
from raymarch.sdf.domain import ColorLike, Scalar

COLOR, ORIGIN, LENGTH = var("color", VEC3), var("origin", VEC3), var("t", FLOAT)
"""Radiance at the end of a ray, its origin, and its length. `DIRECTION` is its direction."""

SKY_DISTANCE = 1e20
"""Length of rays that reach the sky: beyond all surfaces of the largest scenes, and finite in float32."""


class Atmosphere(Part):
    """Base of what changes the radiance along camera rays."""

    __slots__ = ()

    @property
    def covers_sky(self) -> bool:
        """True if rays that reach the sky are changed."""
        raise NotImplementedError

    @property
    def lit(self) -> bool:
        """True if it scatters light of lights, whose values are then part of its function."""
        return False

    @property
    def box(self) -> Sequence[Sequence[float]] | None:
        """The corners of the box that holds it; None if it has no end."""
        return None

    def check(self, lights: int) -> None:
        """SceneError if a shader cannot draw it under so many lights."""

    def transmittance(self, p: Expr, wi: Expr, distance: Expr) -> Expr | None:
        """The fraction of a light in a direction that reaches a point of a surface; None if lights are not dimmed."""
        return None

    def moved(self, origin: Any) -> Self:
        """The same, relative to an origin, (3,)."""
        raise NotImplementedError

    def absorbing(self) -> Self:
        """The same, but it gives no light of its own. Asked where it covers the sky."""
        raise NotImplementedError

    def applied(self, sky: Sky, lights: Sequence[Light], where: Location | None) -> Expr:
        """The radiance that arrives at ORIGIN of COLOR. sky, lights, where : of the scene."""
        raise NotImplementedError


@value
class Fog(Atmosphere):
    """Fog with transmittance exp(-optical depth). Without `falloff` the optical depth is density * distance.

    Parameters
    ----------
    color : colour of the fog, linear RGB, each >= 0. None is the sky's radiance in the direction of the ray, and of the
        horizon for a ray that descends: far surfaces fade into the sky without a seam.
    density : extinction per unit of length, >= 0.
    falloff : rate per unit of length at which the density falls with the height y, >= 0: it is
        density * exp(-falloff * (y - height)). 0 is homogeneous fog.
    height : the y at which the fog has its `density`. Without `falloff` it has no effect.

    Raises
    ------
    SceneError : a negative value.

    Notes
    -----
    Homogeneous fog covers surfaces, not the sky. Fog with a falloff also covers the sky, as far as rays pass it: fully
    at the horizon, and less upwards. Only the ray from the camera to the first surface passes fog.
    """

    BELONGS: ClassVar[str] = "Scene(fog=...)"
    color: Expr | None
    density: Expr
    falloff: Expr
    height: Expr

    def __init__(
        self,
        color: ColorLike | None = None,
        density: Scalar = 0.05,
        falloff: Scalar = 0.0,
        height: Scalar = 0.0,
    ) -> None:
        self._set(
            color=optional(as_color, "Fog: color", color),
            density=as_number("Fog: density", density, low=0.0),
            falloff=as_number("Fog: falloff", falloff, low=0.0),
            height=as_number("Fog: height", height),
        )

    @property
    def layered(self) -> bool:
        """True if the density may depend on the height."""
        return not is_zero(self.falloff)

    @property
    def covers_sky(self) -> bool:
        return self.layered and self.color is not None

    def optical_depth(self) -> Expr:
        """The integral of the density over a ray of ORIGIN, DIRECTION and LENGTH.

        The density along a ray is exponential in the distance. With d, the change of its exponent over the ray, the
        integral is LENGTH times the density at the denser end times (1 - exp(-d)) / d. For small d that quotient would
        be a difference of nearly equal numbers, and is a power series instead; so nearly horizontal rays are exact in
        float32. The exponent is limited, because float32 has no numbers above exp(88).
        """
        if not self.layered:
            return self.density * LENGTH
        start = self.falloff * (self.height - ORIGIN.y)
        rate = self.falloff * DIRECTION.y
        change = abs(rate) * LENGTH
        denser = min(start + max(-rate, 0.0) * LENGTH, 80.0)
        series = _series(min(change, SERIES))
        reach = where(change < SERIES, LENGTH * series, (1.0 - exp(-change)) / max(abs(rate), SMALLEST))
        return self.density * min(reach * exp(denser), 1e30)

    def absorbing(self) -> Fog:
        """The same in black."""
        return self.replace(color=(0.0, 0.0, 0.0))

    def moved(self, origin: Any) -> Fog:
        return self.replace(height=self.height - float(origin[1]))

    def applied(self, sky: Sky, lights: Sequence[Light], where: Location | None) -> Expr:
        level = normalize(vec3(DIRECTION.x, max(DIRECTION.y, 0.0), DIRECTION.z) + 1e-9)
        return mix(sky.function(where)(level) if self.color is None else self.color, COLOR, exp(-self.optical_depth()))


SERIES = 0.25
"""Below this the series has an error of 5e-8; above it the quotient has one of 3e-7."""


def _series(d: Expr) -> Expr:
    """The first terms of (1 - exp(-d)) / d, for d from 0 to `SERIES`."""
    total = 1.0 - d / 6.0
    for k in (5.0, 4.0, 3.0, 2.0):
        total = 1.0 - d / k * total
    return total
