"""The picture that a window draws, without a window."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.screen import Screen
from raymarch.scene.camera import look_at
from raymarch.window.pace import Pace
from raymarch.window.picture import Picture
from raymarch.window.shot import Shot, progressive

SIZE = (80, 48)
CAMERA = rm.Camera((0, 1, 5), (0, 0, 0))


@pytest.fixture
def renderer() -> Iterator[rm.Renderer]:
    with rm.Renderer(SIZE) as made:
        yield made


def shot_of(scene: rm.Scene, *, moved: float = 0.0) -> Shot:
    pose = look_at(np.array((moved, 1, 5)), np.zeros(3), np.array((0, 1, 0)), 0.4)
    return Shot(scene, 0.0, {}, pose)


def test_no_draw_depends_on_what_was_bound_before_it(renderer: rm.Renderer) -> None:
    """Each sampler is given a texture of one kind, so that a driver compiles a program once."""
    scene = rm.Scene(rm.sphere(1), CAMERA, quality=rm.Quality(schedule="cones"))
    for call in renderer.draw_calls(scene):
        given = {name for name, value in call.uniforms.items() if hasattr(value, "textures")}
        assert {name for name in call.program.uniforms if name == "u_carried"} <= given
        for name in given:
            assert all(edge & (edge - 1) for edge in call.uniforms[name].size), name


def test_a_moving_picture_marches_no_longer_than_its_budget(renderer: rm.Renderer) -> None:
    """Rays that are marched over several passes wait where they are, and end once nothing moves."""
    scene = progressive(
        rm.Scene(rm.sphere(1) | rm.plane(offset=-1), CAMERA, quality=rm.Quality(steps_per_pass=4, max_steps=512))
    )
    screen = Screen(renderer.context, SIZE)
    picture = Picture(renderer, screen, Pace(budget=1e-3))
    try:
        picture.step(shot_of(scene, moved=0.3), SIZE, still=False)
        picture.step(shot_of(scene), SIZE, still=False)
        assert renderer.history.marched == 1 and not renderer.history.arrived
        while picture.step(shot_of(scene), SIZE, still=True):
            pass
        assert picture.whole and picture.canvas is not None
        with rm.Renderer(SIZE) as other:
            expected = other.render(scene, pose=shot_of(scene).pose).color
        apart = np.abs(picture.canvas.read()[..., :3] - expected).max(axis=-1)
        assert np.mean(apart > 1 / 255) < 1e-3
    finally:
        picture.release()
        screen.release()
