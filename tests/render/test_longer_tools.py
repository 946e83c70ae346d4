"""Effects that read distances see no end of a tool at a face, or soon beyond it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import raymarch as rm
from raymarch.sdf.tools import with_longer_tools

PLATE = rm.box((40, 10, 40))
FLOOR = rm.plane(offset=-20).material(rm.Material(color=(0.8, 0.8, 0.8), specular=0, ambient=0))
BELOW = rm.Camera((0, -10, 0), (0, -20, 0), up=(0, 0, -1), fov=2 * np.degrees(np.arctan(2.0)))
"""Sees the floor below a plate from -20 to 20."""
SUN = (0.1, 1.0, 0.05)
SIZE = 32


@pytest.fixture(scope="module")
def renderer() -> Iterator[rm.Renderer]:
    with rm.Renderer(size=(SIZE, SIZE)) as made:
        yield made


def seen(softness: float) -> np.ndarray:
    """The fraction of the sun's disc that a row of the floor sees through the hole, by rays to it in closed form."""
    k = np.arange(2048) + 0.5
    far, turn = softness * np.sqrt(k / 2048), 2.399963 * k
    axis = np.array(SUN) / np.linalg.norm(SUN)
    right = np.cross(axis, (1, 0, 0)) / np.linalg.norm(np.cross(axis, (1, 0, 0)))
    ways = axis + far[:, None] * (np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * np.cross(axis, right))
    ways /= ways[:, 1:2]
    x = ((np.arange(SIZE) + 0.5) / SIZE * 2 - 1) * 20
    starts = np.stack([x, 0 * x, 0 * x + 20 / SIZE], 1)[:, None]

    def across(height: float) -> np.ndarray:
        at = starts + height * ways
        return np.stack([np.abs(at[..., ::2]).max(-1), np.hypot(at[..., 0], at[..., 2])], 0)

    low, high = across(15), across(25)
    beside = (np.sign((starts + 15 * ways)[..., 0]) == np.sign((starts + 25 * ways)[..., 0])) & (low[0] > 20)
    return (((low[1] < 8) & (high[1] < 8)) | (beside & (high[0] > 20))).mean(axis=1)


