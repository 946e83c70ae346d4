"""Lights. A light casts a shadow only with `shadow=True`.

`intensity` has one meaning for all lights. A white diffuse surface at right angles to the light, at distance 1 from a
light that has a position, has the value 1 at intensity 1. In physical units the irradiance of a sun is pi * color *
intensity, and so is the radiant intensity of a point light.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import ClassVar, NamedTuple, cast

import numpy as np

from raymarch.errors import SceneError
from raymarch.expr.arrays import SHORTEST, SMALLEST
from raymarch.expr.convert import choice, optional, short, switch
from raymarch.expr.function import function
from raymarch.expr.limits import Limit, limited
from raymarch.expr.node import Expr, const, expr, var
from raymarch.expr.types import BOOL, FLOAT, VEC2, VEC3, struct
from raymarch.expr.vocabulary import (
    acos,
    asin,
    atan,
    clamp,
    cos,
    cross,
    dot,
    get,
    length,
    max,
    min,
    normalize,
    record,
    sin,
    sqrt,
    vec3,
    where,
)
from raymarch.expr.walk import free_variables
from raymarch.scene.parameter import LEAST_LENGTH, as_color, as_direction, as_number, as_vec3, is_zero
from raymarch.scene.value import Part, value
from raymarch.sdf.domain import ColorLike, Scalar, Vec3Like

POINT = var("p", VEC3)
"""The point of a surface that a light is evaluated for."""

SAMPLE = var("u", VEC2)
"""Two random numbers in [0, 1), uniform and independent."""

FAR = var("far", FLOAT)
"""A distance that no two points of the scene exceed."""

DIRECTION = var("wi", VEC3)
"""A direction in which a light is sought."""


class DirectionSample(NamedTuple):
    """The light of an emitter at a point of a surface.

    Parameters
    ----------
    direction : unit vector towards the light, along which the shadow ray runs.
    distance : length of the shadow ray, > 0.
    radiance : linear RGB >= 0, reflected by a white diffuse surface that faces the light: irradiance / pi. Where it is
        0, no shadow ray is traced.
    """

    direction: Expr
    distance: Expr
    radiance: Expr


@function(normal=VEC3, local=VEC3)
def to_world(normal: Expr, local: Expr) -> Expr:
    """A vector about z, about a normal: the branchless basis of Duff et al. (2017)."""
    s = where(normal.z < 0.0, -1.0, 1.0)
    a = -1.0 / (s + normal.z)
    b = normal.x * normal.y * a
    tangent = vec3(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x)
    bitangent = vec3(b, s + normal.y * normal.y * a, -normal.y)
    return local.x * tangent + local.y * bitangent + local.z * normal


LIGHT = struct("Light", (("direction", VEC3), ("distance", FLOAT), ("radiance", VEC3)))
"""The struct of a `DirectionSample`."""

DIRECTION_SAMPLE = var("light_sample", LIGHT)
"""A sample of a light, of which the density is asked."""


class RayHit(NamedTuple):
    """The first point of a visible light on a ray.

    Attributes
    ----------
    distance : from the ray's origin, negative if the ray misses the light.
    cosine : of the angle between the ray and the light's surface normal, > 0.
    radiance : linear RGB, what a ray that ends there shows.
    """

    distance: Expr
    cosine: Expr
    radiance: Expr


LIGHT_HIT = struct("LightHit", (("distance", FLOAT), ("cosine", FLOAT), ("radiance", VEC3)))
"""The struct of a `RayHit`."""


@function(light=LIGHT, width=FLOAT, u=VEC2)
def sample_disc(light: Expr, width: Expr, u: Expr) -> Expr:
    """A random point of a light's disc, for a hard shadow and BSDF evaluation of its own.

    The mean over u converges to the whole disc. width : sine of its angular radius. Points are uniform on the
    projection of the light's sphere to a plane perpendicular to the light's direction. Each is weighted by 1 / cosine
    for its solid angle, so that a diffuse surface is as bright as under a point light. The shadow ray ends at the
    sphere's surface.
    """
    r, turn = min(width, 0.999) * sqrt(u.x), 2.0 * math.pi * u.y
    c = sqrt(1.0 - r * r)
    direction = to_world(get(light, "direction"), vec3(r * cos(turn), r * sin(turn), c))
    return record(LIGHT, direction, _to_sphere(light, width, r * r, c), get(light, "radiance") / c)


def _to_sphere(light: Expr, width: Expr, squared_sine: Expr, cosine: Expr) -> Expr:
    """The distance to a light's sphere in a direction at an angle to its middle; 0 within the sphere."""
    return max(get(light, "distance") * (cosine - sqrt(max(width * width - squared_sine, 0.0))), 0.0)


