"""The sky, which rays that hit nothing see: one colour, a gradient, a clear sky with a sun, or an environment map.

A sky is a function of the ray direction in the expression language. The shader and the reference use the same function.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from os import PathLike
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import Location, SceneError
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.calls import checked
from raymarch.expr.colors import linear_color
from raymarch.expr.convert import called, input_file, short
from raymarch.expr.function import Function, sum_of, unique_function
from raymarch.expr.images import read_image
from raymarch.expr.node import Expr, Operand, expr, var
from raymarch.expr.samples import Samples, sample
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import acos, atan2, clamp, cos, dot, exp, floor, max, min, mix, tan, vec2, vec3
from raymarch.expr.walk import free_variables
from raymarch.scene.light_kinds import Sun
from raymarch.scene.parameter import Values, as_color, as_direction, as_number, is_zero
from raymarch.scene.value import Value, value
from raymarch.sdf.domain import ColorLike, Scalar, Vec3Like, as_operand

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
        A number >= 0 is a factor of this light, and another sky gives its light in place of this one. Camera rays then
        see the colour of this sky, and all other rays that hit nothing the light.

    Raises
    ------
    SceneError : a negative colour, a function that does not give three numbers, or a light of another kind.

    Notes
    -----
    A sky of radiance L in all directions gives a surface the irradiance pi L: a diffuse one has the radiance of its
    albedo times L.

    Examples
    --------
    >>> white = rm.Sky("white", light=rm.GradientSky())  # a white background in daylight
    >>> dim = rm.GradientSky(light=0.3)  # a sky that gives less light than is seen
    """

    BELONGS: ClassVar[str] = "Scene(sky=...)"
    color: Expr
    light: bool | Expr | Sky

    def __init__(
        self,
        color: ColorLike | Callable[[Expr], Operand] = (0.14, 0.26, 0.46),
        light: bool | Scalar | Sky = False,
    ) -> None:
        self._set(light=_light(f"{type(self).__name__}: light", light), color=_radiance(color))

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
    def lights(self) -> bool:
        """True if the sky lights surfaces."""
        return not is_zero(self.light) if isinstance(self.light, Expr) else bool(self.light)

    @property
    def lighting(self) -> Expr:
        """The radiance that lights surfaces and that rays from surfaces see, a vec3, as `radiance`."""
        if isinstance(self.light, Sky):
            return self.light.lighting
        return self.light * self.radiance if isinstance(self.light, Expr) else self.radiance

    @property
    def apart(self) -> bool:
        """True if the light differs from what camera rays see."""
        return self.lighting is not self.radiance

    @property
    def expressions(self) -> list[Expr]:
        """All values that may depend on parameters or time."""
        return [self.radiance, *([self.lighting] if self.apart else [])]

    def radiance_along(
        self, directions: NDArray[Any], values: Values, lighting: bool = False
    ) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Radiance along unit directions, linear RGB, (N, 3) -> (N, 3), float64. lighting : for rays from surfaces."""
        with bound(values.params, values.time):
            seen = self.lighting if lighting else self.radiance
            color = evaluator([seen], [DIRECTION])(np.asarray(directions, np.float64))[0]
        return np.array(np.broadcast_to(color, np.shape(directions)), np.float64)

    def function(self, where: Location | None) -> Function:
        """The radiance as a function of the direction: `sky`. where : the user's line."""
        return unique_function("sky", (DIRECTION,), self.radiance, {}, where)

    def lighting_function(self, where: Location | None) -> Function:
        """The same for rays from surfaces: `sky` too, unless the light is `apart`."""
        if not self.apart:
            return self.function(where)
        return unique_function("lighting_sky", (DIRECTION,), self.lighting, {}, where)

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
            basis.T @ self.radiance_along(directions, values, lighting=True) / n
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


def _light(what: str, light: Any) -> bool | Expr | Sky:
    """True or False, a factor, or another sky."""
    if isinstance(light, bool | np.bool_ | Sky):
        return light if isinstance(light, Sky) else bool(light)
    try:
        return as_number(what, light, low=0.0)
    except SceneError:
        legal = "True, False, a factor >= 0, or another sky, such as rm.Sky((1, 0.9, 0.8)) for one colour"
        raise SceneError(f"{what} = {short(light)}", legal=legal) from None


