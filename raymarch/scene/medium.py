"""Participating media: matter in a box that absorbs and scatters light, such as clouds and smoke.

The radiative transfer equation with single scattering (Chandrasekhar 1960; Pharr, Jakob and Humphreys 2023, chapter
14), as functions of the expression language: midpoint rules along the camera ray, and from its points to each light.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np

from raymarch.errors import Location, SceneError
from raymarch.expr.convert import called, described, integer, optional, switch
from raymarch.expr.function import Function, loop, trace, unique_function
from raymarch.expr.node import Expr, Operand, const, expr, var
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import abs, dot, exp, max, min, sqrt, vec2, vec3
from raymarch.expr.vocabulary import where as choose
from raymarch.expr.walk import free_variables, substitute
from raymarch.scene.fog import COLOR, LENGTH, ORIGIN, Atmosphere
from raymarch.scene.light import FAR, POINT, SAMPLE, Light, sample_of
from raymarch.scene.parameter import as_color, as_number
from raymarch.scene.sky import DIRECTION, Sky
from raymarch.scene.value import value
from raymarch.sdf.domain import ColorLike, Scalar, Vector, as_operand, corners_of

PLACE = var("p", VEC3)
"""The point at which a density is evaluated."""
AXES = [sign * np.eye(3)[axis] for axis in range(3) for sign in (1.0, -1.0)]
"""Directions over which the light of a sky is averaged."""
DARK = 20.0
"""The optical depth at which a ray to a light ends."""
OPAQUE = 1e-3
"""A ray of which less is transmitted ends."""
MOST_TURNS = 60_000
"""Points at which a pixel may ask for the density: software renderers end loops at 65,535 turns in all."""
DENSITY = "a number >= 0, or a function of a point in functions of raymarch, such as lambda p: 4 * rm.fbm(p)"
KINDS = f"{DENSITY}; of an array rm.sampled(array, size), in a solid lambda p: 9 * rm.max(-node.distance(p), 0)"
BOUNDS = "two corners (lower, upper), each finite and lower < upper"


@value
class Medium(Atmosphere):
    """Matter in a box that absorbs and scatters light: a cloud, smoke, or murky air.

    Parameters
    ----------
    density : extinction per unit of length, >= 0: a number, or a function from a point, a vec3 expression, to a number.
        Values below 0 count as 0.
    bounds : the box that holds it: two corners (lower, upper).
    albedo : fraction of the extinction that is scattered, linear RGB, each 0 to 1. The rest is absorbed.
    anisotropy : mean cosine of the angle of scattering, -0.99 to 0.99: 0 scatters evenly, above 0 forwards.
    steps : number of points along a camera ray, 1 to 4096.
    light_steps : number of points along a ray to a light, 1 to 256.
    ambient : radiance that reaches all points from all sides, linear RGB, each >= 0. None is the mean of the sky along
        the axes if the sky lights the scene, else 0.
    shadow : whether it dims the light of lights on surfaces, by `light_steps` points a light.

    Raises
    ------
    SceneError : a value outside its range, or a function that fails or does not give a number.

    Notes
    -----
    Light is scattered once, with the phase function of Henyey and Greenstein (1941). Lights have their intensity at the
    point, dimmed by the medium; lights with an area count by their middle. Surfaces cast no shadow on the medium. Of
    the rays for reflections, glass and indirect light, none passes it but the one from the camera.

    Examples
    --------
    >>> cloud = rm.Medium(lambda p: 8 * rm.fbm(2 * p), bounds=((-2, 0, -1), (2, 1, 1)), ambient=(0.3, 0.4, 0.5))
    >>> scene = rm.Scene(rm.plane(offset=-1), lights=[rm.Sun()], fog=cloud)
    """

    BELONGS: ClassVar[str] = "Scene(fog=...)"
    density: Expr | Function
    bounds: tuple[tuple[float, float, float], tuple[float, float, float]]
    albedo: Expr
    anisotropy: Expr
    steps: int
    light_steps: int
    ambient: Expr | None
    shadow: bool

    def __init__(
        self,
        density: Scalar | Callable[[Expr], Operand],
        bounds: Sequence[Vector],
        albedo: ColorLike = (1.0, 1.0, 1.0),
        anisotropy: Scalar = 0.0,
        steps: int = 48,
        light_steps: int = 8,
        ambient: ColorLike | None = None,
        shadow: bool = False,
    ) -> None:
        corners = corners_of("Medium: bounds", bounds, BOUNDS)
        if not np.all(np.isfinite(corners)):
            raise SceneError(f"Medium: bounds = {described(bounds)}", legal=BOUNDS)
        low, high = (tuple(float(x) for x in corner) for corner in corners)
        self._set(
            density=_density(density),
            bounds=(low, high),
            albedo=as_color("Medium: albedo", albedo, high=1.0),
            anisotropy=as_number("Medium: anisotropy", anisotropy, low=-0.99, high=0.99),
            steps=integer("Medium: steps", steps, 1, 4096),
            light_steps=integer("Medium: light_steps", light_steps, 1, 256),
            ambient=optional(as_color, "Medium: ambient", ambient),
            shadow=switch("Medium: shadow", shadow),
        )

    @property
    def covers_sky(self) -> bool:
        return True

    @property
    def lit(self) -> bool:
        return True

    @property
    def box(self) -> Sequence[Sequence[float]]:
        return self.bounds

    def check(self, lights: int) -> None:
        turns = self.steps * (1 + self.light_steps * lights)
        if turns > MOST_TURNS:
            what = f"Medium: steps = {self.steps}, light_steps = {self.light_steps} and lights: {lights}"
            legal = f"steps * (1 + light_steps * lights) <= {MOST_TURNS}"
            raise SceneError(f"{what}, {turns} points a pixel", legal=legal, where=self.where)

    @property
    def expressions(self) -> list[Expr]:
        """All values that may depend on parameters or time."""
        own = self.density.body if isinstance(self.density, Function) else self.density
        return [own, self.albedo, self.anisotropy, *([] if self.ambient is None else [self.ambient])]

    def absorbing(self) -> Medium:
        """The same, but it scatters no light."""
        return self.replace(albedo=(0.0, 0.0, 0.0))

    def moved(self, origin: Any) -> Medium:
        """The same medium, relative to an origin."""
        density = self.density
        if isinstance(density, Function):
            place = PLACE + const(origin)
            density = unique_function(density.name, (PLACE,), density.inline(place), {}, density.where)
        low, high = (tuple(np.asarray(corner) - origin) for corner in self.bounds)
        return self.replace(density=density, bounds=(low, high))

    def applied(self, sky: Sky, lights: Sequence[Light], where: Location | None) -> Expr:
        """The radiance that arrives at ORIGIN of COLOR: what is transmitted of it, and what is scattered on the way.

        A step scatters albedo * source * (1 - its transmittance), which is exact where source and density are constant
        over it.
        """
        begin, end = _within(self.bounds, ORIGIN, DIRECTION, LENGTH)
        width = max(end - begin, 0.0) / self.steps
        ambient = self._ambient(sky)

        def step(i: Expr, light: Expr, transmittance: Expr) -> tuple[Expr, Expr]:
            at = ORIGIN + (begin + (i + 0.5) * width) * DIRECTION
            density = self._at(at)
            source = ambient
            for each in lights:
                source = source + self._from_light(each, at, density)
            passed = exp(-density * width)
            return light + transmittance * (1.0 - passed) * source, transmittance * passed

        def until(_: Expr, __: Expr, transmittance: Expr) -> Expr:
            return (width <= 0.0) | (transmittance < OPAQUE)

        light, transmittance = loop(self.steps, (vec3(0.0), 1.0), step, until)
        return self.albedo * light + transmittance * COLOR

    def transmittance(self, p: Expr, wi: Expr, distance: Expr) -> Expr | None:
        """The fraction of a light in a direction that reaches a point of a surface; None if lights are not dimmed."""
        return exp(-self._depth(p, wi, distance)) if self.shadow else None

    def _depth(self, at: Expr, direction: Expr, distance: Expr, needless: Expr | None = None) -> Expr:
        """The optical depth along a ray. needless : where it may be left out."""
        begin, end = _within(self.bounds, at, direction, distance)
        width = max(end - begin, 0.0) / self.light_steps

        def until(_: Expr, depth: Expr) -> Expr:
            over = (width <= 0.0) | (depth > DARK)
            return over if needless is None else over | needless

        def step(i: Expr, depth: Expr) -> tuple[Expr]:
            return (depth + self._at(at + (begin + (i + 0.5) * width) * direction) * width,)

        return loop(self.light_steps, (0.0,), step, until)[0]

    def _at(self, place: Expr) -> Expr:
        return max(self.density(place) if isinstance(self.density, Function) else self.density, 0.0)

    def _ambient(self, sky: Sky) -> Expr:
        if self.ambient is not None:
            return self.ambient
        if not sky.lights:
            return vec3(0.0)
        total = vec3(0.0)
        for axis in AXES:
            total = total + substitute([sky.lighting], {DIRECTION: const(axis)})[0]
        return total / float(len(AXES))

    def _from_light(self, light: Light, at: Expr, density: Expr) -> Expr:
        """The radiance that a light adds at a point per scattered part, in the direction to the ray's origin."""
        known = {POINT: at, SAMPLE: vec2(0.5, 0.5), FAR: expr(1e20)}
        direction, distance, radiance = substitute(list(sample_of(light)), known)
        depth = self._depth(at, direction, distance, density <= 0.0)
        g = self.anisotropy
        spread = max(1.0 + g * g - 2.0 * g * dot(direction, DIRECTION), 1e-4)
        # pi times the phase function: `radiance` is that of a white diffuse surface, the irradiance over pi
        phase = 0.25 * (1.0 - g * g) / (spread * sqrt(spread))
        return phase * exp(-depth) * radiance


