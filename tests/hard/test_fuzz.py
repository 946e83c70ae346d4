"""A short search among random scenes; a longer one: python -m tests.lab.fuzz --minutes 10."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import raymarch as rm
from raymarch import glsl
from tests.hard.python import as_python, make
from tests.hard.relations import RELATIONS
from tests.hard.world import World
from tests.lab.fuzz import Search, faults

NODE = rm.union(
    rm.box((1.0, 0.6, 0.8)).rotate(0.4, "y"), rm.torus(0.7, 0.15).translate((0.2, 0.3, 0)), k=0.1
) - rm.sphere(0.4).translate((0.3, 0.4, 0.3))


@pytest.mark.parametrize("name", RELATIONS)
def test_a_relation_holds(name: str, world: World) -> None:
    assert not faults(world, NODE, 5, (name,))


def test_a_scene_is_drawn_as_if_nothing_had_been_drawn_before(world: World) -> None:
    """After other lights too, which a renderer else keeps as rows: they change roundings of colours."""
    assert not faults(world, rm.sphere(1.0), 0, ("with_a_lamp_that_is_off", "made_of_the_default", "drawn_again"))
    assert not faults(world, rm.sphere(1.0), 0, ("cut_with_itself", "drawn_again"))


def test_there_are_enough() -> None:
    assert len(RELATIONS) >= 20


def test_random_scenes_are_as_promised(world: World) -> None:
    report = Search(world).batch(1, 5)
    assert report is None, report


def test_a_fault_is_found(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tracer that takes what it only came near for a hit."""
    load = glsl.load

    def spoiled(name: str, variants: frozenset[str] = frozenset()) -> glsl.Module:
        module = load(name, variants)
        lines = tuple(line.replace("refined(widths, t, next, derivative)", "next > 0.0") for line in module.lines)
        return replace(module, lines=lines)

    monkeypatch.setattr(glsl, "load", spoiled)
    found = faults(world, NODE | rm.box((4, 0.01, 4)), 6, ("drawn_again",))
    assert any("in the air" in what for what in found)


def test_a_scene_as_python_makes_it_again() -> None:
    made = eval(as_python(NODE), {"make": make})
    points = np.random.default_rng(1).normal(size=(20, 3))
    assert np.array_equal(made.distance(points), NODE.distance(points)) and "make('box'" in as_python(NODE)
