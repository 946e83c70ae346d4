"""Samples refute a wrong box, spread or exactness of the user's own nodes, and no fact of this package."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.vocabulary import length, max, min, sin, vec2, vec3
from raymarch.sdf.definition import REGISTRY, cube
from raymarch.sdf.sampled_facts import contradictions, stated_by_user


@rm.operator(
    bounds=lambda child, height: (child.lower - height, child.upper + height),
    lipschitz=lambda child, height: child.lipschitz + 7 * height,
    spread=lambda child, height: child.spread,
)
def short_box(p: Any, child: Any, height: float = 0.3) -> Any:
    return child(p) + height * sin(6.3 * p.x)


@rm.operator(
    bounds=lambda child, height: child.grown(height),
    lipschitz=lambda child, height: child.lipschitz + 7 * height,
    spread=lambda child, height: child.spread,
)
def grown_box(p: Any, child: Any, height: float = 0.3) -> Any:
    return child(p) + height * sin(6.3 * p.x)


@rm.shape(exactness="bound", bounds=lambda size: cube(0.5 * size), spread=1.0)
def crate(p: Any, size: Any = (1, 1, 1)) -> Any:
    q = abs(p) - 0.5 * size
    return max(q.x, max(q.y, q.z))


@rm.shape(exactness="bound", bounds=lambda radius: cube(radius), spread=1.0)
def slow(p: Any, radius: float = 1.0) -> Any:
    return 0.5 * (length(p) - radius)


@rm.shape(exactness="exact", bounds=lambda size: cube(0.5 * size))
def exact_crate(p: Any, size: Any = (1, 1, 1)) -> Any:
    q = abs(p) - 0.5 * size
    return max(q.x, max(q.y, q.z))


@rm.shape(exactness="exact", bounds=lambda radius: cube(vec2(radius, radius)), dimension=2)
def exact_disc(p: Any, radius: float = 1.0) -> Any:
    return length(p) - radius


@rm.shape(exactness="exact", bounds=lambda a: cube(3.0))
def exact_pair(p: Any, a: float = 1.0) -> Any:
    """Overlapping spheres: exact outside only."""
    return min(length(p - vec3(a, 0, 0)) - 1.5, length(p + vec3(a, 0, 0)) - 1.5)


@rm.shape(exactness="bound", bounds=lambda radius: cube(2 * radius), spread=1.0, symmetry="xyz")
def off_centre(p: Any, radius: float = 1.0) -> Any:
    return length(p - vec3(0, 0.5 * radius, 0)) - radius


for _own in ("off_centre", "short_box", "grown_box", "crate", "slow", "exact_crate", "exact_disc", "exact_pair"):
    REGISTRY.pop(_own)

STRETCHED = rm.sphere().scale((1, 3, 1))


@pytest.mark.parametrize(
    ("node", "words"),
    [
        (short_box(STRETCHED), "outside its bounds"),
        (slow(), "more than its spread, 1, times the field"),
        (exact_crate(), "not exact"),
        (exact_pair(), "not exact"),
        (off_centre(), "differs by 1 if y changes sign"),
        (
            rm.glsl_node(
                "float ball(vec3 p) { return length(p) - 1.0; }",
                "ball",
                bounds=((-0.5, -1, -1), (1, 1, 1)),
                twin=lambda p: np.linalg.norm(p, axis=-1) - 1.0,
            ),
            "outside its bounds",
        ),
    ],
    ids=lambda value: value.name if isinstance(value, rm.Node) else "",
)
def test_a_wrong_fact_is_refuted(node: rm.Node, words: str) -> None:
    assert stated_by_user(node)
    (found,) = contradictions(node)
    assert words in found


@pytest.mark.parametrize(
    "node",
    [
        grown_box(STRETCHED),
        short_box(rm.sphere()),
        crate((1, 2, 1)),
        exact_disc(),
        exact_crate((1, 2, 3)).round(0.1) & rm.plane(),
        rm.box(1).repeat(2.0),
        rm.mandelbulb(),
        rm.sphere(rm.Param("thickness", 1.0, 0.5, 2.0)),
        rm.glsl_node("float ball(vec3 p) { return length(p) - 1.0; }", "ball"),
    ],
    ids=lambda node: node.name,
)
def test_correct_facts_are_not_refuted(node: rm.Node) -> None:
    assert list(contradictions(node)) == []


def test_a_picture_outside_of_its_box_is_doubtful() -> None:
    scene = rm.Scene(short_box(STRETCHED))
    with pytest.warns(rm.RenderWarning, match=r"test_sampled_facts.py:\d+: short_box: the solid reaches .* outside"):
        rm.render(scene, (16, 9))
    found = rm.probe(scene, (16, 9))
    assert not found.sound
    assert "outside its bounds" in str(found)
    assert rm.probe(rm.Scene(grown_box(STRETCHED)), (16, 9)).sound
