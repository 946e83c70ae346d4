"""The view of errors, on frames whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.cost.maps import ERROR_SCALE, WRONG, error_picture, errors_of
from raymarch.gpu.frame import Frame
from raymarch.scene.parameter import set_values
from tests.cost.cost_samples import make_scene

SIZE = (48, 27)


def frame_with(scene: rm.Scene, depth: np.ndarray, params: dict[str, float] | None = None) -> Frame:
    pose = scene.pose(set_values(scene.parameters, params or {}, 0.0), SIZE[0] / SIZE[1])
    return Frame(SIZE, 0.0, [], {"depth": depth.astype(np.float32)}, lambda name: ({}, []), pose=pose)


def test_an_error_of_half_a_footprint_is_a_half() -> None:
    scene = make_scene()
    known = rm.truth(scene, SIZE, outputs=())
    pixel = 2 * np.tan(np.radians(45 / 2)) / SIZE[1]
    depth = known.depth * (1 + 0.5 * pixel)
    depth[0, :4] = np.where(known.hit[0, :4], np.inf, 3.0)
    found = errors_of(frame_with(scene, depth), scene)
    assert np.all(np.isinf(found[0, :4]))
    rest = np.ones_like(known.hit)
    rest[0, :4] = False
    assert np.allclose(found[known.hit & rest], 0.5, rtol=1e-4)
    assert np.all(found[~known.hit & rest] == 0.0)


def test_the_truth_is_that_of_the_same_parameters() -> None:
    scene = rm.Scene(
        rm.sphere(rm.Param("radius", 1.0, min=0.1, max=2)), rm.Camera(position=(0, 0, 5), target=(0, 0, 0))
    )
    known = rm.truth(scene, SIZE, params={"radius": 0.5}, outputs=())
    assert errors_of(frame_with(scene, known.depth, {"radius": 0.5}), scene, {"radius": 0.5}).max() < 1e-4
    assert np.isinf(errors_of(frame_with(scene, known.depth), scene)).any()


def test_colours() -> None:
    shown = np.asarray(error_picture(np.array([[0.0, 1e-4, 0.03, 10.0, 99.0, np.inf]])))
    ends = np.rint(255 * ERROR_SCALE.colored([1e-4, 0.03, 10.0]))
    assert shown[0].tolist() == [*[ends[k].tolist() for k in (0, 0, 1, 2, 2)], list(WRONG)]


@pytest.mark.parametrize(("epsilon", "least", "most"), [(1e-3, 0.0, 0.02), (10.0, 0.05, 40.0)])
def test_a_coarser_tracer_has_larger_errors(egl, epsilon, least, most) -> None:
    scene = make_scene()
    scene = scene.replace(quality=rm.Quality(epsilon=epsilon, refinement="none"))
    with rm.Renderer(SIZE, context=egl) as renderer:
        found = errors_of(renderer.render(scene, outputs=("depth",)), scene)
    middle = np.median(found[np.isfinite(found) & (found > 0)])
    assert least <= middle <= most
