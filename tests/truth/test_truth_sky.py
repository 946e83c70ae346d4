"""Skies, their light, ambient occlusion, patterns and pictures, against closed forms."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from raymarch.errors import SceneError
from raymarch.expr.images import read_image, write_channels
from raymarch.scene import (
    AmbientOcclusion,
    Camera,
    GradientSky,
    ImageSky,
    Material,
    Param,
    Scene,
    Sky,
    Sun,
    SunSky,
    checker,
    noise,
    stripes,
)
from raymarch.scene.parameter import Values, set_values
from raymarch.scene.sky import harmonics_at
from raymarch.scene.tone import LUMINANCE
from raymarch.sdf import box, plane, sphere
from raymarch.sdf.node import Node
from raymarch.truth import truth
from tests.support.refusals import refused

ABOVE = Camera((0, 5, 0), (0, 0, 0), up=(0, 0, 1))
AHEAD = Camera((0, 0, 4), (0, 0, 0))
NOW = Values({})
MATTE = Material((0.6, 0.3, 0.2), specular=0, ambient=0)


def directions(n: int = 200) -> Any:
    d = np.random.default_rng(3).normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def test_a_plane_under_a_constant_sky_has_its_albedo() -> None:
    made = truth(Scene(plane().material(MATTE), camera=ABOVE, lights=[], sky=Sky((1, 1, 1), light=True)), (3, 3))
    np.testing.assert_allclose(made.color, np.broadcast_to((0.6, 0.3, 0.2), (3, 3, 3)), rtol=1e-6)


@pytest.mark.parametrize("metalness", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 0.3, 1.0])
def test_no_surface_gives_more_than_a_white_sky_gives(metalness: float, roughness: float) -> None:
    skin = Material(albedo=(1, 1, 1), metalness=metalness, roughness=roughness)
    scene = Scene(
        sphere().material(skin), camera=Camera((0, 0, 4), (0, 0, 0)), lights=[], sky=Sky((1, 1, 1), light=True)
    )
    made = truth(scene, (41, 41))
    assert made.color[made.hit].max() <= 1.005


def test_harmonics_are_the_mean_light_of_each_half_of_the_sky() -> None:
    """For a gradient, whose true mean is known by quadrature; a constant sky is itself."""
    sky = GradientSky((0.2, 0.4, 0.9), (0.9, 0.8, 0.7), (0.3, 0.2, 0.1))
    around = directions(40_000)
    seen = sky.radiance_along(around, NOW)
    for n in directions(20):
        weight = np.maximum(around @ n, 0.0)
        wanted = (weight[:, None] * seen).sum(axis=0) / weight.sum()
        found = harmonics_at(n[None, :])[0] @ sky.harmonics(NOW)
        np.testing.assert_allclose(found, wanted, atol=0.02)
    flat = harmonics_at(directions(9)) @ Sky((0.2, 0.5, 0.8)).harmonics(NOW)
    np.testing.assert_allclose(flat, np.broadcast_to((0.2, 0.5, 0.8), (9, 3)), atol=2e-3)


def test_harmonics_are_orthonormal() -> None:
    basis = harmonics_at(directions(400_000))
    np.testing.assert_allclose(basis.T @ basis / len(basis), np.eye(9), atol=0.02)


def test_a_sky_is_seen_where_nothing_is_hit() -> None:
    made = truth(Scene(sphere(0.2), camera=Camera((0, 0, 4), (0, 0, 0)), lights=[], sky=Sky(lambda d: d * d)), (9, 9))
    np.testing.assert_allclose(made.color[~made.hit], made.direction[~made.hit] ** 2, atol=1e-12)


def test_a_clear_sky_is_brightest_at_its_sun_and_bluer_away_from_it() -> None:
    sky = SunSky((1, 1, 0))
    sun, beside, opposite = sky.radiance_along(np.array([[0.707, 0.707, 0], [0, 1, 0], [-0.707, 0.707, 0]]), NOW)
    assert (
        sun.sum() > 2 * beside.sum() > 0
        and opposite[2] > opposite[0]
        and np.isfinite(sky.radiance_along(directions(), NOW)).all()
    )
    assert sky.radiance_along(directions(), NOW).min() >= 0
    assert isinstance(sky.sun(shadow=True), Sun)
    low, high = (np.ravel(NOW.of(SunSky((1, h, 0)).sun().color)) for h in (0.05, 5.0))
    assert low[2] / low[0] < 0.5 < high[2] / high[0]


@pytest.mark.parametrize("sky", [GradientSky(light=True), SunSky(light=True), SunSky((0.5, 1, 0.7), light=True)])
def test_the_defaults_have_the_contrast_of_daylight_and_do_not_clip(sky: Sky) -> None:
    """The floor: 4 to 6 times as bright in the sun as in the shadow. A ball of albedo 0.8 is white towards the sun."""
    sun = sky.sun() if isinstance(sky, SunSky) else Sun()
    camera = Camera((2.0, 4.0, 3.0), (0, 0, 0))

    def brightest(node: Node, lights: list[Sun]) -> float:
        painted = node.material(Material(albedo=(0.8, 0.8, 0.8), roughness=1, f0=0))
        made = truth(Scene(painted, camera=camera, lights=lights, sky=sky), (21, 21))
        return float((made.color[made.hit] @ LUMINANCE).max())

    assert 4.0 < brightest(plane(), [sun]) / brightest(plane(), []) < 6.0
    assert 0.5 < brightest(plane(), [sun]) < 0.85 and brightest(sphere(), [sun]) < 1.02


def test_the_time_of_day_may_be_a_parameter() -> None:
    height = Param("height", 1.0, 0.0, 3.0)
    scene = Scene(sphere(), sky=SunSky((1, height, 0), light=True))
    assert "height" in scene.parameters
    values = [set_values(scene.parameters, {"height": h}) for h in (0.1, 3.0)]
    assert not np.allclose(*(scene.sky.harmonics(v) for v in values))


# AmbientOcclusion


def test_occlusion_leaves_a_plane_alone_and_darkens_a_corner() -> None:
    sky = Sky((1, 1, 1), light=True)
    wall = box((2, 4, 8)).translate((-1, 0, 0))
    white = Material((1, 1, 1), specular=0, ambient=0)
    scene = Scene(
        (plane() | wall).material(white),
        camera=ABOVE,
        lights=[],
        sky=sky,
        occlusion=AmbientOcclusion(4, 1.0, decay=1.0),
    )
    made = truth(scene, (60, 3))
    where = made.position + made.depth[..., None] * made.direction
    floor = (np.abs(where[..., 1]) < 1e-6) & (where[..., 0] > 0)
    x = where[..., 0][floor]
    shown = made.color[..., 0][floor]
    assert np.any(x < 1.0) and np.allclose(shown[x > 1.0], 1.0, atol=1e-6)
    steps = np.array([0.25, 0.5, 0.75, 1.0])
    wanted = np.mean(np.clip(np.minimum(x[:, None], steps) / steps, 0, 1), axis=1)
    np.testing.assert_allclose(shown, wanted, atol=1e-6)


def test_occlusion_dims_the_ambient_share_of_phong() -> None:
    glow = Material((1, 1, 1), specular=0, ambient=1.0)
    node = (plane() | box((2, 4, 8)).translate((-1.1, 0, 0))).material(glow)
    light = [Sun((0, -1, 0))]  # from below: only the ambient share is seen
    plain, dimmed = (
        truth(Scene(node, camera=ABOVE, lights=light, occlusion=o), (9, 3)).color
        for o in (None, AmbientOcclusion(strength=0.5))
    )
    assert np.all(dimmed <= plain + 1e-12) and dimmed.min() < 0.9 * plain.min()


# Patterns


def test_patterns_are_what_they_are_called() -> None:
    def values(pattern: Any) -> Any:
        made = Scene(plane().material(Material(pattern, specular=0, ambient=0)), camera=ABOVE, lights=[Sun((0, 1, 0))])
        picture = truth(made, (40, 40))
        return (picture.position + picture.depth[..., None] * picture.direction), picture.color[..., 0]

    where, board = values(checker(1.0, 0.0, 0.5))
    cell = np.floor(where / 0.5 + 0.25).sum(axis=-1) % 2
    assert np.array_equal(board > 0.5, cell < 0.5) and 0.3 < board.mean() < 0.7
    where, layers = values(stripes((1, 1, 1), (0, 0, 0), 0.25, "z"))
    assert np.array_equal(layers > 0.5, np.floor(where[..., 2] / 0.25) % 2 < 0.5)
    _, clouds = values(noise(0.0, 1.0, 0.5))
    assert 0.0 <= clouds.min() < 0.4 and 0.6 < clouds.max() <= 1.0
    assert np.abs(np.diff(clouds, axis=0)).max() < 0.5


# Pictures


def radiance_file(path: Path, pixels: Any, packed: bool) -> None:
    """A Radiance picture, written by hand."""
    height, width = pixels.shape[:2]
    largest = pixels.max(axis=-1)
    exponent = np.where(largest > 0, np.ceil(np.log2(np.maximum(largest, 1e-30))), -128).astype(int)
    rgb = np.clip(np.floor(pixels / np.exp2(exponent - 8.0)[..., None]), 0, 255)
    rgbe = np.concatenate([rgb, (exponent + 128)[..., None]], axis=-1).astype(np.uint8)
    body = b""
    for row in rgbe:
        if not packed:
            body += row.tobytes()
            continue
        body += struct.pack(">BBH", 2, 2, width)
        for c in range(4):
            first = row[:, c]
            body += bytes([128 + 4, first[0]]) if np.all(first[:4] == first[0]) else bytes([4, *first[:4]])
            body += bytes([width - 4, *first[4:]])
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {height} +X {width}\n".encode() + body)


def picture() -> Any:
    return np.random.default_rng(2).uniform(0.0, 1.0, (6, 12, 3)) * np.exp2(np.arange(6) - 3)[:, None, None]


@pytest.mark.parametrize("packed", [True, False])
def test_a_radiance_picture_is_read_to_its_eight_bits(tmp_path: Path, packed: bool) -> None:
    pixels = picture()
    pixels[0, :4] = 0.25
    radiance_file(tmp_path / "sky.hdr", pixels, packed)
    read = read_image("test", tmp_path / "sky.hdr")
    assert np.abs(read - pixels).max(axis=-1).max() < np.max(pixels) / 128
    assert np.all(np.abs(read - pixels) <= pixels.max(axis=-1, keepdims=True) / 128 + 1e-9)


def test_an_exr_picture_comes_back_as_it_was(tmp_path: Path) -> None:
    pixels = picture().astype(np.float32)
    write_channels(tmp_path / "sky.exr", {"RGB": pixels})
    assert np.array_equal(read_image("test", tmp_path / "sky.exr"), pixels)


def test_a_common_picture_is_read_as_srgb(tmp_path: Path) -> None:
    Image.new("RGB", (4, 2), (188, 0, 255)).save(tmp_path / "sky.png")
    np.testing.assert_allclose(read_image("test", tmp_path / "sky.png")[0, 0], (0.5029, 0, 1), atol=1e-4)


def test_a_picture_of_the_sky_stands_where_it_should(tmp_path: Path) -> None:
    """Its middle is along -z, its right half along +x, its top row up; the seam is closed."""
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[:, 64:, 0] = 1.0  # the right half: x > 0
    pixels[:32, :, 1] = 1.0  # the upper half
    write_channels(tmp_path / "sky.exr", {"RGB": pixels})
    sky = ImageSky(tmp_path / "sky.exr")
    right, left, up, ahead = (
        sky.radiance_along(np.array([d], np.float64), NOW)[0]
        for d in ((1, 0.2, -1), (-1, 0.2, -1), (0, 1, 0), (0, 0, -1))
    )
    assert right[0] == 1 and left[0] == 0 and right[1] == left[1] == up[1] == 1 and 0 < ahead[0] < 1
    turned = ImageSky(tmp_path / "sky.exr", rotation=np.pi)
    assert turned.radiance_along(np.array([[1, 0.2, -1.0]]), NOW)[0, 0] == 0
    seam = sky.radiance_along(np.array([[1e-4, 0.2, 1.0], [-1e-4, 0.2, 1.0]]), NOW)[:, 0]
    assert abs(seam[0] - seam[1]) < 0.1


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("missing.hdr", None, ("cannot read", "No such file")),
        ("broken.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 9\nabc", ("cannot read", "too early")),
        ("noise.hdr", b"nothing of the kind", ("cannot read", "no header")),
        ("broken.exr", b"nothing of the kind", ("cannot read",)),
        ("broken.png", b"nothing of the kind", ("cannot read",)),
    ],
)
def test_a_bad_picture_is_refused_with_the_line(tmp_path: Path, name: str, content: bytes | None, words: Any) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError) as caught:
        ImageSky(tmp_path / name)
    assert all(word in str(caught.value) for word in (*words, "test_truth_sky.py:", "ImageSky", name))


def test_a_picture_beyond_the_limit_is_refused(tmp_path: Path) -> None:
    Image.new("L", (2047, 1)).save(tmp_path / "wide.png")
    with pytest.raises(SceneError, match="2047 x 1 pixels"):
        ImageSky(tmp_path / "wide.png")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sky((-1, 0, 0)), ("Sky: color", ">= 0")),
        (lambda: Sky(lambda d: d.x), ("the function gives a float",)),
        (lambda: Sky(light=-1), ("light = -1", "a factor >= 0")),
        (lambda: GradientSky(zenith=3), ("GradientSky: zenith",)),
        (lambda: SunSky(turbidity=1), ("turbidity = 1",)),
        (lambda: SunSky((0, 0, 0)), ("sun_direction",)),
        (lambda: AmbientOcclusion(steps=0), ("steps = 0", "1 to 32")),
        (lambda: AmbientOcclusion(reach=0), ("reach = 0",)),
        (lambda: Scene(sphere(), occlusion=3), ("occlusion = 3",)),
        (lambda: checker((1, 0, 0), (1, 0)), ("checker", "two numbers")),
        (lambda: stripes(0, 1, axis="w"), ("axis = 'w'",)),
        (lambda: noise(0, 1, octaves=0), ("octaves = 0",)),
    ],
)
def test_what_cannot_be_is_refused(make: Any, words: tuple[str, ...]) -> None:
    refused(make, *words)
