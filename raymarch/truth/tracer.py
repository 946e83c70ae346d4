"""The picture in float64."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.convert import short
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values, set_values
from raymarch.scene.scene import Scene, check_scene
from raymarch.truth.field import Field
from raymarch.truth.rays import Rays, camera_rays
from raymarch.truth.shading import Surface
from raymarch.truth.visibility import first_hits, is_inside
from raymarch.truth.whitted import light_of

OUTPUTS = ("depth", "normal", "material", "color")


@dataclass(eq=False)
class Truth:
    """A picture of H rows and W columns in float64; row 0 is its top.

    Attributes
    ----------
    depth : (H, W), distance along the unit ray; inf where nothing was hit.
    hit : (H, W) bool.
    residual : (H, W), |field| at the hit; 0 where nothing was hit.
    evaluations : (H, W) int, field values that the search for the hit took.
    gap : (H, W), length of the ray before its end that was not proved free: should something be hidden there, the
        depth is too large by no more. Below 1.5e-8 of the depth, but for rays that touch a surface or graze
        it; inf for a field whose exactness is "estimate", where nothing can be proved.
    position : (3,), where the camera stands. direction : (H, W, 3), the unit rays.
    normal, material, color : see there; computed on first access if they were not asked for.
    """

    depth: NDArray[np.float64]
    hit: NDArray[np.bool_]
    residual: NDArray[np.float64]
    evaluations: NDArray[np.int64]
    gap: NDArray[np.float64]
    position: NDArray[np.float64]
    direction: NDArray[np.float64]
    _surface: Surface = field(repr=False)
    _sky: NDArray[np.float64] = field(repr=False)

    @cached_property
    def normal(self) -> NDArray[np.float64]:
        """(H, W, 3), unit normals out of the solid, from the symbolic gradient; 0 where nothing was hit.

        They are never flipped: seen from inside the solid they point away. Where the gradient vanishes, the normal is
        minus the ray's direction.
        """
        return self._picture(self._surface.normals, np.zeros(3))

    @cached_property
    def material(self) -> NDArray[np.int64]:
        """(H, W), index into `scene.materials` of what has the largest share; -1 where nothing was hit."""
        return self._picture(self._surface.material, np.int64(-1))

    @cached_property
    def color(self) -> NDArray[np.float64]:
        """(H, W, 3), linear RGB, >= 0 and without an upper end; the colour of the sky where nothing was hit."""
        surface = self._surface
        light = light_of(surface) if surface.scene.whitted else surface.light()
        return self._picture(surface.through_fog(light), self._sky)

    def _picture(self, values: Any, background: Any) -> NDArray[Any]:
        made = np.empty((*self.hit.shape, *values.shape[1:]), values.dtype)
        made[...] = background
        made[self.hit] = values
        return made


def truth(
    scene: Scene,
    size: tuple[int, int] = (640, 360),
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    outputs: Sequence[str] = OUTPUTS,
) -> Truth:
    """Trace a scene in float64 on the CPU.

    Parameters
    ----------
    scene : what to trace.
    size : (width, height) in pixels, each >= 1.
    time : seconds, finite.
    params : values of parameters by name, within their ranges; the others keep their defaults.
    outputs : what to compute at once, of "depth", "normal", "material", "color". The rest follows on first access.

    Every ray is marched by steps that a 1-Lipschitz field proves safe (`raymarch.truth.march`), so no surface is
    stepped over, however thin; each hit is then narrowed to a few units in the last place. A field whose
    exactness is "estimate" promises nothing: it is marched by plain steps of half its value, and may have holes.

    From inside a solid |field| is marched: the wall that hides the outside is shown. With f the field,
    n the normal towards the viewer's side, l the unit vector to a light and v the one to the viewer, a surface of
    colour C has the colour

        sum over lights of c (ambient C + visible (C max(n.l, 0) + specular max(r.v, 0)^shininess [n.l > 0]))

    where r = 2 (n.l) n - l, and c is the light's colour times intensity, over d^2 for a point light (Phong 1975).
    `visible` is 0 or 1 for a light with a shadow, else 1. A point light that touches the surface adds nothing to it.

    Raises SceneError for an unknown parameter or output, a value out of range, a size below 1, and a
    field that is NaN somewhere on a ray.
    """
    check_scene("truth", scene)
    width, height = _checked_size(size)
    for name in outputs:
        if not isinstance(name, str) or name not in OUTPUTS:
            raise SceneError(f"truth: output {short(name)}", legal=", ".join(OUTPUTS))
    values = set_values(scene.parameters, params, time)
    pose = scene.pose(values, width / height)
    made = trace(scene, values, pose, camera_rays(pose, width, height), (height, width), pose.pixel(height))
    for name in outputs:
        getattr(made, name)
    return made


def trace(scene: Scene, values: Values, pose: Pose, rays: Rays, shape: tuple[int, int], pixel: float) -> Truth:
    """The truth along rays from where the camera stands, H times W of them, as a picture of shape (H, W).

    pixel : width, at distance 1, of what each ray stands for.
    """
    far = scene.far(pose)
    moment = Field(scene, values)
    inside = is_inside(moment, pose.position)
    roots = first_hits(moment, rays, rays.lines(scene.node.facts, far), inside)
    rows = np.flatnonzero(np.isfinite(roots.t))
    directions, depth = rays.directions[rows], roots.t[rows]
    surface = Surface(scene, values, moment, pose.position, directions, depth, far, inside, pixel)
    residual = np.zeros(roots.t.shape)
    residual[rows] = np.abs(moment.distance(surface.points))
    return Truth(
        depth=roots.t.reshape(shape),
        hit=np.isfinite(roots.t).reshape(shape),
        residual=residual.reshape(shape),
        evaluations=roots.evaluations.reshape(shape),
        gap=roots.gap.reshape(shape),
        position=pose.position,
        direction=rays.directions.reshape(*shape, 3),
        _surface=surface,
        _sky=scene.sky.seen(rays.directions, values).reshape(*shape, 3),
    )


def _checked_size(size: Any) -> tuple[int, int]:
    legal = "(width, height), two integers >= 1"
    if not isinstance(size, tuple | list) or len(size) != 2:
        raise SceneError(f"truth: size = {short(size)}", legal=legal)
    for edge in size:
        if isinstance(edge, bool) or not isinstance(edge, int | np.integer) or edge < 1:
            raise SceneError(f"truth: size = {short(size)}", legal=legal)
    return int(size[0]), int(size[1])