@function(light=LIGHT, width=FLOAT, direction=VEC3)
def eval_disc(light: Expr, width: Expr, direction: Expr) -> Expr:
    """The point of a light's disc in a direction, as `sample_disc` gives it; radiance 0 beside the disc."""
    axis = get(light, "direction")
    side, cosine = cross(axis, direction), dot(axis, direction)
    limit = min(width, 0.999)
    squared = dot(side, side)
    met = (cosine > 0.0) & (squared <= limit * limit)
    radiance = where(met, get(light, "radiance") / max(cosine, SMALLEST), vec3(0.0))
    return record(LIGHT, direction, _to_sphere(light, width, squared, cosine), radiance)


@function(light=LIGHT, width=FLOAT, direction=VEC3)
def pdf_disc(light: Expr, width: Expr, direction: Expr) -> Expr:
    """The density of the directions of `sample_disc`, per solid angle, for a direction that meets the disc."""
    limit = min(width, 0.999)
    return max(dot(get(light, "direction"), direction), 0.0) / (math.pi * max(limit * limit, SMALLEST))


def _elevations(light: Expr, width: Expr, normal: Expr) -> tuple[Expr, Expr, Expr]:
    """Of a sphere: whether a surface's horizon cuts it, the elevation of its middle, and that of its visible part."""
    cosine = dot(normal, get(light, "direction"))
    elevation = asin(clamp(cosine, -1.0, 1.0))
    return abs(cosine) < width, elevation, 0.5 * (elevation + asin(min(width, 1.0)))


@function(light=LIGHT, width=FLOAT, normal=VEC3)
def above_horizon(light: Expr, width: Expr, normal: Expr) -> Expr:
    """The direction to the middle of the part of a light's sphere that a surface sees, and the distance there.

    width : sine of the sphere's angular radius.
    """
    cut, elevation, visible = _elevations(light, width, normal)
    direction = get(light, "direction")
    level = direction - sin(elevation) * normal
    bent = cos(visible) / max(length(level), 1e-6) * level + sin(visible) * normal
    turned = where(cut, sin(visible - elevation), 0.0)
    distance = _to_sphere(light, width, turned * turned, sqrt(1.0 - turned * turned))
    return record(LIGHT, where(cut, bent, direction), distance, get(light, "radiance"))


@function(light=LIGHT, width=FLOAT, normal=VEC3)
def part_above_horizon(light: Expr, width: Expr, normal: Expr) -> Expr:
    """The irradiance of a light's sphere that a surface's horizon cuts, over that of its whole disc in the direction of
    `above_horizon`; 1 where it is not cut.

    The form factor of a sphere (Snyder 1996), written without differences of nearly equal numbers.
    """
    cut, elevation, visible = _elevations(light, width, normal)
    squared, cosine = max(width * width, SMALLEST), sin(elevation)
    sine = sqrt(max(1.0 - cosine * cosine, 0.0))
    x = sqrt(max(1.0 / squared - 1.0, 1e-8))
    y = clamp(-x * cosine / max(sine, 1e-6), -1.0, 1.0)
    a = sine * sqrt(1.0 - y * y) / x
    small = a - a * a * a * (1.0 / 3.0 - a * a * (0.2 - a * a * (1.0 / 7.0 - a * a / 9.0))) / squared
    factor = (cosine * acos(y) + where(a < 0.25, small, atan(a) / squared - a * x * x)) / math.pi
    return where(cut, max(factor, 0.0) / max(sin(visible), 1e-6), 1.0)


