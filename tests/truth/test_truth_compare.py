"""Edges in a picture, and frames held against the truth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raymarch.scene import Camera, Material, Scene
from raymarch.sdf import box, plane, sphere
from raymarch.truth import Truth, silhouettes, truth
from tests.support.compared import compare


def picture(node: Any, position: Any = (0, 0, 5), target: Any = (0, 0, 0), size: Any = (80, 60)) -> Truth:
    return truth(Scene(node, camera=Camera(position, target)), size)


@pytest.fixture(scope="module")
def scene() -> Truth:
    node = plane(offset=-1.0) | sphere().translate((-0.8, 0, 0)) | box(1).translate((1, 0, 0))
    return picture(node, (1, 1.5, 6))


def border(mask: Any) -> Any:
    """Pixels with one of their eight neighbours on the other side of a mask."""
    padded = np.pad(mask, 1, mode="edge")
    shifted = [
        padded[1 + i : padded.shape[0] - 1 + i, 1 + j : padded.shape[1] - 1 + j] for i in (-1, 0, 1) for j in (-1, 0, 1)
    ]
    return np.any([s != mask for s in shifted], axis=0)


def test_a_ball_before_the_sky_has_its_outline_only() -> None:
    made = picture(sphere())
    assert np.array_equal(silhouettes(made), border(made.hit))


def test_creases_of_a_box_are_edges_and_its_faces_are_not() -> None:
    made = picture(box((2, 2, 2)), (4, 3, 5))
    face = np.where(made.hit, np.argmax(np.abs(made.normal), axis=-1), -1)
    assert np.array_equal(silhouettes(made), border(face))


def test_a_jump_in_depth_is_an_edge_and_a_slope_is_not() -> None:
    """A floor runs on behind a step of its own kind; its far end gets steep, but nowhere jumps."""
    step = box((4, 0.3, 1)).translate((0, -1, 0))
    made = picture(plane(offset=-1.0) | step, (0, 1.5, 6))
    on_step = (
        np.abs((made.position + np.where(made.hit, made.depth, 0)[..., None] * made.direction)[..., 1] + 0.85) < 1e-9
    )
    top = np.where(made.hit, on_step, -1)
    edges = silhouettes(made)
    assert np.all(edges[border(top)])  # behind the top edge the floor has the same normal and material
    assert np.mean(edges) < 0.35
    floor = picture(plane(offset=-1.0), (0, 1.5, 6))
    assert np.array_equal(silhouettes(floor), border(floor.hit))


def test_a_change_of_material_is_an_edge() -> None:
    left, right = (Material(c) for c in ((1, 0, 0), (0, 1, 0)))
    halves = box((1, 1, 1)).translate((-0.5, 0, 0)).material(left) | box((1, 1, 1)).translate((0.5, 0, 0)).material(
        right
    )
    made = picture(halves)
    assert np.array_equal(silhouettes(made), border(made.material))


def test_width(scene: Truth) -> None:
    one, two = silhouettes(scene, 1), silhouettes(scene, 2)
    assert not silhouettes(scene, 0).any()
    assert np.array_equal(two, one | border(one))
    with pytest.raises(ValueError, match="width"):
        silhouettes(scene, -1)


def test_the_truth_agrees_with_itself(scene: Truth) -> None:
    result = compare(scene.depth, scene.normal, scene)
    assert result.missed_hits == result.false_hits == 0
    assert result.depth_max == 0.0 and result.normal_max < 1e-6
    assert 1000 < result.compared < result.pixels < scene.depth.size


def test_errors_are_found_where_they_were_made(scene: Truth) -> None:
    plain = ~silhouettes(scene)
    depth, normal = scene.depth.copy(), scene.normal.copy()
    rows, columns = np.nonzero(plain & scene.hit)
    depth[rows[:7], columns[:7]] = np.inf
    sky = np.argwhere(plain & ~scene.hit)[:5]
    depth[tuple(sky.T)] = 3.0
    depth[rows[7], columns[7]] *= 1.01
    depth[silhouettes(scene)] = np.nan  # does not count
    turn = np.radians(2.0)
    normal[rows[7], columns[7]] = (0, np.cos(turn), np.sin(turn))
    scene_normal = scene.normal[rows[7], columns[7]]
    np.testing.assert_allclose(scene_normal, (0, 1, 0), atol=1e-12)
    result = compare(depth, 3.0 * normal, scene)
    assert (result.missed_hits, result.false_hits) == (7, 5)
    assert result.depth_p50 == 0.0 and abs(result.depth_max - 0.01) < 1e-12
    assert result.normal_p50 < 1e-6 and abs(result.normal_max - 2.0) < 1e-9


def test_percentiles(scene: Truth) -> None:
    result = compare(scene.depth * 1.001, None, scene)
    np.testing.assert_allclose([result.depth_p50, result.depth_p99, result.depth_max], 0.001, rtol=1e-9)
    assert np.isnan([result.normal_p50, result.normal_p95, result.normal_p99, result.normal_max]).all()


def test_a_frame_of_another_shape_is_refused(scene: Truth) -> None:
    with pytest.raises(ValueError, match="frame_depth"):
        compare(scene.depth[:-1], None, scene)
    with pytest.raises(ValueError, match="frame_normal"):
        compare(scene.depth, scene.depth, scene)
