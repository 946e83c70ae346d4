"""How far a ray is free: convex fields, and the advance of every node, held by numbers in float64."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.sdf.advance import DEEPEST, STRETCH, Advancing, along, readable
from raymarch.sdf.convexity import hull_of, is_convex
from raymarch.sdf.evaluation import field_of
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node
from tests.support.node_samples import NodeSample, samples

SOLID = [sample for sample in samples() if sample.definition.dimension == 3]

Lines = tuple[NDArray[np.float64], NDArray[np.float64], float]


def lines_through(node: Node, count: int, seed: int) -> Lines:
    """Points near and far, unit directions, most of which lead past the solid, and the solid's size."""
    random = np.random.default_rng(seed)
    lower, upper = np.clip(node.bounds[0], -9, 9), np.clip(node.bounds[1], -9, 9)
    size, middle, n = float(np.max(upper - lower)), 0.5 * (lower + upper), node.dimension
    points = middle + random.normal(size=(count, n)) * size * random.choice([0.1, 0.5, 2.0], (count, 1))
    others = middle + random.normal(size=(count, n)) * size * 0.4
    directions = others - points
    return points, directions / np.linalg.norm(directions, axis=1)[:, None], size


@pytest.mark.parametrize("sample", samples(), ids=lambda sample: sample.id)
def test_fields_that_count_as_convex_lie_above_their_tangents(sample: NodeSample) -> None:
    node = sample.build()
    if not is_convex(node):
        return
    points, directions, size = lines_through(node, 2000, 1)
    steps = np.random.default_rng(2).uniform(-3, 3, (len(points), 1)) * size
    pairs = evaluator([along(field_of(node)).body], along(field_of(node)).params)(points, directions)[0]
    here, slopes = pairs[:, 0], pairs[:, 1]
    there, middle = node.distance(points + steps * directions), node.distance(points + 0.5 * steps * directions)
    assert np.all(here + there - 2.0 * middle > -1e-9 * size)
    assert np.all(there - here - slopes * steps[:, 0] > -1e-8 * size)


@pytest.mark.parametrize("sample", SOLID, ids=lambda sample: sample.id)
def test_no_surface_lies_in_the_advance(sample: NodeSample) -> None:
    node = sample.build()
    if not readable(node):
        return
    made = Advancing(Lowering()).function(node)
    points, directions, size = lines_through(node, 400, 3)
    cone = np.arange(len(points)) % 2.0  # rays and cones in turns
    start, growth = 0.02 * cone, 0.1 * cone
    stretches = size * 10.0 ** np.random.default_rng(4).uniform(-2.0, 0.5, len(points))
    numbers = start, growth, stretches
    (found,) = evaluator([made.body], [*made.params, STRETCH])(points, directions, *numbers)
    value, inside, advance = found[:, 0], found[:, 1] < 0.0, np.minimum(np.abs(found[:, 1]), 8.0 * size)
    np.testing.assert_allclose(value, node.distance(points), rtol=1e-12, atol=1e-12 * size)
    plain, side = np.where(inside, -value, value), np.where(inside, -1.0, 1.0)
    assert np.all(plain[inside] > 0.0)
    share = np.concatenate([np.linspace(0.0, 0.999999, 30), 1.0 - np.geomspace(1e-6, 1e-2, 6)])
    s = share * advance[:, None]
    passed = node.distance((points[:, None] + s[..., None] * directions[:, None]).reshape(-1, 3)).reshape(s.shape)
    passed *= side[:, None]
    assert np.all((passed - start[:, None] - growth[:, None] * s > -1e-9 * size) | (advance[:, None] < 1e-9 * size))
    assert np.all(inside | (advance > 0.999 * (plain - start) / (1.0 + growth) * node.lipschitz - 1e-9))


def test_of_united_implicit_surfaces_the_value_is_a_bound_and_the_way_leads_through_the_box() -> None:
    quadric = rm.implicit(lambda p: p.x**2 + 2 * p.y**2 + p.z**2 - 1, 1.2).rotate(0.5, "y")
    node = quadric.translate((-2, 0, 0)) | rm.sphere(0.4).translate((2, 0, 0))
    made = Advancing(Lowering()).function(node)
    points, directions, size = lines_through(node, 2000, 5)
    (found,) = evaluator([made.body], [*made.params, STRETCH])(points, directions, 0.0, 0.0, 3.0 * size)
    distance, far = node.distance(points), quadric.translate((-2, 0, 0)).distance(points) > 1.3
    assert np.all(np.sign(found[:, 0]) == np.sign(distance))
    assert np.all(found[:, 0] <= distance + 1e-12)
    s = np.minimum(np.abs(found[:, 1]), 8.0 * size)[:, None] * np.linspace(0.0, 0.999999, 60)
    passed = node.distance((points[:, None] + s[..., None] * directions[:, None]).reshape(-1, 3)).reshape(s.shape)
    assert np.all(passed * np.sign(distance)[:, None] > -1e-9 * size)
    ends = node.distance(points + np.minimum(found[:, 1], 8.0 * size)[:, None] * directions)
    assert np.sum(far & (found[:, 1] < 8.0 * size) & (np.abs(ends) < 1e-3)) > 50


