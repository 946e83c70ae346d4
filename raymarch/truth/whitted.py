"""Ways of light through mirrors and glass, all of them: what `Quality(integrator="whitted")` shows, in float64."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.material import SMOOTH
from raymarch.truth.rays import Rays
from raymarch.truth.shading import Surface
from raymarch.truth.visibility import first_hits

Array = NDArray[np.float64]

FAINT = 2.0**-9
"""Ways that bring less than this are not followed: half a step of 8 bits."""


DULL = 2.0 * SMOOTH
"""Roughness that mirrors seen in mirrors have towards lights: their highlights would be specks far below a pixel."""


def reflectance(cosine: Array, ratio: Array) -> Array:
    """Share of unpolarised light that is mirrored where two clear bodies meet, after Fresnel, (N,).

    cosine : to the normal, on the side of the light. ratio : the index of refraction there over that beyond. Beyond
    the critical angle it is 1.
    """
    sine = ratio**2 * (1.0 - cosine**2)
    beyond = np.sqrt(np.maximum(1.0 - sine, 0.0))
    upright = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    lying = (cosine - ratio * beyond) / (cosine + ratio * beyond)
    result: Array = np.where(sine >= 1.0, 1.0, 0.5 * (upright**2 + lying**2))
    return result


def light_of(surface: Surface, weight: Array | None = None, depth: int = 0) -> Array:
    """The light of a surface and of what its mirrored and bent ways meet, without fog, (N, 3).

    weight : share of it that reaches the eye, (N, 3); ways below `FAINT` are left out, and leave their share to the
    other way. depth : surfaces before it; at `Scene.bounces`, the sky stands for what glass would still show.
    """
    n, look, last = len(surface.depth), surface.look, depth == surface.scene.bounces
    weight = np.ones((n, 3)) if weight is None else weight
    through = np.ones(n) if surface.within else look["transmission"][:, 0]
    followed = np.zeros(n) if last else np.clip(2.0 - look["roughness"][:, 0] / SMOOTH, 0.0, 1.0)
    color = np.zeros((n, 3))
    if np.any(through < 1.0):
        color += (1.0 - through)[:, None] * surface.light(followed[:, None])
    if np.any(through > 0.0) and not surface.within:
        color += through[:, None] * (look["emission"] + surface.glint())
    if last:
        return color + through[:, None] * surface.scene.sky.seen(surface.directions, surface.values)
    cosine = np.clip(-np.einsum("ij,ij->i", surface.shading_normals, surface.directions), 0.0, 1.0)
    ratio = look["ior"][:, 0] if surface.within else 1.0 / look["ior"][:, 0]
    back = reflectance(cosine, ratio)
    brightest = weight.max(axis=1)
    back = np.where(back * brightest < FAINT, 0.0, back)
    back = np.where((1.0 - back) * brightest < FAINT, 1.0, back)
    base = look["f0"] * (1.0 - look["metalness"]) + look["color"] * look["metalness"]
    schlick = base + (1.0 - base) * ((1.0 - cosine) ** 5)[:, None]
    share = (1.0 - through) * followed * look["physical"][:, 0]
    mirrored = (through * back)[:, None] + share[:, None] * schlick
    bent = np.broadcast_to((through * (1.0 - back))[:, None], (n, 3))
    color += mirrored * _met(surface, weight * mirrored, _reflected(surface, cosine), depth, crosses=False)
    color += bent * _met(surface, weight * bent, _refracted(surface, cosine, ratio), depth, crosses=True)
    return color


def _reflected(surface: Surface, cosine: Array) -> Array:
    return surface.directions + 2.0 * cosine[:, None] * surface.shading_normals


def _refracted(surface: Surface, cosine: Array, ratio: Array) -> Array:
    beyond = np.sqrt(np.maximum(1.0 - ratio**2 * (1.0 - cosine**2), 0.0))
    along = (ratio * cosine - beyond)[:, None]
    result: Array = ratio[:, None] * surface.directions + along * surface.shading_normals
    return result


def _met(surface: Surface, weight: Array, directions: Array, depth: int, crosses: bool) -> Array:
    """What comes to the surface along directions, (N, 3); 0 where it would be faint.

    crosses : through the surface, from the side on which it is not seen.
    """
    color = np.zeros((len(weight), 3))
    row = np.flatnonzero(weight.max(axis=1) >= FAINT)
    if not row.size:
        return color
    off = surface.offset[row, None] * surface.geometric_normals[row]
    rays = Rays(surface.points[row] + (-off if crosses else off), directions[row])
    inside, within = surface.inside != crosses, surface.within != crosses
    lines = rays.lines(surface.scene.node.facts, 2.0 * surface.far, surface.depth[row])
    roots = first_hits(surface.field, rays, lines, inside)
    hit = np.isfinite(roots.t)
    if not within:
        color[row[~hit]] = surface.scene.sky.seen(rays.directions[~hit], surface.values)
    if not hit.any():
        return color
    absorption = _absorption(surface)[row[hit]]
    met = replace(
        surface,
        origin=rays.origins[hit],
        directions=rays.directions[hit],
        depth=roots.t[hit],
        travelled=(surface.travelled + surface.depth)[row[hit]],
        inside=inside,
        within=within,
        absorption=absorption,
        dull=DULL if surface.scene.lights else 0.0,
    )
    left = np.exp(-absorption * met.depth[:, None]) if within else np.ones_like(absorption)
    color[row[hit]] = left * light_of(met, weight[row[hit]] * left, depth + 1)
    return color


def _absorption(surface: Surface) -> Array:
    """Of the glass that is, or is entered, here, (N, 3): light that is mirrored inside stays in what it came into."""
    return surface.look["absorption"] if surface.absorption is None or not surface.within else surface.absorption
