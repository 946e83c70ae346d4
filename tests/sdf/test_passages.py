"""What passes between nodes stays findable where it is asked for, and changes nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.derivative import companion
from raymarch.expr.faults import KINDS, decoded, first_fault, plain
from raymarch.expr.function import Function
from raymarch.expr.glsl import print_functions
from raymarch.expr.vocabulary import length, log, max
from raymarch.expr.walk import find
from raymarch.sdf.definition import REGISTRY, cube
from raymarch.sdf.evaluation import lower
from raymarch.sdf.lower import Lowering

POINTS = np.random.default_rng(5).uniform(-2, 2, (500, 3))


@rm.shape(exactness="bound", bounds=lambda radius: cube(radius))
def cracked(p: Any, radius: float = 0.5) -> Any:
    """Goes wrong where x is not above 0, though the value hides it."""
    return max(length(p) - radius, log(p.x) - 200.0)


@rm.shape(exactness="bound", bounds=lambda radius: cube(radius))
def steepening(p: Any, radius: float = 0.5) -> Any:
    """A value that is finite where its gradient is not."""
    return 1e-10 / p.x


for _own in ("cracked", "steepening"):
    REGISTRY.pop(_own)


def trees() -> dict[str, rm.Node]:
    """Nodes that are asked once, twice, through labels, in cells, and in the plane."""
    red = rm.Material((1, 0, 0))
    pair = rm.sphere(0.3).translate((0.2, 0.1, 0)) | rm.box((0.2, 0.9, 0.3))
    return {
        "blend": rm.union(rm.sphere(), rm.box(1).translate((1, 0, 0)), k=0.2).rotate(0.3, "z"),
        "asked twice": pair.repeat((2, None, None), 3) - pair,
        "labels": (rm.sphere().material(red) | rm.box(1) | rm.torus()).material(red) & rm.box(1),
        "cells": rm.repeat_varied(lambda i: rm.sphere(0.2 + 0.1 * rm.hash(i)) | rm.box((0.3, 0.3, 0.3)), 1.0, 5),
        "flat": rm.rectangle((1, 2)).extrude(0.5).twist(0.4),
        "fractal": rm.mandelbulb(),
    }


def probed(node: rm.Node) -> tuple[Function, list[rm.Node]]:
    sites: list[rm.Node] = []
    return Lowering(sites=sites).field(node), sites


@pytest.mark.parametrize("name", trees())
def test_values_and_gradients_are_those_of_the_field(name: str) -> None:
    node = trees()[name]
    field, sites = probed(node)
    for made, usual in ((field, lower(node)), (companion(field), companion(lower(node)))):
        expected = evaluator([usual.body], usual.params)(POINTS)[0]
        assert np.array_equal(evaluator([made.body], made.params)(POINTS)[0], expected)
        assert np.array_equal(evaluator([plain(made).body], made.params)(POINTS)[0], expected)
        assert not find([plain(made).body], "probe")
    assert sites[0] is node and len(set(map(id, sites))) == len(sites) and all(site.label is None for site in sites)


@pytest.mark.parametrize("name", trees())
def test_without_its_passages_the_text_is_the_usual_one(name: str) -> None:
    node = trees()[name]
    texts = [print_functions([plain(probed(node)[0])]), print_functions([lower(node)])]
    assert [line.text for line in texts[0].lines()] == [line.text for line in texts[1].lines()]


def fault(body: Any, params: Any, at: Any, sites: list[rm.Node]) -> tuple[str, str]:
    found = first_fault([body])
    assert found is not None
    code = evaluator([found], params, np.float32)(np.array([at]))[0].reshape(-1, 2)[0, 0]
    kind, site = decoded(float(code))
    return KINDS[kind], sites[site - 1].name if site else ""


AROUND: dict[str, Callable[[rm.Node], rm.Node]] = {
    "alone": lambda node: node,
    "in a union": lambda node: rm.sphere().translate((5, 0, 0)) | node,
    "turned": lambda node: node.rotate(0.0, "y") | rm.box(1),
    "as a function of its own": lambda node: rm.repeat_varied(lambda i: node, 4.0, 3) | rm.box(1),
    "asked at two points": lambda node: (node | rm.box((0.1, 0.1, 0.1))).repeat((4, None, None), 1),
}


@pytest.mark.parametrize("name", AROUND)
def test_the_node_at_fault_is_named_through_others(name: str) -> None:
    field, sites = probed(AROUND[name](cracked()))
    what = "the logarithm of 0 or less"
    assert fault(field.body, field.params, (-0.5, 0.1, 0.2), sites) == (what, "cracked")
    if name in ("alone", "in a union", "turned"):  # copies are asked where it goes wrong for them
        assert fault(field.body, field.params, (0.5, 0.1, 0.2), sites) == ("", "")


def test_a_gradient_at_fault_belongs_to_the_node_whose_it_is() -> None:
    field, sites = probed(rm.sphere() & steepening().rotate(0.0, "y").translate((1, 0, 0)))
    at = (1.0 + 2.0**-23, 0.1, 0.2)
    assert fault(field.body, field.params, at, sites) == ("", "")
    slope = companion(field)
    assert fault(slope.body, slope.params, (0.5, 0.1, 0.2), sites) == ("", "")
    field, sites = probed(steepening().translate((0, 1, 0)))
    slope = companion(field)
    what, name = fault(slope.body, slope.params, (1e-30, 0.1, 0.2), sites)
    assert what.endswith("not finite") and name == "steepening"
    assert fault(field.body, field.params, (1e-30, 0.1, 0.2), sites) == ("", "")
