"""Offsets and shells are as thick as the user asked for, or the plan and `Frame.doubts` say how thick they are."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch as rm
from raymarch.plan import plan
from raymarch.sdf import Node
from raymarch.sdf.levels import FIRST_ORDER, moved_otherwise, slopes_at_surface
from tests.support.random_trees import BY_ARITY, USABLE, made


def crossing(node: Node, start: np.ndarray, direction: np.ndarray, reach: float) -> np.ndarray:
    """Where rays that start inside leave a solid, by bisection."""
    low, high = np.zeros(len(start)), np.full(len(start), reach)
    for _ in range(50):
        middle = 0.5 * (low + high)
        inside = node.distance(start + middle[:, None] * direction) <= 0
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low


def on_surface(node: Node) -> tuple[np.ndarray, np.ndarray]:
    """Points of the surface with the normals there, by differences."""
    random, size = np.random.default_rng(4), float(np.linalg.norm(node.facts.size))
    lower, upper = node.bounds
    ends = random.uniform(lower - 0.01 * size, upper + 0.01 * size, (2, 4000, 3))
    values = node.distance(ends.reshape(-1, 3)).reshape(2, -1)
    cross = (values[0] <= 0) & (values[1] > 0)
    inside, outside = ends[0][cross][:200], ends[1][cross][:200]
    for _ in range(50):
        middle = 0.5 * (inside + outside)
        held = (node.distance(middle) <= 0)[:, None]
        inside, outside = np.where(held, middle, inside), np.where(held, outside, middle)
    h = 1e-6 * size
    normal = np.stack([node.distance(inside + h * e) - node.distance(inside - h * e) for e in np.eye(3)], axis=1)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    kept = length[:, 0] > 1e-9 * h
    return inside[kept], (normal / np.maximum(length, 1e-300))[kept]


@pytest.mark.parametrize("name", [d.name for d in USABLE])
def test_the_thickness_that_is_promised(name: str) -> None:
    """Of every shape, and of every operator on a box and on two balls: by rays, against what the plan says."""
    arity = next(kind for kind, some in BY_ARITY.items() if name in [d.name for d in some])
    children = {
        "none": [],
        "one": [rm.box((1, 0.6, 0.8))],
        "many": [rm.box(0.9), rm.sphere(0.7).translate((0.4, 0, 0))],
    }
    for seed in range(2):
        node = made(name, children[arity], seed)
        if not node.facts.bounded or node.facts.empty or node.exactness == "estimate":
            continue
        slopes = slopes_at_surface(node)
        if slopes is None:
            continue
        points, normals = on_surface(node)
        thickness = 1e-4 * float(np.linalg.norm(node.facts.size))
        low, high = 1 / slopes[1], 1 / max(slopes[0], 1e-9)
        far = 4 * min(high, 50) * thickness
        moved = crossing(node.round(thickness), points, normals, far) / thickness
        wall = crossing(node.shell(2 * thickness), points, normals, far) / thickness
        for found in (moved, wall):
            usual = (found >= 0.98 * low) & (found <= 1.02 * high)
            assert len(points) < 20 or np.mean(usual) >= 0.85, (node, low, high, np.quantile(found, (0.02, 0.5, 0.98)))
        doubts = list(moved_otherwise(node.round(thickness), doubted=True))
        assert bool(doubts) == (node.exactness != "exact" and max(high - 1, 1 - low) > FIRST_ORDER)
        if not doubts:
            assert len(points) < 20 or np.mean(np.abs(moved - 1) <= 1.5 * FIRST_ORDER) >= 0.9, node


def ball_of_samples() -> Node:
    axis = np.linspace(-1.5, 1.5, 64)
    return rm.grid(np.linalg.norm(np.meshgrid(axis, axis, axis, indexing="ij"), axis=0) - 1, 3.0)


@pytest.mark.parametrize(
    "node",
    [
        ball_of_samples(),
        rm.sphere(1).shear(0.7).shear(-0.7),
        rm.union(rm.sphere(1), rm.box(0.3), k=0.1, blend="chamfer"),
        rm.sphere(1).twist(1.0),
        rm.sphere(1).displace_by_noise(0.0, 3.0),
        rm.sphere(2).scale((0.5, 0.5, 0.5)),
        rm.instances(rm.union(rm.sphere(1), rm.box(0.3), k=0.1, blend="round"), [(0, 0, 0)]),
    ],
)
def test_a_divided_ball_keeps_its_thickness(node: Node) -> None:
    """Of balls of radius 1 that are written otherwise, whose fields are divided."""
    directions = np.random.default_rng(1).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    inner = np.broadcast_to(0.0, (50, 3))
    np.testing.assert_allclose(crossing(node.offset(0.2), inner, directions, 3.0), 1.2, atol=0.006)
    np.testing.assert_allclose(crossing(node.offset(-0.2), inner, directions, 3.0), 0.8, atol=0.006)
    np.testing.assert_allclose(crossing(node.shell(0.1), 0.97 * directions, directions, 3.0), 0.08, atol=0.006)


def test_plan_and_doubts_say_by_how_much() -> None:
    twisted = rm.Scene(rm.box(1).twist(2).offset(0.1))
    (said,) = plan(twisted).warnings
    assert "moves by 0.7" in said and "to 1 times" in said
    with rm.Renderer(size=(16, 16)) as renderer:
        assert said in renderer.render(twisted).doubts()
        plain = rm.Scene((rm.box(1) - rm.sphere(0.6)).shell(0.1))
        assert not [doubt for doubt in renderer.render(plain).doubts() if "acts on" in doubt]
    (said,) = plan(plain).warnings
    assert "edges" in said


def test_the_axis_of_a_revolved_outline_is_no_surface() -> None:
    """The field is 0 on the axis, where an edge of the outline is, and negative around it."""
    crown = [(0, 1.7), (0.14, 1.7), (0.3, 2.15), (0.05, 2.25), (0, 2.25)]
    turned = rm.polygon(crown).revolve()
    assert turned.exactness == "bound" and turned.distance((0, 2, 0)) == 0.0
    assert slopes_at_surface(turned) == pytest.approx((1.0, 1.0), abs=1e-3)
    assert not list(moved_otherwise(turned.round(0.02), doubted=True))
    flat = rm.implicit(lambda p: p.y * p.y * p.y, bounds=((-1, -1, -1), (1, 1, 1)))
    low, _ = slopes_at_surface(flat) or (1.0, 1.0)
    assert low < 1e-2  # a surface that is flat is one all the same


POCKET, CUBE = rm.box((0.5, 0.25, 0.5)), rm.box(1)
ROOM = rm.box((1, 0.5, 1))


@pytest.mark.parametrize(
    "node, said",
    [
        ((ROOM - POCKET.translate((0, 0.125, 0))).round(0.01), "draws a wall over what difference cuts"),
        ((ROOM - POCKET.translate((0, 0.13, 0))).shell(0.02), "draws a wall over what difference cuts"),
        ((ROOM - POCKET.translate((0, 0.14, 0))).shell(0.02), ""),
        ((ROOM - POCKET.translate((0, 0.125, 0))).offset(-0.01), ""),
        ((CUBE | CUBE.translate((1, 0, 0))).offset(-0.01), "where parts of union touch"),
        ((CUBE | CUBE.translate((1, 0, 0))).rotate(0.4).shell(0.01), "where parts of union touch"),
        (CUBE.repeat(1, 2).offset(-0.01), "where parts of repeat touch"),
        ((CUBE | CUBE.translate((0.9, 0, 0))).offset(-0.01), ""),
        ((CUBE | CUBE.translate((1, 0, 0))).round(0.01), ""),
        ((ROOM - POCKET.translate((0, 0.125, 0))) | rm.disc(1, 0), "a membrane there, which is drawn as disc is"),
        ((ROOM - POCKET.translate((0, 0.2, 0))) | rm.disc(1, 0), ""),
        ((ROOM - POCKET.translate((0, 0.125, 0))) | rm.disc(1, 0.1), ""),
    ],
)
def test_walls_that_an_offset_makes_of_faces_that_are_not_drawn(node: Node, said: str) -> None:
    """Along a line: the field of the tool's end, or of the face between two solids, is 0, and moves too."""
    doubts = [str(doubt) for doubt in moved_otherwise(node, doubted=True)]
    assert (len(doubts) == 1 and said in doubts[0]) if said else not doubts
