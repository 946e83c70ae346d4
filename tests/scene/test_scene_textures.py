"""Textures as a user gives them: how they lie, how their numbers are read, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import Expr
from raymarch.expr.srgb import srgb_to_linear
from raymarch.expr.walk import find
from raymarch.sdf.interaction import DPDX, DPDY, NORMAL, POSITION
from tests.support.refusals import refused

RNG = np.random.default_rng(4)
FOUR = np.array([[0.1, 0.2], [0.3, 0.4]])  # top left, top right; bottom left, bottom right


def at(value: Expr, point: Any, normal: Any = (0, 0, 1)) -> Any:
    """The value where a footprint is a point."""
    inputs = [np.array([v], np.float64) for v in (point, normal, (0, 0, 0), (0, 0, 0))]
    return evaluator([value], [POSITION, NORMAL, DPDX, DPDY])(*inputs)[0][0]


@pytest.mark.parametrize(
    ("axis", "right", "up"), [("x", (0, 0, -1), (0, 1, 0)), ("y", (1, 0, 0), (0, 0, -1)), ("z", (1, 0, 0), (0, 1, 0))]
)
def test_a_picture_is_upright_from_the_positive_end_of_its_axis(axis: str, right: Any, up: Any) -> None:
    right, up = np.array(right), np.array(up)
    assert np.array_equal(np.cross(right, up), np.eye(3)["xyz".index(axis)])  # seen from there, up is up
    laid = rm.planar(FOUR, (4, 2), axis)
    middles = [-right + 0.5 * up, right + 0.5 * up, -right - 0.5 * up, right - 0.5 * up]
    np.testing.assert_allclose([at(laid.number(POSITION), m) for m in middles], FOUR.ravel(), rtol=1e-3)
    three = rm.triplanar(FOUR, 2)
    for side in (1, -1):  # also from the other end, and not mirrored there
        normal = side * np.cross(right, up)
        found = [
            at(three.number(POSITION), 0.5 * s * side * right + 0.5 * t * up, normal) for t in (1, -1) for s in (-1, 1)
        ]
        np.testing.assert_allclose(found, FOUR.ravel(), rtol=1e-3)


def test_rotation_is_counter_clockwise_about_the_middle_that_offset_moves() -> None:
    laid = rm.planar(FOUR, 2, offset=(5, 7), rotation=np.pi / 2)
    found = [
        at(laid.number(POSITION), (5 + x, 7 + y, 0)) for x, y in ((-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))
    ]
    np.testing.assert_allclose(found, [0.2, 0.4, 0.1, 0.3], rtol=1e-3)


def test_triplanar_weights_are_powers_of_the_normal() -> None:
    laid = rm.triplanar(FOUR, 2, hardness=3)
    normal, point = np.array([0.3, -0.5, 0.81]), np.array([0.4, 0.7, -0.2])
    each = [rm.triplanar(FOUR, 2).number(POSITION)] * 3
    parts = [at(v, point, n) for v, n in zip(each, np.diag(np.sign(normal)), strict=True)]
    weights = np.abs(normal) ** 3 / np.sum(np.abs(normal) ** 3)
    np.testing.assert_allclose(at(laid.number(POSITION), point, normal), weights @ parts, rtol=1e-6)


def test_colours_of_files_are_decoded_and_numbers_are_not(tmp_path: Path) -> None:
    stored = RNG.integers(0, 256, (4, 4, 3), np.uint8)
    Image.fromarray(stored).save(tmp_path / "c.png")
    for given in (tmp_path / "c.png", stored):
        found = at(rm.planar(given, 4).color(POSITION), (-1.5, 1.5, 0))
        np.testing.assert_allclose(found, srgb_to_linear(stored[0, 0] / 255), rtol=1e-3)
        green = rm.planar(given, 4, channel="g").number(POSITION)
        np.testing.assert_allclose(at(green, (-1.5, 1.5, 0)), stored[0, 0, 1] / 255, rtol=1e-3)
    np.testing.assert_allclose(
        at(rm.planar(stored / 255.0, 4).color(POSITION), (-1.5, 1.5, 0)), stored[0, 0] / 255, rtol=1e-3
    )


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "I;16", "P"])
def test_grey_files_of_any_kind_are_numbers(mode: str, tmp_path: Path) -> None:
    grey = np.array([[0, 255], [128, 64]], np.uint8)
    wide = Image.fromarray(grey.astype(np.uint16) * 257)
    picture = wide if mode == "I;16" else Image.fromarray(grey).convert(mode)
    picture.save(tmp_path / "g.png")
    found = at(rm.planar(tmp_path / "g.png", 2).number(POSITION), (-0.5, -0.5, 0))
    assert found == pytest.approx(128 / 255, rel=1e-3)


def test_a_photo_stands_as_its_camera_was_held(tmp_path: Path) -> None:
    stored = np.array([[0, 255], [128, 64]], np.uint8)
    held = Image.Exif()
    held[274] = 6  # the orientation: the first row as stored is the right column
    Image.fromarray(stored).save(tmp_path / "p.png", exif=held)
    value = rm.planar(tmp_path / "p.png", 2).number(POSITION)
    found = [at(value, (x, y, 0)) * 255 for x, y in ((-0.5, 0.5), (0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))]
    np.testing.assert_allclose(found, [128, 0, 64, 255], atol=0.2)


def test_the_channels_of_one_picture_are_one_texture(tmp_path: Path) -> None:
    Image.fromarray(RNG.integers(0, 256, (8, 8, 3), np.uint8)).save(tmp_path / "orm.png")
    maps = {c: rm.triplanar(tmp_path / "orm.png", channel=c) for c in "rgb"}
    made = rm.Material(occlusion=maps["r"], roughness=maps["g"], metalness=maps["b"])
    assert len({node.data for node in find(made.expressions, "texture")}) == 1
    assert len(find(made.expressions, "texture")) == 3  # one for each axis, whatever reads it


def test_a_flat_normal_map_and_an_even_height_bend_nothing() -> None:
    flat = rm.planar(np.tile([0.5, 0.5, 1.0], (4, 4, 1)))
    np.testing.assert_array_equal(at(flat.normal_map_gradient(POSITION), (0.3, 0.2, 0)), 0)
    np.testing.assert_array_equal(at(rm.triplanar(np.ones((4, 4))).height_gradient(POSITION), (0.3, 0.2, 0)), 0)


def test_normals_lean_the_way_that_their_colours_say() -> None:
    """Red right and green up lean towards +u and +v: the surface falls that way."""
    lean = np.array([0.3, 0.2, 0.9]) / np.linalg.norm([0.3, 0.2, 0.9])
    colour = np.tile(0.5 + 0.5 * lean, (4, 4, 1))
    np.testing.assert_allclose(
        at(rm.planar(colour).normal_map_gradient(POSITION), (0, 0, 0)), (-1 / 3, -2 / 9, 0), rtol=2e-3
    )
    down = rm.planar(colour, green="down")
    np.testing.assert_allclose(at(down.normal_map_gradient(POSITION), (0, 0, 0)), (-1 / 3, 2 / 9, 0), rtol=2e-3)
    turned = rm.planar(colour, rotation=np.pi / 2)
    np.testing.assert_allclose(at(turned.normal_map_gradient(POSITION), (0, 0, 0)), (2 / 9, -1 / 3, 0), atol=1e-3)
    above = rm.planar(colour, axis="y")
    np.testing.assert_allclose(at(above.normal_map_gradient(POSITION), (0, 0, 0)), (-1 / 3, 0, 2 / 9), rtol=2e-3)


def test_heights_rise_by_their_differences() -> None:
    ramp = np.tile(np.arange(8) / 8.0, (4, 1))  # 1 across the picture, which is 2 wide
    found = at(rm.planar(ramp, 2, wrap="clamp").height_gradient(POSITION), (0.1, 0, 0))
    np.testing.assert_allclose(found, (0.5, 0, 0), rtol=1e-3)


def test_a_function_may_read_a_texture_where_it_wants() -> None:
    laid = rm.planar(FOUR, 2)
    made = rm.Material(albedo=lambda p: 0.5 * laid(2.0 * p), roughness=lambda p: laid.number(p))
    assert made.textured and at(made.color, (0.25, 0.25, 0))[0] == pytest.approx(0.1, rel=1e-3)


NUMBERS = ["metalness", "roughness", "transmission", "clearcoat", "clearcoat_roughness", "occlusion"]


@pytest.mark.parametrize("name", NUMBERS)
def test_a_number_of_a_material_may_be_computed_from_maps(name: str) -> None:
    grey, red = rm.planar(FOUR), rm.planar(np.stack([FOUR, 0 * FOUR, 0 * FOUR], 2), channel="r")
    half, numbers = rm.Param("half", 0.5, 0, 1), grey.number(POSITION)
    for given, wanted in [
        (grey * 0.5, numbers * 0.5),
        (np.float64(0.5) * grey, 0.5 * numbers),
        (1 - grey / 2, 1 - numbers / 2),
        (half * grey**2, half * numbers**2),
        (-grey + 1.0, -1.0 * numbers + 1.0),
        (0.5 * (grey + red), 0.5 * (numbers + red.number(POSITION))),
        (+grey * 1.0, 1.0 * numbers),
        (abs(grey - half), abs(numbers - half)),
        (rm.where(grey < 0.5, 0.2, grey), rm.where(numbers < 0.5, 0.2, numbers)),
        (rm.where(grey <= 0.3, half, 0.8), rm.where(numbers <= 0.3, half, 0.8)),
        (rm.max(grey, half), rm.max(numbers, half)),
        (rm.mix(half, 0.9, grey), rm.mix(half, 0.9, numbers)),
        (rm.where(half < 0.4, grey, 0.5), rm.where(half < 0.4, numbers, 0.5)),
        (rm.smoothstep(0.2, 0.8, grey) * (0.6 + 0.2 * rm.sin(rm.time)), None),
    ]:
        if wanted is None:
            wanted = rm.smoothstep(0.2, 0.8, numbers) * (0.6 + 0.2 * rm.sin(rm.time))
        made = rm.Material(albedo=(1, 1, 1), **{name: given})
        assert getattr(made, name) is rm.clamp(wanted, 0.0, 1.0)
        assert made.replace(ior=1.3).replace(ior=1.5) == made.replace(ior=1.5)


def test_colours_are_computed_from_maps_in_linear_rgb() -> None:
    picture, grey = rm.planar(np.full((4, 4, 3), 0.5)), rm.planar(FOUR)
    made = rm.Material(color=picture * grey * (1, 0.5, 0.25) + 0.1)
    assert made.color is rm.clamp(picture(POSITION) * grey(POSITION) * rm.vec3(1, 0.5, 0.25) + 0.1, 0.0, 1.0)
    assert rm.Material(ior=1 + grey, transmission=1).ior is rm.clamp(1 + grey.number(POSITION), 1.0, 4.0)


def test_arithmetic_of_three_projections_has_the_range_of_the_picture() -> None:
    """The weights of the projections add up to 1: what is legal for a picture is legal for three."""
    three = rm.triplanar(np.array([[0.2, 0.9], [0.4, 0.6]]))
    for name in NUMBERS:
        rm.Material(albedo=(1, 1, 1), **{name: three / 0.9})
        with pytest.raises(rm.SceneError, match=f"{name}: .* gives values from 0[.3-9]* to 1.8"):
            rm.Material(albedo=(1, 1, 1), **{name: 2 * three})
    for value in (three * 0.5, 1 - three, three * three, three + 0.1, (three * rm.planar(FOUR)) / 0.9):
        rm.Material(color=value, roughness=value)
        rm.Material(shininess=1 + value, specular=value, ambient=value, emission=value)
    with pytest.raises(rm.SceneError, match=r"color: .* from -0.[45]\d* to 0.2"):
        rm.Material(color=0.4 - three)


def test_colours_are_chosen_by_comparison_of_maps() -> None:
    grey = rm.planar(FOUR)
    made = rm.Material(color=rm.where(grey < 0.5, "red", (0, 0, 1))).color
    assert made is rm.clamp(rm.where(grey.number(POSITION) < 0.5, rm.vec3(1, 0, 0), rm.vec3(0, 0, 1)), 0.0, 1.0)
    for wrong, words in (
        (lambda: rm.Material(roughness=grey < 0.5), ["roughness", "bool"]),
        (lambda: rm.Material(roughness=0.2 if grey < 0.5 else 0.8), ["no truth value", "rm.where"]),
    ):
        refused(wrong, *words)


def refusals() -> list[tuple[Any, list[str]]]:
    picture, big = np.full((4, 4, 3), 0.5), np.zeros((2, 4097))
    return [
        (lambda: rm.planar("missing.png"), ["missing.png", "no file"]),
        (lambda: rm.triplanar(big), ["4097"]),
        (lambda: rm.triplanar(np.zeros((4, 4, 5))), ["(4, 4, 5)"]),
        (lambda: rm.triplanar(np.full((4, 4), np.nan)), ["finite"]),
        (lambda: rm.triplanar(7), ["7"]),
        (lambda: rm.triplanar(picture, hardness=0), ["hardness", "0"]),
        (lambda: rm.triplanar(picture, size=-1), ["size", "-1"]),
        (lambda: rm.planar(picture, size=(1, 2, 3)), ["size"]),
        (lambda: rm.planar(picture, axis="w"), ["axis", "'w'"]),
        (lambda: rm.planar(picture, wrap="tile"), ["wrap", "'mirror'"]),
        (lambda: rm.planar(picture, channel="a"), ["channel", "'a'"]),
        (lambda: rm.planar(picture, green="left"), ["green"]),
        (lambda: rm.planar(picture, offset=1), ["offset"]),
        (lambda: rm.Material(roughness=rm.planar(np.eye(3)[None])), ["roughness", "3 channels", "channel="]),
        (lambda: rm.Material(roughness=rm.planar(2 * FOUR + 0.5)), ["roughness", "1.3"]),
        (lambda: rm.Material(albedo=rm.planar(2 * picture + 0.1)), ["albedo", "1.1"]),
        (lambda: rm.Material(roughness=rm.planar(np.eye(3)[None]) * 0.5), ["roughness", "3 channels", "channel="]),
        (lambda: rm.Material(roughness=rm.planar(FOUR) * (1, 0.5, 0)), ["roughness", "vec3", "numbers"]),
        (lambda: rm.Material(roughness=lambda p: rm.planar(FOUR)(p) * 0.5), ["roughness", "vec3", "number(p)"]),
        (lambda: rm.Material(ior=rm.planar(FOUR) * 0.1, transmission=1), ["ior", "* 0.1", "from 1 to 4"]),
        (lambda: rm.Material(height=rm.planar(FOUR) * 0.1), ["height", "height_scale"]),
        (lambda: rm.Material(normal=rm.planar(picture) * 0.1), ["normal", "normal_strength"]),
        (lambda: rm.planar(FOUR) * rm.sphere(), ["texture: arithmetic", "sphere"]),
        (lambda: rm.Material(normal=rm.planar(FOUR)), ["normal", "channel"]),
        (lambda: rm.Material(normal=picture), ["normal"]),
        (lambda: rm.Material(height=0.5), ["height"]),
        (lambda: rm.Material(height=lambda p: p), ["height", "vec3"]),
        (lambda: rm.Material(height=lambda p: rm.planar(FOUR).number(p)), ["height", "texture"]),
        (lambda: rm.Material(albedo="wood.png"), ["albedo", "wood.png", "triplanar"]),
        (lambda: rm.Material(roughness=FOUR), ["roughness", "(2, 2)", "planar"]),
        (lambda: rm.Material(occlusion=2), ["occlusion", "2"]),
        (lambda: rm.Material(normal_strength=-1), ["normal_strength"]),
    ]


@pytest.mark.parametrize("case", range(len(refusals())))
def test_what_is_wrong_is_named(case: int) -> None:
    make, words = refusals()[case]
    refused(make, *words)


def test_a_broken_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "b.png").write_bytes(b"\x89PNG\r\n\x1a\n and no more")
    refused(lambda: rm.triplanar(tmp_path / "b.png"), "b.png", "cannot read")


def test_a_map_of_another_size_than_the_albedo_is_refused() -> None:
    wood, small = np.full((8, 8, 3), 0.5), np.full((4, 8), 0.5)
    refused(
        lambda: rm.Material(albedo=rm.planar(wood), metalness=rm.planar(small)), "metalness", "8 x 4", "albedo", "8 x 8"
    )
    rm.Material(albedo=rm.planar(wood), metalness=rm.planar(small, size=3))  # laid otherwise: another picture


def test_more_grids_than_any_driver_takes_are_named() -> None:
    """Pictures share textures, sampled grids do not."""
    centre = np.pad([[[-1.0]]], 1)
    parts = [rm.grid(centre + 0.01 * (k + 1)).translate((3 * k, 0, 0)) for k in range(17)]
    with pytest.raises(rm.PlanError, match="17 textures") as caught:
        _assembled(rm.Scene(rm.union(*parts)))
    assert "0 pictures" in str(caught.value) and "16" in str(caught.value)
    _assembled(rm.Scene(rm.union(*parts[:16])))


def _assembled(scene: rm.Scene) -> None:
    from raymarch.plan import plan
    from raymarch.shader import assemble

    assemble(plan(scene))


def test_a_picture_of_more_than_16_bits_is_refused(tmp_path: Path) -> None:
    Image.fromarray(np.full((2, 2), 200_000, np.int32)).save(tmp_path / "deep.tif")
    with pytest.raises(rm.SceneError, match="16 bits"):
        rm.Material(roughness=rm.planar(tmp_path / "deep.tif", 1.0))


def test_arithmetic_of_maps_is_checked_for_the_values_that_they_have() -> None:
    """One white texel of 64 x 64 suffices. Read twice, a texture is one; rm.clamp makes all legal."""
    spike, ramp = np.zeros((64, 64)), np.linspace(0, 1, 64 * 64).reshape(64, 64)
    spike[33, 47] = 1.0
    white, grey = rm.planar(spike, 1, "y"), rm.planar(ramp, 1, "y")

    def material(value: Any) -> rm.Material:
        return rm.Material(albedo=(0.5, 0.5, 0.5), roughness=value)

    for value, ends in (
        (3 * white, "from 0 to 3"),
        (0.2 + 0.9 * grey, "from 0.2 to 1.1"),
        (grey - 0.2, "from -0.2 to 0.8"),
    ):
        with pytest.raises(rm.SceneError, match=f"gives values {ends} .values from 0 to 1.") as caught:
            material(value)
        assert __file__ in str(caught.value)
    for value in (grey - 0.5 * grey, 4 * grey * (1 - grey), rm.clamp(3 * white, 0, 1), rm.max(grey, 0.1) ** 0.5):
        material(value)
    assert repr(rm.mix(0.1, 0.9, grey)).startswith("mix(0.1, 0.9, Texture(")
    blue = rm.Material(albedo=rm.mix("red", "blue", grey)).albedo
    assert blue.type is rm.Material(albedo="red").albedo.type
