"""Functions and values are named after definitions: the text depends on the values of the scene alone."""

from __future__ import annotations

from pathlib import Path

import raymarch as rm
from raymarch.plan import plan
from raymarch.scene.file import load
from raymarch.shader import assemble

FILE = """
import raymarch as rm

def shed(size):
    wall = rm.box((size, 1, 1)).material(rm.Material(color=(0.8, 0.2, 0.2)))
    roof = rm.sphere(size).translate((0, 0.6, 0)).material(rm.Material(color=(0.2, 0.2, 0.8)))
    return wall | roof

barn = shed(0.5)
scene = rm.Scene(barn.rotate(0.3) | barn.translate((2, 0, 0)) | shed(0.7).translate((0, 0, 3)) | rm.plane(offset=-1))
"""


def test_functions_and_values_are_named_after_their_definitions(tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    file.write_text(FILE)
    text = assemble(plan(load(file))).text()
    assert text.count("float union_field(vec3 p) {") == 1 and text.count("Part union_part(vec3 p) {") == 1
    assert text.count("union_part(") == 2, "one call, at the point of the copy that is nearer"
    assert "vec4 box2 = box_gradient(" in text and "vec4 sphere2 = sphere_gradient(" in text


def test_variables_functions_and_lines_of_the_user_leave_the_text_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    file.write_text(FILE)
    text = assemble(plan(load(file))).text()
    renamed = FILE.replace("wall", "left").replace("shed", "house").replace("barn", "ground")
    file.write_text(
        renamed.replace(" | ", " |").replace("(barn", "(\n\nbarn").replace("scene = rm.Scene(", "scene = (")
    )
    assert assemble(plan(load(file))).text() == text


def test_materials_of_a_repeated_subtree_are_those_of_its_parts() -> None:
    red, blue = rm.Material(color=(1, 0, 0)), rm.Material(color=(0, 0, 1))
    pair = rm.sphere(0.5).material(red) | rm.box((0.4, 0.4, 0.4)).translate((1, 0, 0)).material(blue)
    scene = rm.Scene(pair.rotate(0.3) | pair.translate((0, 3, 0)), lights=[rm.Sun()])
    with rm.Renderer(size=(48, 64)) as renderer:
        frame = renderer.render(scene, outputs=("color", "material"))
        seen, color = frame.material, frame.color
    for index, channel in ((scene.materials.index(red), 0), (scene.materials.index(blue), 2)):
        of_it = color[seen == index]
        assert len(of_it) > 20 and bool((of_it[:, channel] >= of_it.max(axis=1) - 1e-6).all())
