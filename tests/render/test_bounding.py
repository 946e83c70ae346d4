"""Costly operands in boxes: no value of the field changes, whatever they are skipped for."""

from __future__ import annotations

import base64
import re
import zlib
from importlib import import_module
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.walk import find
from raymarch.gpu import camera_field
from raymarch.plan import bounding, plan
from raymarch.plan.hoisting import with_hoisted
from raymarch.scene.parameter import Values
from raymarch.shader.assemble import assemble

SUN = rm.Sun(sun_direction=(0.5, 1, 0.4), shadow=True)
RED = rm.Material(color=(0.8, 0.2, 0.1))
PATTERNS = ((0.05, "x"), (0.2, "y"))


def solid(seed: int, moved: Any = 0.0) -> rm.Node:
    """A random union: exact fields and bounds, boxes that overlap, a blend, a union below a transform, materials."""
    random = np.random.default_rng(seed)
    shapes = (rm.torus(0.4, 0.15), rm.menger(0.7, 2), rm.box((0.8, 0.3, 0.5)) - rm.sphere(0.3), rm.octahedron(0.5))
    placed = [
        shape.rotate(random.uniform(-3, 3), "x").translate(tuple(random.uniform(-0.9, 0.9, 3))) for shape in shapes
    ]
    inner = (placed[0] | placed[1].material(RED)).rotate(0.4, "y").scale(0.8)
    blend = rm.union(placed[2], rm.sphere(0.3), k=0.2).translate((moved, 0.2, 0))
    return rm.union(inner, blend, placed[3].material(RED), rm.box((4, 0.2, 4)).translate((0, -1.1, 0)).round(0.02))


def values(node: rm.Node, points: np.ndarray, **change: Any) -> np.ndarray:
    """The planned field at some points, in float64."""
    quality = rm.Quality(analytic=False, **change)
    made = plan(rm.Scene(node, rm.Camera((1, 1, 3)), quality=quality))
    return evaluator([made.field.body], made.field.params)(points - made.origin)[0]


POINTS = np.random.default_rng(0).uniform(-2.5, 2.5, (4000, 3))


@pytest.mark.parametrize("seed", range(6))
def test_no_value_of_the_field_changes(seed: int) -> None:
    node = solid(seed)
    assert plan(rm.Scene(node, quality=rm.Quality(bounding_volumes=True))).bounding.used
    np.testing.assert_allclose(values(node, POINTS, bounding_volumes=True), node.distance(POINTS), rtol=0, atol=1e-12)


def test_a_limit_that_ignores_negative_distances_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Boxes that overlap: with no distance kept above 0, the deeper of two solids is skipped."""
    node = rm.box(1.0) | rm.box(1.2).translate((0.3, 0, 0))
    monkeypatch.setattr(bounding, "SOME", -10.0)
    wrong = values(node, POINTS, bounding_volumes=True)
    assert np.abs(wrong - node.distance(POINTS)).max() > 0.01


def test_the_picture_stays_with_shadow_occlusion_mirror_and_patterns(
    renderer: rm.Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    checker = rm.Material(color=lambda p: rm.where(rm.sin(9 * p.x) * rm.sin(9 * p.z) > 0.0, 0.9, 0.2) * rm.vec3(1.0))
    mirror = rm.Material(albedo=(0.9, 0.9, 0.9), metalness=1, roughness=0)
    balls = (rm.sphere(0.4) | rm.torus(0.5, 0.1).material(RED)).translate((0.3, 0.1, 0))
    blend = rm.union(rm.box(0.5), rm.sphere(0.3).translate((0, 0.3, 0)), k=0.2).translate((-0.7, 0, -0.3))
    node = rm.union(balls, blend, rm.sphere(0.4).translate((-0.5, 0.1, 0.8)).material(mirror), rm.plane(offset=-0.4))
    frames = []
    monkeypatch.setattr(camera_field, "CHEAP", 0)  # else rays start with other steps where boxes add operations
    for choice in (True, False):
        quality = rm.Quality(analytic=False, integrator="whitted", bounding_volumes=choice)
        camera, occlusion = rm.Camera((1.8, 1.2, 2.6)), rm.AmbientOcclusion()
        scene = rm.Scene(node.material(checker), camera, [SUN], occlusion=occlusion, bounces=1, quality=quality)
        frames.append(renderer.render(scene, outputs=("color", "depth", "normal", "material")))
    on, off = frames
    np.testing.assert_allclose(on.depth, off.depth, rtol=2e-6)
    np.testing.assert_array_equal(on.material, off.material)
    np.testing.assert_allclose(on.normal, off.normal, atol=2e-4)
    np.testing.assert_allclose(on.color, off.color, atol=2e-4)


def test_patterns_that_read_the_footprint_stay_inside_of_a_transform(renderer: rm.Renderer) -> None:
    """Checkers are filtered over the pixel's footprint, which has other axes in the space of the union."""
    checkers = [
        rm.Material(albedo=rm.checker((0.9, 0.2, 0.1), (0.1, 0.1, 0.1), size, axis=axis))
        for size, axis in ((0.05, "x"), (0.2, "y"))
    ]
    balls = (rm.torus(0.6, 0.2).material(checkers[0]) | rm.box((0.6, 0.4, 0.8)).material(checkers[1])).rotate(0.7, "z")
    node = balls.scale((1.4, 0.7, 1.0)).translate((0.1, 0.2, 0)) | rm.plane(offset=-0.4).material(checkers[1])
    scene = rm.Scene(node, rm.Camera((1.8, 1.2, 2.6)), [SUN])
    # A pattern is read below the hit by its residual, a sixteenth of an epsilon at most. Rows take other steps.
    for epsilon, share, most in ((0.1, 0.01, 0.01), (0.003, 1e-3, 1e-3)):
        frames = []
        for choice in ({"bounding_volumes": True}, {"objects": "data"}, {"objects": "text"}):
            quality = rm.Quality(analytic=False, epsilon=epsilon, **choice)
            frames.append(renderer.render(scene.replace(quality=quality)).color)
        boxes, rows, text = frames
        for other, part in ((boxes, 1e-3), (rows, share)):
            difference = np.abs(other - text)
            assert np.mean(difference > 2e-4) < part and difference.max() < most


