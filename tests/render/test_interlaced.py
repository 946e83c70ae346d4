"""Pictures within a budget of time: coarse grids of pixels first, nothing drawn twice, the same picture at the end."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.budget import Budget, CellPace
from raymarch.gpu.clock import Clock
from raymarch.gpu.context import Context
from raymarch.gpu.interlaced import CELL, ORDERS, band
from raymarch.gpu.renderer import Renderer
from tests.support.compared import same_texels

SIZE = (96, 54)
BUDGET = 10.0


@cache
def scene(angle: float = 0.0, **quality: Any) -> rm.Scene:
    ring = rm.union(rm.torus(0.7, 0.2).rotate(1.2, "x"), rm.sphere(0.4), k=0.2)
    place = (3.4 * np.sin(angle), 0.8, 3.4 * np.cos(angle))
    lights = [rm.Sun(shadow=True), rm.PointLight((1, 2, 1), shadow=True)]
    given = {"steps_per_pass": 8, "temporal": "accumulate", "analytic": False, **quality}
    return rm.Scene(
        ring | rm.plane(offset=-0.8), rm.Camera(place, (0, -0.1, 0), fov=50), lights, quality=rm.Quality(**given)
    )


@pytest.fixture(scope="module")
def opened(egl: Context) -> Iterator[Renderer]:
    with Renderer(SIZE, context=egl) as made:
        yield made


@pytest.fixture
def renderer(opened: Renderer) -> Renderer:
    opened.forget()
    return opened


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The draw calls. By the clock, a pass takes .05 ms and 16 microseconds for each pixel, a fill the former."""
    calls: list[Any] = []

    def clock(self: Clock, draw: Any) -> float:
        del self
        draw()
        call = draw.__self__
        calls.append(call)
        width, height = (call.part or (0, 0, *call.target.size))[2:]
        return 0.05 + (0.0 if call.program.name == "fill" else 16e-3 * width * height)

    monkeypatch.setattr(Clock, "time", clock)
    return calls


def frames_of(renderer: Renderer, scene: rm.Scene, budget: float = BUDGET, **more: Any) -> list[Any]:
    frames = [renderer.render(scene, within=budget, **more)]
    while not frames[-1].complete:
        assert len(frames) < 400
        frames.append(renderer.render(scene, within=budget, **more))
    return frames


@pytest.mark.parametrize("order", range(len(ORDERS)))
@pytest.mark.parametrize("size", [(1, 1), (3, 9), (8, 8), (17, 5), (96, 54)])
def test_each_pixel_is_in_one_grid_and_every_grid_covers_the_picture(order: int, size: tuple[int, int]) -> None:
    """Once a grid is drawn, the blocks of all so far leave no pixel free."""
    times, shown = np.zeros(size[::-1], int), np.zeros(size[::-1], bool)
    for grid in ORDERS[order]:
        width, height = grid.size(size)
        for y in range(height):
            for x in range(width):
                column, row = grid.first[0] + x * grid.stride[0], grid.first[1] + y * grid.stride[1]
                times[row, column] += 1
                shown[row : row + grid.block[1], column : column + grid.block[0]] = True
        assert shown.all()
    assert np.all(times == 1)


