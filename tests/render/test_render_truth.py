"""Solids put together at random, held against the float64 truth: hits, depths, normals, materials, colours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import bound
from raymarch.gpu import Renderer
from raymarch.scene import load
from raymarch.scene.parameter import Values, set_values
from raymarch.truth import Truth, silhouettes, truth
from tests.support.analytic import EPSILON, around
from tests.support.compared import compare

SIZE = (80, 60)


class Chance:
    """Solids from a seed, each about the origin and about two across."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def number(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def vector(self, low: float, high: float) -> tuple[float, float, float]:
        return (self.number(low, high), self.number(low, high), self.number(low, high))

    def one_of(self, *choices: Any) -> Any:
        return choices[self.random.integers(len(choices))]

    def shape(self) -> rm.Node:
        return self.one_of(
            lambda: rm.sphere(self.number(0.4, 0.9)),
            lambda: rm.box(self.vector(0.5, 1.6)),
            lambda: rm.torus(self.number(0.5, 0.9), self.number(0.15, 0.4)),
            lambda: rm.cylinder(self.number(0.3, 0.7), self.number(0.6, 1.8)),
            lambda: rm.capsule(self.vector(-0.6, -0.1), self.vector(0.1, 0.6), self.number(0.15, 0.4)),
        )()

    def changed(self, node: rm.Node) -> rm.Node:
        width = node.bounds[1] - node.bounds[0]
        return self.one_of(
            lambda: node,
            lambda: node.round(self.number(0.02, 0.1)),
            lambda: node.scale(self.vector(0.7, 1.3)),
            lambda: node.mirror(self.vector(-1, 1)),
            lambda: node.repeat(tuple(width * self.number(1.0, 1.2)), (int(self.number(1, 3)), 1, 2)).scale(0.6),
        )()

    def solid(self, depth: int) -> rm.Node:
        if depth == 0:
            node = self.changed(self.shape())
        else:
            combine = self.one_of(rm.union, rm.union, rm.difference, rm.intersection)
            parts = [self.solid(depth - 1) for _ in range(self.one_of(2, 3))]
            node = combine(*parts, k=self.one_of(0.0, self.number(0.05, 0.3)))
        node = node.rotate(self.number(-3, 3), self.vector(0.1, 1)).translate(self.vector(-0.4, 0.4))
        if self.random.random() < 0.5:
            node = node.material(rm.Material(self.vector(0, 1), self.number(5, 60)))
        return node

    def scene(self) -> rm.Scene:
        node = self.solid(2) | self.solid(1).translate((1, 0, 0))
        if self.random.random() < 0.5:
            node = node | rm.plane((self.number(-0.1, 0.1), 1, self.number(-0.1, 0.1)), -1.5)
        lights = [
            rm.Sun((self.number(-1, 1), 1, 0.5), shadow=True),
            rm.PointLight((self.number(-4, 4), 4, 5), intensity=12, shadow=True),
        ]
        fog = self.one_of(None, rm.Fog(density=0.03))
        return rm.Scene(node, rm.Camera((1.5, 2.0, 6.5), (0.3, 0, 0)), lights, fog=fog)


def assert_true(renderer: Renderer, scene: rm.Scene, **moment: Any) -> None:
    """No hit missed or invented off silhouettes; depths, normals, materials and colours as they should be.

    The bars are those of the examples. A pixel's colour lies among those of its neighbours in the true picture, to a
    step of 8 bits: a shadow's border may stand a pixel to the side of where it belongs.
    """
    frame = renderer.render(scene, outputs=("color", "depth"), **moment)
    known = truth(scene, size=renderer.size, **moment)
    found = compare(frame.depth, frame.normal, known)
    assert (found.missed_hits, found.false_hits) == (0, 0)
    if found.compared:
        assert found.depth_p99 <= 1e-3 and found.normal_p95 <= 0.5
    inner = ~silhouettes(known)
    assert np.array_equal(frame.material[inner], known.material[inner])
    shown, wanted = np.asarray(frame.image(), int), scene.tone.image(known.color).astype(int)
    rows, columns = inner.shape
    near = np.pad(wanted, ((1, 1), (1, 1), (0, 0)), "edge")
    near = np.stack([near[i : i + rows, j : j + columns] for i in range(3) for j in range(3)])
    wrong = np.maximum(shown - near.max(axis=0), near.min(axis=0) - shown).max(axis=-1)
    off = np.argwhere(~around(~inner) & (wrong > 1))
    assert len(off) < 0.01 * inner.size
    values = set_values(scene.parameters, moment.get("params", {}), moment.get("time", 0.0))
    pixel = scene.pose(values, renderer.size[0] / renderer.size[1]).pixel(renderer.size[1])
    for y, x in off:
        assert grazes(scene, values, known, (y, x), pixel), (y, x, shown[y, x], wanted[y, x])


