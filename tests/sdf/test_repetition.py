"""Repetition against all copies, one by one: what is not asked must not be missed."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch.expr.vocabulary as v
from raymarch.errors import SceneError
from raymarch.expr import expr
from raymarch.scene.parameter import Param
from raymarch.sdf import Node, box, capsule, circle, cylinder, plane, rectangle, repeat, shape, slab, sphere
from raymarch.sdf.domain import Positive
from tests.support.refusals import refused

Count = int | None


def all_copies(
    node: Node, points: NDArray[np.float64], spacing: tuple[float | None, ...], counts: tuple[Count, ...]
) -> NDArray[np.float64]:
    """The smallest distance over every copy; copies without end are cut off far from the points."""
    offsets = []
    for step, count in zip(spacing, counts, strict=True):
        if step is None or count == 1:
            offsets.append([0.0])
        elif count is None:
            offsets.append([k * step for k in range(-5, 6)])
        else:
            offsets.append([(k - 0.5 * (count - 1)) * step for k in range(count)])
    return np.min([node.distance(points - np.array(o)) for o in product(*offsets)], axis=0)


def drawn(spacing: tuple[float | None, ...], counts: tuple[Count, ...], count: int = 2400) -> NDArray[np.float64]:
    """Points among the copies and beyond their ends; many of them on and beside the borders of cells."""
    random = np.random.default_rng(4)
    ends = [(2.0, None) if s is None else (s, c) for s, c in zip(spacing, counts, strict=True)]
    half = [step * (3.2 if count is None else 0.5 * count + 1.5) for step, count in ends]
    points = random.uniform(-1, 1, (count, 3)) * half
    for axis, step in enumerate(spacing):
        if step is not None:
            snapped = np.round(points[: count // 3, axis] / (0.5 * step)) * 0.5 * step
            points[: count // 3, axis] = snapped + random.choice([0.0, 1e-12, -1e-12, 1e-6, -1e-6], count // 3)
    return points


CHILDREN: dict[str, Node] = {
    "symmetric": box((0.6, 0.4, 0.5)),
    "aside": sphere(0.3).translate((0.7, -0.3, 0.2)),
    "far aside": sphere(0.35).translate((7.3, 0.0, -4.1)),
    "slanted": capsule((-0.25, -0.2, 0.1), (0.3, 0.25, -0.2), 0.15),
    "two pieces": sphere(0.1).translate((-0.35, 0.0, 0.2)) | sphere(0.1).translate((0.35, 0.1, -0.3)),
}
GRIDS: dict[str, tuple[tuple[float | None, ...], tuple[Count, ...]]] = {
    "without end": ((1.0, 1.1, 1.2), (None, None, None)),
    "odd": ((1.0, 1.3, None), (3, 5, 1)),
    "even": ((1.0, 1.0, 1.5), (2, 4, 2)),
    "mixed": ((1.1, None, 1.0), (4, 1, None)),
    "one axis": ((None, 1.2, None), (1, None, 1)),
    "ones": ((1.0, 1.0, 1.0), (1, 3, 1)),
}


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("child", CHILDREN)
def test_exact_children_give_the_nearest_copy(child: str, grid: str) -> None:
    node, (spacing, counts) = CHILDREN[child], GRIDS[grid]
    assert node.exactness == "exact"
    points = drawn(spacing, counts)
    endless = [s is not None and c is None for s, c in zip(spacing, counts, strict=True)]
    points += np.where(endless, np.mean(node.bounds, axis=0), 0.0)  # copies without end are cut off far from the child
    repeated = repeat(node, spacing, counts)
    np.testing.assert_allclose(repeated.distance(points), all_copies(node, points, spacing, counts), atol=1e-11)
    assert repeated.exactness == "exact"


@shape(exactness="bound", bounds=lambda radius: (expr((-0.5, -0.2, -0.2)), expr((0.4, 0.2, 0.2))))
def lopsided(p: Any, radius: Positive = 0.2) -> Any:
    """A ball whose field says little on its left: the copy to the right of a point seems nearer than the own one."""
    return v.min(v.length(p) - radius, v.max(0.1, 0.6 + p.x))


BOUNDED: dict[str, Node] = {
    "lopsided": lopsided(),
    "bitten": box((0.6, 0.5, 0.6)) - sphere(0.3).translate((0.3, 0.25, 0.1)),
    "stretched": sphere(0.3).scale((1.4, 0.5, 1.0)).translate((0.1, 0.2, 0.0)),
    "blended": sphere(0.2).union(sphere(0.2).translate((0.3, 0.1, 0.0)), k=0.3),
}


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("child", BOUNDED)
def test_bound_children_give_a_bound_that_does_not_jump(child: str, grid: str) -> None:
    node, (spacing, counts) = BOUNDED[child], GRIDS[grid]
    assert node.exactness == "bound"
    repeated = repeat(node, spacing, counts)
    points = drawn(spacing, counts)
    value, nearest = repeated.distance(points), all_copies(node, points, spacing, counts)
    solid = sphere(0.2) if child == "lopsided" else node
    low, high = repeated.bounds
    aside = np.maximum(low - points, points - high).max(axis=1)  # the way to the box of all copies
    limit = np.maximum(all_copies(solid, points, spacing, counts), aside)
    assert np.all(value <= limit + 1e-12), "larger than the distance to a copy"
    np.testing.assert_array_equal(value < -1e-12, nearest < -1e-12)
    np.testing.assert_allclose(value[nearest < 0], nearest[nearest < 0], atol=1e-12)
    random = np.random.default_rng(6)
    steps = random.normal(size=points.shape)
    steps *= (10 ** random.uniform(-9, -1, len(points)) / np.linalg.norm(steps, axis=1))[:, None]
    rise = np.abs(repeated.distance(points + steps) - value)
    assert np.all(rise <= np.linalg.norm(steps, axis=1) * (1 + 1e-9) + 1e-13)


def test_a_bound_child_seen_from_afar() -> None:
    """Beyond the box of all copies the distance goes on growing: a ray comes nearer in a few steps."""
    repeated = BOUNDED["bitten"].repeat((1.0, None, None), (3, 1, 1))
    far = [(50.0, 0.0, 0.0), (0.3, -50.0, 0.0), (0.0, 0.0, 50.0)]
    assert np.all(repeated.distance(far) > 45.0)
    endless = BOUNDED["bitten"].repeat((1.0, None, None))
    assert endless.distance((1234.3, 50.0, 0.0)) > 45.0
    assert repeated.facts.spread == endless.facts.spread == 1.0


@pytest.mark.parametrize("child", [CHILDREN["aside"], CHILDREN["symmetric"], BOUNDED["stretched"]])
def test_every_cell_is_alike_however_far(child: Node) -> None:
    spacing = (1.0, 1.5, 2.0)  # exact in binary, so that moving by cells rounds nothing away
    repeated = child.repeat(spacing)
    points = np.round(drawn(spacing, (None, None, None), 600) * 2**20) / 2**20
    near = repeated.distance(points)
    for cells in (1.0, -3.0, 1e3, 1e6):
        np.testing.assert_allclose(repeated.distance(points + cells * np.array(spacing)), near, atol=1e-9)


def test_the_axes_left_alone_are_left_alone() -> None:
    bars = cylinder(0.2, 50.0).repeat((1.0, None, 1.0))
    np.testing.assert_allclose(bars.distance([(5.0, 30.0, 3.0), (4.5, 0.0, 3.0), (0.0, 0.0, 0.0)]), [5.0, 0.3, -0.2])
    endless = (plane((0, 1, 0), 0.5) & plane((0, -1, 0), 0.5)).repeat((None, 2.0, None))
    np.testing.assert_allclose(endless.distance([(9.0, 0.75, -7.0), (0.0, 2.0, 50.0)]), [0.25, -0.5])


def test_one_number_serves_all_axes() -> None:
    child = CHILDREN["aside"]
    assert child.repeat(1.5, 3).glsl() == child.repeat((1.5, 1.5, 1.5), (3, 3, 3)).glsl()
    assert child.repeat(1.5).glsl() == child.repeat(np.array([1.5, 1.5, 1.5]), None).glsl()


@pytest.mark.parametrize(
    ("child", "spacing", "asked"),
    [
        (box(0.5), 1.0, 1),
        (sphere(0.2).translate((0.1, 0, 0)), 1.0, 2),
        (sphere(0.2).translate((0.1, 0.1, 0)), 1.0, 4),
        (sphere(0.2).translate((0.1, 0.1, 0.1)), 1.0, 8),
        (sphere(0.2).translate((0.1, 0.1, 0.1)), (1.0, None, None), 2),
    ],
)
def test_as_few_copies_are_asked_as_symmetry_allows(child: Node, spacing: Any, asked: int) -> None:
    text = child.repeat(spacing).glsl()
    body = text[text.index("float field(") :]
    assert body.count("sphere(") + body.count("box(") + body.count("translate_field(") == asked


def test_bounds() -> None:
    low, high = sphere(0.25).translate((0.5, 0, 0)).repeat((2.0, 1.0, None), (4, None, 1)).bounds
    np.testing.assert_allclose(low, [-2.75, -np.inf, -0.25])
    np.testing.assert_allclose(high, [3.75, np.inf, 0.25])


def test_copies_that_touch_are_no_longer_exact() -> None:
    """Walls between them bound nothing: the distance from inside is too small."""
    assert box(1.0).repeat(1.0).exactness == "bound"
    assert box(1.0).repeat((1.0, None, None), (2, 1, 1)).exactness == "bound"
    assert box(1.0).repeat((None, 1.5, None)).exactness == "exact"


def test_a_spacing_that_is_a_parameter() -> None:
    spacing = Param("gap", 1.5, 1.0, 4.0)
    repeated = sphere(0.5).repeat((spacing, None, None), (3, 1, 1))
    np.testing.assert_allclose(repeated.bounds[1], [4.5, 0.5, 0.5])
    assert repeated.distance((1.5, 0, 0)) == -0.5
    assert repeated.exactness == "bound", "they touch at the end of the range"
    with pytest.raises(SceneError, match="1 wide along x"):
        sphere(0.5).repeat((Param("gap", 1.5, 0.5, 4.0), None, None))


REFUSED: dict[str, tuple[Callable[[], Any], tuple[str, ...]]] = {
    "spacing 0": (lambda: sphere(0.2).repeat(0), ("spacing along x = 0", "> 0")),
    "negative spacing": (lambda: sphere(0.2).repeat((1, -2.5, 1)), ("spacing along y = -2.5", "> 0")),
    "spacing not a number": (lambda: sphere(0.2).repeat((1, 1, float("nan"))), ("along z = nan", "> 0")),
    "infinite spacing": (lambda: sphere(0.2).repeat(float("inf")), ("inf", "finite")),
    "two spacings": (lambda: sphere(0.2).repeat((1, 2)), ("(1, 2)", "three for x, y and z")),
    "spacing of texts": (lambda: sphere(0.2).repeat(("a", 1, 1)), ("'a'", "number")),
    "child too large": (lambda: sphere(0.8).repeat((2, 1.5, 2)), ("sphere is 1.6 wide along y", "1.5", ">= 1.6")),
    "child too large aside": (
        lambda: sphere(0.8).translate((5, 0, 0)).repeat((1.5, None, None)),
        ("translate is 1.6 wide along x", ">= 1.6"),
    ),
    "child without end": (lambda: plane().repeat((1, None, 1)), ("plane is unbounded along x", "None")),
    "count 0": (lambda: sphere(0.2).repeat(1, 0), ("count = 0", ">= 1")),
    "negative count": (lambda: sphere(0.2).repeat(1, (1, -2, 1)), ("(1, -2, 1)", ">= 1")),
    "half a count": (lambda: sphere(0.2).repeat(1, 2.5), ("2.5", ">= 1")),
    "true as a count": (lambda: sphere(0.2).repeat(1, True), ("True", ">= 1")),
    "three spacings in the plane": (lambda: circle(0.2).repeat((1, 2, 3)), ("(1, 2, 3)", "two for x and y")),
    "too large in the plane": (lambda: circle(0.6).repeat((None, 1)), ("circle is 1.2 wide along y", ">= 1.2")),
    "two counts": (lambda: sphere(0.2).repeat(1, (2, 3)), ("(2, 3)", "three for x, y and z")),
    "no node": (lambda: repeat(3.0, 1.0), ("3.0", "a node")),
    "time as spacing": (lambda: sphere(0.2).repeat(_time()), ("-inf", "> 0")),
}


def _time() -> Any:
    from raymarch.scene.parameter import time

    return time


@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_value_range_and_line(name: str) -> None:
    wrong, words = REFUSED[name]
    refused(wrong, *words)


def test_whole_numbers_of_numpy_are_counts() -> None:
    assert sphere(0.2).repeat(1.0, np.int64(3)).glsl() == sphere(0.2).repeat(1.0, 3).glsl()


@pytest.mark.parametrize("grid", [((1.1, 1.3), (3, 4)), ((None, 1.0), (1, None)), ((1.4, 1.0), (None, 2))])
def test_flat_shapes_repeat_in_their_plane(grid: Any) -> None:
    child = circle(0.3).translate((0.1, 0.15)) | rectangle((0.2, 0.4)).translate((-0.1, 0.0))
    points = np.random.default_rng(6).uniform(-3.0, 3.0, (2400, 2))
    node, copies = child.repeat(*grid), all_copies(child, points, *grid)
    np.testing.assert_array_equal(np.sign(node.distance(points)), np.sign(copies))
    assert node.extrude(0.5).exactness == node.exactness == "bound"
    assert np.all(np.abs(node.distance(points)) <= np.abs(copies) + 1e-12)
    exact = circle(0.3).translate((0.1, 0.15)).repeat(*grid)
    assert exact.exactness == "exact"
    np.testing.assert_allclose(
        exact.distance(points), all_copies(circle(0.3).translate((0.1, 0.15)), points, *grid), atol=1e-12
    )


def test_polar_copies_of_a_solid_that_is_bounded_along_y_alone() -> None:
    wall = (slab((0, 1, 0), 0.4) - plane((1, 0, 0), 1.0)).rotate(0.3, "y")
    points = np.random.default_rng(3).uniform(-3, 3, (500, 3))
    copies = np.min([wall.rotate(2 * np.pi * i / 5, "y").distance(points) for i in range(5)], axis=0)
    np.testing.assert_allclose(wall.polar(5).distance(points), copies, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5])
def test_mirrored_cells_are_centred_on_the_origin(count: int) -> None:
    """An even number has a wall at the origin. Every second copy is the image of its neighbours in the walls."""
    spacing, points = 2.0, np.random.default_rng(0).uniform(-6, 6, (4000, 3))
    child = box((0.6, 0.5, 0.4)).translate((0.3, 0.1, 0.0))
    centres = spacing * (np.arange(count) - 0.5 * (count - 1))
    assert (0.0 in centres) == (count % 2 == 1)
    found = child.repeat_mirrored((spacing, None, None), (count, 1, 1)).distance(points)
    best = np.inf
    for first in (1.0, -1.0):  # which of the copies are mirrored
        turns = first * (-1.0) ** np.arange(count)
        copies = [
            child.distance((points - (centre, 0, 0)) * (turn, 1, 1))
            for centre, turn in zip(centres, turns, strict=True)
        ]
        best = min(best, np.abs(found - np.min(copies, axis=0)).max())
    assert best < 1e-12
