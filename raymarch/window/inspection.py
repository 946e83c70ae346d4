"""Inspection of the picture: the point under the cursor, and the mean cost of a pixel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from raymarch.errors import RaymarchError
from raymarch.scene.scene import Scene
from raymarch.window.changes import trouble
from raymarch.window.constants import CLICKED
from raymarch.window.pace import scaled
from raymarch.window.pick import Pick, picked, ray_through

if TYPE_CHECKING:
    from raymarch.window.viewer import Viewer


def pick_at(viewer: Viewer, x: float, y: float) -> Pick | None:
    """The pick at a cursor position; its reference values follow later."""
    size = viewer.window.size
    column, row = (int(v) for v in viewer.window.pixel(x, y))
    if not (0 <= column < size[0] and 0 <= row < size[1]):
        return None
    try:
        shot, values = viewer.state.shot(), viewer.state.values
        _prepare_clicks(viewer, shot.scene)
        texels = viewer.picture.probe(shot, size, column, row)
    except RaymarchError as fault:
        trouble(viewer, fault)
        return None
    view = viewer.state.hold()
    origin, ray = ray_through(view, (column, row), size)
    viewer.picks += 1
    pick = picked(viewer.picks, (column, row), texels, origin, ray)
    viewer.inquiry.ask(pick, shot, values, origin, ray)
    return pick


def _prepare_clicks(viewer: Viewer, scene: Scene) -> None:
    """Prepare the shader of clicks with the uniforms that its trial compiled."""
    if scene is not viewer.clicked:
        ready, _ = viewer.clicks.fit(viewer.renderer.prepared(scene, CLICKED))
        viewer.renderer.adopt(scene, ready, CLICKED)
        viewer.clicked = scene


def evaluations(viewer: Viewer) -> float | None:
    """Mean evaluations per pixel, from a picture of a quarter of the size; None until the picture is complete."""
    if not viewer.picture.whole:
        return None
    shot = viewer.state.shot()
    if viewer.evaluated is None or not shot.same(viewer.evaluated[0]):
        renderer = viewer.picture.at(scaled(viewer.window.size, 0.25))
        made = renderer.render(shot.scene, shot.time, shot.params, ("evaluations",), pose=shot.pose)
        viewer.evaluated = (shot, float(made.evaluations.mean()))
    return viewer.evaluated[1]
