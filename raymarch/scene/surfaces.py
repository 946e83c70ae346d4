"""The BSDF of all materials of a scene, and the sampling of its lobes for lights with an area."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

from raymarch.errors import SceneError
from raymarch.expr.function import sum_of
from raymarch.expr.node import Expr, expr
from raymarch.expr.vocabulary import (
    dot,
    max,
    min,
    vec3,
    where,
)
from raymarch.scene.bsdf import BSDF, Microfacets, Phong, Values, instance_of
from raymarch.scene.fields import GLOSSY
from raymarch.scene.layers import Blend, Coated
from raymarch.scene.light import Light, density_of, has_area
from raymarch.scene.material import Material
from raymarch.scene.parameter import is_zero
from raymarch.scene.quality import Quality
from raymarch.scene.reflectance import (
    LEAST_COSINE,
    MIN_ALPHA,
    pdf_reflected,
    reflect,
    sample_visible_normal,
)
from raymarch.scene.subsurface import Scattered


def sample_lobes(bsdf: BSDF, values: Values, normal: Expr, view: Expr, u: Expr, choice: Expr) -> Expr:
    """A random direction of one of the lobes that are narrower than `GLOSSY`, for lights with an area.

    u : a vec2, choice : a float, random numbers in [0, 1). The zero vector if there is no such lobe.
    """
    alpha, below = expr(0.0), expr(0.0)
    for width, chance in _narrow(bsdf, values, normal, view):
        alpha = where(choice >= below, width, alpha)
        below = below + chance
    half_vector = sample_visible_normal(normal, view, max(alpha, MIN_ALPHA), u)
    return where(below > 0.0, reflect(view, half_vector), vec3(0.0))


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


def has_disc(light: Light, materials: Sequence[Material], bounces: bool) -> bool:
    """True if light comes from random points of a disc: with a sampled shadow, and where rays bounce from visible
    lights, as mirrors show them; without a shadow only if a material is glossy."""
    if light.shadow:
        return light.soft and (light.penumbra == "sampled" or (bounces and light.visible))
    round_ = not is_zero(light.softness) and any(field.name == "shadow_radius" for field in fields(light))
    return bounces and light.visible and round_ and any(material.glossy for material in materials)


def samples_both(light: Light, materials: Sequence[Material], bounces: bool = False) -> bool:
    """True if surfaces sample their lobes beside the points of a light, because a lobe may be narrower than the light.

    Such a light has an area, and its light or its shadow is sampled at random points. bounces : see `has_disc`.
    """
    if not any(material.glossy for material in materials):
        return False
    area = has_area(light)
    disc = has_disc(light, materials, bounces)
    return disc != area and (disc or density_of(light) is not None)


def bsdf_of(materials: Sequence[Material], quality: Quality) -> BSDF:
    """The BSDF of all materials of a scene. SceneError for several classes of the user's own."""
    settings = quality.masking, quality.energy_compensation and any(m.metallic for m in materials)
    kinds = {"phong" if not m.physical else m.bsdf or "physical" for m in materials}
    base = Microfacets(*settings)
    clear: Microfacets | Coated = Coated(base) if any(m.coated for m in materials) else base
    physical: BSDF = Scattered(clear) if any(m.scatters for m in materials) else clear
    own = list(dict.fromkeys(m.bsdf for m in materials if m.bsdf is not None))
    if len(own) > 1:
        where_ = next(m.where for m in materials if m.bsdf is own[1])
        names = " and ".join(kind.__name__ for kind in own)
        raise SceneError(f"materials with the BSDFs {names}", legal="one class of your own in a scene", where=where_)
    made: list[tuple[BSDF, str]] = [(Phong(), "")] if "phong" in kinds or not kinds else []
    made += [(physical, "physical")] if "physical" in kinds else []
    made += [(instance_of(own[0], settings), "own")] if own else []
    found = made[0][0]
    for bsdf, weight in made[1:]:
        found = Blend(found, bsdf, weight)
    return found