@pytest.mark.parametrize("shape", [(2, 2), (3, 40), (33, 34)])
def test_steep_heights_are_not_passed(shape: tuple[int, int]) -> None:
    random = np.random.default_rng(8)
    node = rm.heightmap(random.uniform(-1, 1, shape), size=(2, 3), height=0.7, base=0.8)
    made = Advancing(Lowering()).function(node)
    points, directions, _ = lines_through(node, 3000, 5)
    points[::3, (0, 2)] = np.round(points[::3, (0, 2)], 1)  # on borders of cells
    directions[::5, 0], directions[::7, 2] = 0.0, 0.0
    stretches = 10.0 ** random.uniform(-3.0, 1.0, len(points))
    zero = np.zeros(len(points))
    (found,) = evaluator([made.body], [*made.params, STRETCH])(points, directions, zero, zero, stretches)
    value, advance = found[:, 0], np.minimum(found[:, 1], 9.0)
    assert np.all(value == node.distance(points)) and np.all(advance[value > 0.0] > 0.0)
    for part in np.linspace(0.0, 0.999, 60):
        there = node.distance(points + part * advance[:, None] * directions)
        assert np.all(there[value > 1e-9] > -1e-9)


def test_a_false_statement_of_convexity_is_found() -> None:
    node = rm.torus()
    assert not is_convex(node)
    points, directions, size = lines_through(node, 2000, 1)
    middle = node.distance(points + size * directions)
    bent = node.distance(points) + node.distance(points + 2.0 * size * directions) - 2.0 * middle
    assert np.min(bent) < -1e-3


def test_convex_fields_and_hulls_of_shapes() -> None:
    convex = [rm.sphere(), rm.box(1), rm.dodecahedron(), rm.capsule(), rm.ellipsoid(), rm.sphere().scale((1, 2, 3))]
    convex += [rm.intersection(rm.box(1), rm.sphere(), k=0.1), rm.box(1).round(0.1), rm.box(1) & rm.sphere()]
    assert all(map(is_convex, convex))
    assert not any(
        map(is_convex, (rm.box(1) | rm.sphere(), rm.box(1) - rm.sphere(), rm.box(1).twist(1.0), rm.gyroid()))
    )
    assert hull_of(rm.torus()) is not None
    assert hull_of(rm.sphere()) is None


def test_the_way_is_that_of_the_closed_form() -> None:
    def advance(node: Node, point: tuple[float, ...], direction: tuple[float, ...]) -> float:
        made = Advancing(Lowering()).function(node)
        zero = np.zeros(1)
        return float(evaluator([made.body], made.params)(np.array([point]), np.array([direction]), zero, zero)[0][0, 1])

    tilted = (0.0, -0.6, -0.8)
    assert advance(rm.plane(), (0.0, 3.0, 0.0), tilted) == pytest.approx(5.0)
    assert advance(rm.plane(), (0.0, 3.0, 0.0), (0.0, 0.6, 0.8)) >= 1e18
    hole = rm.plane() - rm.sphere(1.0)
    assert advance(hole, (0.0, -0.5, 0.0), (0.0, -1.0, 0.0)) == pytest.approx(0.5)
    rows = rm.cylinder(0.2, 1.0).repeat((1.0, None, 1.0))
    assert advance(rows, (0.5, 0.0, 0.0), (0.0, 0.0, 1.0)) > 0.5
    stretched = rm.sphere().scale((1.0, 4.0, 1.0))
    assert advance(stretched, (3.0, 0.0, 0.0), (-1.0, 0.0, 0.0)) == pytest.approx(2.0)


def test_deep_trees_are_not_read() -> None:
    node = rm.sphere()
    for _ in range(DEEPEST + 1):
        node = node.translate((0.1, 0.0, 0.0))
    assert not readable(node)
    assert readable(rm.sphere() | rm.box(1))
