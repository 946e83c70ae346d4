"""Lights. A light casts a shadow only if it says so.

Brightness has one meaning for all of them: a white matte surface that faces a light of intensity 1 squarely, at
distance 1 from lights that have a place, has the value 1. In physical units a sun's irradiance is pi times its colour
and intensity, and a point light's radiant intensity as well.
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

PENUMBRAS = ("two-sided", "cone", "triangulated", "sampled")


@value
class Light(Value):
    """What all lights share.

    Parameters
    ----------
    color : linear RGB, each >= 0. intensity : factor >= 0.
    shadow : whether it casts one; False costs nothing.
    softness : how wide the light is as its shadows see it, >= 0: the radius of a lamp's body, or the tangent of a sun's
        angular radius (0.0047 for the real one). 0 is a hard shadow, the cheapest.
    penumbra : how a soft shadow is found. "two-sided": the share of the light's disc that is left by the nearest
        obstacle, taken as a straight edge; half at the edge of the geometry, as it should be, but what is thinner
        than the disc lets light through. "cone": the smallest clearance over the disc's radius (Quilez 2008), dark
        already at the edge, and behind all that stands in the way. "triangulated": that with the
        clearance between two samples estimated (Aaltonen 2018). "sampled": a hard shadow of one point of the light at
        random, right for whatever is in the way, and for highlights; it takes `Quality(samples=...)` or frames to make
        it smooth.
    """

    color: Expr
    intensity: Expr
    shadow: bool
    softness: Expr
    penumbra: str

    def __init__(self, color: Any, intensity: Any, shadow: bool, softness: Any, penumbra: str) -> None:
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
    def soft(self) -> bool:
        """True if its shadow has a penumbra."""
        return self.shadow and not _is_zero(self.softness)

    @property
    def expressions(self) -> list[Expr]:
        """All that may depend on parameters or time."""
        given = (getattr(self, field.name) for field in fields(self))
        return [e for e in given if isinstance(e, Expr)]


@value
class Sun(Light):
    """Light from infinitely far away.

    Parameters
    ----------
    direction : towards the sun, any length but 0.
    color, intensity, shadow, softness, penumbra : see `Light`.
    """

    direction: Expr

    def __init__(
        self,
        direction: Any = (0.5, 1.0, 0.7),
        color: Any = (1.0, 1.0, 1.0),
        intensity: Any = 1.0,
        shadow: bool = False,
        softness: Any = 0.0,
        penumbra: str = "two-sided",
    ) -> None:
        Light.__init__(self, color, intensity, shadow, softness, penumbra)
        self._set(direction=as_direction("Sun: direction", direction))


@value
class PointLight(Light):
    """Light from one point; it falls off with the inverse square of the distance.

    Parameters
    ----------
    position : vec3.
    color, intensity, shadow, softness, penumbra : see `Light`.
    range : nothing farther away is lit, > 0; the light fades towards it by (1 - (d/range)^4)^2, and costs nothing beyond.
        None is no end.
    shadow_radius : what is farther away gets no shadow, > 0; None is no end.
    attenuation : (constant, linear, quadratic), each >= 0, not all 0: the light is divided by their polynomial of the
        distance in place of its square, and fades by 1 - d/range if there is a range.
    """

    position: Expr
    range: Expr | None
    shadow_radius: Expr | None
    attenuation: Expr | None

    def __init__(
        self,
        position: Any,
        color: Any = (1.0, 1.0, 1.0),
        intensity: Any = 1.0,
        shadow: bool = False,
        softness: Any = 0.0,
        penumbra: str = "two-sided",
        range: Any = None,
        shadow_radius: Any = None,
        attenuation: Any = None,
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
    position : vec3. direction : in which it shines, any length but 0.
    angle : from the axis to the cone's edge, in radians, above 0 and up to pi.
    blend : share of the angle over which the edge fades, from 0, a sharp one, to 1. With c the cosine to the axis, c0
        at the edge and c1 where the fading ends, the light is multiplied by ((c - c0) / (c1 - c0))^2.
    The rest : see `PointLight`.
    """

    direction: Expr
    angle: Expr
    blend: Expr

    def __init__(
        self,
        position: Any,
        direction: Any = (0.0, -1.0, 0.0),
        angle: Any = 0.5,
        blend: Any = 0.2,
        color: Any = (1.0, 1.0, 1.0),
        intensity: Any = 1.0,
        shadow: bool = False,
        softness: Any = 0.0,
        penumbra: str = "two-sided",
        range: Any = None,
        shadow_radius: Any = None,
        attenuation: Any = None,
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
        """Cosines of the angles to the axis at which the light ends, and at which it is whole."""
        return cos(self.angle), cos(self.angle * (1.0 - self.blend))


@value
class SphereLight(PointLight):
    """Light from a ball that itself is not seen: paint a node with an emission of intensity / radius^2 to show it.

    Parameters
    ----------
    position : of the ball's centre. radius : of the ball, > 0. It is what softens the shadow.
    The rest : see `PointLight`; intensity is the brightness at distance 1 from the centre.

    A matte surface that sees the whole ball is lit exactly as by a point light. A highlight is that of a point too.
    """

    radius: Expr

    def __init__(
        self,
        position: Any,
        radius: Any = 0.5,
        color: Any = (1.0, 1.0, 1.0),
        intensity: Any = 1.0,
        shadow: bool = False,
        penumbra: str = "two-sided",
        range: Any = None,
        shadow_radius: Any = None,
        attenuation: Any = None,
    ) -> None:
        given = _length("SphereLight: radius", radius)
        if given is None:
            raise SceneError("SphereLight: radius = None", legal="a finite number > 0")
        PointLight.__init__(
            self, position, color, intensity, shadow, given, penumbra, range, shadow_radius, attenuation
        )
        self._set(radius=given)


def hard(light: Light) -> Light:
    """The same light with hard shadows; of a ball, its centre."""
    if isinstance(light, SphereLight):
        return PointLight(**{name: value for name, value in light.arguments().items() if name != "radius"})
    return light.replace(softness=0.0)


def _is_zero(value: Expr) -> bool:
    return value.is_constant and not np.any(value.data)


def _length(what: str, value: Any) -> Expr | None:
    return None if value is None else as_number(what, value, low=1e-6)
