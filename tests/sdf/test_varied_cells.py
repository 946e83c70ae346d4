"""Copies that differ from cell to cell, held against a union of copies built one by one."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.expr.arrays import value_of
from raymarch.expr.node import expr
from raymarch.expr.vocabulary import mod, sin, vec3
from raymarch.sdf import Node, box, hash, repeat_varied, sphere, union
from tests.support.refusals import refused

POINTS = np.random.default_rng(5).uniform(-4, 4, (4000, 3))


def ball(index: Any) -> Node:
    return sphere(0.2 + 0.2 * hash(index)).translate(vec3(0.0, 0.05 * sin(index.x), 0.0))


def bricks(index: Any) -> Node:
    return box((0.7, 0.6, 0.5)).rotate(0.9 * index.x + index.z, (0, 1, 0)) | sphere(0.2 + 0.1 * mod(index.z, 2.0))


@pytest.mark.parametrize("build", [ball, bricks])
def test_it_is_the_union_of_its_cells(build: Any) -> None:
    node = repeat_varied(build, (1.2, None, 1.3), (4, 1, 3))
    cells = [expr((float(i), 0.0, float(k))) for i, k in product(range(-2, 2), range(-1, 2))]
    apart = [build(c).translate(((c.data[0] + 0.5) * 1.2, 0.0, c.data[2] * 1.3)) for c in cells]
    whole = union(*apart).distance(POINTS)
    found = node.distance(POINTS)
    np.testing.assert_array_equal(np.sign(found), np.sign(whole))
    assert np.all(np.abs(found) <= np.abs(whole) + 1e-12)
    near = np.abs(whole) < 0.4  # less than half a cell: nothing that is not asked can be nearer
    np.testing.assert_allclose(found[near], whole[near], atol=1e-12)


def test_a_copy_is_that_of_its_index() -> None:
    """Without end: along x the radius follows the index."""
    node = repeat_varied(lambda index: sphere(0.3 + 0.1 * sin(index.x)), (1.0, None, None))
    for i in (-7, 0, 3):
        assert node.distance([i, 0, 0]) == pytest.approx(-0.3 - 0.1 * np.sin(i), abs=1e-12)


def test_a_function_of_the_index_stands_beside_a_loop() -> None:
    """The loop of the ellipsoid carries tangents; noise of the index is constant within a cell, so it has none."""
    node = repeat_varied(
        lambda i: rm.ellipsoid((0.7 + 0.1 * hash(i), 1, 0.7)).translate((0, 0.1 * rm.value_noise(0.3 * i), 0)),
        2,
        (3, 1, 3),
    )
    slope, points, h = node.gradient(POINTS[:200]), POINTS[:200], 1e-6
    steps = [(node.distance(points + h * e) - node.distance(points - h * e)) / (2 * h) for e in np.eye(3)]
    assert np.mean(np.abs(slope - np.stack(steps, axis=1)).max(axis=1) < 1e-5) > 0.95
    assert "field" in rm.Scene(node).node.glsl() and rm.truth(rm.Scene(node), size=(8, 8)).depth.min() < np.inf


def test_random_numbers_are_even() -> None:
    drawn = np.array([value_of(hash((float(i), float(j), 2.0))) for i in range(20) for j in range(20)])
    assert abs(drawn.mean() - 0.5) < 0.05 and abs(drawn.std() - 12**-0.5) < 0.03
    assert len(np.unique(drawn)) == len(drawn)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: repeat_varied(lambda i: sphere(0.6), 1.0), "spacing >= 1.2"),
        (lambda: repeat_varied(lambda i: sphere(0.3 + 0.1 * i.x), 1.0, 9), "a number > 0"),
        (lambda: repeat_varied(lambda i: sphere(1.0).translate(i), 1.0), "finite range"),
        (lambda: repeat_varied(lambda i: rm.plane(), 1.0), "None as the spacing"),
        (lambda: repeat_varied(lambda i: 3, 1.0), "a solid"),
        (lambda: repeat_varied(lambda i: rm.circle(), 1.0), "a solid"),
        (lambda: repeat_varied(ball, 1.0, 2.5), "integers >= 1"),
        (lambda: repeat_varied(ball, 0.0), "a number > 0"),
        (lambda: rm.Material(color=_escaped()), "between"),
        (lambda: rm.Camera(position=_escaped()), "depends on the index of a cell"),
        (lambda: sphere(0.3).translate(0.1 * sin(_escaped())).glsl(), "outside of repeat_varied"),
    ],
)
def test_what_cannot_be_is_refused(make: Any, says: str) -> None:
    refused(make, says)


def _escaped() -> Any:
    """The index of a cell, taken out of its repetition."""
    seen: list[Any] = []
    repeat_varied(lambda index: (seen.append(index), sphere(0.2))[1], 1.0)
    return seen[0]


def test_a_material_outside_of_its_cell_is_refused() -> None:
    node = sphere().material(rm.Material(color=0.5 + 0.5 * sin(_escaped())))
    with pytest.raises(SceneError, match="outside of repeat_varied"):
        rm.truth(rm.Scene(node), size=(4, 4))
