"""Pictures of spheres and planes against school geometry: where, how far, which way, in light or in shadow."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.scene.quality import TRACERS
from tests.support.analytic import EPSILON, ULP, View, angles, edges, hit_plane, hit_sphere, points, unit
from tests.support.cameras import camera_of

# Nothing about it is symmetric: mirrored or upside down it is another picture.
BALLS = [((1.5, 1.0, 0.0), 0.6), ((-1.0, 0.3, -1.0), 0.9), ((-0.4, -0.6, 1.5), 0.25)]
FLOOR = -0.9
COLORS = [(0.9, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.1, 0.9), (0.5, 0.5, 0.5)]


def balls() -> list[rm.Node]:
    return [rm.sphere(r).translate(c) for c, r in BALLS]


def solid() -> rm.Node:
    parts = [*balls(), rm.plane(offset=FLOOR)]
    return rm.union(*[part.material(rm.Material(color)) for part, color in zip(parts, COLORS, strict=True)])


def scene_of(view: View, node: rm.Node | None = None, **parts: Any) -> rm.Scene:
    return rm.Scene(solid() if node is None else node, camera_of(view), **parts)


def exact(view: View) -> tuple[Any, Any, Any, Any]:
    """Distance, number of the part hit (-1 for none), normal, cosine between the normal and the way back."""
    d = view.directions
    ways = [hit_sphere(view.origin, d, c, r) for c, r in BALLS] + [hit_plane(view.origin, d, FLOOR)]
    t = np.min(ways, axis=0)
    part = np.where(np.isfinite(t), np.argmin(ways, axis=0), -1)
    p = points(view.origin, d, t)
    normal = np.zeros_like(p)
    for i, (c, r) in enumerate(BALLS):
        normal = np.where((part == i)[..., None], (p - c) / r, normal)
    normal = np.where((part == len(BALLS))[..., None], (0.0, 1.0, 0.0), normal)
    return t, part, normal, -np.sum(normal * d, axis=-1)


def allowed(view: View, t: Any, cosine: Any) -> Any:
    """How far a hit may lie from the surface along its ray.

    The field was at most epsilon there, which is EPSILON pixel widths; a convex surface then is at most
    epsilon / cosine away. Besides, coordinates and distances are rounded to float32.
    """
    return EPSILON * view.pixel * t / cosine + 8 * ULP * t


def assert_depths(depth: Any, view: View, t: Any, cosine: Any, where: Any) -> None:
    wrong = np.abs(depth[where] - t[where]) / allowed(view, t[where], cosine[where])
    assert wrong.size and np.all(wrong <= 1), (
        f"{(wrong > 1).sum()} of {wrong.size} are off, up to {wrong.max():g} times"
    )


VIEW = View((2.0, 1.5, 6.0), (0.1, 0.0, 0.0), 40.0, (160, 120))


@pytest.mark.parametrize("tracer", TRACERS)
def test_every_pixel_is_where_geometry_says(renderer: rm.Renderer, tracer: str) -> None:
    frame = renderer.render(scene_of(VIEW, quality=rm.Quality(tracer=tracer)), outputs=("depth",))
    t, part, normal, cosine = exact(VIEW)
    inner = ~edges(part)
    assert inner.mean() > 0.5 and set(np.unique(part[inner])) == {-1, 0, 1, 2, 3}
    hit = np.isfinite(frame.depth)
    assert np.array_equal(hit[inner], part[inner] >= 0)
    both = inner & (part >= 0)
    assert_depths(frame.depth, VIEW, t, cosine, both)
    # An error along the ray moves the point sideways by its sine, and turns the normal by that over the radius.
    radius = np.array([*(r for _, r in BALLS), np.inf])[part[both]]
    sideways = allowed(VIEW, t[both], cosine[both]) * np.sqrt(1 - np.minimum(cosine[both], 1) ** 2)
    assert np.all(angles(frame.normal, normal)[both] <= sideways / radius + 16 * ULP)


def test_materials_are_those_of_the_parts(renderer: rm.Renderer) -> None:
    scene = scene_of(VIEW)
    frame = renderer.render(scene, outputs=("material",))
    _, part, _, _ = exact(VIEW)
    inner = ~edges(part)
    found = [scene.materials.index(rm.Material(color)) for color in COLORS]
    expected = np.array([*found, -1])[part]
    assert np.array_equal(frame.material[inner], expected[inner])


def test_colours_are_those_of_the_parts(renderer: rm.Renderer) -> None:
    """Ambient light alone: each pixel shows the colour of its material, the sky where nothing is hit."""
    parts = [part.material(rm.Material(c, ambient=1.0, specular=0.0)) for part, c in zip(balls(), COLORS, strict=False)]
    scene = scene_of(VIEW, rm.union(*parts), lights=[rm.Sun((0, -1e-9, -1))], sky=(0.25, 0.5, 1.0))
    frame = renderer.render(scene)
    ways = [hit_sphere(VIEW.origin, VIEW.directions, c, r) for c, r in BALLS]
    part = np.where(np.isfinite(np.min(ways, axis=0)), np.argmin(ways, axis=0), -1)
    inner = ~edges(part)
    expected = np.array([*COLORS[:3], (0.25, 0.5, 1.0)], np.float32)[part]
    z = points(VIEW.origin, VIEW.directions, np.min(ways, axis=0))[..., 2]
    unlit = inner & (part >= 0) & (z > np.array([*(c[2] for c, _ in BALLS), 0.0])[part])  # the sun shines from behind
    assert unlit.mean() > 0.05
    assert np.abs(frame.color - expected)[unlit | (inner & (part < 0))].max() <= 2 * ULP


@pytest.mark.parametrize("size", [(1, 1), (1, 64), (64, 1), (63, 37), (2, 3)])
def test_sizes_small_thin_and_odd(renderer: rm.Renderer, size: tuple[int, int]) -> None:
    view = View(VIEW.position, (1.2, 0.8, 0.0), VIEW.fov, size)
    renderer.resize(size)
    frame = renderer.render(scene_of(view), outputs=("color", "depth"))
    width, height = size
    assert frame.size == size and frame.image().size == size
    assert frame.color.shape == (height, width, 3) and frame.depth.shape == (height, width)
    t, part, _, cosine = exact(view)
    inner = ~edges(part) if max(size) > 3 else np.ones(part.shape, bool)  # among so few, each is beside an edge
    steep = inner & (part >= 0) & (cosine > 0.02)
    assert_depths(frame.depth, view, t, cosine, steep)
    assert np.array_equal(np.isfinite(frame.depth)[inner], (part >= 0)[inner])


@pytest.mark.parametrize("fov", [2.0, 90.0, 150.0])
def test_narrow_and_wide_views(renderer: rm.Renderer, fov: float) -> None:
    view = View((2.0, 1.5, 6.0), BALLS[0][0], fov, (160, 120))
    frame = renderer.render(scene_of(view), outputs=("depth",))
    t, part, _, cosine = exact(view)
    inner = ~edges(part) & (part >= 0)
    assert_depths(frame.depth, view, t, cosine, inner)


def test_a_camera_may_roll(renderer: rm.Renderer) -> None:
    view = View((2.0, 1.5, 6.0), (0.1, 0.0, 0.0), 40.0, (160, 120), up=(1.0, 0.4, 0.2))
    frame = renderer.render(scene_of(view), outputs=("depth",))
    t, part, _, cosine = exact(view)
    inner = ~edges(part)
    assert np.array_equal(np.isfinite(frame.depth)[inner], (part >= 0)[inner])
    both = inner & (part >= 0)
    assert_depths(frame.depth, view, t, cosine, both)


@pytest.mark.parametrize("size", [(63, 37), (64, 36)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_rays_along_an_axis_hit_what_stands_there(renderer: rm.Renderer, axis: int, size: tuple[int, int]) -> None:
    """The middle column and row of an odd picture hold rays that run exactly along the faces of the scene's box."""
    position = np.zeros(3)
    position[axis] = 5.0
    up = (0.0, 1.0, 0.0) if axis != 1 else (0.0, 0.0, -1.0)
    view = View(tuple(position), (0, 0, 0), 40.0, size, up)
    renderer.resize(size)
    frame = renderer.render(scene_of(view, rm.sphere() & rm.box((3, 3, 3))), outputs=("depth",))
    t = hit_sphere(view.origin, view.directions, (0, 0, 0), 1.0)
    inner = ~edges(np.isfinite(t).astype(int))
    assert np.array_equal(np.isfinite(frame.depth)[inner], np.isfinite(t)[inner])
    p = points(view.origin, view.directions, t)
    assert_depths(frame.depth, view, t, -np.sum(p * view.directions, axis=-1), inner & np.isfinite(t))


