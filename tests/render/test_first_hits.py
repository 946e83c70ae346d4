"""Rays hit the first surface on their way: no thin solid is passed, and none is hit that a ray only passes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu import Renderer

Frame = tuple[Any, Any]


def drawn(renderer: Renderer, scene: rm.Scene, **quality: Any) -> Frame:
    """Depth and normals of a scene whose solids are all marched."""
    marched = scene.replace(quality=rm.Quality(analytic=False, **quality))
    frame = renderer.render(marched, outputs=("depth", "normal"))
    return frame.depth.copy(), frame.normal.copy()


def test_a_draft_does_not_show_the_inner_side_of_thin_roofs(renderer: Renderer) -> None:
    """Roofs of less than a pixel: a step of a pixel beyond what is certified ends on their inner side."""
    plate = rm.box((1.2, 0.14, 2.2)).translate((0.6, -0.07, 0)).rotate(-0.8, "z").translate((0, 1.2, 0)).mirror("x")
    house = rm.union(plate, rm.box((1.4, 0.8, 1.9)).translate((0, 0.4, 0)), k=1e-3)
    village = rm.union(house.repeat((3.0, None, 3.6), (4, 1, 4)), rm.plane(), k=1e-3)
    scene = rm.Scene(village, rm.Camera((16 * np.sin(1.2), 9, 16 * np.cos(1.2)), (0, 0, 0), fov=40))
    renderer.resize((96, 64))
    _, exact = drawn(renderer, scene, epsilon=0.02)
    _, draft = drawn(renderer, scene, epsilon=0.5)
    beside = [np.roll(exact, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    flat = np.max([np.linalg.norm(other - exact, axis=-1) for other in beside], axis=0) < 0.01
    assert flat.sum() > 4000
    assert not np.sum(flat & (np.sum(exact * draft, axis=-1) < 0.0))


def test_a_ray_that_rises_out_of_steps_is_no_hit(renderer: Renderer) -> None:
    """Above a floor that a blend joins to a ring, rays end within a pixel of a surface that they have passed."""
    ring = rm.torus(1.0, 0.3).rotate(0.3, "x").translate((0, 0.3, 0))
    scene = rm.Scene(rm.union(ring, rm.plane(), k=0.2), rm.Camera((0, 0.35, 5), (0, 0.35, 0), fov=40))
    renderer.resize((96, 54))
    known, _ = drawn(renderer, scene, max_steps=4096)
    for tracer in ("bracketing", "relaxed"):
        depth, _ = drawn(renderer, scene, max_steps=64, tracer=tracer)
        assert not np.sum(np.isfinite(depth) & ~np.isfinite(known)), tracer


@pytest.mark.parametrize(
    ("camera", "quality"),
    [({}, {"analytic": True}), ({}, {"analytic": True, "steps_per_pass": 4}), ({"near": 0.1, "far": 300.0}, {})],
)
def test_walls_around_the_camera_have_no_holes(
    renderer: Renderer, camera: dict[str, float], quality: dict[str, Any]
) -> None:
    """The walls are the faces of the scene's box, where rays end: rounding puts some hits behind that end."""
    node = rm.box((30.1, 11.3, 20.7)) | rm.sphere(0.5).translate((-2, 0, 0))
    scene = rm.Scene(node, rm.Camera((3.3, 0.15, 0.1), (0, 0, 0), fov=60, **camera), quality=rm.Quality(**quality))
    renderer.resize((96, 72))
    assert np.isfinite(renderer.render(scene, outputs=("depth",)).depth).all()
