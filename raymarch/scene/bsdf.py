"""BSDFs: how surfaces reflect light, as functions of the expression language. Shader and reference evaluate these.

`eval` is the BSDF times the cosine of the light's direction, as in Mitsuba and pbrt, and times pi: a white diffuse
surface that faces the light has the value 1, as for `Light.intensity`. Directions point away from the surface and have
length 1. Values of materials are expressions by the names of `raymarch.scene.material.FIELDS`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, TypeAlias

from raymarch.errors import SceneError
from raymarch.expr.convert import short
from raymarch.expr.function import Function, function, sum_of
from raymarch.expr.node import Expr, Operand, expr, var
from raymarch.expr.types import FLOAT, VEC2, VEC3, struct
from raymarch.expr.vocabulary import (
    clamp,
    cos,
    cross,
    dot,
    get,
    max,
    min,
    mix,
    normalize,
    pow,
    record,
    sin,
    sqrt,
    vec3,
    where,
)
from raymarch.scene.light import Light, density_of, has_area, has_disc, to_world
from raymarch.scene.material import COAT, FIELDS, GLOSSY, PHONG, PHYSICAL, SMOOTH, Material
from raymarch.scene.quality import Quality

Values: TypeAlias = Mapping[str, Expr]

LEAST_COSINE = 1e-4
"""Least cosine of the view: normals from maps and from differences may face away from it."""

MIN_ALPHA = 1e-3
"""Least alpha towards lights: a perfect mirror would show no point light."""


# Fresnel terms


@function(f0=VEC3, cosine=FLOAT)
def fresnel_schlick(f0: Expr, cosine: Expr) -> Expr:
    """Fresnel reflectance after Schlick (1994), of the reflectance at normal incidence.

    The power is a product: rounding can make 1 - cosine negative.
    """
    x = clamp(1.0 - cosine, 0.0, 1.0)
    square = x * x
    return f0 + (1.0 - f0) * (square * square * x)


@function(cosine=FLOAT, ratio=FLOAT)
def fresnel_dielectric(cosine: Expr, ratio: Expr) -> Expr:
    """Fresnel reflectance of a dielectric for unpolarised light; 1 beyond the critical angle.

    cosine : of the angle of incidence. ratio : index of refraction on the side of incidence over that on the other.
    """
    sine = ratio * ratio * (1.0 - cosine * cosine)
    beyond = sqrt(1.0 - sine)
    upright = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    lying = (cosine - ratio * beyond) / (cosine + ratio * beyond)
    return where(sine >= 1.0, 1.0, 0.5 * (upright * upright + lying * lying))


# Microfacets


@function(normal=VEC3, half_vector=VEC3, alpha=FLOAT)
def d_ggx(normal: Expr, half_vector: Expr, alpha: Expr) -> Expr:
    """GGX distribution of microfacet normals (Walter et al. 2007) times pi.

    The sine comes from a cross product, because 1 - cosine^2 would lose all digits for a nearly smooth surface.
    """
    side = cross(normal, half_vector)
    cosine = dot(normal, half_vector) * alpha
    spread = alpha / (dot(side, side) + cosine * cosine)
    return spread * spread


@function(cosine=FLOAT, alpha=FLOAT)
def smith_root(cosine: Expr, alpha: Expr) -> Expr:
    """cosine * sqrt(1 + alpha^2 tan^2), the root of Smith's masking for GGX."""
    return sqrt(cosine * cosine * (1.0 - alpha * alpha) + alpha * alpha)


@function(n_dot_l=FLOAT, n_dot_v=FLOAT, alpha=FLOAT)
def v_smith(n_dot_l: Expr, n_dot_v: Expr, alpha: Expr) -> Expr:
    """Visibility term G2 / (4 n_dot_l n_dot_v) of GGX: Smith masking, height-correlated (Heitz 2014)."""
    return 0.5 / (n_dot_l * smith_root(n_dot_v, alpha) + n_dot_v * smith_root(n_dot_l, alpha))


@function(n_dot_l=FLOAT, n_dot_v=FLOAT, alpha=FLOAT)
def v_smith_separable(n_dot_l: Expr, n_dot_v: Expr, alpha: Expr) -> Expr:
    """Visibility term of GGX: masking and shadowing are independent (Walter et al. 2007)."""
    return 1.0 / ((n_dot_l + smith_root(n_dot_l, alpha)) * (n_dot_v + smith_root(n_dot_v, alpha)))


@function(cosine=FLOAT, roughness=FLOAT)
def missing_albedo(cosine: Expr, roughness: Expr) -> Expr:
    """Energy that single scattering by white microfacets loses at a cosine: 1 minus their directional albedo.

    A fit to the integral of GGX with correlated masking, between 0.008 below and 0.005 above.
    """
    a, c = max(roughness * roughness, 1e-6), clamp(cosine, 1e-4, 1.0)
    steady = 0.2448 + a * (3.9077 * a - 0.0067)
    linear = 1.3351 + a * (2.9461 * a - 0.281)
    bent = a * (10.9215 - 6.6435 * a) - 1.9867
    above = c * (steady + c * (linear + c * bent))
    steep = a * (1.5333 * a - 0.6629) + c * (0.588 + 3.8876 * a)
    below = a * a * a + c * (a * a * (1.3633 + 7.3622 * a) + c * steep)
    return clamp(a * a * above / below, 0.0, 1.0)


