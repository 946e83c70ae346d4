"""A picture of every definition of the package, held against the float64 tracer: see `tests/sdf/node_samples.py`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import raymarch as rm

sys.path.insert(0, str(Path(__file__).parents[1] / "sdf"))
from node_samples import NodeSample, samples

SIZE = (48, 36)
FIRST = {sample.definition.name: sample for sample in reversed(samples())}


def shown(node: rm.Node) -> rm.Node:
    """Flat shapes get a thickness, endless ones an end."""
    if node.label is not None:
        node = node.children[0].material(rm.Material())
    if node.dimension == 2:
        node = node.extrude(0.3)
    return node if node.facts.bounded else node & rm.box(2.4)


def truth_of(scene: rm.Scene) -> rm.Truth:
    return rm.truth(scene, size=SIZE)


@pytest.mark.parametrize("sample", FIRST.values(), ids=FIRST)
def test_the_picture_is_the_truth(sample: NodeSample, renderer: rm.Renderer) -> None:
    node = shown(sample.build())
    rough = node.exactness == "estimate"
    scene = rm.Scene(node, quality=rm.Quality(epsilon=0.002, max_steps=8192))
    renderer.resize(SIZE)
    if rough and np.all(truth_of(scene).depth == np.inf):  # positive everywhere: seen from half a pixel's width on
        assert np.isfinite(renderer.render(rm.Scene(node), outputs=("depth",)).depth).sum() > 20
        return
    frame, truth = renderer.render(scene, outputs=("depth", "normal")), truth_of(scene)
    both = np.isfinite(frame.depth) & np.isfinite(truth.depth)
    assert both.sum() > 20, "hardly anything is seen"
    pixel = 2.0 * np.tan(np.radians(scene.camera.fov.data) / 2.0) / SIZE[1]
    off = np.abs(frame.depth[both] - truth.depth[both]) / (pixel * truth.depth[both])  # in widths of a pixel
    missed = np.mean(np.isfinite(frame.depth) != np.isfinite(truth.depth))
    if rough:  # where its surface is, depends on the last bit in places
        assert missed <= 0.05
        assert np.median(off) < 0.1
        return
    assert missed <= 0.01
    assert np.mean(off > 0.02) <= 0.01
    turned = np.linalg.norm(frame.normal[both] - truth.normal[both], axis=-1)
    assert np.mean(turned > 0.02) <= 0.03
