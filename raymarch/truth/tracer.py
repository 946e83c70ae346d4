"""Render a picture in float64 on the CPU."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.calls import checked
from raymarch.expr.convert import short
from raymarch.scene.camera import Pose
from raymarch.scene.legal import warn_of_values
from raymarch.scene.parameter import ParamValue, Values, set_values
from raymarch.scene.scene import Scene, as_scene
from raymarch.scene.shown import Shown
from raymarch.sdf.node import Node
from raymarch.truth.field import Field
from raymarch.truth.fog import fogged, sky_seen
from raymarch.truth.large import field_of
from raymarch.truth.light import GOLDEN_ANGLE, lights_shown
from raymarch.truth.march import Roots
from raymarch.truth.rays import Rays, camera_rays, lens_rays
from raymarch.truth.shading import Surface
from raymarch.truth.visibility import first_hits, is_inside
from raymarch.truth.whitted import radiance

OUTPUTS = ("depth", "normal", "material", "color")


@dataclass(eq=False, repr=False)
class Truth:
    """A reference picture of H rows and W columns in float64; row 0 is the top.

    Attributes
    ----------
    depth : (H, W), distance along the unit ray; inf where nothing was hit.
    hit : (H, W) bool.
    residual : (H, W), |field| at the hit; 0 where nothing was hit.
    evaluations : (H, W) int, number of field evaluations of the search for the hit.
    gap : (H, W), length before the end of the ray that was not proved free. The error of the depth is at most this.
        Below 1.5e-8 of the depth, except for rays that touch or graze a surface. inf for a field whose exactness is
        "estimate": nothing can be proved there.
    position : (3,), position of the camera. origin, direction : (H, W, 3), ray origins and unit ray directions.
    normal, material, color : see the properties; computed on first access if they were not requested.
    """

    depth: NDArray[np.float64]
    hit: NDArray[np.bool_]
    residual: NDArray[np.float64]
    evaluations: NDArray[np.int64]
    gap: NDArray[np.float64]
    position: NDArray[np.float64]
    origin: NDArray[np.float64]
    direction: NDArray[np.float64]
    _surfaces: Sequence[tuple[NDArray[np.intp], Surface]] = field(repr=False)
    _sky: NDArray[np.float64] = field(repr=False)
    _of: Shown | None = field(repr=False, default=None)
    _shown: tuple[NDArray[np.bool_], NDArray[np.float64]] | None = field(repr=False, default=None)
    _mean: Callable[[], NDArray[np.float64]] | None = field(repr=False, default=None)
    _finish: Callable[[NDArray[np.float64]], NDArray[np.float64]] = field(repr=False, default=lambda color: color)

    def __repr__(self) -> str:
        height, width = self.hit.shape
        return f"<Truth {width}x{height}: {int(self.hit.sum())} of {self.hit.size} rays hit>"

    def __getstate__(self) -> dict[str, Any]:
        """Pickle all arrays, without the scene's functions."""
        arrays = {name: getattr(self, name) for name in ("normal", "material", "color")}
        return {**{n: v for n, v in vars(self).items() if not n.startswith("_")}, **arrays}

    @cached_property
    def normal(self) -> NDArray[np.float64]:
        """(H, W, 3), unit outward normals from the symbolic gradient; 0 where nothing was hit.

        They are never flipped: from inside the solid they point away from the viewer. Where the gradient vanishes, the
        normal is the negative ray direction.
        """
        return self._picture(lambda surface: surface.normals, np.zeros(3))

    @cached_property
    def material(self) -> NDArray[np.int64]:
        """(H, W), index into `scene.materials` of the material with the largest weight; -1 where nothing was hit."""
        return self._picture(lambda surface: surface.material, np.int64(-1))

    @cached_property
    def color(self) -> NDArray[np.float64]:
        """(H, W, 3), linear RGB, >= 0, unbounded above; the colour of the sky where nothing was hit.

        Visible lights are in the colour alone: the other arrays are those of the solids behind them.
        """
        if self._mean is not None:
            return self._finish(self._mean())

        def seen(surface: Surface) -> NDArray[np.float64]:
            return surface.apply_fog(radiance(surface) if surface.scene.whitted else surface.light())

        color = self._picture(seen, self._sky)
        if self._shown is not None:
            color[self._shown[0]] = self._shown[1]
        return self._finish(color)

    def _picture(self, values_of: Callable[[Surface], Any], background: Any) -> NDArray[Any]:
        values = [(rows, values_of(surface)) for rows, surface in self._surfaces]
        result = np.empty((self.hit.size, *values[0][1].shape[1:]), values[0][1].dtype)
        result[...] = np.broadcast_to(background, (*self.hit.shape, *result.shape[1:])).reshape(result.shape)
        for rows, found in values:
            result[rows] = found
        return result.reshape(*self.hit.shape, *result.shape[1:])


