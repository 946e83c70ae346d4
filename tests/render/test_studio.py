"""What a picture of a bare node shows: a studio, well exposed, that touches no other scene."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import raymarch as rm
from raymarch.scene.scene import scene_of
from raymarch.scene.studio import CLAY, GROUND, staged

SIZE = (64, 36)


def test_a_bare_node_stands_on_a_ground_in_its_shadow() -> None:
    made = staged(scene_of(rm.sphere()))
    assert {CLAY, GROUND} <= {*made.materials} and made.node.distance((5, -1.0, 5)) == 0.0
    picture = np.asarray(rm.render(rm.sphere(), SIZE)).astype(float) / 255
    assert np.mean(picture.max(axis=-1) > 0.95) < 0.01 and np.mean(picture.max(axis=-1) < 0.05) < 0.01
    ground = picture[-3:, 2:].mean(axis=-1)
    assert ground.min() < 0.7 * ground.max(), "no shadow on the ground"


def test_what_is_stated_is_not_staged() -> None:
    scene = rm.Scene(rm.sphere(), lights=[])
    assert staged(scene) is scene
    red = rm.Material(color="red")
    assert CLAY not in staged(scene_of(rm.sphere().material(red) | rm.box())).materials


def test_an_endless_solid_is_cut_with_a_word() -> None:
    with pytest.warns(rm.SceneWarning, match="has no end: the picture shows a cube"):
        made = staged(scene_of(rm.sphere(0.3).repeat(1)))
    assert made.subject is not None and made.subject.size.max() > 3


def test_a_bent_solid_gives_no_doubt_about_light_that_nobody_asked_for() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rm.render(rm.box((0.7, 2.4, 0.7)).twist(1.2), SIZE)
