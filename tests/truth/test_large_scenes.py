"""The reference of scenes of many objects asks few of them, and is that which asks all."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
import pytest

import raymarch as rm
from raymarch.scene.parameter import Values, set_values
from raymarch.truth import large
from raymarch.truth.field import Field
from raymarch.truth.large import LargeField, field_of

SIZE = (8, 6)
RED = rm.Material(color=(0.8, 0.1, 0.1))


def things(count: int, seed: int = 5, size: float = 2.5) -> list[rm.Node]:
    """Solids of several forms, some with a material: exact ones, bounds, and one in six moved by a Param."""
    random = np.random.default_rng(seed)
    moving = rm.Param("lift", 0.1, -0.5, 0.5)
    kinds: list[Any] = [
        lambda: rm.box((0.3, 0.2, 0.4)).rotate(random.uniform(0, 3), random.normal(size=3)),
        lambda: rm.sphere(random.uniform(0.05, 0.2)),
        lambda: rm.sphere(0.2) - rm.box((0.3, 0.1, random.uniform(0.2, 0.3))),
        lambda: rm.torus(0.2, 0.05).scale((1, random.uniform(0.5, 1), 1)),
        lambda: rm.cylinder(0.1, 0.4).translate((0, moving, 0)),
        lambda: rm.union(rm.sphere(0.15), rm.sphere(0.1).translate((0.15, 0, 0)), k=0.1),
    ]
    found = []
    for i in range(count):
        made = kinds[i % len(kinds)]().translate(tuple(random.uniform(-size, size, 3)))
        found.append(made.material(RED) if i % 3 else made)
    return found


def blend(family: str) -> rm.Node:
    return rm.union(*things(40), k=0.1, blend=family)


COLORS = np.random.default_rng(1).uniform(0, 1, (80, 3))
TREE = rm.cylinder(0.05, 0.4) | rm.cone(0.2, 0.4).translate((0, 0.3, 0))
PLACES = np.random.default_rng(2).uniform(-2.5, 2.5, (80, 4)) * [1, 1, 1, 0.1] + [0, 0, 0, 0.8]
SOLIDS = {
    "hard": rm.union(*things(70)),
    "nested": rm.union(*things(36)).material(rm.Material("blue")) | rm.union(*things(24, 6)) | blend("quadratic"),
    "hidden": rm.union(*things(60), rm.sphere(2.0).visible(camera=False)),
    "instances": rm.instances(TREE, PLACES, COLORS) | rm.union(*things(10)),
    "a floor in a blend": rm.union(rm.plane(offset=-2), *things(40), k=0.1),
    **{family: blend(family) for family in ("quadratic", "cubic", "quartic", "circular")},
}


@pytest.fixture(autouse=True)
def few() -> Iterator[None]:
    with mock.patch.object(large, "MANY", 20):
        yield


def scene_of(name: str, **more: Any) -> rm.Scene:
    node = SOLIDS[name] | rm.plane(offset=-2.5).material(rm.Material("green"))
    return rm.Scene(node, rm.Camera((3, 4, 8), (0, 0, 0)), **more)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_field_of_many_objects_has_the_values_of_the_whole(name: str) -> None:
    scene = scene_of(name)
    values = set_values(scene.parameters, {"lift": 0.3} if scene.parameters else None, 0.0)
    some, whole = field_of(scene, values), Field(scene, values)
    assert isinstance(some, LargeField)
    random = np.random.default_rng(0)
    points = np.concatenate([random.uniform(-3, 3, (200, 3)), 30 * random.normal(size=(20, 3))])
    for one, other in ((some, whole), (some.of("shadow"), whole.of("shadow"))):
        assert np.allclose(one.distance(points), other.distance(points), rtol=1e-14, atol=1e-14)
        assert np.allclose(one.rest(points), other.rest(points), rtol=1e-14, atol=1e-14)
        assert np.array_equal(one.planes(points), other.planes(points))
    assert np.allclose(some.gradient(points), whole.gradient(points), atol=1e-9)
    assert np.allclose(some.material_weights(points), whole.material_weights(points), atol=1e-9)
    one, other = some.material_values(points), whole.material_values(points)
    assert all(np.allclose(one[v], other[v], atol=1e-9) for v in other)


@pytest.mark.parametrize("name", ["nested", "instances"])
def test_the_picture_of_many_objects_is_that_of_the_whole(name: str) -> None:
    soft = {"radius": 0.3} if name == "instances" else {}
    lights = [rm.Sun((1, 3, 2), shadow=True), rm.PointLight((2, 3, 3), shadow=True, **soft)]
    scene = scene_of(name, lights=lights, occlusion=rm.AmbientOcclusion())
    found = rm.truth(scene, SIZE)
    with mock.patch.object(large, "MANY", 10_000):
        known = rm.truth(scene, SIZE)
    assert np.array_equal(found.hit, known.hit) and known.hit.mean() > 0.3
    assert np.allclose(found.depth, known.depth, rtol=1e-12)
    assert np.allclose(found.normal, known.normal, atol=1e-7)
    assert np.array_equal(found.material, known.material)
    assert np.allclose(found.color, known.color, atol=1e-7)


@pytest.mark.parametrize("name", ["hard", "quadratic"])
def test_a_point_asks_few_objects(name: str) -> None:
    field = field_of(scene_of(name), Values({}))
    assert isinstance(field, LargeField)
    group = field._groups[0]
    operands = group.operands if isinstance(group, large._Blend) else group
    points = np.random.default_rng(0).uniform(-2, 2, (100, 3))
    with mock.patch.object(operands, "ask", wraps=operands.ask) as ask:
        field.distance(points)
    asked = sum(len(call.args[0]) for call in ask.call_args_list) / len(points)
    assert asked < (12 if name == "hard" else 0.9 * len(operands.original))
    assert len(operands.asked) <= 10, "objects of one form share a program"
