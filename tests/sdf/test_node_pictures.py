"""A picture of every definition of the package, held against the float64 truth: hits, depths, normals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.gpu import Renderer
from raymarch.gpu.context import Context
from raymarch.scene.parameter import set_values
from raymarch.sdf import Node
from raymarch.sdf.definition import REGISTRY
from raymarch.truth import silhouettes, truth
from tests.support.compared import compare
from tests.support.node_samples import NodeSample, definitions, samples

SIZE, SMALL = (48, 48), (32, 32)
"""The smaller for estimates, whose truth takes long."""
FOOTPRINT = 0.25
"""How far a hit may be from the surface, in widths of its pixel."""


@pytest.fixture(scope="module")
def renderer(egl: Context) -> Iterator[Renderer]:
    with Renderer(SIZE, "egl") as made:
        yield made


def solid(node: Node) -> Node:
    """Something to look at: flat shapes get a thickness, endless ones an end."""
    if node.dimension == 2:
        node = REGISTRY["straight_extrusion"].make((node,), (0.3,), {})
    return node if node.facts.bounded else node & rm.box(1.2)


def scene(node: Node) -> rm.Scene:
    """The whole solid, seen from aside and above."""
    low, high = node.bounds
    centre, reach = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    towards = np.array([0.55, 0.45, 0.7])
    eye = centre + 2.4 * reach * towards / np.linalg.norm(towards)
    return rm.Scene(node, rm.Camera(tuple(eye), tuple(centre), fov=52.0))


CHOSEN: list[NodeSample] = [
    [s for s in samples() if s.definition is d][0 if d.exactness == "estimate" else -1] for d in definitions()
]
"""Of each definition the last sample: drawn parameters, and a child that is least like the others. Fractals of drawn
parameters may be dust."""


def some_long() -> Iterator[Any]:
    """Every third picture of a definition; the others are long: tests/sdf/test_every_node.py holds the field and the
    gradient of each on the driver."""
    for i, sample in enumerate(CHOSEN):
        yield pytest.param(sample, id=sample.id, marks=[pytest.mark.long] if i % 3 else [])


@pytest.mark.parametrize("sample", list(some_long()))
def test_its_picture_is_true(sample: NodeSample, renderer: Renderer) -> None:
    node = solid(sample.build())
    shown = scene(node)
    size = SMALL if node.exactness == "estimate" else SIZE
    renderer.resize(size)
    frame = renderer.render(shown, outputs=("depth", "normal"))
    known = truth(shown, size=size, outputs=("depth", "normal"))
    footprint = shown.pose(set_values({}, {}, 0.0)).pixel(size[1]) * FOOTPRINT

    hit = np.isfinite(frame.depth)
    assert hit.sum() >= 10, "nothing to see"
    places = known.position + frame.depth[hit][:, None] * known.direction[hit]
    above = np.abs(node.distance(places)) / (footprint * frame.depth[hit])
    if node.exactness == "estimate":  # may be positive everywhere; then it is where it is small that a hit is
        assert np.mean(above > 4.0) <= 0.02
        assert np.mean(known.hit & ~hit) <= 0.01
        return
    assert above.max() <= 1.0, "hits in the air"

    found = compare(frame.depth, frame.normal, known)
    assert (found.missed_hits, found.false_hits) == (0, 0)
    both = known.hit & hit & ~silhouettes(known)
    facing = np.abs(np.einsum("ij,ij->i", known.direction[both], known.normal[both]))
    off = np.abs(frame.depth[both] - known.depth[both]) * facing / (footprint * known.depth[both])
    assert np.all(off <= 1.0), f"off by up to {off.max():.3g} of a pixel's {FOOTPRINT}"
    turned = np.degrees(angles(frame.normal[both], known.normal[both])) > 2.0
    assert turned.sum() <= max(3, 0.01 * turned.size)  # the two sides of a sliver, a crease within a pixel


def angles(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Between vectors, in radians."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.einsum("ij,ij->i", a, b))
