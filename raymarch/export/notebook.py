"""Scenes, nodes and frames in notebooks: as pictures, and as pages that can be turned."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from raymarch.errors import PlanError, SceneError
from raymarch.export.live import Live
from raymarch.expr.calls import checked
from raymarch.expr.convert import integer, short
from raymarch.gpu import frame
from raymarch.gpu.still import render
from raymarch.scene.parameter import set_values
from raymarch.scene.scene import Scene, check_scene, in_notebook, scene_of
from raymarch.scene.studio import staged
from raymarch.sdf.node import Node

SIZE = (400, 300)
"""Size of the pictures of scenes and nodes."""

FLAT = 0.1
"""Height to which a flat shape is extruded for its picture, over its larger extent."""


def png(shown: Scene | Node) -> bytes:
    """The picture of a scene or a node as a PNG file; a flat shape is extruded."""
    return frame.png(render(as_scene(shown), SIZE))


def as_scene(shown: Scene | Node) -> Scene:
    """The scene itself, or a node in a studio."""
    if not isinstance(shown, Node):
        check_scene("show", shown)
        return shown
    if shown.dimension == 3:
        return staged(scene_of(shown))
    low, high = shown.bounds
    extent = float(max((high - low)[:2]))
    return staged(scene_of(shown.extrude(FLAT * extent if 0 < extent < float("inf") else FLAT)))


@checked
def show(scene: Scene | Node, size: tuple[int, int] = (640, 400), time: float = 0.0, params: Any = None) -> Any:
    """A scene or node as the last value of a notebook cell: a page that can be turned, with a slider for each Param.

    Parameters
    ----------
    scene : a Scene, or a solid, which is shown in a studio.
    size : (width, height) in pixels, each from 1 to 4096.
    time, params : initial values.

    Returns
    -------
    Any
        A widget if the package anywidget is installed and this is a notebook: `params`, `time`, `view`, `orbit` and
        `pan` of the widget are those of the page, in both directions (see `raymarch.export.widget`). Else an object
        that shows the page alone.

    Raises
    ------
    SceneError : an unknown parameter or a size that is no pair of integers from 1 to 4096.

    Notes
    -----
    A scene that a page cannot hold is shown as a picture.
    """
    given = as_scene(scene)
    if not isinstance(size, tuple | list) or len(size) != 2:
        raise SceneError(f"show: size = {short(size)}", legal="(width, height) in pixels")
    width, height = (integer("show: size", edge, 1, 4096, "integers from 1 to 4096") for edge in size)
    live = Live(given, set_values(given.parameters, params, time, given.where), (width, height))
    if not in_notebook() or find_spec("anywidget") is None:
        return live
    from raymarch.export.widget import widget_class

    try:
        return widget_class()(live)
    except PlanError:
        return live
