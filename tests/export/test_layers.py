"""Layers of OpenEXR files, read back by OpenEXR and held against closed forms; Cryptomatte decoded by its manifest."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.export.mattes import RANKS, identity, murmur3
from tests.support.commands import run

OpenEXR = pytest.importorskip("OpenEXR")

WIDTH, HEIGHT = 64, 48

SCENE = """
import raymarch as rm

gold = rm.Material(albedo=(0.9, 0.6, 0.2), metalness=1.0)
shade = rm.Material(color=(0.1, 0.5, 0.3))
left = rm.sphere(0.8).translate((-1, 0, 0)).material(gold)
right = (rm.box((1, 1, 1)) - rm.sphere(0.5).translate((0, 0, 0.5))).translate((1, 0.3, 0))
wall = rm.plane(normal=(0, 0, 1), offset=-2).material(shade)
scene = rm.Scene(
    left | right | wall,
    camera=rm.Camera((0, 0, 6), (0, 0, 0), projection="orthographic", height=4),
    lights=[rm.Sun(shadow=True)],
    sky=(0.2, 0.4, 0.6),
)
"""

MOVING = """
import raymarch as rm

ball = rm.sphere(0.8).translate((6 * rm.time * rm.time, 0, 0))
drop = rm.sphere(0.5 + rm.time).translate((0, -1.6, 0))
scene = rm.Scene(ball | drop, camera=rm.Camera((CAMERA, 0, 6), (CAMERA, 0, 0), projection="orthographic", height=4))
"""


def channels(folder: Path, text: str, *options: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """The channels of a rendered file by name, and its header."""
    (folder / "scene.py").write_text(text)
    target = folder / "made.exr"
    assert run("render", str(folder / "scene.py"), "-o", str(target), "--size", f"{WIDTH}x{HEIGHT}", *options) == 0
    with OpenEXR.File(str(target), separate_channels=True) as found:
        return {name: channel.pixels for name, channel in found.channels().items()}, dict(found.header())


def stacked(found: dict[str, NDArray[Any]], name: str, letters: str) -> NDArray[Any]:
    return np.stack([found[f"{name}.{letter}"] for letter in letters], axis=-1)


def decoded(found: dict[str, NDArray[Any]], header: dict[str, Any], kind: str) -> dict[str, NDArray[Any]]:
    """The coverage of each name of a Cryptomatte, (H, W): by the manifest, as a program reads it."""
    (name,) = (key for key, value in header.items() if key.startswith("cryptomatte/") and value == kind)
    key = name.rpartition("/")[0]
    assert header[f"{key}/hash"] == "MurmurHash3_32" and header[f"{key}/conversion"] == "uint32_to_float32"
    assert len(key.partition("/")[2]) == 7
    levels = [n.partition(".")[0] for n in sorted(found) if n.startswith(kind) and n.endswith(".R")]
    assert levels == [f"{kind}{i:02d}" for i in range(RANKS // 2)]
    covers = {}
    for listed, text in json.loads(header[f"{key}/manifest"]).items():
        (number,) = struct.unpack("<f", struct.pack("<I", int(text, 16)))
        cover = np.zeros((HEIGHT, WIDTH))
        for level in levels:
            for ids, weights in ("RG", "BA"):
                cover += np.where(found[f"{level}.{ids}"] == np.float32(number), found[f"{level}.{weights}"], 0.0)
        covers[listed] = cover
    return covers


def inside(shape: Any, edge: int) -> NDArray[Any]:
    """The fraction of each pixel that a shape covers, at the points of a square grid; shape : a function of x and y."""
    x = (np.arange(WIDTH * edge) + 0.5) / edge - WIDTH / 2
    y = HEIGHT / 2 - (np.arange(HEIGHT * edge) + 0.5) / edge
    found = shape(x[None, :] * 4 / HEIGHT, y[:, None] * 4 / HEIGHT)
    return np.asarray(found, float).reshape(HEIGHT, edge, WIDTH, edge).mean(axis=(1, 3))


def ball(x: Any, y: Any) -> Any:
    return (x + 1) ** 2 + y**2 < 0.64


def block(x: Any, y: Any) -> Any:
    return (abs(x - 1) < 0.5) & (abs(y - 0.3) < 0.5)


@pytest.mark.parametrize(
    "text, value",
    [
        ("", 0),
        ("hello", 0x248BFA47),
        ("hello, world", 0x149BBB7F),
        ("The quick brown fox jumps over the lazy dog", 0x2E4FF723),
    ],
)
def test_the_hash_is_that_of_published_values(text: str, value: int) -> None:
    assert murmur3(text) == value


def test_no_name_is_a_number_that_is_not_finite() -> None:
    for i in range(3000):
        number = np.uint32(identity(f"name {i}")).view(np.float32)
        assert np.isfinite(number) and abs(number) >= np.finfo(np.float32).tiny


@pytest.mark.parametrize("samples", [1, 9])
def test_names_cover_their_pixels(samples: int, tmp_path: Path) -> None:
    found, header = channels(tmp_path, SCENE, "--cryptomatte", "--samples", str(samples))
    edge = int(samples**0.5)
    objects = decoded(found, header, "crypto_object")
    assert set(objects) == {"left", "right", "wall"}
    for name, shape in (("left", ball), ("right", block)):
        wanted = inside(shape, edge)
        assert np.mean(np.abs(objects[name] - wanted) > 1e-6) < 0.002, name
        assert samples == 1 or np.any((wanted > 0) & (wanted < 1))
    np.testing.assert_allclose(sum(objects.values()), 1.0, atol=1e-6)
    materials = decoded(found, header, "crypto_material")
    assert set(materials) == {"default", "gold", "shade"}
    for name, own in (("left", "gold"), ("right", "default"), ("wall", "shade")):
        np.testing.assert_allclose(objects[name], materials[own], atol=1e-6)
    assert {"R", "G", "B"} < set(found) and "Z" not in found


def test_layers_for_compositing(tmp_path: Path) -> None:
    found, header = channels(tmp_path, SCENE, "--layers")
    hole = (np.linspace(-32, 32, 65)[:-1] + 0.5) / 12
    x, y = np.meshgrid(hole, -hole[8:56])
    on_wall = ~ball(x, y) & ~block(x, y)
    np.testing.assert_allclose(found["Z"][on_wall], 8.0, atol=1e-4)
    np.testing.assert_allclose(found["Z"][ball(x, y)], 6 - np.sqrt((0.64 - (x + 1) ** 2 - y**2)[ball(x, y)]), atol=2e-3)
    position = stacked(found, "position", "XYZ")
    np.testing.assert_allclose(position[..., :2], np.stack([x, y], axis=-1), atol=1e-4)
    np.testing.assert_allclose(stacked(found, "normal", "XYZ")[on_wall], [[0, 0, 1]] * on_wall.sum(), atol=1e-5)
    albedo = stacked(found, "albedo", "RGB")
    np.testing.assert_allclose(albedo[ball(x, y)], [[0.9, 0.6, 0.2]] * ball(x, y).sum(), atol=1e-6)
    np.testing.assert_allclose(albedo[on_wall], [[0.1, 0.5, 0.3]] * on_wall.sum(), atol=1e-6)
    assert not np.any(stacked(found, "vector", "XYZW"))
    assert not any(name.startswith("cryptomatte") for name in header)


@pytest.mark.parametrize("camera", ["(3, 2, 5), (0, 0, 0), fov=50", '(3, 2, 5), (0, 0, 0), projection="orthographic"'])
def test_the_matrices_of_the_header_lead_points_to_their_pixels(camera: str, tmp_path: Path) -> None:
    text = f"import raymarch as rm\nscene = rm.Scene(rm.torus(), camera=rm.Camera({camera}))\n"
    found, header = channels(tmp_path, text, "--layers")
    hit = found["Z"] < 1e9
    points = np.c_[stacked(found, "position", "XYZ")[hit], np.ones(hit.sum())].astype(float)
    seen = points @ header["worldToCamera"]
    np.testing.assert_allclose(seen[:, 2], found["Z"][hit], rtol=1e-4)
    assert np.allclose(seen[:, 3], 1) and np.linalg.det(header["worldToCamera"]) < 0
    flat = points @ header["worldToNDC"]
    row, column = np.nonzero(hit)
    np.testing.assert_allclose(flat[:, 0] / flat[:, 3] * WIDTH, column + 0.5, atol=0.02)
    np.testing.assert_allclose(flat[:, 1] / flat[:, 3] * HEIGHT, row + 0.5, atol=0.02)
    assert hit.sum() > 100 and np.all(found["Z"][~hit] == np.float32(1e10))


def test_the_sky_is_transparent_and_colours_are_premultiplied(tmp_path: Path) -> None:
    text = SCENE.replace("left | right | wall", "left | right")
    opaque, _ = channels(tmp_path, text, "--samples", "4")
    found, _ = channels(tmp_path, text, "--samples", "4", "--alpha")
    assert "A" not in opaque and set(found) == {"R", "G", "B", "A"}
    assert np.any((found["A"] > 0) & (found["A"] < 1)) and np.all(found["R"][found["A"] == 0] == 0)
    for letter, sky in zip("RGB", (0.2, 0.4, 0.6), strict=True):
        over = found[letter] + (1 - found["A"]) * sky
        np.testing.assert_allclose(over, opaque[letter], atol=1e-5)


def test_motion_vectors_lead_to_the_frame_before_and_from_the_one_after(tmp_path: Path) -> None:
    """As in Blender: x and y from the pixel to the place in the frame before, z and w from that in the frame after."""
    text = MOVING.replace("CAMERA", "0.0")
    found, _ = channels(tmp_path, text, "--layers", "--time", "0.2", "--fps", "10")
    vector, pixel = stacked(found, "vector", "XYZW"), HEIGHT / 4
    on_ball = (found["Z"] < 1e9) & (stacked(found, "position", "XYZ")[..., 1] > -0.6)
    moved = np.array([6 * 0.1**2 - 6 * 0.2**2, 0.0, 6 * 0.2**2 - 6 * 0.3**2, 0.0]) * pixel
    np.testing.assert_allclose(vector[on_ball], np.tile(moved, (on_ball.sum(), 1)), atol=1e-3)
    assert on_ball.sum() > 100 and not np.any(vector[found["Z"] > 1e9])
    grown = stacked(found, "position", "XYZ")[..., 1] < -1.0  # a ball that grows moves along its normals
    away = stacked(found, "normal", "XYZ")[grown][:, :2] * 0.1 * pixel
    np.testing.assert_allclose(vector[grown], np.c_[-away, -away], atol=0.02)
    assert grown.sum() > 20 and np.abs(away).max() > 0.5


def test_motion_vectors_of_a_camera_and_of_a_swept_parameter(tmp_path: Path) -> None:
    text = MOVING.replace("CAMERA", '(0.5 * rm.time + rm.Param("slide", 0.0, -1.0, 1.0))').replace("6 * rm.time", "0")
    target = tmp_path / "made_%d.exr"
    (tmp_path / "scene.py").write_text(text)
    options = ("--size", f"{WIDTH}x{HEIGHT}", "--layers", "--fps", "10", "--frames", "0:3", "--set", "slide=-0.2:0.2")
    assert run("render", str(tmp_path / "scene.py"), "-o", str(target), *options) == 0
    pixel = HEIGHT / 4
    for i, (before, after) in enumerate([(0.0, 0.2), (0.2, 0.2), (0.2, 0.0)]):
        with OpenEXR.File(str(tmp_path / f"made_{i}.exr"), separate_channels=True) as file:
            found = {name: channel.pixels for name, channel in file.channels().items()}
        vector = stacked(found, "vector", "XYZW")
        on_ball = (found["Z"] < 1e9) & (stacked(found, "position", "XYZ")[..., 1] > -0.6)
        wanted = np.array([0.05 + before, 0.0, 0.05 + after, 0.0]) * pixel
        np.testing.assert_allclose(vector[on_ball], np.tile(wanted, (on_ball.sum(), 1)), atol=1e-3)


def test_options_of_layers_need_an_exr(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.py").write_text(SCENE)
    for option in ("--layers", "--cryptomatte"):
        assert run("render", str(tmp_path / "scene.py"), "-o", str(tmp_path / "a.png"), option) == 2
        assert f"{option} with the output" in capsys.readouterr().err
    target = str(tmp_path / "a.exr")
    assert run("render", str(tmp_path / "scene.py"), "-o", target, "--cryptomatte", "--view=depth") == 2
    assert "--view depth with all arrays" in capsys.readouterr().err
    assert run("render", str(tmp_path / "scene.py"), "-o", target, "--layers", "--fps", "0") == 2
    assert "--fps 0.0 (a number > 0)" in capsys.readouterr().err


def test_instances_and_shared_parts_have_names(tmp_path: Path) -> None:
    text = """