@checked
def truth(
    scene: Scene | Node,
    size: tuple[int, int] = (640, 360),
    time: float = 0.0,
    params: Mapping[str, ParamValue] | None = None,
    outputs: Sequence[str] = OUTPUTS,
) -> Truth:
    """Trace a scene in float64 on the CPU.

    Parameters
    ----------
    scene : the scene to render, or a solid, which is put into a default one.
    size : (width, height) in pixels, each >= 1.
    time : seconds, finite.
    params : values of parameters by name, within their ranges; the others keep their defaults.
    outputs : arrays to compute at once, of "depth", "normal", "material", "color". The others are computed on first
        access.

        sum over lights of c (ambient C + visible (C max(n.l, 0) + specular max(r.v, 0)^shininess [n.l > 0]))

    Returns
    -------
    Truth

    Raises
    ------
    SceneError : an unknown parameter or output, a value out of range, a size below 1, and a field that is NaN somewhere
        on a ray.

    Notes
    -----
    Rays are marched by steps that are safe for a 1-Lipschitz field (`raymarch.truth.march`), so no surface is stepped
    over, however thin. Each hit is then refined to a few units in the last place. A field whose exactness is "estimate"
    gives no guarantee: it is marched by steps of half its value, and the picture may have holes.

    From inside a solid |field| is marched, so the inner side of its surface is visible. Let n be the normal on the
    viewer's side, l the unit vector to a light and v the unit vector to the viewer. A Phong surface of colour C has the
    colour

    where r = 2 (n.l) n - l, and c is the light's colour times intensity, over d^2 for a point light (Phong 1975).
    `visible` is 0 or 1 for a light with a shadow, else 1. A point light that touches the surface adds nothing to it.

    With `Camera(aperture=...)` or `shutter=...`, the colour is the mean over `Quality(samples=...)` points of the lens
    and times, at least 16. All other arrays are those of rays from the centre of the lens at the frame's time.
    """
    scene = as_scene("truth", scene)
    width, height = checked_size(size)
    for name in outputs:
        if not isinstance(name, str) or name not in OUTPUTS:
            raise SceneError(f"truth: output {short(name)}", legal=", ".join(OUTPUTS))
    values = set_values(scene.parameters, params, time)
    warn_of_values(scene.node, values.params, values.time)
    pose = scene.pose(values, width / height)
    result = trace(scene, values, pose, camera_rays(pose, width, height), (height, width), pose.pixel(height))
    if scene.motion_blur:
        result._mean = lambda: _mean_over_times(scene, values, (width, height))
    elif pose.aperture > 0.0:
        result._mean = lambda: _mean_over_lens(scene, values, pose, (width, height), _lens_points(scene))
    result._of = Shown(scene.node, values, pose)
    result._finish = lambda color: finished(scene, values, color)
    for name in outputs:
        getattr(result, name)
    return result


def finished(scene: Scene, values: Values, color: NDArray[np.float64]) -> NDArray[np.float64]:
    """A whole picture in linear light, (H, W, 3), after the post effects of its scene."""
    for effect in scene.post:
        color = effect.apply(color, effect.numbers(values))
    return color


LENS_POINTS = 16
"""Smallest number of points of a lens."""

RAYS_AT_ONCE = 200_000
"""Rays through the lens that are traced together; this bounds the memory."""


def _lens_points(scene: Scene) -> NDArray[np.float64]:
    """The points of the lens that a reference picture is averaged over, (N, 2) in radii."""
    return lens_points(max(scene.quality.samples, LENS_POINTS))


def lens_points(count: int) -> NDArray[np.float64]:
    """Points of a lens on a spiral (Vogel 1979), each of which stands for the same area, (count, 2) in radii."""
    numbers = np.arange(count)
    radius, angle = np.sqrt((numbers + 0.5) / count), 2.0 * np.pi * GOLDEN_ANGLE * numbers
    return np.asarray(radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1), np.float64)


def _mean_over_times(scene: Scene, values: Values, size: tuple[int, int]) -> NDArray[np.float64]:
    """The mean colour over even times while the shutter is open, each with another point of the lens."""
    points, seconds = _lens_points(scene), scene.camera.open_seconds(values)
    count = len(points)
    points = points[np.random.default_rng(0).permutation(count)]  # else the radius would grow with time
    total = np.zeros((size[1], size[0], 3))
    for i in range(count):
        then = replace(values, time=values.time + seconds * ((i + 0.5) / count - 0.5))
        pose = scene.pose(then, size[0] / size[1])
        total += _mean_over_lens(scene, then, pose, size, points[i : i + 1])
    return total / count


