"""Functions and values are named after the scene file's variables."""

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


def test_a_repeated_subtree_is_one_function_named_after_its_variable(tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    file.write_text(FILE)
    text = assemble(plan(load(file))).text()
    assert text.count("float barn(vec3 p) {") == 1 and text.count("Part barn_part(vec3 p) {") == 1
    assert text.count("barn_part(") == 2, "one call, at the point of the copy that is nearer"
    assert "vec4 wall = box_gradient(" in text and "vec4 roof = sphere_gradient(" in text


def test_equal_subtrees_of_a_function_are_named_after_it(tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    file.write_text(
        FILE.replace("barn = shed(0.5)", "barn = rm.torus(1, 0.2)").replace("0.7", "0.5")
        + "scene = shed(0.5) | shed(0.5).translate((3, 0, 0))"
    )
    text = assemble(plan(load(file))).text()
    assert "float shed(vec3 p) {" in text and "Part shed_part(vec3 p) {" in text


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