@function(cosine=FLOAT, roughness=FLOAT)
def missing_albedo_separable(cosine: Expr, roughness: Expr) -> Expr:
    """The same for separable masking, between 0.01 below and 0.005 above."""
    a, c = max(roughness * roughness, 1e-6), clamp(cosine, 1e-4, 1.0)
    first = a * (0.0457 + a * (0.2015 + 0.142 * a))
    steady = 4.5024 + a * (2.3809 + 102.1036 * a)
    linear = 52.1098 + a * (7.7107 + 106.6024 * a)
    bent = a * (436.681 - 264.5132 * a) - 88.7519
    above = first + c * (steady + c * (linear + c * bent))
    steep = a * (123.225 * a - 36.7) + c * (16.5361 + 141.6331 * a)
    below = a * a * a + c * (a * a * (58.4572 + 217.8073 * a) + c * steep)
    return clamp(a * a * above / below, 0.0, 1.0)


@function(roughness=FLOAT)
def mean_missing_albedo(roughness: Expr) -> Expr:
    """Cosine-weighted mean over the hemisphere of `missing_albedo`."""
    r = max(roughness, 1e-3)
    above = 9.1786 + r * (7.2436 * r - 13.3576)
    return r * r * (r * r) * above / (1.0 + r * (7.9611 + r * (13.3432 * r - 17.1284)))


@function(roughness=FLOAT)
def mean_missing_albedo_separable(roughness: Expr) -> Expr:
    """Cosine-weighted mean over the hemisphere of `missing_albedo_separable`."""
    r = max(roughness, 1e-3)
    above = 6.9992 + r * (r * (54.3927 - 22.8858 * r) - 31.8371)
    return r * r * (r * r) * above / (1.0 + r * (0.8659 + r * (21.4558 * r - 12.5989)))


def _power(roughness: Expr) -> Expr:
    return 5.0 + roughness * (6.06 * roughness - 7.04)


@function(v=FLOAT, r=FLOAT)
def albedo_f90(v: Expr, r: Expr) -> Expr:
    """Directional albedo of microfacets for Schlick's factor (1 - cosine)^5, the part of the reflectance beyond f0.

    A fit to the integral with correlated masking: at most 0.003 below it and 0.03 above, and 0.1 above where the cosine
    is less than 0.1.
    """
    return pow(max(1.0 - v, 0.0), _power(r)) / (1.0 + r * r * (6.6 + 17.43 * r))


def _mean_albedo_f90(r: Expr) -> Expr:
    """Cosine-weighted mean of `albedo_f90`: 2 times the integral of the cosine times it."""
    power = _power(r)
    return 2.0 / (1.0 + r * r * (6.6 + 17.43 * r)) / ((power + 1.0) * (power + 2.0))


@function(to_light=FLOAT, v=FLOAT, r=FLOAT)
def interface_transmittance(to_light: Expr, v: Expr, r: Expr) -> Expr:
    """Diffuse transmittance of the microfacet interface, over 1 - f0: light enters, is scattered diffusely, and leaves.

    (1 - albedo(to_light)) (1 - albedo(v)) / (1 - mean albedo), with `albedo_f90` (Kelemen and Szirmay-Kalos 2001). For
    smooth surfaces this is 21/20 (1 - (1 - to_light)^5) (1 - (1 - v)^5), the diffuse part of Ashikhmin and Shirley
    (2000).
    """
    return (1.0 - albedo_f90(to_light, r)) * (1.0 - albedo_f90(v, r)) / (1.0 - _mean_albedo_f90(r))


# Sampling


class Random(NamedTuple):
    """Random numbers in [0, 1), uniform and independent.

    direction : a vec2. lobe, model, several, coat : floats that choose between lobes.
    """

    direction: Expr
    lobe: Expr
    model: Expr
    several: Expr
    coat: Expr


RANDOM = Random(var("u", VEC2), *(var(f"u_of_{name}", FLOAT) for name in Random._fields[1:]))
"""Stand for the random numbers of a sample."""

SAMPLE = struct("BsdfSample", (("direction", VEC3), ("weight", VEC3)))
"""A sampled direction, and the BSDF times cosine over the density of the lobe; 0 where the sample carries no light."""


@function(normal=VEC3, u=VEC2)
def sample_cosine(normal: Expr, u: Expr) -> Expr:
    """A direction with the density cosine / pi."""
    r, turn = sqrt(u.x), 2.0 * math.pi * u.y
    return to_world(normal, vec3(r * cos(turn), r * sin(turn), sqrt(1.0 - u.x)))


@function(normal=VEC3, view=VEC3, alpha=FLOAT, u=VEC2)
def sample_visible_normal(normal: Expr, view: Expr, alpha: Expr, u: Expr) -> Expr:
    """A visible GGX microfacet normal, by spherical caps (Dupuy and Benyoub 2023)."""
    tangent, bitangent = to_world(normal, vec3(1.0, 0.0, 0.0)), to_world(normal, vec3(0.0, 1.0, 0.0))
    v = vec3(alpha * dot(view, tangent), alpha * dot(view, bitangent), dot(view, normal))
    stretched = normalize(v)
    turn = 2.0 * math.pi * u.x
    z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z
    s = sqrt(clamp(1.0 - z * z, 0.0, 1.0))
    h = vec3(s * cos(turn), s * sin(turn), z) + stretched
    h = normalize(vec3(alpha * h.x, alpha * h.y, max(h.z, 1e-7)))
    return h.x * tangent + h.y * bitangent + h.z * normal


