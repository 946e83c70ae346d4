"""Terms of which BSDFs are made: Fresnel, microfacets, directional albedos, and the sampling of lobes."""

from __future__ import annotations

import math
from typing import NamedTuple

from raymarch.expr.function import Function, function
from raymarch.expr.node import Expr, var
from raymarch.expr.types import FLOAT, VEC2, VEC3, struct
from raymarch.expr.vocabulary import clamp, cos, cross, dot, get, max, normalize, pow, record, sin, sqrt, vec3, where
from raymarch.scene.light import to_world

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


def mean_albedo_f90(r: Expr) -> Expr:
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
    return (1.0 - albedo_f90(to_light, r)) * (1.0 - albedo_f90(v, r)) / (1.0 - mean_albedo_f90(r))


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


def reflect(view: Expr, normal: Expr) -> Expr:
    return 2.0 * dot(normal, view) * normal - view


def sampled_alpha(roughness: Expr) -> Expr:
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
    direction = reflect(view, h)
    n_dot_l, n_dot_v = dot(normal, direction), max(dot(normal, view), LEAST_COSINE)
    unhidden = 2.0 * n_dot_l * (n_dot_v + smith_root(n_dot_v, alpha)) * smith(n_dot_l, n_dot_v, alpha)
    weight = fresnel_schlick(f0, dot(view, h)) * unhidden
    return record(SAMPLE, direction, where(n_dot_l > 0.0, weight, vec3(0.0)))


@function(normal=VEC3, n_dot_v=FLOAT, roughness=FLOAT, color=VEC3, u=VEC2)
def sample_diffuse(normal: Expr, n_dot_v: Expr, roughness: Expr, color: Expr, u: Expr) -> Expr:
    """A direction of the diffuse part of a physical material."""
    direction = sample_cosine(normal, u)
    return record(SAMPLE, direction, color * interface_transmittance(dot(normal, direction), n_dot_v, roughness))


def divided(sample: Expr, chance: Expr) -> Expr:
    """A sample of a lobe that was chosen with a probability."""
    return record(SAMPLE, get(sample, "direction"), get(sample, "weight") / chance)


def scaled(sample: Expr, factor: Expr) -> Expr:
    return record(SAMPLE, get(sample, "direction"), get(sample, "weight") * factor)


@function(normal=VEC3, view=VEC3, ior=FLOAT, side=FLOAT, roughness=FLOAT, u=VEC2, choice=FLOAT)
def sample_rough_dielectric(
    normal: Expr, view: Expr, ior: Expr, side: Expr, roughness: Expr, u: Expr, choice: Expr
) -> Expr:
    """Reflection or refraction by a visible microfacet, chosen by the Fresnel reflectance (Walter et al. 2007).

    side : -1 inside. Light that other microfacets block is lost.
    """
    alpha = sampled_alpha(roughness)
    ratio = where(side > 0.0, 1.0 / ior, ior)
    h = sample_visible_normal(normal, view, alpha, u)
    v_dot_h, n_dot_v = dot(view, h), max(dot(normal, view), LEAST_COSINE)
    reflects = choice < fresnel_dielectric(v_dot_h, ratio)
    beyond = ratio * v_dot_h - sqrt(1.0 - ratio * ratio * (1.0 - v_dot_h * v_dot_h))
    direction = where(reflects, reflect(view, h), beyond * h - ratio * view)
    n_dot_l = where(reflects, dot(normal, direction), -dot(normal, direction))
    eye, light = smith_root(n_dot_v, alpha), smith_root(n_dot_l, alpha)
    both = n_dot_l * (n_dot_v + eye) / (n_dot_l * eye + n_dot_v * light)  # G2 / G1
    weight = where(reflects, both, 2.0 * n_dot_l / (n_dot_l + light))  # G1 beyond
    return record(SAMPLE, direction, vec3(where(n_dot_l > 0.0, weight, 0.0)))
