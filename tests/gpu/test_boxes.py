"""Boxes drawn over the picture, against a camera whose projection is known by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.boxes import HIDDEN, OUTERMOST, Box, boxes_of, draw_boxes, edges_of, project
from raymarch.gpu.context import Context
from raymarch.gpu.views import light, picture
from raymarch.scene.camera import Pose, look_at

SIZE = (200, 100)
POSE = look_at(np.array([0.0, 0, 4]), np.zeros(3), np.array([0.0, 1, 0]), math.tan(math.radians(30)))
RED = np.array(OUTERMOST)


def pixel_of(point: tuple[float, float, float], pose: Pose = POSE) -> tuple[float, float]:
    """Column and row of a point, for a camera on the z axis that looks along -z."""
    scale = SIZE[1] / 2 / pose.tan_half_fov / (pose.position[2] - point[2])
    return SIZE[0] / 2 + point[0] * scale, SIZE[1] / 2 - point[1] * scale


def drawn(depth: float | np.ndarray, *boxes: Box, pose: Pose = POSE, far: float = 100.0) -> np.ndarray:
    picture = np.zeros((SIZE[1], SIZE[0], 3))
    return draw_boxes(picture, np.broadcast_to(depth, picture.shape[:2]), pose, list(boxes), far)


def box(lower: tuple[float, ...], upper: tuple[float, ...], depth: int = 0) -> Box:
    return Box("box", np.array(lower, float), np.array(upper, float), depth)


@pytest.mark.parametrize("z", [1.0, -1.0])
def test_edges_lie_where_the_camera_sees_them(z: float) -> None:
    made = drawn(np.inf, box((-1, -1, -1), (1, 1, 1)))
    left, top = pixel_of((-1, 1, z))
    right, bottom = pixel_of((1, -1, z))
    for row in (top, bottom):
        assert np.all(made[int(row), int(left) + 1 : int(right) - 1] == RED)
    for column in (left, right):
        assert np.all(made[int(top) + 1 : int(bottom) - 1, int(column)] == RED)


def test_nothing_else_is_drawn() -> None:
    made = drawn(np.inf, box((-1, -1, -1), (1, 1, 1)))
    left, top = pixel_of((-1, 1, 1))
    assert not made[: int(top)].any() and not made[:, : int(left)].any()
    assert not made[45:55, 95:105].any()


def test_an_edge_behind_a_surface_is_faint() -> None:
    made = drawn(4.0, box((-1, -1, -1), (1, 1, 1)))
    front, back = pixel_of((0, 1, 1)), pixel_of((0, 1, -1))
    assert np.allclose(made[int(front[1]), 100], RED)
    assert np.allclose(made[int(back[1]), 100], HIDDEN * RED)


def test_distance_along_a_line_is_that_of_its_points() -> None:
    a, b = np.array([-1.0, -0.5, 1]), np.array([2.0, 1.0, -6])
    rows, columns, along = project(a, b, POSE, (100, 200))
    s = np.linspace(0, 1, 4001)[:, None]
    points = a + s * (b - a)
    known = np.array([pixel_of(tuple(p)) for p in points])
    for row, column, t in zip(rows, columns, along, strict=True):
        nearest = np.argmin(np.hypot(known[:, 0] - column - 0.5, known[:, 1] - row - 0.5))
        assert t == pytest.approx(np.linalg.norm(points[nearest] - POSE.position), rel=0.03)
    assert len(set(zip(rows.tolist(), columns.tolist(), strict=True))) >= 0.9 * len(rows)


def test_edges_through_and_behind_the_camera() -> None:
    around = drawn(np.inf, box((-1, -1, -9), (1, 1, 9)))  # the camera is inside: the far end is seen, and four edges
    left, top = pixel_of((-1, 1, -9))
    assert np.all(around[int(top), int(left) + 1 : 100] == RED)
    assert np.all(around.any(axis=-1).any(axis=1)[:30]), "the edges towards the camera run out of the picture"
    assert not drawn(np.inf, box((-1, -1, 5), (1, 1, 9))).any()
    assert not drawn(np.inf, box((50, -1, -1), (51, 1, 1))).any()
    assert np.isfinite(drawn(np.inf, box((-1, -1, 4), (1, 1, 4)))).all()


def test_a_box_without_end_has_only_the_edges_that_are_there() -> None:
    inf = np.inf
    assert not list(edges_of(box((-inf, -inf, -inf), (inf, 0, inf)), 10))  # a half-space
    tube = list(edges_of(box((-1, -1, -inf), (1, 1, inf)), 10))
    assert len(tube) == 4
    assert all({a[2], b[2]} == {-10.0, 10.0} for a, b in tube)
    assert len(list(edges_of(box((-1, -1, -1), (1, 1, 1)), 10))) == 12
    assert len(list(edges_of(box((-1, -1, -1), (1, 1, inf)), 10))) == 4 + 4


def test_operands_through_materials_and_booleans_alone() -> None:
    painted = (rm.sphere(0.5) | rm.box((1, 1, 4))).material(rm.Material())
    moved = (rm.sphere() | rm.torus()).translate((2, 0, 0))
    found = boxes_of(rm.Scene(rm.union(painted, moved, rm.plane()) - rm.box((0.1, 0.2, 0.3))))
    assert [b.depth for b in found] == sorted(b.depth for b in found)
    corners = {(b.depth, *b.upper.tolist()) for b in found}
    assert (1, 0.05, 0.1, 0.15) in corners
    assert any(c[1:] == (0.5, 0.5, 2.0) for c in corners), "the operand inside the material"
    assert any(np.allclose(c[1:], (3.25, 1, 1.25)) for c in corners)
    assert not any(c[1:] == (1.25, 0.25, 1.25) for c in corners), "a part in a space of its own"


def test_an_empty_operand_has_no_box() -> None:
    nothing = rm.sphere() & rm.sphere().translate((9, 0, 0))
    names = [b.name for b in boxes_of(rm.Scene(nothing | rm.box(1)))]
    assert "hard_intersection" not in names and "box" in names


def test_the_view_draws_over_the_picture(egl: Context) -> None:
    camera = rm.Camera(position=(0, 0, 4), target=(0, 0, 0), fov=60)
    scene = rm.Scene(rm.sphere(1.0), camera, sky=(0, 0, 0))
    with rm.Renderer(SIZE, context=egl) as renderer:
        frame = renderer.render(scene)
        image = np.asarray(picture(frame, "boxes", scene)) / 255.0
        plain = np.asarray(frame.image().convert("RGB")) / 255.0
        numbers = light(frame, "boxes", scene)
    left, top = pixel_of((-1, 1, 1))
    assert np.abs(image[int(top), int(left) + 2 : 100] - RED).max() <= 1 / 255
    assert np.allclose(numbers[int(top), int(left) + 2 : 100], RED)
    hidden = pixel_of((0, -1, -1))  # below the sphere's middle, behind it or beside it
    row = image[int(hidden[1])]
    assert np.abs(row[100] - (HIDDEN * RED + (1 - HIDDEN) * plain[int(hidden[1]), 100])).max() <= 2 / 255
    assert np.array_equal(image[50, 100], plain[50, 100])
    assert image.shape == (100, 200, 3)
