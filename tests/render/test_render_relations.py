"""Scenes that must give the same picture, and scenes whose pictures must be related: no reference is needed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu import Frame, Renderer
from raymarch.scene.quality import TRACERS
from tests.support.analytic import EPSILON, ULP, around

SIZE = (160, 120)
FOV = 40.0
PIXEL = 2 * np.tan(np.radians(FOV) / 2) / SIZE[1]
CAMERA = rm.Camera((1.0, 1.5, 5.0), (0.0, 0.1, 0.0), fov=FOV)
SUN = rm.Sun((0.5, 1.0, 0.7), shadow=True)
RED, BLUE = rm.Material((0.9, 0.1, 0.1)), rm.Material((0.1, 0.1, 0.9))


def scene(node: rm.Node, **parts: Any) -> rm.Scene:
    return rm.Scene(node, parts.pop("camera", CAMERA), parts.pop("lights", [SUN]), **parts)


def drawn(renderer: Renderer, made: rm.Scene, **how: Any) -> Frame:
    return renderer.render(made, outputs=("color", "depth"), **how)


def assert_same(a: Frame, b: Frame) -> None:
    """Bit for bit, hit for hit."""
    for name in ("depth", "normal", "material", "color"):
        assert np.array_equal(a.array(name), b.array(name)), name


def assert_alike(a: Frame, b: Frame) -> None:
    """The same surfaces, each hit within its own epsilon; colours alike to 8 bits where nothing has an edge.

    Away from edges both hits lie within epsilon / cosine of the one surface, so they differ by twice that at most.
    Rounding may move a shadow's border as well, so pixels at an edge in the colours are left out with the others.
    """
    hit_a, hit_b = np.isfinite(a.depth), np.isfinite(b.depth)
    shown = np.asarray(a.image(), int)
    edge = np.zeros(hit_a.shape, bool)
    for axis in (0, 1):
        differs = np.abs(np.diff(shown, axis=axis)).max(axis=-1) > 24
        differs |= np.diff(a.material, axis=axis) != 0
        differs |= np.abs(np.diff(a.normal, axis=axis)).max(axis=-1) > 0.5
        pad = [(0, 1), (0, 0)] if axis == 0 else [(0, 0), (0, 1)]
        edge |= np.pad(differs, pad)
    inner = ~around(around(edge))
    assert inner.mean() > 0.5
    assert np.array_equal(hit_a[inner], hit_b[inner])
    both = inner & hit_a
    assert both.sum() > 1000
    depth = a.depth[both].astype(np.float64)
    cosine = np.clip(np.abs(cosines(a))[both], 1e-3, 1)
    assert np.all(np.abs(depth - b.depth[both]) <= 2 * (EPSILON * PIXEL * depth / cosine + 8 * ULP * depth))
    assert np.array_equal(a.material[inner], b.material[inner])
    assert np.abs(shown - np.asarray(b.image(), int))[inner].max() <= 1


def cosines(frame: Frame) -> Any:
    """Between normals and rays, to the accuracy that an allowance needs."""
    x = (np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2) * PIXEL
    y = (SIZE[1] / 2 - np.arange(SIZE[1]) - 0.5) * PIXEL
    back = np.array([1.0, 1.4, 5.0]) / np.linalg.norm([1.0, 1.4, 5.0])
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    rays = -back + x[None, :, None] * right + y[:, None, None] * np.cross(back, right)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.sum(rays * frame.normal, axis=-1)


def body(size: Any = 1.0, offset: Any = 0.3, turn: Any = 0.6) -> rm.Node:
    """A solid with an edge, a blend, a hole and two materials."""
    block = rm.box((size, 0.8, 1.2)).round(0.1).rotate(turn, "y").material(RED)
    ring = rm.torus(0.9, 0.2).translate((offset, 0.4, 0.1)).material(BLUE)
    return rm.union(block, ring, k=0.25) - rm.sphere(0.45).translate((0.2, 0.5, 0.6))


GROUND = rm.plane(offset=-0.6)


# The same text or the same numbers: the same picture.


def test_a_solid_united_with_itself_is_itself(renderer: Renderer) -> None:
    solid = body() | GROUND
    one = drawn(renderer, scene(solid))
    for other in (solid | solid, solid & solid, rm.union(solid, solid, solid), body() | GROUND | body()):
        assert_same(one, drawn(renderer, scene(other)))


def test_the_order_of_operands_does_not_matter(renderer: Renderer) -> None:
    """Distances are equal bit for bit; a normal is a sum, whose terms come in another order."""
    a, b, c = body(), GROUND.material(BLUE), rm.sphere(0.3).translate((-1, 0.5, 0.8)).material(RED)
    x, y = rm.box((1.2, 1.2, 1.2)).material(BLUE), rm.sphere(0.8).translate((0.2, 0.1, 0)).material(RED)
    families = [[rm.union(*order) for order in ((a, b, c), (b, a, c), (c, b, a), (b, c, a))]]
    families += [[f(x, y, k=k), f(y, x, k=k)] for k in (0.0, 0.3) for f in (rm.union, rm.intersection)]
    for first, *others in families:
        known = scene(first)
        one = drawn(renderer, known)
        for node in others:
            other = scene(node)
            two = drawn(renderer, other)
            assert np.array_equal(one.depth, two.depth) and np.array_equal(one.evaluations, two.evaluations)
            assert np.abs(one.normal - two.normal).max() <= 4 * ULP and np.abs(one.color - two.color).max() <= 32 * ULP
            numbers = np.array([*(known.materials.index(m) for m in other.materials), -1])  # they go by appearance
            assert np.array_equal(one.material, numbers[two.material])


def test_grouping_does_not_matter(renderer: Renderer) -> None:
    a, b, c = body(), GROUND, rm.sphere(0.3).translate((-1, 0.5, 0.8))
    assert_same(drawn(renderer, scene((a | b) | c)), drawn(renderer, scene(a | (b | c))))
    assert_same(drawn(renderer, scene(a | b | c)), drawn(renderer, scene(rm.union(a, b, c))))


def test_a_shared_part_and_a_copy_of_it_are_the_same(renderer: Renderer) -> None:
    shared = body()
    one = scene(shared.translate((1, 0, 0)) | shared.translate((-1, 0, 0)))
    two = scene(body().translate((1, 0, 0)) | body().translate((-1, 0, 0)))
    assert_same(drawn(renderer, one), drawn(renderer, two))


def test_an_effect_that_is_not_seen_changes_nothing(renderer: Renderer) -> None:
    one = drawn(renderer, scene(body() | GROUND))
    no_fog = drawn(renderer, scene(body() | GROUND, fog=rm.Fog(density=0.0)))
    assert np.array_equal(one.depth, no_fog.depth) and np.abs(one.color - no_fog.color).max() <= 4 * ULP
    dark = drawn(renderer, scene(body() | GROUND, lights=[SUN, rm.PointLight((0, 3, 3), intensity=0.0, shadow=True)]))
    assert_same(one, dark)


# Literals and uniforms.


def test_a_parameter_is_as_good_as_its_value(renderer: Renderer) -> None:
    params = (rm.Param("size", 0.7, 0.5, 2), rm.Param("offset", 0.0, -1, 1), rm.Param("turn", 0.0, -3, 3))
    values = {"size": 1.0, "offset": 0.3, "turn": 0.6}
    one = drawn(renderer, scene(body(*params) | GROUND), params=values)
    assert_alike(drawn(renderer, scene(body() | GROUND)), one)


def test_time_is_as_good_as_its_value(renderer: Renderer) -> None:
    one = drawn(renderer, scene(body(turn=rm.time) | GROUND), time=0.6)
    assert_alike(drawn(renderer, scene(body() | GROUND)), one)


def test_parameters_of_camera_and_lights_are_as_good_as_their_values(renderer: Renderer) -> None:
    x, hue = rm.Param("x", 0.5, 0, 2), rm.Param("hue", (0.0, 0.0, 0.0), 0, 1)
    moving = scene(
        body() | GROUND,
        camera=rm.Camera((x, 1.5, 5.0), (0.0, 0.1, 0.0), fov=40 * x),
        lights=[rm.Sun((0.5 * x, 1.0, 0.7), shadow=True, intensity=x), rm.PointLight((0, 3 * x, 0), hue)],
        sky=hue,
    )
    still = scene(body() | GROUND, lights=[SUN, rm.PointLight((0, 3, 0), (0.25, 0.5, 0.75))], sky=(0.25, 0.5, 0.75))
    one, other = drawn(renderer, still), drawn(renderer, moving, params={"x": 1.0, "hue": (0.25, 0.5, 0.75)})
    assert np.array_equal(one.depth, other.depth)
    assert_alike(one, other)


# Motions and sizes.


@pytest.mark.parametrize("offset", [(1.0, -2.0, 0.5), (64.0, -32.0, 16.0)])
def test_a_scene_moved_with_its_camera_looks_the_same(renderer: Renderer, offset: Any) -> None:
    camera = rm.Camera(tuple(np.add((1.0, 1.5, 5.0), offset)), tuple(np.add((0.0, 0.1, 0.0), offset)), fov=FOV)
    lamp = rm.PointLight((1, 3, 2), intensity=4, shadow=True)
    moved = rm.PointLight(tuple(np.add((1, 3, 2), offset)), intensity=4, shadow=True)
    one = drawn(renderer, scene(body() | GROUND, lights=[SUN, lamp]))
    two = drawn(renderer, scene((body() | GROUND).translate(offset), camera=camera, lights=[SUN, moved]))
    assert_alike(one, two)


def test_a_scene_turned_with_its_camera_looks_the_same(renderer: Renderer) -> None:
    angle = 0.7
    c, s = np.cos(angle), np.sin(angle)

    def turned(v: Any) -> tuple[float, ...]:  # about y, counter-clockwise seen from its tip
        return (c * v[0] + s * v[2], v[1], -s * v[0] + c * v[2])

    camera = rm.Camera(turned((1.0, 1.5, 5.0)), turned((0.0, 0.1, 0.0)), fov=FOV)
    one = drawn(renderer, scene(body() | GROUND))
    light = rm.Sun(turned((0.5, 1.0, 0.7)), shadow=True)
    two = drawn(renderer, scene((body() | GROUND).rotate(angle, "y"), camera=camera, lights=[light]))
    hit = np.isfinite(one.depth) & np.isfinite(two.depth)
    back = np.stack([c * two.normal[..., 0] - s * two.normal[..., 2], two.normal[..., 1],
                     s * two.normal[..., 0] + c * two.normal[..., 2]], axis=-1)  # fmt: skip
    two._arrays["normal"] = np.where(hit[..., None], back, 0).astype(np.float32)
    assert_alike(one, two)


def handed(x: float) -> rm.Scene:
    """A scene without symmetry, and for x = -1 its mirror image."""
    node = rm.union(
        rm.box((0.8, 1.0, 1.2)).rotate(0.5 * x, "y").translate((0.7 * x, 0, 0)).material(RED),
        rm.capsule((-0.9 * x, -0.5, 0), (-0.4 * x, 0.9, 0.3), 0.25).material(BLUE),
        rm.plane((0.1 * x, 1, 0.2), -0.7),
    )
    lights = [rm.Sun((0.5 * x, 1.0, 0.7), shadow=True), rm.PointLight((-1.0 * x, 2.0, 2.0), shadow=True)]
    return rm.Scene(node, rm.Camera((1.0 * x, 1.5, 5.0), (0.2 * x, 0.1, 0.0), fov=FOV), lights, fog=rm.Fog())


def test_a_mirrored_scene_is_the_mirrored_picture(renderer: Renderer) -> None:
    """Bit for bit: floating-point numbers are symmetrical about 0, and so are the pixels' centres."""
    one, two = drawn(renderer, handed(1.0)), drawn(renderer, handed(-1.0))
    for name in ("color", "depth", "material", "evaluations"):
        assert np.array_equal(one.array(name), two.array(name)[:, ::-1]), name
    assert np.array_equal(one.normal, two.normal[:, ::-1] * np.float32((-1, 1, 1)))
    assert (one.color != two.color).any()


