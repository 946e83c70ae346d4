"""Lights. A light casts a shadow only with `shadow=True`.

`intensity` has one meaning for all lights. A white diffuse surface at right angles to the light, at distance 1 from a
light that has a position, has the value 1 at intensity 1. In physical units the irradiance of a sun is pi * color *
intensity, and so is the radiant intensity of a point light.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, ClassVar, NamedTuple, TypeAlias, cast

from raymarch.errors import SceneError
from raymarch.expr.arrays import SHORTEST, SMALLEST
from raymarch.expr.convert import choice, short, switch
from raymarch.expr.function import function
from raymarch.expr.node import Expr, expr, var
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
    record,
    sin,
    sqrt,
    vec3,
    where,
)
from raymarch.expr.walk import free_variables
from raymarch.scene.parameter import as_color, as_number, is_zero
from raymarch.scene.value import Part, value
from raymarch.sdf.domain import ColorLike, Scalar

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

    def arguments(self) -> dict[str, Any]:
        found = Part.arguments(self)
        return found | {"direction": None} if found.get("target") is not None else found

    def _unchanged(self, changes: dict[str, Any]) -> dict[str, Any]:
        """The arguments without changes. A new direction drops the target, and a new target the direction."""
        aims = {"target", "direction"}
        return {n: None if n in aims and aims & changes.keys() else v for n, v in self.arguments().items()}

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


Dimming: TypeAlias = Callable[[Expr, Expr, Expr], Expr | None]
"""The fraction of a light that reaches a point, by the point, the direction and the distance; None is all of it."""


def _dimmed(sample: DirectionSample, dimming: Dimming | None) -> DirectionSample:
    share = None if dimming is None else dimming(POINT, sample.direction, sample.distance)
    return sample if share is None else sample._replace(radiance=share * sample.radiance)


def sample_of(
    light: Light, values: Mapping[str, Expr] | None = None, dimming: Dimming | None = None
) -> DirectionSample:
    """The `sample_direction` of a light at `POINT`, checked. SceneError if it is not of the types of DirectionSample.

    values : stand for its `emitter_values`; None for these themselves. dimming : what the light passes.
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
    return _dimmed(made, dimming)


def has_area(light: Light) -> bool:
    """True if random points of a light give its light."""
    return SAMPLE in free_variables(sample_of(light))


def density_of(
    light: Light, values: Mapping[str, Expr] | None = None, dimming: Dimming | None = None
) -> tuple[DirectionSample, Expr] | None:
    """A light's `eval_direction` at `POINT` and `DIRECTION`, and its `pdf_direction` of `DIRECTION_SAMPLE`, checked.

    None if the light cannot be met by a direction, or if a class derived from that of `eval_direction` or
    `pdf_direction` has another `sample_direction`. values, dimming : as for `sample_of`.
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
    return _dimmed(DirectionSample(*map(expr, met)), dimming), expr(pdf)


def ray_hit_of(light: Light, values: Mapping[str, Expr]) -> RayHit | None:
    """The `eval_ray` of a visible light at `POINT` and `DIRECTION`; None for a light that is not visible.

    values : stand for its `emitter_values`.
    """
    return light.eval_ray(values, POINT, DIRECTION) if light.visible else None
