"""Materials of repeated solids: each cell its own, and none lost where a copy touches the box of all."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import value_of
from raymarch.expr.node import expr
from raymarch.expr.vocabulary import vec3

SIZE = (96, 72)
CAMERA = rm.Camera(position=(3, 4, 5), target=(0, 0, 0))


def color_of(index: Any) -> Any:
    return vec3(rm.hash(index), 0.2 + 0.6 * rm.hash(index + vec3(0.0, 7.0, 0.0)), 0.5)


def tile(index: Any) -> rm.Node:
    paint = rm.Material(color=color_of(index), shininess=10.0 + 20.0 * rm.hash(index))
    return (rm.box((0.8, 0.4, 0.8)).round(0.05) | rm.sphere(0.4).translate((0, 0.3, 0))).material(paint)


def scene(node: rm.Node) -> rm.Scene:
    return rm.Scene(node | rm.plane(offset=-0.25), camera=CAMERA, lights=[rm.Sun((0.3, 1, 0.5), intensity=0.8)])


SCENES = {
    "varied": lambda: rm.repeat_varied(tile, (1, None, 1), (4, 1, 3)),
    "varied and shared": lambda: rm.repeat_varied(
        lambda i: tile(i) | rm.sphere(0.2).translate((0.35, 0.3, 0.3)), (1.2, None, 1.2), (3, 1, 3)
    ),
    "guarded": lambda: (
        rm.box((0.8, 0.5, 0.6)).shear(0.1).material(rm.Material(color=(0.8, 0.2, 0.1))).repeat((1, None, 1), 3)
    ),
    "polar": lambda: (
        (rm.box((0.5, 0.5, 0.3)) - rm.sphere(0.2).translate((0.25, 0.25, 0)))
        .material(rm.Material(color=(0.1, 0.3, 0.8)))
        .translate((1.5, 0, 0))
        .polar(5)
    ),
    "wrapped": lambda: rm.box((6, 1, 0.4)).material(rm.Material(color=(0.1, 0.8, 0.2))).wrap_around(),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_picture_is_the_truth(name: str, renderer: rm.Renderer) -> None:
    shown = scene(SCENES[name]())
    frame, truth = renderer.render(shown), rm.truth(shown, size=renderer.size)
    off = np.abs(frame.color - truth.color).max(axis=2) > 0.01
    assert off.mean() < 0.01  # pixels on an edge may see either side of it
    assert (frame.material != truth.material).mean() < 0.005


def test_a_cell_has_the_color_of_its_index() -> None:
    """Lit from everywhere alike, so that the picture is the colour: seen from above, one cell a column."""
    node = rm.repeat_varied(
        lambda i: rm.box((1.0, 0.5, 1.0)).material(rm.Material(color_of(i), specular=0, ambient=1)), (1, None, 1), 5
    )
    shown = rm.Scene(
        node, lights=[rm.Sun((0, -1, 0))], camera=rm.Camera(position=(0, 6, 0), target=(0, 0, 0), up=(0, 0, -1))
    )
    truth = rm.truth(shown, size=(151, 151))
    for i in (-2, 0, 1):
        for k in (-1, 0, 2):
            column, row = (np.argmin(np.abs(axis)) for axis in _seen_at(truth, shown, i, k))
            wanted = value_of(color_of(expr((float(i), 0.0, float(k)))))
            np.testing.assert_allclose(truth.color[row, column], wanted, atol=1e-9)


def _seen_at(truth: rm.Truth, shown: rm.Scene, x: float, z: float) -> tuple[Any, Any]:
    """How far the columns and rows of a square picture from above miss a point of the top faces."""
    pixels = (np.arange(151) + 0.5) / 151 * 2 - 1
    reach = 5.75 * np.tan(np.radians(shown.camera.fov.data) / 2)
    return pixels * reach - x, pixels * reach - z
