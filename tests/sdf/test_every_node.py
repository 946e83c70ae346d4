"""What every node promises, tested on every definition of the package: see `node_samples`.

Each test reads a fact from the node and holds it against the field itself, evaluated in float64.
"""

from __future__ import annotations

import numpy as np
import pytest
from glsl_harness import assert_es, run
from node_samples import POINTS, Field, NodeSample, definitions, samples, seen
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from raymarch.expr.derivative import companion
from raymarch.expr.glsl import print_functions
from raymarch.expr.types import VECTORS
from raymarch.gpu.context import Context
from raymarch.sdf import Node
from raymarch.sdf.lower import lower

ULP = float(np.finfo(np.float32).eps)

each_node = pytest.mark.parametrize("sample", samples(), ids=lambda s: s.id)

TWIN_ULPS: dict[str, tuple[float, str]] = {}
"""Definitions whose float32 twin may be off by more than 16 ulp, and why."""


def test_every_definition_has_samples() -> None:
    assert {s.definition.name for s in samples()} == {d.name for d in definitions()}
    assert len(definitions()) >= 22


@each_node
def test_glsl_is_the_twin(sample: NodeSample, egl: Context) -> None:
    """float32 on the driver against float64, within 16 ulp of the coordinates or of the solid's size."""
    s = seen(sample)
    text = print_functions([lower(s.node)])
    point = VECTORS[s.node.dimension]
    values = run(egl, s.node.glsl(), "field({0})", [(point, s.points)], samples=text.samples)
    error = np.abs(values - s.values)
    ulps, _ = TWIN_ULPS.get(sample.definition.name, (16.0, ""))
    allowed = ulps * ULP * np.maximum(np.abs(s.points).max(axis=1), s.field.size)
    wrong = ~(error <= allowed)
    share = 0.01 if s.node.exactness == "estimate" else 0.0
    assert wrong.mean() <= share, (
        f"{wrong.sum()} of {POINTS} points differ, worst by {np.nanmax(error / allowed) * ulps:.1f} ulp "
        f"at {s.points[np.argmax(np.nan_to_num(error / allowed, nan=np.inf))]}"
    )


@each_node
def test_glsl_serves_es(sample: NodeSample) -> None:
    node = seen(sample).node
    assert_es(node.glsl(), "field({0})", [VECTORS[node.dimension]])