def sized(s: float) -> rm.Scene:
    """A scene s times as large, its camera too; the lamp's light reaches farther."""
    block = rm.box((s, 0.8 * s, 1.2 * s)).round(0.1 * s).rotate(0.6, "y").material(RED)
    ring = rm.torus(0.9 * s, 0.2 * s).translate((0.3 * s, 0.4 * s, 0.1 * s)).material(BLUE)
    node = rm.union(block, ring, k=0.25 * s) - rm.sphere(0.45 * s).translate((0.2 * s, 0.5 * s, 0.6 * s))
    copies = rm.cylinder(0.1 * s, s).rotate(0.3, "x").repeat((s, None, s), count=(5, None, 3)).translate((0, 0, -3 * s))
    lights = [SUN, rm.PointLight((s, 3 * s, 2 * s), intensity=4 * s * s, shadow=True)]
    camera = rm.Camera((s, 1.5 * s, 5 * s), (0, 0.1 * s, 0), fov=FOV)
    return rm.Scene(node | copies | rm.plane(offset=-0.6 * s), camera, lights, fog=rm.Fog(density=0.05 / s))


@pytest.mark.parametrize("power", [-20, -3, 3, 20])
def test_a_scene_of_another_size_looks_the_same(renderer: Renderer, power: int) -> None:
    """Bit for bit for powers of two, from a millionth to a million: no constant in the shader is a length."""
    one, two = drawn(renderer, sized(1.0)), drawn(renderer, sized(2.0**power))
    assert np.array_equal(one.depth * np.float32(2.0**power), two.depth)
    assert np.array_equal(one.normal, two.normal) and np.array_equal(one.evaluations, two.evaluations)
    assert np.abs(one.color - two.color).max() <= 8 * ULP


