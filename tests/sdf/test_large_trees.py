"""Trees much deeper than Python's recursion limit of 1,000."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import raymarch
from raymarch.sdf import Node, sphere, union
from tests.support.recursion import few_calls

MANY = 600
POINTS = np.array([[0.3, 0.2, 0.1], [500.2, 0.0, 0.0], [-3.0, 1.0, 0.0]])


def row(count: int) -> list[Node]:
    return [sphere(0.4).translate((float(i), 0.0, 0.0)) for i in range(count)]


@pytest.fixture(scope="module")
def chain() -> Node:
    """a | b | c | ..."""
    node, *others = row(MANY)
    for other in others:
        node = node | other
    return node


def to_row(points: np.ndarray) -> np.ndarray:
    nearest = np.clip(np.round(points[:, 0]), 0, MANY - 1)
    return np.linalg.norm(points - np.stack([nearest, 0 * nearest, 0 * nearest], axis=1), axis=1) - 0.4


def test_facts_of_a_chain(chain: Node) -> None:
    np.testing.assert_allclose(chain.bounds, [[-0.4] * 3, [MANY - 0.6, 0.4, 0.4]])


def test_distance_of_a_chain(chain: Node) -> None:
    np.testing.assert_allclose(chain.distance(POINTS), to_row(POINTS))


def test_gradient_of_a_chain(chain: Node) -> None:
    h = 1e-6
    central = [(to_row(POINTS + h * e) - to_row(POINTS - h * e)) / (2 * h) for e in np.eye(3)]
    np.testing.assert_allclose(chain.gradient(POINTS), np.transpose(central), atol=1e-6)


def test_text_of_a_chain(chain: Node) -> None:
    text = chain.glsl()
    assert len(re.findall(r"\bsphere\(\s*p\b", text)) == MANY
    assert max(map(len, text.splitlines())) < 200


def test_a_chain_is_a_balanced_union() -> None:
    node, *others = row(500)
    for other in others:
        node = node | other
    assert node.glsl() == union(*row(500)).glsl()


def test_a_long_smooth_chain() -> None:
    with few_calls():
        node, *others = row(150)
        for other in others:
            node = node.union(other, k=0.1)
        np.testing.assert_allclose(node.distance((120.0, 0.0, 0.0)), -0.4, atol=1e-9)
        assert np.all(np.isfinite(node.gradient(POINTS)))
        assert node.glsl().count("smooth_min(") == 150


def test_a_long_chain_of_placings() -> None:
    with few_calls():
        node = sphere(0.5)
        for i in range(300):
            node = node.translate((0.01, 0, 0)) if i % 2 else node.scale(1.0 + 1e-9)
        np.testing.assert_allclose(node.distance((1.5, 0, 0)), -0.5, atol=1e-4)
        np.testing.assert_allclose(node.gradient((3.5, 0, 0)), [1, 0, 0], atol=1e-12)
        assert node.glsl()


def test_dropping_a_large_tree_is_quiet() -> None:
    node = sphere(0.1)
    for _ in range(5_000):
        node = node.round(0.0)
    del node


def test_a_shared_part_is_written_once() -> None:
    """Each level asks the level below twice: the text grows by a level, not by a factor of two."""
    node = sphere(0.5).translate((0.1, 0, 0)) - sphere(0.3)
    for i in range(40):
        node = node.translate((2.0**-i, 0, 0)) - node.rotate(0.5)
    text = node.glsl()
    assert len(text) < 40_000
    assert len(re.findall(r"^float \w+\(vec3 p\) {", text, re.MULTILINE)) == 41  # one each, and the field


def test_the_text_does_not_depend_on_the_process() -> None:
    code = (
        "from raymarch.sdf import *\n"
        "from raymarch.scene import Material\n"
        "part = (sphere(.5) | box((1, 2, 3)).rotate(.3)).repeat((4, None, 5)) - torus().translate((1, 0, 0))\n"
        "print((part.material(Material((1, 0, 0))) | part.mirror('x').union(capsule(), k=.2)).glsl())"
    )
    texts = set()
    for seed in ("0", "99"):
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(Path(raymarch.__file__).parents[1])},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        texts.add(done.stdout)
    assert len(texts) == 1


def test_many_points_take_no_more_than_their_values() -> None:
    """A deep field has hundreds of steps between its points and its values: they are held for some points at once."""
    node = union(*[sphere(0.1).rotate(0.1 * i, "z").translate((i, 0, 0)).round(0.1) for i in range(40)], k=0.2)
    points = np.random.default_rng(1).normal(size=(200_000, 3))
    tracemalloc.start()
    try:
        node.distance(points)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 1.5 * points.nbytes
