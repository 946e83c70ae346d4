"""Edits of lights, materials and quality: what they draw, and that their Python says the same."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.context import Context
from raymarch.gpu.renderer import Renderer
from raymarch.scene.file import load
from raymarch.window import edits
from raymarch.window.edits import Edits

SIZE = (48, 32)
RED = rm.Material(color=(0.8, 0.1, 0.1))


def scene() -> rm.Scene:
    return rm.Scene(
        rm.sphere().material(RED) | rm.box((4, 0.2, 4)).translate((0, -1, 0)),
        camera=rm.Camera((2, 2, 4), (0, 0, 0)),
        lights=[
            rm.Sun((1, 2, 1), shadow=True),
            rm.PointLight((-2, 2, 2), color=(0.2, 0.4, 0.9), intensity=5, range=9),
            rm.SpotLight((0, 4, 0), half_angle=0.4, intensity=9),
            rm.SphereLight((2, 3, 2), radius=0.4, intensity=3, shadow=True),
        ],
    )


@pytest.fixture
def renderer(egl: Context) -> Iterator[Renderer]:
    with Renderer(SIZE, context=egl) as made:
        yield made


def close(a: Any, b: Any) -> bool:
    return bool(np.allclose(a, b, atol=2e-3))


def test_no_edits_are_the_scene_itself() -> None:
    made = scene()
    assert Edits().apply(made) is made and Edits().empty


def test_lights_taken_over_look_the_same(renderer: Renderer) -> None:
    made = scene()
    taken = Edits(lights=edits.editable_lights(made))
    assert close(renderer.render(taken.apply(made)).color, renderer.render(made).color)


def test_moving_a_light_compiles_nothing(renderer: Renderer) -> None:
    made = scene()
    edited = Edits(lights=edits.editable_lights(made)).apply(made)
    before = renderer.render(edited).color
    compiled = renderer.compiled
    after = renderer.render(edited, params={"light 2 intensity": 50.0, "light 1 sun_direction": (0.1, 1.0, 0.2)}).color
    assert renderer.compiled == compiled and not close(before, after)


def test_a_material_is_exchanged_where_it_is(renderer: Renderer) -> None:
    made = scene()
    values = edits.editable_material(RED)
    green = {**values, "color": (0.1, 0.8, 0.1)}
    edited = Edits(materials={1: green}).apply(made)
    expected = rm.Scene(
        rm.sphere().material(rm.Material(color=(0.1, 0.8, 0.1))) | rm.box((4, 0.2, 4)).translate((0, -1, 0)),
        made.camera,
        made.lights,
    )
    assert close(renderer.render(edited).color, renderer.render(expected).color)
    moved = renderer.render(edited, params={"material 1 color": values["color"]}).color
    assert close(moved, renderer.render(made).color)
    assert edited.node.where == made.node.where


def test_the_default_material_can_be_edited(renderer: Renderer) -> None:
    made = scene()
    values = {**edits.editable_material(made.materials[0]), "color": (0.0, 0.0, 0.9)}
    picture = renderer.render(Edits(materials={0: values}).apply(made))
    floor = picture.color[-4:, 20:28].reshape(-1, 3).mean(axis=0)
    ball = picture.color[14:16, 23:25].reshape(-1, 3).mean(axis=0)
    assert floor[2] > 3 * floor[0] and ball[0] > ball[2] / 2


@pytest.mark.parametrize("kind", list(edits.KINDS))
def test_a_new_light_of_every_kind_lights(renderer: Renderer, kind: str) -> None:
    made = rm.Scene(rm.sphere(), rm.Camera((2, 2, 4), (0, 0, 0)), lights=[])
    lit = Edits(lights=(edits.new_light(kind, 1, made),)).apply(made)
    assert renderer.render(lit).color.max() > renderer.render(made).color[16, 24].max() + 0.1


def test_the_python_of_edits_draws_the_same(renderer: Renderer) -> None:
    made = scene()
    lights = edits.editable_lights(made)
    lights = (lights[0].with_value("shadow", False), *lights[1:3])
    edited = Edits(lights, {1: edits.editable_material(RED)}, {"normals": "central"})
    params: dict[str, Any] = {"light 2 intensity": 2.5, "material 1 color": (0.3, 0.3, 0.1)}
    names: dict[str, Any] = {"rm": rm, "scene": made}
    exec(edited.python(made, params), names)
    node = rm.sphere().material(names["material_1"]) | rm.box((4, 0.2, 4)).translate((0, -1, 0))
    written = names["scene"].replace(node=node)
    assert len(written.lights) == 3 and written.quality.normals == "central"
    shown = renderer.render(edited.apply(made), params=params).color
    assert close(shown, renderer.render(written).color)


def test_an_expression_stays_one() -> None:
    made = rm.Scene(rm.sphere(), lights=[rm.Sun(intensity=1 + rm.time)])
    edited = Edits(lights=edits.editable_lights(made)).apply(made)
    assert edited.lights[0].intensity is made.lights[0].intensity
    names: dict[str, Any] = {"rm": rm, "scene": made}
    exec(Edits(lights=edits.editable_lights(made)).python(made, {}), names)
    assert names["scene"].lights[0].intensity is made.lights[0].intensity


def test_an_edited_material_keeps_its_maps_and_glass() -> None:
    rough = rm.Material(
        albedo=rm.checker((0.2, 0.2, 0.2), (0.8, 0.8, 0.8), 1.0),
        roughness=0.4,
        transmission=0.5,
        ior=1.3,
        height=rm.triplanar(np.eye(4), 1.0),
    )
    scene = rm.Scene(rm.sphere().material(rough))
    edited = Edits(materials={1: {**edits.editable_material(rough), "roughness": 0.7}}).apply(scene)
    (made,) = edited.materials[1:]
    assert made.transmits and made.relief and made.color is rough.color
    assert made.roughness is not rough.roughness


def test_the_python_of_an_edited_glass_is_glass() -> None:
    glass = rm.Material(transmission=0.8, ior=1.4, absorption=(0.1, 0.2, 0.3), roughness=0.2)
    scene = rm.Scene(rm.sphere().material(glass))
    text = Edits(materials={1: {**edits.editable_material(glass), "roughness": 0.3}}).python(scene, {})
    made = eval(text.partition("=")[2].partition("  #")[0], {"rm": rm})
    assert made == glass.replace(roughness=0.3)


def test_the_python_of_a_light_names_its_penumbra() -> None:
    (light,) = edits.editable_lights(
        rm.Scene(rm.sphere(), lights=[rm.Sun(shadow=True, softness=0.1, penumbra="sampled")])
    )
    assert "penumbra='sampled'" in light.python({})


def test_the_python_of_edits_runs_at_the_end_of_a_file_with_a_bare_node(tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    file.write_text("import raymarch as rm\nscene = rm.sphere()\n")
    base = load(file)
    lights = tuple(
        light.with_value("softness" if light.kind == "Sun" else "radius", 0.2) for light in edits.editable_lights(base)
    )
    edited = Edits(lights, {0: edits.editable_material(base.materials[0])}, {"max_steps": 99})
    with file.open("a") as out:
        out.write(edited.python(base, {"material 0 specular": 0.5}) + "\n")
    made = load(file)
    assert made.quality.max_steps == 99 and made.lights[0].soft
    assert "material_0 = rm.Material(" in file.read_text() and "specular=0.5" in file.read_text()