def grazes(scene: rm.Scene, values: Values, known: Truth, at: Any, pixel: float) -> bool:
    """Whether a light that is seen from a pixel's surface all but touches something on its way.

    A shadow's ray is blocked a share of an epsilon (a tenth of a pixel's width) before a surface. What comes so near
    and goes away again has a shadow thinner than a pixel there, which the picture may show between the true ones.
    """
    epsilon = EPSILON * pixel * known.depth[at]
    start = known.position + known.depth[at] * known.direction[at] + 2 * epsilon * known.normal[at]
    for light in scene.lights:
        way = values.of(light.sun_direction) * 20.0 if isinstance(light, rm.Sun) else values.of(light.position) - start
        with bound(values.params, values.time):
            along = scene.node.distance(start + np.linspace(0, 1, 20_000)[:, None] * way)
        lowest = (along[1:-1] <= along[:-2]) & (along[1:-1] <= along[2:])
        if np.any(lowest & (np.abs(along[1:-1]) <= epsilon)):
            return True
    return False


@pytest.mark.parametrize("seed", range(10))
def test_a_random_solid_is_true(renderer: Renderer, seed: int) -> None:
    renderer.resize(SIZE)
    assert_true(renderer, Chance(seed).scene())


EXAMPLES = sorted((Path(rm.__file__).parents[1] / "examples").glob("*.py"))


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_an_example_is_true_at_the_ends_of_its_parameters(renderer: Renderer, file: Path) -> None:
    renderer.resize((44, 33) if file.stem == "textures" else SIZE)  # its truth takes long
    scene = load(file)
    if scene.node.exactness == "estimate":
        return  # tests/examples looks at where rays on an estimate end
    low = {name: spec.min for name, spec in scene.parameters.items() if spec.min is not None}
    high = {name: spec.max for name, spec in scene.parameters.items() if spec.max is not None}
    assert_true(renderer, scene, time=1.7, params=low)
    if low:
        assert_true(renderer, scene, time=0.4, params=high)


@pytest.mark.parametrize("size", [(30, 90), (90, 30), (41, 41)])
def test_an_unplaced_camera_is_the_same_in_every_format(renderer: Renderer, size: tuple[int, int]) -> None:
    renderer.resize(size)
    assert_true(renderer, rm.Scene(rm.box((2, 1, 0.5)).rotate(0.5, "x") | rm.sphere(0.3).translate((0, 1.2, 0))))


def test_parameters_and_time_are_true_away_from_their_defaults(renderer: Renderer) -> None:
    renderer.resize(SIZE)
    size, turn = rm.Param("size", 0.5, 0.3, 1.5), rm.Param("turn", (0.0, 1.0, 0.0))
    node = rm.union(rm.box(size), rm.sphere(size * 0.7).translate((rm.time, 0, 0)), k=0.1 * size) | rm.plane(offset=-1)
    scene = rm.Scene(
        node.material(rm.Material((size / 2, 0.5, 0.5))),
        rm.Camera((2, 2, 5 + rm.time), (0, 0, 0), turn),
        [rm.Sun((1, 2, rm.time), intensity=size, shadow=True), rm.PointLight((0, 3, rm.time), turn * 8, shadow=True)],
        sky=(0, size / 2, 0),
        fog=rm.Fog((0, 0, size / 2), 0.1 * size),
    )
    assert_true(renderer, scene)
    assert_true(renderer, scene, time=0.8, params={"size": 1.4, "turn": (0.3, 1.0, 0.2)})
