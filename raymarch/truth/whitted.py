"""Whitted ray tracing of mirrors and glass in float64: the reference of `Quality(integrator="whitted")`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.fields import SMOOTH
from raymarch.scene.reflectance import fresnel_dielectric
from raymarch.truth.bsdf import values_of
from raymarch.truth.light import lights_shown
from raymarch.truth.rays import Rays
from raymarch.truth.shading import Surface
from raymarch.truth.visibility import first_hits

Array = NDArray[np.float64]

THROUGHPUT_CUTOFF = 2.0**-9
"""Paths with a throughput below this are not traced: half a step of 8 bits."""

MIN_ROUGHNESS = 2.0 * SMOOTH
"""Lower bound of the roughness towards lights at secondary hits: highlights of mirrors in mirrors would be far smaller
than a pixel."""


def radiance(surface: Surface, weight: Array | None = None, depth: int = 0) -> Array:
    """Outgoing radiance of a surface with its reflected and refracted rays, without fog, (N, 3).

    weight : throughput from the surface to the camera, (N, 3). A ray with a throughput below `THROUGHPUT_CUTOFF` is not
    traced; its weight goes to the other ray. depth : number of surfaces before this one. At `Scene.bounces` glass
    returns the radiance of the sky.
    """
    n, material, last = len(surface.depth), surface.material_values, depth == surface.scene.bounces
    weight = np.ones((n, 3)) if weight is None else weight
    transmission = np.ones(n) if surface.in_glass else material["transmission"][:, 0]
    traced = [np.zeros(n) if last else part for part in surface.reflection.traced()]
    color = np.zeros((n, 3))
    if np.any(transmission < 1.0):
        color += (1.0 - transmission)[:, None] * surface.light(traced)
    if np.any(transmission > 0.0) and not surface.in_glass:
        color += transmission[:, None] * (material["emission"] + surface.dielectric_highlights())
    if last:
        return color + transmission[:, None] * surface.scene.sky.radiance_along(
            surface.directions, surface.values, lighting=True
        )
    cosine = np.clip(-np.einsum("ij,ij->i", surface.shading_normals, surface.directions), 0.0, 1.0)
    ratio = material["ior"][:, 0] if surface.in_glass else 1.0 / material["ior"][:, 0]
    fresnel = values_of(fresnel_dielectric, cosine, ratio)
    throughput = weight.max(axis=1)
    fresnel = np.where(fresnel * throughput < THROUGHPUT_CUTOFF, 0.0, fresnel)
    fresnel = np.where((1.0 - fresnel) * throughput < THROUGHPUT_CUTOFF, 1.0, fresnel)
    reflected = (transmission * fresnel)[:, None] + (1.0 - transmission)[:, None] * surface.reflection.mirrored(traced)
    refracted = np.broadcast_to((transmission * (1.0 - fresnel))[:, None], (n, 3))
    directions = surface.directions + 2.0 * cosine[:, None] * surface.shading_normals
    color += reflected * _trace_secondary(surface, weight * reflected, directions, depth, crosses=False)
    directions = _refract(surface, cosine, ratio)
    color += refracted * _trace_secondary(surface, weight * refracted, directions, depth, crosses=True)
    return color


def _refract(surface: Surface, cosine: Array, ratio: Array) -> Array:
    beyond = np.sqrt(np.maximum(1.0 - ratio**2 * (1.0 - cosine**2), 0.0))
    normal_scale = (ratio * cosine - beyond)[:, None]
    result: Array = ratio[:, None] * surface.directions + normal_scale * surface.shading_normals
    return result


def _trace_secondary(surface: Surface, weight: Array, directions: Array, depth: int, crosses: bool) -> Array:
    """Radiance that arrives from some directions, (N, 3); 0 where the throughput is below the cutoff.

    crosses : the rays start on the far side of the surface.
    """
    color = np.zeros((len(weight), 3))
    row = np.flatnonzero(weight.max(axis=1) >= THROUGHPUT_CUTOFF)
    if not row.size:
        return color
    off = surface.offset[row, None] * surface.geometric_normals[row]
    rays = Rays(surface.points[row] + (-off if crosses else off), directions[row])
    inside, in_glass = surface.inside != crosses, surface.in_glass != crosses
    lines = rays.lines(surface.scene.node.facts, 2.0 * surface.far, surface.depth[row])
    seen = surface.field.of("reflection")
    roots = first_hits(seen, rays, lines, inside)
    hit = np.isfinite(roots.t)
    # surfaces find visible lights by themselves, except through glass
    light, distance = lights_shown(surface.scene.lights, surface.values, rays.origins, rays.directions, roots.t)
    shown = np.isfinite(distance)
    if crosses or surface.in_glass:
        absorbed = _absorption(surface)[row[shown]] if in_glass else 0.0
        color[row[shown]] = np.exp(-absorbed * distance[shown, None]) * light[shown]
    row, hit, rays = row[~shown], hit[~shown], Rays(rays.origins[~shown], rays.directions[~shown])
    roots = replace(roots, t=roots.t[~shown])
    if not in_glass:
        color[row[~hit]] = surface.scene.sky.radiance_along(rays.directions[~hit], surface.values, lighting=True)
    if not hit.any():
        return color
    absorption = _absorption(surface)[row[hit]]
    hit_surface = replace(
        surface,
        field=seen,
        origin=rays.origins[hit],
        directions=rays.directions[hit],
        depth=roots.t[hit],
        travelled=(surface.travelled + surface.depth)[row[hit]],
        inside=inside,
        in_glass=in_glass,
        absorption=absorption,
        min_roughness=MIN_ROUGHNESS if surface.scene.lights else 0.0,
    )
    transmittance = np.exp(-absorption * hit_surface.depth[:, None]) if in_glass else np.ones_like(absorption)
    color[row[hit]] = transmittance * radiance(hit_surface, weight[row[hit]] * transmittance, depth + 1)
    return color


def _absorption(surface: Surface) -> Array:
    """Absorption of the glass that contains or begins at the surface, (N, 3). Internal reflections stay in the same
    glass."""
    if surface.absorption is None or not surface.in_glass:
        return surface.material_values["absorption"]
    return surface.absorption