def light(renderer: rm.Renderer, node: rm.Node, sun: rm.Sun) -> np.ndarray:
    """The visible fraction of a sun along the row."""
    scene = rm.Scene(node | FLOOR, BELOW, [sun])
    return (renderer.render(scene).color / renderer.render(scene.replace(node=FLOOR)).color)[SIZE // 2, :, 0]


@pytest.mark.parametrize(
    ("penumbra", "error", "apart"), [("two-sided", 0.01, 0.01), ("cone", 0.2, 0.03), ("triangulated", 0.2, 0.05)]
)
@pytest.mark.parametrize("softness", [0.05, 0.2])
def test_a_penumbra_goes_through_a_flush_hole(
    renderer: rm.Renderer, penumbra: str, error: float, apart: float, softness: float
) -> None:
    """As far off as below a hole by a tool of any length: 0.25 and more of the light is lost if the end is read."""
    sun = rm.Sun(SUN, shadow=True, softness=softness, penumbra=penumbra)
    flush, short, long = (light(renderer, PLATE - rm.cylinder(8, height), sun) for height in (10, 10.5, 80))
    np.testing.assert_allclose(flush, long, atol=1e-4)
    np.testing.assert_allclose(short, long, atol=1e-4)
    assert np.abs(flush - seen(softness)).mean() < error
    scene = rm.Scene(PLATE - rm.cylinder(8, 10) | FLOOR, BELOW, [sun])
    truth = rm.truth(scene, (SIZE, SIZE)).color[SIZE // 2]
    np.testing.assert_allclose(renderer.render(scene).color[SIZE // 2], truth, atol=apart)


SHIFT = rm.Param("shift", 0.0, -30.0, 30.0)
PLACED = {
    "small": (1e-3, lambda plate: plate),
    "large": (1e3, lambda plate: plate),
    "turned": (1.0, lambda plate: plate.rotate(0.4, "x").rotate(np.pi / 2, "y").rotate(0.4, "z")),
    "moved": (1.0, lambda plate: plate.translate((SHIFT, 2 * SHIFT, 3)).translate((-4, -8, -3))),
}
"""The size of a scene, and how the plate and the tool are placed. The parameter is 4."""


@pytest.mark.parametrize("name", PLACED)
def test_a_penumbra_goes_through_a_hole_of_any_size_and_place(name: str) -> None:
    size, placed = PLACED[name]
    tool = rm.cylinder(8 * size, 11 * size) | rm.box((3 * size, 12 * size, 3 * size))
    node = placed(rm.box((40 * size, 10 * size, 40 * size))) - placed(tool)
    floor = rm.plane(offset=-20 * size).material(rm.Material(color=(0.8, 0.8, 0.8), specular=0, ambient=0))
    camera = BELOW.replace(position=(0, -10 * size, 0), target=(0, -20 * size, 0))
    with rm.Renderer(size=(SIZE, SIZE)) as own:
        scenes = [rm.Scene(n, camera, [rm.Sun(SUN, shadow=True, softness=0.2)]) for n in (node | floor, floor)]
        values = {"shift": 4.0} if name == "moved" else {}
        found, lit = own.render(scenes[0], params=values).color, own.render(scenes[1]).color
    assert np.abs((found / lit)[SIZE // 2, :, 0] - seen(0.2)).mean() < 0.01


def test_occlusion_goes_through_a_flush_hole(renderer: rm.Renderer) -> None:
    found = []
    drilled = [PLATE - rm.cylinder(8, height) for height in (10, 80)]
    drilled.append((rm.rectangle((40, 40)) - rm.circle(8)).extrude(10).rotate(np.pi / 2, "x"))
    for plate in drilled:
        node = plate.translate((0, -13, 0)) | FLOOR
        sky = rm.Sky((1, 1, 1), light=True)
        scene = rm.Scene(node, BELOW.replace(position=(0, 0, 0)), [], sky, occlusion=rm.AmbientOcclusion(reach=8))
        found += [renderer.render(scene).color, rm.truth(scene, (SIZE, SIZE)).color]
    assert np.ptp(found[0]) > 0.3
    for one in found[1:]:
        np.testing.assert_allclose(found[0], one, atol=0.01)


@pytest.mark.parametrize("thickness", [5e-4, 0.05])
def test_a_thin_skin_over_a_hole_is_dark_below(renderer: rm.Renderer, thickness: float) -> None:
    """5e-4 is a thousandth of a pixel in a picture of the plate that is 90 pixels high."""
    node = PLATE - rm.cylinder(8, 20).translate((0, -5 - thickness, 0))
    for penumbra in ("two-sided", "cone", "triangulated"):
        sun = rm.Sun(SUN, shadow=True, softness=0.05, penumbra=penumbra)
        assert light(renderer, node, sun)[10:22].max() < 0.01


CUT = {
    "both ends": PLATE - rm.cylinder(8, 10),
    "blind": PLATE - rm.box((10, 5, 10)).translate((0, 2.5, 0)),
    "corner": PLATE - rm.box((20, 10, 20)).translate((10, 0, 10)),
    "turned": PLATE.rotate(0.7, (1, 2, 3)) - (rm.cylinder(8, 10) | rm.box((4, 10, 30))).rotate(0.7, (1, 2, 3)),
    "flat": (rm.rectangle((40, 40)) - rm.rectangle((20, 40)).translate((10, 0))).extrude(10),
    "extrusion": rm.plane() - rm.ring(8, 3).extrude(6).rotate(np.pi / 2, "x").translate((0, -3, 0)),
    "beside a wall": (PLATE | rm.box((10, 40, 40)).translate((25, 10, 0))) - rm.cylinder(8, 10).translate((9, 0, 0)),
    "below a wire": (PLATE | rm.capsule((-9, 14, 0), (9, 14, 0), 0.2)) - rm.cylinder(8, 10),
    "below a knob": (PLATE | rm.sphere(3).translate((23, 20, 0))) - rm.box((20, 10, 20)).translate((10, 0, 0)),
}


@pytest.mark.parametrize("name", CUT)
def test_a_longer_tool_cuts_the_same_solid(name: str) -> None:
    node = CUT[name]
    longer = with_longer_tools(node, 1.0)
    points = np.random.default_rng(0).uniform(-30, 30, (200_000, 3))
    before, after = node.distance(points), longer.distance(points)
    assert longer is not node and (after >= before - 1e-9).all() and after.max() > before.max() - 1e-9
    assert not ((before < -1e-6) & (after > -1e-6)).any()


@pytest.mark.parametrize("factor", [1e-3, 0.125, 8.0, 1e3])
def test_a_scaled_solid_has_the_tools_of_the_solid(factor: float) -> None:
    """How far a tool must reach is a length of the scene, in which the solid is scaled."""
    node = rm.sphere(0.4) - rm.box(0.5).translate((0.2, 0.2, 0.2))
    points = np.random.default_rng(3).uniform(-0.6, 0.6, (2000, 3))
    wanted = with_longer_tools(node, 0.25).distance(points)
    assert np.abs(wanted - node.distance(points)).max() > 0.02  # the tool is longer
    for scaled in (
        node.scale(factor),
        node.rotate(0.0, "x").scale(factor**0.5).translate((0, 0, 0)).scale(factor**0.5),
    ):
        made = with_longer_tools(scaled, 0.25 * factor)
        np.testing.assert_allclose(made.distance(points * factor), wanted * factor, rtol=1e-9, atol=1e-9 * factor)


@pytest.mark.parametrize("depth", [9.9, 9.9999])
def test_a_tool_that_ends_in_the_solid_stays(depth: float) -> None:
    node = PLATE - rm.cylinder(8, depth)
    assert with_longer_tools(node, 1.0) is node


def test_a_tool_that_reaches_far_enough_or_moves_stays() -> None:
    knobbed = PLATE | rm.sphere(2).translate((15, 5, 0))
    for node in (knobbed - rm.cylinder(8, 13), PLATE - rm.cylinder(8, rm.Param("height", 10.0, 8.0, 12.0))):
        assert with_longer_tools(node, 1.0) is node


def test_a_tool_that_a_parameter_moves_through_the_face_is_doubted_where_it_is_flush(renderer: rm.Renderer) -> None:
    height = rm.Param("height", 9.0, 8.0, 20.0)
    sun = rm.Sun(SUN, shadow=True, softness=0.1)
    scene = rm.Scene(PLATE - rm.cylinder(8, height) | FLOOR, BELOW, [sun])
    told = []
    for value in (9.0, 10.0, 10.5, 18.0):
        doubts = renderer.render(scene, params={"height": value}).doubts()
        told.append([what for doubt in doubts for what in ("flush with a face", "beyond a face") if what in doubt])
    assert told == [[], ["flush with a face"], ["beyond a face"], []]
