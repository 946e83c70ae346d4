"""Displacement by a function: what is derived of it, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.derivative import companion
from raymarch.expr.vocabulary import cos, floor, sin, sqrt
from raymarch.sdf import box, plane, sphere
from raymarch.sdf.noise import lattice_noise, value_noise
from tests.support.refusals import refused

POINTS = np.random.default_rng(6).uniform(-2, 2, (20_000, 3))


def test_the_surface_moves_by_the_function() -> None:
    node = plane().displace_by(lambda p: 0.1 * sin(3.0 * p.x) * cos(2.0 * p.z))
    x, z = POINTS[:, 0], POINTS[:, 2]
    heights = -0.1 * np.sin(3.0 * x) * np.cos(2.0 * z)
    assert np.all(np.abs(node.distance(np.stack([x, heights, z], axis=1))) < 1e-12)
    assert node.params["amplitude"].data == pytest.approx(0.1)
    assert 0.3 <= node.params["slope"].data <= np.hypot(0.3, 0.2) + 1e-12


def test_a_polynomial_is_held_outside_of_the_solid() -> None:
    """Its slope has a bound only there; on the surface nothing of that is seen."""
    node = box((1, 1, 1)).displace_by(lambda p: 0.2 * p.x * p.x)
    free = box((1, 1, 1)).displace_by(lambda p: 0.2 * p.x * p.x, 0.2, 1.0)
    np.testing.assert_array_equal(node.distance(POINTS) < 0, free.distance(POINTS) < 0)
    assert node.facts.bounded


def test_far_away_nothing_is_divided() -> None:
    node = sphere().displace_by_noise(0.05, 8.0)
    far = np.array([[0.0, 40.0, 0.0]])
    assert node.distance(far)[0] == pytest.approx(39.0 - 0.05)


def test_noise_is_as_steep_as_it_says() -> None:
    """Random values of both extremes make it nearly pi steep; a smaller constant would be wrong."""
    slope = companion(lattice_noise)
    at = np.random.default_rng(7).uniform(-30, 30, (200_000, 3))
    (both,) = evaluator([slope.body], slope.params)(at)
    steepest = np.linalg.norm(both[:, :3], axis=1).max()
    assert 2.0 < steepest <= np.pi
    assert np.abs(both[:, 3]).max() <= 1.0


def test_the_slope_of_noise_in_a_function_is_derived() -> None:
    """Over all space, by the chain rule: two octaves of equal slope in the plane, each component at most pi."""
    terrain = plane().displace_by(lambda p: 0.3 * value_noise(2 * p.xz) + 0.15 * value_noise(4 * p.xz))
    assert float(terrain.params["slope"]) == pytest.approx(0.3 * 2 * 2 * np.sqrt(2) * np.pi)
    assert float(terrain.params["amplitude"]) == pytest.approx(0.45)
    points = np.random.default_rng(3).uniform(-20, 20, (20_000, 3)) * (1, 0.02, 1)
    moved = points + 1e-3 * np.random.default_rng(4).normal(size=points.shape)
    slopes = np.abs(terrain.distance(moved) - terrain.distance(points)) / np.linalg.norm(moved - points, axis=1)
    assert slopes.max() <= 1.0
    assert rm.plane().displace_by(lambda p: rm.noise(0, 0.2, 2.0)(p)).facts.exactness == "bound"
    refused(lambda: value_noise(1.0), "a vec3 or a vec2")


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: sphere().displace_by(lambda p: floor(p.x)), "lipschitz = "),
        (lambda: plane().displace_by(lambda p: 0.1 * p.x), "node & box(...)"),
        (lambda: sphere().displace_by(lambda p: 50.0 * p.x * p.x), "amplitude and lipschitz as numbers"),
        (lambda: sphere().displace_by(lambda p: sqrt(p.x), 0.1), "amplitude and lipschitz as numbers"),
        (lambda: sphere().displace_by(lambda p: p), "a number"),
        (lambda: sphere().displace_by(3), "a function of a point"),
        (lambda: rm.circle().displace_by(lambda p: 0.1 * sin(p.x)), "a solid"),
        (lambda: sphere().displace_by(lambda p: 0.1 * sin(p.x), -1.0), ">= 0"),
        (lambda: sphere().displace_by_noise(0.1, 0.0), "> 0"),
        (lambda: sphere().displace_by_noise(octaves=99), "<= 16"),
    ],
)
def test_what_cannot_be_is_refused(make: Any, says: str) -> None:
    refused(make, says)


@pytest.mark.parametrize("size", [1e-9, 1e9, 1e12])
def test_the_amplitude_of_a_function_may_be_of_any_size(size: float) -> None:
    """It is a length: what float32 limits is the slope."""

    def made(s: float) -> rm.Node:
        return rm.sphere(0.8 * s).displace_by(lambda p: 0.15 * s * rm.worley(p * (3 / s)) + 0.1 * p.x * p.y / s)

    for corner, at_one in zip(made(size).bounds, made(1.0).bounds, strict=True):
        assert corner / size == pytest.approx(at_one)
    with pytest.raises(rm.SceneError, match="have no limit"):
        rm.sphere(size).displace_by(lambda p: rm.exp(1e3 * p.x / size) * size)
