"""Ready-made skies: a gradient, a clear sky with a sun, and an environment map."""

from __future__ import annotations

import math
from os import PathLike

import numpy as np

from raymarch.expr.calls import checked
from raymarch.expr.convert import input_file
from raymarch.expr.node import Expr, expr
from raymarch.expr.samples import Samples, sample
from raymarch.expr.vocabulary import acos, atan2, clamp, cos, dot, exp, floor, max, min, mix, tan, vec2, vec3
from raymarch.scene.images import read_image
from raymarch.scene.light import Sun
from raymarch.scene.parameter import as_color, as_direction, as_number
from raymarch.scene.sky import Sky
from raymarch.scene.value import value
from raymarch.sdf.domain import ColorLike, Scalar, Vec3Like


@value
class GradientSky(Sky):
    """A sky with a gradient from the horizon to the zenith, above a ground of one colour.

    Parameters
    ----------
    zenith, horizon, ground : linear RGB, each >= 0.
    light : see `Sky`.
    """

    zenith: Expr
    horizon: Expr
    ground: Expr

    def __init__(
        self,
        zenith: ColorLike = (0.25, 0.45, 0.8),
        horizon: ColorLike = (0.75, 0.82, 0.9),
        ground: ColorLike = (0.3, 0.28, 0.25),
        light: bool = False,
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
    direction : direction towards the sun, any length but 0. Its elevation is clamped to above the horizon.
    turbidity : amount of haze, from 2 (clear) to 10.
    intensity : factor >= 0. At 1 the sky far from the sun has a brightness of about 0.5.
    ground : colour below the horizon, linear RGB, each >= 0.
    light : see `Sky`. It does not include the direct light of the sun: add `sun()` to the lights of the scene.
    """

    direction: Expr
    turbidity: Expr
    intensity: Expr
    ground: Expr

    def __init__(
        self,
        direction: Vec3Like = (0.5, 0.6, 0.7),
        turbidity: Scalar = 3.0,
        intensity: Scalar = 1.0,
        ground: ColorLike = (0.25, 0.23, 0.2),
        light: bool = False,
    ) -> None:
        towards = as_direction("SunSky: direction", direction)
        haze = as_number("SunSky: turbidity", turbidity, 2.0, 10.0)
        factor = as_number("SunSky: intensity", intensity, low=0.0)
        low = as_color("SunSky: ground", ground)

        def color(d: Expr) -> Expr:
            above = _preetham(d, towards, haze) * factor
            return mix(above, low * factor, clamp(-12.0 * d.y, 0.0, 1.0))

        Sky.__init__(self, color, light)
        self._set(direction=towards, turbidity=haze, intensity=factor, ground=low)

    @checked
    def sun(
        self,
        intensity: Scalar = 3.0,
        shadow: bool = False,
        softness: Scalar = 0.0,
        penumbra: str = "two-sided",
    ) -> Sun:
        """The sun as a light: white at the zenith, red at the horizon.

        intensity : factor >= 0, multiplied by the intensity of the sky.
        shadow, softness, penumbra : see `Sun`.
        """
        up = max(self.direction.y, 0.0)
        through = exp(expr((-0.06, -0.12, -0.28)) / (up + 0.1))
        factor = as_number("SunSky.sun: intensity", intensity, low=0.0)
        return Sun(self.direction, through, factor * self.intensity, shadow, softness, penumbra)


@value
class ImageSky(Sky):
    """An environment map in equirectangular projection: longitude across, latitude down, its centre along -z.

    Parameters
    ----------
    file : Radiance (.hdr), OpenEXR (.exr), or a file that Pillow reads, up to 2046 pixels wide and high.
    intensity : factor >= 0.
    turn : rotation about the y axis, in radians.
    light : see `Sky`.

    Notes
    -----
    Raises SceneError for a file that is missing, broken or too large.
    """

    file: str
    intensity: Expr
    turn: Expr

    def __init__(
        self, file: str | PathLike[str], intensity: Scalar = 1.0, turn: Scalar = 0.0, light: bool = False
    ) -> None:
        name = input_file("ImageSky: file", file, "the name of a picture's file")
        pixels = np.maximum(read_image("ImageSky", name), 0.0)
        height, width = pixels.shape[:2]
        # An extra column on each side closes the circle; an extra row at each end repeats the row of the pole.
        closed = np.pad(pixels, ((1, 1), (0, 0), (0, 0)), "edge")
        closed = np.pad(closed, ((0, 0), (1, 1), (0, 0)), "wrap")
        channels = [Samples(closed[..., c]) for c in range(3)]
        factor, angle = as_number("ImageSky: intensity", intensity, low=0.0), as_number("ImageSky: turn", turn)

        def color(d: Expr) -> Expr:
            around = atan2(d.x, -d.z) - angle
            u = around * (0.5 / math.pi) + 0.5
            u = u - floor(u)
            v = acos(d.y) * (1.0 / math.pi)
            at = vec2(u * width + 0.5, v * height + 0.5)
            return vec3(*(sample(channel, at) for channel in channels)) * factor

        Sky.__init__(self, color, light)
        self._set(file=name, intensity=factor, turn=angle)


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
    """Radiance of the clear sky in linear RGB, in units of 20 kilocandela per square metre."""
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
    bright, x, y = max(values[0], 0.0) * 0.05, values[1], max(values[2], 0.02)
    xyz = vec3(bright * x / y, bright, bright * (1.0 - x - y) / y)
    return min(max(vec3(*(dot(tuple(row), xyz) for row in _TO_RGB.tolist())), 0.0), 60.0)
