"""Blends of many operands: cells drop those that change nothing, and no others."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import bound
from raymarch.proof import blends
from raymarch.proof.blends import Blend, Tree
from raymarch.proof.parts import Blended, Operands
from raymarch.proof.rays import Rays, Stretch
from raymarch.scene.parameter import Values
from raymarch.sdf.lower import Lowering
from raymarch.truth.narrow import some_blended

N = 60
random = np.random.default_rng(4)
PLACES = random.uniform(-2.0, 2.0, (N, 3))
SIZES = random.uniform(0.1, 0.4, N)
VALUES = Values({}, 0.0)


def blend(family: str = "quadratic", k: Any = 0.2) -> rm.Node:
    def part(i: int) -> rm.Node:
        solid = rm.sphere(SIZES[i]) if i % 2 else rm.box(1.5 * SIZES[i]).rotate(0.1 * i, "y")
        return solid.translate(PLACES[i])

    return rm.union(*map(part, range(N)), k=k, blend=family)


def operands(node: rm.Node) -> Operands:
    return Operands(node, VALUES, "camera", whole=False)


def stretches(made: Operands, length: float, count: int = 300) -> tuple[Any, ...]:
    """Random stretches of rays, their values by the operands, and points on them."""
    draw = np.random.default_rng(int(1e6 * length))
    start = draw.uniform(-2.4, 2.4, (count, 3))
    way = draw.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    at = Stretch(np.arange(count), np.zeros(count, np.int64), np.zeros(count), np.full(count, length))
    found = made.enclose(Rays(start, way), at, 0.5 * at.end)
    return found, start[:, None] + np.linspace(0.0, length, 9)[:, None] * way[:, None]


@pytest.mark.parametrize("family", ["quadratic", "cubic", "quartic"])
def test_all_values_on_a_stretch_are_enclosed(family: str) -> None:
    node = blend(family)
    made = operands(node)
    assert isinstance(made.forms[0], Blended)
    for length in (2.0, 0.5, 0.1, 0.01, 0.0):
        (range_, at, _), points = stretches(made, length)
        values = node.distance(points.reshape(-1, 3)).reshape(points.shape[:2])
        assert np.all(range_[0][:, None] <= values + 1e-12) and np.all(values - 1e-12 <= range_[1][:, None])
        assert np.all(at[0] <= values[:, 4] + 1e-12) and np.all(values[:, 4] - 1e-12 <= at[1])
        if length <= 0.01:
            near = (range_[0] <= 0.0) & (range_[1] >= 0.0)
            assert np.all((range_[1] - range_[0])[near] <= 4.0 * length + 1e-9)


def cells_of(found: Blend, most: int) -> Iterator[tuple[int, Any]]:
    """Some cells of each level that list operands, and points in them."""
    for level, numbers in enumerate(found._numbers):
        listed = [(code, cell) for code, cell in numbers.items() if len(found._kept[cell])]
        for code, cell in listed[:most]:
            place = np.array([code % (1 << 20), code >> 20 & (1 << 20) - 1, code >> 40]) - 2.0
            yield cell, np.random.default_rng(code).uniform(*found._box(level, place), (20, 3))


def test_cells_keep_few_operands_and_the_value() -> None:
    """That of the kept ones is the value of all at each point of a cell: a fold of two of which one is far is the
    nearer."""
    node = blend()
    made = operands(node)
    stretches(made, 0.05)
    stretches(made, 0.02)
    found = made.forms[0].blend  # type: ignore[union-attr]
    tried = 0
    for cell, points in cells_of(found, 15):
        kept, values = found._kept[cell], node.distance(points)
        assert np.all((found._ranges[cell][0] <= values) & (values <= found._ranges[cell][1]))
        assert np.all(np.abs(some_blended(node, kept).distance(points) - values) <= found._lost[cell] + 1e-13)
        tried += len(kept) < N
    assert tried > 40 and np.mean([len(kept) for kept in found._kept[-100:]]) < 9
    assert found._lost.max() < 1e-5


@pytest.mark.parametrize("family", ["quadratic", "exponential", "stairs"])
def test_what_is_left_out_is_counted(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    """Also where much is left out. Stairs have no weights that shrink: there nothing is left out that counts."""
    monkeypatch.setattr(blends, "FAINT", 0.0)
    monkeypatch.setattr(blends, "COARSER", -1)
    node = blend(family, k=1.5 if family != "stairs" else 0.05)
    made = operands(node)
    (range_, _, _), points = stretches(made, 0.05)
    values = node.distance(points.reshape(-1, 3)).reshape(points.shape[:2])
    assert np.all(range_[0][:, None] <= values + 1e-12) and np.all(values - 1e-12 <= range_[1][:, None])
    found = made.forms[0].blend  # type: ignore[union-attr]
    missing, few = 0.0, 0
    for cell, points in cells_of(found, 5):
        kept, values = found._kept[cell], node.distance(points)
        rise = np.abs(some_blended(node, kept).distance(points) - values).max()
        assert rise <= found._lost[cell] + 1e-12
        missing, few = max(missing, rise), few + (len(kept) < N)
    assert few > 3 and (missing > 1e-4) == (family != "stairs")


def test_bounds_by_groups_hold_and_are_near() -> None:
    """They show no surface where there is none near."""
    node = blend()
    found = operands(node).forms[0].blend  # type: ignore[union-attr]
    points = np.random.default_rng(2).uniform(-6.0, 6.0, (400, 3))
    values = node.distance(points)
    low, high = found._bounds([points, points], np.zeros(400), np.zeros(400))
    assert np.all(low <= values) and np.all(values <= high)
    assert np.all(low[values > 0.4] > 0.0)


def test_the_width_may_be_a_parameter() -> None:
    node = blend(k=rm.Param("k", 0.2, 0.1, 0.3))
    field = Lowering(rays="camera").field(node)
    tree = Tree.of(field.body, field.params)
    assert tree is not None
    for k in (0.1, 0.3):
        with bound({"k": k}, 0.0):
            found = Blend(tree, field.params, np.full(3, -3.0), np.full(3, 3.0))
            a, b = np.zeros((2, 2)), np.array([[0.15, 0.35], [1.0, 1.0]])
            np.testing.assert_array_equal(found._fold.drops(a, b), [k < 0.15, True])


def test_a_picture_of_a_blend_is_proved_as_all_operands_prove_it(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = rm.Scene(blend() | rm.plane(offset=-2.5), rm.Camera((3, 4, 7), (0, 0, 0)))
    picture = rm.truth(scene, (12, 7), outputs=("depth",))
    found = rm.prove(scene, picture)
    wrong = rm.prove(scene, type("", (), {"depth": np.where(picture.depth < 8.0, np.inf, picture.depth)})())
    monkeypatch.setattr(blends, "MANY", 1000)
    assert found.share == 1.0
    np.testing.assert_array_equal(found.state, rm.prove(scene, picture).state)
    assert np.all(wrong.state[picture.depth < 8.0] == 1) and (picture.depth < 8.0).sum() > 5
