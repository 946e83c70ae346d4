"""A solid seen from another origin is the same solid, and nothing far is left in it."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.scene.origin import default_view, origin_of, seen_from
from raymarch.sdf.domain import Vec3
from raymarch.sdf.shifted import shifted
from tests.support.node_samples import NodeSample, definitions, samples

LAST = {sample.definition.name: sample for sample in samples() if sample.definition.dimension == 3}


@pytest.mark.parametrize("sample", LAST.values(), ids=LAST)
def test_the_field_is_the_same(sample: NodeSample) -> None:
    node = sample.build()
    by = np.array([0.7, -1.3, 2.1])
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (200, 3))
    seen = shifted(node, by)
    np.testing.assert_allclose(seen.distance(points), node.distance(points + by), rtol=0, atol=1e-9)
    low, high = node.bounds
    assert np.all(seen.bounds[0] <= low - by + 1e-9) and np.all(seen.bounds[1] >= high - by - 1e-9)
    assert seen.exactness == node.exactness and seen.where == node.where


def test_every_definition_is_there() -> None:
    assert len(LAST) >= 0.4 * len(definitions())


def test_what_was_moved_far_is_not_moved_at_all() -> None:
    solid = (rm.box(1) - rm.sphere(0.6)).round(0.05) | rm.torus().rotate(0.3, "x")
    far = rm.Scene(solid.translate((2e6, 1e6, 0)), rm.Camera((2e6 + 2, 1e6 + 1, 3), (2e6, 1e6, 0)))
    home = rm.Scene(solid)
    assert seen_from(far, origin_of(default_view(far))).node.glsl() == home.node.glsl()
    assert not np.any(origin_of(default_view(home))) and seen_from(home, origin_of(default_view(home))) is home


def test_a_shift_and_back_is_the_same_text() -> None:
    node = rm.union(rm.sphere().translate((1, 2, 3)), rm.plane(offset=2.0), k=0.5).rotate(0.5, "z")
    by = np.array([3.0, 4.0, 5.0])
    points = np.random.default_rng(2).normal(size=(50, 3))
    assert np.allclose(shifted(shifted(node, by), -by).distance(points), node.distance(points), atol=1e-12)


def test_depth_is_no_limit() -> None:
    node: rm.Node = rm.sphere()
    for i in range(1200):
        node = node.round(1e-6) if i % 2 else node.translate((1e-3, 0, 0))
    assert float(shifted(node, np.array([0.6, 0, 0])).distance([(0, 0, 0)])[0]) == pytest.approx(-1.0006, abs=1e-9)


def test_a_pattern_stays_where_it_was() -> None:
    checked = rm.box((4, 1, 4)).material(rm.Material(rm.checker((1, 1, 1), (0, 0, 0), 0.5)))
    seen = shifted(checked, np.array([0.3, 0.0, 0.0]))
    assert seen.name == "translate" and seen.children[0] is checked


@rm.operator(bounds=lambda child: rm.vec3(-child.box.y, child.box.x, child.box.z) + 1e6, placing="rigid")
def laid_far(p: Any, child: Any) -> Any:
    """A quarter turn about z, and a million along each axis."""
    return child(rm.vec3(p.y - 1e6, 1e6 - p.x, p.z - 1e6))


@rm.shape(
    exactness="exact",
    bounds=lambda centre: (centre - 1.0, centre + 1.0),
    shift=lambda by, centre: ({"centre": centre - by}, np.zeros(3)),
)
def ball_at(p: Any, centre: Vec3 = (0.0, 0.0, 0.0)) -> Any:
    """A ball about a point."""
    return rm.length(p - centre) - 1.0


TURNED_FAR = np.array([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [1e6, 1e6, 1e6, 1]])
FAR = {
    "an operator of one's own": lambda: laid_far(rm.box((0.5, 1, 2))),
    "a matrix": lambda: rm.box((0.5, 1, 2)).transform(TURNED_FAR),
    "a shear": lambda: rm.box((0.5, 1, 2)).shear(0.5, "x", "y").translate((1e6, 1e6, 1e6)),
    "a shape of one's own": lambda: ball_at((1e6, 1e6, 1e6)),
}


@pytest.mark.parametrize("name", FAR)
def test_what_is_placed_far_leaves_no_large_number(name: str) -> None:
    node = FAR[name]()
    by = np.array([1e6, 1e6, 1e6])
    seen = shifted(node, by)
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (200, 3))
    np.testing.assert_allclose(seen.distance(points), node.distance(points + by), rtol=0, atol=1e-9)
    assert max(map(float, re.findall(r"\d+\.\d*(?:e[+-]?\d+)?", seen.glsl()))) < 10.0
