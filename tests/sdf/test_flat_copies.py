"""Copies of flat shapes against the least distance of copies that are placed one by one."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.sdf import Node

Array = NDArray[np.float64]

AT = np.random.default_rng(2).uniform(-3.0, 3.0, (600, 2))

SHAPES: dict[str, Callable[[], Node]] = {
    "on the x axis": lambda: rm.circle(0.2).translate((1, 0)),
    "on the y axis": lambda: rm.rectangle((0.3, 0.2)).translate((0, -1.2)),
    "aside": lambda: rm.rectangle((0.4, 0.7)).translate((1.5, 0.3)),
    "about the origin": lambda: rm.star(5, 0.4, 0.2).translate((0.1, 0.2)),
    "a bound": lambda: (rm.rectangle((0.4, 0.7)) - rm.circle(0.3)).translate((1.5, 0.3)),
}


def least(copies: list[Array]) -> Array:
    found: Array = np.min(copies, axis=0)
    return found


def held(node: Node, inside: Array) -> bool:
    """Whether the box holds all points that are inside."""
    low, high = node.bounds
    return bool(np.all(AT[inside < 0] >= low - 1e-9) and np.all(AT[inside < 0] <= high + 1e-9))


@pytest.mark.parametrize("count", [2, 5, 26])
@pytest.mark.parametrize("name", SHAPES)
def test_polar(name: str, count: int) -> None:
    shape = SHAPES[name]()
    if name == "about the origin" and count == 26:
        with pytest.raises(SceneError, match=r"6.283 radians about the origin.*<= 24"):
            shape.polar(count)
        return
    made = shape.polar(count)
    copies = []
    for i in range(count):
        c, s = np.cos(2 * np.pi * i / count), np.sin(2 * np.pi * i / count)
        copies.append(shape.distance(AT @ np.array([[c, -s], [s, c]])))
    whole = least(copies)
    assert held(made, whole)
    found = made.distance(AT)
    assert np.all(found <= whole + 1e-12) and np.array_equal(found < 0, whole < 0)
    if name != "a bound":
        np.testing.assert_allclose(found, whole, atol=1e-12)
    for axis, flip in (("x", (-1, 1)), ("y", (1, -1))):
        if axis in made.facts.symmetry:
            np.testing.assert_allclose(made.distance(AT * flip), found, atol=1e-12)


@pytest.mark.parametrize("counts", [(3, 2), (4, 1), (None, 3)])
def test_mirrored_cells(counts: tuple[int | None, ...]) -> None:
    shape = rm.rectangle((0.4, 0.7)).rotate(0.3).translate((0.1, 0.1))
    made = shape.repeat_mirrored(1.2, counts)
    x, y = (np.arange(n or 9) - 0.5 * ((n or 9) - 1) for n in counts)
    index = [(np.floor(a + 0.5), np.floor(b + 0.5)) for a in x - 0.25 for b in y - 0.25]
    copies = []
    for (i, j), (a, b) in zip(index, [(a, b) for a in x for b in y], strict=True):
        turned = (1 - 2 * (i % 2), 1 - 2 * (j % 2))
        copies.append(shape.distance((AT - 1.2 * np.array([a, b])) * turned))
    np.testing.assert_allclose(made.distance(AT), least(copies), atol=1e-12)
    assert held(made, least(copies)) and made.exactness == "exact"


def test_an_interval_of_cells() -> None:
    shape = rm.rectangle((0.4, 0.7)).translate((0.1, 0.1))
    made = shape.repeat_interval((0.9, None), 1, 3)
    copies = [shape.translate((0.9 * i, 0)).distance(AT) for i in (1, 2, 3)]
    np.testing.assert_allclose(made.distance(AT), least(copies), atol=1e-12)


def placed() -> dict[str, tuple[Array, Callable[[Node, int], Node]]]:
    """Rows of numbers, and the copies that they stand for."""
    draw = np.random.default_rng(3)
    at, f, a = draw.uniform(-2, 2, (20, 2)), draw.uniform(0.4, 1.5, 20), draw.uniform(0, 6, 20)
    along = np.stack([-np.sin(a) * f, np.cos(a) * f], axis=1)
    matrices = np.zeros((20, 3, 3))
    matrices[:, 0, 0], matrices[:, 0, 1] = np.cos(a) * f, np.sin(a) * f
    matrices[:, 1, :2], matrices[:, 2, :2], matrices[:, 2, 2] = along, at, 1.0

    def turned(s: Node, i: int) -> Node:
        return s.scale(f[i]).rotate(a[i]).translate(at[i])

    return {
        "positions": (at, lambda s, i: s.translate(at[i])),
        "factors": (np.column_stack([at, f]), lambda s, i: s.scale(f[i]).translate(at[i])),
        "vectors": (np.concatenate([at, along], axis=1), turned),
        "matrices": (matrices, turned),
    }


@pytest.mark.parametrize("kind", placed())
def test_instances(kind: str) -> None:
    shape = rm.star(5, 0.3, 0.12) - rm.circle(0.05)
    rows, copy = placed()[kind]
    made = rm.instances(shape, rows)
    whole = least([copy(shape, i).distance(AT) for i in range(len(rows))])
    np.testing.assert_allclose(made.distance(AT), whole, atol=1e-12)
    assert held(made, whole) and pickle.loads(pickle.dumps(made)) == made
    np.testing.assert_allclose(
        made.extrude(0.5).distance(np.insert(AT, 2, 0.1, axis=1)), np.maximum(whole, -0.15), atol=1e-12
    )


def test_instances_that_are_refused() -> None:
    dot = rm.circle(0.1)
    with pytest.raises(SceneError, match=r"2,000 copies of a flat shape.*1,024.*Extrude"):
        rm.instances(dot, np.zeros((2000, 2)))
    with pytest.raises(SceneError, match=r"materials of a flat shape.*extrude"):
        rm.instances(dot, [(0, 0)], rm.Material())
    with pytest.raises(SceneError, match=r"shape \(2, 5\).*\(N, 2\) positions"):
        rm.instances(dot, np.zeros((2, 5)))
    with pytest.raises(SceneError, match=r"shape \(2,\)"):
        rm.instances(dot, (0.0, 1.0))
    with pytest.raises(SceneError, match=r"unbounded"):
        rm.instances(rm.circle(0.1).repeat(1), [(0, 0)])


def test_patterns_are_extruded_and_revolved() -> None:
    wheel = rm.rectangle((0.6, 0.2)).translate((0.8, 0)).polar(5)
    for flat in (wheel, rm.circle(0.3).repeat_mirrored(1, (3, 1)), rm.instances(rm.circle(0.2), [(0, 1), (1, 0)])):
        assert flat.extrude(0.2).facts.bounded and flat.translate((3, 0)).revolve().facts.bounded
        assert "vec2" in flat.extrude(0.2).glsl()
