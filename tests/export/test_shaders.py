"""Exported fragment shaders: they compile as they are, and draw the picture of the renderer."""

from __future__ import annotations

import base64
import json
import re
import subprocess
import sys
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import raymarch as rm
from raymarch.errors import RaymarchError, SceneError
from raymarch.export import inputs
from raymarch.expr.tables import Table
from raymarch.expr.vocabulary import sin, vec3
from raymarch.gpu import Renderer
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target
from raymarch.scene import load
from tests.support.commands import files, run
from tests.support.required import glslang
from tests.support.shadertoy import HOST, MAIN, Shadertoy, tabs

EXAMPLES = Path(rm.__file__).parents[1] / "examples"

SIZE = rm.Param("size", 1.0, 0.5, 2.0)
TINT = rm.Param("tint", (0.9, 0.2, 0.1), 0.0, 1.0)


def scenes() -> dict[str, rm.Scene]:
    ball = rm.sphere(0.7 * SIZE).material(rm.Material(color=TINT))
    moving = rm.Camera(position=vec3(4.0 * sin(rm.time), 1.5, 4.0), target=(0, 0.1 * rm.time, 0), fov=40)
    lit = rm.Sky((0.3, 0.5, 0.7), light=True)
    return {
        "framed": rm.Scene(rm.torus(1, 0.3)),
        "parameters": rm.Scene(ball | rm.plane(offset=-0.8), camera=moving, lights=[rm.Sun(shadow=True)]),
        "hoisted": rm.Scene(
            rm.box(1).rotate(rm.time * 0.5).translate((0, sin(rm.time), 0)),
            rm.Camera(view_from=vec3(sin(rm.time), 0.4, 1.0)),
            lights=[rm.PointLight((3, 4, 5), intensity=20)],
        ),
        "samples": rm.Scene(rm.box(1).rotate(0.4), quality=rm.Quality(samples=4), tone=rm.ToneMapping("aces", 0.5)),
        "cones": rm.Scene(rm.box(1).rotate(0.4), quality=rm.Quality(schedule="cones", temporal="reproject")),
        "split": rm.Scene(rm.box(1).rotate(0.4), quality=rm.Quality(steps_per_pass=8, rays="interpolated")),
        "inside": rm.Scene(rm.sphere(3).shell(0.1), camera=rm.Camera((0, 0.2, 1), (0, 0, 0))),
        "sky": rm.Scene(rm.sphere().material(rm.Material(albedo=(0.8, 0.5, 0.2), metalness=1.0)), sky=lit),
        "paths": rm.Scene(ball | rm.plane(offset=-0.8), sky=lit, bounces=2, quality=rm.Quality(samples=3)),
        "parallel": rm.Scene(
            ball | rm.plane(offset=-0.8),
            rm.Camera(projection="orthographic", near=rm.Param("near", 4.0, 0.0, 9.0), far=9),
        ),
        "lens": rm.Scene(ball, rm.Camera((1, 1, 4), (0, 0, 1), aperture=0.2), quality=rm.Quality(samples=8)),
        "far": rm.Scene(rm.sphere().translate((2e5, 0, 0)), camera=rm.Camera((2e5 + 1, 1, 4), (2e5, 0, 0))),
    }


SCENES = scenes()


def drawn(renderer: Renderer, text: str, uniforms: Mapping[str, Any]) -> NDArray[np.int64]:
    """The 8-bit picture of a fragment shader, (H, W, 3)."""
    with (
        Program(renderer.context, FULL_SCREEN, text, lambda line: (f"line {line}", None), "exported") as program,
        Target(renderer.context, renderer.size) as target,
    ):
        program.draw(target, uniforms)
        return np.rint(255 * target.read()[..., :3]).astype(int)


def picture(renderer: Renderer, scene: rm.Scene, *values: Any) -> NDArray[Any]:
    """The renderer's picture, without earlier frames."""
    renderer.forget()
    return np.asarray(renderer.render(scene, *values).image())


def compare(found: NDArray[np.int64], wanted: NDArray[Any]) -> None:
    """Equal to 2 of 255, but for pixels on edges, where a ray of float32 may fall on either side."""
    off = np.abs(found - wanted.astype(int)).max(axis=2) > 2
    assert wanted.std() > 5 and np.mean(off) <= 0.005


