"""Convex hulls of points against those of SciPy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial import ConvexHull, Delaunay

import raymarch as rm

RANDOM = np.random.default_rng(4)


@pytest.mark.parametrize("size", [0.001, 1.0, 1000.0])
@pytest.mark.parametrize(("n", "dimension"), [(3, 2), (40, 2), (1000, 2), (4, 3), (12, 3), (60, 3)])
def test_hulls_hold_what_scipy_says(n: int, dimension: int, size: float) -> None:
    points = size * RANDOM.normal(size=(n, dimension))
    made, known = rm.hull(points), ConvexHull(points)
    asked = size * RANDOM.normal(size=(4000, dimension)) * 1.5
    inside = Delaunay(points).find_simplex(asked) >= 0
    depth = np.max(asked @ known.equations[:, :-1].T + known.equations[:, -1], axis=1)
    found = made.distance(asked)
    assert np.array_equal(found < 0, inside)
    assert np.max(np.abs(found - depth)[inside]) < 1e-9 * size
    assert np.all(found[~inside] >= depth[~inside] - 1e-9 * size)
    assert np.allclose(made.bounds, (points.min(axis=0), points.max(axis=0)), atol=1e-9 * size)


def test_hulls_of_known_shapes() -> None:
    asked = RANDOM.uniform(-3, 3, (2000, 3))
    corners = [(x, y, z) for x in (-1, 1) for y in (-0.5, 0.5) for z in (-2, 2)]
    assert np.array_equal(rm.hull([*corners, (0, 0, 0)]).distance(asked), rm.box((2, 1, 4)).distance(asked))
    flat = [(-1, -1), (1, -1), (1, 1), (-1, 1), (0, 1), (0.5, 0.2)]
    round_square = rm.hull(flat).round(0.3)
    assert np.allclose(round_square.distance(asked[:, :2]), rm.rectangle(2).round(0.3).distance(asked[:, :2]))
    assert len(rm.hull(flat).params["points"]) == 4


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: rm.hull([rm.sphere(), rm.torus()]), "rm.hull(points)"),
        (lambda: rm.hull([(0, 0), (1, 1), (2, 2)]), "one line"),
        (lambda: rm.hull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]), "one plane"),
        (lambda: rm.hull([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), "3 different points"),
        (lambda: rm.hull(RANDOM.normal(size=(101, 3))), "4 to 100"),
        (lambda: rm.hull([(0, 0), (1, np.nan), (2, 2)]), "points"),
        (lambda: rm.sphere().hull(), "rm.hull(points)"),
        (lambda: rm.minkowski(rm.box(), rm.sphere(0.1)), "node.offset(radius)"),
        (lambda: rm.box().minkowski(0.1), "offset(radius)"),
        (lambda: rm.convex_hull([(0, 0)]), "rm.hull(points)"),
    ],
)
def test_faults_name_the_cure(make: Callable[[], object], words: str) -> None:
    with pytest.raises(rm.SceneError) as caught:
        make()
    assert words in str(caught.value)
