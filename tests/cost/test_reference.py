"""The kept truth: the right one, and computed once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import raymarch as rm
from raymarch.cache import VARIABLE
from raymarch.cost import reference as reference_module
from raymarch.cost.checks import check
from raymarch.cost.content import content_key
from raymarch.cost.flip import flip
from raymarch.cost.reference import reference
from raymarch.cost.settings import Setting
from raymarch.cost.sweep import sweep
from tests.cost.cost_samples import SIZE, make_scene


def test_it_is_the_truth(scene, known):
    plain = rm.truth(scene, size=SIZE)
    for name in ("depth", "hit", "normal", "material", "color"):
        assert np.array_equal(getattr(known, name), getattr(plain, name)), name
    assert known.size == SIZE
    assert known.pixel == pytest.approx(2 * np.tan(np.radians(22.5)) / SIZE[1])
    assert known.floor.mean() > 3


@pytest.fixture(scope="module")
def fine(scene):
    return rm.truth(scene, size=(2 * SIZE[0], 2 * SIZE[1])).color


def test_the_picture_is_the_mean_of_finer_rays(known, fine):
    assert known.picture[7, 9] == pytest.approx(fine[14:16, 18:20].mean(axis=(0, 1)))
    assert known.spread[7, 9] == pytest.approx(fine[14:16, 18:20].reshape(4, 3).std(axis=0, ddof=1).max() / 2)


def test_the_half_is_every_other_ray(scene, known, fine, monkeypatch):
    assert known.half[7, 9] == pytest.approx((fine[14, 18] + fine[15, 19]) / 2)
    monkeypatch.setattr(reference_module, "AT_ONCE", 4 * SIZE[0] * 5)
    monkeypatch.setenv(VARIABLE, "")
    bands = reference(scene, SIZE, samples=4)
    for name in ("picture", "half", "spread"):
        assert np.array_equal(getattr(bands, name), getattr(known, name)), name


def test_how_much_of_the_picture_is_done_is_said(scene, monkeypatch):
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setattr(reference_module, "AT_ONCE", SIZE[0] * 4 * SIZE[1] // 2)
    told = []
    reference(scene, SIZE, samples=4, progress=told.append)
    shares = [text.rpartition(", ")[2] for text in told if text.endswith("%")]
    assert shares[0] == "50%" and shares[-1] == "100%"


def test_where_nearly_all_is_silhouettes_nearer_ones_count(known):
    assert known.edge_width == 1.0
    lattice = rm.Scene(rm.gyroid() & rm.sphere(2))
    found = reference(lattice, (96, 54), samples=0)
    assert found.edge_width in reference_module.EDGE_WIDTHS
    assert (found.hit & ~found.edges).sum() >= 0.5 * found.hit.sum()
    assert reference(rm.Scene(rm.mandelbulb()), (48, 27), samples=0).edge_width == 1.0


def test_it_is_computed_once(known, monkeypatch):
    monkeypatch.setattr(reference_module, "_compute", lambda *_: pytest.fail("computed again"))
    again = reference(make_scene(), SIZE, samples=4)
    assert np.array_equal(again.depth, known.depth)
    assert (again.samples, again.pixel) == (4, known.pixel)


def other_scenes() -> dict[str, rm.Scene]:
    made = {}
    for name in ("lights", "sky", "fog", "camera", "node", "material", "barely"):
        scene = make_scene()
        match name:
            case "lights":
                scene = scene.replace(lights=(rm.Sun(shadow=False),))
            case "sky":
                scene = scene.replace(sky=rm.Sky((1, 0, 0)))
            case "fog":
                scene = scene.replace(fog=rm.Fog())
            case "camera":
                scene = scene.replace(camera=rm.Camera(position=(1.5, 1.2, 4), target=(0, 0.5, 0), fov=45.0001))
            case "node":
                scene = scene.replace(node=scene.node | rm.sphere(0.1).translate((0, 3, 0)))
            case "material":
                scene = make_scene((1.0, 0.0, 0.0))
            case "barely":
                scene = scene.replace(node=scene.node.translate((0, 1e-13, 0)))
        made[name] = scene
    return made


def test_another_scene_has_another_key():
    keys = [content_key(make_scene()), *(content_key(s) for s in other_scenes().values())]
    assert len(set(keys)) == len(keys)
    assert content_key(make_scene(), 1) != content_key(make_scene(), 2)


def test_quality_and_place_in_the_file_do_not_count():
    other = make_scene()
    other = other.replace(quality=rm.Quality(tracer="plain"))
    assert content_key(other) == content_key(make_scene())


def test_a_model_that_the_truth_follows_counts():
    other = make_scene()
    other = other.replace(quality=rm.Quality(masking="separable"))
    assert content_key(other) != content_key(make_scene())


def test_the_key_is_the_same_in_another_process(scene):
    root = Path(__file__).parents[2]
    code = (
        "from tests.cost.cost_samples import make_scene; from raymarch.cost.content import content_key;"
        "print(content_key(make_scene()))"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code],
        cwd=root,
        env=os.environ | {"PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert answer.stdout.strip() == content_key(scene)


def test_shared_parts_do_not_make_it_slow():
    node = rm.sphere(0.5)
    for k in range(60):  # as a tree it would have 2^60 leaves
        node = rm.union(node, node.translate((0.1 * k, 0, 0)), k=0.05) if k < 12 else node.rotate(0.1)
    assert len(content_key(rm.Scene(node))) == 64


@pytest.mark.parametrize("spoil", ["empty", "text", "cut"])
def test_a_spoiled_file_is_made_anew(scene, tmp_path, monkeypatch, spoil):
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    first = reference(scene, (16, 9))
    (file,) = (tmp_path / "truth").glob("*.npz")
    content = file.read_bytes()
    file.write_bytes({"empty": b"", "text": b"hello", "cut": content[: len(content) // 2]}[spoil])
    assert np.array_equal(reference(scene, (16, 9)).depth, first.depth)
    assert file.read_bytes() == content
    assert [p.name for p in file.parent.iterdir()] == [file.name]


@pytest.mark.parametrize("folder", ["", "/dev/null/nowhere"])
def test_without_a_cache_it_works_too(scene, monkeypatch, folder):
    monkeypatch.setenv(VARIABLE, folder)
    assert reference(scene, (16, 9)).hit.any()


@pytest.mark.parametrize("samples", [2, 289, -4])
def test_samples_are_a_square(scene, samples):
    with pytest.raises(ValueError, match="square"):
        reference(scene, (16, 9), samples=samples)


def test_an_estimate_has_no_floor():
    known = reference(rm.Scene(rm.mandelbulb()), (16, 9))
    assert np.all(known.floor == -1)


def test_geometry_alone(scene, known):
    plain = reference(scene, SIZE, samples=0)
    assert np.array_equal(plain.depth, known.depth)
    assert np.array_equal(plain.edges, known.edges)
    assert not plain.picture.any()
    assert np.all(plain.floor == -1)


def test_geometry_is_that_of_every_quality(scene, known, monkeypatch):
    reference(scene, SIZE, samples=0)
    monkeypatch.setattr(reference_module, "_compute", lambda *_: pytest.fail("computed again"))
    other = make_scene()
    other = other.replace(quality=rm.Quality.preset("exact"))
    assert np.array_equal(reference(other, SIZE, samples=0).depth, known.depth)


CAMERAS = {
    "orthographic": {"projection": "orthographic", "height": 3.0},
    "clip planes": {"near": 4.2, "far": 5.6},
    "lens": {"aperture": 0.3, "focus": 2.0},
    "shutter": {"shutter": 0.6},
}


@pytest.mark.parametrize("kind", CAMERAS)
def test_cameras_of_every_kind_are_measured(kind):
    blurs = kind in ("lens", "shutter")
    ball = rm.sphere(0.7).translate((0.5 + 0.2 * rm.sin(8 * rm.time), 0.5, 0))
    solid = rm.union(rm.box(1.2), ball, k=0.2)  # marched
    camera = rm.Camera((2, 2, 4), target=(0, 0, 0), **CAMERAS[kind])
    scene = rm.Scene(solid, camera, quality=rm.Quality(tracer="bracketing", samples=64 if blurs else 1))
    known = reference(scene, (32, 18), samples=36 if blurs else 1)
    with rm.Renderer(known.size) as renderer:
        found = sweep(scene, [Setting("base", scene.quality)], known, renderer, repeats=1)
        checks = check(found, scene, renderer)
    base = found.base
    assert base.errors.sound
    assert base.errors.pixels > 30
    assert base.errors.pixels_p99 < 0.05
    assert base.evaluations >= found.floor
    assert all(c.holds for c in checks if c.name.startswith("hits"))
    if blurs:
        sharp = scene.replace(camera=camera.replace(aperture=0.0, shutter=0.0))
        blind = flip(reference(sharp, known.size, samples=36).picture, base.color)
        assert base.errors.flip_mean < 0.6 * blind.mean(), "it is not that of the sharp picture"


def test_instances_have_a_key_that_depends_on_their_materials() -> None:
    """Also those that are more than the reference spells out."""
    places = np.random.default_rng(0).uniform(-9, 9, (2500, 3))

    def key(color: float, radius: float = 0.2) -> str:
        colors = np.full((2500, 3), 0.5)
        colors[7] = color
        marked = rm.sphere(radius).material(rm.Material("red")) | rm.box(0.1)
        return content_key(rm.Scene(rm.instances(marked, places, colors)))

    assert key(0.5) == key(0.5)
    assert len({key(0.5), key(0.25), key(0.5, 0.21)}) == 3
