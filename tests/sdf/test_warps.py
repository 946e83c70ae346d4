"""Orienting, shearing, wrapping and turning into each other: where points go, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.sdf import box, plane, sphere
from tests.support.refusals import refused

RANDOM = np.random.default_rng(9)


@pytest.mark.parametrize("direction", [(1, 2, -0.5), (0, -1, 0), (0, 1, 0), (1e-9, -1, 0), (0, 0, 3)])
def test_orient_points_the_axis(direction: tuple[float, float, float]) -> None:
    """A needle along y comes to lie along the direction, undistorted."""
    node = box((0.2, 2.0, 0.2)).orient(direction)
    unit = np.array(direction) / np.linalg.norm(direction)
    np.testing.assert_allclose(node.distance([unit * 1.5, -unit * 1.5]), 0.5, atol=1e-9)
    assert node.exactness == "exact"
    slopes = np.linalg.norm(node.gradient(RANDOM.uniform(-2, 2, (100, 3))), axis=1)
    np.testing.assert_allclose(slopes, 1.0, atol=1e-9)


def test_orient_takes_another_axis() -> None:
    node = box((2.0, 0.2, 0.2)).orient((0, 0, 1), axis="x")
    assert node.distance([0, 0, 1.2]) == pytest.approx(0.2)


def test_shear_leans() -> None:
    node = box((1.0, 2.0, 1.0)).shear(0.5, "x", "y")
    moved = RANDOM.uniform(-1.5, 1.5, (2000, 3))
    at = moved - np.array([0.5, 0, 0]) * moved[:, 1:2]
    np.testing.assert_array_equal(node.distance(moved) < 0, box((1.0, 2.0, 1.0)).distance(at) < 0)
    assert plane((1, 0, 0)).shear(0.3).distance([0.3, 1.0, 0.0]) == pytest.approx(0.0, abs=1e-12)


def test_wrap_around_makes_a_ring() -> None:
    """Points of the slab go to the angle x / radius and the radius plus z."""
    slab = box((6.0, 1.0, 0.4)) - sphere(0.3).translate((1.0, 0.1, 0.1))
    node, radius = slab.wrap_around(-3.2, 3.2), 6.4 / (2 * np.pi)
    flat = RANDOM.uniform((-3.2, -0.8, -0.4), (3.2, 0.8, 0.4), (4000, 3))
    angle, rho = flat[:, 0] / radius, radius + flat[:, 2]
    ring = np.stack([rho * np.sin(angle), flat[:, 1], rho * np.cos(angle)], axis=1)
    np.testing.assert_array_equal(node.distance(ring) < 0, slab.distance(flat) < 0)


def test_transition_has_both_ends() -> None:
    a, b = box((1.0, 2.0, 1.0)), rm.cylinder(0.7, 2.0)
    node = a.transition(b, (0, -0.5, 0), (0, 0.5, 0))
    points = RANDOM.uniform(-1.2, 1.2, (4000, 3))
    low, high = points[:, 1] < -0.5, points[:, 1] > 0.5
    np.testing.assert_array_equal(node.distance(points[low]) < 0, a.distance(points[low]) < 0)
    np.testing.assert_array_equal(node.distance(points[high]) < 0, b.distance(points[high]) < 0)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: sphere().orient((0, 0, 0)), "not all zero"),
        (lambda: sphere().orient((1, 0, 0), axis="w"), "'x', 'y', 'z'"),
        (lambda: rm.circle().orient((1, 0, 0)), "a solid"),
        (lambda: sphere().shear(0.5, "x", "x"), "two different"),
        (lambda: plane().wrap_around(), "a number as start"),
        (lambda: sphere().wrap_around(-0.5, 0.5), "start and end around the solid"),
        (lambda: sphere(0.5).wrap_around(), "leaves the axis free"),
        (lambda: plane((0, 0, 1)).wrap_around(-3, 3), "cut an unbounded solid"),
        (lambda: plane().transition(sphere(), (0, 0, 0), (0, 1, 0)), "node & box(...)"),
        (lambda: sphere().transition(box(1), (0, 1, 0), (0, 1, 0)), "two different points"),
    ],
)
def test_what_cannot_be_is_refused(make: Any, says: str) -> None:
    refused(make, says)


TRIANGLE = rm.polygon([(-1, -1), (1.2, -1), (0, 1)])
CONVEX = [rm.rectangle((2, 1)), rm.rectangle(1.0), TRIANGLE, rm.polygon([(1, 1), (-1, 1), (-0.6, -0.7), (0.7, -0.9)])]
CONVEX += [rm.regular_polygon(5, 0.8), rm.flat_triangle((-0.8, -0.6), (0.1, 0.8), (0.9, -0.4))]


@pytest.mark.parametrize("bottom", range(len(CONVEX)))
@pytest.mark.parametrize("top", range(len(CONVEX)))
def test_a_frustum_between_polygons_is_straight(bottom: int, top: int) -> None:
    """Any point between a point of one end and a point of the other is in it, and those at the ends are on it."""
    a, b = CONVEX[bottom], CONVEX[top]
    solid = a.extrude_to(b, 1.5, "linear")
    random = np.random.default_rng(bottom * 10 + top)
    ends = [
        points[node.distance(points) <= 0][:400]
        for node, points in zip((a, b), random.uniform(-1.3, 1.3, (2, 4000, 2)), strict=True)
    ]
    n, t = min(map(len, ends)), random.uniform(0, 1, 400)
    share = t[:n, None]
    flat = (1 - share) * ends[0][:n] + share * ends[1][:n]
    assert np.all(solid.distance(np.concatenate([flat, 1.5 * (share - 0.5)], axis=1)) <= 1e-12)
    for node, z in ((a, -0.75 + 1e-9), (b, 0.75 - 1e-9)):  # nothing else is in it
        points = random.uniform(-1.3, 1.3, (2000, 2))
        clear = np.abs(node.distance(points)) > 1e-6
        inside = solid.distance(np.column_stack([points, np.full(len(points), z)])) <= 0
        np.testing.assert_array_equal(inside[clear], node.distance(points)[clear] <= 0)


def test_the_corners_of_a_square_frustum() -> None:
    """Half-way between squares of 2 and 1 the corner is at 0.75, on the line between theirs."""
    solid = rm.rectangle(2.0).extrude_to(rm.rectangle(1.0), 1.0, "linear")
    np.testing.assert_allclose(solid.distance([(0.75, 0.75, 0), (0.75, 0, 0), (1, 1, -0.5)]), 0.0, atol=1e-12)


@pytest.mark.parametrize("beside", [0.0, 1e-7, 1e-5])
@pytest.mark.parametrize("rate", [-0.4, 0.3, 0.8])
def test_normals_where_a_tapered_solid_touches_its_box(rate: float, beside: float) -> None:
    """A hit may lie a little outside the box. The gradient there is that of a torus, by the chain rule."""
    angle, away = np.random.default_rng(0).uniform(0, 2 * np.pi, 500), np.linspace(-0.02, 0.02, 500)
    radius, y = 0.6 + away, np.sqrt(0.04 - away**2)
    width = 1 + rate * y
    points = np.stack([radius * np.cos(angle) * width, y + beside, radius * np.sin(angle) * width], axis=1)
    found = rm.torus(0.6, 0.2).taper(rate).gradient(points)
    steep = -rate * radius * away / width + y  # of the distance to the ring, times .2
    right = np.stack([away / width * np.cos(angle), steep, away / width * np.sin(angle)], axis=1)
    cosine = np.sum(found * right, axis=1) / np.linalg.norm(found, axis=1) / np.linalg.norm(right, axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 0.1


@pytest.mark.parametrize("beside", [1e-7, 1e-5])
@pytest.mark.parametrize("rate", [2.0, -1.0, 0.5])
@pytest.mark.parametrize("deform", ["twist", "bend"])
def test_normals_where_a_bent_or_twisted_solid_touches_its_reach(deform: str, rate: float, beside: float) -> None:
    """The edges of a box lie at its reach. A hit a little outside of a face, beside the edge, has the face's normal,
    although it lies beyond the reach."""
    axis = 1 if deform == "twist" else 2  # the axis of the deformation
    first, second = (2, 0) if deform == "twist" else (0, 1)
    rate = rate if deform == "twist" else 0.4 * rate

    def deformed(point: np.ndarray) -> np.ndarray:
        """The image of a point: turned about the axis by the angle at the image."""
        image = point.copy()
        for _ in range(200):
            angle = rate * image[1] if deform == "twist" else rate * image[0]
            c, s = np.cos(angle), np.sin(angle)
            image[first] = c * point[first] - s * point[second]
            image[second] = s * point[first] + c * point[second]
        return image

    face, edge = np.zeros(3), np.full(3, 0.5)
    edge[axis], face[first] = 0.1, 1.0
    beyond = edge + beside * (0.7 * face - 0.3 * np.eye(3)[second])
    assert np.hypot(beyond[first], beyond[second]) > np.hypot(0.5, 0.5)
    node = rm.box((1, 1, 1)).twist(rate) if deform == "twist" else rm.box((1, 1, 1)).bend(rate)
    found = node.gradient([deformed(beyond), deformed(edge - 1e-4 * np.eye(3)[second])])
    found /= np.linalg.norm(found, axis=1)[:, None]
    assert np.degrees(np.arccos(np.clip(found[0] @ found[1], -1, 1))) < 0.1
