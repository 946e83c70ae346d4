"""Warps by a function of the point: the solid, the box and the stretch that are derived, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import clamp, floor, sin, sqrt, vec3
from tests.support.refusals import refused

CASES: dict[str, Callable[[float], rm.Node]] = {
    "waves": lambda s: rm.sphere(s).warp(lambda p: 0.1 * s * sin(6.0 / s * p.yzx)),
    "one side": lambda s: rm.box((4 * s, 0.3 * s, 0.3 * s)).warp(
        lambda p: vec3(0.0, s, 0.0) * eased(clamp((p.x / s + 1.0) / 2.0, 0.0, 1.0))
    ),
    "parabola": lambda s: rm.box((2 * s, 0.2 * s, s)).warp(lambda p: vec3(0.0, 0.4 / s * p.x * p.x, 0.0)),
    "twice the size": lambda s: rm.torus(s, 0.3 * s).warp(lambda p: -0.5 * p),
    "clamped": lambda s: rm.box((s, s, s)).warp(lambda p: vec3(3.0 * p.y, 0.0, 0.0), 0.2 * s),
    "of a warp": lambda s: rm.sphere(s).warp(lambda p: 0.2 * p.zxy).warp(lambda p: 0.1 * s * sin(3.0 / s * p.zyx)),
}


def eased(t: Expr) -> Expr:
    return t * t * (3.0 - 2.0 * t)


def pairs(node: rm.Node, count: int = 100_000) -> tuple[Any, Any]:
    """Points in and around the box of a node, and points beside them."""
    random = np.random.default_rng(3)
    lower, upper = node.bounds
    size = upper - lower
    points = random.uniform(lower - 0.5 * size, upper + 0.5 * size, (count, 3))
    return points, points + random.normal(size=points.shape) * 1e-5 * size.max()


def test_the_solid_is_the_preimage_of_the_map() -> None:
    points = np.random.default_rng(4).uniform(-3, 3, (50_000, 3))
    x, y, z = points.T
    node = rm.box((4.0, 0.3, 0.3)).warp(lambda p: vec3(0.0, sin(2.0 * p.x), 0.5 * p.x * p.x))
    inside = (np.abs(x) < 2) & (np.abs(y + np.sin(2 * x)) < 0.15) & (np.abs(z + 0.5 * x * x) < 0.15)
    assert inside.sum() > 50
    np.testing.assert_array_equal(node.distance(points) < 0, inside)


def test_a_linear_warp_is_a_shear() -> None:
    warped, sheared = rm.sphere().warp(lambda p: vec3(-0.5 * p.y, 0.0, 0.0)), rm.sphere().shear(0.5)
    points, _ = pairs(sheared)
    near = np.all((points > warped.bounds[0]) & (points < warped.bounds[1]), axis=1)
    np.testing.assert_allclose(warped.distance(points[near]), sheared.distance(points[near]), atol=1e-12)
    assert warped.facts.divisor == pytest.approx(sheared.facts.divisor)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("name", CASES)
def test_the_box_holds_the_solid_and_no_slope_exceeds_one(name: str, size: float) -> None:
    node = CASES[name](size)
    points, beside = pairs(node)
    inside = points[node.distance(points) < 0]
    assert len(inside) > 100
    assert np.all((inside >= node.bounds[0]) & (inside <= node.bounds[1]))
    slope = np.abs(node.distance(points) - node.distance(beside)) / np.linalg.norm(points - beside, axis=1)
    assert slope.max() <= 1.0 + 1e-6
    assert slope.max() > 0.5  # so the constant is not far too large
    np.testing.assert_allclose(node.bounds, np.multiply(CASES[name](1.0).bounds, size), rtol=1e-6, atol=1e-6 * size)


@pytest.mark.parametrize("name", CASES)
def test_the_picture_is_proved(name: str) -> None:
    """A proof by intervals, which does not use the constant."""
    found = rm.prove(rm.Scene(CASES[name](1.0) | rm.plane(offset=-2.7)), size=(64, 36))
    assert not np.any(found.state == 1)
    assert found.share > 0.99


def test_what_moves_is_within_the_box_at_every_time() -> None:
    lift = rm.Param("lift", 0.2, 0.0, 0.6)
    node = rm.box((2.0, 0.2, 1.0)).warp(lambda p: vec3(0.0, lift * sin(3.0 * p.x + rm.time), 0.0))
    assert node.bounds[1] == pytest.approx((1.0, 0.7, 0.5))
    points, beside = pairs(node)
    for time, value in ((0.0, 0.6), (1.3, 0.6), (40.0, 0.1)):
        given: dict[str, Any] = {"time": time, "params": {"lift": value}}
        now = node.distance(points, **given)
        assert np.all(np.abs(points[now < 0]) <= node.bounds[1])
        slope = np.abs(now - node.distance(beside, **given)) / np.linalg.norm(points - beside, axis=1)
        assert slope.max() <= 1.0 + 1e-6


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: rm.sphere().warp(lambda p: 0.1 * floor(p)), "lipschitz = "),
        (lambda: rm.plane().warp(lambda p: 0.1 * p), "node & box(...)"),
        (lambda: rm.sphere().warp(lambda p: p * p * p), "amplitude and lipschitz as numbers"),
        (lambda: rm.sphere().warp(lambda p: 0.1 * sqrt(p)), "amplitude and lipschitz as numbers"),
        (lambda: rm.sphere().warp(lambda p: p.x), "a vec3"),
        (lambda: rm.sphere().warp(3), "a function of a point"),
        (lambda: rm.circle().warp(lambda p: 0.1 * sin(p)), "a solid"),
        (lambda: rm.sphere().warp(lambda p: 0.1 * p, -1.0), ">= 0"),
        (lambda: rm.sphere().warp(lambda p: 0.1 * p, 0.1, 0.0), "> 0"),
        (lambda: rm.sphere().warp(lambda p: "red"), "a function from a point to a vec3"),
    ],
)
def test_what_cannot_be_is_refused(make: Any, says: str) -> None:
    refused(make, says)
