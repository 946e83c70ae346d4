"""The materials of a scene are those that the shader marks: one that nothing shows calls for no module."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.walk import find
from raymarch.plan import plan
from raymarch.sdf.lower import Lowering
from raymarch.shader import assemble

RED, WHITE = rm.Material((1, 0, 0)), rm.Material(albedo=(1, 1, 1))
GLASS, SILVER = rm.Material(transmission=1), rm.Material(albedo=(1, 1, 1), metalness=1, roughness=0)
BALL, BOX = rm.sphere(), rm.box(1)
SOLIDS = {
    "none": BALL | BOX,
    "one": BALL.material(GLASS) | BOX,
    "on another": BALL.material(RED).material(GLASS),
    "on two": (BALL.material(RED) | BOX.material(WHITE)).material(GLASS),
    "on one of two": (BALL.material(RED) | BOX).material(GLASS),
    "on a cut without one": (BALL.material(WHITE) - BOX).material(GLASS),
    "on a cut with one": (BALL - BOX.material(WHITE)).material(GLASS),
    "on a nested cut": ((BALL.material(RED) & BOX) & rm.torus()).material(GLASS),
    "on a nested cut without one": ((BALL & BOX.material(RED)) & rm.torus()).material(GLASS),
    "on a smooth cut": rm.difference(BALL.material(RED), BOX, k=0.2).material(GLASS),
    "on copies": BALL.material(SILVER).repeat(3, 2).material(GLASS),
    "twice": BALL.material(GLASS) | BALL.material(GLASS).translate((2, 0, 0)),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_materials_are_those_that_are_marked(name: str) -> None:
    scene = rm.Scene(SOLIDS[name])
    default, *others = scene.materials
    marks = find([Lowering().field(scene.node, label=default).body], "mark")
    assert {mark.data for mark in marks} - {default} == set(others)
    assert scene.bounces == (6 if any(m.transmits for m in others) else 0)


@pytest.mark.parametrize("integrator", ["path", "whitted"])
@pytest.mark.parametrize("name", SOLIDS)
def test_all_that_is_called_for_is_there(name: str, integrator: str) -> None:
    made = plan(rm.Scene(SOLIDS[name], bounces=2, quality=rm.Quality(integrator=integrator)))
    text = assemble(made).text()
    assert ("Glass" in text) == (made.glass is not None)


@pytest.mark.parametrize("cut", [lambda a, b: a - b, lambda a, b: a & rm.sphere(9) - b])
@pytest.mark.parametrize("k", [0.0, 0.05])
def test_a_cut_by_a_tool_without_a_material_hides_nothing_in_its_hole(cut: Any, k: float) -> None:
    """The tool's material counts for nothing, its distance does: what lies in the hole is nearer than the wall."""
    red, blue = rm.Material((1, 0, 0)), rm.Material((0, 0, 1))
    bowl = cut(rm.box((2, 1, 2)).material(red), rm.sphere(0.8).translate((0, 0.5, 0)))
    ball = rm.sphere(0.3).translate((0, 0.2, 0)).material(blue)
    scene = rm.Scene(rm.union(bowl, ball, k=k), rm.Camera((0, 4, 0.5), (0, 0, 0), fov=20), [rm.Sun((0, 1, 0))])
    with rm.Renderer((32, 32)) as renderer:
        frame = renderer.render(scene, outputs=("material",))
    truth = rm.truth(scene, size=(32, 32), outputs=("material",))
    y, x = np.mgrid[0:32, 0:32]
    middle = np.hypot(x - 15.5, y - 15.5) < 4
    in_hole, wall = scene.materials.index(blue), scene.materials.index(red)
    for material in (frame.material, truth.material):
        assert np.all(material[middle] == in_hole) and np.all(material[:, 0] == wall)


@pytest.mark.parametrize("painted", ["before", "after"])
@pytest.mark.parametrize("scaled", [0.1, 2.0, (0.5, 0.5, 0.5000001), "transform"])
def test_a_blend_shows_as_much_of_a_scaled_solid_whenever_it_is_painted(painted: str, scaled: Any) -> None:
    """By symmetry, half of each in the plane between two equal balls."""
    red, blue = rm.Material((1, 0, 0), ambient=1, specular=0), rm.Material((0, 0, 1), ambient=1, specular=0)
    factor = 2.0 if scaled == "transform" else scaled[0] if isinstance(scaled, tuple) else scaled

    def larger(node: rm.Node) -> rm.Node:
        return node.transform(np.diag((2.0, 2.0, 2.0, 1.0))) if scaled == "transform" else node.scale(scaled)

    ball = rm.sphere(2 / factor)
    ball = larger(ball.material(red)) if painted == "before" else larger(ball).material(red)
    node = rm.union(ball.translate((-2.2, 0, 0)), rm.sphere(2).material(blue).translate((2.2, 0, 0)), k=3)
    scene = rm.Scene(node, rm.Camera((0, 0, 9), (0, 0, 0), fov=20), [rm.Sun((0, 0, 1))])
    with rm.Renderer((33, 33)) as renderer:
        drawn = renderer.render(scene).color[16, 16]
    for color in (drawn, rm.truth(scene, size=(33, 33)).color[16, 16]):
        np.testing.assert_allclose(color[0], color[2], rtol=1e-3)
        assert color[0] > 0.5
