"""The bound of the rounding errors is one: no device that draws is farther off than it says."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings

import raymarch as rm
from raymarch.expr.glsl import print_functions
from raymarch.expr.types import VEC3
from raymarch.gpu.context import Context
from raymarch.sdf.evaluation import lower
from tests.hard.rounding import rounding_of
from tests.hard.world import ULP
from tests.support import random_trees
from tests.support.glsl_harness import run


def test_random_trees_are_within_it(egl: Context) -> None:
    @given(random_trees.trees)
    @settings(max_examples=16)
    def look(node: rm.Node) -> None:
        field, points, values = random_trees.looked_at(node)
        points = points[:300].astype(np.float32).astype(np.float64)
        values = field.value(points)
        text = print_functions([lower(node)])
        found = run(egl, node.glsl(), "field({0})", [(VEC3, points)], samples=text.samples).astype(np.float64)
        bound = rounding_of(node, points, np.zeros(len(points)))
        off = np.abs(found - values)
        wrong = off > bound + 1e-37
        assert not wrong.any(), (node, wrong.sum(), points[wrong][0], off[wrong][0], bound[wrong][0])

    look()


def test_it_is_no_wider_than_it_must_be() -> None:
    """For most definitions, with simple children, it is some ulp of the size of the solid."""
    tight = []
    operands = {
        "none": [],
        "one": [rm.box((1, 0.8, 0.6))],
        "many": [rm.sphere(0.6), rm.box(1).translate((0.4, 0.2, 0))],
    }
    for arity, children in operands.items():
        for definition in random_trees.BY_ARITY[arity]:
            node = random_trees.made(definition.name, children, 0)
            field, points, _ = random_trees.looked_at(node)
            points = points[:60].astype(np.float32).astype(np.float64)
            bound = rounding_of(node, points, np.zeros(len(points)))
            tight.append(np.median(bound) / (ULP * max(field.size, 1e-9)))
    assert len(tight) > 80 and np.median(tight) < 8 and np.percentile(tight, 75) < 16
