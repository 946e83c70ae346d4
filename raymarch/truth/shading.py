"""What the light makes of a surface: two models, shadows, emission, fog."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.light import Light, PointLight
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.scene.sky import harmonics_at
from raymarch.truth.field import Field
from raymarch.truth.footprint import footprint
from raymarch.truth.light import (
    PARTS,
    Incoming,
    directional_albedo,
    incoming,
    microfacets,
    multiscatter_albedo,
    parts_of,
    soft_visibility,
)
from raymarch.truth.march import GAP, NOISE
from raymarch.truth.rays import Rays, unit
from raymarch.truth.visibility import unblocked

Array = NDArray[np.float64]


@dataclass(eq=False)
class Surface:
    """The points that were hit, N of them. What is not asked for is not computed.

    Attributes
    ----------
    scene, values, field : what was hit, at which moment.
    origin, directions : from where they are seen, (3,) or (N, 3), and along which unit directions, (N, 3).
    depth : distances from the origin, (N,).
    far : how far rays are traced. inside : the origin lies in the solid.
    pixel : width of a pixel at distance 1. travelled : way of the light before the origin, (N,) or a number.
    within : it lies in glass, which the light has entered on its way, and which takes `absorption` of it, (N, 3), on a
        unit of length. dull : lights shine on anything smoother as on that.
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
    within: bool = False
    absorption: Array | None = None
    dull: float = 0.0
    travelled: Array | float = 0.0

    @cached_property
    def points(self) -> Array:
        """The points, (N, 3)."""
        return self.origin + self.depth[:, None] * self.directions

    @cached_property
    def normals(self) -> Array:
        """Unit normals out of the solid, (N, 3); where there is no gradient, they face the viewer."""
        slope = self.field.gradient(self.points)
        return unit(np.where(slope.any(axis=1, keepdims=True), slope, -self.directions))

    @cached_property
    def weights(self) -> Array:
        """Share of each material, (N, len(scene.materials))."""
        return self.field.material_weights(self.points)

    @property
    def material(self) -> NDArray[np.int64]:
        """Index of the material with the largest share, (N,)."""
        return np.argmax(self.weights, axis=1)

    def light(self, followed: Any = 0.0) -> Array:
        """What the surface gives off and gets from lights and sky, (N, 3).

        followed : share of its reflection that is not taken from the sky, because its way is followed, (N, 1).
        """
        color = self.look["emission"] + self._from_sky(followed)
        for light in self.scene.lights:
            color = color + self._from(light)
        return color

    def glint(self) -> Array:
        """What it mirrors of lights where it is the outside of glass, (N, 3)."""
        f0 = ((self.look["ior"] - 1.0) / (self.look["ior"] + 1.0)) ** 2
        coat = {"color": np.zeros(3), "metalness": np.zeros(1), "f0": f0, "physical": np.ones(1)}
        outside = replace(self)
        outside.look = {name: np.broadcast_to(coat.get(name, value), value.shape) for name, value in self.look.items()}
        return sum((outside._from(light) for light in self.scene.lights), np.zeros_like(self.points))

    def through_fog(self, color: Array) -> Array:
        """What fog leaves of a colour at the surface, (N, 3) -> (N, 3)."""
        fog = self.scene.fog
        if fog is None:
            return color
        through = np.exp(-self.values.of(fog.density) * self.depth)[:, None]
        return self.values.of(fog.color) * (1.0 - through) + color * through

    @cached_property
    def _open(self) -> Array:
        """Share of the ambient light that corners leave, (N, 1)."""
        occlusion = self.scene.occlusion
        if occlusion is None:
            return np.ones((len(self.depth), 1))
        reach, strength, decay = (float(self.values.of(v)) for v in occlusion.expressions)
        side = -1.0 if self.inside else 1.0
        missing, weights = np.zeros(len(self.depth)), 0.0
        for i in range(occlusion.steps):
            far = reach * (i + 1) / occlusion.steps
            rise = side * self.field.distance(self.points + far * self.shading_normals)
            missing += decay**i * np.clip(1.0 - rise / far, 0.0, 1.0)
            weights += decay**i
        return np.clip(1.0 - strength * missing / weights, 0.0, 1.0)[:, None]

    def _from_sky(self, followed: Any) -> Array:
        """What the sky adds, by the rules of `Sky(light=True)`, (N, 3)."""
        sky, look, n = self.scene.sky, self.look, self.shading_normals
        if not sky.light:
            return np.zeros((len(self.depth), 3))
        light = sky.harmonics(self.values)
        even = np.maximum(harmonics_at(n) @ light, 0.0)
        seen = np.clip(-np.einsum("ij,ij->i", n, self.directions), 0.0, 1.0)[:, None]
        mirrored = self.directions + 2.0 * seen * n
        masking = self.scene.quality.masking
        rough, metal, color, f0 = self._roughness, look["metalness"], look["color"], look["f0"]
        around = (
            sky.seen(mirrored, self.values) * (1.0 - rough) + np.maximum(harmonics_at(mirrored) @ light, 0.0) * rough
        )
        base = f0 * (1.0 - metal) + color * metal
        share, edge = directional_albedo(seen, rough, masking)
        back = base * share + edge
        inside = (1.0 - edge) * (1.0 - f0) * (1.0 - metal)
        several: Any = 0.0
        if self.scene.quality.energy_compensation:
            several = even * multiscatter_albedo(seen, color, metal, rough, masking)
        glossy = (1.0 - followed) * (around * back + several) + even * inside * color
        ambient = look["open"] * self._open
        result: Array = ambient * (look["physical"] * glossy + (1.0 - look["physical"]) * color * even)
        return result

    @cached_property
    def look(self) -> dict[str, Array]:
        """Material of each point, mixed: colours (N, 3), the others (N, 1)."""
        if not self.field.mapped:
            return self.field.looks(self._inner)
        width = self.scene.quality.footprint * self.pixel * (self.travelled + self.depth)
        return self.field.looks(self._inner, self.normals, *footprint(self.normals, self.directions, width))

    @property
    def _inner(self) -> Array:
        """Where materials are evaluated, (N, 3): for patterns a little inside the solid, so that a face on the jump of
        a pattern does not show the rounding of each hit."""
        if not self.field.patterned:
            return self.points
        return self.points - self.offset[:, None] * self.normals

    @property
    def _roughness(self) -> Array:
        """Towards lights and sky, (N, 1)."""
        return np.maximum(self.look["roughness"], self.dull)

    @cached_property
    def shading_normals(self) -> Array:
        """Bent by the material, and from inside the solid those of the walls on the side that is seen."""
        normals = self.normals
        if self.field.mapped:
            side = np.where(self._away, -1.0, 1.0)
            bent = unit(normals - self.look["tilt"])
            low = 0.01 + side * np.einsum("ij,ij->i", bent, self.directions)[:, None]
            normals = unit(bent - side * np.maximum(low, 0.0) * self.directions)
        return np.where(self._away, -normals, normals) if self.inside else normals

    @property
    def geometric_normals(self) -> Array:
        """Normals of the solid, on the side of the shading normals, (N, 3)."""
        return np.where(self._away, -self.normals, self.normals) if self.inside else self.normals

    @cached_property
    def _away(self) -> NDArray[np.bool_]:
        """Where the solid's normal points away from the viewer, (N, 1)."""
        return np.einsum("ij,ij->i", self.normals, self.directions)[:, None] > 0.0

    def _from(self, light: Light) -> Array:
        """What one light adds. One whose points are sampled is the mean of even points of its disc."""
        come = incoming(light, self.values, self.points, self.far)
        if not (light.soft and light.penumbra == "sampled"):
            return self._answered(light, come)
        width = self.values.of(light.softness)
        spread = width / np.maximum(come.distance, 1e-300) if isinstance(light, PointLight) else width
        spread = np.broadcast_to(spread, come.distance.shape)
        return sum((self._answered(light, part) for part in parts_of(come, spread)), np.zeros_like(self.points)) / PARTS

    def _answered(self, light: Light, come: Incoming) -> Array:
        """What comes from one direction: the answers of the two models, each by its share."""
        n_dot_l = np.einsum("ij,ij->i", self.shading_normals, come.direction)
        visible = self._visible(light, come, (n_dot_l > 0.0) & come.radiance.any(axis=1))[:, None]
        share = self.look["physical"]
        added = np.zeros_like(self.points)
        if np.any(share < 1.0):
            added += (1.0 - share) * self._phong(come, n_dot_l[:, None], visible)
        if np.any(share > 0.0):
            look = self.look
            answer = microfacets(
                self.shading_normals,
                -self.directions,
                come.direction,
                look["color"],
                look["metalness"],
                self._roughness,
                look["f0"],
                self.scene.quality.masking,
                self.scene.quality.energy_compensation,
            )
            added += share * come.radiance * visible * answer
        return added

    def _phong(self, come: Incoming, n_dot_l: Array, visible: Array) -> Array:
        look = self.look
        reflected = 2.0 * n_dot_l * self.shading_normals - come.direction
        seen = np.maximum(np.einsum("ij,ij->i", reflected, -self.directions)[:, None], 0.0)
        gloss = look["specular"] * seen ** look["shininess"] * (n_dot_l > 0.0)
        direct = visible * (look["color"] * np.maximum(n_dot_l, 0.0) + gloss)
        result: Array = come.radiance * (look["open"] * self._open * look["ambient"] * look["color"] + direct)
        return result

    def _visible(self, light: Light, come: Incoming, asked: NDArray[Any]) -> Array:
        """Share of a light that is seen from the surface, 0 to 1. What is not asked is 0 for a light with a shadow."""
        if not light.shadow:
            return np.ones(len(asked))
        visible = np.zeros(len(asked))
        if isinstance(light, PointLight) and light.shadow_radius is not None:
            beyond = come.distance >= self.values.of(light.shadow_radius)
            visible[beyond] = 1.0
            asked = asked & ~beyond
        row = np.flatnonzero(asked)
        if not row.size:
            return visible
        offset = self.offset[row]
        rays = Rays(self.points[row] + offset[:, None] * self.shading_normals[row], come.direction[row])
        box, end = self.scene.node.facts, come.distance[row]
        if light.soft and light.penumbra != "sampled":
            side = -1.0 if self.inside else 1.0
            visible[row] = soft_visibility(
                light, self.values, lambda points: side * self.field.distance(points), rays, box, offset, end
            )
        else:
            visible[row] = unblocked(self.field, rays, box, end, self.depth[row], self.inside)
        return visible

    @cached_property
    def offset(self) -> Array:
        """How far off the surface shadow rays start, and how far inside of it patterns are asked, (N,).

        It must exceed the residual of the hit, some units in the last place of the coordinates. Far more than
        that costs nothing: `GAP` (the square root of a unit) of the distance is a millionth of a pixel. Much less
        would cost time, as a ray that leaves a round surface along its tangent takes 1 / sqrt(offset) steps.
        """
        size = np.linalg.norm(self.origin, axis=-1) + self.depth
        offset: Array = np.maximum(GAP * self.depth, 64 * NOISE * size)
        return offset
