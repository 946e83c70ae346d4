"""Exported WGSL: a compiler of WebGPU takes it, and its functions have the values of the float64 reference."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.expr.vocabulary import sin
from raymarch.scene import load
from raymarch.scene.parameter import set_values
from raymarch.truth.field import Field
from tests.export.test_shaders import EXAMPLES
from tests.support import chromium
from tests.support.commands import files
from tests.support.wgsl_device import Device

MAIN = """
@group(0) @binding(0) var<storage, read> points: array<vec4f>;
@group(0) @binding(1) var<storage, read_write> found: array<vec4f>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) at: vec3u) {
    let p = points[at.x].xyz;
    BEFORE
    found[at.x] = CALL;
}
"""


@pytest.fixture(scope="module")
def device() -> Iterator[Device]:
    if find_spec("wgpu") is None:
        pytest.skip("wgpu is not installed")
    with Device() as made:
        if not made.present:
            pytest.skip("wgpu finds no device")
        yield made


def text(scene: rm.Scene, folder: Path, **options: Any) -> str:
    rm.export(scene, folder / "made.wgsl", **options)
    return (folder / "made.wgsl").read_text()


def computed(device: Device, code: str, call: str, points: NDArray[Any], before: str = "") -> NDArray[np.float32]:
    """The values of a vec4f expression of a point p, (N, 4); N is a multiple of 64."""
    given = np.zeros((len(points), 4), np.float32)
    given[:, :3] = points
    shader = code + MAIN.replace("CALL", call).replace("BEFORE", before)
    return device.compute(shader, given)


SIZE = rm.Param("size", 1.2, 0.5, 2.0)
SOLIDS = {
    "blend": rm.union(rm.box((1, 0.5, 0.8)).rotate(0.4, "y"), rm.torus(0.7, 0.2), k=0.2) - rm.sphere(0.3),
    "parameter": rm.sphere(SIZE).twist(0.5) & rm.box(1.5 * SIZE),
    "time": rm.capsule((0, 0, 0), (1, 0, 0), 0.2).translate((sin(rm.time), 0, 0)).mirror("x"),
    "fractal": rm.mandelbulb(iterations=3),
    "repeated": rm.sphere(0.2).repeat((1, 1, 1), count=(3, 3, 3)),
    "gyroid": rm.gyroid(thickness=0.1),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_fields_have_their_values(name: str, device: Device, tmp_path: Path) -> None:
    scene = rm.Scene(SOLIDS[name])
    code = text(scene, tmp_path, time=0.7)
    points = np.random.default_rng(2).uniform(-1.3, 1.3, (256, 3)).astype(np.float32)
    field = Field(scene, set_values(scene.parameters, None, 0.7))
    wanted = field.distance(points.astype(float))
    got = computed(device, code, "vec4f(field(p), 0.0, 0.0, 0.0)", points)[:, 0]
    assert np.std(wanted) > 0.01
    np.testing.assert_allclose(got, wanted, atol=2e-5)


def test_variables_change_the_values(device: Device, tmp_path: Path) -> None:
    scene = rm.Scene(SOLIDS["time"] | SOLIDS["parameter"])
    points = np.random.default_rng(2).uniform(-1.3, 1.3, (64, 3)).astype(np.float32)
    field = Field(scene, set_values(scene.parameters, {"size": 0.8}, 0.2))
    code = text(scene, tmp_path, time=0.7)
    got = computed(device, code, "vec4f(field(p))", points, "u_time = 0.2; u_size = 0.8; set_frame();")[:, 0]
    np.testing.assert_allclose(got, field.distance(points.astype(float)), atol=2e-5)


def test_lights_and_materials_have_their_values(device: Device, tmp_path: Path) -> None:
    solid = rm.sphere(0.5).material(rm.Material(albedo=(0.8, 0.2, 0.1), roughness=0.4)) | rm.plane(offset=-0.5)
    lamp = rm.PointLight((1, 2, 1), color=(1, 0.5, 0.25), intensity=8)
    code = text(rm.Scene(solid, lights=[lamp], tone=rm.ToneMapping("aces")), tmp_path)
    points = np.random.default_rng(3).uniform(-1, 1, (64, 3)).astype(np.float32)
    call = "vec4f(sample_point_light(p, vec3f(1.0, 2.0, 1.0), vec3f(8.0, 4.0, 2.0)).radiance, 1.0)"
    assert "fn reflect_light(" in code and "fn toned(" in code
    got = computed(device, code, call, points)
    away = np.linalg.norm(points - (1, 2, 1), axis=1)[:, None]
    np.testing.assert_allclose(got[:, :3], np.array([8, 4, 2]) / away**2, rtol=1e-5)


@pytest.mark.parametrize(
    "name", ["village", "primitives", "papers/glass", "papers/lights", "papers/smoothing", "showcase/lanterns"]
)
def test_the_compiler_takes_examples(name: str, device: Device, tmp_path: Path) -> None:
    assert device.refused(text(load(EXAMPLES / f"{name}.py"), tmp_path)) == ""


def test_what_shaders_set_while_they_draw_is_declared(device: Device, tmp_path: Path) -> None:
    solid = rm.sphere(0.5) | rm.box(1).translate((2, 0, 0)).visible(camera=False) | rm.plane(offset=-0.5)
    scene = rm.Scene(solid, occlusion=rm.AmbientOcclusion(3), sky=rm.GradientSky(light=True))
    code = text(scene, tmp_path)
    points = np.random.default_rng(4).uniform((1.4, -0.4, -0.6), (2.6, 0.6, 0.6), (64, 3)).astype(np.float32)
    x, y, z = points.T.astype(float)
    others = np.minimum(np.sqrt(x * x + y * y + z * z) - 0.5, y + 0.5)
    q = np.abs([x - 2, y, z]) - 0.5
    box = np.linalg.norm(np.maximum(q, 0), axis=0) + np.minimum(q.max(axis=0), 0)
    for kind, wanted in ((0, others), (1, np.minimum(others, box)), (2, np.minimum(others, box))):
        got = computed(device, code, "vec4f(field(p))", points, f"ray_kind = {kind}.0;")[:, 0]
        np.testing.assert_allclose(got, wanted, atol=2e-6)
    open_, closed = (
        computed(device, code, "vec4f(ambient_occlusion(p, vec3f(0, 1, 0)))", points, f"u_side = {side}.0;")
        for side in (1, -1)
    )
    assert np.any(open_ != closed)


@pytest.mark.may_skip
@pytest.mark.skipif(chromium.find() is None, reason="there is no Chromium")
def test_the_compiler_of_a_browser_takes_examples(tmp_path: Path) -> None:
    tint = chromium.Tint()
    try:
        for name in ("papers/soft_shadows", "showcase/plates", "village"):
            assert tint.refused(text(load(EXAMPLES / f"{name}.py"), tmp_path)) == ""
        assert "undeclared" in tint.refused("fn f() -> f32 { return undeclared; }")
    finally:
        tint.close()


def test_the_compiler_finds_faults(device: Device, tmp_path: Path) -> None:
    code = text(rm.Scene(rm.box(1)), tmp_path)
    assert "lengths" in device.refused(code.replace("length(", "lengths(", 1))


def test_what_wgsl_cannot_hold_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RaymarchError, match=r"textures.py:\d+: a .wgsl file holds no textures"):
        rm.export(load(EXAMPLES / "textures.py"), tmp_path / "made.wgsl")
    assert not files(tmp_path)
