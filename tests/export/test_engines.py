"""Shaders for game engines and three.js draw the picture of the renderer."""

from __future__ import annotations

import json
import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import PlanError
from raymarch.gpu import Renderer
from raymarch.scene import load
from tests.export.test_shaders import EXAMPLES, SCENES, compare, drawn, picture
from tests.support import chromium
from tests.support.engines import PAGE, RESERVED, STUB, godot_as_glsl, godot_faults
from tests.support.required import glslang
from tests.support.wgsl_device import Device


def text_of(folder: Path, scene: Any, suffix: str, **options: Any) -> str:
    rm.export(scene, folder / f"made{suffix}", **options)
    return (folder / f"made{suffix}").read_text()


@pytest.mark.parametrize("name", SCENES)
def test_a_shader_for_godot_draws_the_picture(name: str, renderer: Renderer, tmp_path: Path) -> None:
    text = text_of(tmp_path, SCENES[name], ".gdshader", time=0.4)
    assert godot_faults(text) == []
    found = drawn(renderer, godot_as_glsl(text), {"host_size": (64, 48), "TIME": 0.2})
    moving = "uniform float start" in text
    compare(found, picture(renderer, SCENES[name], 0.6 if moving else 0.4))


def test_inputs_of_godot(renderer: Renderer, tmp_path: Path) -> None:
    text = text_of(tmp_path, SCENES["parameters"], ".gdshader")
    assert "uniform float u_size : hint_range(0.5, 2.0, 0.0015) = 1.0;" in text.splitlines()
    assert "uniform vec3 u_tint = vec3(0.9, 0.2, 0.1);" in text.splitlines()
    names = set(re.findall(r"^\w[\w ]* (\w+)(?: [:=].*)?[;(]", text, re.MULTILINE))
    assert not names & (RESERVED - {"fragment", "start", "canvas_item"})
    given = {"host_size": (64, 48), "u_size": 1.4, "playing": False, "start": 0.8, "TIME": 5.0}
    compare(drawn(renderer, godot_as_glsl(text), given), picture(renderer, SCENES["parameters"], 0.8, {"size": 1.4}))
    linear = drawn(renderer, godot_as_glsl(text), {"host_size": (64, 48), "in_linear": True}) / 255
    shown = drawn(renderer, godot_as_glsl(text), {"host_size": (64, 48)}) / 255
    np.testing.assert_allclose(
        linear, np.where(shown < 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4), atol=0.01
    )


def spirv(text: str, folder: Path) -> tuple[bytes, bytes]:
    """The vertex and the pixel shader of HLSL, by the reference compiler."""
    (folder / "made.hlsl").write_text(text)
    found = []
    for stage, entry in (("vert", "full_screen"), ("frag", "main")):
        made = folder / f"{stage}.spv"
        command = [glslang(), "-D", "-V", "-S", stage, "-e", entry, "-o", str(made), str(folder / "made.hlsl")]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout
        found.append(made.read_bytes())
    return found[0], found[1]


def constants(text: str, **given: Any) -> bytes:
    """The buffer of a shader: its initial values, or others, packed as HLSL packs them."""
    found = bytearray()
    for kind, name, value in re.findall(
        r"^    (float\d?|int) (\w+);  // ([^:]+): ", text.partition("};")[0], re.MULTILINE
    ):
        numbers = given.get(name, [float(number) for number in value.strip("()").split(",")])
        data = np.atleast_1d(np.asarray(numbers, np.float32)).tobytes()
        if len(found) % 16 + len(data) > 16:
            found += bytes(-len(found) % 16)
        assert len(data) == 4 * int(kind[5:] or 1)
        found += data
    return bytes(found + bytes(-len(found) % 16))


@pytest.fixture(scope="module")
def device() -> Iterator[Device]:
    pytest.importorskip("wgpu")
    with Device() as found:
        if not found.present:
            pytest.skip("wgpu finds no device")
        yield found


@pytest.mark.parametrize("name", SCENES)
def test_the_reference_compiler_takes_hlsl(name: str, tmp_path: Path) -> None:
    spirv(text_of(tmp_path, SCENES[name], ".hlsl"), tmp_path)


