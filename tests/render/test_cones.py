"""Cones that start rays: nothing lies before where they end, and the picture is as if rays started at the camera."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.context import Context
from raymarch.gpu.draw_calls import cells, widest
from raymarch.gpu.renderer import Renderer
from raymarch.plan import plan
from raymarch.plan.marching import PIXEL, SCHEDULES, Level
from raymarch.scene.quality import TRACERS

SIZE = (161, 90)  # no level divides it
PUBLISHED = ("two", "four", "six")


def scene(quality: rm.Quality) -> rm.Scene:
    """Near and far, thin and round, with a horizon."""
    bars = rm.box((0.02, 1.5, 0.02)).repeat((0.4, None, None), (7, 1, 1)).translate((0, 0, 0.6))
    ring = rm.union(rm.torus(0.7, 0.2).rotate(1.2, "x"), rm.sphere(0.4), k=0.2)
    return rm.Scene(
        bars | ring | rm.plane(offset=-0.8),
        rm.Camera((0.9, 0.8, 3.4), (0, -0.1, 0), fov=50),
        lights=[rm.Sun()],
        quality=quality,
    )


@pytest.fixture(scope="module")
def renderer(egl: Context) -> Renderer:
    del egl
    with Renderer(SIZE, "egl") as made:
        yield made


@pytest.fixture(scope="module")
def truth() -> rm.Truth:
    return rm.truth(scene(rm.Quality()), SIZE)


@pytest.mark.parametrize(
    ("schedule", "tracer"),
    [
        *itertools.product(("cone", "cones"), (t for t in TRACERS if t != "auto")),
        *((schedule, "auto") for schedule in PUBLISHED),
    ],
)
def test_every_hit_is_found_and_where_it_is(renderer: Renderer, truth: rm.Truth, schedule: str, tracer: str) -> None:
    quality = rm.Quality(tracer=tracer, schedule=schedule, max_steps=4000)
    frame = renderer.render(scene(quality), outputs=("depth", "evaluations"))
    hit = np.isfinite(truth.depth)
    assert np.isfinite(frame.depth)[hit].all()
    # Where a ray just passes or meets an edge, an epsilon decides; a missed surface would be many pixels.
    both = hit & np.isfinite(frame.depth)
    error = np.abs(frame.depth[both] / truth.depth[both] - 1)
    assert np.quantile(error, 0.99) < 1e-3 and (error > 0.01).mean() < 0.004


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("schedule", sorted(set(SCHEDULES) - {"single"}))
def test_no_cone_goes_on_beyond_what_it_holds(renderer: Renderer, truth: rm.Truth, schedule: str, samples: int) -> None:
    """Row 54 of the hard cases: whatever lies in a cell of any level lies behind where its cone ended."""
    made = scene(rm.Quality(schedule=schedule, samples=samples, analytic=False))
    for call in renderer.draw_calls(made):
        call.draw()
    levels = plan(made, size=SIZE).marching.schedule.levels
    assert len(levels) == len(SCHEDULES[schedule].levels) + (samples > 1)
    for i, level in enumerate(levels):
        ended = renderer.resources.target(f"cone {i}", level.size(SIZE)).read()[..., 0]
        rows = np.minimum((np.arange(SIZE[1]) + 0.5) / SIZE[1] * ended.shape[0], ended.shape[0] - 1).astype(int)
        columns = np.minimum((np.arange(SIZE[0]) + 0.5) / SIZE[0] * ended.shape[1], ended.shape[1] - 1).astype(int)
        free = ended[rows][:, columns]
        free = np.where(free < 0, np.inf, free)
        assert np.all(free <= truth.depth * (1 + 1e-5)), (schedule, i)
        if level.share == 1 and level.scale >= 0.25:
            both = np.isfinite(truth.depth) & np.isfinite(free)
            assert np.median(free[both] / truth.depth[both]) > 0.8, "a cone goes near to what it holds"


def test_a_cone_holds_all_rays_of_its_cell() -> None:
    """The angle that is worked out is no less than that of any cell, and is theirs in the middle of the picture."""
    for size, scale, fov in itertools.product(((64, 64), (161, 90), (33, 200)), (1 / 16, 1 / 4, 3 / 4, 1.0), (20, 140)):
        level = Level(scale)
        slope = float(np.tan(np.radians(fov) / 2))
        for jittered in (False, True):
            (width, height), footprint = cells(level, size, jittered)
            bound = widest(footprint, 2 * slope / size[1])
            columns, rows = level.size(size)
            x, y = np.meshgrid((np.arange(columns) + 0.5) * width, (np.arange(rows) + 0.5) * height)
            middle = _direction(x, y, size, slope)
            angles = [
                np.linalg.norm(_direction(x + sx * footprint[0], y + sy * footprint[1], size, slope) - middle, axis=-1)
                for sx, sy in itertools.product((-1, 1), (-1, 1))
            ]
            assert np.max(angles) <= bound
            if min(columns, rows) > 4:
                assert bound <= 1.2 * np.max(angles) + 1e-6


def _direction(x: np.ndarray, y: np.ndarray, size: tuple[int, int], slope: float) -> np.ndarray:
    ray = np.stack([(2 * x - size[0]) / size[1] * slope, (2 * y - size[1]) / size[1] * slope, -np.ones_like(x)], -1)
    return np.asarray(ray / np.linalg.norm(ray, axis=-1, keepdims=True))


@pytest.mark.parametrize("outputs", [("color",), ("depth",), ("color", "depth")])
def test_cones_of_samples_hold_the_whole_pixel(renderer: Renderer, outputs: tuple[str, ...]) -> None:
    """Also where a picture is not asked for: what it then leaves for the next one must hold all its rays."""
    draw_calls = renderer.draw_calls(scene(rm.Quality(samples=4, schedule="cone")), outputs=outputs)
    *_, pixel = (d for d in draw_calls if d.chosen.name == "cone")
    assert pixel.uniforms["u_cell"] == (1.0, 1.0) and pixel.uniforms["u_footprint"] == (0.5, 0.5)
    assert pixel.uniforms["u_cone"] >= 0.99 * np.hypot(0.5, 0.5) * pixel.uniforms["u_pixel"]
    rays = [d for d in draw_calls if d.chosen.name != "cone"]
    assert rays and all(d.uniforms["u_footprint"] == (0.5, 0.5) for d in rays)


def test_cones_save_evaluations(renderer: Renderer) -> None:
    """The last steps, which prove that no thin solid is passed, are the same with cones and without. Of 20.7
    evaluations one level of cones saves 2.4, three levels 1.1: near the bars the inner levels end at once."""
    single = renderer.render(
        scene(rm.Quality(schedule="single", analytic=False)), outputs=("evaluations",)
    ).evaluations.mean()
    for schedule, saved in (("cone", 2.3), ("cones", 1.1)):
        cones = renderer.render(
            scene(rm.Quality(schedule=schedule, analytic=False)), outputs=("evaluations",)
        ).evaluations.mean()
        assert cones < single - saved


def test_the_published_schedules() -> None:
    """Bálint and Valasek 2018: resolutions and parts of the steps, which make up the whole."""
    assert [level.scale for level in SCHEDULES["two"].levels] == [1 / 2]
    assert [level.scale for level in SCHEDULES["four"].levels] == [1 / 4, 1 / 2, 3 / 4]
    assert [level.scale for level in SCHEDULES["six"].levels] == [1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6]
    for name in PUBLISHED:
        assert sum(level.share for level in SCHEDULES[name].levels) + SCHEDULES[name].share == 1
    assert PIXEL.size(SIZE) == SIZE


def test_the_plan_marches_cones_only_where_they_pay_and_are_safe() -> None:
    cheap, costly = rm.sphere(), rm.union(*(rm.sphere(0.1).translate((i, 0, 0)) for i in range(60)))
    assert not plan(rm.Scene(cheap), size=(640, 360)).marching.cones
    text = rm.Scene(costly, quality=rm.Quality(objects="text", analytic=False))
    assert plan(text, size=(640, 360)).marching.cones
    assert not plan(text, size=(16, 9)).marching.cones and not plan(text).marching.cones
    beside = rm.Scene(rm.union(costly, rm.plane(offset=-1)), quality=rm.Quality(objects="text"))
    assert plan(beside, size=(640, 360)).analytic.used and not plan(beside, size=(640, 360)).marching.cones
    assert plan(beside, size=(6400, 3600)).marching.cones
    block = rm.box((1.5, 0.4, 1.5)).round(0.05)
    column = rm.union(rm.cylinder(0.5, 4), *(block.translate((0, y, 0)) for y in (-2.2, 2.2)), k=0.3)
    far, near = (rm.Scene(column.repeat((3, None, 3), count=n) | rm.plane(offset=-2.3)) for n in (None, (9, None, 9)))
    assert plan(far, size=(640, 360)).marching.schedule == SCHEDULES["cone"]
    assert plan(far, size=(640, 360)).analytic.used and not plan(far, size=(160, 90)).marching.cones
    assert not plan(near, size=(640, 360)).marching.cones
    assert not plan(rm.Scene(costly), size=(640, 360)).marching.cones, "cells skip empty space"
    guess = rm.Scene(rm.mandelbulb(), quality=rm.Quality(schedule="cones"))
    assert not plan(guess, size=(640, 360)).marching.cones
    trusting = rm.Scene(rm.mandelbulb(), quality=rm.Quality(schedule="cones", assume_certified=True))
    assert plan(trusting, size=(640, 360)).marching.cones