@pytest.mark.parametrize("distance", [10.0, 100.0, 1e3, 1e4])
def test_a_box_seen_through_a_long_lens_is_lit_on_its_outside(renderer: rm.Renderer, distance: float) -> None:
    """The ray starts on the faces, which touch the scene's box; rounding must not take the camera inside of it."""
    direction = np.array([0.3, 0.2, 1.0])
    fov = float(np.degrees(2 * np.arctan(0.9 / distance)))
    camera = rm.Camera(tuple(direction * distance), (0, 0, 0), fov=fov)
    sun = unit(np.array([0.3, 0.4, 1.0]))
    frame = renderer.render(rm.Scene(rm.box(1), camera, [rm.Sun(tuple(sun))]), outputs=("color", "normal"))
    for axis in range(3):
        face = frame.normal[..., axis] == 1
        assert face.any()
        expected = 0.5 * (0.1 + sun[axis])
        highlight = (
            0.25 * max(0.0, float(2 * sun[axis] * direction[axis] - sun @ direction) / np.linalg.norm(direction)) ** 32
        )
        # The highlight changes over the face by its exponent times the angle, here below 1 / distance.
        assert np.all(np.abs(frame.color[face] - expected - highlight) <= 32 * 0.25 / distance + 8 * ULP)


# Shadows.


