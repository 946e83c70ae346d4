"""Implicit surfaces: what is derived of their functions, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from tests.support.refusals import refused
from tests.support.surfaces import SURFACES

POINTS = np.random.default_rng(3).uniform(-1.0, 1.0, (20_000, 3))


@pytest.mark.parametrize("name", SURFACES)
def test_the_sign_is_that_of_the_function_and_the_slope_is_at_most_1(name: str) -> None:
    surface = SURFACES[name]
    node = surface.node()
    points = POINTS * surface.bounds
    values = surface.function(points.T)
    np.testing.assert_array_equal(node.distance(points) < 0.0, values < 0.0)
    moved = points + 1e-4 * surface.bounds * np.random.default_rng(4).normal(size=points.shape)
    rise = np.abs(node.distance(moved) - node.distance(points)) / np.linalg.norm(moved - points, axis=1)
    assert rise.max() <= 1.0 + 1e-9
    assert node.facts.exactness == "bound"


def test_the_box_closes_the_solid_and_shrinks_around_it() -> None:
    node = rm.implicit(lambda p: p.x * p.x + p.z * p.z - 0.04, ((-4.0, -1.0, -4.0), (4.0, 1.0, 4.0)))
    np.testing.assert_allclose(node.distance([(0, 1.5, 0), (0, -1.5, 0), (0, 1, 0)]), [0.5, 0.5, 0.0], atol=1e-12)
    np.testing.assert_allclose(node.bounds, [[-0.5, -1.0, -0.5], [0.5, 1.0, 0.5]])


def test_a_solid_closes_it() -> None:
    ball = rm.sphere(0.8)
    node = rm.implicit(SURFACES["clebsch"].expression, ball)
    inside = (SURFACES["clebsch"].function(POINTS.T) < 0.0) & (np.linalg.norm(POINTS, axis=1) < 0.8)
    np.testing.assert_array_equal(node.distance(POINTS) < 0.0, inside)


def test_blends_act_on_about_the_distance() -> None:
    """A quadric with another factor is the same solid; blended, it is the same solid too, and about that of balls."""
    ball, floor = rm.sphere(), rm.plane(offset=-1.2)
    for factor in (1.0, 300.0):
        node = rm.implicit(lambda p, factor=factor: factor * (rm.dot(p, p) - 1.0), 1.5)
        blended, wanted = (rm.union(solid, floor, k=0.5) for solid in (node, ball))
        inside, should = (solid.distance(2.0 * POINTS) < 0.0 for solid in (blended, wanted))
        assert 0.0 < np.mean(inside != should) < 0.004


def test_a_parameter_moves_the_level() -> None:
    node = rm.implicit(lambda p: rm.dot(p, p), 1.5, rm.Param("level", 1.0, 0.25, 2.0))
    assert float(node.bounds[1][0]) >= math.sqrt(2.0) - 1e-9
    assert node.distance([(0.9, 0, 0)])[0] < 0.0


def test_a_function_without_a_bound_of_its_slope_is_an_estimate() -> None:
    node = rm.implicit(lambda p: rm.sqrt(abs(p.x)) + abs(p.y) + abs(p.z) - 0.5, 1.0)
    assert node.facts.exactness == "estimate"
    assert node.distance([(0, 0, 0)])[0] < 0.0 < node.distance([(0.9, 0, 0)])[0]


def test_a_root_of_squares_is_a_length() -> None:
    """Its slope is bounded, so the solid is certified."""
    torus = rm.implicit(lambda p: ((p.x**2 + p.z**2) ** 0.5 - 1.0) ** 2 + p.y**2 - 0.1, 2.0)
    ball = rm.implicit(lambda p: np.linalg.norm(p) - 1.0, 2.0)
    assert (torus.facts.exactness, ball.facts.exactness) == ("bound", "bound")
    np.testing.assert_array_equal(ball.distance(POINTS) < 0.0, np.linalg.norm(POINTS, axis=1) < 1.0)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: rm.implicit(lambda p: rm.dot(p, p) + 1.0, 1.0), "nowhere below its level in the box: 1"),
        (lambda: rm.implicit(lambda p: rm.dot(p, p) - 9.0, 1.0), "everywhere in the box"),
        (lambda: rm.implicit(lambda p: p.x / (p.y - p.y) + 1.0, 1.0), "surface is -inf at [-1.0"),
        (lambda: rm.implicit(lambda p: (p.x - p.z) / (p.x - p.z) - 0.5, 1.0), "surface is nan at [-1.0"),
        (lambda: rm.implicit(lambda p: p.x, np.inf), "two corners (lower, upper)"),
        (lambda: rm.implicit(lambda p: p.x, rm.plane()), "not bounded"),
        (lambda: rm.implicit(lambda p: p.x, ((0, 0, 0), (1, np.inf, 1))), "not bounded"),
        (lambda: rm.implicit(lambda p: p.x, -1.0), "the cube from -b to b"),
        (lambda: rm.implicit(lambda p: p.x, "box"), "the cube from -b to b"),
        (lambda: rm.implicit(lambda p: p, 1.0), "gives a vec3"),
        (lambda: rm.implicit(lambda p: 1.0, 1.0), "does not depend on the point"),
        (lambda: rm.implicit(lambda p: "x", 1.0), "negative inside, of functions of raymarch"),
        (lambda: rm.implicit(lambda p: p.x < 0.0, 1.0), "gives a bool"),
        (lambda: rm.implicit(np.sin, 1.0), "test_implicit.py"),
        (lambda: rm.implicit(3.0, 1.0), "negative inside, of functions of raymarch"),
        (lambda: rm.implicit(rm.sphere(), 1.0), "negative inside, of functions of raymarch"),
        (lambda: rm.implicit(lambda p: math.sin(p.x), 1.0), "rm.sin in place of math.sin"),
        (lambda: rm.implicit(lambda p: np.sum(p * p) - 1.0, 1.0), "raymarch's own functions"),
        (lambda: rm.implicit(lambda p: np.where(p.x > 0.0, 1.0, -1.0), 1.0), "of functions of raymarch"),
        (lambda: rm.implicit(lambda p: p.x, 1.0, "red"), "level"),
        (lambda: rm.implicit(lambda p: p.x), "implicit needs 'bounds'"),
    ],
)
def test_refused(make: Any, says: str) -> None:
    refused(make, says)