@pytest.mark.parametrize("s", [0.3, 7.0])
def test_scaling_is_the_same_as_building_it_larger(renderer: Renderer, s: float) -> None:
    camera = rm.Camera((s, 1.5 * s, 5 * s), (0, 0.1 * s, 0), fov=FOV)
    larger = drawn(renderer, scene((body() | GROUND).scale(s), camera=camera))
    larger._arrays["depth"] = (larger.depth / s).astype(np.float32)
    assert_alike(drawn(renderer, scene(body() | GROUND)), larger)


# Repetition.


CHILDREN: list[Callable[[], rm.Node]] = [
    lambda: rm.sphere(0.3),
    lambda: rm.box((0.5, 0.4, 0.3)).rotate(0.5, (1, 2, 3)),
    lambda: rm.capsule((0, 0, 0), (0.3, 0.4, 0.2), 0.1).translate((0.2, -0.1, 0.1)),
]


@pytest.mark.parametrize("count", [1, 2, 3, (4, 1, 2)])
@pytest.mark.parametrize("child", CHILDREN, ids=range(len(CHILDREN)))
def test_a_repetition_is_the_union_of_its_copies(renderer: Renderer, child: Callable[[], rm.Node], count: Any) -> None:
    counts = (count, count, count) if isinstance(count, int) else count
    spacing = (0.9, 1.0, 1.1)
    places = [[(i - (n - 1) / 2) * s for i in range(n)] for n, s in zip(counts, spacing, strict=True)]
    marched = rm.Quality(analytic=False)  # both fields: a ray that only passes an edge may be a marched hit
    copies = [child().translate((x, y, z)) for x in places[0] for y in places[1] for z in places[2]]
    repeated = drawn(renderer, scene(child().repeat(spacing, count) | GROUND.translate((0, -1.5, 0)), quality=marched))
    explicit = drawn(renderer, scene(rm.union(*copies) | GROUND.translate((0, -1.5, 0)), quality=marched))
    assert_alike(explicit, repeated)


