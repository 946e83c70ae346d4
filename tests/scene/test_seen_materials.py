"""The materials of a scene are those that the shader marks: one that nothing shows calls for no module."""

from __future__ import annotations

import pytest

import raymarch as rm
from raymarch.expr.walk import find
from raymarch.plan import plan
from raymarch.sdf.lower import Lowering
from raymarch.shader import assemble

RED, WHITE = rm.Material((1, 0, 0)), rm.Material(albedo=(1, 1, 1))
GLASS, SILVER = rm.Material(transmission=1), rm.Material(albedo=(1, 1, 1), metalness=1, roughness=0)
BALL, BOX = rm.sphere(), rm.box()
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


@pytest.mark.parametrize("ways", ["random", "tree"])
@pytest.mark.parametrize("name", SOLIDS)
def test_all_that_is_called_for_is_there(name: str, ways: str) -> None:
    made = plan(rm.Scene(SOLIDS[name], bounces=2, quality=rm.Quality(ways=ways)))
    text = assemble(made).text()
    assert ("Glass" in text) == (made.glass is not None)
