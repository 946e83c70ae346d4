"""Subsurface scattering: light enters a solid, is scattered in it, and leaves it elsewhere.

The medium is homogeneous, scatters evenly in all directions, and has the index of refraction of its surroundings: the
model of OpenPBR (2024) without anisotropy. Paths walk in it at random (glsl/path/subsurface.glsl). Light enters with
the cosine distribution of a diffuse surface and leaves with it, so that lights are sampled where it leaves, and a walk
of no length is diffuse reflection.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from raymarch.expr.function import function
from raymarch.expr.node import Expr
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import dot, max, mix, record, sqrt, vec3, where
from raymarch.scene.bsdf import BSDF, Lobe, Microfacets, Random, Values
from raymarch.scene.fields import SUBSURFACE
from raymarch.scene.layers import Coated
from raymarch.scene.reflectance import LEAST_COSINE, SAMPLE, albedo_f90, mean_albedo_f90, sample_cosine


@function(color=VEC3)
def scattering_albedo(color: Expr) -> Expr:
    """The albedo of one scattering, of that of a half-space in even light.

    The inverse of van de Hulst's (1980) spherical albedo (1 - s) (1 - 0.139 s) / (1 + 1.17 s), s = sqrt(1 - albedo),
    as Kulla and Conty (2017) and OpenPBR have it.
    """
    s = 4.09712 + 4.20863 * color - sqrt(9.59217 + color * (41.6808 + 17.7126 * color))
    return 1.0 - s * s


@dataclass(frozen=True)
class Scattered(BSDF):
    """A physical BSDF over a medium that scatters light. Here the light that is scattered stays at its point: a part of
    the diffuse reflection has the colour of the medium. Path tracing takes that part out, and walks."""

    base: Microfacets | Coated

    LABEL = "subsurface scattering"

    @property
    def fields(self) -> tuple[str, ...]:
        return (*self.base.fields, *SUBSURFACE)

    @property
    def rough(self) -> tuple[str, ...]:
        return self.base.rough

    @property
    def metal(self) -> str:
        return self.base.metal

    @property
    def layers(self) -> tuple[BSDF, ...]:
        return (self, *self.base.layers)

    def entry(self, values: Values, n_dot_v: Expr) -> Expr:
        """The fraction of light in a direction that reaches the medium, a vec3. That of no scattering in `eval`."""
        passed = (1.0 - values["metalness"]) * (1.0 - albedo_f90(n_dot_v, values["roughness"]))
        if isinstance(self.base, Coated):
            passed = passed * self.base.transmittance(values, n_dot_v)
        return passed * (1.0 - values["f0"])

    def _exit(self, values: Values, n_dot_l: Expr) -> Expr:
        """The transmittance where light leaves, over its mean for diffuse light; see `interface_transmittance`."""
        roughness = values["roughness"]
        passed = (1.0 - albedo_f90(n_dot_l, roughness)) / (1.0 - mean_albedo_f90(roughness))
        return passed * self.base.transmittance(values, n_dot_l) if isinstance(self.base, Coated) else passed

    def _mixed(self, values: Values) -> Values:
        """The values of the base: its diffuse part has the colour of the medium, or is left out where "exits" is -1."""
        share = values["subsurface"] * (1.0 - values["metalness"])
        matte = where(values["exits"] < -0.5, 0.0, 1.0)
        return {**values, "color": mix(values["color"], values["subsurface_color"], share), "matte": matte}

    def prepare(self, values: Values, normal: Expr, view: Expr) -> dict[str, Expr]:
        return self.base.prepare(values, normal, view)

    def eval(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        n_dot_l = dot(normal, light)
        whole = self.base.eval(self._mixed(values), normal, view, light)
        return where(values["exits"] > 0.5, vec3(n_dot_l * self._exit(values, n_dot_l)), whole)

    def sample(self, values: Values, normal: Expr, view: Expr, random: Random) -> Expr:
        direction = sample_cosine(normal, random.direction)
        n_dot_l = max(dot(normal, direction), LEAST_COSINE)
        exits = record(SAMPLE, direction, vec3(self._exit(values, n_dot_l)))
        return where(values["exits"] > 0.5, exits, self.base.sample(self._mixed(values), normal, view, random))

    def pdf(self, values: Values, normal: Expr, view: Expr, light: Expr) -> Expr:
        whole = self.base.pdf(self._mixed(values), normal, view, light)
        return where(values["exits"] > 0.5, dot(normal, light) / math.pi, whole)

    def lobes(self, values: Values, n_dot_v: Expr) -> list[Lobe]:
        kept = where(values["exits"] > 0.5, 0.0, 1.0)
        return [lobe.scaled(kept, kept, kept) for lobe in self.base.lobes(self._mixed(values), n_dot_v)]

    def diffuse_albedo(self, values: Values, n_dot_v: Expr) -> Expr:
        return self.base.diffuse_albedo(self._mixed(values), n_dot_v)
