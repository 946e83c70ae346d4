"""The kinds of lights: suns, points, spots, spheres and rectangles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from weakref import WeakSet

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.arrays import SHORTEST, SMALLEST
from raymarch.expr.convert import optional, short, switch
from raymarch.expr.limits import Limit, limited
from raymarch.expr.node import Expr, const
from raymarch.expr.vocabulary import (
    clamp,
    cos,
    cross,
    dot,
    length,
    max,
    min,
    normalize,
    sqrt,
    vec3,
    where,
)
from raymarch.scene.light import DirectionSample, Light, RayHit
from raymarch.scene.parameter import LEAST_LENGTH, as_direction, as_number, as_vec3, is_zero
from raymarch.scene.value import value
from raymarch.sdf.domain import ColorLike, Scalar, Vec3Like


@value
class Sun(Light):
    """Directional light from infinitely far away.

    Parameters
    ----------
    sun_direction : the direction from the scene to the sun, any length but 0.
    color, intensity, shadow, penumbra : see `Light`.
    softness : tangent of the angular radius of the sun, >= 0: 0.0047 for the real one. Light comes evenly from that
        cone. 0 gives a hard shadow, which is the cheapest.

    Raises
    ------
    SceneError : a value outside its range.
    """

    sun_direction: Expr

    LABEL = "sun light"

    def __init__(
        self,
        sun_direction: Vec3Like = (0.5, 1.0, 0.7),
        color: ColorLike = (1.0, 1.0, 1.0),
        intensity: Scalar = 1.0,
        shadow: bool = False,
        softness: Scalar = 0.0,
        penumbra: str = "two-sided",
    ) -> None:
        Light.__init__(self, color, intensity, shadow, softness, penumbra)
        self._set(sun_direction=as_direction("Sun: sun_direction", sun_direction))

    def emitter_values(self) -> dict[str, Expr]:
        return {"direction": self.sun_direction, **Light.emitter_values(self)}

    @staticmethod
    def sample_direction(values: Mapping[str, Expr], p: Expr, u: Expr, far: Expr) -> DirectionSample:
        return DirectionSample(values["direction"], far, values["radiance"])


@value
class PointLight(Light):
    """Light from one point. It falls off with the inverse square of the distance.

    Parameters
    ----------
    position : (x, y, z) in scene units.
    color, intensity, shadow, penumbra : see `Light`.
    radius : of the ball whose shadow the light casts, >= 0. It shines as a point. 0 gives a hard shadow, which is the
        cheapest.
    range : distance beyond which nothing is lit, > 0. At distance d the light is multiplied by (1 - (d/range)^4)^2.
        Beyond the range the light costs nothing. None means no limit.
    shadow_radius : distance from the light beyond which surfaces receive no shadow, > 0. None means no limit.
    attenuation : (constant, linear, quadratic), each >= 0, not all 0. The light is divided by this polynomial of the
        distance instead of its square. With a range, it is multiplied by 1 - d/range.

    Raises
    ------
    SceneError : a value outside its range.
    """

    position: Expr
    radius: Expr
    range: Expr | None
    shadow_radius: Expr | None
    attenuation: Expr | None

    LABEL = "point lights"

    def __init__(
        self,
        position: Vec3Like,
        color: ColorLike = (1.0, 1.0, 1.0),
        intensity: Scalar = 1.0,
        shadow: bool = False,
        radius: Scalar = 0.0,
        penumbra: str = "two-sided",
        range: Scalar | None = None,
        shadow_radius: Scalar | None = None,
        attenuation: Vec3Like | None = None,
    ) -> None:
        name = type(self).__name__
        given = as_number(f"{name}: radius", radius, low=0.0)
        Light.__init__(self, color, intensity, shadow, given, penumbra)
        self._set(
            position=as_vec3(f"{name}: position", position),
            radius=given,
            range=optional(as_number, f"{name}: range", range, LEAST_LENGTH),
            shadow_radius=optional(as_number, f"{name}: shadow_radius", shadow_radius, LEAST_LENGTH),
            attenuation=optional(as_vec3, f"{name}: attenuation", attenuation, 0.0),
        )
        if self.attenuation is not None and is_zero(self.attenuation):
            raise SceneError(f"{name}: attenuation = {short(attenuation)}", legal="3 numbers >= 0, not all zero")
        if self.attenuation is not None:
            limit = Limit(f"{name}: attenuation", "3 numbers >= 0, not all zero", nonzero=True)
            self._set(attenuation=limited(self.attenuation, limit))

    @property
    def reach(self) -> tuple[Expr, Expr] | None:
        return None if self.range is None else (self.position, self.range)

    def emitter_values(self) -> dict[str, Expr]:
        given = {"range": self.range, "attenuation": self.attenuation}
        found = {name: value for name, value in given.items() if value is not None}
        return {"position": self.position, **Light.emitter_values(self), **found}

    @staticmethod
    def sample_direction(values: Mapping[str, Expr], p: Expr, u: Expr, far: Expr) -> DirectionSample:
        to_light = values["position"] - p
        if "attenuation" in values:
            distance = max(length(to_light), SHORTEST)
            terms = values["attenuation"]
            falloff = 1.0 / max(terms.x + distance * (terms.y + distance * terms.z), SMALLEST)
            if "range" in values:
                falloff = falloff * max(1.0 - distance / values["range"], 0.0)
        else:
            squared = max(dot(to_light, to_light), SMALLEST)
            distance = sqrt(squared)
            falloff = 1.0 / squared
            if "range" in values:
                falloff = falloff * _window(distance, values["range"])
        return DirectionSample(to_light / distance, distance, falloff * values["radiance"])


_aimed: WeakSet[Expr] = WeakSet()
"""The directions that follow from targets: `dataclasses.replace` passes both."""


def _aim(name: str, position: Expr, direction: Vec3Like | None, target: Vec3Like | None) -> dict[str, Expr | None]:
    """The direction of a light that is given by it or by a point, and that point."""
    if target is None:
        down = (0.0, -1.0, 0.0)
        return {
            "direction": as_direction(f"{name}: direction", down if direction is None else direction),
            "target": None,
        }
    if direction is not None and not (isinstance(direction, Expr) and direction in _aimed):
        raise SceneError(f"{name}: direction together with target", legal="one of them; both say where it shines")
    at = as_vec3(f"{name}: target", target)
    found = as_direction(f"{name}: target - position", at - position)
    _aimed.add(found)
    return {"direction": found, "target": at}


@value
class SpotLight(PointLight):
    """Light from one point into a cone.

    Parameters
    ----------
    position : (x, y, z) in scene units.
    direction : direction in which the light shines, any length but 0. None for (0, -1, 0), straight down.
    half_angle : from the axis of the cone to its edge, in radians, above 0 and up to pi.
    blend : fraction of the half angle over which the edge fades, from 0 (sharp) to 1. Let c be the cosine of the angle
        to the axis, c0 its value at the edge and c1 its value where the fade ends: the light is multiplied by
        ((c - c0) / (c1 - c0))^2.
    color, intensity, shadow, radius, penumbra, range, shadow_radius, attenuation : see `PointLight`.
    target : the point at which the light shines, (x, y, z), in place of `direction`.

    Raises
    ------
    SceneError : a value outside its range, and `direction` together with `target`.
    """

    direction: Expr
    half_angle: Expr
    blend: Expr
    target: Expr | None

    LABEL = "spot lights"

    def __init__(
        self,
        position: Vec3Like,
        direction: Vec3Like | None = None,
        half_angle: Scalar = 0.5,
        blend: Scalar = 0.2,
        color: ColorLike = (1.0, 1.0, 1.0),
        intensity: Scalar = 1.0,
        shadow: bool = False,
        radius: Scalar = 0.0,
        penumbra: str = "two-sided",
        range: Scalar | None = None,
        shadow_radius: Scalar | None = None,
        attenuation: Vec3Like | None = None,
        target: Vec3Like | None = None,
    ) -> None:
        PointLight.__init__(
            self, position, color, intensity, shadow, radius, penumbra, range, shadow_radius, attenuation
        )
        self._set(
            **_aim("SpotLight", self.position, direction, target),
            half_angle=as_number("SpotLight: half_angle", half_angle, 1e-3, math.pi),
            blend=as_number("SpotLight: blend", blend, 0.0, 1.0),
        )

    def emitter_values(self) -> dict[str, Expr]:
        outer, inner = cos(self.half_angle), cos(self.half_angle * (1.0 - self.blend))
        return {**PointLight.emitter_values(self), "axis": self.direction, "outer": outer, "inner": inner}

    @staticmethod
    def sample_direction(values: Mapping[str, Expr], p: Expr, u: Expr, far: Expr) -> DirectionSample:
        found = PointLight.sample_direction(values, p, u, far)
        cosine = -dot(found.direction, values["axis"])
        rise = clamp((cosine - values["outer"]) / max(values["inner"] - values["outer"], 1e-6), 0.0, 1.0)
        return found._replace(radiance=(rise * rise) * found.radiance)


@value
class SphereLight(PointLight):
    """Light from a sphere.

    Parameters
    ----------
    position : centre of the sphere, (x, y, z) in scene units.
    radius : of the sphere, > 0. Its shadow is as soft as that of a sphere of this size.
    color : see `Light`.
    intensity : brightness at distance 1 from the centre, >= 0.
    shadow, penumbra, range, shadow_radius, attenuation : see `PointLight`.
    visible : whether camera rays, mirrors and refraction show the sphere, with a radiance of intensity / radius^2. It
        needs no node, and casts no shadow. In scenes with bounces, its shadow is sampled, whatever its `penumbra`; and
        so is its light without a shadow, where a material is smoother than a roughness of 0.4: mirrors show it then
        through solids.

    Raises
    ------
    SceneError : a value outside its range.

    Notes
    -----
    A diffuse surface is lit exactly by the part of the sphere above its horizon. Points within the sphere receive no
    light. Highlights are those of a point, unless the light is sampled.
    """

    visible: bool

    LABEL = "sphere lights"

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
        visible: bool = False,
    ) -> None:
        given = as_number("SphereLight: radius", radius, LEAST_LENGTH)
        PointLight.__init__(
            self, position, color, intensity, shadow, given, penumbra, range, shadow_radius, attenuation
        )
        self._set(visible=switch("SphereLight: visible", visible))

    @property
    def cut_by_horizon(self) -> bool:
        return not (self.shadow and self.penumbra == "sampled")

    def emitter_values(self) -> dict[str, Expr]:
        return {**PointLight.emitter_values(self), "radius": self.radius}

    @staticmethod
    def sample_direction(values: Mapping[str, Expr], p: Expr, u: Expr, far: Expr) -> DirectionSample:
        found = PointLight.sample_direction(values, p, u, far)
        return found._replace(radiance=where(found.distance > values["radius"], found.radiance, vec3(0.0)))

    @staticmethod
    def eval_ray(values: Mapping[str, Expr], p: Expr, direction: Expr) -> RayHit:
        to_centre, radius = values["position"] - p, values["radius"]
        middle = dot(to_centre, direction)
        side = to_centre - middle * direction
        inside = radius * radius - dot(side, side)
        half = sqrt(max(inside, 0.0))
        distance = where((inside > 0.0) & (middle > half), middle - half, -1.0)
        return RayHit(distance, half / radius, values["radiance"] / (radius * radius))


@value
class RectLight(Light):
    """Light from one side of a rectangle.

    One random point of it lights each sample, so its light and shadow are exact but noisy: it needs
    `Quality(samples=...)` or several frames. In scenes with physical materials smoother than a roughness of 0.4, one
    random direction of the highlight is sampled too, and both are weighted by the power heuristic (Veach and Guibas
    1995).

    Parameters
    ----------
    position : centre of the rectangle, (x, y, z) in scene units.
    width, height : edges of the rectangle, > 0.
    direction : direction in which it shines, any length but 0. None for (0, -1, 0), straight down.
    up : direction of its height, any length but 0, not parallel to `direction`. None for y, or z if it shines along y.
    color : see `Light`.
    intensity : brightness at distance 1 from a small rectangle, >= 0.
    shadow : see `Light`.
    range : distance from a point of the rectangle beyond which it lights nothing; see `PointLight`.
    visible : whether camera rays, mirrors and refraction show the side that shines, with a radiance of
        pi * intensity / (width * height). It needs no node, and casts no shadow. The other side is never seen.
    target : the point at which it shines, (x, y, z), in place of `direction`.

    Raises
    ------
    SceneError : a value outside its range, and `direction` together with `target`.

    Notes
    -----
    A point at distance d adds intensity * cos(angle to `direction`) / d^2.
    """

    position: Expr
    width: Expr
    height: Expr
    direction: Expr
    up: Expr | None
    range: Expr | None
    visible: bool
    target: Expr | None

    LABEL = "rectangular lights"

    def __init__(
        self,
        position: Vec3Like,
        width: Scalar = 1.0,
        height: Scalar = 1.0,
        direction: Vec3Like | None = None,
        up: Vec3Like | None = None,
        color: ColorLike = (1.0, 1.0, 1.0),
        intensity: Scalar = 1.0,
        shadow: bool = False,
        range: Scalar | None = None,
        visible: bool = False,
        target: Vec3Like | None = None,
    ) -> None:
        Light.__init__(self, color, intensity, shadow, 0.0, "sampled")
        place = as_vec3("RectLight: position", position)
        self._set(
            visible=switch("RectLight: visible", visible),
            range=optional(as_number, "RectLight: range", range, LEAST_LENGTH),
            position=place,
            width=as_number("RectLight: width", width, low=LEAST_LENGTH),
            height=as_number("RectLight: height", height, low=LEAST_LENGTH),
            **_aim("RectLight", place, direction, target),
        )
        self._set(up=optional(as_direction, "RectLight: up", up))
        right = cross(self.direction, self.upright)
        if right.is_constant and float(np.linalg.norm(right.data)) < 1e-6:
            raise SceneError(f"RectLight: up = {short(up)}", legal="a direction that is not parallel to `direction`")

    @property
    def upright(self) -> Expr:
        """The direction of its height, before it is made perpendicular to that in which it shines."""
        if self.up is not None:
            return self.up
        return where(abs(self.direction.y) > 0.999, const((0.0, 0.0, 1.0)), const((0.0, 1.0, 0.0)))

    @property
    def reach(self) -> tuple[Expr, Expr] | None:
        if self.range is None:
            return None
        return self.position, self.range + 0.5 * sqrt(self.width * self.width + self.height * self.height)

    def emitter_values(self) -> dict[str, Expr]:
        right = normalize(cross(self.direction, self.upright))
        across, along = self.width * right, self.height * cross(right, self.direction)
        return {
            "position": self.position,
            **Light.emitter_values(self),
            "normal": self.direction,
            "across": across,
            "along": along,
            **({} if self.range is None else {"range": self.range}),
        }

    @staticmethod
    def sample_direction(values: Mapping[str, Expr], p: Expr, u: Expr, far: Expr) -> DirectionSample:
        place = values["position"] + (u.x - 0.5) * values["across"] + (u.y - 0.5) * values["along"]
        to_light = place - p
        squared = max(dot(to_light, to_light), SMALLEST)
        distance = sqrt(squared)
        direction = to_light / distance
        falloff = max(-dot(direction, values["normal"]), 0.0) / squared
        if "range" in values:
            falloff = falloff * _window(distance, values["range"])
        return DirectionSample(direction, distance, falloff * values["radiance"])

    @staticmethod
    def eval_direction(values: Mapping[str, Expr], p: Expr, direction: Expr, far: Expr) -> DirectionSample:
        met, distance, cosine = _on_rectangle(values, p, direction)
        falloff = cosine / max(distance * distance, SMALLEST)
        if "range" in values:
            falloff = falloff * _window(distance, values["range"])
        return DirectionSample(direction, distance, where(met, falloff * values["radiance"], vec3(0.0)))

    @staticmethod
    def eval_ray(values: Mapping[str, Expr], p: Expr, direction: Expr) -> RayHit:
        met, distance, cosine = _on_rectangle(values, p, direction)
        area = length(values["across"]) * length(values["along"])
        return RayHit(where(met, distance, -1.0), cosine, math.pi / area * values["radiance"])

    @staticmethod
    def pdf_direction(values: Mapping[str, Expr], p: Expr, sample: DirectionSample) -> Expr:
        area = length(values["across"]) * length(values["along"])
        cosine = max(-dot(sample.direction, values["normal"]), SHORTEST)
        return sample.distance * sample.distance / (area * cosine)


def _on_rectangle(values: Mapping[str, Expr], p: Expr, direction: Expr) -> tuple[Expr, Expr, Expr]:
    """Whether a ray meets the side of a rectangle that shines, its distance, and the cosine to its normal."""
    across, along, normal = values["across"], values["along"], values["normal"]
    to_centre, cosine = values["position"] - p, -dot(direction, normal)
    distance = -dot(to_centre, normal) / max(cosine, SHORTEST)
    place = distance * direction - to_centre
    u, v = dot(place, across) / dot(across, across), dot(place, along) / dot(along, along)
    return (min(cosine, distance) > SHORTEST) & (max(abs(u), abs(v)) <= 0.5), distance, cosine


KINDS = (Sun, PointLight, SpotLight, SphereLight, RectLight)
"""The kinds of lights of raymarch."""


def _window(distance: Expr, range: Expr) -> Expr:
    """The factor (1 - (d/range)^4)^2 that makes an inverse square 0 at a range (Karis 2013)."""
    ratio = distance / range
    window = max(1.0 - ratio * ratio * ratio * ratio, 0.0)
    return window * window


def hard(light: Light) -> Light:
    """The same light with hard shadows. A SphereLight becomes a PointLight at its centre, and a RectLight tiny."""
    if isinstance(light, RectLight):
        return light.replace(width=LEAST_LENGTH, height=LEAST_LENGTH, visible=False)
    if isinstance(light, SphereLight):
        return PointLight(**{n: v for n, v in light.arguments().items() if n not in ("radius", "visible")})
    return light.replace(**{"radius" if isinstance(light, PointLight) else "softness": 0.0})
