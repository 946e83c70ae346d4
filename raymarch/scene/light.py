"""Lights. A light casts a shadow only with `shadow=True`.

`intensity` has one meaning for all lights. A white diffuse surface at right angles to the light, at distance 1 from a
light that has a position, has the value 1 at intensity 1. In physical units the irradiance of a sun is pi * color *
intensity, and so is the radiant intensity of a point light.
"""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.convert import choice, short, switch
from raymarch.expr.limits import Limit, limited
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import cos
from raymarch.scene.parameter import as_direction, as_number, as_vec3
from raymarch.scene.value import Value, value
from raymarch.sdf.domain import ColorLike, Scalar, Vec3Like

PENUMBRAS = ("two-sided", "cone", "triangulated", "sampled")


@value
class Light(Value):
    """Base class of all lights.

    Parameters
    ----------
    color : linear RGB, each component >= 0.
    intensity : factor of the colour, >= 0.
    shadow : whether the light casts a shadow. False costs nothing.
    softness : size of the light for its shadow, >= 0: the radius of a light with a position, or the tangent of the
        angular radius of a sun (0.0047 for the real one). 0 gives a hard shadow, which is the cheapest.
    penumbra : method for soft shadows.

        - "two-sided": the fraction of the light's disc that the nearest obstacle leaves visible. The obstacle is taken
          as a straight edge. The fraction is one half at the edge of the geometry, which is correct. Obstacles
          thinner than the disc let light through.
        - "cone": the smallest clearance over the radius of the disc (Quilez 2008). It is dark already at the edge of
          the geometry, and behind every obstacle.
        - "triangulated": as "cone", with the clearance between two samples estimated (Aaltonen 2018).
        - "sampled": a hard shadow of one random point of the light. It is correct for all obstacles, and for
          highlights. It is noisy: it needs `Quality(samples=...)` or several frames.
    """

    color: Expr
    intensity: Expr
    shadow: bool
    softness: Expr
    penumbra: str

    def __init__(self, color: ColorLike, intensity: Scalar, shadow: bool, softness: Scalar, penumbra: str) -> None:
        self._begin()
        name = type(self).__name__
        self._set(
            color=as_vec3(f"{name}: color", color, low=0.0),
            intensity=as_number(f"{name}: intensity", intensity, low=0.0),
            shadow=switch(f"{name}: shadow", shadow),
            penumbra=choice(f"{name}: penumbra", penumbra, PENUMBRAS),
            softness=as_number(f"{name}: softness", softness, low=0.0),
        )

    @property
    def radiance(self) -> Expr:
        """Colour times intensity, a vec3."""
        return self.color * self.intensity

    @property
    def has_position(self) -> bool:
        """True if the light has a `position`: its softness is a radius, else the tangent of an angular radius."""
        return any(field.name == "position" for field in fields(self))

    @property
    def soft(self) -> bool:
        """True if the shadow has a penumbra."""
        return self.shadow and not _is_zero(self.softness)

    @property
    def expressions(self) -> list[Expr]:
        """All values that may depend on parameters or time."""
        given = (getattr(self, field.name) for field in fields(self))
        return [e for e in given if isinstance(e, Expr)]


@value
class Sun(Light):
    """Directional light from infinitely far away.

    Parameters
    ----------
    direction : direction towards the sun, any length but 0.
    color, intensity, shadow, softness, penumbra : see `Light`.

    Notes
    -----
    Raises SceneError for a value outside its range.
    """

    direction: Expr

    def __init__(
        self,
        direction: Vec3Like = (0.5, 1.0, 0.7),
        color: ColorLike = (1.0, 1.0, 1.0),
        intensity: Scalar = 1.0,
        shadow: bool = False,
        softness: Scalar = 0.0,
        penumbra: str = "two-sided",
    ) -> None:
        Light.__init__(self, color, intensity, shadow, softness, penumbra)
        self._set(direction=as_direction("Sun: direction", direction))


@value
class PointLight(Light):
    """Light from one point. It falls off with the inverse square of the distance.

    Parameters
    ----------
    position : (x, y, z) in scene units.
    color, intensity, shadow, softness, penumbra : see `Light`.
    range : distance beyond which nothing is lit, > 0. At distance d the light is multiplied by (1 - (d/range)^4)^2.
        Beyond the range the light costs nothing. None means no limit.
    shadow_radius : distance from the light beyond which surfaces receive no shadow, > 0. None means no limit.
    attenuation : (constant, linear, quadratic), each >= 0, not all 0. The light is divided by this polynomial of the
        distance instead of its square. With a range, it is multiplied by 1 - d/range.

    Notes
    -----
    Raises SceneError for a value outside its range.
    """

    position: Expr
    range: Expr | None
    shadow_radius: Expr | None
    attenuation: Expr | None

    def __init__(
        self,
        position: Vec3Like,
        color: ColorLike = (1.0, 1.0, 1.0),
        intensity: Scalar = 1.0,
        shadow: bool = False,
        softness: Scalar = 0.0,
        penumbra: str = "two-sided",
        range: Scalar | None = None,
        shadow_radius: Scalar | None = None,
        attenuation: Vec3Like | None = None,
    ) -> None:
        Light.__init__(self, color, intensity, shadow, softness, penumbra)
        name = type(self).__name__
        self._set(
            position=as_vec3(f"{name}: position", position),
            range=_length(f"{name}: range", range),
            shadow_radius=_length(f"{name}: shadow_radius", shadow_radius),
            attenuation=None if attenuation is None else as_vec3(f"{name}: attenuation", attenuation, low=0.0),
        )
        if self.attenuation is not None and _is_zero(self.attenuation):
            raise SceneError(f"{name}: attenuation = {short(attenuation)}", legal="3 numbers >= 0, not all zero")
        if self.attenuation is not None:
            limit = Limit(f"{name}: attenuation", "3 numbers >= 0, not all zero", nonzero=True)
            self._set(attenuation=limited(self.attenuation, limit))