def _smooth(field: Field, points: NDArray[np.float64], h: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Central differences, and where they mean something: away from kinks."""
    at = field.value(points)
    parts, smooth = [], np.ones(len(points), bool)
    for axis in np.eye(field.dimension):
        after, before = field.value(points + h * axis), field.value(points - h * axis)
        parts.append((after - before) / (2 * h))
        smooth &= np.abs(after - 2 * at + before) <= 1e-4 * h
    return np.stack(parts, axis=-1), smooth


@each_node
def test_gradient_equals_central_differences(sample: NodeSample) -> None:
    s = seen(sample)
    points = s.points[:2000]
    central, smooth = _smooth(s.field, points, 1e-6 * s.field.size)
    gradient = s.field.gradient(points)
    assert np.all(np.isfinite(gradient))
    assert smooth.mean() > 0.5, "too few points are smooth to tell anything"
    np.testing.assert_allclose(gradient[smooth], central[smooth], atol=2e-5 * max(1, s.node.lipschitz))
    np.testing.assert_allclose(s.node.gradient(points[:5]), gradient[:5], atol=1e-12)


@each_node
def test_gradient_on_the_driver(sample: NodeSample, egl: Context) -> None:
    s = seen(sample)
    points = s.points[:4000]
    _, smooth = _smooth(s.field, points, 1e-4 * s.field.size)
    text = print_functions([companion(lower(s.node))])
    body = "\n".join(line.text for line in text.lines()) + "\n"
    declared = "".join(f"uniform sampler{d.dimension}D {name};\n" for name, d in text.samples.items())
    point = VECTORS[s.node.dimension]
    size = s.node.dimension + 1
    values = run(egl, declared + body, "field_gradient({0})", [(point, points)], size, samples=text.samples)
    error = np.abs(values[:, :-1] - s.field.gradient(points)).max(axis=1)[smooth]
    assert np.mean(error < 1e-4) > 0.995, f"off by up to {error.max():.3g}"


@each_node
def test_never_steeper_than_promised(sample: NodeSample) -> None:
    """Pairs of points, far apart and close together; and the gradient itself."""
    s = seen(sample)
    if s.node.exactness == "estimate":
        assert s.node.lipschitz == np.inf
        return
    random = np.random.default_rng(12)
    limit = s.node.lipschitz
    assert 0 < limit <= 1
    steps = random.normal(size=s.points.shape)
    steps *= (s.field.size * 10 ** random.uniform(-5, -0.5, POINTS) / np.linalg.norm(steps, axis=1))[:, None]
    for other, values in ((s.points[::-1], s.values[::-1]), (near := s.points + steps, s.field.value(near))):
        distance = np.linalg.norm(other - s.points, axis=1)
        rise = np.abs(values - s.values)
        rounding = 64 * np.finfo(np.float64).eps * (np.abs(s.points).max() + s.field.size)
        worst = np.argmax(rise - limit * distance)
        assert rise[worst] <= limit * distance[worst] * (1 + 1e-9) + rounding, (s.points[worst], other[worst])
    slopes = np.linalg.norm(s.field.gradient(s.points[:5000]), axis=1)
    assert slopes.max() <= limit * (1 + 1e-9)


@each_node
def test_solid_lies_within_its_bounds(sample: NodeSample) -> None:
    s = seen(sample)
    low, high = s.node.bounds
    assert low.shape == high.shape == (s.node.dimension,)
    assert np.all(low <= high)
    slack = 1e-9 * s.field.size
    inside = s.points[s.values < 0]
    assert len(inside) > 50, "no interior found: give the definition a line in SPECIAL"
    assert np.all((inside >= low - slack) & (inside <= high + slack))
    # Around it as well, farther out than the region looked at so far.
    random = np.random.default_rng(13)
    far = random.uniform(s.field.low - 2 * s.field.size, s.field.high + 2 * s.field.size, s.points[:20_000].shape)
    outside = np.any((far < low - slack) | (far > high + slack), axis=1)
    assert np.all(s.field.value(far)[outside] > 0)


@each_node
def test_bounds_of_exact_shapes_are_tight(sample: NodeSample) -> None:
    s = seen(sample)
    if s.definition_is_no_exact_shape if hasattr(s, "definition_is_no_exact_shape") else (
        sample.definition.arity != "none" or s.node.exactness != "exact"
    ):
        pytest.skip("no exact shape")
    for axis in range(s.node.dimension):
        for edge in (bounds[axis] for bounds in s.node.bounds):
            if np.isfinite(edge):
                assert _lowest_on_plane(s.field, axis, edge) <= 0.01 * s.field.size


def _lowest_on_plane(field: Field, axis: int, at: float) -> float:
    """The smallest value on an axis-aligned plane, by a grid that closes in."""
    low, high = field.low.copy(), field.high.copy()
    best = np.inf
    for _ in range(5):
        sides = [np.array([at]) if k == axis else np.linspace(low[k], high[k], 33) for k in range(field.dimension)]
        grid = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, field.dimension)
        values = field.value(grid)
        middle = grid[np.argmin(values)]
        best = min(best, float(values.min()))
        half = 0.15 * (high - low)
        low, high = middle - half, middle + half
    return best


@each_node
def test_distance_is_never_larger_than_to_the_surface(sample: NodeSample) -> None:
    """For exact nodes and bounds alike: the surface, found by bisection, is at least as far as the field says."""
    s = seen(sample)
    if s.node.exactness == "estimate":
        pytest.skip("an estimate promises nothing")
    cloud = s.field.surface(np.random.default_rng(14), s.points[:40_000], 3000)
    assert len(cloud) == 3000
    distances, nearest = cKDTree(cloud).query(s.points[:20_000])
    excess = np.abs(s.values[:20_000]) - distances
    worst = np.argmax(excess)
    assert excess[worst] <= 1e-9 * s.field.size, (s.points[worst], cloud[nearest[worst]], s.values[worst])


@each_node
def test_exact_distance_is_the_distance(sample: NodeSample) -> None:
    """Inside and outside, against the nearest point of the surface by search."""
    s = seen(sample)
    if s.node.exactness != "exact":
        pytest.skip("not exact")
    random = np.random.default_rng(15)
    cloud = s.field.surface(random, s.points[:40_000], 3000)
    margin = np.minimum(s.points - s.field.low, s.field.high - s.points).min(axis=1)
    known = np.abs(s.values) < margin  # the nearest surface lies in the region looked at
    queries = np.concatenate([s.points[known & (s.values > 0)][:200], s.points[known & (s.values < 0)][:200]])
    distances = nearest_distance(s.field, random, cloud, queries)
    missing = distances - np.abs(s.field.value(queries))
    worst = np.argmax(missing)
    assert missing[worst] <= 2e-3 * s.field.size, (
        f"at {queries[worst]} the field says {s.field.value(queries)[worst]}, the surface is {distances[worst]} away"
    )


def nearest_distance(
    field: Field, random: np.random.Generator, cloud: NDArray[np.float64], queries: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distances to the surface: from the nearest known points of it, by trying others around them."""
    best, index = cKDTree(cloud).query(queries)
    at = cloud[index]
    radius = 0.08 * field.size
    for _ in range(14):
        tried = at[:, None] + radius * random.normal(size=(len(at), 8, field.dimension))
        for _ in range(3):
            slope = field.gradient(tried)
            tried = tried - (field.value(tried) / np.maximum((slope**2).sum(axis=-1), 1e-6))[..., None] * slope
        distances = np.linalg.norm(tried - queries[:, None], axis=-1)
        distances[~(np.abs(field.value(tried)) < 1e-9 * field.size)] = np.inf  # did not reach the surface
        chosen = np.argmin(distances, axis=1)
        rows = np.arange(len(at))
        better = distances[rows, chosen] < best
        best = np.where(better, distances[rows, chosen], best)
        at = np.where(better[:, None], tried[rows, chosen], at)
        radius *= 0.65
    return best


@each_node
def test_symmetry_is_symmetry(sample: NodeSample) -> None:
    s = seen(sample)
    points = s.points[:10_000]
    for axis in s.node.facts.symmetry:
        mirrored = points * np.where(np.arange(s.node.dimension) == "xyz".index(axis), -1.0, 1.0)
        np.testing.assert_allclose(s.field.value(mirrored), s.values[:10_000], atol=1e-12 * s.field.size)


@each_node
def test_equal_nodes_have_equal_text(sample: NodeSample) -> None:
    first, second = sample.build(), sample.build()
    assert first.glsl() == second.glsl()
    assert first.glsl().startswith("float") or "uniform sampler" in first.glsl()


@each_node
def test_one_point_is_like_many(sample: NodeSample) -> None:
    node: Node = seen(sample).node
    points = seen(sample).points[:3]
    assert node.distance(points[0]).shape == ()
    np.testing.assert_array_equal([node.distance(p) for p in points], node.distance(points))
    assert node.distance(points[:0]).shape == (0,)
    assert node.gradient(points[:0]).shape == (0, node.dimension)


@each_node
def test_definition_is_documented(sample: NodeSample) -> None:
    assert len(sample.definition.doc.strip()) > 5