BALL, RADIUS, GROUND = np.array([0.2, 0.5, -0.3]), 0.5, -0.4
ABOVE = View((1.5, 3.0, 4.0), (0.3, 0.0, -0.3), 45.0, (160, 120))


def ball_over_ground() -> rm.Node:
    return rm.sphere(RADIUS).translate(tuple(BALL)) | rm.plane(offset=GROUND)


def ground_seen() -> tuple[Any, Any, Any, Any]:
    """Which pixels show the ground, at which points, how far a shadow's border may be misplaced there, and epsilon.

    The hit is off by up to a sixteenth of epsilon, over the cosine, along the ray; the shadow's ray starts on its own
    line and is blocked a thirty-second before another surface. Below a rise of a quarter it starts up to two epsilons
    above that line.
    """
    d = ABOVE.directions
    ball, ground = hit_sphere(ABOVE.origin, d, BALL, RADIUS), hit_plane(ABOVE.origin, d, GROUND)
    part = np.where(ball < ground, 0, np.where(np.isfinite(ground), 1, -1))
    seen = (part == 1) & ~edges(part)
    epsilon = EPSILON * ABOVE.pixel * np.where(seen, ground, 1.0)
    cosine = np.where(seen, -d[..., 1], 1.0)
    margin = epsilon * (1 / cosine + 0.5) / 16 + 32 * ULP
    return seen, points(ABOVE.origin, d, np.where(seen, ground, 0.0)), margin, epsilon


def passes_at(p: Any, direction: Any) -> Any:
    """How far from the ball's middle rays pass, inf for those that lead away from it."""
    along = np.sum((BALL - p) * direction, axis=-1)
    across = np.linalg.norm(BALL - p - along[..., None] * direction, axis=-1)
    return np.where(along > 0, across, np.inf)


def lit_of(renderer: rm.Renderer, light: rm.Sun | rm.PointLight) -> Any:
    """1 where the light arrives, 0 in its shadow, nan where it does not matter: by the two shades of the ground."""
    matt = rm.Material((1, 1, 1), specular=0.0, ambient=0.0)
    frame = renderer.render(rm.Scene(ball_over_ground().material(matt), camera_of(ABOVE), [light]))
    return frame.color[..., 0]


