"""BSDFs: how surfaces reflect light, as functions of the expression language. Shader and reference evaluate these.

`eval` is the BSDF times the cosine of the light's direction, as in Mitsuba and pbrt, and times pi: a white diffuse
surface that faces the light has the value 1, as for `Light.intensity`. Directions point away from the surface and have
length 1. Values of materials are expressions by the names of `raymarch.scene.fields.FIELDS`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, TypeAlias

from raymarch.errors import SceneError
from raymarch.expr.convert import short
from raymarch.expr.function import sum_of
from raymarch.expr.node import Expr, Operand, expr, var
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import clamp, cos, dot, max, min, mix, normalize, pow, record, sin, sqrt, vec3, where
from raymarch.scene.fields import ALL, FIELDS, PHONG, PHYSICAL, SMOOTH
from raymarch.scene.light import to_world
from raymarch.scene.reflectance import (
    LEAST_COSINE,
    MIN_ALPHA,
    albedo_f90,
    d_ggx,
    divided,
    fresnel_dielectric,
    fresnel_schlick,
    interface_transmittance,
    mean_missing_albedo,
    mean_missing_albedo_separable,
    missing_albedo,
    missing_albedo_separable,
    pdf_reflected,
    sample_diffuse,
    sample_reflection,
    sample_reflection_separable,
    sampled_alpha,
    v_smith,
    v_smith_separable,
)
from raymarch.scene.reflectance import RANDOM as RANDOM
from raymarch.scene.reflectance import SAMPLE as SAMPLE
from raymarch.scene.reflectance import Random as Random
from raymarch.scene.reflectance import sample_cosine as sample_cosine

Values: TypeAlias = Mapping[str, Expr]


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
        return reflect(normal, view, f0, sampled_alpha(roughness), u)

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
        specular = self.specular(normal, view, light, roughness, base_reflectance(values))
        transmittance = interface_transmittance(n_dot_l, n_dot_v, roughness) * _dielectric(values)
        result = specular + transmittance * (1.0 - values["f0"]) * values["color"]
        if self.compensated:  # a wide, reciprocal lobe
            lobe = self.missing(n_dot_l, roughness) / self.mean_missing(roughness)
            result = result + lobe * values["ms_albedo"]
        return n_dot_l * result

    def sample(self, values: Values, normal: Expr, view: Expr, random: Random) -> Expr:
        """The specular, the diffuse or the multiply scattered part, with probabilities by their albedos."""
        n_dot_v, roughness = max(dot(normal, view), LEAST_COSINE), values["roughness"]
        chance, diffuse = self._chance(values, n_dot_v)
        glossy = self.reflection(normal, view, base_reflectance(values), roughness, random.direction)
        matte = sample_diffuse(normal, n_dot_v, roughness, diffuse, random.direction)
        found = where(random.lobe < chance, divided(glossy, chance), divided(matte, 1.0 - chance))
        if not self.compensated:
            return found
        several, albedo = self._several(values, normal, view)
        wide = self._sample_wide(normal, roughness, albedo, random.direction)
        return where(random.several < several, divided(wide, several), divided(found, 1.0 - several))

    def pdf(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        n_dot_v, n_dot_l, roughness = max(dot(normal, view), LEAST_COSINE), dot(normal, light), values["roughness"]
        chance, _ = self._chance(values, n_dot_v)
        found = mix(n_dot_l / math.pi, pdf_reflected(normal, view, light, sampled_alpha(roughness)), chance)
        if not self.compensated:
            return found
        several, _ = self._several(values, normal, view)
        power = 1.5 - roughness
        return mix(found, pow(n_dot_l, 1.0 / power - 1.0) / (2.0 * math.pi * power), several)

    def _chance(self, values: Values, n_dot_v: Expr) -> tuple[Expr, Expr]:
        """The probability of the specular part, and the colour of the diffuse part."""
        metalness, third = values["metalness"], vec3(1.0 / 3.0)
        diffuse = _dielectric(values) * (1.0 - values["f0"]) * values["color"]
        specular = dot(fresnel_schlick(base_reflectance(values), n_dot_v), third)
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
        base, roughness = base_reflectance(values), values["roughness"]
        scale, bias = self.directional_albedo(n_dot_v, roughness)
        mirror = min(fresnel_schlick(base, n_dot_v), mix(base, vec3(1.0), bias))
        return [Lobe(roughness, base * scale + bias, mirror, values.get("ms_albedo"))]

    def diffuse_albedo(self, values: Values, n_dot_v: Expr) -> Expr:
        _, bias = self.directional_albedo(n_dot_v, values["roughness"])
        return (1.0 - bias) * (1.0 - values["f0"]) * _dielectric(values) * values["color"]


def _dielectric(values: Values) -> Expr:
    """The weight of the diffuse part. "matte" : 0 where a medium below the surface takes its place."""
    dielectric = 1.0 - values["metalness"]
    return values["matte"] * dielectric if "matte" in values else dielectric


def base_reflectance(values: Values) -> Expr:
    """Reflectance of a physical material at normal incidence, a vec3."""
    return mix(values["f0"], values["color"], values["metalness"])


def over_dielectric(values: Values, ior: Expr, share: Expr) -> dict[str, Expr]:
    """The values of a physical material of which a share is the outside of glass.

    Schlick's reflectance is linear in f0, and the diffuse part in the colour, so these two are interpolated.
    """
    diffuse = (1.0 - share) * (1.0 - values["metalness"]) * (1.0 - values["f0"]) * values["color"]
    f0 = mix(base_reflectance(values), vec3(fresnel_dielectric(1.0, 1.0 / ior)), share)
    changed = {"f0": f0, "color": diffuse / max(1.0 - f0, 1e-6), "metalness": expr(0.0)}
    if "clearcoat" in values:  # the outside of glass has no coat
        changed["clearcoat"] = (1.0 - share) * values["clearcoat"]
    return {**values, **changed}


def instance_of(kind: type[BSDF], settings: tuple[str, bool]) -> BSDF:
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
    bsdf = instance_of(kind, ("correlated", True))
    values: dict[str, Expr] = {field.name: var(field.name, field.type) for field in ALL}
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
