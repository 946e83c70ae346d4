"""The bound of the rounding errors is one: no device that draws is farther off than it says."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings

import raymarch as rm
from raymarch.expr.glsl import print_functions
from raymarch.expr.types import VEC3
from raymarch.gpu.context import Context
from raymarch.sdf.lower import lower
from tests.hard.rounding import rounding_of
from tests.hard.world import ULP
from tests.support import random_trees
from tests.support.glsl_harness import run


def test_random_trees_are_within_it(egl: Context) -> None:
    """And it is no wider than it must be: at most half the trees within some ulp of their size."""
    tight = []

    @given(random_trees.trees)
    @settings(max_examples=25)
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
        tight.append(np.median(bound) / (ULP * max(field.size, 1e-9)))

    look()

    assert np.median(tight) < 64