def pdf_reflected(normal: Expr, view: Expr, light: Expr, alpha: Expr) -> Expr:
    """Density of the reflection at visible normals: G1 D / (4 n_dot_v)."""
    n_dot_v = max(dot(normal, view), LEAST_COSINE)
    distribution = d_ggx(normal, normalize(light + view), alpha) / math.pi
    return distribution / (2.0 * (n_dot_v + smith_root(n_dot_v, alpha)))


def _reflect(view: Expr, normal: Expr) -> Expr:
    return 2.0 * dot(normal, view) * normal - view


def _alpha(roughness: Expr) -> Expr:
    """Alpha of sampled lobes; that towards lights is at least `MIN_ALPHA`."""
    return max(roughness * roughness, 1e-4)


@function(normal=VEC3, view=VEC3, f0=VEC3, alpha=FLOAT, u=VEC2)
def sample_reflection(normal: Expr, view: Expr, f0: Expr, alpha: Expr, u: Expr) -> Expr:
    """A reflection by a visible microfacet, with correlated masking; weighted by the Fresnel term and G2 / G1."""
    return _reflection(v_smith, normal, view, f0, alpha, u)


@function(normal=VEC3, view=VEC3, f0=VEC3, alpha=FLOAT, u=VEC2)
def sample_reflection_separable(normal: Expr, view: Expr, f0: Expr, alpha: Expr, u: Expr) -> Expr:
    """The same with separable masking."""
    return _reflection(v_smith_separable, normal, view, f0, alpha, u)


def _reflection(smith: Function, normal: Expr, view: Expr, f0: Expr, alpha: Expr, u: Expr) -> Expr:
    h = sample_visible_normal(normal, view, alpha, u)
    direction = _reflect(view, h)
    n_dot_l, n_dot_v = dot(normal, direction), max(dot(normal, view), LEAST_COSINE)
    unhidden = 2.0 * n_dot_l * (n_dot_v + smith_root(n_dot_v, alpha)) * smith(n_dot_l, n_dot_v, alpha)
    weight = fresnel_schlick(f0, dot(view, h)) * unhidden
    return record(SAMPLE, direction, where(n_dot_l > 0.0, weight, vec3(0.0)))


@function(normal=VEC3, n_dot_v=FLOAT, roughness=FLOAT, color=VEC3, u=VEC2)
def sample_diffuse(normal: Expr, n_dot_v: Expr, roughness: Expr, color: Expr, u: Expr) -> Expr:
    """A direction of the diffuse part of a physical material."""
    direction = sample_cosine(normal, u)
    return record(SAMPLE, direction, color * interface_transmittance(dot(normal, direction), n_dot_v, roughness))


def _divided(sample: Expr, chance: Expr) -> Expr:
    """A sample of a lobe that was chosen with a probability."""
    return record(SAMPLE, get(sample, "direction"), get(sample, "weight") / chance)


def _scaled(sample: Expr, factor: Expr) -> Expr:
    return record(SAMPLE, get(sample, "direction"), get(sample, "weight") * factor)


@function(normal=VEC3, view=VEC3, ior=FLOAT, side=FLOAT, roughness=FLOAT, u=VEC2, choice=FLOAT)
def sample_rough_dielectric(
    normal: Expr, view: Expr, ior: Expr, side: Expr, roughness: Expr, u: Expr, choice: Expr
) -> Expr:
    """Reflection or refraction by a visible microfacet, chosen by the Fresnel reflectance (Walter et al. 2007).

    side : -1 inside. Light that other microfacets block is lost.
    """
    alpha = _alpha(roughness)
    ratio = where(side > 0.0, 1.0 / ior, ior)
    h = sample_visible_normal(normal, view, alpha, u)
    v_dot_h, n_dot_v = dot(view, h), max(dot(normal, view), LEAST_COSINE)
    reflects = choice < fresnel_dielectric(v_dot_h, ratio)
    beyond = ratio * v_dot_h - sqrt(1.0 - ratio * ratio * (1.0 - v_dot_h * v_dot_h))
    direction = where(reflects, _reflect(view, h), beyond * h - ratio * view)
    n_dot_l = where(reflects, dot(normal, direction), -dot(normal, direction))
    eye, light = smith_root(n_dot_v, alpha), smith_root(n_dot_l, alpha)
    both = n_dot_l * (n_dot_v + eye) / (n_dot_l * eye + n_dot_v * light)  # G2 / G1
    weight = where(reflects, both, 2.0 * n_dot_l / (n_dot_l + light))  # G1 beyond
    return record(SAMPLE, direction, vec3(where(n_dot_l > 0.0, weight, 0.0)))


# BSDFs


