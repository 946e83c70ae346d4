"""What a picture of a bare node shows: a studio, well exposed, that touches no other scene."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import raymarch as rm
from raymarch.export import notebook
from raymarch.scene.scene import scene_of
from raymarch.scene.studio import CLAY, GROUND, staged
from raymarch.window import reload
from raymarch.window.edits import Edits
from tests.export.test_shaders import page

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


def test_the_studio_is_a_scene_to_start_from() -> None:
    solid = rm.torus()
    made = rm.studio(solid)
    assert made == staged(scene_of(solid)) and staged(made) is made
    assert made.replace(lights=[]).lights == () and made.where == solid.where
    for wrong in (3, made, rm.circle()):
        with pytest.raises(rm.SceneError):
            rm.studio(wrong)


def test_windows_pages_and_pictures_show_the_same(tmp_path: Path) -> None:
    file = tmp_path / "ball.py"
    file.write_text("import raymarch as rm\nscene = rm.sphere()\n")
    loaded = reload._loaded(file, 60.0)
    assert loaded == staged(scene_of(rm.sphere())) == notebook.as_scene(rm.sphere())
    _, data = page(rm.sphere(), tmp_path)
    assert str(GROUND.color.data[0]) in data["shader"]


def test_edits_of_a_solid_alone_are_lines_that_run() -> None:
    base = staged(scene_of(rm.sphere()))
    lines = Edits(quality={"samples": 2}).python(base, {})
    names = {"rm": rm, "scene": rm.sphere()}
    exec(lines, names)
    assert names["scene"] == base.replace(quality=base.quality.replace(samples=2))


def test_an_endless_solid_is_cut_with_a_word() -> None:
    with pytest.warns(rm.SceneWarning, match="has no end: the picture shows a cube"):
        made = staged(scene_of(rm.sphere(0.3).repeat(1)))
    assert made.subject is not None and made.subject.size.max() > 3


@pytest.mark.parametrize(("solid", "radius", "period"), [(rm.sphere(0.3), 0.3, 1.0), (rm.box(5), 2.5, 8.0)])
def test_the_copies_of_an_endless_solid_stay_whole(solid: rm.Node, radius: float, period: float) -> None:
    """The cube ends between two copies."""
    edge = rm.Scene(solid.repeat(period)).framed.cube  # type: ignore[union-attr]
    within = (0.5 * edge + 0.5 * period) % period - 0.5 * period
    assert edge > 2 * period and abs(within) > radius, edge


def test_a_bent_solid_gives_no_doubt_about_light_that_nobody_asked_for() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rm.render(rm.box((0.7, 2.4, 0.7)).twist(1.2), SIZE)