@pytest.mark.parametrize("x", [-1.5, 1.4])
def test_a_box_holds_over_the_range_of_a_param(x: float) -> None:
    node = solid(5, rm.Param("x", 0.0, -1.5, 1.5))
    with bound({"x": x}, 0.0):
        np.testing.assert_allclose(values(node, POINTS, bounding_volumes=True), node.distance(POINTS), atol=1e-12)


def test_a_solid_that_time_moves_is_evaluated_in_its_box() -> None:
    node = solid(2, 0.5 * rm.sin(2 * rm.time)) | rm.sphere(0.3).translate((0, rm.sin(rm.time), 0.8))
    made = plan(rm.Scene(node, quality=rm.Quality(bounding_volumes=True)))
    (union,) = [each for each in made.bounding.made if each.field.name == "nearest"][-1:]
    assert not find([union.field.body], "time")  # computed on the CPU, once a frame
    for time in (0.0, 0.8, 1e5):
        frame = with_hoisted(made.hoisted, Values({}, time))
        with bound(frame.params, time):
            found = evaluator([made.field.body], made.field.params)(POINTS - made.origin)[0]
            np.testing.assert_allclose(found, node.distance(POINTS), atol=1e-9)


@rm.shape(exactness="estimate", bounds=lambda: ((-1, -1, -1), (1, 1, 1)))
def unknown_rise(p):  # type: ignore[no-untyped-def]
    """A ball whose field rises slowly; nothing is known of it."""
    return 0.2 * (rm.length(p) - 1.0)


@rm.shape(exactness="estimate", bounds=lambda: ((-1, -1, -1), (1, 1, 1)), spread=5.0)
def known_rise(p):  # type: ignore[no-untyped-def]
    """The same with a declared spread."""
    return 0.2 * (rm.length(p) - 1.0)


def test_only_a_declared_spread_puts_an_estimate_into_its_box() -> None:
    for form, used in ((unknown_rise, False), (known_rise, True)):
        node = form() | form().translate((1.8, 0, 0))
        made = plan(rm.Scene(node, quality=rm.Quality(bounding_volumes=True))).bounding
        assert made.used == used
        np.testing.assert_allclose(values(node, POINTS, bounding_volumes=True), node.distance(POINTS), atol=1e-12)


def test_cheap_scenes_keep_their_text() -> None:
    scene = rm.Scene(solid(1))
    on, off = (scene.replace(quality=rm.Quality(bounding_volumes=choice)) for choice in (None, False))
    assert assemble(plan(on)).text() == assemble(plan(off)).text()


def test_costly_operands_are_found_and_the_reason_is_told() -> None:
    node = rm.union(*[rm.helix().translate((2 * i, 0.1 * i, 0)) for i in range(4)], rm.plane(offset=-1))
    made = plan(rm.Scene(node))
    assert (
        made.bounding.reason == "4 operands of a hard union: each takes 700 operations or more (35 ns, as a box does)"
    )
    text = assemble(made).text()
    assert "float nearest(vec3 p)" in text and "i < 256" in text
    plain = plan(rm.Scene(node, quality=rm.Quality(bounding_volumes=False)))
    assert made.shapes == plain.shapes == 5, "shapes in boxes count"
    assert plain.bounding.reason == "Quality(bounding_volumes=False)" and "nearest(" not in assemble(plain).text()
    assert not plan(rm.Scene(node.visible(shadow=False) | rm.sphere())).bounding.used


@pytest.mark.parametrize("form", ["glsl", "html", "shadertoy", "wgsl"])
def test_every_form_of_text_has_the_branch(form: str) -> None:
    scene = rm.Scene(rm.torus() | rm.octahedron().translate((1, 0, 0)), quality=rm.Quality(bounding_volumes=True))
    module = import_module(f"raymarch.export.text.{form}")
    text = module.text_of(scene, Values({})).text
    if form == "html" and (packed := re.search(r'"shader":{"bytes":"([^"]+)"}', text)):
        text = zlib.decompress(base64.b64decode(packed[1])).decode()
    assert re.search(r"if \(bound (<|\\u003c) ", text)
