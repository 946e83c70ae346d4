"""Textures on the device: what they are filtered to, what of them is kept, and light that goes on from them."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.atlas import Atlas, packed
from raymarch.expr.function import Function
from raymarch.expr.glsl import print_functions
from raymarch.expr.node import const, var
from raymarch.expr.texels import Texels, Wrap
from raymarch.expr.textures import texture
from raymarch.expr.types import FLOAT, VEC2
from raymarch.expr.vocabulary import cos, sin, vec3
from raymarch.gpu import Renderer
from raymarch.gpu.context import Context
from raymarch.plan import mixing, plan
from raymarch.shader import Shader, assemble
from raymarch.truth import silhouettes, truth
from tests.support.glsl_harness import evaluate, run, text_of
from tests.support.shader_samples import scenes, tiles

WEIGHTS = 3 * 2.0**-9
"""What texture units may do to a value, by its range: they round the weights along u, v and the levels to 8 bits."""

SIZE = (80, 60)


@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp"])
@pytest.mark.parametrize(("height", "width", "channels"), [(16, 16, 3), (5, 12, 1), (1, 7, 2), (1, 1, 3)])
def test_the_device_filters_as_the_truth_does(wrap: Wrap, height: int, width: int, channels: int, egl: Context) -> None:
    rng = np.random.default_rng(height + width)
    data = Texels(rng.uniform(0, 1, (height, width, channels)), wrap)
    at = rng.uniform(-2, 3, (400, 2))
    across, along = (10.0 ** rng.uniform(-4, 0.5, (400, 1)) * rng.uniform(-1, 1, (400, 2)) for _ in range(2))
    weight = np.where(rng.uniform(size=400) < 0.2, 0.0, rng.uniform(0, 1, 400))
    inputs = (*(var(name, VEC2) for name in ("at", "across", "along")), var("weight", FLOAT))
    node = texture(data, *inputs)
    function = Function("pictured", inputs, vec3(node, const(0.0)) if channels == 2 else node)
    points = [v.astype(np.float32).astype(np.float64) for v in (at, across, along, weight)]
    found = evaluate(egl, function, points)
    wanted = evaluator([function.body], inputs)(*points)[0]
    off = np.abs(found - wanted).reshape(400, -1).max(axis=1)
    # Where the number of samples is about to change, rounding may take another one.
    assert np.mean(off > WEIGHTS) < 0.01 and off.max() < 0.5
    assert np.all(found.reshape(400, -1)[weight == 0.0] == 0.0)


def test_pictures_in_an_atlas_are_filtered_as_the_truth_does(egl: Context) -> None:
    """Each picture as if it were alone, also at its borders: the neighbours are 100 times as bright."""
    rng = np.random.default_rng(3)
    shapes = [(16, 16), (5, 12), (1, 7), (1, 1), (32, 9), (9, 64)]
    wraps: list[Wrap] = ["repeat", "mirror", "clamp"]
    pictures = [Texels(100.0 ** (k % 2) * rng.uniform(0.5, 1, (*s, 3)), wraps[k % 3]) for k, s in enumerate(shapes)]
    places = packed(pictures, len(pictures) - 1)
    assert len({place.atlas.name for place in places.values()}) == 1
    at = rng.uniform(-2, 3, (200, 2))
    across, along = (10.0 ** rng.uniform(-3, 0.5, (200, 1)) * rng.uniform(-1, 1, (200, 2)) for _ in range(2))
    names = ("at", "across", "along")
    inputs = (*(var(name, VEC2) for name in names), var("weight", FLOAT))
    points = [v.astype(np.float32).astype(np.float64) for v in (at, across, along, np.ones(200))]
    for data in pictures:
        function = Function("pictured", inputs, texture(data, *inputs))
        text = print_functions([function], places=places)
        given = list(zip([i.type for i in inputs], points, strict=True))
        found = run(egl, text_of(text), "pictured({0}, {1}, {2}, {3})", given, 3, samples=text.samples)
        wanted = evaluator([function.body], inputs)(*points)[0]
        off = np.abs(found - wanted).max(axis=1) / data.levels[0].max()
        assert np.mean(off > 1e-4) < 0.01, "where the number of samples changes, rounding may take another one"
        assert np.median(off) < 1e-6


def test_more_pictures_than_texture_units_share_an_atlas() -> None:
    def drawn(count: int) -> Shader:
        maps = [rm.planar(np.full((3 + k, 4, 3), 0.5), 1.0, wrap=("repeat", "clamp")[k % 2]) for k in range(count)]
        mean = rm.Material(lambda p: sum(m.color(p) for m in maps) / count)
        return assemble(plan(rm.Scene(rm.sphere(0.4).material(mean)), ("color",)))

    assert "atlas" not in drawn(16).text()
    shared = drawn(19)
    assert len(shared.samples) == 16 == shared.text().count("uniform sampler2D")
    (atlas,) = (data for data in shared.samples.values() if isinstance(data, Atlas))
    assert len(atlas.places) == 4, "as few as suffice, the smallest first"


def textured_grid(count: int, k: float = 0.0, three: bool = False) -> rm.Scene:
    """Boxes side by side, each with a picture of its own. k : of a smooth blend. three : in three projections."""
    rng = np.random.default_rng(0)
    laid = rm.triplanar if three else rm.planar
    maps = [laid(rng.uniform(0.1, 0.9, (4 + k % 3, 8, 3)), 0.5) for k in range(count)]
    boxes = [rm.box(0.8).translate((k % 8, k // 8, 0)).material(rm.Material(m)) for k, m in enumerate(maps)]
    union = rm.union(*boxes, k=k) if k else rm.union(*boxes)
    return rm.Scene(union, camera=rm.Camera((3.5, 2, 9), (3.5, 1.5, 0)))


@pytest.mark.parametrize("k", [0.0, 0.4])
@pytest.mark.parametrize("count", [24, 64, 128])
def test_one_look_up_of_the_chosen_picture_is_compiled(count: int, k: float) -> None:
    """Drivers inline each look-up: of 31 pictures with one each, llvmpipe took a minute to compile."""
    shader = assemble(plan(textured_grid(count, k), ("color",)))
    calls = [line for line in shader.text().splitlines() if "filtered" in line and not line.startswith("vec4 filtered")]
    assert sum(line.count("filtered") for line in calls) == 1
    assert len(shader.samples) == 1


def test_the_chosen_picture_is_that_of_the_truth(renderer: Renderer) -> None:
    made = textured_grid(24)
    renderer.resize(SIZE)
    known = truth(made, SIZE)
    off = np.abs(renderer.render(made).color - known.color).max(axis=-1)[known.hit & ~silhouettes(known)]
    assert off.size > 500 and np.percentile(off, 99) < 1e-4


@pytest.mark.parametrize("three", [False, True])
def test_a_smooth_blend_of_many_pictures_is_that_of_the_truth(three: bool, renderer: Renderer) -> None:
    """A loop over the parts with a weight gives the mean of all: between the boxes of three and four pictures."""
    made = textured_grid(24, 0.7, three)
    renderer.resize(SIZE)
    known = truth(made, SIZE)
    off = np.abs(renderer.render(made).color - known.color).max(axis=-1)[known.hit & ~silhouettes(known)]
    assert off.size > 500 and np.percentile(off, 99) < (2e-3 if three else 4e-4)


def test_a_loop_over_parts_gives_the_sum_of_all(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of colours, numbers and relief, and where some parts have no pictures or are cut, in sharp and smooth unions."""
    rng = np.random.default_rng(1)
    balls = []
    for i in range(14):
        grey, tint = rm.planar(rng.uniform(0.2, 0.9, (6, 6)), 0.4), rm.planar(rng.uniform(0.1, 0.9, (5, 7, 3)), 0.6)
        paint = rm.Material(
            albedo=tint if i % 3 else (0.8, 0.4, 0.2), roughness=0.5 * grey, height=grey if i % 2 else None
        )
        balls.append(rm.sphere(0.6).translate((i % 5, i // 5, 0)).material(paint))
    smooth = rm.union(*balls[:10], k=0.5) - rm.box(1.2).translate((1, 0, 0.6))
    made = rm.Scene(
        smooth | rm.union(*balls[10:], k=0.2),
        rm.Camera((2, 1, 7), (2, 1, 0)),
        lights=[rm.Sun(shadow=True)],
        sky=rm.Sky((0.3, 0.4, 0.6), light=True),
    )
    renderer.resize(SIZE)
    found = renderer.render(made).color
    renderer.forget()
    monkeypatch.setattr(mixing, "FEW", 1000)
    with Renderer(SIZE, context=renderer.context) as other:
        wanted = other.render(made).color
        assert "part_of_blend" not in other.prepared(made).texts["color"]
    assert "part_of_blend" in renderer.prepared(made).texts["color"]
    assert np.ptp(wanted) > 0.3
    np.testing.assert_allclose(found, wanted, atol=2e-6)


def test_a_checkered_floor_is_that_of_the_truth_up_to_its_horizon(renderer: Renderer) -> None:
    checks = np.kron(np.array([[0.1, 0.9], [0.9, 0.1]]), np.ones((32, 32)))
    floor = rm.plane().material(rm.Material(rm.planar(checks, 0.5, "y"), specular=0.0))
    made = rm.Scene(floor, camera=rm.Camera((0.13, 1, 0), (0.13, 0.9, -2)))
    renderer.resize(SIZE)
    known = truth(made, SIZE)
    off = np.abs(renderer.render(made).color - known.color).max(axis=-1)[known.hit & ~silhouettes(known)]
    assert off.size > 1000 and np.percentile(off, 99) < WEIGHTS * 0.8


def test_equal_pictures_are_one_texture_on_the_device(renderer: Renderer) -> None:
    before = renderer.resources.objects["data"]
    ball = rm.sphere()
    made = [rm.Material(rm.triplanar(tiles(24).copy())), rm.Material(rm.planar(tiles(24), 2, rotation=1))]
    scene = rm.Scene(ball.material(made[0]) | ball.translate((2, 0, 0)).material(made[1]))
    renderer.render(scene)
    renderer.render(scene, time=1.0)
    assert renderer.resources.objects["data"] == before + 1
    (picture,) = renderer.prepared(scene).plan.textures
    assert picture.size == (24, 24) and picture.nbytes == 2 * 3 * (24**2 + 12**2 + 6**2 + 3**2 + 1)


def test_what_a_part_does_not_show_is_not_read(renderer: Renderer) -> None:
    """The weight of a texture is 0 where another part is seen: the text says so."""
    shown = rm.sphere().material(rm.Material(rm.planar(tiles()))) | rm.box(1).material(rm.Material((1, 0, 0)))
    text = " ".join(renderer.prepared(rm.Scene(shown)).texts["color"].split())
    calls = re.findall(r"filtered\(u_texels.*?\)", text)
    assert len(calls) == 1 and re.search(r", (\w+) \? 1\.0 : 0\.0\)$", calls[0])


def test_a_bent_mirror_shows_what_the_truth_shows(renderer: Renderer) -> None:
    """As for other trees: each colour is among those of the true picture around it, but for a few pixels in which a way
    leaps from one thing to another."""
    made = scenes()["textures in a tree"]
    renderer.resize(SIZE)
    known, found = truth(made, SIZE).color, renderer.render(made).color
    near = np.pad(known, ((1, 1), (1, 1), (0, 0)), "edge")
    near = np.stack([near[i : i + SIZE[1], j : j + SIZE[0]] for i in range(3) for j in range(3)])
    wrong = np.maximum(found - near.max(axis=0), near.min(axis=0) - found).max(axis=-1)
    assert np.mean(wrong > 1 / 255) < 0.01


def test_textures_are_read_wherever_light_goes(renderer: Renderer) -> None:
    """Light that path_traced over a red and a blue half of a floor brings both colours to a white ball."""
    halves = np.concatenate([np.tile((1.0, 0.05, 0.05), (2, 2, 1)), np.tile((0.05, 0.05, 1.0), (2, 2, 1))], axis=1)
    floor = rm.plane(offset=-1).material(rm.Material(albedo=rm.planar(halves, 20, "y", wrap="clamp"), roughness=1.0))
    ball = rm.sphere().material(rm.Material(albedo=(0.9, 0.9, 0.9), roughness=1.0))
    renderer.resize((48, 36))
    scene = rm.Scene(
        ball | floor, rm.Camera((0, 0.5, 6), (0, 0, 0)), [], (1, 1, 1), bounces=2, quality=rm.Quality(samples=64)
    )
    low = renderer.render(scene).color[20:24]
    left, right = low[:, 16:22].mean((0, 1)), low[:, 26:32].mean((0, 1))
    assert left[0] > 1.1 * left[2] and right[2] > 1.1 * right[0]


def test_a_texture_may_lie_otherwise_in_each_cell(renderer: Renderer) -> None:
    def block(index: rm.Node) -> rm.Node:
        shift = 0.3 * index.x
        return rm.box((0.8, 0.8, 0.8)).material(rm.Material(rm.planar(tiles(), offset=(shift, 0.0))))

    scene = rm.Scene(rm.repeat_varied(block, (1, None, None), 3))
    renderer.resize(SIZE)
    known = truth(scene, SIZE)
    off = np.abs(renderer.render(scene).color - known.color).max(axis=-1)[known.hit & ~silhouettes(known)]
    assert np.percentile(off, 95) < WEIGHTS
    still = rm.box((0.8, 0.8, 0.8)).material(rm.Material(rm.planar(tiles()))).repeat((1, None, None), 3)
    assert np.abs(truth(rm.Scene(still), SIZE).color - known.color).max() > 0.1


def test_textures_far_from_the_origin_are_those_near_it(renderer: Renderer) -> None:
    """A material's space is told from its own place: coordinates of millions leave the footprint as it is."""
    pictures = []
    for place in ((0.0, 0.0, 0.0), (1e6, -2e6, 5e5)):
        bumpy = rm.Material(rm.triplanar(tiles(), 0.5), height=rm.planar(tiles()[..., 0], 0.5), height_scale=0.05)
        floor = rm.plane(offset=-0.6).material(rm.Material(rm.planar(tiles(), 1, "y")))
        camera = rm.Camera(tuple(np.add(place, (1, 1.5, 3))), place)
        pictures.append(renderer.render(rm.Scene((rm.box(1).material(bumpy) | floor).translate(place), camera)).color)
    assert np.percentile(np.abs(pictures[0] - pictures[1]), 99.9) < 1e-3


def test_a_mirror_shows_a_floor_as_from_behind_it(renderer: Renderer) -> None:
    """A pixel is as wide as all of the way of light is long: to the mirror, and from there to the floor. On the device
    a ray meets the floor within a tenth of a pixel, which moves an edge between checks by a tenth of their contrast."""
    checks = np.kron(np.array([[0.1, 0.9], [0.9, 0.1]]), np.ones((16, 16)))
    floor = rm.plane().material(rm.Material(albedo=(0, 0, 0), f0=0, emission=rm.planar(checks, 0.6, "y")))
    silver = rm.Material(albedo=(1, 1, 1), metalness=1, roughness=0)
    dark: dict[str, object] = {
        "lights": [],
        "sky": (0, 0, 0),
        "bounces": 1,
        "quality": rm.Quality(integrator="whitted"),
    }
    eye, to, seen = np.array([0.1, 1.0, 4.0]), np.array([0.1, 0.7, 0.0]), (1, 1, -1)
    mirrored = rm.Scene(floor | rm.plane((0, 0, 1)).material(silver), rm.Camera(tuple(eye), tuple(to)), **dark)
    behind = rm.Scene(floor, rm.Camera(tuple(eye * seen), tuple(to * seen)), **dark)
    renderer.resize(SIZE)
    for draw, near in (
        (lambda s: truth(s, SIZE).color, 1e-6),
        (lambda s: renderer.render(s).color, 0.1 * 0.8 + WEIGHTS),
    ):
        picture, direct = draw(mirrored), draw(behind)[:, ::-1]
        wall = np.abs(truth(mirrored, SIZE).normal[..., 2]) > 0.9
        far = wall & (truth(behind, SIZE).depth[:, ::-1] < 30)
        assert far.sum() > 300 and np.ptp(direct[far]) > 0.2
        assert np.percentile(np.abs(picture - direct)[far], 98) < near


@pytest.mark.parametrize(("map_of", "paths"), [(rm.planar, False), (rm.planar, True), (rm.triplanar, False)])
def test_a_picture_of_one_color_is_that_color_also_at_grazing_pixels(
    map_of: Any, paths: bool, renderer: Renderer
) -> None:
    """A map without relief bends no normal. The weights of three projections add up to 1 but for rounding."""

    def drawn(albedo: Any) -> Any:
        ring = rm.torus(1, 0.4).rotate(0.5, "x").material(rm.Material(albedo=albedo, roughness=0.3))
        camera, lights = rm.Camera((0, 1.5, 4), (0, 0, 0)), [rm.Sun(shadow=True)]
        return renderer.render(rm.Scene(ring | rm.plane(offset=-0.5), camera, lights, bounces=int(paths))).color

    picture = np.full((4, 4, 3), 0.5, np.float32)
    np.testing.assert_allclose(drawn(map_of(picture)), drawn((0.5, 0.5, 0.5)), atol=1e-3)


@pytest.mark.parametrize("bounces", [0, 1])
def test_relief_of_another_solid_bends_no_normal(bounces: int, renderer: Renderer) -> None:
    def drawn(beside: rm.Material) -> Any:
        ring = rm.torus(1, 0.4).rotate(0.5, "x").material(rm.Material(color="peru", roughness=0.3))
        behind = rm.sphere(0.2).translate((0, 1, 9)).material(beside)
        camera, lights = rm.Camera((0, 1.5, 4), (0, 0, 0)), [rm.Sun()]
        made = rm.Scene(ring | rm.plane(offset=-0.5) | behind, camera, lights, bounces=bounces)
        outputs = ("color", "shading_normal") if not bounces else ("color",)
        return renderer.render(made, outputs=outputs)

    plain, raised = drawn(rm.Material()), drawn(RAISED)
    np.testing.assert_allclose(raised.color, plain.color, atol=1e-6)
    if not bounces:
        np.testing.assert_allclose(raised.shading_normal, plain.shading_normal, atol=1e-6)


def test_a_normal_map_of_one_tilt_turns_the_shading_normal_by_that_tilt(renderer: Renderer) -> None:
    """The map's right is the x of the floor, its up is -z. What lights the floor makes no difference."""
    tilt = np.array([0.36, 0.48, 0.8])
    picture = np.broadcast_to(np.float32(0.5 + 0.5 * tilt), (4, 4, 3)).copy()
    relief = rm.Material(normal=rm.planar(picture, axis="y"))
    for lights in ([], [rm.Sun()]):
        made = rm.Scene(rm.plane().material(relief), rm.Camera((0, 4, 1), (0, 0, 0)), lights)
        frame = renderer.render(made, outputs=("shading_normal", "normal"))
        hit = np.isfinite(frame.depth)
        assert hit.mean() > 0.9 and np.allclose(frame.normal[hit], (0, 1, 0), atol=1e-6)
        np.testing.assert_allclose(frame.shading_normal[hit], np.tile((0.36, 0.8, -0.48), (hit.sum(), 1)), atol=5e-3)
        assert not frame.shading_normal[~hit].any()


RAISED = rm.Material(height=lambda p: 0.05 * sin(6.0 * p.x) * cos(5.0 * p.y) * sin(4.0 * p.z), height_scale=1.0)
RELIEFS = {
    "heights": rm.sphere(1.2).material(RAISED) | rm.plane(offset=-1),
    "a blend": rm.union(rm.sphere(1.2).material(RAISED), rm.box(1.6).rotate(0.4, "y"), k=0.3),
    "no relief": rm.sphere(1.2) | rm.plane(offset=-1).material(rm.Material(rm.planar(np.full((4, 4, 3), 0.5)))),
}


@pytest.mark.parametrize("fov", [40.0, None])
@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("solid", RELIEFS)
def test_shading_normals_are_those_of_the_reference(
    solid: str, inside: bool, fov: float | None, renderer: Renderer
) -> None:
    """They are outward; light turns them to the camera where that is in the solid."""
    lens: dict[str, Any] = {"fov": fov} if fov else {"projection": "orthographic"}
    camera = rm.Camera((0.1, 0.2, 0.1) if inside else (1, 2, 4), (-0.6, 0.1, -0.2), **lens)
    made = rm.Scene(RELIEFS[solid], camera, [rm.Sun()])
    frame = renderer.render(made, outputs=("shading_normal", "normal"))
    known = truth(made, renderer.size)
    outward = known._picture(lambda s: -s.shading_normals if s.inside else s.shading_normals, 0.0)
    both = known.hit & (np.abs(np.where(known.hit, known.depth, 0.0) - frame.depth) < 1e-3)
    assert both.mean() > 0.3
    off = np.abs(frame.shading_normal - outward)[both].max(axis=-1)
    assert np.quantile(off, 0.99) < 1e-3 and off.max() < 0.02
    if solid == "no relief":
        assert np.array_equal(frame.shading_normal, frame.normal)
    else:
        assert np.abs(frame.shading_normal - frame.normal).max() > 0.1


def test_a_picture_seen_squarely_from_far_is_its_mean(egl: Context) -> None:
    """The footprint in the middle is a circle of many texels, which has no longer axis."""
    checks = np.indices((64, 64)).sum(axis=0) % 2
    floor = rm.Material(albedo=rm.planar(0.2 + 0.6 * checks, 0.5, "y"), roughness=1.0)
    camera = rm.Camera((0, 30, 0), (0, 0, 0), up=(0, 0, 1))
    scene = rm.Scene(rm.plane().material(floor), camera, lights=[rm.Sun((0, 1, 0))])
    with Renderer((65, 65), context=egl) as renderer:
        color = renderer.render(scene).color
    assert np.isfinite(color).all() and abs(color[32, 32, 0] - color[30, 30, 0]) < 0.01


def test_a_hard_projection_is_as_bright_between_the_axes(egl: Context) -> None:
    white = rm.Material(albedo=rm.triplanar(np.ones((4, 4)), 1.0, hardness=64), roughness=1.0)
    scene = rm.Scene(rm.sphere().material(white), rm.Camera((3, 3, 3), (0, 0, 0)), lights=[rm.Sun((1, 1, 1))])
    with Renderer((33, 33), context=egl) as renderer:
        assert renderer.render(scene).color[16, 16, 0] > 0.9


def test_what_glows_beside_a_map_needs_no_light(egl: Context) -> None:
    lamp = rm.sphere(0.5).material(rm.Material(albedo=(0, 0, 0), emission=(1, 0.5, 0.2)))
    floor = rm.plane(offset=-1).material(rm.Material(albedo=rm.planar(np.ones((4, 4)), 1.0, "y")))
    with Renderer((33, 33), context=egl) as renderer:
        color = renderer.render(rm.Scene(lamp | floor, lights=[], sky=(0, 0, 0))).color
    assert np.allclose(color[16, 16], (1, 0.5, 0.2), atol=1e-3)


def test_pictures_of_scenes_gone_by_are_freed_by_their_size(egl: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raymarch.gpu.resource_cache.HELD", 20_000)
    monkeypatch.setattr("raymarch.gpu.resource_cache.UNITS", 2)
    with Renderer((8, 8), context=egl) as renderer:
        for k in range(6):
            map_ = rm.planar(np.full((32, 32, 3), 0.1 * k), 1.0)  # some 8 kB with its smaller ones
            renderer.render(rm.Scene(rm.plane().material(rm.Material(albedo=map_))))
        assert renderer.resources.objects["data"] == 2
