"""What the light makes of a surface: Phong's model, hard shadows, fog."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.light import Light, PointLight, Sun
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.truth.field import Field
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
    origin, directions : from where they are seen, (3,), and along which unit directions, (N, 3).
    depth : distances from the origin, (N,).
    far : how far rays are traced. inside : the origin lies in the solid.
    """

    scene: Scene
    values: Values
    field: Field
    origin: Array
    directions: Array
    depth: Array
    far: float
    inside: bool

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

    @cached_property
    def color(self) -> Array:
        """Linear RGB with fog, (N, 3)."""
        phong = self._phong
        color = np.zeros((len(self.depth), 3))
        for light in self.scene.lights:
            color += self._from(light, phong)
        fog = self.scene.fog
        if fog is not None:
            through = np.exp(-self.values.of(fog.density) * self.depth)[:, None]
            color = self.values.of(fog.color) * (1.0 - through) + color * through
        return color

    @cached_property
    def _phong(self) -> _Phong:
        looks = self.field.looks(self.points)
        return _Phong(looks[:, :3], looks[:, 3:4], looks[:, 4:5], looks[:, 5:])

    @cached_property
    def _shading_normals(self) -> Array:
        """From inside the solid its walls are lit on the side that is seen."""
        if not self.inside:
            return self.normals
        away = np.einsum("ij,ij->i", self.normals, self.directions)[:, None] > 0.0
        return np.where(away, -self.normals, self.normals)

    def _from(self, light: Light, phong: _Phong) -> Array:
        """What one light adds."""
        n = self._shading_normals
        to_light, distance = self._towards(light)
        radiance = self.values.of(light.radiance)
        if isinstance(light, PointLight):
            radiance = radiance / np.where(distance > 0.0, distance, np.inf)[:, None] ** 2
        facing = np.einsum("ij,ij->i", n, to_light)[:, None]
        reflected = 2.0 * facing * n - to_light
        seen = np.maximum(np.einsum("ij,ij->i", reflected, -self.directions)[:, None], 0.0)
        direct = phong.color * np.maximum(facing, 0.0) + phong.specular * seen**phong.shininess * (facing > 0.0)
        if light.shadow:
            direct *= self._visible(to_light, distance, facing[:, 0] > 0.0)[:, None]
        result: Array = radiance * (phong.ambient * phong.color + direct)
        return result

    def _towards(self, light: Light) -> tuple[Array, Array]:
        """Unit vectors to a light and its distance; to a sun it is twice how far rays are traced from the camera,
        for no two points of the scene are farther apart."""
        if isinstance(light, PointLight):
            way = self.values.of(light.position) - self.points
            return unit(way), np.linalg.norm(way, axis=1)
        assert isinstance(light, Sun)
        direction = self.values.of(light.direction)
        return np.broadcast_to(direction, self.points.shape), np.full(len(self.points), 2.0 * self.far)

    def _visible(self, to_light: Array, distance: Array, facing: NDArray[Any]) -> Array:
        """1 where a light is seen from the surface, else 0. What faces away is not asked."""
        row = np.flatnonzero(facing)
        start = self.points[row] + self._offset[row, None] * self._shading_normals[row]
        rays = Rays(start, to_light[row])
        visible = np.zeros(len(facing))
        if row.size:
            box = self.scene.node.facts
            visible[row] = unblocked(self.field, rays, box, distance[row], self.depth[row], self.inside)
        return visible

    @cached_property
    def _offset(self) -> Array:
        """How far shadow rays start off the surface, (N,).

        It must exceed the residual of the hit, some units in the last place of the coordinates. Far more than
        that costs nothing: `GAP` (the square root of a unit) of the distance is a millionth of a pixel. Much less
        would cost time, as a ray that leaves a round surface along its tangent takes 1 / sqrt(offset) steps.
        """
        size = np.linalg.norm(self.origin) + self.depth
        offset: Array = np.maximum(GAP * self.depth, 64 * NOISE * size)
        return offset


@dataclass(frozen=True, slots=True)
class _Phong:
    """Material of each point, mixed: color (N, 3), the others (N, 1)."""

    color: Array
    shininess: Array
    specular: Array
    ambient: Array
