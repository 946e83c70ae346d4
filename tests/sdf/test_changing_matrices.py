"""`transform` by matrices of expressions: against NumPy, against constant matrices, and in pictures."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.expr.node import expr
from raymarch.expr.walk import find
from raymarch.sdf.affine import smallest_stretch
from raymarch.truth import truth

Array = NDArray[np.float64]
T = rm.time
C, S = rm.cos(T), rm.sin(T)
K = rm.Param("k", 1.0, 0.5, 2.0)
TURN = rm.Param("turn", 0.3)

MATRICES: dict[str, tuple[list[list[Any]], Callable[[float, float, float], list[list[float]]]]] = {
    "stretch in time": (
        [[2 + C, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
        lambda t, k, a: [[2 + math.cos(t), 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
    ),
    "turn and scale": (
        [[2 * C, 2 * S, 0, 0], [-2 * S, 2 * C, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]],
        lambda t, k, a: [
            [2 * math.cos(t), 2 * math.sin(t), 0, 0],
            [-2 * math.sin(t), 2 * math.cos(t), 0, 0],
            [0, 0, 2, 0],
            [0, 0, 0, 1],
        ],
    ),
    "shear and move": (
        [[1, 0, 0, 0], [0.7 * S, 1, 0, 0], [0, 0.3 * C, K, 0], [0.5, S, K, 1]],
        lambda t, k, a: [
            [1, 0, 0, 0],
            [0.7 * math.sin(t), 1, 0, 0],
            [0, 0.3 * math.cos(t), k, 0],
            [0.5, math.sin(t), k, 1],
        ],
    ),
    "reflect by a parameter": (
        [[rm.cos(TURN), 0, rm.sin(TURN), 0], [0, -K, 0, 0], [-rm.sin(TURN), 0, rm.cos(TURN), 0], [0, 0, 0, 1]],
        lambda t, k, a: [
            [math.cos(a), 0, math.sin(a), 0],
            [0, -k, 0, 0],
            [-math.sin(a), 0, math.cos(a), 0],
            [0, 0, 0, 1],
        ],
    ),
    "move alone": (
        [[1.5, 0.4, 0, 0], [0, 0.7, 0, 0], [0, 0, 1, 0], [S, C, K, 1]],
        lambda t, k, a: [[1.5, 0.4, 0, 0], [0, 0.7, 0, 0], [0, 0, 1, 0], [math.sin(t), math.cos(t), k, 1]],
    ),
}
MOMENTS = [(0.0, 1.0, 0.3), (1.9, 0.5, -1.0), (4.4, 2.0, 2.5), (-77.3, 1.3, 9.0)]
BRICK = rm.box((1.0, 0.6, 0.8))


def values(matrix: list[list[Any]], k: float, a: float) -> dict[str, float]:
    """The values of the parameters that a matrix reads."""
    read = {leaf.data.name for row in matrix for each in row for leaf in find([expr(each)], "param")}
    return {name: value for name, value in {"k": k, "turn": a}.items() if name in read}


@pytest.mark.parametrize("name", MATRICES)
def test_the_field_is_that_of_numpy(name: str) -> None:
    """The value is the smallest singular value, or little less, times the child's value at the point that NumPy maps
    back; the solid is the same as under the matrix of numbers."""
    matrix, numbers = MATRICES[name]
    node = BRICK.transform(matrix)
    points = np.random.default_rng(1).uniform(-3, 3, (500, 3))
    for t, k, a in MOMENTS:
        m = np.array(numbers(t, k, a))
        back = np.concatenate([points, np.ones((500, 1))], axis=1) @ np.linalg.inv(m)
        least = np.linalg.svd(m[:3, :3], compute_uv=False)[-1]
        found, wanted = node.distance(points, t, values(matrix, k, a)), least * BRICK.distance(back[:, :3])
        np.testing.assert_allclose(found, wanted, rtol=3e-5, atol=1e-9)
        assert np.all(np.abs(found) <= np.abs(wanted) * (1.0 + 1e-12) + 1e-15)


@pytest.mark.parametrize("name", MATRICES)
def test_facts_hold_at_all_moments(name: str) -> None:
    """Every corner of the moved box is in the bounds, values grow no faster than the distance, and points of small
    values are within the spread of the box."""
    matrix, numbers = MATRICES[name]
    node, random = BRICK.transform(matrix), np.random.default_rng(2)
    corners = 0.5 * np.array([(x, y, z, 2.0) for x in (-1, 1) for y in (-0.6, 0.6) for z in (-0.8, 0.8)])
    assert node.exactness == "bound" and node.lipschitz <= 1.0
    for _ in range(40):
        t, k, a = random.uniform(-50, 50), random.uniform(0.5, 2.0), random.uniform(-9, 9)
        moved = (corners @ np.array(numbers(t, k, a)))[:, :3]
        low, high = node.bounds
        assert np.all(moved >= low - 1e-9) and np.all(moved <= high + 1e-9)
        p, q = random.uniform(-3, 3, (2, 200, 3))
        at, to = (node.distance(x, t, values(matrix, k, a)) for x in (p, q))
        assert np.all(np.abs(at - to) <= np.linalg.norm(p - q, axis=1) * (1.0 + 1e-9))
        margin = np.maximum(at, 0.0)[:, None] * node.facts.spread
        assert np.all((p >= low - margin) & (p <= high + margin) | (at < 0)[:, None])


def test_bounds_of_the_smallest_stretch() -> None:
    """They hold what NumPy finds at random values, and the lower one is close."""
    random = np.random.default_rng(3)
    cases: list[tuple[list[list[Any]], Callable[[float, float], list[list[float]]]]] = [
        (
            [[2 * C, -2 * S], [2 * S, 2 * C]],
            lambda t, k: [[2 * np.cos(t), -2 * np.sin(t)], [2 * np.sin(t), 2 * np.cos(t)]],
        ),
        ([[1, 0.7 * S], [0, K]], lambda t, k: [[1, 0.7 * np.sin(t)], [0, k]]),
        (
            [[K, 0.2 * S, 0], [0, 1, 0.3 * C], [0.1, 0, -1 - 0.4 * C]],
            lambda t, k: [[k, 0.2 * np.sin(t), 0], [0, 1, 0.3 * np.cos(t)], [0.1, 0, -1 - 0.4 * np.cos(t)]],
        ),
    ]
    for rows, numbers in cases:
        vector = rm.vec2 if len(rows) == 2 else rm.vec3
        low, high = smallest_stretch([vector(*row) for row in rows])
        found = [
            np.linalg.svd(np.array(numbers(t, k)), compute_uv=False)[-1]
            for t, k in random.uniform((-9, 0.5), (9, 2.0), (4000, 2))
        ]
        assert 0.0 < low <= np.min(found) and np.max(found) <= high
        assert low >= 0.8 * np.min(found)


def test_what_cannot_be_known_is_refused() -> None:
    free, wide = rm.Param("free", 1.0), rm.Param("wide", 1.0, -1.0, 1.0)

    def diagonal(x: Any) -> list[list[Any]]:
        return [[x, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]

    for matrix, *words in (
        (diagonal(free), "flattens nothing", "'free' needs min= and max="),
        (diagonal(wide), "smallest stretch is between 0 and 1", "for all values of its parameters"),
        ([[C, 0, 0], [0, 1, 0], [0, 0, 1]], "3 rows", "4x4"),
        ([[C, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "3 rows", "4x4"),
        ([[C, 0, 0, S], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "an expression, 0, 0, 1", "pass its transpose"),
        ([[C, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], "pass its transpose"),
        (
            [[C, 0, 0, 0], [0, np.nan, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
            "an element of the matrix is nan",
            "4x4 finite",
        ),
        (
            [[C, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, np.inf, 0, 1]],
            "an element of the matrix is inf",
            "4x4 finite",
        ),
        ([[rm.vec2(1, 2), 0, 0, 0], [0, C, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], "4x4 finite numbers, or expressions"),
    ):
        with pytest.raises(SceneError) as fault:
            BRICK.transform(matrix)
        assert all(word in str(fault.value) for word in words), str(fault.value)
        assert "test_changing_matrices.py" in str(fault.value)


def test_a_moment_that_flattens_is_told() -> None:
    """A matrix whose stretch passes 0 in time is drawn at all other moments, as `scale` is."""
    node = BRICK.transform([[T - 1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    assert node.distance((1.4, 0, 0), 3.0) == pytest.approx(0.2, rel=1e-4)
    assert node.distance((3.0, 0, 0), 0.0) == pytest.approx(2.5, rel=1e-4)  # a reflection
    with pytest.warns(rm.RenderWarning, match="transform: stretch = 0.0 at time = 1"):
        node.distance((3.0, 0, 0), 1.0)


def scene(matrix: list[list[Any]], **more: Any) -> rm.Scene:
    floor = rm.plane(offset=-1.6).material(rm.Material(color=(0.6, 0.5, 0.4)))
    solid = BRICK.transform(matrix).material(rm.Material(color=(0.2, 0.6, 0.8)))
    more = {"lights": [rm.Sun((1, 2, 1.5), shadow=True)], "camera": rm.Camera((2, 2, 4), (0, -0.3, 0)), **more}
    return rm.Scene(solid | floor, **more)


@pytest.mark.parametrize("name", MATRICES)
def test_pictures_are_those_of_a_constant_matrix(name: str) -> None:
    """Colours, shadows included, depths and normals: those of the matrix of numbers at that moment."""
    matrix, numbers = MATRICES[name]
    with rm.Renderer((64, 40)) as renderer:
        for t, k, a in MOMENTS[1:3]:
            outputs = ("color", "depth", "normal")
            found = renderer.render(scene(matrix), t, values(matrix, k, a), outputs)
            wanted = renderer.render(scene(numbers(t, k, a)), t, outputs=outputs)
            for output in outputs:
                apart = np.abs(found.array(output) - wanted.array(output))
                assert np.mean(np.nan_to_num(apart) > 2e-3) < 0.01, output


def test_reference_and_proof_agree_with_a_picture_of_mirrors_and_shadows() -> None:
    matrix = [[1.2, 0, 0, 0], [0.5 * S, 1, 0, 0], [0, 0.3 * C, 0.8, 0], [0, 0.1 * S, 0, 1]]
    solid = BRICK.round(0.05).transform(matrix).material(rm.Material(albedo=(0.8, 0.4, 0.2), roughness=0.6))
    mirror = rm.plane(offset=-0.8).material(rm.Material(albedo=(0.8, 0.8, 0.8), roughness=0.02, metalness=1.0))
    made = scene(matrix).replace(node=solid | mirror, bounces=2, quality=rm.Quality(integrator="whitted"))
    with rm.Renderer((60, 40)) as renderer:
        found = renderer.render(made, 1.1, outputs=("color", "depth", "normal"))
    wanted = truth(made, (60, 40), time=1.1)
    hit = np.isfinite(wanted.depth)
    assert np.mean(hit) > 0.3 and np.array_equal(np.isfinite(found.array("depth")), hit)
    np.testing.assert_allclose(found.array("depth")[hit], wanted.depth[hit], atol=2e-3)
    np.testing.assert_allclose(found.color, wanted.color, atol=1e-2)
    assert np.all(rm.prove(made, size=(30, 20), time=1.1).state == 0)


@pytest.mark.parametrize("kind", ["glsl", "wgsl", "html"])
def test_exports_hold_the_matrix(kind: str, tmp_path: Path) -> None:
    file = tmp_path / f"scene.{kind}"
    rm.export(scene(MATRICES["stretch in time"][0]), file)
    assert "time" in file.read_text().lower()