@function(lobe=BOOL, of_light=FLOAT, of_lobes=FLOAT)
def power_heuristic(lobe: Expr, of_light: Expr, of_lobes: Expr) -> Expr:
    """The factor of the light that a sample of a light has alone, if directions of lobes are sampled too.

    The weights of Veach and Guibas (1995) with exponent 2, of the densities p of the light and q of the lobes. A sample
    of the light counts p^2 / (p^2 + q^2). A sample of the lobes counts q^2 / (p^2 + q^2), and has p / q times the value
    of a sample of the light in that direction. lobe : whether it is a sample of the lobes.
    """
    ratio = min(of_lobes / max(of_light, SMALLEST), 1.0 / SHORTEST)
    return where(lobe, ratio, 1.0) / (1.0 + ratio * ratio)


PENUMBRAS = ("two-sided", "cone", "triangulated", "sampled")


@value
class Light(Part):
    """Base class of all lights.

    Parameters
    ----------
    color : linear RGB, each component >= 0.
    intensity : factor of the colour, >= 0.
    shadow : whether the light casts a shadow. False costs nothing.
    softness : size of the light for its shadow, >= 0: `Sun(softness=...)`, the tangent of an angular radius, or the
        `radius` of a light with a position. 0 gives a hard shadow, which is the cheapest.
    penumbra : method for soft shadows.

        - "two-sided": the fraction of the light's disc that obstacles leave visible, from the clearance of one ray, and
          of six more in penumbras. It is one half at the edge of the geometry, and 0 behind what is thin and wide.
        - "cone": the smallest clearance over the radius of the disc (Quilez 2008). It is dark already at the edge of
          the geometry.
        - "triangulated": as "cone", with the clearance between two samples estimated (Aaltonen 2018).
        - "sampled": a hard shadow of one random point of the light. It is correct for all obstacles, and for
          highlights. It is noisy: it needs `Quality(samples=...)` or several frames.

    Raises
    ------
    SceneError : a value outside its range.
    """

    BELONGS: ClassVar[str] = "Scene(lights=[...])"
    color: Expr
    intensity: Expr
    shadow: bool
    softness: Expr
    penumbra: str

    LABEL: ClassVar[str] = "lights"  # what `explain` calls lights of this kind
    visible = False  # whether rays show the light; see `eval_ray`
    shadow_radius = cast("Expr | None", None)  # the distance from the light beyond which surfaces receive no shadow

    def __init__(self, color: ColorLike, intensity: Scalar, shadow: bool, softness: Scalar, penumbra: str) -> None:
        name = type(self).__name__
        self._set(
            color=as_color(f"{name}: color", color),
            intensity=as_number(f"{name}: intensity", intensity, low=0.0),
            shadow=switch(f"{name}: shadow", shadow),
            penumbra=choice(f"{name}: penumbra", penumbra, PENUMBRAS),
            softness=as_number(f"{name}: softness", softness, low=0.0),
        )

    @property
    def radiance(self) -> Expr:
        """Colour times intensity, a vec3."""
        return self.color * self.intensity

    def emitter_values(self) -> dict[str, Expr]:
        """The values that `sample_direction` reads, by name. They do not depend on the point."""
        return {"radiance": self.radiance}

    @staticmethod
    def sample_direction(values: Mapping[str, Expr], p: Expr, u: Expr, far: Expr) -> DirectionSample:
        """The light at a point p, a vec3. Shader and reference evaluate these expressions.

        values : stand for the `emitter_values`. u : a vec2 of two random numbers in [0, 1); the light of a light with
        an area is the mean over u. far : a distance that no two points of the scene exceed.
        """
        raise SceneError("a Light without a kind", legal="a light such as Sun(...), or a class with sample_direction")

    @staticmethod
    def eval_direction(values: Mapping[str, Expr], p: Expr, direction: Expr, far: Expr) -> DirectionSample | None:
        """The light at a point p from a unit direction, as `sample_direction` gives it where it samples that direction.

        The radiance is 0 where the direction misses the light. None if the light cannot be met by a direction.
        """
        return None

    @staticmethod
    def pdf_direction(values: Mapping[str, Expr], p: Expr, sample: DirectionSample) -> Expr | None:
        """The density of `sample_direction` at a sample with radiance, per solid angle. None with `eval_direction`."""
        return None

    @staticmethod
    def eval_ray(values: Mapping[str, Expr], p: Expr, direction: Expr) -> RayHit | None:
        """The first point of the light on a ray from a point p in a unit direction. None for a light without an area.

        A light that is `visible` is shown by it.
        """
        return None

    @property
    def reach(self) -> tuple[Expr, Expr] | None:
        """Centre and radius of a ball beyond which the radiance is 0; None for a light without such a limit.

        Of many lights, only those that reach a surface are evaluated there.
        """
        return None

    @property
    def has_position(self) -> bool:
        """True if the light has a `position`: its softness is a radius, else the tangent of an angular radius."""
        return any(field.name == "position" for field in fields(self))

    @property
    def soft(self) -> bool:
        """True if the shadow has a penumbra."""
        return self.shadow and not is_zero(self.softness)

    @property
    def cut_by_horizon(self) -> bool:
        """True if only the part of the light above the surface's horizon counts, which random points do not show."""
        return False

    @property
    def disc_width(self) -> Expr:
        """The radius of a light with a position, else the sine of the angular radius."""
        return self.softness if self.has_position else self.softness / sqrt(1.0 + self.softness * self.softness)


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


