"""Wrong facts of definitions are contradicted, and named with the definition's file and line."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.proof import proof as module
from raymarch.proof.facts import wrong_facts
from raymarch.scene.parameter import Values
from raymarch.sdf.definition import cube
from raymarch.sdf.domain import Positive
from raymarch.sdf.node import Node
from tests.support.node_samples import NodeSample, samples

UNIT = cube(1.0)


def shape(field: Callable[[Any], Any], **facts: Any) -> Node:
    """A shape of one size, with facts that may be wrong; the facts not given are right."""

    def solid(p: Any, size: Positive = 1.0) -> Any:
        """A solid."""
        return field(p / size) * size

    given = {"exactness": "bound", "bounds": lambda size: cube(size), **facts}
    made: Node = rm.shape(**given)(solid)()
    return made


def ball(p: Any) -> Any:
    return rm.length(p) - 1.0


def slab(p: Any) -> Any:
    return rm.max(*abs(p)) - 1.0


def ring(p: Any) -> Any:
    return rm.length(rm.vec2(rm.length(p.xz) - 0.7, p.y)) - 0.3


def waves(p: Any) -> Any:
    return rm.length(p) - 0.7 - 0.2 * rm.sin(12.0 * p.x)


WRONG: dict[str, tuple[Callable[[], Node], str]] = {
    "twice the distance": (lambda: shape(lambda p: 2.0 * ball(p)), "Lipschitz"),
    "1.01 of the distance": (lambda: shape(lambda p: 1.01 * ball(p)), "Lipschitz"),
    "a square": (lambda: shape(lambda p: rm.dot(p, p) - 1.0), "Lipschitz"),
    "waves": (lambda: shape(waves), "Lipschitz"),
    "a stretched ball": (lambda: shape(lambda p: ball(p * rm.vec3(1.0, 3.0, 1.0))), "Lipschitz"),
    "a divisor that is too small": (lambda: shape(lambda p: 6.0 * ball(p), lipschitz=lambda size: 3.0), "divisor"),
    "a divisor for waves": (lambda: shape(waves, lipschitz=lambda size: 1.5), "divisor"),
    "a step": (lambda: shape(lambda p: ball(p) + 0.3 * rm.floor(p.x)), "exactness"),
    "a bound that jumps": (lambda: shape(lambda p: rm.where(p.y > 0.0, ball(p), ball(p) + 0.6)), "exactness"),
    "half a distance as exact": (lambda: shape(lambda p: 0.5 * ball(p), exactness="exact"), "exact"),
    "a maximum as exact": (lambda: shape(slab, exactness="exact"), "exact"),
    "a small box": (lambda: shape(ball, bounds=lambda size: cube(0.8 * size)), "box"),
    "a flat box": (lambda: shape(ball, bounds=lambda size: cube(rm.vec3(1.0, 0.9, 1.0) * size)), "box"),
    "a box beside": (lambda: shape(lambda p: ball(p - rm.vec3(0.5, 0.0, 0.0))), "box"),
    "a box of a ring": (lambda: shape(ring, bounds=lambda size: cube(rm.vec3(0.95, 0.3, 0.95) * size)), "box"),
    "a spread": (lambda: shape(lambda p: 0.5 * ball(p), spread=1.0), "spread"),
    "a convex ring": (lambda: shape(ring, convex=True), "convex"),
    "two convex balls": (
        lambda: shape(lambda p: rm.length(rm.vec3(abs(p.x) - 0.6, p.y, p.z)) - 0.4, convex=True),
        "convex",
    ),
    "a mirrored half": (lambda: shape(lambda p: rm.max(ball(p), p.x), symmetry="xyz"), "symmetry"),
    "a mirrored ball": (lambda: shape(lambda p: rm.length(p - rm.vec3(0.0, 0.2, 0.0)) - 0.8, symmetry="y"), "symmetry"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_fact_is_named(name: str) -> None:
    make, word = WRONG[name]
    node = make()
    found = wrong_facts(node.translate((0.3, 0, 0)) | rm.plane(offset=-3), Values({}, 0.0), every=False)
    assert any(word in line for line in found), found
    assert all("test_facts.py:" in line and line.startswith("solid (") for line in found)


def test_right_facts_of_the_same_shapes() -> None:
    for node in (shape(ball, convex=True, symmetry="xyz"), shape(ring), shape(slab), shape(lambda p: 0.5 * ball(p))):
        assert wrong_facts(node, Values({}, 0.0), every=True) == ()


SOME = [s for s in samples() if s.definition.dimension == 3 and s.definition.arity == "none"][::40]


@pytest.mark.parametrize("sample", SOME, ids=lambda s: s.id)
def test_no_fact_of_the_library_is_called_wrong(sample: NodeSample) -> None:
    assert wrong_facts(sample.build(), Values({}, 0.0), every=True) == ()


def test_a_proof_names_wrong_facts() -> None:
    scene = rm.Scene(WRONG["twice the distance"][0](), camera=rm.Camera((0, 0, 4)))
    found = rm.prove(scene, size=(16, 9))
    assert "Lipschitz constant 1 is wrong: the field rises by 2" in found.wrong_facts[0]
    assert math.isclose(found.share, np.mean(found.state == 0)) and found.as_dict()["wrong_facts"]


def test_facts_are_sought_when_they_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(module, "wrong_facts", lambda node, values, every: asked.append(every) or ("a fact",))
    ball = rm.Scene(rm.sphere(), camera=rm.Camera((0, 0, 4)))
    found = rm.prove(ball, SimpleNamespace(depth=np.full((2, 2), 1.0)))
    assert found.contradicted == 4 and asked == []
    again = pickle.loads(pickle.dumps(found))
    assert again.wrong_facts == found.wrong_facts == ("a fact",) and asked == [True]
