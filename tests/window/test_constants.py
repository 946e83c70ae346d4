"""Edited numbers become uniforms: nothing is compiled for the next edit, and the picture is the baked one."""

from __future__ import annotations

import json

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.prepare import prepare
from raymarch.window.constants import MOST, Constants, parsed

CAMERA = rm.Camera((1, 2, 4), (0, 0, 0))
SIZE = (96, 60)


def scene_of(radius: float, red: float = 0.8) -> rm.Scene:
    ball = rm.sphere(radius).material(rm.Material(color=(red, 0.2, 0.1)))
    return rm.Scene(ball | rm.box((4, 0.25, 4)).translate((0, -1.1, 0)), CAMERA, lights=[rm.Sun(shadow=True)])


def test_numbers_that_differ_become_uniforms_and_others_stay() -> None:
    before = parsed("#version 330 core\nfloat f(float x) {\n    return 2.0 * x + 3.5;\n}\n")
    after = parsed("#version 330 core\nfloat f(float x) {\n    return 2.0 * x + 4.5e-3;\n}\n").changed(before)
    assert after.glsl() == (
        "#version 330 core\nuniform float u_number_1; float f(float x) {\n    return 2.0 * x + u_number_1;\n}\n"
    )
    assert after.values == {"u_number_1": 4.5e-3}


@pytest.mark.parametrize(
    "text",
    [
        "const float a = {};\nvoid main() {{ }}",  # outside of a function
        "void main() {{\n    const float a = 2.0 * {};\n}}",
        "void main() {{\n    const vec2 a[2] = vec2[](vec2(0.0),\n        vec2({}));\n}}",
        "void main() {{\n#define A {}\n}}",
        "void main() {{ float a = {}f; }}",  # a form that is left alone
    ],
)
def test_what_must_be_a_constant_stays_one(text: str) -> None:
    before, after = (parsed("#version 330 core\n" + text.format(number)) for number in ("1.0", "2.0"))
    assert after.changed(before).glsl() == "#version 330 core\n" + text.format("2.0")


def test_another_structure_and_too_many_numbers_are_baked() -> None:
    one = parsed("void main() { a = 1.0; }")
    assert not parsed("void main() { b = 2.0; }").changed(one).free
    assert not parsed("void main() { a = -2.0; }").changed(one).free
    many = [parsed(f"void main() {{ f({', '.join([number] * (MOST + 1))}); }}") for number in ("1.0", "2.0")]
    assert not many[1].changed(many[0]).free


@pytest.mark.parametrize("schedule", ["single", "cones"])
def test_a_number_that_is_edited_again_compiles_nothing_and_shows_the_same_picture(schedule: str) -> None:
    constants = Constants()
    compiled = []
    with rm.Renderer(SIZE) as renderer, rm.Renderer(SIZE) as other:
        for radius, red in ((0.7, 0.8), (0.75, 0.8), (0.9, 0.8), (0.8, 0.8), (0.8, 0.3), (0.9, 0.6)):
            scene = scene_of(radius, red).replace(quality=rm.Quality(schedule=schedule))
            for_trial = Constants(json.loads(json.dumps(constants.as_json())))
            ready, fresh = constants.fit(prepare(scene, size=SIZE))
            assert for_trial.fit(prepare(scene, size=SIZE))[0].texts == ready.texts
            renderer.adopt(scene, ready)
            before = renderer.compiled
            seen = renderer.render(scene)
            compiled.append(renderer.compiled > before)
            assert compiled[-1] == fresh
            apart = np.abs(seen.color - other.render(scene).color).max(axis=-1)
            assert np.mean(apart > 1 / 255) < 2e-3, (radius, red)
    assert compiled == [True, True, False, False, True, False]