@pytest.mark.parametrize("direction", [(0, 1, 0), (0.8, 1, -0.3), (-3, 1, 1)])
def test_the_shadow_of_a_sun_is_a_cylinder(renderer: rm.Renderer, direction: Any) -> None:
    seen, p, margin, _ = ground_seen()
    way = unit(np.asarray(direction, np.float64))
    passing = passes_at(p, way)
    clear = seen & (np.abs(passing - RADIUS) > margin)
    shadow = passing < RADIUS
    assert (clear & shadow).sum() > 200 and (clear & ~shadow).sum() > 2000 and (seen & ~clear).sum() < 500
    shade = lit_of(renderer, rm.Sun(direction, shadow=True))
    assert np.all(shade[clear & shadow] == 0)
    assert np.all(np.abs(shade[clear & ~shadow] - way[1]) <= 8 * ULP)


@pytest.mark.parametrize("position", [(0.2, 2.0, -0.3), (1.0, 1.6, 0.4), (-2.0, 0.9, -0.6)])
def test_the_shadow_of_a_lamp_is_a_cone(renderer: rm.Renderer, position: Any) -> None:
    seen, p, margin, epsilon = ground_seen()
    way = np.asarray(position) - p
    far = np.linalg.norm(way, axis=-1)
    margin = margin + np.where(way[..., 1] < 0.25 * far, 2 * epsilon, 0.0)
    passing = passes_at(p, way / far[..., None])
    clear = seen & (np.abs(passing - RADIUS) > margin)
    shadow = passing < RADIUS
    assert (clear & shadow).sum() > 100 and (clear & ~shadow).sum() > 2000
    shade = lit_of(renderer, rm.PointLight(position, shadow=True))
    assert np.all(shade[clear & shadow] == 0)
    expected = (position[1] - GROUND) / far**3  # cosine over the square of the distance
    # A hit that lies off by e moves the light's distance by as much, and its share by three times e over it.
    wrong = np.abs(shade / expected - 1)[clear & ~shadow]
    assert np.all(wrong <= (3 * margin / far)[clear & ~shadow] + 32 * ULP)


def test_a_lamp_before_the_ball_is_not_in_its_shadow(renderer: rm.Renderer) -> None:
    """The lamp hangs between the ball and the ground: what stands beyond it blocks nothing."""
    seen, _, _, _ = ground_seen()
    shade = lit_of(renderer, rm.PointLight((0.2, -0.2, -0.3), shadow=True))
    assert np.all(shade[seen] > 0)


def test_a_light_without_shadow_shines_through(renderer: rm.Renderer) -> None:
    seen, _, _, _ = ground_seen()
    assert np.all(lit_of(renderer, rm.Sun((0.8, 1, -0.3)))[seen] > 0)


def test_no_surface_shadows_itself(renderer: rm.Renderer) -> None:
    """On a lone ball under a sun every point that faces the light is lit, down to grazing light."""
    sun = unit(np.array([1.0, 0.3, 0.2]))
    matt = rm.Material((1, 1, 1), specular=0.0, ambient=0.0)
    scene = rm.Scene(rm.sphere().material(matt), rm.Camera((0, 0, 4)), [rm.Sun(tuple(sun), shadow=True)])
    frame = renderer.render(scene, outputs=("color", "normal"))
    facing = frame.normal @ sun
    lit = facing > 1e-3
    assert lit.sum() > 1000 and np.all(np.abs(frame.color[..., 0][lit] - facing[lit]) <= 16 * ULP)
    assert np.all(frame.color[..., 0][np.isfinite(frame.depth) & (facing < 0)] == 0)


