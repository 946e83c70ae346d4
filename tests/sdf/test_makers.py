"""Extrusions that grow and turn, parts of a revolution, and copies that overlap."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import raymarch as rm

POINTS = np.random.default_rng(1).uniform(-2.5, 2.5, (3000, 3))
X, Y, Z = POINTS.T


@pytest.mark.parametrize(("scale", "twist"), [(1, 0), (0.5, 0), (1, 1.2), (0.5, 1.2), (2, -0.7)])
@pytest.mark.parametrize("profile", [rm.rectangle((2, 1)).translate((0.5, 0)), rm.circle(1) - rm.circle(0.4)])
def test_sections_of_an_extrusion_grow_and_turn_evenly(profile: rm.Node, scale: float, twist: float) -> None:
    solid = profile.extrude(2, scale=scale, twist=twist)
    share = np.clip(Z / 2 + 0.5, 0, 1)
    size, angle = 1 + (scale - 1) * share, twist * share
    back = [np.cos(angle) * X + np.sin(angle) * Y, np.cos(angle) * Y - np.sin(angle) * X]
    inside = (profile.distance(np.stack(back, axis=1) / size[:, None]) < 0) & (abs(Z) < 1)
    values = solid.distance(POINTS)
    assert np.array_equal(values < 0, inside)
    assert np.all(solid.bounds[0] <= POINTS[inside].min(axis=0))
    assert np.all(solid.bounds[1] >= POINTS[inside].max(axis=0))
    two = POINTS + np.random.default_rng(2).normal(size=POINTS.shape) * 0.05
    assert np.all(abs(solid.distance(two) - values) <= np.linalg.norm(two - POINTS, axis=1) * (1 + 1e-9))


@pytest.mark.parametrize("scale", [0, 0.01, 0.5, 2])
@pytest.mark.parametrize(
    "profile", [rm.rectangle((2, 1)), rm.circle(0.9), rm.regular_polygon(5), rm.polygon([(0.2, 0), (1.5, 0), (1, 1)])]
)
def test_convex_sections_end_in_a_tip_without_steep_fields(profile: rm.Node, scale: float) -> None:
    """A tip of 0.01 made the field 3,000 times smaller everywhere, and 0 was refused."""
    solid = profile.extrude(2, scale=scale)
    size = 1 + (scale - 1) * np.clip(Z / 2 + 0.5, 0, 1)
    sections = profile.distance(np.stack([X, Y], axis=1) / np.maximum(size, 1e-12)[:, None])
    assert np.array_equal(solid.distance(POINTS) < 0, (sections < 0) & (abs(Z) < 1))
    assert solid.facts.undivided == 1 and np.allclose(solid.bounds[0][2], -1) and np.allclose(solid.bounds[1][2], 1)


@pytest.mark.parametrize("angle", [0.5, np.pi / 2, np.pi, 4.0, 2 * np.pi])
def test_a_part_of_a_revolution(angle: float) -> None:
    solid = rm.rectangle((0.6, 1)).revolve(1, angle)
    inside = (abs(np.hypot(X, Z) - 1) < 0.3) & (abs(Y) < 0.5) & (abs(np.arctan2(Z, X)) < angle / 2)
    assert np.array_equal(solid.distance(POINTS) < 0, inside)


def test_parameters_move_the_end_of_an_extrusion_and_of_a_revolution() -> None:
    end = rm.Param("end", 1.0, 0.5, 2.0)
    solid = rm.rectangle((2, 1)).extrude(2, scale=end, twist=end)
    fixed = rm.rectangle((2, 1)).extrude(2, scale=0.7, twist=0.7)
    now = solid.distance(POINTS, params={"end": 0.7})
    assert np.array_equal(now < 0, fixed.distance(POINTS) < 0)
    part = rm.circle(0.3).revolve(1, end)
    assert np.array_equal(
        part.distance(POINTS, params={"end": 0.7}) < 0, rm.circle(0.3).revolve(1, 0.7).distance(POINTS) < 0
    )


ROD = rm.capsule((-1.2, 0, 0), (1.2, 0.4, 0), 0.15)


@pytest.mark.parametrize(
    ("spacing", "count", "padding"),
    [
        ((1.0, None, None), 5, 1),
        ((1.0, None, None), 4, 1),
        ((1.0, 2, None), (7, 3, None), 1),
        ((0.6, None, None), 2, 2),
    ],
)
def test_copies_may_overlap_their_neighbours(spacing: Any, count: Any, padding: int) -> None:
    each = [1 if s is None else count if isinstance(count, int) else count[i] for i, s in enumerate(spacing)]
    places = [
        [(i - (n - 1) / 2) * (s or 0.0) for i, n, s in zip(cell, each, spacing, strict=True)]
        for cell in product(*map(range, each))
    ]
    copies = np.min([ROD.distance(POINTS - place) for place in places], axis=0)
    np.testing.assert_allclose(ROD.repeat(spacing, count, padding=padding).distance(POINTS), copies, atol=1e-12)


def test_infinitely_many_copies_may_overlap() -> None:
    copies = np.min([ROD.distance(POINTS - (i, 0, 0)) for i in range(-6, 7)], axis=0)
    np.testing.assert_allclose(ROD.repeat((1, None, None), padding=1).distance(POINTS), copies, atol=1e-12)


def test_many_wide_copies_around_an_axis() -> None:
    blade = rm.box((0.1, 2, 1.5)).rotate(0.5, "x").translate((2, 0, 0))
    turns = 2 * np.pi * np.arange(30) / 30
    copies = [
        blade.distance(np.stack([np.cos(t) * X + np.sin(t) * Z, Y, np.cos(t) * Z - np.sin(t) * X], axis=1))
        for t in turns
    ]
    np.testing.assert_allclose(blade.polar(30).distance(POINTS), np.min(copies, axis=0), atol=1e-12)
    with pytest.raises(rm.SceneError, match="its sector only"):
        blade.polar(31)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rm.star().extrude(1, scale=0), "scale = 0"),
        (lambda: rm.circle().extrude(1, scale=0, twist=1), "scale = 0"),
        (lambda: rm.circle().extrude(1, scale=-1), "scale = -1"),
        (lambda: rm.circle().extrude(1, scale=(1, 2)), "extrude: scale"),
        (lambda: rm.circle().extrude(1, scale=np.ones(2)), "extrude: scale"),
        (lambda: rm.circle().extrude(1, scale=True), "extrude: scale"),
        (lambda: rm.circle().revolve(0, 90), "> 0 and <= 6.28319"),
        (lambda: rm.circle().revolve(0, 0), "> 0 and <= 6.28319"),
        (lambda: ROD.repeat(1), "or padding"),
        (lambda: ROD.repeat(1, padding=-1), "padding = -1"),
        (lambda: ROD.repeat((0.5, None, None), padding=1), "2.7 wide along x, its cell only 1.5"),
        (lambda: rm.box(1.000001).repeat(1), "box is 1.000001 wide along x, its cell only 1"),
    ],
)
def test_refused(make: Any, message: str) -> None:
    with pytest.raises(rm.SceneError, match=message):
        make()


def test_cones_between_points_are_those_about_y() -> None:
    a, b = np.array((0.3, -0.4, 0.5)), np.array((1.0, 0.8, -0.6))
    apart = float(np.linalg.norm(b - a))
    along = (POINTS - a) @ (b - a) / apart
    across = np.linalg.norm(POINTS - a - along[:, None] * (b - a) / apart, axis=1)
    turned = np.stack([across, along - apart / 2, np.zeros(len(along))], axis=1)
    for made, known in (
        (rm.cone_between(a, b, 0.5, 0.2), rm.cone(0.5, apart, 0.2)),
        (rm.round_cone_between(a, b, 0.5, 0.2), rm.round_cone(0.5, apart, 0.2)),
    ):
        assert made.exactness == "exact"
        np.testing.assert_allclose(made.distance(POINTS), known.distance(turned), atol=1e-12)
    below = rm.round_cone_between((0, 1, 0), (0, -1, 0), 0.5, 0.2)
    np.testing.assert_allclose(
        below.distance(POINTS), rm.round_cone(0.5, 2, 0.2).distance(POINTS * [1, -1, 1]), atol=1e-12
    )


def test_a_tube_touches_a_ball_at_each_point_and_follows_a_curve() -> None:
    path, radii = np.array([(0, 0, 0), (1, 0.5, 0), (2, 0, 1), (2, 1, 2)]), np.array([0.3, 0.1, 0.25, 0.05])
    straight, curved = rm.tube(path, radii), rm.tube(path, radii, segments=8)
    balls = np.min([np.linalg.norm(POINTS - c, axis=1) - r for c, r in zip(path, radii, strict=True)], axis=0)
    for made in (straight, curved):
        assert np.all(made.distance(POINTS) <= balls + 1e-12)
        np.testing.assert_allclose(made.distance(path), -radii, atol=0.02)
    assert len(curved.children) == 24
    middle = rm.tube(path, 0.1, segments=2).children[2].bounds
    assert np.all(middle[0] - 0.1 < path[1]) and np.all(path[1] < middle[1] + 0.1)
    inner = rm.tube([(0, 0, 0), (0.1, 0, 0), (1, 0, 0)], (0.5, 0.1, 0.1))
    np.testing.assert_allclose(inner.bounds, [(-0.5, -0.5, -0.5), (1.1, 0.5, 0.5)], atol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rm.tube([(0, 0, 0)]), "two or more points"),
        (lambda: rm.tube([(0, 0, 0), (0, 0, 0)]), "different from the one before"),
        (lambda: rm.tube([(0, 0, 0), (1, 0, 0)], (1, 2, 3)), "a number > 0, or 2 of them"),
        (lambda: rm.tube(np.arange(300.0).reshape(100, 3), segments=32), "3168 pieces"),
        (lambda: rm.cone_between((0, 0, 0), (0, 0, 0)), "the same point"),
        (lambda: rm.round_cone_between((0, 0, 0), (0, 0.1, 0), 1, 0.2), "one ball contains the other"),
    ],
)
def test_tubes_refused(make: Any, message: str) -> None:
    with pytest.raises(rm.SceneError, match=message):
        make()


class Tensor:
    """What is an array for NumPy, as those of other libraries."""

    def __init__(self, values: Any) -> None:
        self._values = np.asarray(values)

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray[Any, Any]:
        return self._values


def test_arrays_of_other_libraries_are_taken_everywhere() -> None:
    ball = rm.sphere(0.2)
    assert ball.repeat(Tensor([1.0, 2.0, 3.0]), Tensor([3, 1, 2])) == ball.repeat((1, 2, 3), (3, 1, 2))
    np.testing.assert_array_equal(
        rm.colormap(0.5, Tensor([[1, 0, 0], [0, 1, 0]])), rm.colormap(0.5, ["red", (0, 1, 0)])
    )
    assert rm.Material(color=Tensor([0.1, 0.2, 0.3])) == rm.Material(color=(0.1, 0.2, 0.3))
    assert rm.tube(Tensor([[0, 0, 0], [1, 0, 0]])).bounds[1][0] == 1.1
