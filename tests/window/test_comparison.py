"""The reference of a picture tile by tile, and the errors over the picture."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

import raymarch as rm
from raymarch.cost.maps import ERROR_SCALE, WRONG, errors_of
from raymarch.proof import COLORS
from raymarch.proof.search import CONTRADICTED, PROVED
from raymarch.window import comparison
from raymarch.window.model import Verdicts
from raymarch.window.proving import OPACITY, Proving
from raymarch.window.reference import Abandoned, Reference, from_centre, traced
from tests.support.window_driver import PATIENCE
from tests.window.test_commands import model_of

SIZE = (48, 32)


def test_a_tile_is_that_part_of_the_reference() -> None:
    model = model_of()
    model.state.aspect = SIZE[0] / SIZE[1]
    known = rm.truth(model.state.scene, SIZE)
    x, y, width, height = tile = (20, 3, 9, 7)
    depth, color = traced(model.state.shot(), model.state.values, SIZE, tile)
    rows = slice(SIZE[1] - y - height, SIZE[1] - y)
    np.testing.assert_allclose(depth, known.depth[rows, x : x + width], rtol=1e-12)
    np.testing.assert_allclose(color, known.color[rows, x : x + width], rtol=1e-9)


def test_tiles_cover_the_picture_from_the_centre() -> None:
    seen = np.zeros((70, 110), int)
    tiles = from_centre((110, 70), 32)
    for x, y, width, height in tiles:
        seen[y : y + height, x : x + width] += 1
    assert np.all(seen == 1)
    x, y, width, height = tiles[0]
    assert x < 55 + 16 < x + 48 and y < 35 + 16 < y + 48


def test_a_reference_is_computed_once_and_outlives_a_change_of_quality() -> None:
    model, woken = model_of(), threading.Event()
    reference = Reference(woken.set)
    shot = model.state.shot()
    reference.ask(shot, model.state.values, SIZE)
    assert woken.wait(PATIENCE)
    assert not [tile for tile in reference.latest() if tile.trouble]
    assert reference.share == 1.0 and not np.isnan(reference.color).any()
    draft = shot.scene.replace(quality=rm.Quality.preset("draft"))
    assert reference.covers(replace(shot, scene=draft, view="depth"), SIZE)
    before = reference.depth
    reference.ask(replace(shot, scene=draft), model.state.values, SIZE)
    assert reference.depth is before
    assert not reference.covers(shot, (SIZE[0], SIZE[1] + 1))
    for other in (replace(shot, params={"radius": 1.5}), replace(shot, scene=shot.scene.replace(lights=[]))):
        assert not reference.covers(other, SIZE)
    reference.stop()
    assert not reference.covers(shot, SIZE)


def test_a_scene_that_cannot_be_traced_says_why() -> None:
    model, woken = model_of(), threading.Event()
    reference = Reference(woken.set)
    broken = replace(model.state.shot(), scene=None)  # type: ignore[arg-type]
    reference.ask(broken, model.state.values, SIZE)
    assert woken.wait(PATIENCE)
    (tile,) = reference.latest()
    assert tile.trouble and reference.share == 0.0


def test_hits_are_proved_and_a_wrong_one_is_contradicted() -> None:
    model, woken = model_of(), threading.Event()
    shot, proving = model.state.shot(), Proving(woken.set)
    model.state.aspect = SIZE[0] / SIZE[1]
    proving.depth = rm.truth(model.state.scene, SIZE, outputs=("depth",)).depth.copy()
    middle = SIZE[1] // 2, SIZE[0] // 2
    proving.depth[middle] *= 0.99
    shot = model.state.shot()
    proving.ask(shot, model.state.values, SIZE)
    assert woken.wait(PATIENCE)
    assert not [tile.trouble for tile in proving.latest() if tile.trouble]
    assert proving.verdicts == Verdicts(SIZE[0] * SIZE[1] - 1, 1, 0, SIZE[0] * SIZE[1]) and proving.share == 1.0
    assert proving.state[middle] == CONTRADICTED
    layer = comparison.proof_layer(proving.state, SIZE[0] - 1)
    assert tuple(layer[middle]) == tuple(layer[middle[0] + 1, middle[1] - 1]) == (*COLORS[CONTRADICTED], 255)
    assert tuple(layer[0, 0]) == (*COLORS[PROVED], OPACITY[PROVED]) and not layer[:, -1].any()
    assert proving.covers(replace(shot, view="normal"), SIZE)
    draft = shot.scene.replace(quality=rm.Quality.preset("draft"))
    for other in (replace(shot, params={"radius": 1.5}), replace(shot, scene=draft), replace(shot, time=1.0)):
        assert not proving.covers(other, SIZE)


def test_a_proof_that_nobody_asks_for_ends_soon() -> None:
    """Within a tile: the thread asks after each round of stretches."""
    model = model_of()
    shot, proving = model.state.shot(), Proving(lambda: None)
    asked = []

    def check() -> None:
        asked.append(True)
        if len(asked) > 2:
            raise Abandoned

    proving.depth = np.full(SIZE[::-1], np.inf)
    make = proving.work(shot, model.state.values, SIZE, check)
    with pytest.raises(Abandoned):
        make((0, 0, *SIZE))


def test_errors_are_those_of_the_error_view() -> None:
    model = model_of()
    model.state.aspect = SIZE[0] / SIZE[1]
    shot, scene = model.state.shot(), model.state.scene
    with rm.Renderer(SIZE) as renderer:
        frame = renderer.render(scene, outputs=("depth",))
    true = rm.truth(scene, SIZE).depth.copy()
    expected = errors_of(frame, scene)
    np.testing.assert_allclose(comparison.errors_of(frame.depth, true, shot), expected, rtol=1e-6, atol=1e-9)
    true[:10] = np.nan
    assert np.isnan(comparison.errors_of(frame.depth, true, shot)[:10]).all()


@pytest.mark.parametrize("end", [4, 2])
def test_a_layer_shows_errors_where_they_are_known(end: int) -> None:
    scale = ERROR_SCALE
    errors = np.array([[np.nan, 0.0, np.inf, scale.high]])
    layer = comparison.error_layer(errors, end)
    high = np.rint(255 * scale.colored(scale.high)).astype(np.uint8)
    whole = [(0, 0, 0, 0), (*layer[0, 1, :3], comparison.DIM), (*WRONG, 255), (*high, 255)]
    assert np.array_equal(layer[0], [rgba if i < end else (0, 0, 0, 0) for i, rgba in enumerate(whole)])
    assert layer[0, 1, :3].max() < 30  # no error dims the picture
