"""Shading of surfaces in float64: lights and sky on the scene's BSDF, shadows, emission, ambient occlusion, fog."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.light import Dimming, Light, power_heuristic
from raymarch.scene.light_kinds import PointLight, SphereLight
from raymarch.scene.parameter import Values
from raymarch.scene.relief import shading_normal
from raymarch.scene.scene import Scene
from raymarch.scene.sky import harmonics_at
from raymarch.scene.surfaces import bsdf_of, has_disc, samples_both
from raymarch.truth.bsdf import Reflection, values_of
from raymarch.truth.field import Field
from raymarch.truth.fog import fogged
from raymarch.truth.light import (
    DISC_SAMPLES,
    LOBE_SAMPLES,
    Incoming,
    area_samples,
    disc_density,
    disc_met,
    disc_samples,
    incoming,
    light_density,
    lobe_numbers,
    met_by,
    of_sphere,
    soft_visibility,
)
from raymarch.truth.march import GAP, NOISE
from raymarch.truth.rays import Rays, footprint, unit
from raymarch.truth.visibility import unblocked

Array = NDArray[np.float64]


@dataclass(eq=False)
class Surface:
    """N hit points. Values are computed on first access.

    scene, values, field : the scene, its parameter values and its field.
    origin, directions : ray origins, (3,) or (N, 3), and unit ray directions, (N, 3).
    depth : distances from the origin, (N,).
    far : far distance of camera rays. near : distances of the camera's near plane, (N,) or a number.
    inside : the origin lies in the solid.
    pixel : width of a pixel at distance 1, or at all distances if camera rays are `parallel`. travelled : path length
        from the camera to the origin, (N,) or a number.
    in_glass : the origin lies in glass that the path has entered; its absorption coefficient is `absorption`, (N, 3),
        per unit of length. min_roughness : lower bound of the roughness towards lights and sky.
    """

    scene: Scene
    values: Values
    field: Field
    origin: Array
    directions: Array
    depth: Array
    far: float
    inside: bool
    pixel: float
    in_glass: bool = False
    absorption: Array | None = None
    min_roughness: float = 0.0
    travelled: Array | float = 0.0
    parallel: bool = False
    near: Array | float = 0.0

    @cached_property
    def points(self) -> Array:
        """Hit points, (N, 3)."""
        return self.origin + self.depth[:, None] * self.directions

    @cached_property
    def normals(self) -> Array:
        """Unit outward normals, (N, 3); where the gradient is 0, they face the viewer."""
        gradient = self.field.gradient(self.points)
        return unit(np.where(gradient.any(axis=1, keepdims=True), gradient, -self.directions))

    @cached_property
    def weights(self) -> Array:
        """Weight of each material, (N, len(scene.materials))."""
        return self.field.material_weights(self.points)

    @property
    def material(self) -> NDArray[np.int64]:
        """Index of the material with the largest weight, (N,)."""
        return np.argmax(self.weights, axis=1)

    def light(self, traced: Sequence[Array] | None = None) -> Array:
        """Outgoing radiance: emission and reflected light of emitters and sky, (N, 3).

        traced : fraction of each lobe that a traced ray replaces, so the sky does not add it, (N,); None for 0.
        """
        color = self.material_values["emission"] + self._from_sky(traced)
        for light in self.scene.lights:
            color = color + self._from_light(light)
        return color

    def dielectric_highlights(self) -> Array:
        """Specular highlights of the lights on the outside of glass, (N, 3)."""
        f0 = ((self.material_values["ior"] - 1.0) / (self.material_values["ior"] + 1.0)) ** 2
        coat = {"color": np.zeros(3), "metalness": np.zeros(1), "f0": f0, "physical": np.ones(1)}
        outside = replace(self)
        outside.material_values = {
            name: np.broadcast_to(coat.get(name, value), value.shape) for name, value in self.material_values.items()
        }
        return sum((outside._from_light(light) for light in self.scene.lights), np.zeros_like(self.points))

    @property
    def _dimming(self) -> Dimming | None:
        return None if self.scene.fog is None else self.scene.fog.transmittance

    def apply_fog(self, color: Array) -> Array:
        """Attenuate a colour at the surface by the fog, (N, 3) -> (N, 3)."""
        return fogged(self.scene, self.values, color, self.origin, self.directions, self.depth, self.near)

    @cached_property
    def _ambient_occlusion(self) -> Array:
        """Ambient occlusion factor, 1 where nothing occludes, (N, 1)."""
        occlusion = self.scene.occlusion
        if occlusion is None:
            return np.ones((len(self.depth), 1))
        side = -1.0 if self.inside else 1.0
        return self.field.of("shadow").ambient_occlusion(self.points, self.shading_normals, side)[:, None]

    def _from_sky(self, traced: Sequence[Array] | None) -> Array:
        """Reflected light of the sky, see `Sky(light=True)`, (N, 3)."""
        sky, material, n = self.scene.sky, self.material_values, self.shading_normals
        if not sky.lights:
            return np.zeros((len(self.depth), 3))
        light = sky.harmonics(self.values)
        n_dot_v = np.clip(-np.einsum("ij,ij->i", n, self.directions), 0.0, 1.0)[:, None]
        reflected = self.directions + 2.0 * n_dot_v * n
        mean, blurred = (np.maximum(harmonics_at(about) @ light, 0.0) for about in (n, reflected))
        around = np.broadcast_to(sky.radiance_along(reflected, self.values, lighting=True), n.shape)
        if traced is None:
            traced = [np.zeros(len(n)) for _ in self.reflection.traced()]
        found = self._regularized.reflect_sky(mean, around, blurred, traced)
        result: Array = material["ambient_visibility"] * self._ambient_occlusion * found
        return result

    @cached_property
    def reflection(self) -> Reflection:
        """The BSDF of all materials at the points."""
        bsdf = bsdf_of(self.scene.materials, self.scene.quality)
        return Reflection(bsdf, self.material_values, self.shading_normals, -self.directions)

    @cached_property
    def material_values(self) -> dict[str, Array]:
        """Blended material values at each point: colours (N, 3), the others (N, 1)."""
        if not self.field.mapped:
            return self.field.material_values(self._material_points)
        path = np.ones_like(self.depth) if self.parallel else self.travelled + self.depth
        width = self.scene.quality.footprint * self.pixel * path
        return self.field.material_values(
            self._material_points, self.normals, *footprint(self.normals, self.directions, width)
        )

    @property
    def _material_points(self) -> Array:
        """Points where materials are evaluated, (N, 3).

        Patterns are evaluated slightly inside the solid: on a face that coincides with a discontinuity of the pattern,
        rounding errors of the hits would be visible.
        """
        if not self.field.patterned:
            return self.points
        return self.points - self.offset[:, None] * self.normals

    @cached_property
    def _regularized(self) -> Reflection:
        """The reflection towards lights and sky, with the roughness bounded from below."""
        at, material = self.reflection, self.material_values
        rough = {name: np.maximum(material[name], self.min_roughness) for name in at.bsdf.rough}
        return replace(at, material=material | rough)

    @cached_property
    def shading_normals(self) -> Array:
        """Normals perturbed by bump and normal maps, on the viewer's side where the origin lies in or on the solid."""
        normals = self.normals
        if any(material.relief for material in self.scene.materials):
            slopes = self.material_values["bump_gradient"]
            bent = values_of(shading_normal, normals, -self.directions, slopes)
            normals = np.where(np.any(slopes != 0.0, axis=-1)[..., None], bent, normals)
        return np.where(self._turned, -normals, normals)

    @property
    def geometric_normals(self) -> Array:
        """Geometric normals on the side of the shading normals, (N, 3)."""
        return np.where(self._turned, -self.normals, self.normals)

    @cached_property
    def _turned(self) -> NDArray[np.bool_]:
        """Whether the outward normal points away from the viewer, who is in the solid or on its surface, (N, 1).

        On the surface, as where solids are thinner than a hit, the shader's `visible_side` keeps normals at a cosine
        below a quarter.
        """
        cosine = np.einsum("ij,ij->i", self.normals, self.directions)
        away = cosine > 0.0 if self.inside else (cosine > 0.25) & (self.depth == 0.0)
        return np.asarray(away)[:, None]

    def _from_light(self, light: Light) -> Array:
        """Reflected light of one emitter: of a light with an area or a sampled penumbra, the mean over points of it."""
        chosen = area_samples(light)
        centres = (incoming(light, self.values, self.points, self.far, u, self._dimming) for u in chosen)
        if samples_both(light, self.scene.materials, self.scene.bouncing):
            return self._from_both(light, centres, len(chosen))
        if isinstance(light, SphereLight) and not self._has_disc(light):
            centre = next(centres)
            width = self._width(light, centre)
            incident, part = of_sphere(centre, width, self.shading_normals)
            upright = np.minimum(width, np.einsum("ij,ij->i", self.shading_normals, incident.direction))
            return self._reflected(light, incident, upright, part)
        several = len(chosen) * (DISC_SAMPLES if self._has_disc(light) else 1)
        samples = (self._reflected(light, part) for centre in centres for part in self._points(light, centre))
        return sum(samples, np.zeros_like(self.points)) / several

    def _from_both(self, light: Light, centres: Iterator[Incoming], count: int) -> Array:
        """The same of points of the light and directions of the lobes, with the weights of the shader."""
        points = self.points
        met: Callable[[Array], Incoming] = partial(met_by, light, self.values, points, self.far, self._dimming)
        density: Callable[[Incoming], Array] = partial(light_density, light, self.values, points)
        samples = centres
        if self._has_disc(light):
            centre = next(centres)
            width = self._width(light, centre)
            count, samples = DISC_SAMPLES, disc_samples(centre, width)
            met, density = partial(disc_met, centre, width), partial(disc_density, centre, width)

        def reflected(incident: Incoming, sampled: bool) -> Array:
            """The weighted light of a sample of the light, or of the lobes."""
            other = self._regularized.pdf_lobes(incident.direction)
            weight = values_of(power_heuristic, np.full(len(other), not sampled), density(incident), other)
            return self._reflected(light, replace(incident, radiance=weight[:, None] * incident.radiance))

        from_light = sum((reflected(part, True) for part in samples), np.zeros_like(points)) / count
        directions = (self._regularized.sample_lobes((u, v, choice)) for u, v, choice in lobe_numbers().tolist())
        from_lobes = (reflected(met(direction), False) for direction in directions)
        return from_light + sum(from_lobes, np.zeros_like(points)) / LOBE_SAMPLES

    def _width(self, light: Light, incident: Incoming) -> Array:
        """The sine of the angular radius of a light's disc, (N,)."""
        width = self.values.of(light.disc_width)
        spread = width / np.maximum(incident.distance, 1e-300) if light.has_position else width
        return np.broadcast_to(spread, incident.distance.shape)

    def _points(self, light: Light, incident: Incoming) -> Iterable[Incoming]:
        """The points of a light's disc, or the light itself."""
        return disc_samples(incident, self._width(light, incident)) if self._has_disc(light) else [incident]

    def _has_disc(self, light: Light) -> bool:
        """True if random points of a light's disc cast its shadow."""
        return has_disc(light, self.scene.materials, self.scene.bouncing)

    def _reflected(
        self, light: Light, incident: Incoming, width: Array | None = None, part: Array | float = 1.0
    ) -> Array:
        """Reflected light from one direction, and the light that arrives from all directions.

        width : sine of the light's angular radius, (N,); None for that of its whole disc. part : of the light that
        arrives from that direction.
        """
        width = self._width(light, incident) if width is None else width
        n_dot_l = np.einsum("ij,ij->i", self.shading_normals, incident.direction)
        needed = (n_dot_l > 0.0) & incident.radiance.any(axis=1)
        visible = (part * self._visibility(light, incident, needed, width))[:, None]
        value, ambient = self._regularized.eval(incident.direction)
        dimmed = self.material_values["ambient_visibility"] * self._ambient_occlusion * ambient
        result: Array = incident.radiance * (dimmed + visible * value)
        return result

    def _visibility(self, light: Light, incident: Incoming, needed: NDArray[Any], width: Array) -> Array:
        """Visible fraction of a light, 0 to 1. It is 0 where not `needed`, if the light has a shadow.

        The rays end before what touches the light. width : sine of its angular radius, (N,).
        """
        if not light.shadow:
            return np.ones(len(needed))
        visible = np.zeros(len(needed))
        if isinstance(light, PointLight) and light.shadow_radius is not None:
            beyond = incident.distance >= self.values.of(light.shadow_radius)
            visible[beyond] = 1.0
            needed = needed & ~beyond
        row = np.flatnonzero(needed)
        if not row.size:
            return visible
        offset = self.offset[row]
        rays = Rays(self.points[row] + offset[:, None] * self.shading_normals[row], incident.direction[row])
        box, end = self.scene.node.facts, incident.distance[row] - 64.0 * offset
        blocking = self.field.of("shadow")
        if light.soft and not self._has_disc(light):
            side = -1.0 if self.inside else 1.0
            reading = blocking.undivided
            divisor = None if blocking.certified and blocking.divisor == 1.0 else blocking.divisor
            visible[row] = soft_visibility(
                light.penumbra, width[row], lambda points: side * reading(points), rays, box, offset, end, divisor
            )
        else:
            visible[row] = unblocked(blocking, rays, box, end, self.depth[row], self.inside)
        return visible

    @cached_property
    def offset(self) -> Array:
        """Offset of secondary rays from the surface, and of pattern evaluations into the solid, (N,).

        It must exceed the residual of the hit, some units in the last place of the coordinates. A far larger offset
        does no harm: `GAP` (the square root of a unit) of the distance is a millionth of a pixel. A much smaller one
        would cost time: a ray that leaves a round surface along its tangent takes 1 / sqrt(offset) steps.
        """
        size = np.linalg.norm(self.origin, axis=-1) + self.depth
        offset: Array = np.maximum(GAP * self.depth, 64 * NOISE * size)
        return offset
