"""Samples and frames joined: means, histories that follow the camera, and what must leave no trace."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch import glsl
from raymarch.expr.hashing import PCG_GLSL, pcg
from raymarch.gpu import draw_calls
from raymarch.gpu.context import Context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.renderer import Renderer
from raymarch.gpu.sequences import halton, r2
from raymarch.gpu.targets import Target
from raymarch.plan import marching
from raymarch.plan.marching import SINGLE

SIZE = (48, 32)
KEPT = ("accumulate", "reproject")


@cache
def scene(angle: float = 0.0, **quality: Any) -> rm.Scene:
    ring = rm.union(rm.torus(0.7, 0.2).rotate(1.2, "x"), rm.sphere(0.4), k=0.2).material(rm.Material((0.9, 0.4, 0.2)))
    place = (3.4 * np.sin(angle), 0.8, 3.4 * np.cos(angle))
    return rm.Scene(
        ring | rm.plane(offset=-0.8),
        rm.Camera(place, (0, -0.1, 0), fov=50),
        lights=[rm.Sun(shadow=True)],
        quality=rm.Quality(**quality),
    )


@pytest.fixture
def renderer(egl: Context) -> Iterator[Renderer]:
    with Renderer(SIZE, "egl") as made:
        yield made


@pytest.fixture(scope="module")
def mean(egl: Context) -> np.ndarray:
    """256 samples a pixel in other places, one somewhere in each part of a grid of 16 by 16; no cone starts them."""
    random = np.random.default_rng(3)
    places = [((i % 16 + x) / 16 - 0.5, (i // 16 + y) / 16 - 0.5) for i, (x, y) in enumerate(random.random((256, 2)))]
    with pytest.MonkeyPatch.context() as patch, Renderer(SIZE, "egl") as made:
        patch.setattr(draw_calls, "r2", places.__getitem__)
        choose = marching.choose
        patch.setattr(marching, "choose", lambda *given, **named: replace(choose(*given, **named), schedule=SINGLE))
        return made.render(scene(samples=256)).color


def rms(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.sqrt(np.mean((a - b) ** 2)))


@pytest.mark.parametrize(("kept", "schedule"), [("accumulate", "cone"), ("reproject", "single")])
def test_a_still_picture_comes_to_the_mean_of_its_samples(
    renderer: Renderer, mean: np.ndarray, kept: str, schedule: str
) -> None:
    made = scene(temporal=kept, schedule=schedule)
    one = renderer.render(made).color
    for _ in range(255):
        frame = renderer.render(made)
    assert rms(one, mean) > 4 / 255, "one sample is far from it"
    assert rms(frame.color, mean) <= 1 / 255
    together = renderer.render(scene(samples=256, schedule=schedule)).color
    assert np.abs(frame.color - together).max() < 1e-4, "256 frames are one frame of 256 samples"


@pytest.mark.parametrize("kept", KEPT)
def test_later_samples_start_where_the_cone_of_their_pixel_ended(renderer: Renderer, kept: str) -> None:
    made = scene(temporal=kept)
    first = renderer.render(made).evaluations.mean()
    second = renderer.render(made)
    assert [t.name for t in second.timings if t.name == "cone"] == []
    assert second.evaluations.mean() <= 0.55 * first
    renderer.forget()
    assert renderer.render(made).evaluations.mean() == first


@pytest.mark.parametrize("poison", [np.nan, np.inf])
@pytest.mark.parametrize("kept", KEPT)
@pytest.mark.parametrize("angle", [0.0, 0.01])
def test_a_poisoned_history_leaves_no_trace(renderer: Renderer, kept: str, angle: float, poison: float) -> None:
    """Rows 42 and 44 of the hard cases."""
    for _ in range(3):
        renderer.render(scene(temporal=kept))
    pair = renderer.resources.pair("color history", SIZE, 2 if kept == "reproject" else 1)
    for k in range(pair.front.attachments):
        spoilt = pair.front.read(k)
        spoilt[5:20, 10:30] = poison
        pair.front.write(spoilt, k)
    after = renderer.render(scene(angle, temporal=kept)).color
    assert np.isfinite(after).all()
    for _ in range(50):
        after = renderer.render(scene(angle, temporal=kept)).color
    renderer.forget()
    for _ in range(51):
        fresh = renderer.render(scene(angle, temporal=kept)).color
    assert rms(after, fresh) < 2 / 255


@pytest.mark.parametrize("kept", KEPT)
def test_a_new_renderer_or_size_starts_from_nothing(renderer: Renderer, kept: str) -> None:
    fresh = renderer.render(scene(temporal=kept)).color
    for change in (renderer.forget, lambda: (renderer.resize((20, 20)), renderer.resize(SIZE))):
        renderer.render(scene(0.3, temporal=kept))
        change()
        assert np.array_equal(renderer.render(scene(temporal=kept)).color, fresh)


@pytest.mark.parametrize("kept", KEPT)
def test_a_camera_cut_equals_a_fresh_frame(renderer: Renderer, kept: str) -> None:
    """Row 43 of the hard cases."""
    fresh = renderer.render(scene(2.5, temporal=kept)).color
    for _ in range(3):
        renderer.render(scene(temporal=kept))
    assert np.array_equal(renderer.render(scene(2.5, temporal=kept)).color, fresh)


def test_another_scene_from_the_same_place_has_no_ghost(renderer: Renderer) -> None:
    for kept in KEPT:
        empty = rm.Scene(
            rm.plane(offset=-0.8), scene().camera, lights=[rm.Sun(shadow=True)], quality=rm.Quality(temporal=kept)
        )
        red = empty.replace(lights=[rm.Sun((1, 2, 1), color=(1, 0, 0), shadow=True)])
        for made in (empty, red):
            renderer.forget()
            fresh = renderer.render(made).color
            for _ in range(5):
                renderer.render(scene(temporal=kept))
            assert np.array_equal(renderer.render(made).color, fresh)


def test_a_moving_camera_finds_what_it_saw_again(renderer: Renderer) -> None:
    renderer.resize((160, 90))
    for i in range(24):
        moving = renderer.render(scene(0.004 * i, temporal="reproject")).color
    mean = renderer.render(scene(0.004 * 23, samples=64)).color
    one = renderer.render(scene(0.004 * 23)).color
    assert rms(moving, mean) < 0.8 * rms(one, mean)
    assert rms(moving[8:-8, 8:-8], mean[8:-8, 8:-8]) < rms(moving[8:-8, 8:-8], mean[8:-8, 7:-9])  # it does not lag
    assert rms(moving[8:-8, 8:-8], mean[8:-8, 8:-8]) < rms(moving[8:-8, 8:-8], mean[8:-8, 9:-7])


def test_what_asks_for_none_of_it_has_none_of_it(renderer: Renderer) -> None:
    renderer.render(scene())
    assert renderer.resources.objects == {"programs": 1, "targets": 1, "data": 0}
    (call,) = renderer.draw_calls(scene())
    assert not {"u_history", "u_carried", "u_jitter"} & set(call.program.uniforms)
    renderer.render(scene(temporal="reproject"))
    cones = 1 + 1  # and what the first level has in place of a coarser one
    assert renderer.resources.objects["targets"] == 1 + cones + 2 + 2 * 2


def test_sequences_spread_over_the_pixel() -> None:
    for sequence, count in ((r2, 256), (halton, 16)):
        points = np.array([sequence(i) for i in range(count)])
        assert np.all(np.abs(points) <= 0.5) and np.abs(points.mean(axis=0)).max() < 1.1 / count**0.75
        assert len(np.unique(np.floor((points + 0.5) * 4), axis=0)) >= min(count, 16) * 0.8
    assert r2(0) == (0.0, 0.0), "the first sample is the pixel's middle"


def test_random_numbers_are_those_of_numpy_bit_by_bit(egl: Context) -> None:
    module = "\n".join(glsl.load("random/pixel").lines)
    main = "void main() { c = vec4(random_of_pixel(0), random_of_pixel(7), 0.0, 0.0); }"
    text = f"#version 330 core\nout vec4 c;\n{PCG_GLSL}\n{module}\n{main}\n"
    with Target(egl, (64, 32)) as target, Program(egl, FULL_SCREEN, text, lambda _: ("test", None), "test") as program:
        program.draw(target, {"u_sample": 3})
        drawn = target.read()[::-1]
    x, y = np.meshgrid(np.arange(64, dtype=np.uint32), np.arange(32, dtype=np.uint32))
    for k, dimension in ((0, 0), (1, 7)):
        inner = pcg(np.full_like(x, 3) + pcg(np.full_like(x, dimension)))
        bits = pcg(x + pcg(y + inner))
        assert np.array_equal(drawn[..., k], (bits >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24))
    assert (
        abs(drawn[..., 0].mean() - 0.5) < 0.03
        and abs(np.corrcoef(drawn[..., 0].ravel(), drawn[..., 1].ravel())[0, 1]) < 0.06
    )


def test_varied_steps_are_noise_that_samples_take_out(renderer: Renderer) -> None:
    def depth(**quality: Any) -> np.ndarray:
        made = rm.Scene(rm.mandelbulb(), rm.Camera((0, 0.5, 3)), lights=[], quality=rm.Quality(**quality))
        return renderer.render(made, outputs=("iterations",)).iterations

    even, varied = depth(), depth(step_variation=0.5)
    assert varied.mean() > 1.1 * even.mean()
    assert np.array_equal(varied, depth(step_variation=0.5)), "the same numbers each time"


@pytest.mark.parametrize("quality", [{}, {"schedule": "cone"}, {"samples": 4}, {"temporal": "reproject"}])
def test_interpolated_rays_are_those_that_are_computed(renderer: Renderer, quality: dict[str, Any]) -> None:
    computed = renderer.render(scene(**quality), outputs=("color", "depth"))
    renderer.forget()
    between = renderer.render(scene(rays="interpolated", **quality), outputs=("color", "depth"))
    both = np.isfinite(computed.depth) & np.isfinite(between.depth)
    assert np.mean(np.isfinite(computed.depth) == np.isfinite(between.depth)) > 0.99
    assert np.quantile(np.abs(between.depth[both] / computed.depth[both] - 1), 0.95) < 1e-5
    assert np.quantile(np.abs(between.color - computed.color), 0.95) < 1 / 255


@pytest.mark.parametrize("kept", KEPT)
def test_frames_show_patterns_as_sharp_as_samples(renderer: Renderer, kept: str) -> None:
    """Patterns are filtered over the footprint of a ray, which shrinks with the number of frames.

    The mean variance of 64 footprints is 1.65 times that of 64 samples in one frame.
    """
    lines = rm.grid_lines((0.9, 0.9, 0.9), (0.1, 0.1, 0.1), 0.3, 0.03)
    shown = rm.Scene(rm.plane().material(rm.Material(lines)), rm.Camera((0, 1.5, 5), (0, 0.4, 0)))
    with Renderer((8 * SIZE[0], 8 * SIZE[1]), "egl") as fine:
        large = fine.render(shown.replace(quality=rm.Quality(samples=4))).color.astype(np.float64)
    right = large.reshape(SIZE[1], 8, SIZE[0], 8, 3).mean(axis=(1, 3))
    samples = renderer.render(shown.replace(quality=rm.Quality(samples=64))).color
    renderer.forget()
    for _ in range(64):
        frame = renderer.render(shown.replace(quality=rm.Quality(temporal=kept)))
    assert rms(frame.color, right) < 1.25 * rms(samples, right)  # with the footprint of the first frame: 1.85


def test_footprints_fall_as_frames_are_added() -> None:
    single, four = rm.Quality(temporal="accumulate"), rm.Quality(temporal="accumulate", samples=4)
    assert [single.footprint_of(k) for k in (0, 1, 3, 7, 100)] == [0.5, 0.5, 0.25, 0.125, 0.125]
    assert [four.footprint_of(k) for k in (0, 3, 4, 7, 8)] == pytest.approx([0.5, 0.5, 0.25, 0.25, 1 / 6])
    assert [rm.Quality(samples=n).footprint for n in (1, 4, 64, 256)] == [1.0, 0.5, 0.125, 0.125]
