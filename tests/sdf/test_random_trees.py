"""Facts of random trees of nodes: what holds for each operator must hold for any of them on top of any others."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
from hypothesis import given, settings

from raymarch.expr.glsl import print_functions
from raymarch.expr.types import VEC3
from raymarch.gpu.context import Context
from raymarch.sdf import Node
from raymarch.sdf.evaluation import evaluate_undivided, lower
from tests.support.glsl_harness import run
from tests.support.random_trees import deep_trees, looked_at


@given(deep_trees)
@settings(max_examples=50)
def test_facts_hold(node: Node) -> None:
    field, points, values = looked_at(node)
    assert np.all(np.isfinite(values))
    low, high = node.bounds
    slack = 1e-9 * max(field.size, float(np.abs(points).max()))
    inside = points[values < -slack]
    assert np.all((inside >= low - slack) & (inside <= high + slack)), node
    outside = np.maximum(np.maximum(low - points, points - high), 0.0).max(axis=1)
    spread = node.facts.spread
    with np.errstate(invalid="ignore"):
        assert np.all((outside <= spread * np.maximum(values, 0.0) + slack) | np.isinf(spread)), node
    for axis in node.facts.symmetry:
        mirrored = points * np.where(np.arange(3) == "xyz".index(axis), -1.0, 1.0)
        np.testing.assert_allclose(field.value(mirrored), values, atol=slack)
    if node.exactness == "estimate":
        return
    random = np.random.default_rng(2)
    steps = random.normal(size=points.shape)
    steps *= (field.size * 10 ** random.uniform(-6, -0.3, len(points)) / np.linalg.norm(steps, axis=1))[:, None]
    near = points + steps
    for other, there in ((points[::-1], values[::-1]), (near, field.value(near))):
        distance = np.linalg.norm(other - points, axis=1)
        assert np.all(np.abs(there - values) <= node.lipschitz * distance * (1 + 1e-9) + slack * 1e-3), node
    undivided = evaluate_undivided(node, points)
    assert np.all((undivided > 0) == (values > 0)) and np.all(np.abs(values) <= np.abs(undivided) * (1 + 1e-9)), node
    change = np.abs(evaluate_undivided(node, near) - undivided)
    far = np.linalg.norm(near - points, axis=1)
    assert np.all(change <= node.facts.undivided * far * (1 + 1e-9) + slack * 1e-3), node
    if np.isfinite(node.facts.undivided_spread):
        assert np.all(outside <= node.facts.undivided_spread * np.maximum(undivided, 0.0) + slack), node


def depth(node: Node) -> int:
    return 1 + max((depth(child) for child in node.children), default=0)


def test_promised_slopes_are_met() -> None:
    """Trees are about as steep as they promise; the median of 60 of them, many eight deep and more."""
    loose, depths = [], []

    @given(deep_trees)
    @settings(max_examples=40)
    def look(node: Node) -> None:
        depths.append(depth(node))
        if node.exactness != "estimate":
            field, points, _ = looked_at(node)
            loose.append(node.lipschitz / max(np.linalg.norm(field.gradient(points), axis=1).max(), 1e-9))

    look()
    assert sum(d >= 8 for d in depths) >= 10
    assert np.median(loose) <= 1.5


def made_again(node: Node) -> Node:
    """The tree with a node of its own at each place, made on this line."""
    return Node(node.definition, tuple(map(made_again, node.children)), node.params, label=node.label)


@given(deep_trees)
@settings(max_examples=12)
def test_the_text_depends_on_the_values_alone(node: Node) -> None:
    """Not on the lines that made the nodes, on their variables, or on which objects are shared."""
    assert made_again(node).glsl() == pickle.loads(pickle.dumps(node)).glsl() == node.glsl()


@given(deep_trees)
@settings(max_examples=12)
def test_twins_agree(egl: Context, node: Node) -> None:
    """float32 on the driver against float64; rounding adds up with the depth of the tree."""
    field, points, values = looked_at(node)
    text = print_functions([lower(node)])
    twin: Any = run(egl, node.glsl(), "field({0})", [(VEC3, points)], samples=text.samples)
    scale = 2.0**-23 * max(field.size, float(np.abs(points).max()))
    allowed = np.full(len(points), 256 * scale)
    if node.exactness == "estimate":  # a fractal may change by much where a point moves by an ulp, also in float64
        ulps = np.random.default_rng(5).uniform(-4, 4, (8, *points.shape)) * scale
        allowed += 4 * np.max([np.abs(field.value(points + step) - values) for step in ulps], axis=0)
    wrong = np.abs(twin - values) > allowed
    assert wrong.mean() <= (0.02 if node.exactness == "estimate" else 0.001), node
