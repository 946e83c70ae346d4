"""Plans for devices that skip branches: one part is evaluated at a hit, and the picture is the same."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import raymarch as rm
from raymarch.export import export
from raymarch.export.sequence import Contents, Item
from raymarch.export.stills import Shot
from raymarch.expr.branches import branched, leaves
from raymarch.expr.walk import find
from raymarch.gpu.context import open_context
from raymarch.gpu.prepare import prepare
from raymarch.plan.device import FORCED, HARDWARE, SOFTWARE, device_class
from raymarch.scene import load
from tests.lab.gpu_compiler import EXAMPLES

pillar = rm.union(rm.box((0.5, 1.6, 0.5)).round(0.05), rm.torus(0.45, 0.1).translate((0, 0.8, 0)), k=0.1)
checks = rm.checker((1, 0.2, 0.1), (0.1, 0.2, 1), 0.3)
SOLID = rm.union(
    rm.plane(offset=-0.9),
    pillar.translate((-1.2, 0, 0)).material(rm.Material(color=checks)),
    pillar.rotate(0.4, "y").translate((1.2, 0, 0.3)).material(rm.Material(color=(0.2, 0.8, 0.3))),
    rm.link(0.3, 0.4, 0.12).rotate(0.7, "x").material(rm.Material(color=(0.9, 0.7, 0.1))),
    rm.icosahedron(0.4).translate((0, 1, -1)).twist(1.5),
)
SCENE = rm.Scene(SOLID, lights=[rm.Sun(shadow=True)])
CLEAR = rm.Material(transmission=1, ior=1.5)
FILM = rm.Material(albedo=(0.2, 0.5, 0.2), roughness=0.05, transmission=0.5, ior=1.3, emission=(0.1, 0, 0))
GLASS = rm.Scene(
    rm.union(
        rm.sphere(0.7).translate((-0.6, 0, 0)).material(CLEAR),
        rm.box((0.9, 0.9, 0.9)).rotate(0.6, "y").translate((0.8, 0, 0)).material(FILM),
        rm.plane(offset=-0.8).material(rm.Material(color=checks, roughness=0.03)),
    ),
    lights=[rm.SphereLight((0, 2, -1), radius=0.3, visible=True), rm.Sun(shadow=True)],
    sky=rm.GradientSky(light=True),
    bounces=4,
    quality=rm.Quality(integrator="whitted"),
)

LAMPS = [rm.PointLight((x, 2, 1), shadow=True, radius=0.1) for x in (-1, 1)]
GLOSSY = rm.Scene(
    rm.sphere(0.6).material(rm.Material(albedo=(0.8, 0.6, 0.3), roughness=0.3))
    | rm.plane(offset=-0.6).material(rm.Material(albedo=(0.3, 0.3, 0.3), roughness=0.6)),
    lights=[rm.SphereLight((1, 2, 1), radius=0.4, shadow=True)],
    sky=rm.GradientSky(light=True),
)
SCENES = {"union": SCENE, "tree of rays": GLASS, "lamps": SCENE.replace(lights=LAMPS), "glossy": GLOSSY}


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_pictures_of_both_classes_are_the_same_on_a_software_driver(scene, monkeypatch):
    drawn = []
    for name in ("software", "hardware"):
        monkeypatch.setenv(FORCED, name)
        with rm.Renderer((64, 36)) as renderer:
            frame = renderer.render(scene, outputs=("color", "normal", "material"))
            assert renderer.prepared(scene).plan.device.name == name
            drawn.append((frame.color, frame.normal, frame.material))
    for one, other in zip(*drawn, strict=True):
        assert np.array_equal(one, other)


@pytest.fixture(scope="module")
def village():
    return {device: prepare(load(EXAMPLES / "village.py"), device=device) for device in (SOFTWARE, HARDWARE)}


def test_parts_are_evaluated_in_branches_of_their_own(village):
    part = part_at(village[HARDWARE])
    assert len(re.findall(r"if \(.*{\n", part)) == 4
    for block in re.split(r"    }\n", part):
        assert len(re.findall(r"= union_part\d*\(", block)) <= 1, block
    assert "if (" not in part_at(village[SOFTWARE]) and "u_unseen" not in village[SOFTWARE].texts["color"]


def test_parts_that_call_the_same_function_share_a_branch(village):
    """Seven houses of four kinds."""
    called = re.findall(r"= (union_part\d*)\(", part_at(village[HARDWARE]))
    assert len(called) == len(set(called)) == 4


def test_functions_of_the_march_have_no_branches(village):
    made = village[HARDWARE].plan
    assert branched(made.field) is None
    tree = branched(made.material)
    assert tree is not None and len(list(leaves(tree))) == 5
    assert not any(find([leaf.values[0]], "stop_gradient") for leaf in leaves(tree))


def test_no_ray_of_a_tree_waits_in_an_array_on_hardware():
    texts = {device: prepare(GLASS, device=device).texts["color"] for device in (SOFTWARE, HARDWARE)}
    assert "Branch waiting[4]" in texts[SOFTWARE] and "Branch waiting" not in texts[HARDWARE]


def test_lights_are_not_kept_while_shadows_are_traced():
    texts = {d: prepare(SCENE.replace(lights=LAMPS), device=d).texts["color"] for d in (SOFTWARE, HARDWARE)}
    again = re.findall(r"Light (light_\d) = \w+\(surface.p \+ u_unseen", texts[HARDWARE])
    kept = {device: text.count(" = light;") for device, text in texts.items()}
    assert again == ["light_0", "light_1"] and kept == {SOFTWARE: 2, HARDWARE: 0}


def test_what_light_has_computed_is_not_kept_while_shadows_are_traced():
    texts = {d: prepare(GLOSSY, device=d).texts["color"] for d in (SOFTWARE, HARDWARE)}
    forgotten = {device: text.count("roughness += u_unseen") for device, text in texts.items()}
    assert forgotten[SOFTWARE] == 0 < forgotten[HARDWARE]


def part_at(ready):
    found = re.search(r"(?ms)^Part part_at\(.*?^}", ready.texts["color"])
    assert found is not None
    return found[0]


def test_the_environment_decides_the_class(monkeypatch):
    assert device_class(is_software=True) is SOFTWARE and device_class(is_software=False) is HARDWARE
    assert HARDWARE.rolls and not SOFTWARE.rolls
    monkeypatch.setenv(FORCED, "gpu")
    with pytest.raises(rm.PlanError, match=f"{FORCED}.gpu.*software, hardware"):
        device_class()


def test_exports_are_planned_for_hardware(tmp_path):
    export(SCENE, tmp_path / "scene.glsl")
    text = (tmp_path / "scene.glsl").read_text()
    assert "#define u_unseen" in text and "uniform float u_unseen" not in text


def test_the_hash_of_a_picture_does_not_depend_on_the_class(monkeypatch, tmp_path):
    """A client that draws nothing names the pictures that the GPUs of its workers draw."""
    shot = Shot((16, 9))
    item = Item("frame 0", 0.0, tmp_path / "a.png", shot.size)
    with open_context() as context:
        monkeypatch.setattr(context, "driver", replace(context.driver, is_software=False))
        renderer = rm.Renderer(shot.size, context=context)
        assert renderer.prepared(SCENE).plan.device is HARDWARE
        assert Contents(SCENE, shot, renderer).of(item) == Contents(SCENE, shot).of(item) is not None
