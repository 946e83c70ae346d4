"""Gradients on planes of symmetry, where distances are equal, against one-sided differences of the distance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from raymarch.expr import var
from raymarch.expr.arrays import evaluator
from raymarch.expr.derivative import gradient
from raymarch.expr.types import FLOAT
from raymarch.sdf import Node
from raymarch.sdf.blends import FAMILIES
from tests.support.one_sided import SURE, limits, mirrored_fields, on_the_plane


@pytest.mark.parametrize(("name", "build"), [pytest.param(*pair, id=pair[0]) for pair in mirrored_fields()])
def test_the_gradient_is_the_limit_from_both_sides_or_lies_between_them(name: str, build: Callable[[], Node]) -> None:
    node = build()
    points = on_the_plane(5, 50)
    seen = limits(node.distance, points)
    assert seen.sure.mean() > 0.5
    assert seen.missed(node.gradient(points))[seen.sure].max() < 1e-6


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("k", [0.1, 1.0])
def test_partial_derivatives_of_a_fold_at_ties(family: str, k: float) -> None:
    """Where both are equal, and where one is the radius of a fillet: materials take the same weights."""
    a, b, width = var("a", FLOAT), var("b", FLOAT), var("k", FLOAT)
    fold = FAMILIES[family](4).fold
    radius = k if family == "round" else k * 0.25 / (np.sqrt(2.0) - 1.0)
    made = fold(a, b, width)
    value = evaluator([made], [a, b, width])
    slopes = evaluator([gradient(made, a), gradient(made, b)], [a, b, width])
    random = np.random.default_rng(7)
    first = np.append(random.uniform(-1, 2, 60) * k, np.full(40, radius))
    second = np.append(first[:60], random.uniform(-1, 3, 40) * k)
    found = [np.broadcast_to(s, first.shape) for s in slopes(first, second, np.full(100, k))]
    steps = 1e-4 * k * 0.5 ** np.arange(3)

    def side(move_a: float, move_b: float) -> np.ndarray:
        at = [value(first + move_a * h, second + move_b * h, np.full(100, k))[0] for h in (0.0, *steps)]
        coarse, middle, fine = [(v - at[0]) / h for v, h in zip(at[1:], steps, strict=True)]
        return ((4 * (2 * fine - middle) - (2 * middle - coarse)) / 3).astype(float)

    for slope, way in zip(found, ((1.0, 0.0), (0.0, 1.0)), strict=True):
        right, left = side(*way), -side(-way[0], -way[1])
        low, high = np.minimum(left, right), np.maximum(left, right)
        assert np.all((slope > low - 1e-6) & (slope < high + 1e-6))
    if family in ("quadratic", "cubic", "quartic", "circular", "exponential", "root"):
        np.testing.assert_allclose([s[:60] for s in found], 0.5, atol=10 * SURE)