def _density(given: Any) -> Expr | Function:
    """The density as a number, or as a function of `PLACE`."""
    if isinstance(given, Function):
        return given
    if isinstance(given, Expr) or not callable(given):
        as_operand("Medium: density", given, KINDS)
        return as_number("Medium: density", given, low=0.0)

    def of_point(p: Expr) -> Expr:
        made = called("Medium: density", given, p, legal=DENSITY)
        return as_operand("Medium: the value of the density", made, DENSITY)

    code = getattr(given, "__code__", of_point.__code__)
    made = trace("medium_density", of_point, [("p", VEC3)], code)
    if made.type is not FLOAT:
        raise SceneError(f"Medium: the density gives a {made.type}", legal=DENSITY, where=made.where)
    if set(free_variables([made.body])) - {*made.params}:
        raise SceneError("Medium: the density depends on more than the point", legal=DENSITY, where=made.where)
    return made


def _within(bounds: Any, origin: Expr, direction: Expr, length: Expr) -> tuple[Expr, Expr]:
    """Where a ray of a length enters and leaves a box; it leaves before it enters if it misses the box."""
    low, high = map(const, bounds)
    rate = _never_parallel(direction)
    a, b = (low - origin) / rate, (high - origin) / rate
    first, last = min(a, b), max(a, b)
    begin = max(max(first.x, max(first.y, first.z)), 0.0)
    return begin, min(min(last.x, min(last.y, last.z)), length)


def _never_parallel(direction: Expr) -> Expr:
    """A direction without components so small that a quotient is infinite."""
    return vec3(*(choose(abs(x) < 1e-20, 1e-20, x) for x in direction))
