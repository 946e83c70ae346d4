"""Silhouettes nearer than a pixel."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import raymarch as rm
from raymarch.truth import Truth, silhouettes
from raymarch.truth.near_edges import silhouettes_within

SIZE = (48, 27)
SCENE = rm.Scene(rm.gyroid() & rm.sphere(2))


@pytest.fixture(scope="module")
def known() -> Truth:
    return rm.truth(SCENE, SIZE, outputs=("normal", "material"))


def test_at_one_pixel_it_is_the_usual_rule(known, monkeypatch):
    monkeypatch.setattr(
        sys.modules[silhouettes_within.__module__], "AT_ONCE", 100
    )  # blocks of several batches fit together
    inner = np.zeros(known.hit.shape, np.bool_)
    inner[2:-2, 2:-2] = True  # at the picture's border the usual rule has no pixels beyond to look at
    assert np.array_equal(silhouettes_within(SCENE, inner, 1.0), silhouettes(known) & inner)


def test_a_straight_edge_counts_by_its_distance():
    """The edge of a wall that covers the left of the picture, at 0.3 pixels from the middles of its last column."""
    width, height = 10, 6
    pixel = 2.0 * np.tan(np.radians(30) / 2) / height
    wall = rm.box((100, 100, 1)).translate((-50 + 0.3 * pixel * 5, 0, -0.5))
    scene = rm.Scene(wall, camera=rm.Camera(position=(0, 0, 5), target=(0, 0, 0), fov=30))
    asked = np.ones((height, width), np.bool_)
    middles = (np.arange(width) + 0.5 - width / 2) * pixel * 5
    apart = np.abs(middles - 0.3 * pixel * 5) / (pixel * 5)
    for spacing in (0.9, 0.25, 0.1):
        found = silhouettes_within(scene, asked, spacing)
        assert np.array_equal(found[3], apart < spacing), spacing


def test_only_what_is_asked_is_looked_at(known):
    asked = np.zeros(known.hit.shape, np.bool_)
    assert not silhouettes_within(SCENE, asked, 0.25).any()
    asked[10, 20] = True
    assert silhouettes_within(SCENE, asked, 0.25).sum() <= 1