def test_a_shadow_falls_from_one_end_of_the_scene_to_the_other(renderer: rm.Renderer) -> None:
    """The camera stands in the middle, so that no part is as far from it as the wall is from its shadow."""
    floor = rm.box((20, 0.2, 20)).translate((0, -0.1, 0))
    wall = rm.box((0.2, 4, 20)).translate((-9.5, 2, 0))
    matt = rm.Material((1, 1, 1), specular=0.0, ambient=0.0)
    camera = rm.Camera((0, 1.5, 0), (9, 0, 0.1), fov=40)
    # Light that climbs 1 in 6: the wall's top, at 4, throws its shadow 24 far.
    scene = rm.Scene((floor | wall).material(matt), camera, [rm.Sun((-6, 1, 0), shadow=True)])
    frame = renderer.render(scene)
    assert np.isfinite(frame.depth).mean() > 0.3
    assert np.all(frame.color[np.isfinite(frame.depth)] == 0)
    known = rm.truth(scene, size=(32, 24))
    assert known.hit.mean() > 0.3 and np.all(known.color[known.hit] == 0)


# Normals, each way within its own theory.

BEHIND = ((-10.0, 0.0, -0.8), (0.0, -10.0, -0.8), (-0.3, -0.2, -10.0))
"""Balls at whose front one coordinate alone is large, and below 0: a step must be in proportion to its size."""


@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (3.0, -2.0, 1.0), *BEHIND])
@pytest.mark.parametrize("normals", ["analytic", "tetrahedron", "central", "forward"])
def test_normals_are_as_exact_as_their_method(renderer: rm.Renderer, normals: str, centre: Any) -> None:
    """A unit ball, whose distance has the second derivative 1 across the ray and the third of 3 at most.

    With a step h first-order differences are wrong by h / 2 in each component, central ones by h^2 / 2 at most;
    values of float32 are off by a few ulp of the coordinates, which is divided by h.
    """
    view = View(tuple(np.add(centre, (1.0, 0.7, 4.0))), centre, 35.0, (160, 120))
    scene = scene_of(view, rm.sphere().translate(centre), quality=rm.Quality(normals=normals))
    frame = renderer.render(scene, outputs=("depth", "normal"))
    ideal = hit_sphere(view.origin, view.directions, centre, 1.0)
    inner = np.isfinite(ideal) & ~edges(np.isfinite(ideal).astype(int))
    p = points(view.origin, view.directions, np.where(inner, frame.depth, 0.0))
    wrong = angles(frame.normal, unit(p - centre))[inner]
    largest = np.abs(p).max(axis=-1)[inner]
    noise = 4 * ULP * (largest + np.linalg.norm(view.origin) / 2)
    step = {"analytic": np.inf, "central": 4.9215666e-3, "forward": 3.4526698e-4, "tetrahedron": 3.4526698e-4}[normals]
    h = step * largest
    bound = {
        "analytic": noise,
        "central": np.sqrt(3) * (h * h / 2 + noise / h) + noise,
        "forward": np.sqrt(3) * (h / 2 + 2 * noise / h) + noise,
        "tetrahedron": np.sqrt(3) * (h / 2 + 2 * noise / h) + noise,
    }[normals]
    assert inner.sum() > 3000 and np.all(wrong <= bound), (wrong / bound).max()


def test_finite_differences_cost_accuracy(renderer: rm.Renderer) -> None:
    """The order that the theory gives: analytic before central before the first-order two."""
    view = View((1.0, 0.7, 4.0), (0, 0, 0), 35.0, (160, 120))
    worst = {}
    for normals in ("analytic", "central", "tetrahedron", "forward"):
        frame = renderer.render(scene_of(view, rm.sphere(), quality=rm.Quality(normals=normals)), outputs=("normal",))
        hit = np.isfinite(frame.depth)
        p = points(view.origin, view.directions, np.where(hit, frame.depth, 0.0))
        worst[normals] = float(np.median(angles(frame.normal, unit(p))[hit]))
    assert worst["analytic"] < worst["central"] < min(worst["tetrahedron"], worst["forward"])


# From inside.