def page(scene: rm.Scene, folder: Path, **options: Any) -> tuple[Path, dict[str, Any]]:
    """An exported page, and its data."""
    file = folder / "made.html"
    rm.export(scene, file, **options)
    (text,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', file.read_text(), re.DOTALL)
    data = json.loads(text)
    for name in ("shader", "display"):
        if isinstance(data[name], dict):
            data[name] = zlib.decompress(base64.b64decode(data[name]["bytes"])).decode()
    return file, data


def export_text(folder: Path, scene: rm.Scene, **options: Any) -> str:
    rm.export(scene, folder / "made.glsl", **options)
    return (folder / "made.glsl").read_text()


@pytest.mark.parametrize("name", SCENES)
def test_a_shader_draws_the_picture_of_the_renderer(name: str, renderer: Renderer, tmp_path: Path) -> None:
    """Without any uniform but the size: its initial values are those of the scene."""
    scene = SCENES[name]
    text = export_text(tmp_path, scene)
    compare(drawn(renderer, text, {"u_resolution": (64, 48)}), picture(renderer, scene))


def test_uniforms_are_parameters_and_time(renderer: Renderer, tmp_path: Path) -> None:
    scene = SCENES["parameters"]
    text = export_text(tmp_path, scene)
    given = {"size": 1.4, "tint": (0.1, 0.3, 0.9)}
    wanted = picture(renderer, scene, 0.8, given)
    uniforms = {"u_resolution": (64, 48), "u_time": 0.8, "u_size": 1.4, "u_tint": (0.1, 0.3, 0.9)}
    compare(drawn(renderer, text, uniforms), wanted)
    initial = export_text(tmp_path, scene, time=0.8, params=given)
    compare(drawn(renderer, initial, {"u_resolution": (64, 48)}), wanted)
    assert "//   float u_size = 1.0: parameter 'size' from 0.5 to 2.0" in text.splitlines()


def test_an_orbit_turns_the_camera_about_its_target(renderer: Renderer, tmp_path: Path) -> None:
    solid = rm.box((1, 1.5, 2)).rotate(0.3, "x")
    before = rm.Scene(solid, camera=rm.Camera((0, 0, 5), (0, 0, 0)))
    angle, height, factor = 0.7, 0.4, 1.2
    place = 5 * factor * np.array([np.sin(angle) * np.cos(height), np.sin(height), np.cos(angle) * np.cos(height)])
    after = before.replace(camera=rm.Camera(tuple(place), (0, 0, 0)))
    text = export_text(tmp_path, before)
    found = drawn(renderer, text, {"u_resolution": (64, 48), "u_orbit": (angle, height, np.log(factor))})
    compare(found, picture(renderer, after))


@pytest.mark.parametrize("name", SCENES)
def test_a_shader_for_shadertoy_draws_the_picture(name: str, renderer: Renderer, tmp_path: Path) -> None:
    """Samples of a still scene add up in a buffer, one in each frame."""
    scene = SCENES[name]
    text = export_text(tmp_path, scene, shadertoy=True)
    assert set(tabs(text)) == ({"Buffer A", "Image"} if scene.quality.samples > 1 else {"Image"})
    with Shadertoy(renderer.context, text, (64, 48)) as host:
        compare(host.draw(scene.quality.samples, time=0.6), picture(renderer, scene, 0.6))


def test_samples_of_a_scene_that_moves_are_drawn_in_each_frame(renderer: Renderer, tmp_path: Path) -> None:
    scene = SCENES["hoisted"].replace(quality=rm.Quality(samples=3))
    text = export_text(tmp_path, scene, shadertoy=True)
    with Shadertoy(renderer.context, text, (64, 48)) as host:
        host.draw(time=0.1)
        compare(host.draw(time=0.6), picture(renderer, scene, 0.6))


def test_a_buffer_starts_again(renderer: Renderer, tmp_path: Path) -> None:
    """When the mouse drags, which turns the camera, and when the size changes."""
    scene = SCENES["samples"]
    text = export_text(tmp_path, scene, shadertoy=True)
    with Shadertoy(renderer.context, text, (64, 48)) as host:
        still = host.draw(4)
        turned = host.draw(2, mouse=(20.0, 24.0, 20.0, 24.0))
        assert np.mean(np.abs(turned - still).max(axis=2) > 2) > 0.1
        released = host.draw(3, mouse=(20.0, 24.0, -20.0, -24.0))
        with Shadertoy(renderer.context, text, (64, 48)) as other:
            compare(released, other.draw(4, mouse=(20.0, 24.0, -20.0, -24.0)))
        host.resize((48, 48))
        with Shadertoy(renderer.context, text, (48, 48)) as other:
            compare(host.draw(4), other.draw(4))


@pytest.mark.parametrize("name", ["parameters", "samples", "paths", "sky"])
def test_the_reference_compiler_takes_both_forms(name: str, tmp_path: Path) -> None:
    desktop = tmp_path / "desktop.frag"
    desktop.write_text(export_text(tmp_path, SCENES[name]))
    given = [desktop]
    for tab, text in tabs(export_text(tmp_path, SCENES[name], shadertoy=True)).items():
        given.append(tmp_path / f"{tab}.frag")
        given[-1].write_text(HOST + text + MAIN)
    done = subprocess.run([glslang(), *map(str, given)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def data_scenes() -> dict[str, rm.Scene]:
    grid = rm.grid(np.linalg.norm(np.mgrid[-1:1:8j, -1:1:8j, -1:1:8j], axis=0) - 0.5)
    land = rm.heightmap(np.sin(np.mgrid[0:3:9j, 0:4:12j]).sum(axis=0) * 0.2)
    lights = [rm.PointLight((i - 4, 2, 3), intensity=2 + i) for i in range(9)]
    balls = rm.union(*(rm.sphere(0.3 + 0.01 * i).translate((i % 5 - 2, i // 5 - 2, 0)) for i in range(25)))
    return {
        "grids": rm.Scene(grid | land.translate((0, -1, 0))),
        "lights": rm.Scene(rm.torus(), lights=lights),
        "rows": rm.Scene(balls, quality=rm.Quality(objects="data")),
    }


@pytest.mark.parametrize("name", ["grids", "lights", "rows"])
def test_small_data_are_constants(name: str, renderer: Renderer, tmp_path: Path) -> None:
    scene = data_scenes()[name]
    wanted = picture(renderer, scene)
    text = export_text(tmp_path, scene, shadertoy=name != "rows")
    assert "sampler" not in "".join(line for line in text.splitlines() if line.startswith("uniform"))
    if name == "rows":
        compare(drawn(renderer, text, {"u_resolution": (64, 48)}), wanted)
    else:
        with Shadertoy(renderer.context, text, (64, 48)) as host:
            compare(host.draw(), wanted)
    assert files(tmp_path) == {"made.glsl"}
    # Compilers of GPUs refuse long constructors, and give each float of an array the place of a vec4.
    lengths = re.findall(r"const vec4 constant_numbers_\d\[(\d+)\]", text)
    assert (name == "lights") == (not lengths) and all(int(length) <= 256 for length in lengths)


def test_large_textures_are_samplers_and_arrays(renderer: Renderer, tmp_path: Path) -> None:
    image = np.random.default_rng(3).uniform(0, 1, (32, 32, 3))
    solid = rm.box(1).rotate(0.5).material(rm.Material(albedo=rm.triplanar(image)))
    scene = rm.Scene(solid | rm.grid(np.linalg.norm(np.mgrid[-1:1:20j, -1:1:20j, -1:1:20j], axis=0) - 0.6))
    wanted = picture(renderer, scene)
    text = export_text(tmp_path, scene)
    assert files(tmp_path) == {"made.glsl", "made.textures.npz"}
    arrays = dict(np.load(tmp_path / "made.textures.npz"))
    levels = sorted({name.partition(".")[0] for name in arrays if "texels" in name})
    assert len(levels) == 1 and "32 x 32, 3 half floats, 6 levels, filtered linearly" in text
    gl = renderer.context.gl
    with renderer.context.bound():
        (base,) = levels
        picture_texture = gl.texture((32, 32), 3, dtype="f2")
        picture_texture.build_mipmaps()
        for k in range(6):
            picture_texture.write(arrays[f"{base}.{k}"].tobytes(), level=k, alignment=1)
        picture_texture.filter = (gl.LINEAR_MIPMAP_LINEAR, gl.LINEAR)
        (samples,) = (name for name in arrays if "samples" in name)
        grid = gl.texture3d((20, 20, 20), 1, arrays[samples].tobytes(), dtype="f4")
        grid.filter = (gl.NEAREST, gl.NEAREST)
    compare(drawn(renderer, text, {"u_resolution": (64, 48), base: picture_texture, samples: grid}), wanted)


def test_a_label_does_not_continue_its_comment_in_the_next_line() -> None:
    assert Table(np.zeros((2, 1)), "C:\\a\n\\").label == "C:\\a\\n"


def test_textures_replace_no_file_of_the_user(tmp_path: Path) -> None:
    """Of the files that the export does not name itself, it replaces those of an earlier export alone."""
    image = np.random.default_rng(3).uniform(0, 1, (64, 64, 3))
    scene = rm.Scene(rm.box(1).material(rm.Material(albedo=rm.triplanar(image))))
    beside = tmp_path / "made.textures.npz"
    user = (lambda: np.savez(beside, mine=1), lambda: beside.write_text("mine"), lambda: beside.symlink_to("x"))
    for make in user:
        make()
        before = beside.lstat().st_mtime_ns
        once = (
            r"^\S+:\d+: export: the textures of '.*' belong into '.*made.textures.npz', which is another file \(another"
        )
        with pytest.raises(SceneError, match=once):
            rm.export(scene, tmp_path / "made.glsl")
        assert beside.lstat().st_mtime_ns == before and files(tmp_path) == {beside.name}
        beside.unlink()
    rm.export(scene, tmp_path / "made.glsl")
    rm.export(scene, tmp_path / "made.glsl")
    with pytest.raises(SceneError, match="another file"):
        rm.export(scene, tmp_path / "made.frag")
    assert files(tmp_path) == {"made.glsl", beside.name}


def test_many_objects_are_rows_of_textures(renderer: Renderer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As text, thousands of objects take compilers minutes; Shadertoy has no textures for them."""
    places = np.random.default_rng(2).uniform(-2, 2, (400, 3))
    balls = [rm.sphere(0.1 + 0.0005 * i).translate(tuple(p)) for i, p in enumerate(places)]
    scene = rm.Scene(rm.union(*balls, rm.plane(offset=-2), rm.sphere(0.5).translate((0, 2 + sin(rm.time), 0))))
    wanted = picture(renderer, scene)
    text = export_text(tmp_path, scene)
    assert len(text) < 60_000 and files(tmp_path) == {"made.glsl", "made.textures.npz"}
    arrays = dict(np.load(tmp_path / "made.textures.npz"))
    with renderer.context.bound():
        gl, tables = renderer.context.gl, {}
        for name, array in arrays.items():
            tables[name] = gl.texture(array.shape[1::-1], array.shape[2], array.tobytes(), dtype="f4")
            tables[name].filter = (gl.NEAREST, gl.NEAREST)
    compare(drawn(renderer, text, {"u_resolution": (64, 48), **tables}), wanted)
    monkeypatch.setattr(inputs, "MOST_AS_TEXT", 400)
    (tmp_path / "text").mkdir()
    assert "sampler" not in export_text(tmp_path / "text", scene) and files(tmp_path / "text") == {"made.glsl"}


def refused(scene: rm.Scene, folder: Path, **options: Any) -> str:
    """The message of a refusal, which leaves no file."""
    with pytest.raises(RaymarchError) as caught:
        rm.export(scene, folder / "made.glsl", **options)
    assert not files(folder)
    return str(caught.value)


def test_letters_too_fine_for_shadertoy_name_their_resolution(tmp_path: Path) -> None:
    fine, coarse = (rm.text("NEON", height=1, resolution=n).extrude(0.1) for n in (96, 24))
    with pytest.raises(RaymarchError, match=r"Shadertoy file holds no textures.*smaller resolution= of text, image"):
        rm.export(fine, tmp_path / "a.glsl", shadertoy=True)
    rm.export(coarse, tmp_path / "a.glsl", shadertoy=True)


def test_what_a_shader_cannot_hold_is_refused_with_its_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    textures = load(EXAMPLES / "textures.py")
    message = refused(textures, tmp_path, shadertoy=True)
    assert "textures.py:48: array of 256 x 256 x 3: a Shadertoy file holds no textures" in message
    lights = [rm.PointLight((i + rm.time, 2, 3)) for i in range(9)]
    assert "9 lights, one of which depends on time" in refused(rm.Scene(rm.sphere(), lights=lights), tmp_path)
    many = rm.Scene(rm.sphere(), lights=[rm.PointLight((i, 2, 3)) for i in range(9)])
    with monkeypatch.context() as changed:
        changed.setattr(inputs, "SMALL", 71)
        assert "9 lights with more than 71 numbers" in refused(many, tmp_path, shadertoy=True)
    sky = rm.Sky(TINT, light=True)
    message = refused(rm.Scene(rm.sphere(), sky=sky), tmp_path)
    assert "Sky(light=True) depends on time or a Param" in message and "test_shaders.py" in message
    field = rm.grid(np.linalg.norm(np.mgrid[-1:1:20j, -1:1:20j, -1:1:20j], axis=0) - 0.5)
    assert "samples of 20 x 20 x 20" in refused(rm.Scene(field), tmp_path, shadertoy=True)


def test_options_of_other_forms_are_refused(tmp_path: Path) -> None:
    ball = rm.Scene(rm.sphere())
    assert "cells = 8 for a .glsl file (with .stl" in refused(ball, tmp_path, cells=8)
    assert "unknown parameter 'x'" in refused(ball, tmp_path, params={"x": 1})
    with pytest.raises(RaymarchError, match=r"cannot export '.*made.xyz' \(a file ending in .gdshader, .glsl"):
        rm.export(ball, tmp_path / "made.xyz")
    with pytest.raises(RaymarchError, match=r"no/made.glsl': No such file or directory"):
        rm.export(ball, tmp_path / "no" / "made.glsl")
    with pytest.raises(RaymarchError, match="export of 3"):
        rm.export(3, tmp_path / "made.glsl")  # type: ignore[arg-type]


def test_the_command_writes_a_shader(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "columns.glsl"
    assert run("export", str(EXAMPLES / "columns.py"), "-o", str(file), "--set", "gap=4") == 0
    assert "uniform float u_gap = 4.0;" in file.read_text()
    assert run("export", str(EXAMPLES / "columns.py"), "-o", str(file), "--set", "gap=4", "--shadertoy") == 0
    assert "const float u_gap = 4.0;" in file.read_text() and "mainImage" in file.read_text()
    before = file.read_bytes()
    assert run("export", str(EXAMPLES / "textures.py"), "-o", str(file), "--shadertoy") == 2
    assert "textures.py:48" in capsys.readouterr().err and file.read_bytes() == before
    assert run("export", str(EXAMPLES / "csg.py"), "-o", str(file), "--box", "1,2") == 2
    assert "--box 1,2 (two corners" in capsys.readouterr().err


@pytest.mark.parametrize("ending", ["glsl", "html"])
def test_too_many_moving_objects_are_refused_at_their_line(
    ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exports hold objects that move as text, of which compilers take a limited number."""
    monkeypatch.setattr(sys.modules["raymarch.plan.stages"], "LARGEST", 16)
    balls = [rm.sphere(0.2).translate((0.5 * i, sin(rm.time + i), 0.0)) for i in range(40)]
    with pytest.raises(RaymarchError, match="those that move are text in exports") as caught:
        rm.export(rm.Scene(rm.union(*balls)), tmp_path / f"made.{ending}")
    assert caught.value.where is not None and caught.value.where.file == __file__
    assert not any(tmp_path.iterdir())


def test_a_solid_that_time_moves_beyond_the_horizon_is_reached(renderer: Renderer, tmp_path: Path) -> None:
    near = rm.sphere() | rm.plane(offset=-2)
    scene = rm.Scene(near | rm.sphere(1e5).translate((0, 0, -3e4 * rm.time)), rm.Camera((0, 3, 6), (0, 3, 0)))
    wanted = picture(renderer, scene, 20.0)
    uniforms = {"u_resolution": renderer.size, "u_time": 20.0}
    compare(drawn(renderer, export_text(tmp_path, scene), uniforms), wanted)
    assert np.mean(np.any(wanted != picture(renderer, scene.replace(node=near)), axis=2)) > 0.02


def test_depth_in_a_page_is_that_of_the_centre_of_the_lens(renderer: Renderer, tmp_path: Path) -> None:
    scene = rm.Scene(rm.sphere(1.3) | rm.plane(offset=-1), rm.Camera((1, 1, 4), (0, 0, 0), aperture=0.5))
    text = (
        page(scene, tmp_path)[1]["shader"].replace("#version 300 es", "#version 330 core").replace("PASS 0", "PASS 1")
    )
    with (
        Program(renderer.context, FULL_SCREEN, text, lambda line: (f"line {line}", None), "geometry") as program,
        Target(renderer.context, renderer.size, 3) as target,
    ):
        program.draw(target, {"u_resolution": renderer.size})
        found = target.read()[..., 0]
    right = renderer.render(scene, outputs=("depth",)).depth
    hit = np.isfinite(right)
    np.testing.assert_array_equal(found >= 0.0, hit)
    np.testing.assert_allclose(found[hit], right[hit], rtol=1e-3)