class Lobe(NamedTuple):
    """A glossy lobe about the mirror direction, as the sky and Whitted ray tracing see it.

    roughness : width of the lobe, a float.
    albedo : its directional albedo at the view, a vec3.
    reflectance : the albedo of a mirror in its place, a vec3. At most what the parts below the lobe leave over: at
        grazing angles a perfect mirror reflects more than a rough surface.
    wide : directional albedo of light that is scattered several times, in all directions, a vec3; None for none.
    """

    roughness: Expr
    albedo: Expr
    reflectance: Expr
    wide: Expr | None = None

    def scaled(self, albedo: Operand, reflectance: Operand, wide: Operand) -> Lobe:
        """The lobe with its parts multiplied."""
        spread = None if self.wide is None else self.wide * wide
        return Lobe(self.roughness, self.albedo * albedo, self.reflectance * reflectance, spread)


class BSDF(ABC):
    """How a surface reflects light. Normal, view and light are unit vectors that point away from the surface."""

    LABEL: ClassVar[str] = ""
    """What `explain` calls it, if it is a feature of its own."""

    @property
    def layers(self) -> tuple[BSDF, ...]:
        """The BSDF and those that it contains."""
        return (self,)

    @property
    @abstractmethod
    def fields(self) -> tuple[str, ...]:
        """The material values that it reads."""

    @property
    def rough(self) -> tuple[str, ...]:
        """The material values that are the roughness of a lobe."""
        return ()

    @property
    def metal(self) -> str:
        """The material value that is 1 where no light is reflected diffusely; empty if there is none."""
        return ""

    def prepare(self, values: Values, normal: Expr, view: Expr) -> dict[str, Expr]:
        """Values that depend on the view but not on the light, by name. Other methods find them among the values."""
        return {}

    def ambient(self, values: Values) -> Expr | None:
        """Fraction of each light that arrives from all directions and is reflected, in shadow too, a vec3."""
        return None

    @abstractmethod
    def eval(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        """The BSDF times cosine and pi, a vec3, for a light above the surface."""

    @abstractmethod
    def sample(self, values: Values, normal: Expr, view: Expr, random: Random) -> Expr:
        """A random direction as a `SAMPLE`."""

    @abstractmethod
    def pdf(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        """The density of the directions of `sample`, per solid angle, for a light above the surface."""

    @abstractmethod
    def diffuse_albedo(self, values: Values, n_dot_v: Expr) -> Expr:
        """Directional albedo of all but the lobes, a vec3."""

    def lobes(self, values: Values, n_dot_v: Expr) -> list[Lobe]:
        """The glossy lobes. Their number does not depend on the values."""
        return []

    def reflect_sky(
        self, values: Values, n_dot_v: Expr, mean: Expr, mirrored: Expr, blurred: Expr, traced: Sequence[Operand]
    ) -> Expr:
        """Reflected light of the sky, a vec3.

        mean : the cosine-weighted mean radiance of the sky about the normal. mirrored : its radiance in the mirror
        direction. blurred : its mean about that direction. traced : fraction of each lobe that rays trace.
        """
        result = mean * self.diffuse_albedo(values, n_dot_v)
        for lobe, done in zip(self.lobes(values, n_dot_v), traced, strict=True):
            shown = mix(mirrored, blurred, lobe.roughness) * lobe.albedo
            shown = shown if lobe.wide is None else shown + mean * lobe.wide
            result = result + (1.0 - expr(done)) * shown
        return result

    def traced(self, values: Values, n_dot_v: Expr) -> list[Expr]:
        """Fraction of each lobe that Whitted ray tracing replaces by a mirror, from its roughness."""
        return [clamp(2.0 - lobe.roughness / SMOOTH, 0.0, 1.0) for lobe in self.lobes(values, n_dot_v)]

    def mirrored(self, values: Values, n_dot_v: Expr, traced: Sequence[Expr]) -> Expr:
        """Reflectance of the traced fractions of the lobes as mirrors, a vec3."""
        lobes = self.lobes(values, n_dot_v)
        terms = [done * lobe.reflectance for lobe, done in zip(lobes, traced, strict=True)]
        return sum_of(terms) if terms else vec3(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Phong(BSDF):
    """Diffuse reflection with Phong's highlight."""

    @property
    def fields(self) -> tuple[str, ...]:
        return PHONG

    def ambient(self, values: Values) -> Expr | None:
        return values["ambient"] * values["color"]

    def eval(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        n_dot_l = dot(normal, light)
        highlight = dot(2.0 * n_dot_l * normal - light, view)
        gloss = where(highlight > 0.0, pow(highlight, values["shininess"]), 0.0)
        return n_dot_l * values["color"] + values["specular"] * gloss

    def sample(self, values: Values, normal: Expr, view: Expr, random: Random) -> Expr:
        """Paths leave out the highlight."""
        return record(SAMPLE, sample_cosine(normal, random.direction), values["color"])

    def pdf(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        return dot(normal, light) / math.pi

    def diffuse_albedo(self, values: Values, n_dot_v: Expr) -> Expr:
        return values["color"]


@dataclass(frozen=True)
class Microfacets(BSDF):
    """Microfacet reflection (Cook and Torrance 1982) over a diffuse part that reflects light that passes the interface.

    masking : "correlated" or "separable", see `Quality`.
    compensated : add the multiple scattering between the microfacets of metals (Kulla and Conty 2017).
    """

    masking: str = "correlated"
    compensated: bool = False

    @property
    def fields(self) -> tuple[str, ...]:
        return PHYSICAL

    @property
    def rough(self) -> tuple[str, ...]:
        return ("roughness",)

    @property
    def metal(self) -> str:
        return "metalness" if "metalness" in self.fields else ""

    def missing(self, cosine: Expr, roughness: Expr) -> Expr:
        """1 minus the directional albedo of single scattering by white microfacets."""
        return (missing_albedo if self.masking == "correlated" else missing_albedo_separable)(cosine, roughness)

    def mean_missing(self, roughness: Expr) -> Expr:
        """The cosine-weighted mean of `missing`."""
        correlated = self.masking == "correlated"
        return (mean_missing_albedo if correlated else mean_missing_albedo_separable)(roughness)

    def specular(self, normal: Expr, view: Expr, light: Expr, roughness: Expr, f0: Expr) -> Expr:
        """Single scattering by microfacets, times pi."""
        n_dot_l, n_dot_v = dot(normal, light), max(dot(normal, view), LEAST_COSINE)
        half_vector = normalize(light + view)
        alpha = max(roughness * roughness, MIN_ALPHA)
        smith = v_smith if self.masking == "correlated" else v_smith_separable
        distribution = d_ggx(normal, half_vector, alpha) * smith(n_dot_l, n_dot_v, alpha)
        return distribution * fresnel_schlick(f0, dot(half_vector, view))

    def reflection(self, normal: Expr, view: Expr, f0: Expr, roughness: Expr, u: Expr) -> Expr:
        """A sample of single scattering by microfacets."""
        reflect = sample_reflection if self.masking == "correlated" else sample_reflection_separable
        return reflect(normal, view, f0, _alpha(roughness), u)

    def directional_albedo(self, n_dot_v: Expr, roughness: Expr) -> tuple[Expr, Expr]:
        """Directional albedo of single scattering: f0 times the first value plus the second."""
        whole = 1.0 - self.missing(n_dot_v, roughness)
        edge = min(albedo_f90(n_dot_v, roughness), whole)
        return whole - edge, edge

    def prepare(self, values: Values, normal: Expr, view: Expr) -> dict[str, Expr]:
        """The directional albedo of multiple scattering. For white metal it is all that single scattering loses."""
        if not self.compensated:
            return {}
        color, roughness = values["color"], values["roughness"]
        missing = self.mean_missing(roughness)
        mean = color + (1.0 - color) / 21.0  # cosine-weighted mean of Schlick's reflectance
        further = mean * mean * (1.0 - missing) / (1.0 - mean * missing)
        return {"ms_albedo": values["metalness"] * self.missing(dot(normal, view), roughness) * further}

    def eval(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        roughness = values["roughness"]
        n_dot_l, n_dot_v = dot(normal, light), max(dot(normal, view), LEAST_COSINE)
        specular = self.specular(normal, view, light, roughness, _base(values))
        transmittance = interface_transmittance(n_dot_l, n_dot_v, roughness) * (1.0 - values["metalness"])
        result = specular + transmittance * (1.0 - values["f0"]) * values["color"]
        if self.compensated:  # a wide, reciprocal lobe
            lobe = self.missing(n_dot_l, roughness) / self.mean_missing(roughness)
            result = result + lobe * values["ms_albedo"]
        return n_dot_l * result

    def sample(self, values: Values, normal: Expr, view: Expr, random: Random) -> Expr:
        """The specular, the diffuse or the multiply scattered part, with probabilities by their albedos."""
        n_dot_v, roughness = max(dot(normal, view), LEAST_COSINE), values["roughness"]
        chance, diffuse = self._chance(values, n_dot_v)
        glossy = self.reflection(normal, view, _base(values), roughness, random.direction)
        matte = sample_diffuse(normal, n_dot_v, roughness, diffuse, random.direction)
        found = where(random.lobe < chance, _divided(glossy, chance), _divided(matte, 1.0 - chance))
        if not self.compensated:
            return found
        several, albedo = self._several(values, normal, view)
        wide = self._sample_wide(normal, roughness, albedo, random.direction)
        return where(random.several < several, _divided(wide, several), _divided(found, 1.0 - several))

    def pdf(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        n_dot_v, n_dot_l, roughness = max(dot(normal, view), LEAST_COSINE), dot(normal, light), values["roughness"]
        chance, _ = self._chance(values, n_dot_v)
        found = mix(n_dot_l / math.pi, pdf_reflected(normal, view, light, _alpha(roughness)), chance)
        if not self.compensated:
            return found
        several, _ = self._several(values, normal, view)
        power = 1.5 - roughness
        return mix(found, pow(n_dot_l, 1.0 / power - 1.0) / (2.0 * math.pi * power), several)

    def _chance(self, values: Values, n_dot_v: Expr) -> tuple[Expr, Expr]:
        """The probability of the specular part, and the colour of the diffuse part."""
        metalness, third = values["metalness"], vec3(1.0 / 3.0)
        diffuse = (1.0 - metalness) * (1.0 - values["f0"]) * values["color"]
        specular = dot(fresnel_schlick(_base(values), n_dot_v), third)
        rest = (1.0 - albedo_f90(n_dot_v, values["roughness"])) * dot(diffuse, third)
        # The offsets avoid a division by 0 for black; the clamp samples both parts.
        chance = clamp((specular + 1e-6) / (specular + rest + 2e-6), 0.05, 0.95)
        return where(metalness >= 1.0, 1.0, chance), diffuse

    def _several(self, values: Values, normal: Expr, view: Expr) -> tuple[Expr, Expr]:
        """The probability of the multiply scattered part, and its directional albedo."""
        albedo = Microfacets.prepare(self, values, normal, view)["ms_albedo"]
        several = dot(albedo, vec3(1.0 / 3.0))
        once = 1.0 - values["metalness"] * self.missing(dot(normal, view), values["roughness"])
        return several / (several + once), albedo

    def _sample_wide(self, normal: Expr, roughness: Expr, albedo: Expr, u: Expr) -> Expr:
        """A lobe that is narrow at the horizon on smooth surfaces, as its density."""
        first, turn = max(u.x, 1e-6), 2.0 * math.pi * u.y
        power = 1.5 - roughness
        cosine = pow(first, power)
        sine = sqrt(1.0 - cosine * cosine)
        direction = to_world(normal, vec3(sine * cos(turn), sine * sin(turn), cosine))
        lobe = self.missing(cosine, roughness) / self.mean_missing(roughness)
        return record(SAMPLE, direction, albedo * (lobe * 2.0 * power * pow(first, 2.0 * power - 1.0)))

    def lobes(self, values: Values, n_dot_v: Expr) -> list[Lobe]:
        base, roughness = _base(values), values["roughness"]
        scale, bias = self.directional_albedo(n_dot_v, roughness)
        mirror = min(fresnel_schlick(base, n_dot_v), mix(base, vec3(1.0), bias))
        return [Lobe(roughness, base * scale + bias, mirror, values.get("ms_albedo"))]

    def diffuse_albedo(self, values: Values, n_dot_v: Expr) -> Expr:
        _, bias = self.directional_albedo(n_dot_v, values["roughness"])
        return (1.0 - bias) * (1.0 - values["f0"]) * (1.0 - values["metalness"]) * values["color"]


def _base(values: Values) -> Expr:
    """Reflectance of a physical material at normal incidence, a vec3."""
    return mix(values["f0"], values["color"], values["metalness"])


def over_dielectric(values: Values, ior: Expr, share: Expr) -> dict[str, Expr]:
    """The values of a physical material of which a share is the outside of glass.

    Schlick's reflectance is linear in f0, and the diffuse part in the colour, so these two are interpolated.
    """
    diffuse = (1.0 - share) * (1.0 - values["metalness"]) * (1.0 - values["f0"]) * values["color"]
    f0 = mix(_base(values), vec3(fresnel_dielectric(1.0, 1.0 / ior)), share)
    changed = {"f0": f0, "color": diffuse / max(1.0 - f0, 1e-6), "metalness": expr(0.0)}
    if "clearcoat" in values:  # the outside of glass has no coat
        changed["clearcoat"] = (1.0 - share) * values["clearcoat"]
    return {**values, **changed}


COAT_F0 = 0.04
"""Reflectance of the clear coat at normal incidence: that of the index of refraction 1.5."""


@dataclass(frozen=True)
class Coated(BSDF):
    """A clear coat over a physical BSDF, with the values of KHR_materials_clearcoat of glTF.

    The coat is a dielectric with GGX microfacets and the reflectance `COAT_F0`. Light passes it twice: the base is
    multiplied by the transmittance 1 - clearcoat E of both directions, where E is the directional albedo of the coat.
    So the whole is reciprocal and reflects no more light than arrives. (glTF multiplies by one factor, of the view.)
    Light that is reflected back into the base is lost.
    """

    base: Microfacets

    LABEL = "clear coat"

    @property
    def fields(self) -> tuple[str, ...]:
        return (*self.base.fields, *COAT)

    @property
    def rough(self) -> tuple[str, ...]:
        return (*self.base.rough, "clearcoat_roughness")

    @property
    def metal(self) -> str:
        return self.base.metal

    @property
    def layers(self) -> tuple[BSDF, ...]:
        return (self, *self.base.layers)

    def _transmittance(self, values: Values, cosine: Expr) -> Expr:
        scale, bias = self.base.directional_albedo(cosine, values["clearcoat_roughness"])
        return 1.0 - values["clearcoat"] * (COAT_F0 * scale + bias)

    def _mean_transmittance(self, values: Values) -> Expr:
        """The cosine-weighted mean of the transmittance."""
        roughness = values["clearcoat_roughness"]
        bias = _mean_albedo_f90(roughness)
        scale = max(1.0 - self.base.mean_missing(roughness) - bias, 0.0)
        return 1.0 - values["clearcoat"] * (COAT_F0 * scale + bias)

    def prepare(self, values: Values, normal: Expr, view: Expr) -> dict[str, Expr]:
        return self.base.prepare(values, normal, view)

    def eval(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        n_dot_l, n_dot_v = dot(normal, light), max(dot(normal, view), LEAST_COSINE)
        transmittance = self._transmittance(values, n_dot_l) * self._transmittance(values, n_dot_v)
        coat = self.base.specular(normal, view, light, values["clearcoat_roughness"], vec3(COAT_F0))
        return transmittance * self.base.eval(values, normal, view, light) + n_dot_l * values["clearcoat"] * coat

    def _chance(self, values: Values, n_dot_v: Expr) -> Expr:
        """The probability of the coat: its albedo over the sum with the colour of the base."""
        albedo = 1.0 - self._transmittance(values, n_dot_v)
        base = (1.0 - albedo) * (dot(values["color"], vec3(1.0 / 3.0)) + COAT_F0)
        return where(albedo > 0.0, clamp(albedo / (albedo + base), 0.05, 0.95), 0.0)

    def sample(self, values: Values, normal: Expr, view: Expr, random: Random) -> Expr:
        n_dot_v, roughness = max(dot(normal, view), LEAST_COSINE), values["clearcoat_roughness"]
        chance = self._chance(values, n_dot_v)
        coat = self.base.reflection(normal, view, vec3(COAT_F0), roughness, random.direction)
        below = self.base.sample(values, normal, view, random)
        n_dot_l = max(dot(normal, get(below, "direction")), LEAST_COSINE)
        passed = self._transmittance(values, n_dot_l) * self._transmittance(values, n_dot_v)
        # The probability of the base is at least 0.05 where it is sampled.
        rest = _scaled(below, passed / max(1.0 - chance, 0.05))
        return where(random.coat < chance, _scaled(coat, values["clearcoat"] / max(chance, 0.05)), rest)

    def pdf(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        chance = self._chance(values, max(dot(normal, view), LEAST_COSINE))
        coat = pdf_reflected(normal, view, light, _alpha(values["clearcoat_roughness"]))
        return mix(self.base.pdf(values, normal, view, light), coat, chance)

    def lobes(self, values: Values, n_dot_v: Expr) -> list[Lobe]:
        roughness, weight = values["clearcoat_roughness"], values["clearcoat"]
        view, mean = self._transmittance(values, n_dot_v), self._mean_transmittance(values)
        mirror = min(weight * fresnel_schlick(vec3(COAT_F0), n_dot_v), vec3(1.0 - view))
        coat = Lobe(roughness, vec3(1.0 - view), mirror)
        below = [
            lobe.scaled(view * mix(view, mean, lobe.roughness), (1.0 - mirror) * (1.0 - mirror), view * mean)
            for lobe in self.base.lobes(values, n_dot_v)
        ]
        return [*below, coat]

    def diffuse_albedo(self, values: Values, n_dot_v: Expr) -> Expr:
        passed = self._transmittance(values, n_dot_v) * self._mean_transmittance(values)
        return passed * self.base.diffuse_albedo(values, n_dot_v)


@dataclass(frozen=True)
class Blend(BSDF):
    """Two BSDFs, interpolated by a value, such as Phong and microfacets by "physical".

    If values are also given with the prefix "outside ", the second one reads these, and all in it.
    """

    first: BSDF
    second: BSDF
    weight: str = "physical"

    @property
    def fields(self) -> tuple[str, ...]:
        others = tuple(name for name in self.second.fields if name not in self.first.fields)
        return (*self.first.fields, *others, self.weight)

    @property
    def rough(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((*self.first.rough, *self.second.rough)))

    @property
    def metal(self) -> str:
        return self.first.metal or self.second.metal

    @property
    def layers(self) -> tuple[BSDF, ...]:
        return (self, *self.first.layers, *self.second.layers)

    def prepare(self, values: Values, normal: Expr, view: Expr) -> dict[str, Expr]:
        return self.first.prepare(values, normal, view) | self.second.prepare(values, normal, view)

    def ambient(self, values: Values) -> Expr | None:
        ambient = self.first.ambient(values)
        return None if ambient is None else (1.0 - values[self.weight]) * ambient

    def eval(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        outside = {name: values.get(f"outside {name}", value) for name, value in values.items()}
        one, other = (
            bsdf.eval(given, normal, view, light) for bsdf, given in ((self.first, values), (self.second, outside))
        )
        return mix(one, other, values[self.weight])

    def sample(self, values: Values, normal: Expr, view: Expr, random: Random) -> Expr:
        weight, u = values[self.weight], random.model
        rest = random if not isinstance(self.first, Blend) else random._replace(model=(u - weight) / (1.0 - weight))
        one = self.first.sample(values, normal, view, rest)
        return where(u < weight, self.second.sample(values, normal, view, random), one)

    def pdf(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        one, other = (bsdf.pdf(values, normal, view, light) for bsdf in (self.first, self.second))
        return mix(one, other, values[self.weight])

    def lobes(self, values: Values, n_dot_v: Expr) -> list[Lobe]:
        weight = values[self.weight]
        one, other = (bsdf.lobes(values, n_dot_v) for bsdf in (self.first, self.second))
        rest = 1.0 - weight
        return [lobe.scaled(rest, rest, rest) for lobe in one] + [lobe.scaled(weight, weight, weight) for lobe in other]

    def diffuse_albedo(self, values: Values, n_dot_v: Expr) -> Expr:
        one, other = (bsdf.diffuse_albedo(values, n_dot_v) for bsdf in (self.first, self.second))
        return mix(one, other, values[self.weight])


def sample_lobes(bsdf: BSDF, values: Values, normal: Expr, view: Expr, u: Expr, choice: Expr) -> Expr:
    """A random direction of one of the lobes that are narrower than `GLOSSY`, for lights with an area.

    u : a vec2, choice : a float, random numbers in [0, 1). The zero vector if there is no such lobe.
    """
    alpha, below = expr(0.0), expr(0.0)
    for width, chance in _narrow(bsdf, values, normal, view):
        alpha = where(choice >= below, width, alpha)
        below = below + chance
    half_vector = sample_visible_normal(normal, view, max(alpha, MIN_ALPHA), u)
    return where(below > 0.0, _reflect(view, half_vector), vec3(0.0))


def pdf_lobes(bsdf: BSDF, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
    """The density of `sample_lobes`, per solid angle; 0 below the surface, and for a view from below it."""
    density = sum_of([c * pdf_reflected(normal, view, light, a) for a, c in _narrow(bsdf, values, normal, view)])
    return where(min(dot(normal, light), dot(normal, view)) > LEAST_COSINE, density, 0.0)


def _narrow(bsdf: BSDF, values: Values, normal: Expr, view: Expr) -> list[tuple[Expr, Expr]]:
    """Alpha of each lobe as `eval` has it, and its probability: equal for all narrow lobes, and 0 for the others."""
    lobes = bsdf.lobes(values, max(dot(normal, view), LEAST_COSINE))
    used = [where((x.roughness < GLOSSY) & (dot(x.reflectance, vec3(1.0)) > 0.0), 1.0, 0.0) for x in lobes]
    count = max(sum_of(used), 1.0) if used else expr(1.0)
    alphas = (max(lobe.roughness * lobe.roughness, MIN_ALPHA) for lobe in lobes)
    return [(alpha, share / count) for alpha, share in zip(alphas, used, strict=True)]


def samples_both(light: Light, materials: Sequence[Material], bounces: bool = False) -> bool:
    """True if surfaces sample their lobes beside the points of a light, because a lobe may be narrower than the light.

    Such a light has an area, and its light or its shadow is sampled at random points. bounces : see `has_disc`.
    """
    if not any(material.glossy for material in materials):
        return False
    area = has_area(light)
    disc = has_disc(light, bounces)
    return disc != area and (disc or density_of(light) is not None)


def bsdf_of(materials: Sequence[Material], quality: Quality) -> BSDF:
    """The BSDF of all materials of a scene. SceneError for several classes of the user's own."""
    settings = quality.masking, quality.energy_compensation and any(m.metallic for m in materials)
    kinds = {"phong" if not m.physical else m.bsdf or "physical" for m in materials}
    base = Microfacets(*settings)
    physical = Coated(base) if any(m.coated for m in materials) else base
    own = list(dict.fromkeys(m.bsdf for m in materials if m.bsdf is not None))
    if len(own) > 1:
        where_ = next(m.where for m in materials if m.bsdf is own[1])
        names = " and ".join(kind.__name__ for kind in own)
        raise SceneError(f"materials with the BSDFs {names}", legal="one class of your own in a scene", where=where_)
    made: list[tuple[BSDF, str]] = [(Phong(), "")] if "phong" in kinds or not kinds else []
    made += [(physical, "physical")] if "physical" in kinds else []
    made += [(_instance(own[0], settings), "own")] if own else []
    found = made[0][0]
    for bsdf, weight in made[1:]:
        found = Blend(found, bsdf, weight)
    return found


def _instance(kind: type[BSDF], settings: tuple[str, bool]) -> BSDF:
    """A BSDF of the user's own."""
    return kind(*settings) if issubclass(kind, Microfacets) else kind()


def check_bsdf(kind: Any) -> None:
    """SceneError if a value is not a class of BSDFs whose methods give expressions of the right types."""
    legal = "a class derived from a BSDF of raymarch.scene.bsdf, such as Microfacets"
    if not isinstance(kind, type) or not issubclass(kind, BSDF):
        raise SceneError(f"Material: bsdf = {short(kind)}", legal=legal)
    if getattr(kind, "__abstractmethods__", None):
        missing = ", ".join(sorted(kind.__abstractmethods__))
        raise SceneError(f"Material: bsdf = {kind.__name__}", legal=f"a class with {missing}")
    bsdf = _instance(kind, ("correlated", True))
    values: dict[str, Expr] = {name: var(name, value.type) for name, value in Material()._fields.items()}
    normal, view, light = (var(name, VEC3) for name in ("normal", "view", "light"))
    unknown = sorted({*bsdf.fields, *bsdf.rough} - set(values))
    if unknown:
        raise SceneError(f"{kind.__name__}: fields {', '.join(unknown)}", legal=", ".join(FIELDS))
    try:
        values |= bsdf.prepare(values, normal, view)
        results = (
            ("eval", bsdf.eval(values, normal, view, light), VEC3),
            ("sample", bsdf.sample(values, normal, view, RANDOM), SAMPLE),
            ("diffuse_albedo", bsdf.diffuse_albedo(values, var("n_dot_v", FLOAT)), VEC3),
        )
    except KeyError as fault:
        raise SceneError(f"{kind.__name__} reads the value {fault}", legal=", ".join(FIELDS)) from None
    for method, value, type_ in results:
        if not isinstance(value, Expr) or value.type is not type_:
            given = value.type if isinstance(value, Expr) else short(value)
            raise SceneError(f"{kind.__name__}.{method} gives {given}", legal=f"an expression of type {type_}")