def test_a_mirror_is_a_union_with_the_image(renderer: Renderer) -> None:
    part = rm.box((0.5, 0.4, 0.3)).rotate(0.5, "z").translate((0.8, 0.2, 0.3))
    image = rm.box((0.5, 0.4, 0.3)).rotate(-0.5, "z").translate((-0.8, 0.2, 0.3))
    assert_alike(drawn(renderer, scene(part | image | GROUND)), drawn(renderer, scene(part.mirror("x") | GROUND)))


# Tracers differ in their ways, not in what they find.


@pytest.mark.parametrize("tracer", [t for t in TRACERS if t != "plain"])
def test_all_tracers_see_the_same(renderer: Renderer, tracer: str) -> None:
    plain = drawn(renderer, scene(body() | GROUND, quality=rm.Quality(tracer="plain")))
    other = drawn(renderer, scene(body() | GROUND, quality=rm.Quality(tracer=tracer)))
    assert_alike(plain, other)


def test_a_finer_epsilon_comes_nearer(renderer: Renderer) -> None:
    """It takes more evaluations, and what a coarse one finds lies within the coarse one of what the fine one finds."""
    fine = drawn(renderer, scene(rm.sphere(), quality=rm.Quality(epsilon=0.001)))
    coarse = drawn(renderer, scene(rm.sphere(), quality=rm.Quality(epsilon=1.0)))
    assert fine.evaluations.sum() > coarse.evaluations.sum()
    inner = ~around(~np.isfinite(fine.depth)) & (np.abs(cosines(fine)) > 0.2)
    slack = np.abs(fine.depth[inner] - coarse.depth[inner])
    assert np.all(slack <= PIXEL * fine.depth[inner] / np.abs(cosines(fine))[inner] + 16 * ULP * 5)