@pytest.mark.parametrize("way", [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
def test_from_inside_a_ball_its_wall_is_seen(renderer: rm.Renderer, way: Any) -> None:
    position = np.array([0.4, -0.3, 0.2])
    up = (0.0, 1.0, 0.0) if way[1] == 0 else (0.0, 0.0, 1.0)
    view = View(tuple(position), tuple(position + way), 80.0, (64, 48), up)
    renderer.resize(view.size)
    frame = renderer.render(scene_of(view, rm.sphere(2.0)), outputs=("color", "depth"))
    t = hit_sphere(view.origin, view.directions, (0, 0, 0), 2.0)
    normal = unit(points(view.origin, view.directions, t))
    cosine = np.sum(normal * view.directions, axis=-1)
    # From inside the ball the field is not convex along the ray: the wall is nearer than the tangent says.
    assert np.all(np.abs(frame.depth - t) <= allowed(view, t, cosine) + EPSILON * view.pixel * t)
    assert np.all(angles(frame.normal, normal) <= 2 * EPSILON * view.pixel + 16 * ULP), "normals point outwards"
    sun = unit(np.array([0.5, 1.0, 0.7]))
    lit = np.sum(-normal * sun, axis=-1)  # it is shaded on the side that is seen
    clear = np.abs(lit) > 0.05
    ambient = 0.5 * 0.1
    shade = frame.color[..., 0]
    assert np.all((shade > ambient + 0.02)[clear & (lit > 0)]) and np.all(
        np.abs(shade - ambient)[clear & (lit < 0)] < 1e-6
    )


def test_from_below_the_ground_its_surface_is_seen_above_and_nothing_below(renderer: rm.Renderer) -> None:
    view = View((0, -3, 0), (0, -2.5, -1), 60.0, (160, 120))
    frame = renderer.render(scene_of(view, rm.plane()), outputs=("depth",))
    t = hit_plane(view.origin, view.directions, 0.0)
    inner = ~edges(np.isfinite(t).astype(int))
    steep = inner & np.isfinite(t) & (view.directions[..., 1] > 0.05)
    assert_depths(frame.depth, view, t, view.directions[..., 1], steep)
    assert np.all(np.isinf(frame.depth[view.directions[..., 1] < -0.01]))
    assert np.all(frame.normal[steep] == (0, 1, 0))


# Light, by its formula.


@pytest.mark.parametrize("shininess", [2.0, 30.0, 300.0])
def test_a_surface_is_shaded_after_phong(renderer: rm.Renderer, shininess: float) -> None:
    """Ambient, diffuse and highlight of a sun and a lamp on a ball, pixel by pixel."""
    hue = np.array([0.7, 0.4, 0.2])
    material = rm.Material(tuple(hue), shininess=shininess, specular=0.5, ambient=0.15)
    sun, lamp = unit(np.array([0.5, 0.8, 0.6])), np.array([-1.0, 1.5, 2.0])
    lights = [rm.Sun(tuple(sun), (1, 0.9, 0.8), 0.7), rm.PointLight(tuple(lamp), (0.2, 0.5, 1.0), 5)]
    view = View((0.5, 0.4, 4.0), (0, 0, 0), 35.0, (160, 120))
    frame = renderer.render(scene_of(view, rm.sphere().material(material), lights=lights), outputs=("color", "depth"))
    hit = np.isfinite(frame.depth)
    p = points(view.origin, view.directions, np.where(hit, frame.depth, np.inf))[hit]
    normal, back = unit(p), -view.directions[hit]
    expected = np.zeros((len(p), 3))
    for way, light in ((np.broadcast_to(sun, p.shape), (0.7, 0.63, 0.56)), (lamp - p, (1.0, 2.5, 5.0))):
        far = np.linalg.norm(way, axis=-1, keepdims=True)
        towards = way / far
        falls = 1.0 if light[0] == 0.7 else far**-2
        diffuse = np.maximum(np.sum(normal * towards, axis=-1, keepdims=True), 0)
        mirrored = 2 * np.sum(normal * towards, axis=-1, keepdims=True) * normal - towards
        gloss = np.maximum(np.sum(mirrored * back, axis=-1, keepdims=True), 0) ** shininess * (diffuse > 0)
        expected += np.array(light) * falls * (hue * (0.15 + diffuse) + 0.5 * gloss)
    # The highlight changes by the exponent times the error of the normal, some ulp of the coordinates.
    assert np.all(np.abs(frame.color[hit] - expected) <= (16 + 16 * shininess) * ULP * 5)
    assert frame.color[hit].max() > 1.0


# Where marching is hard.


@pytest.mark.parametrize("tracer", TRACERS)
@pytest.mark.parametrize("thickness", [0.05, 0.002])
def test_nothing_thin_is_stepped_over(renderer: rm.Renderer, tracer: str, thickness: float) -> None:
    """A plate behind a ball: a ray that leaves the ball behind sees the distance grow, and is tempted to leap."""
    plate = rm.box((40, 40, thickness)).translate((0, 0, -3))
    ball = rm.sphere(0.8).translate((0.2, 0.1, 1))
    view = View((0.3, 0.2, 6.0), (0.1, 0, 0), 40.0, (160, 120))
    frame = renderer.render(scene_of(view, plate | ball, quality=rm.Quality(tracer=tracer)), outputs=("depth",))
    near = hit_sphere(view.origin, view.directions, (0.2, 0.1, 1), 0.8)
    behind = (-3 + thickness / 2 - view.origin[2]) / view.directions[..., 2]
    inner = ~edges(np.isfinite(near).astype(int)) & np.isinf(near)
    assert np.isfinite(frame.depth).all()
    assert_depths(frame.depth, view, behind, -view.directions[..., 2], inner)


def open_ground() -> rm.Node:
    """With a ball high up behind the camera, so that no box of the scene ends at the ground, where rays would start."""
    return rm.plane() | rm.sphere().translate((0, 30, 60))


@pytest.mark.parametrize("tracer", TRACERS)
def test_the_ground_reaches_its_horizon(renderer: rm.Renderer, tracer: str) -> None:
    view = View((0, 1, 0), (0, 1, -1), 30.0, (160, 120))
    frame = renderer.render(scene_of(view, open_ground(), quality=rm.Quality(tracer=tracer)), outputs=("depth",))
    # Row 59 is half a pixel above the horizon: there a ray comes within a pixel of the ground, and may take it.
    assert not np.isfinite(frame.depth[:59]).any() and np.isfinite(frame.depth[60:]).all()
    t = hit_plane(view.origin, view.directions, 0.0)
    assert_depths(
        frame.depth, view, t, -view.directions[..., 1], np.broadcast_to(np.arange(120)[:, None] > 70, t.shape)
    )


def test_a_ray_that_runs_out_of_steps_takes_what_it_came_nearest(renderer: rm.Renderer) -> None:
    """Over a plane each step of plain tracing is the height; where 40 of them do not arrive, the ray has come to a
    known place, and shows the ground there."""
    view = View((0, 1, 0), (0, 1, -1), 30.0, (160, 120))
    quality = rm.Quality(tracer="plain", max_steps=40, analytic=False)
    frame = renderer.render(scene_of(view, open_ground(), quality=quality), outputs=("depth", "evaluations"))
    sinking = -view.directions[..., 1]
    t = np.zeros(sinking.shape)
    for _ in range(40):
        t += 1 - t * sinking
    height = 1 - t * sinking
    ran_out = (frame.iterations == 40) & (sinking > 0)
    assert 0.01 < ran_out.mean() < 0.5
    sure = ran_out & (np.abs(height / t / view.pixel - 1) > 0.01) & (height > 1.01 * EPSILON * view.pixel * t)
    assert sure.any() and np.all(np.abs(frame.depth[sure] / t[sure] - 1) < 1e-4)
    assert not np.isfinite(frame.depth)[sinking < 0].any() and 40 < frame.iterations[sinking < 0].max() < 4096


def test_a_far_horizon_is_seen_through_a_long_lens(renderer: rm.Renderer) -> None:
    """The first row below the horizon shows the ground more than a thousand heights away."""
    view = View((0, 1, 0), (0, 1, -1), 4.0, (64, 48))
    renderer.resize(view.size)
    frame = renderer.render(scene_of(view, open_ground()), outputs=("depth",))
    t = hit_plane(view.origin, view.directions, 0.0)
    assert t[24].min() > 1000
    assert np.isfinite(frame.depth[24:]).all() and not np.isfinite(frame.depth[:23]).any()
    # A ray that ran out of its 512 steps has come within a pixel's width, any other within an epsilon.
    below = np.broadcast_to(np.arange(48)[:, None] > 24, t.shape)
    assert_depths(frame.depth, view, t, -view.directions[..., 1], below & (frame.iterations < 512))
    assert_depths(frame.depth, view, t, -view.directions[..., 1] * EPSILON, below)


def test_positions_are_those_of_the_hits_also_far_from_the_origin(renderer: rm.Renderer) -> None:
    """The shader's coordinates are relative to a point near the camera there; positions are those of the scene."""
    for place in (0.0, 1e5):
        node = (rm.sphere() | rm.box(1).rotate(0.3, "y").translate((1.5, 0, 0))).translate((place, 0, 0))
        scene = rm.Scene(node, rm.Camera((place, 1, 6), (place, 0, 0)))
        frame = renderer.render(scene, outputs=("position", "depth"))
        assert frame.pose is not None
        hit = np.isfinite(frame.depth)
        rays = frame.pose.directions(np.arange(160), np.arange(120)[:, None], (160, 120))
        expected = frame.pose.position + frame.depth[..., None] * rays
        error = np.abs(frame.position - expected)[hit]
        assert hit.any() and error.max() <= 8 * np.spacing(np.float32(place + 8))
        assert np.isnan(frame.position[~hit]).all()


def test_a_camera_a_ten_thousandth_of_a_radius_above_a_torus(renderer: rm.Renderer) -> None:
    """Rays along the surface take up to 860 steps. Those that ran out of 512 showed a surface that they pass. With a
    lower limit, rays that rise from the surface go on; others show it."""
    renderer.resize((96, 54))
    up = np.array((0.94, 0.34, 0.0)) / np.linalg.norm((0.94, 0.34, 0.0))
    foot = (0.9, 0.0, 0.0) + 0.1001 * up
    camera = rm.Camera(tuple(foot), tuple(foot + 0.05 * up - (0, 0, 1)), tuple(up), fov=30)
    scene = rm.Scene(rm.torus(0.9, 0.1), camera, lights=[])
    frame = renderer.render(scene, outputs=("depth", "iterations"))
    wrong = np.isfinite(frame.depth) != rm.truth(scene, renderer.size, outputs=()).hit
    assert 512 < frame.iterations.max() < 1000 and wrong.sum() <= 2
    short = renderer.render(scene.replace(quality=rm.Quality(max_steps=100)), outputs=("depth", "iterations", "done"))
    assert 100 < short.iterations.max() < 1000 and np.all(short.iterations[~short.done] >= 100)
    assert not (np.isfinite(frame.depth) & ~np.isfinite(short.depth)).any()
    shown = np.isfinite(short.depth) & ~np.isfinite(frame.depth)
    assert not (shown & short.done).any() and shown.mean() < 0.01


@pytest.mark.parametrize("radius", [1.0, 100.0, 1e4])
def test_rays_from_just_above_a_ball_meet_what_lies_behind_it(renderer: rm.Renderer, radius: float) -> None:
    """They rise slowly from the ball, and go on: none of 81 shows the sky before the box."""
    renderer.resize((9, 9))
    eye = radius * (1 + 1e-4)
    behind = rm.box(0.6 * radius).translate((0, radius, -3 * radius))
    camera = rm.Camera((0, eye, 0), (0, eye + 0.02 * radius, -2 * radius), fov=6)
    scene = rm.Scene(rm.sphere(radius) | behind, camera, lights=[], quality=rm.Quality(analytic=False))
    right = rm.truth(scene, renderer.size, outputs=()).hit
    frame = renderer.render(scene, outputs=("depth", "done"))
    assert frame.done.all() and np.array_equal(np.isfinite(frame.depth), right)
    short = scene.replace(quality=scene.quality.replace(max_steps=70))
    assert np.array_equal(np.isfinite(renderer.render(short, outputs=("depth",)).depth), right)
