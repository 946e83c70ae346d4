"""The picture that a window draws, without a window."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.srgb import linear_to_srgb
from raymarch.gpu.screen import Screen
from raymarch.gpu.views import VIEWS, scale_of
from raymarch.gpu.views import picture as picture_of
from raymarch.scene.camera import look_at
from raymarch.window.pace import Pace
from raymarch.window.picture import Picture, _Part
from raymarch.window.reference import from_centre
from raymarch.window.shot import Shot, preview, progressive
from tests.support.window_driver import alike

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
        values = {name: value[0] if isinstance(value, tuple) else value for name, value in call.uniforms.items()}
        given = {name: value.size for name, value in values.items() if hasattr(value, "textures")}
        assert {name for name in call.program.uniforms if name == "u_carried"} <= given.keys()
        for name, size in given.items():
            assert all(edge & (edge - 1) for edge in size), name


def test_a_moving_picture_marches_no_longer_than_its_budget(renderer: rm.Renderer) -> None:
    """Rays that are marched over several passes wait where they are, and end once nothing moves."""
    scene = progressive(
        rm.Scene(
            rm.sphere(1) | rm.plane(offset=-1),
            CAMERA,
            quality=rm.Quality(steps_per_pass=4, max_steps=64, analytic=False),
        )
    )
    screen = Screen(renderer.context, SIZE)
    picture = Picture(renderer, screen, Pace(budget=1e-3))
    try:
        picture.step(shot_of(scene, moved=0.3), SIZE, still=False)
        picture.step(shot_of(scene), SIZE, still=False)
        assert renderer.history.march.passes == 1 and not renderer.history.march.arrived
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


def test_a_moving_picture_leaves_lights_out_at_the_end_of_its_budget(renderer: rm.Renderer) -> None:
    """It says how many it has. The still picture has all."""
    lamps = [rm.PointLight((np.sin(k), 2, np.cos(k)), intensity=0.2, shadow=True) for k in range(40)]
    scene = progressive(rm.Scene(rm.sphere(1) | rm.plane(offset=-1), CAMERA, lights=lamps))
    assert scene.quality.lights_per_pass == "auto"
    screen = Screen(renderer.context, SIZE)
    picture = Picture(renderer, screen, Pace(budget=1e-3))
    try:
        picture.step(shot_of(scene), SIZE, still=False)
        assert picture.drawn.lights == (1, 40)
        while picture.step(shot_of(scene), SIZE, still=True):
            pass
        assert picture.whole and picture.drawn.lights is None and picture.canvas is not None
        with rm.Renderer(SIZE) as other:
            whole = other.render(scene, pose=shot_of(scene).pose).color
        np.testing.assert_array_equal(picture.canvas.read()[..., :3], whole)
    finally:
        picture.release()
        screen.release()


@pytest.mark.parametrize(
    "view", ["depth", "normal", "iterations", "slice", "boxes", "all_evaluations", "shadow_evaluations"]
)
def test_a_view_is_the_one_of_the_renderer(renderer: rm.Renderer, view: str) -> None:
    scene = rm.Scene(rm.sphere(1) | rm.box((4, 0.2, 4)), CAMERA, [rm.Sun(shadow=True)])
    shot = replace(shot_of(progressive(scene)), view=view)
    screen = Screen(renderer.context, SIZE)
    picture = Picture(renderer, screen, Pace(budget=1e3))
    try:
        while picture.step(shot, SIZE, still=True):
            pass
        with rm.Renderer(SIZE) as other:
            frame = other.render(shot.scene, pose=shot.pose, outputs=VIEWS[view])
        expected = np.asarray(picture_of(frame, view, scene).convert("RGB"))
        assert picture.canvas is not None
        seen = np.asarray(255 * linear_to_srgb(picture.canvas.read()[..., :3]) + 0.5, int)
        assert alike(seen, expected)
        scale = scale_of(frame, view)
        assert (picture.scale is None) == (scale is None) == (view in ("normal", "boxes"))
        if scale is not None:
            assert picture.scale is not None and picture.scale.quantity.split(",")[0] == scale.quantity.split(",")[0]
            assert picture.scale.low == pytest.approx(scale.low, rel=1e-5)
            assert picture.scale.high == pytest.approx(scale.high, rel=0.05)
        assert picture.drawn.share == 1.0 and picture.drawn.samples == picture.drawn.wanted == 1
    finally:
        picture.release()
        screen.release()


def test_progress_counts_what_is_drawn(renderer: rm.Renderer) -> None:
    shot = shot_of(progressive(rm.Scene(rm.sphere(1), CAMERA)))
    screen = Screen(renderer.context, SIZE)
    picture = Picture(renderer, screen, Pace(budget=1e-6), samples=3)
    try:
        shares = []
        while picture.step(shot, SIZE, still=True):
            shares.append(picture.drawn.share)
        assert shares == sorted(shares) and shares[-1] == 1.0 and len(set(shares)) >= 10
        assert 0.0 <= shares[0] < 0.5
    finally:
        picture.release()
        screen.release()


def test_a_post_effect_follows_the_coarse_picture_and_the_refined_one(renderer: rm.Renderer) -> None:
    lamp = rm.sphere(0.5).material(rm.Material(emission=(9, 6, 3)))
    scene = progressive(rm.Scene(lamp | rm.plane(offset=-1), CAMERA, post=[rm.Bloom(0.5, 0.1)]))
    screen = Screen(renderer.context, SIZE)
    picture = Picture(renderer, screen, Pace(), samples=2)
    try:
        while picture.step(shot_of(scene), SIZE, still=True):
            pass
        assert picture.canvas is not None
        with rm.Renderer(SIZE) as other:
            twice = scene.replace(quality=scene.quality.replace(samples=2, temporal="off"))
            expected = other.render(twice, pose=shot_of(scene).pose).color
        assert np.abs(picture.canvas.read()[..., :3] - expected).max() <= 1e-6 * expected.max()
    finally:
        picture.release()
        screen.release()


def test_a_slow_picture_moves_as_a_preview(renderer: rm.Renderer) -> None:
    """Without shadows; still, it is the picture itself, in tiles that replace the preview from the centre."""
    lamp = rm.Sun((1, 0.3, -0.2), intensity=3, shadow=True, softness=0.2)
    scene = progressive(rm.Scene(rm.sphere(1) | rm.plane(offset=-1), CAMERA, lights=[lamp]))
    cheap = preview(scene)
    assert cheap is not None and not any(light.shadow for light in cheap.lights) and cheap.node is scene.node
    screen = Screen(renderer.context, SIZE)
    picture = Picture(renderer, screen, Pace(budget=1.0))

    def colors(of: rm.Scene, moved: float, size: tuple[int, int]) -> np.ndarray:
        with rm.Renderer(size) as other:
            return other.render(of, pose=shot_of(of, moved=moved).pose).color

    def shown() -> np.ndarray:
        assert picture.canvas is not None
        return picture.canvas.read()[..., :3]

    try:
        picture.pace.drawn(1e6, 1)
        assert picture.pace.slow(SIZE)
        for moved in (0.1, 0.2):
            picture.step(shot_of(scene, moved=moved), SIZE, still=False)
        assert not picture.whole and not picture.preview
        without, with_shadows = (colors(of, 0.2, picture.drawn.size).mean() for of in (cheap, scene))
        assert abs(shown().mean() - without) < 0.3 * abs(with_shadows - without)
        while picture.step(shot_of(scene, moved=0.2), SIZE, still=True):
            pass
        apart = np.abs(shown() - colors(scene, 0.2, SIZE)).max(axis=-1)
        assert picture.whole and np.mean(apart > 1 / 255) < 1e-3

        # While another process compiles the scene, its preview is drawn, moving and still, and is not the whole.
        picture.compiling = scene
        while picture.step(shot_of(scene, moved=0.3), SIZE, still=True):
            pass
        assert picture.preview and picture.resting and not picture.whole
        apart = np.abs(shown() - colors(cheap, 0.3, SIZE)).max(axis=-1)
        assert np.mean(apart > 1 / 255) < 1e-3
    finally:
        picture.release()
        screen.release()


def test_a_scene_whose_time_is_unknown_moves_as_the_preview_at_hand(renderer: rm.Renderer) -> None:
    """Its program was compiled elsewhere while its preview moved: nothing is drawn whole before tiles tell its time. If
    it is never still, because its own time moves it, it is tried after some frames."""
    lamp = rm.Sun((1, 0.3, -0.2), intensity=3, shadow=True, softness=0.2)
    scene = progressive(rm.Scene(rm.sphere(1) | rm.plane(offset=-1), CAMERA, lights=[lamp]))
    screen = Screen(renderer.context, SIZE)
    picture = Picture(renderer, screen, Pace())
    try:
        picture.compiling = scene
        picture.step(shot_of(scene), SIZE, still=False)
        compiled, picture.compiling = renderer.compiled, None
        for moved in (0.1, 0.2, 0.3):
            picture.step(shot_of(scene, moved=moved), SIZE, still=False)
        assert renderer.compiled == compiled and not picture.pace.known and not picture.preview
        for frame in range(1, 60):
            picture.step(replace(shot_of(scene), time=frame / 30), SIZE, still=False)
        assert renderer.compiled > compiled and picture.pace.known
        while picture.step(shot_of(scene), SIZE, still=True):
            pass
        assert picture.whole and picture.shot is not None and picture.shot.scene is scene
    finally:
        picture.release()
        screen.release()


def test_a_scene_without_expensive_light_has_no_preview() -> None:
    assert preview(rm.Scene(rm.sphere(), lights=[rm.Sun(shadow=True)])) is None
    assert preview(rm.Scene(rm.sphere(), occlusion=rm.AmbientOcclusion())) is not None


@pytest.mark.parametrize(("middle", "cheap"), [(320, 0.02), (560, 1 / 16)])
def test_tiles_follow_the_time_of_the_last_one(middle: int, cheap: float) -> None:
    """Each pixel is drawn once; after two tiles none takes three times the budget, also where a pixel takes many times
    as long as elsewhere, at the centre or after many cheap tiles. They are so few that a wait of .1 ms for each takes
    less than an eighth of the time."""
    size, budget = (640, 360), 16.0
    seen, times, pixels = np.zeros(size[::-1], int), [], 0
    part = _Part([], from_centre(size, 256))
    while part.tiles:
        x, y, width, height = tile = part.next()
        seen[y : y + height, x : x + width] += 1
        slow = np.hypot(np.arange(x, x + width)[None, :] - middle, np.arange(y, y + height)[:, None] - 180) < 90
        times.append(float(np.sum(np.where(slow, 1.0, cheap)) * 1e-2))
        pixels += width * height
        part.drawn(tile, times[-1], budget, sum(times) / pixels)
    assert np.all(seen == 1) and max(times[2:]) <= 3.0 * budget
    assert 0.1 * len(times) < sum(times) / 8


def test_a_fast_device_draws_large_tiles() -> None:
    part = _Part([], [])
    part.drawn((0, 0, 256, 256), 0.01, 33.0, 1e-7)
    assert part.pixels == 2 * 256 * 256
