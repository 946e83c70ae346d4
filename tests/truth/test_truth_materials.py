"""Which material a surface is made of, and how materials mix."""

from __future__ import annotations

import numpy as np
import pytest

from raymarch.scene import Camera, Material, Scene, Sun
from raymarch.sdf import Node, box, sphere, union
from raymarch.truth import Truth, truth

RED, GREEN, BLUE = (Material(c, specular=0.0, ambient=1.0) for c in np.eye(3).tolist())
PLAIN = Material()


def shares(node: Node, size: tuple[int, int] = (40, 30)) -> Truth:
    """Lit from behind, a surface of ambient 1 shows its own colour: the shares of red, green and blue."""
    camera = Camera((1, 2, 5), (0, 0, 0))
    return truth(Scene(node, camera=camera, lights=[Sun((-1, -2, -5))]), size)


def blended(reds: float, greens: float, blues: float) -> Node:
    parts = (
        sphere(0.8 + reds).translate((-0.6, 0, 0)).material(RED),
        box((1.0, 1.2, 0.8)).translate((0.5, 0.1, 0)).round(0.1 + greens).material(GREEN),
        sphere(0.5 + blues).translate((0, 0.8, 0.2)).material(BLUE),
    )
    return union(*parts, k=0.4)


def test_shares_are_how_much_each_distance_moves_the_field() -> None:
    made = shares(blended(0, 0, 0))
    points = made.position + made.depth[made.hit][:, None] * made.direction[made.hit]
    lit = np.einsum("ij,j->i", made.normal[made.hit], np.array([-1.0, -2.0, -5.0])) > 0
    step = 1e-6
    moves = []
    for i in range(3):
        more, less = (blended(*(s * step * np.eye(3)[i])) for s in (1, -1))
        moves.append(np.abs(more.distance(points) - less.distance(points)) / (2 * step))
    wanted = np.stack(moves, axis=1)
    wanted /= wanted.sum(axis=1, keepdims=True)
    mixed = (np.sort(wanted, axis=1)[:, 1] > 0.05) & ~lit
    assert mixed.sum() > 50
    np.testing.assert_allclose(made.color[made.hit][~lit], wanted[~lit], atol=1e-7)
    index = np.array([0, *(list(Scene(blended(0, 0, 0)).materials).index(m) for m in (RED, GREEN, BLUE))])
    clear = np.ptp(np.sort(wanted, axis=1)[:, 1:], axis=1) > 1e-6
    assert np.array_equal(made.material[made.hit][clear], index[1:][np.argmax(wanted, axis=1)][clear])


def colors(node: Node) -> list[tuple[float, ...]]:
    made = shares(node)
    assert made.hit.any()
    return sorted({tuple(np.round(c, 9).tolist()) for c in made.color[made.hit]})


def test_an_outer_material_reaches_parts_without_one() -> None:
    inner = sphere(0.7).material(RED) | box(1).translate((1, 0, 0))
    assert colors(inner.material(BLUE)) == [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)]


def test_without_a_material_the_default_is_shown() -> None:
    made = truth(Scene(sphere()), (9, 9))
    assert set(np.unique(made.material)) == {-1, 0}
    both = truth(Scene(sphere().material(RED) | box(1).translate((2, 0, 0))), (40, 20))
    assert set(np.unique(both.material)) == {-1, 0, 1}


def test_equal_materials_are_one() -> None:
    again = Material([0, 0, 1], specular=0.0, ambient=1.0)
    node = sphere(0.5).material(BLUE) | box(1).translate((1, 0, 0)).material(again)
    assert len(Scene(node).materials) == 2
    assert set(np.unique(shares(node).material)) == {-1, 1}
    assert colors(node) == [(0.0, 0.0, 1.0)]


def test_a_material_like_the_default_is_the_default() -> None:
    made = truth(Scene(sphere().material(Material())), (9, 9))
    assert set(np.unique(made.material)) == {-1, 0}


@pytest.mark.parametrize("k", [0.0, 0.2])
def test_a_tool_without_a_material_shows_what_it_cuts(k: float) -> None:
    tool = sphere(0.8).translate((0.3, 0.6, 1.2))
    solid = box((2, 2, 2)).material(GREEN)
    assert colors(solid.difference(tool, k=k)) == [(0.0, 1.0, 0.0)]
    assert (0.0, 0.0, 1.0) in colors(solid.difference(tool.material(BLUE), k=k))
    assert colors(solid.intersection(sphere(1.2), k=k)) == [(0.0, 1.0, 0.0)]


def test_a_repeated_part_keeps_its_materials() -> None:
    pair = sphere(0.2).material(RED) | box((0.2, 0.2, 0.2)).translate((0.4, 0, 0)).material(BLUE)
    assert colors(pair.repeat((1.2, 1.0, 1.0), (3, 1, 1))) == [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)]
