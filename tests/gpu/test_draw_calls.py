"""Passes that are prepared ahead and drawn into textures that stay on the device."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import bound, value_of
from raymarch.gpu.context import Context
from raymarch.gpu.prepare import prepare
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.resource_cache import KEPT
from raymarch.gpu.tiles import tiles_of
from raymarch.scene.parameter import Values

SIZE = (40, 30)
RADIUS = rm.Param("radius", 1.0, 0.2, 2.0)
SCENE = rm.Scene(rm.sphere(RADIUS) | rm.box(1).translate((1.5, 0, 0)))


@pytest.fixture
def renderer(egl: Context) -> Iterator[Renderer]:
    with Renderer(SIZE, context=egl) as made:
        yield made


def test_draw_calls_draw_what_render_gives(renderer: Renderer) -> None:
    frame = renderer.render(SCENE)
    (call,) = renderer.draw_calls(SCENE)
    call.target.clear()
    for tile in tiles_of(SIZE):
        call.draw(tile)
    assert np.array_equal(call.target.read()[..., :3], frame.color)


def test_calls_of_an_open_shutter_keep_the_textures_of_all_samples(renderer: Renderer) -> None:
    """Lights as data, and more versions of moving rows than are kept between frames."""
    balls = [rm.sphere(0.1).translate((0.3 * k - 1, 0.3 * rm.time, 0)) for k in range(8)]
    lights = [rm.PointLight((rm.time + k, 3, 1), intensity=2) for k in range(10)]
    quality = rm.Quality(samples=40, objects="data")
    scene = rm.Scene(rm.union(*balls), rm.Camera((0, 0, 4), (0, 0, 0), shutter=0.5), lights, quality=quality)
    expected = renderer.render(scene).color
    calls = renderer.draw_calls(scene)
    for call in calls:
        call.draw()
    assert np.array_equal(calls[-1].target.read()[..., :3], expected)
    renderer.render(scene)
    assert renderer.resources.objects["data"] <= KEPT + 2


def test_a_pose_takes_the_place_of_the_camera(renderer: Renderer) -> None:
    other = rm.Camera(position=(0, 0, -5), target=(0, 0, 0))
    pose = other.pose(Values({}), None)
    (call,) = renderer.draw_calls(SCENE, pose=pose)
    call.draw()
    seen = call.target.read()[..., :3]
    expected = renderer.render(rm.Scene(SCENE.node, camera=other)).color
    assert np.array_equal(seen, expected)
    assert not np.array_equal(seen, renderer.render(SCENE).color)


def test_one_texel_is_that_of_the_picture(renderer: Renderer) -> None:
    (call,) = renderer.draw_calls(SCENE, outputs=("depth",))
    call.target.clear((9.0, 9.0, 9.0, 9.0))
    call.draw((20, SIZE[1] - 1 - 15, 1, 1))
    whole = call.target.read(0)
    assert np.array_equal(call.target.read_texel(20, 15), whole[15, 20])
    assert np.count_nonzero(np.any(whole != 9.0, axis=-1)) == 1
    with pytest.raises(IndexError, match="40 x 30"):
        call.target.read_texel(40, 0)


def test_a_parameter_neither_plans_nor_compiles_again(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    renderer.render(SCENE)
    before = renderer.compiled

    def refuse(*_: Any) -> None:
        raise AssertionError("planned again")

    monkeypatch.setattr("raymarch.gpu.prepared_scenes.assembled", refuse)
    pictures = [renderer.render(SCENE, params={"radius": r}).color for r in (0.5, 1.5)]
    assert renderer.compiled == before
    assert not np.array_equal(*pictures)


def test_a_scene_whose_parts_were_exchanged_is_planned_again(renderer: Renderer) -> None:
    scene = rm.Scene(rm.sphere())
    red = renderer.render(scene).color
    scene = scene.replace(sky=rm.Sky((1, 0, 0)))
    assert not np.array_equal(red, renderer.render(scene).color)


def test_a_borrowed_context_stays_open(egl: Context) -> None:
    with Renderer(SIZE, context=egl) as first:
        before = first.render(SCENE).color
    assert not egl.released
    with Renderer(SIZE, context=egl) as second:
        assert np.array_equal(second.render(SCENE).color, before)


def test_scenes_are_prepared_in_another_thread(renderer: Renderer) -> None:
    """While one thread has parameters bound, another reads its own; and equal expressions stay one object."""
    expected = renderer.render(SCENE).color
    found: list[Any] = []

    def work() -> None:
        found.append(value_of(RADIUS))
        scene = rm.Scene(rm.sphere(RADIUS) | rm.box(1).translate((1.5, 0, 0)))
        found.append((scene, prepare(scene)))

    with bound({"radius": 0.3}, 0.0):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
        assert value_of(RADIUS) == 0.3
    default, (scene, prepared) = found
    assert default == 1.0
    renderer.adopt(scene, prepared)
    before = renderer.compiled
    assert np.array_equal(renderer.render(scene).color, expected)
    assert renderer.compiled == before, "the same text was compiled twice"
