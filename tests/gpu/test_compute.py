"""Passes drawn by compute shaders: the texels of fragment shaders, in tiles, with errors on the user's line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import DeviceError, ShaderError
from raymarch.gpu import compute
from raymarch.gpu.compute import as_compute, draws_by, why_drawn_so
from raymarch.gpu.context import Context, open_context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target
from raymarch.scene import load

EXAMPLES = Path(__file__).parents[2] / "examples"
TWO = """#version 330 core
layout(location = 0) out vec4 place;
layout(location = 1) out vec4 scaled;
uniform float k;
uniform sampler2D picture;
void main() {
    place = vec4(gl_FragCoord.xy, texelFetch(picture, ivec2(gl_FragCoord.xy) % 2, 0).xy);
    if (place.x > 4.0) return;
    scaled = k * place;
}
"""


@pytest.fixture
def computing(monkeypatch: pytest.MonkeyPatch) -> Iterator[Context]:
    monkeypatch.setenv(compute.DRAW_VARIABLE, "compute")
    with open_context("egl") as context:
        if draws_by(context) != "compute":
            pytest.skip(why_drawn_so(context))
        yield context


def test_a_software_renderer_draws_by_fragments(egl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(compute.DRAW_VARIABLE, raising=False)
    if egl.driver.is_software:
        assert draws_by(egl) == "fragment" and "CPU" in why_drawn_so(egl)


def test_the_trial_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(compute.DRAW_VARIABLE, raising=False)
    for times, way in (((24.0, 1.0), "compute"), ((1.2, 1.0), "fragment")):
        with open_context("egl") as context:
            context.driver = replace(context.driver, is_software=False)
            monkeypatch.setattr(compute, "_DECIDED", {})
            monkeypatch.setattr(compute, "_trial", lambda context, times=times: times)
            assert compute._decided(context)[0] == way or context.gl.version_code < 430
            monkeypatch.setattr(compute, "_trial", lambda context: (1.0, 0.0))  # known by now
            assert compute._decided(context)[0] == way or context.gl.version_code < 430


def test_the_trial_measures_both(egl: Context) -> None:
    if egl.gl.version_code >= 430:
        with egl.bound():
            assert all(time > 0 for time in compute._trial(egl))


def test_the_variable_is_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(compute.DRAW_VARIABLE, "cuda")
    with open_context("egl") as context, pytest.raises(DeviceError, match=r"RAYMARCH_DRAW_BY='cuda'.*fragment or comp"):
        draws_by(context)


def test_tiles_textures_and_two_outputs(computing: Context) -> None:
    """A tile writes its own texels only; an early return stores what was set."""
    with (
        Program(computing, FULL_SCREEN, TWO, None, "two") as program,
        Target(computing, (11, 9), 2) as target,
        Target(computing, (2, 2)) as picture,
    ):
        assert program._fragment is None and set(program.uniforms) == {"k", "picture"}
        picture.write(np.float32([[[1, 2, 0, 0], [3, 4, 0, 0]], [[5, 6, 0, 0], [7, 8, 0, 0]]]))
        for attachment in (0, 1):
            target.write(np.full((9, 11, 4), -1, np.float32), attachment)
        program.draw(target, {"k": 3.0, "picture": picture}, (2, 1, 7, 5))
        place, scaled = target.read(0)[::-1], target.read(1)[::-1]
    inside = np.zeros((9, 11), bool)
    inside[1:6, 2:9] = True
    assert np.all(place[~inside] == -1) and np.all(scaled[~inside] == -1)
    y, x = np.nonzero(inside)
    assert np.array_equal(place[inside][:, :2], np.stack([x, y], 1) + 0.5)
    assert place[1, 2].tolist() == [2.5, 1.5, 1, 2] and place[2, 3].tolist() == [3.5, 2.5, 7, 8]
    assert np.array_equal(scaled[1:6, 2:4], 3 * place[1:6, 2:4])


def test_a_blend_draws_by_fragments(computing: Context) -> None:
    with Program(computing, FULL_SCREEN, TWO, None, "two") as program, Target(computing, (4, 4), 2) as target:
        program.draw(target, {"k": 1.0}, blend=True)
        assert program._fragment is not None


def test_a_refused_text_names_its_line(computing: Context) -> None:
    text = TWO.replace("scaled = k * place;", "scaled = k * nothing;")
    with pytest.raises(ShaderError, match=r"line 9.*made by line 9.*nothing"):
        Program(computing, FULL_SCREEN, text, lambda line: (f"line {line}", None), "two")


@pytest.mark.parametrize(
    "text",
    [
        "out vec4 color; void main() { color = vec4(1.0); }",
        TWO.replace("if (place.x > 4.0) return;", "if (place.x > 4.0) discard;"),
        TWO.replace("uniform float k;", "in vec3 ray_direction;\nuniform float k;"),
        TWO.replace("scaled = k * place;", "scaled = dFdx(place);"),
        TWO.replace("out vec4 scaled;", "out vec4 scaled[2];"),
        TWO.replace("void main()", "void other()"),
    ],
    ids=["no location", "discard", "varying", "derivative", "array", "no main"],
)
def test_what_only_a_fragment_shader_can_do(text: str) -> None:
    assert as_compute(TWO) is not None and as_compute(text) is None


@pytest.mark.parametrize("name", ["hello", "papers/glass", "textures", "papers/lights"])
def test_pictures_are_the_same(computing: Context, name: str) -> None:
    """Bit for bit on a software renderer, with passes of cones and samples, and with all arrays."""
    scene, outputs = load(EXAMPLES / f"{name}.py"), ("color", "depth", "normal", "evaluations")
    with rm.Renderer((48, 27), context=computing) as renderer:
        found = renderer.render(scene, outputs=outputs)
        computing.kept["draws"] = ("fragment", "for comparison")
        with rm.Renderer((48, 27), context=computing) as other:
            known = other.render(scene, outputs=outputs)
            for array in outputs:
                if computing.driver.is_software:
                    assert np.array_equal(found.array(array), known.array(array), equal_nan=True), array
                else:
                    assert np.mean(np.abs(found.array(array) - known.array(array)) > 1e-3) < 0.01, array


def test_a_driver_that_refuses_compute_shaders(computing: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(self: object, context: Context, text: str) -> None:
        raise moderngl.Error("no")

    monkeypatch.setattr(compute.Dispatch, "__init__", refused)
    with Program(computing, FULL_SCREEN, TWO, None, "two") as program, Target(computing, (4, 4), 2) as target:
        program.draw(target, {"k": 2.0})
        assert np.array_equal(target.read(1)[..., 0], 2 * target.read(0)[..., 0])