@pytest.mark.parametrize("size", [(1, 1), (7, 3), (8, 4), (9, 5), (40, 23), (160, 90)])
@pytest.mark.parametrize("count", [1, 2, 7, 1000])
def test_bands_cover_a_target_once(size: tuple[int, int], count: int) -> None:
    most = -(-size[0] // CELL[0]) * -(-size[1] // CELL[1])
    times, at = np.zeros(size[::-1], int), 0
    while at < most:
        (x, y, width, height), cells = band(at, min(count, most - at), size)
        assert 0 < cells <= count and width > 0 and height > 0
        times[y : y + height, x : x + width] += 1
        at += cells
    assert at == most and np.all(times == 1)


def test_a_budget_holds_and_nothing_is_drawn_twice(renderer: Renderer, drawn: list[Any]) -> None:
    """Neither a step nor a colour of any pixel; the first frame of a picture already shows all of it."""
    whole = renderer.render(scene()).color
    renderer.forget()
    frames_of(renderer, scene(), 1e9)  # learns
    renderer.forget()
    drawn.clear()
    frames = frames_of(renderer, scene())
    took = [sum(t.draw for t in frame.timings) for frame in frames]
    assert len(frames) > 8
    assert max(took) <= 1.05 * BUDGET and np.median(took) >= 0.8 * BUDGET
    shaded = [call for call in drawn if call.program.name == "color"]
    assert sum(call.part[2] * call.part[3] for call in shaded) == SIZE[0] * SIZE[1]
    assert {call.program.name for call in drawn} == {"color", "fill"}
    errors = [np.abs(frame.color - whole).mean() for frame in frames]
    assert errors[0] < 0.5 * np.abs(whole - whole.mean(axis=(0, 1))).mean() and errors[-1] < 1e-5
    assert np.all(np.diff(errors) <= 1e-7)
    same_texels(renderer, frames[-1].color, whole)


def test_a_complete_picture_is_kept_and_a_moved_one_begins_anew(renderer: Renderer, drawn: list[Any]) -> None:
    frames = frames_of(renderer, scene())
    drawn.clear()
    again = renderer.render(scene(), within=BUDGET)
    assert again.complete and not drawn and np.array_equal(again.color, frames[-1].color)
    moved = renderer.render(scene(1.1), within=BUDGET)
    assert not moved.complete and np.abs(moved.color - again.color).max() > 0.1
    for _ in range(3):  # while the camera moves, each frame shows where it is
        fresh = renderer.render(scene(1.2), within=BUDGET)
        renderer.render(scene(1.1), within=BUDGET)
    truth = renderer.render(scene(1.2)).color
    assert np.abs(fresh.color - truth).mean() < 0.7 * np.abs(again.color - truth).mean()
    assert frames_of(renderer, scene())[-1].complete
    same_texels(renderer, frames_of(renderer, scene())[-1].color, frames[-1].color)


def test_a_picture_that_fits_is_drawn_at_once(renderer: Renderer, drawn: list[Any]) -> None:
    frames_of(renderer, scene(), 1e9)
    for budget, most in ((1e4, 1), (100.0, 6)):
        renderer.forget()
        frames = frames_of(renderer, scene(), budget)
        assert len(frames) <= most and renderer.history.grid.order <= most // 2


@pytest.mark.parametrize(
    ("more", "parts"),
    [
        ({"lights_per_pass": "auto"}, {}),
        ({"schedule": "cones"}, {}),
        ({"tracer": "relaxed", "max_steps": 100}, {}),
        ({"max_steps": 20}, {}),
        ({}, {"post": [rm.Bloom()]}),
        ({}, {"sky": rm.Sky((0.2, 0.3, 0.4), light=True), "occlusion": rm.AmbientOcclusion()}),
        ({}, {"camera": rm.Camera((0, 1, 3), (0, 0, 0), projection="orthographic", height=3)}),
        ({}, {"lights": [rm.Sun(shadow=True, softness=0.3, penumbra="sampled")]}),
    ],
)
def test_the_picture_is_that_without_a_budget(
    renderer: Renderer, drawn: list[Any], more: dict[str, Any], parts: dict[str, Any]
) -> None:
    given = scene(**more).replace(**parts)
    whole = renderer.render(given).color
    renderer.forget()
    frames = frames_of(renderer, given)
    assert len(frames) > 2
    np.testing.assert_allclose(frames[-1].color, whole, atol=2e-6)


def test_grids_of_one_row_are_shown_too(egl: Context, drawn: list[Any]) -> None:
    for size in ((16, 9), (5, 3), (1, 1)):
        with Renderer(size, context=egl) as small:
            whole = small.render(scene()).color
            small.forget()
            np.testing.assert_allclose(frames_of(small, scene(), 0.3)[-1].color, whole, atol=2e-6)


def test_other_arrays_beside_the_picture_and_after_it(renderer: Renderer, drawn: list[Any]) -> None:
    names = ("color", "depth", "normal", "material")
    whole = renderer.render(scene(), outputs=names)
    known = {name: whole.array(name) for name in names}
    renderer.forget()
    frames = frames_of(renderer, scene(), outputs=names)
    for name in names:
        same_texels(renderer, frames[-1].array(name), known[name])
    renderer.forget()
    first = renderer.render(scene(), within=BUDGET)
    assert not first.complete
    same_texels(renderer, first.depth, known["depth"])
    same_texels(renderer, frames_of(renderer, scene())[-1].color, known["color"])


def test_other_arrays_beside_a_picture_with_a_post_effect(renderer: Renderer, drawn: list[Any]) -> None:
    """The effect follows all passes that are drawn grid by grid."""
    made, names = scene().replace(post=[rm.Bloom()]), ("color", "depth", "normal")
    whole = renderer.render(made, outputs=names)
    known = {name: whole.array(name) for name in names}
    renderer.forget()
    frames = frames_of(renderer, made, outputs=names)
    assert len(frames) > 1
    for name in names:
        same_texels(renderer, frames[-1].array(name), known[name])


def test_a_frame_without_a_budget_completes_the_picture(renderer: Renderer, drawn: list[Any]) -> None:
    whole = renderer.render(scene()).color
    renderer.forget()
    assert not renderer.render(scene(), within=BUDGET).complete
    frame = renderer.render(scene())
    assert frame.complete and np.array_equal(frame.color, whole)
    assert renderer.render(scene(), within=BUDGET).complete


def test_the_time_of_bands_is_learned_as_a_fixed_time_and_one_of_a_cell() -> None:
    pace, budget = CellPace(), Budget(10.0)
    assert pace.whole(10) == np.inf
    assert pace.fitting("a", 320, budget, drawn=False) == 20, "a sixteenth, to learn"
    pace.add("a", 1, 0.5)
    for _ in range(30):
        pace.add("a", 1, 0.5 + 0.1)
        pace.add("a", 40, 0.5 + 4.0)
    pace.covered()
    count = pace.fitting("a", 1000, budget, drawn=False)
    assert 0.6 * 5.0 <= 0.5 + 0.1 * count <= 1.2 * 5.0
    assert 0.8 * 9.0 <= pace.whole(80) <= 1.2 * 9.0
    budget.add(9.5)
    assert pace.fitting("a", 1000, budget, drawn=True) == 0
    assert pace.fitting("a", 1000, Budget(1e-9), drawn=False) == 1


def test_a_band_whose_fixed_time_is_longer_than_the_budget_is_not_of_one_cell() -> None:
    pace = CellPace()
    pace.add("a", 1, 5.0)
    pace.add("a", 100, 10.0)
    assert pace.fitting("a", 1000, Budget(1.0), drawn=False) == 25, "a quarter longer"
    assert pace.fitting("a", 1000, Budget(1.0), drawn=True) == 0