@pytest.mark.parametrize("name", ["parameters", "hoisted", "sky", "parallel", "lens", "inside"])
def test_hlsl_draws_the_picture(name: str, device: Device, renderer: Renderer, tmp_path: Path) -> None:
    text = text_of(tmp_path, SCENES[name], ".hlsl", time=0.6)
    found = device.draw(spirv(text, tmp_path), constants(text, u_resolution=(64, 48)), (64, 48))
    compare(found.astype(int), picture(renderer, SCENES[name], 0.6))


@pytest.fixture(scope="module")
def browser() -> Iterator[chromium.Browser]:
    with chromium.Browser() as made:
        yield made


@pytest.mark.may_skip
@pytest.mark.skipif(chromium.find() is None, reason="no Chromium is installed: install the package chromium")
@pytest.mark.parametrize("name", ["parameters", "hoisted", "sky", "lens"])
def test_a_module_for_three_draws_the_picture(
    name: str, browser: chromium.Browser, renderer: Renderer, tmp_path: Path
) -> None:
    three = Path(os.environ["RAYMARCH_THREE"]).read_text() if "RAYMARCH_THREE" in os.environ else STUB
    module = text_of(tmp_path, SCENES[name], ".js", time=0.6)
    (tmp_path / "page.html").write_text(PAGE)
    values = {"u_size": 1.4, "u_tint": (0.2, 0.3, 0.9)} if name == "parameters" else {}
    browser.call("Page.navigate", url=(tmp_path / "page.html").as_uri())
    browser.run("new Promise(done => document.readyState === 'complete' ? done() : addEventListener('load', done))")
    arguments = ", ".join(json.dumps(each) for each in (three, module, values, 64, 48))
    made = browser.run(f"draw({arguments})")
    messages = [text for text in browser.messages if "Error" in text]
    found = np.array(made["pixels"], int).reshape(48, 64, 4)[::-1, :, :3]
    compare(found, picture(renderer, SCENES[name], 0.6, {key[2:]: value for key, value in values.items()}))
    assert messages == [] and {"u_resolution", *values} <= set(made["names"])


def test_light_below_the_surface_of_a_hull(renderer: Renderer, tmp_path: Path) -> None:
    wax = rm.Material(albedo=(0.9, 0.55, 0.4), subsurface=1, subsurface_radius=(0.6, 0.4, 0.3))
    scene = rm.Scene(rm.rounded_hull().material(wax), bounces=1)
    text = text_of(tmp_path, scene, ".gdshader")
    assert godot_faults(text) == []
    compare(drawn(renderer, godot_as_glsl(text), {"host_size": (64, 48)}), picture(renderer, scene))
    spirv(text_of(tmp_path, scene, ".hlsl"), tmp_path)


def test_hlsl_holds_no_glsl_of_the_user(tmp_path: Path) -> None:
    code = "float f(vec3 p) { return length(mat3(2.0) * p) - 2.0; }"
    node = rm.glsl_node(code, "f", "bound", twin=lambda p: 2 * np.linalg.norm(p, axis=1) - 2)
    with pytest.raises(PlanError, match=r"a \.hlsl file holds no GLSL nodes"):
        rm.export(node, tmp_path / "a.hlsl")


def test_hashes_noise_and_turned_solids_in_hlsl(device: Device, renderer: Renderer, tmp_path: Path) -> None:
    cells = rm.repeat_varied(lambda index: rm.box(0.2 + 0.3 * rm.hash(index)).rotate(0.4, (1, 2, 0)), 1.0, 3)
    bumpy = rm.sphere(1.2).displace(lambda p: 0.2 * rm.fbm(2 * p, 3)).translate((0, 2.5, 0))
    scene = rm.Scene(cells | bumpy)
    text = text_of(tmp_path, scene, ".hlsl")
    found = device.draw(spirv(text, tmp_path), constants(text, u_resolution=(64, 48)), (64, 48))
    compare(found.astype(int), picture(renderer, scene))


@pytest.mark.parametrize("suffix", [".gdshader", ".hlsl", ".js"])
def test_textures_are_refused_with_their_line(suffix: str, tmp_path: Path) -> None:
    with pytest.raises(PlanError, match=rf"textures.py:\d+: .*a {suffix} file holds no textures"):
        rm.export(load(EXAMPLES / "textures.py"), tmp_path / f"a{suffix}")
    assert not list(tmp_path.iterdir())