def _radiance(color: Any) -> Expr:
    """A colour, or a function of the direction, as an expression of DIRECTION."""
    legal = "linear RGB >= 0, or a function of a direction that gives such"
    if isinstance(color, type):
        raise SceneError(f"Sky: color = the class {color.__name__}", legal=f"{color.__name__}(...), or {legal}")
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


@value
class GradientSky(Sky):
    """A sky with a gradient from the horizon to the zenith, above a ground of one colour.

    Parameters
    ----------
    zenith, horizon, ground : linear RGB, each >= 0.
    light : see `Sky`.

    Raises
    ------
    SceneError : a negative colour.
    """

    zenith: Expr
    horizon: Expr
    ground: Expr

    def __init__(
        self,
        zenith: ColorLike = (0.07, 0.16, 0.38),
        horizon: ColorLike = (0.5, 0.62, 0.75),
        ground: ColorLike = (0.15, 0.15, 0.15),
        light: bool | Scalar | Sky = False,
    ) -> None:
        top, rim, low = (
            as_color(f"GradientSky: {name}", value)
            for name, value in (("zenith", zenith), ("horizon", horizon), ("ground", ground))
        )

        def color(d: Expr) -> Expr:
            up = max(d.y, 0.0)
            return mix(mix(rim, top, up * (2.0 - up)), low, clamp(-12.0 * d.y, 0.0, 1.0))

        Sky.__init__(self, color, light)
        self._set(zenith=top, horizon=rim, ground=low)


@value
class SunSky(Sky):
    """A clear daylight sky (Preetham, Shirley and Smits 1999), above a ground of one colour.

    Parameters
    ----------
    sun_direction : the direction from the scene to the sun, any length but 0. It is raised to above the horizon.
    turbidity : amount of haze, from 2 (clear) to 10.
    intensity : factor >= 0. At 1 a unit is 50 kilocandela per square metre: the sky far from the sun is about 0.15, and
        a white floor under the sky and `sun()` about 0.4 at an elevation of 17 degrees, 1 at 50 and 1.25 at 90.
    ground : colour below the horizon, linear RGB, each >= 0.
    light : see `Sky`. It does not include the direct light of the sun: add `sun()` to the lights of the scene.

    Raises
    ------
    SceneError : a value outside its range.
    """

    sun_direction: Expr
    turbidity: Expr
    intensity: Expr
    ground: Expr

    def __init__(
        self,
        sun_direction: Vec3Like = (0.5, 0.6, 0.7),
        turbidity: Scalar = 2.0,
        intensity: Scalar = 1.0,
        ground: ColorLike = (0.15, 0.15, 0.15),
        light: bool | Scalar | Sky = False,
    ) -> None:
        towards = as_direction("SunSky: sun_direction", sun_direction)
        haze = as_number("SunSky: turbidity", turbidity, 2.0, 10.0)
        factor = as_number("SunSky: intensity", intensity, low=0.0)
        low = as_color("SunSky: ground", ground)

        def color(d: Expr) -> Expr:
            above = _preetham(d, towards, haze) * factor
            return mix(above, low * factor, clamp(-12.0 * d.y, 0.0, 1.0))

        Sky.__init__(self, color, light)
        self._set(sun_direction=towards, turbidity=haze, intensity=factor, ground=low)

    @checked
    def sun(
        self,
        intensity: Scalar = 1.2,
        shadow: bool = False,
        softness: Scalar = 0.0,
        penumbra: str = "two-sided",
    ) -> Sun:
        """The sun as a light: white at the zenith, red at the horizon.

        Parameters
        ----------
        intensity : factor >= 0, multiplied by the intensity of the sky.
        shadow, softness, penumbra : see `Sun`.

        Returns
        -------
        Sun

        Raises
        ------
        SceneError : arguments of another kind or outside their range.
        """
        up = max(self.sun_direction.y, 0.0)
        through = exp(expr((-0.06, -0.12, -0.28)) / (up + 0.1))
        factor = as_number("SunSky.sun: intensity", intensity, low=0.0)
        return Sun(self.sun_direction, through, factor * self.intensity, shadow, softness, penumbra)


