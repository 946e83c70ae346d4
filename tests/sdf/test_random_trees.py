"""Facts of random trees of nodes: what holds for each operator must hold for any of them on top of any others."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from glsl_harness import run
from hypothesis import given, settings
from hypothesis import strategies as st
from node_samples import SPECIAL, Field, definitions, parameters

from raymarch.errors import SceneError
from raymarch.expr.glsl import print_functions
from raymarch.expr.types import VEC3
from raymarch.gpu.context import Context
from raymarch.sdf import Node, repeat, sphere, transform
from raymarch.sdf.lower import lower

OWN: dict[str, Callable[[Node, np.random.Generator], Node]] = {
    "affine": lambda node, random: transform(node, _affine(random)),
    "repeat_cells": lambda node, random: repeat(
        node, node.facts.size * random.uniform(1.0, 1.6, 3) + 1e-3, tuple(int(n) for n in random.integers(1, 5, 3))
    ),
    "labelled": lambda node, random: node.material("red"),
    "sheared": lambda node, random: node.shear(random.uniform(-1.0, 1.0), *random.permutation(list("xyz"))[:2]),
}
"""How operators with a line in SPECIAL, or whose vectors must fit each other, are applied to any node."""


def _affine(random: np.random.Generator) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) + 0.5 * random.normal(size=(3, 3))
    matrix[3, :3] = random.normal(size=3)
    return matrix


USABLE = [
    d for d in definitions() if d.dimension == d.child_dimension == 3 and (d.name not in SPECIAL or d.name in OWN)
]
BY_ARITY = {arity: [d for d in USABLE if d.arity == arity] for arity in ("none", "one", "many")}


def made(name: str, children: Sequence[Node], seed: int) -> Node:
    """A node of a definition with drawn parameters; where none of some attempts fits, its first child, or a ball."""
    random = np.random.default_rng(zlib.crc32(f"{name} {seed}".encode()))
    definition = next(d for d in USABLE if d.name == name)
    for attempt in range(6):
        try:
            if name in OWN:
                return OWN[name](children[0], random)
            given = parameters(definition, min(seed + attempt, 1), random, 0.8**attempt)
            return definition.make(children, (), given)
        except SceneError:  # the child is too large, or has no end, or parameters do not fit each other
            continue
    return children[0] if children else sphere(0.5)


def names(arity: str) -> st.SearchStrategy[str]:
    return st.sampled_from([d.name for d in BY_ARITY[arity]])


seeds = st.integers(0, 200)
shapes = st.builds(lambda name, seed: made(name, [], seed), names("none"), seeds)


def grown(children: st.SearchStrategy[Node]) -> st.SearchStrategy[Node]:
    one = st.builds(lambda name, child, seed: made(name, [child], seed), names("one"), children, seeds)
    many = st.builds(made, names("many"), st.lists(children, min_size=2, max_size=3), seeds)
    return one | one | many


trees = shapes
for _ in range(8):
    trees = shapes | grown(trees)
deep_trees = grown(trees)


def _looked_at(node: Node) -> tuple[Field, np.ndarray, np.ndarray]:
    field = Field(node)
    points = field.draw(np.random.default_rng(1), 2000)
    return field, points, field.value(points)


@given(deep_trees)
@settings(max_examples=80)
def test_facts_hold(node: Node) -> None:
    field, points, values = _looked_at(node)
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


def depth(node: Node) -> int:
    return 1 + max((depth(child) for child in node.children), default=0)


def test_promised_slopes_are_met() -> None:
    """Trees are about as steep as they promise; the median of 60 of them, many eight deep and more."""
    loose, depths = [], []

    @given(deep_trees)
    @settings(max_examples=60)
    def look(node: Node) -> None:
        depths.append(depth(node))
        if node.exactness != "estimate":
            field, points, _ = _looked_at(node)
            loose.append(node.lipschitz / max(np.linalg.norm(field.gradient(points), axis=1).max(), 1e-9))

    look()
    assert sum(d >= 8 for d in depths) >= 10
    assert np.median(loose) <= 1.5


@given(deep_trees)
@settings(max_examples=25)
def test_twins_agree(egl: Context, node: Node) -> None:
    """float32 on the driver against float64; rounding adds up with the depth of the tree."""
    field, points, values = _looked_at(node)
    text = print_functions([lower(node)])
    twin: Any = run(egl, node.glsl(), "field({0})", [(VEC3, points)], samples=text.samples)
    scale = 2.0**-23 * max(field.size, float(np.abs(points).max()))
    allowed = np.full(len(points), 256 * scale)
    if node.exactness == "estimate":  # a fractal may change by much where a point moves by an ulp, also in float64
        ulps = np.random.default_rng(5).uniform(-4, 4, (8, *points.shape)) * scale
        allowed += 4 * np.max([np.abs(field.value(points + step) - values) for step in ulps], axis=0)
    wrong = np.abs(twin - values) > allowed
    assert wrong.mean() <= (0.02 if node.exactness == "estimate" else 0.001), node