@value
class SpotLight(PointLight):
    """Light from one point into a cone.

    Parameters
    ----------
    position : (x, y, z) in scene units.
    direction : direction in which the light shines, any length but 0.
    half_angle : from the axis of the cone to its edge, in radians, above 0 and up to pi.
    blend : fraction of the half angle over which the edge fades, from 0 (sharp) to 1. Let c be the cosine of the angle
        to the axis, c0 its value at the edge and c1 its value where the fade ends: the light is multiplied by
        ((c - c0) / (c1 - c0))^2.
    color, intensity, shadow, radius, penumbra, range, shadow_radius, attenuation : see `PointLight`.

    Raises
    ------
    SceneError : a value outside its range.
    """

    direction: Expr
    half_angle: Expr
    blend: Expr

    LABEL = "spot lights"

    def __init__(
        self,
        position: Vec3Like,
        direction: Vec3Like = (0.0, -1.0, 0.0),
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
    ) -> None:
        PointLight.__init__(
            self, position, color, intensity, shadow, radius, penumbra, range, shadow_radius, attenuation
        )
        self._set(
            direction=as_direction("SpotLight: direction", direction),
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
        needs no node, and casts no shadow. In scenes with bounces, its shadow is sampled, whatever its `penumbra`.

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
    direction : direction in which it shines, any length but 0.
    up : direction of its height, any length but 0, not parallel to `direction`. None for y, or z if it shines along y.
    color : see `Light`.
    intensity : brightness at distance 1 from a small rectangle, >= 0.
    shadow : see `Light`.
    range : distance from a point of the rectangle beyond which it lights nothing; see `PointLight`.
    visible : whether camera rays, mirrors and refraction show the side that shines, with a radiance of
        pi * intensity / (width * height). It needs no node, and casts no shadow. The other side is never seen.

    Raises
    ------
    SceneError : a value outside its range.

    Notes
    -----
    A point at distance d adds intensity * cos(angle to `direction`) / d^2.
    """

    position: Expr
    width: Expr
    height: Expr
    direction: Expr
    up: Expr
    range: Expr | None
    visible: bool

    LABEL = "rectangular lights"

    def __init__(
        self,
        position: Vec3Like,
        width: Scalar = 1.0,
        height: Scalar = 1.0,
        direction: Vec3Like = (0.0, -1.0, 0.0),
        up: Vec3Like | None = None,
        color: ColorLike = (1.0, 1.0, 1.0),
        intensity: Scalar = 1.0,
        shadow: bool = False,
        range: Scalar | None = None,
        visible: bool = False,
    ) -> None:
        Light.__init__(self, color, intensity, shadow, 0.0, "sampled")
        self._set(
            visible=switch("RectLight: visible", visible),
            range=optional(as_number, "RectLight: range", range, LEAST_LENGTH),
            position=as_vec3("RectLight: position", position),
            width=as_number("RectLight: width", width, low=LEAST_LENGTH),
            height=as_number("RectLight: height", height, low=LEAST_LENGTH),
            direction=as_direction("RectLight: direction", direction),
        )
        upright = where(abs(self.direction.y) > 0.999, const((0.0, 0.0, 1.0)), const((0.0, 1.0, 0.0)))
        self._set(up=upright if up is None else as_direction("RectLight: up", up))
        right = cross(self.direction, self.up)
        if right.is_constant and float(np.linalg.norm(right.data)) < 1e-6:
            raise SceneError(f"RectLight: up = {short(up)}", legal="a direction that is not parallel to `direction`")

    @property
    def reach(self) -> tuple[Expr, Expr] | None:
        if self.range is None:
            return None
        return self.position, self.range + 0.5 * sqrt(self.width * self.width + self.height * self.height)

    def emitter_values(self) -> dict[str, Expr]:
        right = normalize(cross(self.direction, self.up))
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


def sample_of(light: Light, values: Mapping[str, Expr] | None = None) -> DirectionSample:
    """The `sample_direction` of a light at `POINT`, checked. SceneError if it is not of the types of DirectionSample.

    values : stand for its `emitter_values`; None for these themselves.
    """
    legal = "a DirectionSample(direction, distance, radiance) of a vec3, a float and a vec3, made of its arguments"
    found = light.sample_direction(light.emitter_values() if values is None else values, POINT, SAMPLE, FAR)
    what = f"{type(light).__name__}.sample_direction gives"
    if not isinstance(found, DirectionSample):
        raise SceneError(f"{what} {short(found)}", legal=legal, where=light.where)
    made = DirectionSample(*map(expr, found))
    types = [part.type for part in made]
    if types != [VEC3, FLOAT, VEC3]:
        raise SceneError(f"{what} {', '.join(map(str, types))}", legal=legal, where=light.where)
    return made


def has_area(light: Light) -> bool:
    """True if random points of a light give its light."""
    return SAMPLE in free_variables(sample_of(light))


def density_of(light: Light, values: Mapping[str, Expr] | None = None) -> tuple[DirectionSample, Expr] | None:
    """A light's `eval_direction` at `POINT` and `DIRECTION`, and its `pdf_direction` of `DIRECTION_SAMPLE`, checked.

    None if the light cannot be met by a direction, or if a class derived from that of `eval_direction` or
    `pdf_direction` has another `sample_direction`. values : as for `sample_of`.
    """
    names = ("sample_direction", "eval_direction", "pdf_direction")
    depth = [next(i for i, cls in enumerate(type(light).__mro__) if name in vars(cls)) for name in names]
    given = light.emitter_values() if values is None else values
    sample = DirectionSample(*(get(DIRECTION_SAMPLE, name) for name in DirectionSample._fields))
    met, pdf = light.eval_direction(given, POINT, DIRECTION, FAR), light.pdf_direction(given, POINT, sample)
    if depth[0] < depth[1] or depth[0] < depth[2] or met is None or pdf is None:
        return None
    types = [expr(part).type for part in (*met, pdf)]
    if types != [VEC3, FLOAT, VEC3, FLOAT]:
        what = f"{type(light).__name__}.eval_direction and pdf_direction give {', '.join(map(str, types))}"
        legal = "a DirectionSample(direction, distance, radiance) of a vec3, a float and a vec3; and a float"
        raise SceneError(what, legal=legal, where=light.where)
    return DirectionSample(*map(expr, met)), expr(pdf)


def has_disc(light: Light, bounces: bool) -> bool:
    """True if random points of a disc cast its shadow: where rays bounce, of visible lights, as mirrors show them."""
    return light.soft and (light.penumbra == "sampled" or (bounces and light.visible))


def ray_hit_of(light: Light, values: Mapping[str, Expr]) -> RayHit | None:
    """The `eval_ray` of a visible light at `POINT` and `DIRECTION`; None for a light that is not visible.

    values : stand for its `emitter_values`.
    """
    return light.eval_ray(values, POINT, DIRECTION) if light.visible else None


def hard(light: Light) -> Light:
    """The same light with hard shadows. A SphereLight becomes a PointLight at its centre, and a RectLight tiny."""
    if isinstance(light, RectLight):
        return light.replace(width=LEAST_LENGTH, height=LEAST_LENGTH, visible=False)
    if isinstance(light, SphereLight):
        return PointLight(**{n: v for n, v in light.arguments().items() if n not in ("radius", "visible")})
    return light.replace(**{"radius" if isinstance(light, PointLight) else "softness": 0.0})


def _window(distance: Expr, range: Expr) -> Expr:
    """The factor (1 - (d/range)^4)^2 that makes an inverse square 0 at a range (Karis 2013)."""
    ratio = distance / range
    window = max(1.0 - ratio * ratio * ratio * ratio, 0.0)
    return window * window
