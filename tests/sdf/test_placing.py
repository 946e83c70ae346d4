"""Placing: moved, turned, enlarged, mirrored, mapped by a matrix; against SciPy's rotations and pyrr's matrices."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyrr
import pytest
from scipy.spatial.transform import Rotation

from raymarch.expr.node import const
from raymarch.scene.parameter import Param, time
from raymarch.sdf import Node, box, capsule, circle, mirror, plane, rotate, scale, sphere, transform, translate
from raymarch.sdf.placing import rotation_matrix
from tests.support.refusals import refused

RANDOM = np.random.default_rng(8)
POINTS = RANDOM.uniform(-2, 2, (8000, 3))
BRICK = box((1.0, 0.6, 0.4)).translate((0.3, 0.2, 0.1))
SLANTED = capsule((-0.3, -0.2, 0.1), (0.6, 0.4, -0.2), 0.2)


def assert_placed(node: Node, child: Node, back: Callable[[np.ndarray], np.ndarray], factor: float = 1.0) -> None:
    """The node reads at a point what its child reads where the point came from."""
    np.testing.assert_allclose(node.distance(POINTS), factor * child.distance(back(POINTS)), atol=1e-12)


def assert_boxed(node: Node) -> None:
    inside = POINTS[node.distance(POINTS) < 0]
    assert len(inside) > 0
    assert np.all((inside >= node.bounds[0] - 1e-12) & (inside <= node.bounds[1] + 1e-12))


# Rigid motions


def test_translate() -> None:
    moved = BRICK.translate((0.5, -1.0, 0.25))
    assert_placed(moved, BRICK, lambda p: p - (0.5, -1.0, 0.25))
    np.testing.assert_allclose(moved.bounds, np.add(BRICK.bounds, (0.5, -1.0, 0.25)))
    assert moved.exactness == "exact"


@pytest.mark.parametrize("axis", range(3))
def test_a_turn_about_an_axis_leaves_it_exactly(axis: int) -> None:
    matrices = [
        np.asarray(rotation_matrix(const(np.eye(3)[axis]), angle).data) for angle in np.linspace(-7.0, 7.0, 200)
    ]
    np.testing.assert_array_equal([m[axis] for m in matrices], [np.eye(3)[axis]] * 200)


@pytest.mark.parametrize(
    ("axis", "vector"),
    [
        ("x", (1, 0, 0)),
        ("y", (0, 1, 0)),
        ("z", (0, 0, 1)),
        ((1, 2, -2), (1, 2, -2)),
        (np.array([0, 0, -3]), (0, 0, -1)),
    ],
)
@pytest.mark.parametrize("angle", [0.0, 0.7, -2.5, np.pi / 2, 40.5])
def test_rotate_turns_counter_clockwise_seen_from_the_tip(axis: Any, vector: Any, angle: float) -> None:
    turned = BRICK.rotate(angle, axis)
    unit = np.array(vector) / np.linalg.norm(vector)
    assert_placed(turned, BRICK, Rotation.from_rotvec(angle * unit).inv().apply)
    assert turned.exactness == "exact"
    assert_boxed(turned)


def test_a_quarter_turn_about_y_brings_x_to_minus_z() -> None:
    turned = sphere(0.1).translate((1, 0, 0)).rotate(np.pi / 2)
    np.testing.assert_allclose(turned.distance((0, 0, -1)), -0.1, atol=1e-12)


def test_bounds_of_a_turned_box_are_those_of_its_corners() -> None:
    turned = box((2, 1, 1)).rotate(np.pi / 4, "z")
    reach = 0.5 * (2 + 1) / np.sqrt(2)
    np.testing.assert_allclose(turned.bounds[1], [reach, reach, 0.5])


def test_bounds_hold_at_all_times() -> None:
    low, high = box((2, 1, 1)).rotate(time, "z").bounds
    assert np.all(np.isfinite(high)) and np.all(low == -high)
    assert high[0] >= 0.5 * np.hypot(2, 1)


def test_gradients_turn_along() -> None:
    turn = Rotation.from_rotvec([0.3, -0.8, 0.5])
    node = SLANTED.rotate(np.linalg.norm([0.3, -0.8, 0.5]), (0.3, -0.8, 0.5))
    np.testing.assert_allclose(
        node.gradient(POINTS), turn.apply(SLANTED.gradient(turn.inv().apply(POINTS))), atol=1e-12
    )


# Scaling


@pytest.mark.parametrize("factor", [0.01, 0.5, 3.0])
def test_scaling_evenly_keeps_exactness(factor: float) -> None:
    grown = BRICK.scale(factor)
    assert_placed(grown, BRICK, lambda p: p / factor, factor)
    assert grown.exactness == "exact"
    np.testing.assert_allclose(grown.bounds, factor * np.array(BRICK.bounds))


def test_three_equal_factors_are_one() -> None:
    assert BRICK.scale((2, 2, 2)).glsl() == BRICK.scale(2.0).glsl()
    assert BRICK.scale(np.array([2.0, 2.0, 2.0])).exactness == "exact"


def test_a_box_scaled_unevenly_is_a_box() -> None:
    plate = box((2.0, 4.0, 3.0)).scale((1, 0.5, 1e-4))
    assert (plate.exactness, plate.facts.spread) == ("exact", 1.0)
    points = np.random.default_rng(2).uniform(-2, 2, (50, 3))
    np.testing.assert_allclose(plate.distance(points), box((2.0, 2.0, 3e-4)).distance(points), atol=1e-15)
    thin = box(1).scale((1, Param("thin", 0.1, 0.01, 1.0), 1))
    assert thin.exactness == "exact" and thin.distance((0, 0.25, 0)) == pytest.approx(0.2)


def test_scaling_unevenly_gives_a_bound() -> None:
    stretched = sphere(0.5).scale((3.0, 1.0, 0.5))
    assert stretched.exactness == "bound"
    assert stretched.lipschitz <= 1.0
    np.testing.assert_allclose(stretched.distance([(1.5, 0, 0), (0, 0.5, 0), (0, 0, 0.25)]), 0.0, atol=1e-15)
    np.testing.assert_allclose(stretched.bounds[1], [1.5, 0.5, 0.25])
    assert stretched.facts.spread == 6.0


# Matrices: row vectors, as in pyrr


def placed_by(matrix: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda p: (np.hstack([p, np.ones((len(p), 1))]) @ np.linalg.inv(matrix))[:, :3]


PYRR = {
    "translation": pyrr.matrix44.create_from_translation(np.array([0.5, -0.3, 0.2])),
    "rotation": pyrr.matrix44.create_from_y_rotation(0.7),
    "quaternion": pyrr.matrix44.create_from_quaternion(
        pyrr.quaternion.create_from_axis_rotation(np.array([0.0, 0.6, 0.8]), 0.9)
    ),
    "even scale": pyrr.matrix44.create_from_scale(np.array([1.5, 1.5, 1.5])),
    "turned, then moved": pyrr.matrix44.multiply(
        pyrr.matrix44.create_from_z_rotation(0.4), pyrr.matrix44.create_from_translation(np.array([1.0, 0.0, -0.5]))
    ),
    "mirror": np.diag([1.0, 1.0, -1.0, 1.0]),
}


@pytest.mark.parametrize("name", PYRR)
def test_similarities_keep_exactness(name: str) -> None:
    matrix = PYRR[name]
    node = SLANTED.transform(matrix)
    factor = abs(np.linalg.det(matrix[:3, :3])) ** (1 / 3)
    assert_placed(node, SLANTED, placed_by(matrix), factor)
    assert node.exactness == "exact"
    assert_boxed(node)


def test_the_last_row_is_the_offset() -> None:
    matrix = np.eye(4)
    matrix[3, :3] = (1.0, 2.0, 3.0)
    assert sphere(0.5).transform(matrix).distance((1, 2, 3)) == -0.5


UNEVEN = {
    "scale": np.diag([2.0, 0.5, 1.0, 1.0]),
    "shear": np.array([[1, 0, 0, 0], [0.8, 1, 0, 0], [0, 0.3, 1, 0], [0.1, 0, 0, 1]], float),
    "mirrored shear": np.array([[-1, 0.4, 0, 0], [0, 1, 0.2, 0], [0, 0, 0.7, 0], [0, 0, 0.5, 1]], float),
    "turned scale": pyrr.matrix44.multiply(np.diag([2.0, 0.3, 1.0, 1.0]), pyrr.matrix44.create_from_x_rotation(0.8)),
}


@pytest.mark.parametrize("name", UNEVEN)
def test_other_matrices_never_overestimate(name: str) -> None:
    matrix = UNEVEN[name]
    node = BRICK.transform(matrix)
    assert node.exactness == "bound"
    np.testing.assert_array_equal(
        node.distance(POINTS) < 0, BRICK.distance(placed_by(matrix)(POINTS)) < 0, err_msg="the solid itself"
    )
    pairs = POINTS.reshape(-1, 2, 3)
    rise = np.abs(node.distance(pairs[:, 0]) - node.distance(pairs[:, 1]))
    assert np.all(rise <= np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=1))
    slopes = np.linalg.norm(node.gradient(POINTS), axis=1)
    assert slopes.max() <= 1 + 1e-9
    assert slopes.max() > 0.5 * np.linalg.svd(matrix[:3, :3])[1][-1] / np.linalg.svd(matrix[:3, :3])[1][0]
    assert_boxed(node)


def test_normals_of_a_mirrored_solid_point_outwards() -> None:
    node = SLANTED.transform(np.diag([-1.0, 1.0, 1.0, 1.0]))
    away = POINTS[node.distance(POINTS) > 0.1]
    step = away - 0.05 * node.gradient(away)
    np.testing.assert_allclose(node.distance(step), node.distance(away) - 0.05, atol=1e-9)


# Mirrors


def test_mirror_shows_what_lies_on_its_side_twice() -> None:
    ball = sphere(0.3).translate((1, 0.5, 0))
    both = ball.mirror("x")
    image = sphere(0.3).translate((-1, 0.5, 0))
    np.testing.assert_allclose(both.distance(POINTS), (ball | image).distance(POINTS), atol=1e-12)
    assert both.exactness == "exact"
    assert "x" in both.facts.symmetry
    np.testing.assert_allclose(both.bounds, [[-1.3, 0.2, -0.3], [1.3, 0.8, 0.3]])


def test_what_lies_behind_the_mirror_is_gone() -> None:
    gone = sphere(0.3).translate((-1, 0, 0)).mirror("x")
    assert np.all(gone.distance(POINTS) > 0)
    assert sphere(0.3).translate((-1, 0, 0)).mirror((-1, 0, 0)).distance((1, 0, 0)) == -0.3


@pytest.mark.parametrize(
    ("offset", "exactness"), [((0.6, 0, 0), "exact"), ((0.5, 0, 0), "bound"), ((0.2, 0, 0), "bound")]
)
def test_what_touches_the_mirror_grows_together(offset: Any, exactness: str) -> None:
    """The face on the mirror bounds nothing any more, so distances from inside are too small."""
    assert box(1.0).translate(offset).mirror("x").exactness == exactness


def test_a_slanting_mirror() -> None:
    normal = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    ball = sphere(0.25).translate((1.0, 0.2, 0.3))
    both = ball.mirror((2.0, 2.0, 0.0))
    reflected = POINTS - 2 * (POINTS @ normal)[:, None] * normal
    np.testing.assert_allclose(
        both.distance(POINTS), np.minimum(ball.distance(POINTS), ball.distance(reflected)), atol=1e-12
    )
    assert_boxed(both)
    np.testing.assert_allclose(both.bounds, [[-0.45, -1.25, 0.05], [1.25, 0.45, 0.55]], atol=1e-12)


def test_a_mirrored_pair_is_symmetric_on_the_mirror() -> None:
    three = BRICK.mirror("x").mirror("z")
    for axis in (0, 2):
        flipped = POINTS * np.where(np.arange(3) == axis, -1, 1)
        np.testing.assert_allclose(three.distance(flipped), three.distance(POINTS), atol=1e-12)


# Order


def test_a_flat_shape_takes_a_matrix_of_the_plane() -> None:
    turned = np.array([[0.0, 2.0, 0.0], [-2.0, 0.0, 0.0], [0.5, 1.0, 1.0]])
    flat = circle(0.5).translate((1.0, 0.0)).transform(turned)
    assert flat.exactness == "exact"
    assert flat.distance((0.5, 3.0)) == pytest.approx(-1.0)
    sheared = circle(0.5).transform([[1.0, 0.0, 0.0], [0.7, 1.0, 0.0], [0.0, 0.0, 1.0]])
    points = np.random.default_rng(8).uniform(-1.5, 1.5, (500, 2))
    np.testing.assert_array_equal(
        sheared.distance(points) < 0, circle(0.5).distance(points - np.outer(0.7 * points[:, 1], (1, 0))) < 0
    )


def test_methods_apply_one_after_the_other() -> None:
    placed = sphere(0.2).translate((1, 0, 0)).rotate(np.pi / 2, "z").scale(2.0)
    np.testing.assert_allclose(placed.distance((0, 2, 0)), -0.4, atol=1e-12)


def test_functions_and_methods_are_the_same() -> None:
    matrix = PYRR["turned, then moved"]
    for by_method, by_function in (
        (BRICK.translate((1, 2, 3)), translate(BRICK, (1, 2, 3))),
        (BRICK.rotate(0.5, "x"), rotate(BRICK, 0.5, "x")),
        (BRICK.scale((1, 2, 3)), scale(BRICK, (1, 2, 3))),
        (BRICK.mirror("y"), mirror(BRICK, "y")),
        (BRICK.transform(matrix), transform(BRICK, matrix)),
    ):
        assert by_method.glsl() == by_function.glsl()


def test_text_without_matrices_where_none_are_needed() -> None:
    assert "mat3" not in plane().translate((1, 0, 0)).glsl()


# Refusals

_column = np.eye(4)
_column[:3, 3] = 1.0
_flat = np.diag([1.0, 1.0, 0.0, 1.0])
_thin = np.diag([1.0, 1.0, 1e-13, 1.0])
_projective = np.eye(4)
_projective[2, 3] = 0.5
_nan = np.eye(4)
_nan[0, 0] = np.nan

REFUSED: dict[str, tuple[Callable[[], Any], tuple[str, ...]]] = {
    "column vectors": (lambda: BRICK.transform(_column), ("[1.0, 1.0, 1.0, 1.0]", "pass its transpose")),
    "flattening": (lambda: BRICK.transform(_flat), ("[1.0, 1.0, 0.0]", "invertible")),
    "nearly flattening": (lambda: BRICK.transform(_thin), ("1e-13", "invertible")),
    "projective": (lambda: BRICK.transform(_projective), ("0.5", "(0, 0, 0, 1)")),
    "matrix with NaN": (lambda: BRICK.transform(_nan), ("nan", "finite")),
    "3x3 matrix": (lambda: BRICK.transform(np.eye(3)), ("(3, 3)", "4x4")),
    "4x4 matrix in the plane": (lambda: circle().transform(np.eye(4)), ("(4, 4)", "3x3")),
    "columns in the plane": (
        lambda: circle().transform([[1, 0, 2], [0, 1, 0], [0, 0, 1]]),
        ("pass its transpose", "(0, 0, 1)"),
    ),
    "no matrix": (lambda: BRICK.transform("turn"), ("'turn'", "4x4")),
    "scale 0": (lambda: BRICK.scale(0), ("factor = 0", "> 0")),
    "negative scale": (lambda: BRICK.scale((1, -2, 1)), ("(1, -2, 1)", "> 0")),
    "scale not a number": (lambda: BRICK.scale(float("nan")), ("nan", "> 0")),
    "scale of two": (lambda: BRICK.scale((1, 2)), ("(1, 2)", "3 numbers")),
    "unknown axis": (lambda: BRICK.rotate(1.0, "w"), ("axis = 'w'", "'x', 'y', 'z'")),
    "axis of no length": (lambda: BRICK.rotate(1.0, (0, 0, 0)), ("(0, 0, 0)", "not all zero")),
    "flat axis": (lambda: BRICK.rotate(1.0, (1, 0)), ("(1, 0)", "3 numbers")),
    "infinite angle": (lambda: BRICK.rotate(float("inf")), ("inf", "finite")),
    "offset of two": (lambda: BRICK.translate((1, 2)), ("(1, 2)", "3 numbers")),
    "offset a number": (lambda: BRICK.translate(1.0), ("1.0", "3 numbers")),
    "offset with NaN": (lambda: BRICK.translate((0, float("nan"), 0)), ("nan", "finite")),
    "mirror without direction": (lambda: BRICK.mirror((0, 0, 0)), ("(0, 0, 0)", "not all zero")),
    "unknown mirror": (lambda: BRICK.mirror("xy"), ("axis = 'xy'", "'x', 'y', 'z'")),
    "no node": (lambda: translate(3.0, (0, 0, 0)), ("3.0 (float)", "a node")),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_value_range_and_line(name: str) -> None:
    wrong, words = REFUSED[name]
    refused(wrong, *words)


def test_scales_of_scales_are_one_bound() -> None:
    """The smallest of all factors bounds less closely than that of their products; equal products keep exactness."""
    ball, points = sphere(0.5), np.random.default_rng(4).normal(size=(50, 3))
    both = ball.scale((0.03, 1.0, 1.0)).scale((1.0, 1.4, 0.14))
    assert np.allclose(both.distance(points), ball.scale((0.03, 1.4, 0.14)).distance(points), rtol=1e-12)
    assert ball.scale((1.0, 2.0, 1.0)).scale((2.0, 1.0, 2.0)).exactness == "exact"
    wide, turned = (
        np.diag((0.03, 1.0, 1.0, 1.0)),
        np.array([[0, 2.0, 0, 0], [-2, 0, 0, 0], [0, 0, 0.1, 0], [1, 2, 3, 1.0]]),
    )
    made = ball.transform(wide).transform(turned)
    assert np.allclose(made.distance(points), ball.transform(wide @ turned).distance(points), rtol=1e-12)
