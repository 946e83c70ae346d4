"""A scene with a parameter that the window's tests open, edit and break, and its picture without a window."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import raymarch as rm
from tests.support.window_driver import Session

View = Callable[..., Session]

SCENE = """import raymarch as rm

RADIUS = rm.Param("radius", 1.0, 0.5, 2.0)
ball = rm.sphere(RADIUS).material(rm.Material(color=(0.8, 0.2, 0.1)))
floor = rm.box((4, 0.2, 4)).translate((0, -1.2, 0))
scene = rm.Scene(
    ball | floor,
    camera=rm.Camera(position=(0, 1, 6), target=(0, 0, 0)),
)
"""
SIZE = (320, 200)
MIDDLE = (160, 100)


def drawn(scene: rm.Scene, radius: float | None = 1.0) -> Any:
    """The picture with a value of the parameter; None is its default."""
    with rm.Renderer(SIZE) as renderer:
        params = {} if radius is None else {"radius": radius}
        return np.asarray(renderer.render(scene, params=params).image()).astype(int)


def scene_of(text: str, camera: rm.Camera | None = None) -> rm.Scene:
    namespace: dict[str, Any] = {}
    exec(text, namespace)
    scene: rm.Scene = namespace["scene"]
    return scene if camera is None else rm.Scene(scene.node, camera)
