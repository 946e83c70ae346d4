"""BSDFs of others: a clear coat over one, and the interpolation of two."""

from __future__ import annotations

from dataclasses import dataclass

from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import (
    clamp,
    dot,
    get,
    max,
    min,
    mix,
    vec3,
    where,
)
from raymarch.scene.bsdf import BSDF, Lobe, Microfacets, Values
from raymarch.scene.fields import COAT
from raymarch.scene.reflectance import (
    LEAST_COSINE,
    Random,
    fresnel_schlick,
    mean_albedo_f90,
    pdf_reflected,
    sampled_alpha,
    scaled,
)

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

    def transmittance(self, values: Values, cosine: Expr) -> Expr:
        """The fraction of light in a direction that passes the coat."""
        scale, bias = self.base.directional_albedo(cosine, values["clearcoat_roughness"])
        return 1.0 - values["clearcoat"] * (COAT_F0 * scale + bias)

    def _mean_transmittance(self, values: Values) -> Expr:
        """The cosine-weighted mean of the transmittance."""
        roughness = values["clearcoat_roughness"]
        bias = mean_albedo_f90(roughness)
        scale = max(1.0 - self.base.mean_missing(roughness) - bias, 0.0)
        return 1.0 - values["clearcoat"] * (COAT_F0 * scale + bias)

    def prepare(self, values: Values, normal: Expr, view: Expr) -> dict[str, Expr]:
        return self.base.prepare(values, normal, view)

    def eval(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        n_dot_l, n_dot_v = dot(normal, light), max(dot(normal, view), LEAST_COSINE)
        transmittance = self.transmittance(values, n_dot_l) * self.transmittance(values, n_dot_v)
        coat = self.base.specular(normal, view, light, values["clearcoat_roughness"], vec3(COAT_F0))
        return transmittance * self.base.eval(values, normal, view, light) + n_dot_l * values["clearcoat"] * coat

    def _chance(self, values: Values, n_dot_v: Expr) -> Expr:
        """The probability of the coat: its albedo over the sum with the colour of the base."""
        albedo = 1.0 - self.transmittance(values, n_dot_v)
        base = (1.0 - albedo) * (dot(values["color"], vec3(1.0 / 3.0)) + COAT_F0)
        return where(albedo > 0.0, clamp(albedo / (albedo + base), 0.05, 0.95), 0.0)

    def sample(self, values: Values, normal: Expr, view: Expr, random: Random) -> Expr:
        n_dot_v, roughness = max(dot(normal, view), LEAST_COSINE), values["clearcoat_roughness"]
        chance = self._chance(values, n_dot_v)
        coat = self.base.reflection(normal, view, vec3(COAT_F0), roughness, random.direction)
        below = self.base.sample(values, normal, view, random)
        n_dot_l = max(dot(normal, get(below, "direction")), LEAST_COSINE)
        passed = self.transmittance(values, n_dot_l) * self.transmittance(values, n_dot_v)
        # The probability of the base is at least 0.05 where it is sampled.
        rest = scaled(below, passed / max(1.0 - chance, 0.05))
        return where(random.coat < chance, scaled(coat, values["clearcoat"] / max(chance, 0.05)), rest)

    def pdf(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        chance = self._chance(values, max(dot(normal, view), LEAST_COSINE))
        coat = pdf_reflected(normal, view, light, sampled_alpha(values["clearcoat_roughness"]))
        return mix(self.base.pdf(values, normal, view, light), coat, chance)

    def lobes(self, values: Values, n_dot_v: Expr) -> list[Lobe]:
        roughness, weight = values["clearcoat_roughness"], values["clearcoat"]
        view, mean = self.transmittance(values, n_dot_v), self._mean_transmittance(values)
        mirror = min(weight * fresnel_schlick(vec3(COAT_F0), n_dot_v), vec3(1.0 - view))
        coat = Lobe(roughness, vec3(1.0 - view), mirror)
        below = [
            lobe.scaled(view * mix(view, mean, lobe.roughness), (1.0 - mirror) * (1.0 - mirror), view * mean)
            for lobe in self.base.lobes(values, n_dot_v)
        ]
        return [*below, coat]

    def diffuse_albedo(self, values: Values, n_dot_v: Expr) -> Expr:
        passed = self.transmittance(values, n_dot_v) * self._mean_transmittance(values)
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
