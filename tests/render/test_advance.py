"""Rays that ask how far they are free hit what the float64 reference hits, in scenes where marching is hard."""

from __future__ import annotations

import math

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu import Renderer

SIZE = (48, 27)


def carved(unit: float) -> rm.Node:
    """A carved box, a torus and a capsule on a floor, ten units of the given length from the origin."""
    box = rm.rounded_box((1.4, 1, 1.2), 0.1) - rm.sphere(0.6).translate((0.5, 0.4, 0.5))
    parts = rm.union(box, rm.torus(0.8, 0.2).translate((1.6, 0, 0)), rm.capsule((-1.5, 0, 0), (-1.5, 1, 0), 0.3))
    return parts.scale(unit).translate((10 * unit, 0, 10 * unit)) | rm.plane(offset=-unit)


def far_camera(unit: float) -> rm.Camera:
    return rm.Camera(position=(13 * unit, 4 * unit, 16 * unit), target=(10 * unit, 0, 10 * unit))


SHEETS = [rm.box((2, 2, 0.002)).rotate(0.1 * i, "y").translate((0, 0, -0.3 * i)) for i in range(6)]
SHELLS = [rm.sphere(1).shell(0.004).translate((0.7 * i, 0, -i)) for i in range(4)]
FRONT = rm.Camera(position=(0.7, 0.6, 4), target=(0, 0, 0))
SCENES = {
    "thin sheets with a hole": (rm.union(*SHEETS) - rm.cylinder(0.3, 9).rotate(math.pi / 2, "x"), FRONT),
    "shells behind one another": (rm.union(*SHELLS), FRONT),
    "a grazing floor": (rm.plane() | rm.sphere(0.3).translate((0, 0.3, -8)), rm.Camera((0, 0.02, 0), (0, 0, -10))),
    "a fence": (rm.box((0.02, 1, 0.02)).repeat((0.1, None, 0.1), (40, 1, 3)), FRONT),
    "inside of a room": (rm.box((4, 3, 4)).complement() | rm.sphere(0.5), rm.Camera((1.5, 0.5, 1.5), (0, 0, 0))),
    "1e4 units": (carved(1e3), far_camera(1e3)),
    "1e6 units": (carved(1e5), far_camera(1e5)),
}


@pytest.mark.parametrize("name", SCENES)
def test_every_hit_is_that_of_the_reference(renderer: Renderer, name: str) -> None:
    node, camera = SCENES[name]
    scene = rm.Scene(node, camera, quality=rm.Quality(tracer="advance", analytic=False, schedule="single"))
    if renderer.size != SIZE:
        renderer.resize(SIZE)
    depth, true = renderer.render(scene, outputs=("depth",)).depth, rm.truth(scene, SIZE).depth
    hit = np.isfinite(true)
    np.testing.assert_array_equal(np.isfinite(depth), hit)
    pixel = 2.0 * math.tan(math.radians(float(camera.fov) / 2)) / SIZE[1]
    assert np.all(np.abs(depth[hit] - true[hit]) < pixel * true[hit])


def test_it_takes_few_evaluations(renderer: Renderer) -> None:
    node, camera = SCENES["1e4 units"]
    counts = {}
    for tracer in ("bracketing", "advance"):
        scene = rm.Scene(node, camera, quality=rm.Quality(tracer=tracer, analytic=False, schedule="single"))
        counts[tracer] = renderer.render(scene, outputs=("evaluations",)).evaluations.mean()
    assert counts["advance"] < 0.4 * counts["bracketing"]