@value
class SpotLight(PointLight):
    """Light from one point into a cone.

    Parameters
    ----------
    position : (x, y, z) in scene units.
    direction : direction in which the light shines, any length but 0.
    angle : half angle of the cone, from its axis to its edge, in radians, above 0 and up to pi.
    blend : fraction of the angle over which the edge fades, from 0 (sharp) to 1. Let c be the cosine of the angle to
        the axis, c0 its value at the edge and c1 its value where the fade ends: the light is multiplied by
        ((c - c0) / (c1 - c0))^2.
    color, intensity, shadow, softness, penumbra, range, shadow_radius, attenuation : see `PointLight`.

    Notes
    -----
    Raises SceneError for a value outside its range.
    """

    direction: Expr
    angle: Expr
    blend: Expr

    def __init__(
        self,
        position: Vec3Like,
        direction: Vec3Like = (0.0, -1.0, 0.0),
        angle: Scalar = 0.5,
        blend: Scalar = 0.2,
        color: ColorLike = (1.0, 1.0, 1.0),
        intensity: Scalar = 1.0,
        shadow: bool = False,
        softness: Scalar = 0.0,
        penumbra: str = "two-sided",
        range: Scalar | None = None,
        shadow_radius: Scalar | None = None,
        attenuation: Vec3Like | None = None,
    ) -> None:
        PointLight.__init__(
            self, position, color, intensity, shadow, softness, penumbra, range, shadow_radius, attenuation
        )
        self._set(
            direction=as_direction("SpotLight: direction", direction),
            angle=as_number("SpotLight: angle", angle, 1e-3, math.pi),
            blend=as_number("SpotLight: blend", blend, 0.0, 1.0),
        )

    @property
    def cosines(self) -> tuple[Expr, Expr]:
        """Cosines of two angles to the axis: where the light ends, and where its fade ends."""
        return cos(self.angle), cos(self.angle * (1.0 - self.blend))


@value
class SphereLight(PointLight):
    """Light from a sphere. The sphere itself is not visible.

    Parameters
    ----------
    position : centre of the sphere, (x, y, z) in scene units.
    radius : radius of the sphere, > 0. It is also the `softness` of the shadow.
    color, intensity, shadow, penumbra, range, shadow_radius, attenuation : see `PointLight`. `intensity` is the
        brightness at distance 1 from the centre.

    Notes
    -----
    To show the sphere, add a node with an emission of intensity / radius^2.
    A diffuse surface that sees the whole sphere is lit exactly as by a point light. Highlights are those of a point.
    Raises SceneError for a value outside its range.
    """

    radius: Expr

    def __init__(
        self,
        position: Vec3Like,
        radius: Scalar = 0.5,
        color: ColorLike = (1.0, 1.0, 1.0),
        intensity: Scalar = 1.0,
        shadow: bool = False,
        penumbra: str = "two-sided",
        range: Scalar | None = None,
        shadow_radius: Scalar | None = None,
        attenuation: Vec3Like | None = None,
    ) -> None:
        given = _length("SphereLight: radius", radius)
        if given is None:
            raise SceneError("SphereLight: radius = None", legal="a finite number > 0")
        PointLight.__init__(
            self, position, color, intensity, shadow, given, penumbra, range, shadow_radius, attenuation
        )
        self._set(radius=given)


KINDS = (Sun, PointLight, SpotLight, SphereLight)
"""The kinds of lights that the shader and the reference have code for; docs/extending.md lists where."""


def hard(light: Light) -> Light:
    """The same light with hard shadows. A SphereLight becomes a PointLight at its centre."""
    if isinstance(light, SphereLight):
        return PointLight(**{name: value for name, value in light.arguments().items() if name != "radius"})
    return light.replace(softness=0.0)


def _is_zero(value: Expr) -> bool:
    return value.is_constant and not np.any(value.data)


def _length(what: str, value: Any) -> Expr | None:
    return None if value is None else as_number(what, value, low=1e-6)
