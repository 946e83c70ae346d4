"""The samples of one ray, and their figure."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.prepare import assembled, prepare
from raymarch.plan import plan

SIZE = (48, 27)
SOLID = rm.union(rm.torus(), rm.box(1), k=0.2).rotate(0.6, "x") | rm.plane(offset=-1.3)
SCENE = rm.Scene(SOLID, rm.Camera((0.5, 1.5, 5.5)), quality=rm.Quality(analytic=False))
PIXEL = 26, 15


@pytest.mark.parametrize("tracer", ["plain", "relaxed", "bracketing", "advance"])
def test_samples_are_those_of_the_picture(tracer: str) -> None:
    found = rm.ray_samples(SCENE, PIXEL, SIZE, tracer)
    with rm.Renderer(SIZE) as renderer:
        scene = SCENE.replace(quality=SCENE.quality.replace(tracer=tracer))
        frame = renderer.render(scene, outputs=("depth", "evaluations", "fallbacks"))
    column, row = PIXEL
    assert found.tracer == tracer and found.evaluations == frame.evaluations[row, column] > 3
    assert found.hit == frame.depth[row, column] < np.inf
    points = found.origin + found.t[:, None] * found.direction
    known = SOLID.distance(points)
    assert np.allclose(found.value, known, atol=1e-4 if tracer == "advance" else 3e-6)
    assert np.all(found.ahead >= found.value - 1e-6) and np.sum(found.kind == 2) >= frame.fallbacks[row, column]


def test_a_ray_of_rows_and_of_solids_that_all_tell_their_advance() -> None:
    many = rm.union(*[rm.sphere(0.3).translate((i % 8, i // 8, 0)) for i in range(40)]).translate((-3.5, -2, 0))
    found = rm.ray_samples(rm.Scene(many, quality=rm.Quality(analytic=False)), (24, 13), SIZE)
    truth = rm.truth(rm.Scene(many), SIZE).depth[13, 24]
    assert (np.isinf(found.hit) and np.isinf(truth)) or found.hit == pytest.approx(truth, abs=1e-3)


def test_a_figure_tells_what_it_shows() -> None:
    solid = rm.sphere() | rm.box(1).twist(1).translate((3, 0, 0))
    figure = rm.plot_ray(rm.Scene(solid), (10, 10), SIZE)
    upper, lower = figure.axes
    assert "evaluations (1 solid in closed form takes none), " in upper.get_title()
    assert lower.get_xlabel() == "distance along the ray"
    figure.canvas.draw()


def test_pictures_hold_no_code_that_keeps_samples() -> None:
    """It is in the shader of this figure alone, which the module of the march declares and no text is edited for."""
    for outputs in (("color",), ("depth",), ("color", "depth")):
        shader = prepare(SCENE, outputs, SIZE).shader
        assert not any(word in shader.text() for word in ("note_sample", "note_kind", "kept_number"))
    noting = assembled(plan(SCENE, ("ray",), SIZE))
    assert noting.shader.modules["march/note"] and "note_sample" in noting.texts["ray"], "a pass of its own"


@pytest.mark.parametrize("pixel", [(48, 0), (-1, 3), (0.5, 2), 3, (1, 2, 3)])
def test_pixels_outside_of_the_picture_are_refused(pixel: object) -> None:
    with pytest.raises(rm.SceneError, match=r"pixel = .*from \(0, 0\) to \(47, 26\)"):
        rm.ray_samples(SCENE, pixel, SIZE)  # type: ignore[arg-type]
