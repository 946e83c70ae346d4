"""Materials are opaque labels here: they change no distance, and stay findable as marks."""

from __future__ import annotations

from enum import Enum

import numpy as np
import pytest

from raymarch.expr.arrays import evaluator
from raymarch.expr.derivative import partial_derivatives
from raymarch.expr.walk import find
from raymarch.sdf import Node, box, material, sphere, union
from raymarch.sdf.lower import Lowering

POINTS = np.random.default_rng(4).uniform(-2, 2, (500, 3))


class Label(Enum):
    """Labels that are no materials."""

    RED, BLUE, BASE = range(3)


RED, BLUE, BASE = Label


def weights_at(node: Node, points: np.ndarray) -> dict[Label, np.ndarray]:
    """How much of each label there is at some points."""
    definition = Lowering().field(node, label=BASE)
    marks = find([definition.body], "mark")
    weights = evaluator(partial_derivatives(definition.body, marks), definition.params)(points)
    total: dict[Label, np.ndarray] = {}
    for mark, weight in zip(marks, weights, strict=True):
        total[mark.data] = total.get(mark.data, 0.0) + np.broadcast_to(weight, len(points))
    return total


def label_at(node: Node, point: tuple[float, float, float]) -> Label:
    weights = weights_at(node, np.array([point]))
    return max(weights, key=lambda name: abs(weights[name][0]))


def test_a_label_changes_neither_text_nor_facts() -> None:
    plain, labelled = box(1).translate((1, 0, 0)), material(box(1).translate((1, 0, 0)), RED)
    assert labelled.glsl() == plain.glsl()
    assert labelled.exactness == plain.exactness
    np.testing.assert_array_equal(labelled.bounds, plain.bounds)
    np.testing.assert_array_equal(labelled.distance(POINTS), plain.distance(POINTS))
    assert labelled.labelled and not plain.labelled


def test_a_union_with_labels_has_the_text_of_one_without() -> None:
    def scene(label: bool) -> Node:
        ball = sphere(0.5).translate((1, 0, 0))
        return (ball.material(RED) if label else ball) | box(1) - sphere(0.6)

    assert scene(True).glsl() == scene(False).glsl()


def test_the_nearest_part_gives_its_label() -> None:
    node = sphere(0.5).material(RED) | sphere(0.5).translate((2, 0, 0)).material(BLUE) | box(1).translate((0, 3, 0))
    assert label_at(node, (0.4, 0, 0)) == RED
    assert label_at(node, (1.7, 0, 0)) == BLUE
    assert label_at(node, (0, 2.4, 0)) == BASE


def test_the_innermost_label_stays() -> None:
    node = (sphere(0.5).material(RED) | sphere(0.5).translate((2, 0, 0))).material(BLUE)
    assert label_at(node, (0, 0, 0)) == RED
    assert label_at(node, (2, 0, 0)) == BLUE


def test_operators_carry_labels_along() -> None:
    node = (sphere(0.3).material(RED) | box(0.4).translate((1, 0, 0)).material(BLUE)).rotate(np.pi / 2, "z").round(0.1)
    assert label_at(node, (0, 0, 0)) == RED
    assert label_at(node, (0, 1, 0)) == BLUE
    repeated = (sphere(0.2).material(RED) | sphere(0.2).translate((0.5, 0, 0)).material(BLUE)).repeat((2, None, None))
    assert label_at(repeated, (4, 0, 0)) == RED
    assert label_at(repeated, (-3.5, 0, 0)) == BLUE


def test_a_cut_shows_the_tool_if_it_has_a_label() -> None:
    bare = box(2.0).material(RED) - sphere(0.8)
    painted = box(2.0).material(RED) - sphere(0.8).material(BLUE)
    assert label_at(bare, (0.79, 0, 0)) == RED
    assert label_at(painted, (0.79, 0, 0)) == BLUE
    assert label_at(painted, (0.99, 0.9, 0.9)) == RED


@pytest.mark.parametrize("k", [0.0, 0.4])
def test_weights_sum_to_one(k: float) -> None:
    node = union(
        sphere(0.5).material(RED), box(0.8).translate((0.6, 0, 0)).material(BLUE), sphere(0.3).translate((0, 1, 0)), k=k
    )
    total = sum(weights_at(node, POINTS).values())
    np.testing.assert_allclose(total, 1.0, atol=1e-12)


def test_smooth_blends_mix_labels_as_they_mix_gradients() -> None:
    ball, cube = sphere(0.5), box(0.8).translate((0.7, 0, 0))
    node = union(ball.material(RED), cube.material(BLUE), k=0.5)
    weights = weights_at(node, POINTS)
    mixed = weights[RED][:, None] * ball.gradient(POINTS) + weights[BLUE][:, None] * cube.gradient(POINTS)
    np.testing.assert_allclose(node.gradient(POINTS), mixed, atol=1e-12)
    assert np.any((weights[RED] > 0.2) & (weights[RED] < 0.8))


def test_a_shared_part_may_have_two_labels() -> None:
    ball = sphere(0.4).translate((0, 0.2, 0)) - box(0.2)
    node = ball.material(RED) | ball.translate((2, 0, 0)).material(BLUE)
    assert label_at(node, (0, 0.6, 0)) == RED
    assert label_at(node, (2, 0.6, 0)) == BLUE


def test_any_hashable_object_is_a_label() -> None:
    label = object()
    node = sphere().material(label) | box(3.0).translate((5, 0, 0))
    marks = find([Lowering().field(node, label=None).body], "mark")
    assert {mark.data for mark in marks} == {label, None}
