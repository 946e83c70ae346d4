"""Further views of a scene, by which a setting is judged before it is recommended.

A setting that is right in one picture may lose rays in the next: a limit of the steps, or a wide epsilon, is just
enough for one camera and one width of a pixel. So each setting of the march is drawn from two more cameras, one nearer,
one from beside and with pixels of half the width, and held against their references.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.cost.errors import Errors, measure
from raymarch.cost.reference import Reference, reference
from raymarch.cost.settings import Setting
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import Values, set_values
from raymarch.scene.scene import Scene
from raymarch.truth.large import field_of

NEARER = (0.5, 0.25, 0.125)
"""Parts of the way to the target that the first camera moves: the first that leads to free space."""
BESIDE = (30.0, -30.0, 15.0, -15.0)
"""Degrees by which the second camera goes round the target: the first that leads to free space."""
FINER = 0.5
"""Width of its pixels, relative to those of the picture."""
FREE = 0.1
"""A place is free if the field there is at least this part of the field at the scene's own camera."""

Made = tuple[Scene, Pose]


@dataclass(frozen=True, slots=True)
class View:
    """A further view. name : where it looks from. pose : of its camera. known : its reference, of depth alone."""

    name: str
    pose: Pose
    known: Reference


def cameras(
    scene: Scene, size: tuple[int, int], time: float = 0.0, params: Mapping[str, Any] | None = None
) -> dict[str, Made]:
    """Scenes that differ in their cameras, each with the pose of its camera, by the name of the view.

    size : (width, height) of the picture.
    """
    values = set_values(scene.parameters, params, time)
    aspect = size[0] / size[1]
    pose, target = scene.pose(values, aspect), np.asarray(scene.target(values), np.float64)
    free = _free_places(scene, values, pose)
    away, up = pose.position - target, pose.frame[:, 1]
    near = _first(free, [target + (1.0 - share) * away for share in NEARER], pose.position)
    beside = _first(free, [target + _turned(away, up, np.radians(angle)) for angle in BESIDE], pose.position)
    zoom = NEARER[0] if pose.orthographic else 1.0
    found = {
        "nearer": _moved(scene, pose, near, target, values, zoom),
        "from beside, with pixels of half the width": _moved(scene, pose, beside, target, values, FINER),
    }
    return {name: (made, made.pose(values, aspect)) for name, made in found.items()}


def views(
    scene: Scene,
    size: tuple[int, int],
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    progress: Callable[[str], None] | None = None,
) -> list[View]:
    """The further views of a scene with their references, from the cache if they were computed before."""
    found = cameras(scene, size, time, params)
    tell = progress or (lambda _: None)

    def view(name: str) -> View:
        made, pose = found[name]
        return View(name, pose, reference(made, size, time, params, 0, lambda what: tell(f"{what}, {name}")))

    return [view(name) for name in found]


def seen_from(
    view: View, scene: Scene, setting: Setting, renderer: Any, time: float, params: Mapping[str, Any] | None
) -> Errors:
    """The errors of a setting in a view. renderer : of the size of the picture."""
    frame = renderer.render(setting.of(scene), time, params, ("depth",), pose=view.pose)
    return measure(view.known, frame.array("depth"))


def _free_places(scene: Scene, values: Values, pose: Pose) -> Callable[[NDArray[np.float64]], bool]:
    """Whether a camera may stand at a place: on the same side of the surfaces as the scene's own, and not at one."""
    field = field_of(scene, values)
    own = float(field.distance(pose.position[None])[0])

    def free(place: NDArray[np.float64]) -> bool:
        return bool(np.sign(own) * float(field.distance(place[None])[0]) >= FREE * abs(own))

    return free


def _first(
    free: Callable[[NDArray[np.float64]], bool], places: list[NDArray[np.float64]], own: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The first free place; that of the scene's own camera if there is none."""
    return next((place for place in places if free(place)), own)


def _turned(away: NDArray[np.float64], up: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """A vector turned about the axis `up` of a camera (Rodrigues 1840)."""
    beside = np.cross(up, away)
    turned: NDArray[np.float64] = (
        np.cos(angle) * away + np.sin(angle) * beside + (1.0 - np.cos(angle)) * (up @ away) * up
    )
    return turned


def _moved(
    scene: Scene,
    pose: Pose,
    place: NDArray[np.float64],
    target: NDArray[np.float64],
    values: Values,
    zoom: float,
) -> Scene:
    """The scene with a camera of plain numbers at a place, whose picture shows `zoom` times as much."""
    camera = scene.camera
    optics: dict[str, Any] = {"near": pose.near, "far": pose.far if np.isfinite(pose.far) else None}
    if pose.half_height is not None:
        optics["height"] = 2.0 * zoom * pose.half_height
    else:
        optics["fov"] = float(np.degrees(2.0 * np.arctan(zoom * pose.tan_half_fov)))
    if camera.lens:
        optics["focus"] = pose.focus
    up = np.asarray(values.of(camera.up), np.float64)
    where = {"position": tuple(place.tolist()), "target": tuple(target.tolist()), "up": tuple(up.tolist())}
    return scene.replace(camera=camera.replace(**where, **optics, view_from=None))
