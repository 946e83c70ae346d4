"""Boxes of solids that turn by numbers, parameters and time: tight ones in closed form, and points of random chains."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import raymarch as rm
from raymarch.sdf import Node
from tests.support.turned_solids import drawn, measured, moments

T = rm.time
B = rm.Param("b", 0.0, -1.0, 1.0)


@pytest.mark.parametrize(
    ("node", "upper"),
    [
        (rm.sphere(1).rotate(T, "y"), (1, 1, 1)),
        (rm.sphere(1).translate((2, 0, 0)).rotate(T, "y"), (3, 1, 3)),
        (rm.sphere(1).translate((2, 0, 0)).rotate(T, "y").rotate(T, "x").rotate(3 * T, (1, 2, 3)), (3, 3, 3)),
        (rm.box(1).rotate(T, "y"), (0.5**0.5, 0.5, 0.5**0.5)),
        (rm.box(1).rotate(T, "x").rotate(2 * T, "y"), (0.75**0.5, 0.5**0.5, 0.75**0.5)),
        (rm.box(1).rotate(T, (1, 1, 1)).rotate(T, "x").rotate(T, "z"), (0.75**0.5,) * 3),
        (rm.box(1).rotate(B, "z"), (0.5**0.5, 0.5**0.5, 0.5)),
        (
            rm.box((2, 1, 1)).rotate(0.05 * B, "z"),
            (np.cos(0.05) + 0.5 * np.sin(0.05), 0.5 * np.cos(0.05) + np.sin(0.05), 0.5),
        ),
        # corners at a height of 2.5 / sqrt(2) above the axis, or of 1.5 / sqrt(2)
        (rm.box((4, 1, 1)).rotate(T, (1, 1, 0)), (1.25 + (0.5 * 1.375) ** 0.5,) * 2 + ((4.5 - 1.125) ** 0.5,)),
        (rm.box(1).rotate(T, (1, B, 0)), (0.75**0.5,) * 3),
        (rm.box((2, 1, 1)).orient((rm.sin(T), rm.cos(T), B)), (1.5**0.5,) * 3),
        (rm.cylinder(1, 6).rotate(T, "y"), (1, 3, 1)),
        (rm.cylinder(1, 6).rotate(0.5 * np.pi, "x").translate((0, 2, 0)).rotate(T, "z"), (3, 3, 3)),
        (rm.cylinder(1, 6).rotate(0.25 * np.pi, "x").rotate(T, (0, 1, 1)).material(rm.Material()), (1, 8**0.5, 8**0.5)),
        (rm.torus(1, 0.2).rotate(1, "x").rotate(T, "x").rotate(T, "y"), (1.2, 1.2, 1.2)),
        ((rm.sphere(1) | rm.box(1)).rotate(T, "x").scale(2).rotate(T, "y").round(0.1), (2.1, 2.1, 2.1)),
        ((rm.sphere(1) - rm.box(0.5)).rotate(T, "x").shell(0.2), (1.1, 1.1, 1.1)),
        (rm.sphere(1).translate((0, 2, 0)).rotate(T, "x").mirror("y"), (1, 3, 3)),
        (rm.sphere(1).translate((1, 1, 0)).mirror((1, rm.sin(T), 0)), (1 + 2**0.5, 1 + 2**0.5, 1 + 2**0.5)),
        (rm.plane().rotate(T, "y"), (np.inf, 0, np.inf)),
        (rm.rectangle((2, 1)).rotate(T).extrude(1), (1.25**0.5, 1.25**0.5, 0.5)),
        (rm.circle(1).rotate(1).rotate(T).extrude(1), (1, 1, 0.5)),
    ],
)
def test_tight_boxes(node: Node, upper: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(node.bounds[1], upper, rtol=1e-9)


def test_a_ball_on_an_arm_that_moves_a_little() -> None:
    """The centre moves on an arc from (2, 0, 0) by .3 radians either way."""
    low, high = rm.sphere(1).translate((2, 0, 0)).rotate(0.3 * B, "z").bounds
    np.testing.assert_allclose(high, (3, 1 + 2 * np.sin(0.3), 1))
    np.testing.assert_allclose(low, (2 * np.cos(0.3) - 1, -1 - 2 * np.sin(0.3), -1))


def test_a_chain_of_numbers_is_one_motion() -> None:
    ball, brick = rm.sphere(1), rm.box((1, 2, 3))
    turn, offset = Rotation.identity(), np.zeros(3)
    random = np.random.default_rng(4)
    for i in range(24):
        axis, step = random.normal(size=3), random.uniform(-1, 1, 3)
        ball, brick = ball.rotate(0.7 * i, tuple(axis)), brick.rotate(0.7 * i, tuple(axis)).translate(tuple(step))
        each = Rotation.from_rotvec(0.7 * i * axis / np.linalg.norm(axis))
        turn, offset = each * turn, each.apply(offset) + step
    np.testing.assert_allclose(ball.bounds, [[-1] * 3, [1] * 3], atol=1e-12)
    reach = np.abs(turn.as_matrix()) @ (0.5, 1, 1.5)
    np.testing.assert_allclose(brick.bounds, [offset - reach, offset + reach], atol=1e-12)
    assert (rm.box(1) | rm.box(2)).rotate(1, "x").rotate(-1, "x").facts.spread == pytest.approx(1.0)


def chained(node: Node, count: int) -> Node:
    for i in range(count):
        node = node.rotate(0.1 * (i % 7), (1, 1, i % 2))
    return node


def test_thousands_of_motions() -> None:
    """The field is that of one rotation."""
    node = chained(rm.box(1), 2000)
    assert len(node.glsl()) < 1000
    assert np.all(np.abs(chained(rm.box(1), 200).bounds) <= 0.75**0.5 + 1e-12)
    points = np.random.default_rng(1).normal(size=(100, 3))
    np.testing.assert_allclose(np.linalg.norm(node.gradient(points), axis=1), 1.0)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("rigid", [True, False])
def test_bounds_hold_the_points_of_random_chains(seed: int, rigid: bool) -> None:
    """1e5 points a chain. Rigid ones are also tight: a box of a turned box may be up to 3 sqrt(3) times as large."""
    random = np.random.default_rng(seed)
    solid = drawn(random, 1 + seed % 8, 100, rigid=rigid)
    outside, ratio = measured(solid, moments(random, 1000))
    assert outside < 1e-9, solid.steps
    assert not rigid or ratio < 8.0, solid.steps


@pytest.mark.parametrize("count", [1, 3, 9])
def test_spreads_do_not_grow_with_the_number_of_turns(count: int) -> None:
    """A field that is only a bound may be small far from its box: how far must hold, and not explode."""
    slow: Callable[[], Node] = lambda: rm.box((1, 0.6, 0.8)).scale((1, 3, 2)) | rm.sphere(0.4).translate((1, 0, 0))  # noqa: E731
    for angle in (0.7, T, B):
        node = slow()
        for i in range(count):
            node = node.rotate(angle, "xyz"[i % 3])
        low, high = node.bounds
        assert np.all(high <= 0.45 + np.linalg.norm((0.95, 0.9, 0.8)) + 1e-12)  # the ball about (.45, 0, 0)
        assert node.facts.spread <= 8.0 * slow().facts.spread
        points = np.random.default_rng(2).uniform(-6, 6, (4000, 3))
        outside = np.maximum(np.maximum(low - points, points - high), 0.0).max(axis=1)
        assert np.all(outside <= node.facts.spread * np.maximum(node.distance(points), 0.0) + 1e-9)