def _mean_over_lens(
    scene: Scene, values: Values, pose: Pose, size: tuple[int, int], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The mean colour over points of the lens, (N, 2) in radii."""
    width, height = size
    count = len(points)
    total = np.zeros((height, width, 3))
    for some in np.array_split(points, min(count, 1 + count * width * height // RAYS_AT_ONCE)):
        parts = [lens_rays(pose, camera_rays(pose, width, height), point) for point in some]
        origins = [np.broadcast_to(part.origins, part.directions.shape) for part in parts]
        rays = Rays(np.concatenate(origins), np.concatenate([part.directions for part in parts]))
        traced = trace(scene, values, pose, rays, (len(some) * height, width), pose.pixel(height))
        total += traced.color.reshape(len(some), height, width, 3).sum(axis=0)
    return total / count


def trace(
    scene: Scene,
    values: Values,
    pose: Pose,
    rays: Rays,
    shape: tuple[int, int],
    pixel: float,
    node: Node | None = None,
) -> Truth:
    """Trace H times W rays of a camera; the result is a picture of shape (H, W).

    pixel : width of the footprint of each ray at distance 1, or of an orthographic camera at all distances.
    node : the part of the scene's solid that the rays can meet; None for all. With a part, there are no colours.
    """
    far = scene.far(pose, values)
    scene_field = field_of(scene, values, node)
    roots, sides = _first_hits_of_camera(scene, scene_field, pose, rays, far)
    near, end = pose.near / (rate := rays.directions @ pose.view), pose.far / rate
    surfaces = []
    residual = np.zeros(roots.t.shape)
    for inside, side in sides:
        if not side.size:
            continue
        rows = side[np.isfinite(roots.t[side])]
        origins = rays.origins[0] if len(rays.origins) == 1 else rays.origins[rows]
        along = origins, rays.directions[rows], roots.t[rows]
        surface = Surface(
            scene, values, scene_field, *along, far, inside, pixel, parallel=pose.orthographic, near=near[rows]
        )
        residual[rows] = np.abs(scene_field.distance(surface.points))
        surfaces.append((rows, surface))
    starts = rays.at(np.arange(len(near)), near)
    light, distance = lights_shown(scene.lights, values, starts, rays.directions, np.minimum(roots.t, end) - near)
    lit = np.isfinite(distance)
    origins, distance = np.broadcast_to(rays.origins, rays.directions.shape)[lit], (near + distance)[lit]
    shown = fogged(scene, values, light[lit], origins, rays.directions[lit], distance, near[lit]) if lit.any() else None
    return Truth(
        depth=roots.t.reshape(shape),
        hit=np.isfinite(roots.t).reshape(shape),
        residual=residual.reshape(shape),
        evaluations=roots.evaluations.reshape(shape),
        gap=roots.gap.reshape(shape),
        position=pose.position,
        origin=np.broadcast_to(rays.origins, rays.directions.shape).reshape(*shape, 3),
        direction=rays.directions.reshape(*shape, 3),
        _surfaces=surfaces,
        _sky=sky_seen(scene, values, rays.origins, rays.directions, near, end).reshape(*shape, 3),
        _shown=None if shown is None else (lit.reshape(shape), shown),
    )


def _first_hits_of_camera(
    scene: Scene, scene_field: Field, pose: Pose, rays: Rays, far: float
) -> tuple[Roots, list[tuple[bool, NDArray[np.intp]]]]:
    """The first hits between the clip planes, and the rays that start outside and inside the solid."""
    facts, every = scene.node.facts, np.arange(len(rays.directions))
    if len(rays.origins) == 1 and pose.near == 0.0:
        end = np.minimum(far, pose.far / (rays.directions @ pose.view)) if np.isfinite(pose.far) else far
        inside = is_inside(scene_field, rays.origins[0])
        return first_hits(scene_field, rays, rays.lines(facts, end), inside), [(inside, every)]
    rate = rays.directions @ pose.view
    start, end = pose.near / rate, np.minimum(far, pose.far / rate)
    cut = Rays(rays.at(every, start), rays.directions)
    starts_inside = scene_field.distance(cut.origins) < 0.0
    found = Roots(np.full(len(every), np.inf), np.zeros(len(every), np.int64), np.zeros(len(every)))
    sides = [(inside, np.flatnonzero(starts_inside == inside)) for inside in (False, True)]
    for inside, side in sides:
        if not side.size:
            continue
        part = Rays(cut.origins[side], cut.directions[side])
        lines = part.lines(facts, end[side] - start[side], start[side])
        roots = first_hits(scene_field, part, lines, inside)
        found.t[side], found.evaluations[side], found.gap[side] = roots.t + start[side], roots.evaluations, roots.gap
    return found, sides


def checked_size(size: Any) -> tuple[int, int]:
    legal = "(width, height), two integers >= 1"
    if not isinstance(size, tuple | list) or len(size) != 2:
        raise SceneError(f"truth: size = {short(size)}", legal=legal)
    for edge in size:
        if isinstance(edge, bool) or not isinstance(edge, int | np.integer) or edge < 1:
            raise SceneError(f"truth: size = {short(size)}", legal=legal)
    return int(size[0]), int(size[1])