import raymarch as rm

red, blue = (rm.Material(color=c) for c in ("red", "blue"))
pin = rm.cylinder(0.1, 0.6).material(red)
pins = rm.instances(pin, [(x, 0, 0) for x in (-1, 0, 1)])
balls = rm.union(*(rm.sphere(0.2).translate((x, -0.8, 0)) for x in (-1, 0, 1)), k=0.1).material(blue)
scene = rm.Scene(pins | balls, camera=rm.Camera((0, 0, 5), (0, 0, 0)))
"""
    objects = decoded(*channels(tmp_path, text, "--cryptomatte"), "crypto_object")
    assert set(objects) == {"pins", "balls"} or set(objects) == {"pin", "balls"}
    assert all(cover.sum() > 20 for cover in objects.values())


def test_all_that_a_scene_may_have_beside_its_mattes(tmp_path: Path) -> None:
    """A lens, clip planes, earlier frames, post effects; names of other alphabets; cut parts and materials of rows."""
    text = """
import raymarch as rm

ボール = rm.sphere(0.7).translate((-1, 0, 0))
mats = [rm.Material(color=c) for c in ("red", "green", "blue")]
pins = rm.instances(rm.cylinder(0.1, 0.6), [(x, -0.9, 0) for x in (-1, 0, 1)], materials=mats)
cut = rm.box(0.8).material(rm.Material(color="gold")) - rm.sphere(0.5).material(rm.Material(color="navy"))
scene = rm.Scene(
    ボール | pins | cut.translate((1, 0, 0)).twist(0.4),
    camera=rm.Camera((0, 0, 5), (0, 0, 0), aperture=0.05, near=1, far=20),
    quality=rm.Quality(samples=4, temporal="accumulate"),
    post=[rm.Bloom(0.2)],
)
"""
    found, header = channels(tmp_path, text, "--cryptomatte", "--layers", "--alpha")
    objects = decoded(found, header, "crypto_object")
    assert set(objects) == {"ボール", "pins", "cut"} and all(cover.sum() > 10 for cover in objects.values())
    materials = decoded(found, header, "crypto_material")
    assert set(materials) == {"default", "mats", "mats.2", "mats.3", "cut", "cut.2"}
    assert all(cover.sum() > 5 for cover in materials.values())
    np.testing.assert_allclose(materials["cut"] + materials["cut.2"], objects["cut"], atol=1e-6)
    assert not any(np.isnan(values).any() for values in found.values())