@value
class ImageSky(Sky):
    """An environment map in equirectangular projection: longitude across, latitude down, its centre along -z.

    Parameters
    ----------
    source : name of a Radiance (.hdr), OpenEXR (.exr), or a file that Pillow reads, up to 2046 pixels wide and high.
    intensity : factor >= 0.
    rotation : about the y axis, in radians, clockwise as seen from above; `node.rotate` turns the other way.
    light : see `Sky`.

    Raises
    ------
    SceneError : a file that is missing, broken or too large.
    """

    source: str
    intensity: Expr
    rotation: Expr

    def __init__(
        self,
        source: str | PathLike[str],
        intensity: Scalar = 1.0,
        rotation: Scalar = 0.0,
        light: bool | Scalar | Sky = False,
    ) -> None:
        name = input_file("ImageSky: source", source, "the name of a picture's file")
        pixels = np.maximum(read_image("ImageSky", name), 0.0)
        height, width = pixels.shape[:2]
        # An extra column on each side closes the circle; an extra row at each end repeats the row of the pole.
        closed = np.pad(pixels, ((1, 1), (0, 0), (0, 0)), "edge")
        closed = np.pad(closed, ((0, 0), (1, 1), (0, 0)), "wrap")
        channels = [Samples(closed[..., c]) for c in range(3)]
        factor, angle = as_number("ImageSky: intensity", intensity, low=0.0), as_number("ImageSky: rotation", rotation)

        def color(d: Expr) -> Expr:
            around = atan2(d.x, -d.z) - angle
            u = around * (0.5 / math.pi) + 0.5
            u = u - floor(u)
            v = acos(d.y) * (1.0 / math.pi)
            at = vec2(u * width + 0.5, v * height + 0.5)
            return vec3(*(sample(channel, at) for channel in channels)) * factor

        Sky.__init__(self, color, light)
        self._set(source=name, intensity=factor, rotation=angle)


# Constants of Preetham's model. _PEREZ: distributions of luminance and the two chromaticities, each a T + b in the
# turbidity T. _ZENITH: chromaticities at the zenith, cubic in the zenith angle of the sun, with coefficients quadratic
# in T.
_PEREZ = (
    ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)),
    ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)),
    ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)),
)
_ZENITH = (
    ((0.00166, -0.00375, 0.00209, 0.0), (-0.02903, 0.06377, -0.03202, 0.00394), (0.11693, -0.21196, 0.06052, 0.25886)),
    ((0.00275, -0.00610, 0.00317, 0.0), (-0.04214, 0.08970, -0.04153, 0.00516), (0.15346, -0.26756, 0.06670, 0.26688)),
)
_TO_RGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def _preetham(d: Expr, sun: Expr, haze: Expr) -> Expr:
    """Radiance of the clear sky in linear RGB, in units of 50 kilocandela per square metre."""
    height = max(sun.y, 0.02)
    angle = acos(height)
    cosine = max(d.y, 0.01)
    to_sun = clamp(dot(d, sun), -1.0, 1.0)
    gamma = acos(to_sun)
    luminance = (4.0453 * haze - 4.9710) * tan((4.0 / 9.0 - haze / 120.0) * (math.pi - 2.0 * angle))
    zenith = [max(luminance - 0.2155 * haze + 2.4192, 0.05)]
    for rows in _ZENITH:
        parts = [((row[0] * angle + row[1]) * angle + row[2]) * angle + row[3] for row in rows]
        zenith.append((parts[0] * haze + parts[1]) * haze + parts[2])

    def perez(k: int, c: Expr, g: Expr, cos_g: Expr) -> Expr:
        f = [row[0] * haze + row[1] for row in _PEREZ[k]]
        return (1.0 + f[0] * exp(f[1] / c)) * (1.0 + f[2] * exp(f[3] * g) + f[4] * cos_g * cos_g)

    values = [zenith[k] * perez(k, cosine, gamma, to_sun) / perez(k, expr(1.0), angle, cos(angle)) for k in range(3)]
    bright, x, y = max(values[0], 0.0) * 0.02, values[1], max(values[2], 0.02)
    xyz = vec3(bright * x / y, bright, bright * (1.0 - x - y) / y)
    return min(max(vec3(*(dot(tuple(row), xyz) for row in _TO_RGB.tolist())), 0.0), 60.0)
