"""Lights that are shown, touch solids, cut them and graze them, against closed forms and brute force in float64."""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.prepare import prepare
from raymarch.plan.unused import unused

N = 17
WHITE = rm.Material((1.0, 1.0, 1.0), specular=0.0, ambient=0.0)
BLACK = (0.0, 0.0, 0.0)
BALL = rm.SphereLight((0, 1.5, 0), 0.3, intensity=2, shadow=True, visible=True)
PLATE = rm.RectLight((0, 1.5, 0), 0.6, 0.6, intensity=1, shadow=True, visible=True)
MIRROR = rm.Material(albedo=(1, 1, 1), metalness=1.0, roughness=0.0)


@pytest.fixture(scope="module")
def renderer() -> Iterator[rm.Renderer]:
    with rm.Renderer((N, N)) as made:
        yield made


def towards(position: Any, target: Any, fov: float = 1.0) -> rm.Camera:
    return rm.Camera(position, target, fov=fov)


def scene(light: rm.Light, camera: rm.Camera, node: Any = None, **more: Any) -> rm.Scene:
    return rm.Scene(rm.plane().material(WHITE) if node is None else node, camera, [light], sky=BLACK, **more)


@pytest.mark.parametrize("light", [BALL, BALL.replace(penumbra="sampled"), BALL.replace(shadow=False), PLATE])
@pytest.mark.parametrize("bounces", [0, 1])
def test_a_light_that_is_shown_lights_as_if_it_were_not(renderer: rm.Renderer, light: rm.Light, bounces: int) -> None:
    seen = scene(light, towards((0, 0.7, 2.5), (0, 0, 0)), bounces=bounces, quality=rm.Quality(samples=16))
    shown = renderer.render(seen).color
    hidden = renderer.render(
        seen.replace(
            lights=[
                light.replace(visible=False, penumbra="sampled")
                if light.shadow and isinstance(light, rm.SphereLight)
                else light.replace(visible=False)
            ]
        )
    ).color
    np.testing.assert_allclose(shown.mean(), hidden.mean(), rtol=2e-3)


@pytest.mark.parametrize(
    ("light", "radiance"), [(BALL, 2 / 0.3**2), (PLATE.replace(direction=(0, 0, 1), up=(0, 1, 0)), math.pi / 0.6**2)]
)
@pytest.mark.parametrize("shadow", [True, False])
def test_camera_mirrors_and_refraction_show_the_radiance_of_a_light(
    renderer: rm.Renderer, light: rm.Light, radiance: float, shadow: bool
) -> None:
    light = light.replace(shadow=shadow)
    direct = renderer.render(scene(light, towards((0, 1.5, 3), (0, 1.5, 0))))
    np.testing.assert_allclose(direct.color, radiance, rtol=1e-5)
    wall = rm.box((4, 4, 0.1)).translate((0, 1.5, 4)).material(MIRROR)  # behind the camera
    mirrored = scene(light, towards((0.5, 1.5, 2), (0.335, 1.5, 3.95)), wall, bounces=1, quality=rm.Quality(samples=64))
    np.testing.assert_allclose(renderer.render(mirrored).color.mean(), radiance, rtol=0.01)
    pane = rm.box((4, 4, 0.05)).translate((0, 1.5, 2)).material(rm.Material(transmission=1.0, ior=1.001))
    for integrator in ("path", "whitted"):
        through = scene(light, towards((0, 1.5, 4), (0, 1.5, 0)), pane, quality=rm.Quality(integrator=integrator))
        np.testing.assert_allclose(np.median(renderer.render(through).color), radiance, rtol=0.01)


@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_truth_shows_lights(renderer: rm.Renderer, integrator: str) -> None:
    wide = rm.Camera((0.3, 1.2, 4), (0, 1, 0), fov=50)
    node = rm.plane().material(WHITE) | rm.sphere(0.4).translate((0.6, 0.5, 1)).material(
        rm.Material(transmission=1.0, ior=1.3)
    )
    whitted = integrator == "whitted"
    quality = rm.Quality(integrator=integrator, light_samples=64 if whitted else 1)
    seen = scene(BALL.replace(shadow=False), wide, node if whitted else None, quality=quality, bounces=2 * whitted)
    drawn, known = renderer.render(seen).color, rm.truth(seen, (N, N)).color
    assert known.max() > 20
    assert np.mean(np.abs(drawn - known).max(axis=-1) > 0.01 * (1 + known.max(axis=-1))) < 0.02


def test_many_lights_are_shown_from_rows(renderer: rm.Renderer) -> None:
    row = [rm.SphereLight((0.5 * k - 2, 1.5, 0), 0.2, intensity=0.04 * (k + 1), visible=k % 2 == 0) for k in range(9)]
    made = rm.Scene(rm.plane().material(WHITE), rm.Camera((0, 1.5, 6), (0, 1.5, 0), fov=40), row, sky=BLACK)
    np.testing.assert_allclose(renderer.render(made).color, rm.truth(made, (N, N)).color, atol=2e-4)
    assert rm.truth(made, (N, N)).color.max() == pytest.approx(9.0)


def test_a_parameter_moves_a_visible_light(renderer: rm.Renderer) -> None:
    lamp = rm.SphereLight((0, 1.5, 0), rm.Param("radius", 0.3, 0.1, 1), intensity=2, shadow=True, visible=True)
    made = scene(lamp, towards((0, 1.5, 3), (0, 1.5, 0)))
    for radius in (0.3, 0.5):
        color = renderer.render(made, params={"radius": radius}).color
        np.testing.assert_allclose(color, 2 / radius**2, rtol=1e-5)


def test_only_a_visible_light_is_in_the_text() -> None:
    camera = towards((0, 0.7, 2.5), (0, 0, 0))
    shown, hidden = (prepare(scene(light, camera)).shader.text() for light in (PLATE, PLATE.replace(visible=False)))
    assert "visible_light" in shown and "visible_light" not in hidden and "ray_rect" not in hidden
    assert pickle.loads(pickle.dumps(PLATE)) == PLATE != PLATE.replace(visible=False)


def irradiance(points: Any, centre: Any, radius: float, rng: Any) -> Any:
    """Share of the cosine-weighted hemisphere about y that a ball covers, seen from outside of it, by brute force."""
    u, turn = rng.uniform(size=20_000), rng.uniform(0, 2 * np.pi, 20_000)
    rays = np.stack([np.sqrt(u) * np.cos(turn), np.sqrt(1 - u), np.sqrt(u) * np.sin(turn)], axis=1)
    away = np.asarray(points)[:, None] - centre
    along = np.einsum("nij,kj->nk", away, rays)
    inside = along**2 - (np.sum(away**2, axis=-1) - radius**2)
    return np.mean((inside > 0) & (-along > np.sqrt(np.maximum(inside, 0))), axis=1)


@pytest.mark.parametrize(("height", "radius"), [(0.0, 0.5), (0.3, 0.5), (-0.3, 0.5), (0.5, 0.5), (0.1, 2.0)])
@pytest.mark.parametrize("shadow", [None, "two-sided", "sampled"])
def test_a_ball_that_cuts_the_floor_lights_by_its_part_above_the_horizon(
    renderer: rm.Renderer, height: float, radius: float, shadow: str | None
) -> None:
    light = rm.SphereLight(
        (0, height, 0), radius, intensity=radius**2, shadow=shadow is not None, penumbra=shadow or "two-sided"
    )
    above = rm.Camera((0, 8, 0), (0, 0, 0), up=(0, 0, -1), fov=40)
    several = rm.Quality(light_samples=64) if shadow == "sampled" else rm.Quality()
    frame = renderer.render(scene(light, above, quality=several))
    truth = rm.truth(scene(light, above), (N, N), outputs=("depth",))
    points = (truth.origin + truth.depth[..., None] * truth.direction)[N // 2]
    # Where the ball touches the floor, rounding decides whether the point is outside of it: all is covered, or nothing.
    apart = np.abs(np.linalg.norm(points - np.array([0, height, 0]), axis=1) - radius) > 1e-6
    wanted = irradiance(points[apart], (0, height, 0), radius, np.random.default_rng(3))
    drawn = frame.color[N // 2, apart, 0]
    if shadow == "sampled":
        assert drawn.mean() == pytest.approx(wanted.mean(), abs=0.01)
    else:
        np.testing.assert_allclose(drawn, wanted, atol=0.01)


@pytest.mark.parametrize("gap", [0.0, 1e-4])
def test_what_touches_a_light_does_not_hide_it(renderer: rm.Renderer, gap: float) -> None:
    lid = rm.box((2, 0.2, 2)).translate((0, 2.1 + gap, 0)).material(WHITE)
    quality = rm.Quality(light_samples=16)
    for light in (rm.RectLight((0, 2, 0), 0.5, 0.5, shadow=True), rm.PointLight((0, 2, 0), shadow=True)):
        for closed in (True, False):
            with_lid = scene(
                light,
                towards((0, 0.7, 2.5), (0, 0, 0)),
                rm.plane().material(WHITE) | lid,
                quality=rm.Quality(light_samples=16, analytic=closed),
            )
            without = scene(light, with_lid.camera, quality=quality)
            drawn, wanted = renderer.render(with_lid).color.mean(), renderer.render(without).color.mean()
            assert drawn == pytest.approx(wanted, rel=1e-4)
            assert rm.truth(with_lid, (3, 3)).color.mean() == pytest.approx(wanted, rel=0.01)


def test_a_ball_is_lit_up_to_its_terminator_by_a_light_in_a_lid(renderer: rm.Renderer) -> None:
    """Rays that start beside a grazing surface go to the light, not beside it into the lid."""
    ball = rm.sphere(0.3).translate((0, 0.3, 0)).material(WHITE)
    lid = rm.box((2, 0.2, 2)).translate((0, 2.1, -0.3)).material(WHITE)
    seen = scene(rm.PointLight((0, 2, -0.3), shadow=True), rm.Camera((0, 0.4, 3), (0, 0.3, 0), fov=14), ball | lid)
    bare = seen.replace(lights=[seen.lights[0].replace(shadow=False)])
    np.testing.assert_allclose(renderer.render(seen).color, renderer.render(bare).color, atol=1e-6)


@pytest.mark.parametrize(("x", "wanted"), [(0.75, 0.9559), (-0.9, 0.0101)])
def test_a_wide_sun_shines_from_the_cone_of_its_tangent(renderer: rm.Renderer, x: float, wanted: float) -> None:
    """Half of space above a floor is covered at height 1; the shares are integrals over the cone."""
    sun = rm.Sun((0, 1, 0), shadow=True, softness=1.0, penumbra="sampled")
    roof = rm.box((40, 0.002, 40)).translate((-20, 1.001, 0))
    node = (rm.plane() | roof).material(WHITE)
    seen = scene(sun, towards((x + 2, 0.4, 0), (x, 0, 0), 0.1), node, quality=rm.Quality(light_samples=64))
    assert renderer.render(seen).color.mean() == pytest.approx(wanted, abs=0.008)
    assert rm.truth(seen, (1, 1)).color.mean() == pytest.approx(wanted, abs=0.03)
    if x > 0:  # beside the light, where a two-sided penumbra is exact enough
        near = renderer.render(seen.replace(lights=[sun.replace(penumbra="two-sided")])).color.mean()
        assert near == pytest.approx(wanted, abs=0.012)


ROOM_CAMERAS = {
    "near": rm.Camera((0, 0, 3.9), (0, 0, 0), fov=28),
    "far": rm.Camera((0, 0, 39), (0, 0, 0), fov=2.8),
    "orthographic": rm.Camera((0, 0, 3.9), (0, 0, 0), projection="orthographic", height=2),
}


@pytest.mark.parametrize(
    ("camera", "analytic", "coarse"),
    [("near", True, None), ("near", False, None), ("far", False, 0.5), ("orthographic", False, 0.5)],
)
def test_the_brightness_of_a_room_does_not_depend_on_the_size_of_the_picture(
    camera: str, analytic: bool, coarse: float | None
) -> None:
    walls = [rm.box((2.4, 0.2, 2.4)).translate((0, y, 0)) for y in (-1.1, 1.1)]
    walls += [rm.box((0.2, 2.4, 2.4)).translate((x, 0, 0)) for x in (-1.1, 1.1)]
    walls += [rm.box((2.4, 2.4, 0.2)).translate((0, 0, -1.1))]
    room = rm.union(*walls).material(WHITE.replace(color=(0.7, 0.7, 0.7)))
    made = rm.Scene(room, ROOM_CAMERAS[camera], lights=[], sky=(1, 1, 1), bounces=3)
    with rm.Renderer((8, 8)) as small:
        shades = [
            small.render(
                made.replace(quality=rm.Quality(samples=512 if coarse is None else 144, analytic=analytic, epsilon=e))
            ).color.mean()
            for e in (coarse, 1e-3)
        ]
    assert shades[0] == pytest.approx(shades[1], rel=1e-3 if coarse is None else 3e-3)


def test_an_emissive_node_at_the_place_of_a_light_is_doubted() -> None:
    node = rm.plane() | rm.sphere(0.3).material(rm.Material(emission=(9, 9, 9))).translate((0, 1.5, 0))
    doubts = [rm.Scene(node, lights=[BALL.replace(visible=shown)]) for shown in (False, True)]
    found = [any("visible=True" in doubt for doubt in unused(each)) for each in doubts]
    assert found == [True, False]


@pytest.mark.parametrize("size", [0.001, 1.0, 1000.0])
def test_a_light_that_a_floor_cuts_is_shown_no_deeper_than_a_hit_may_lie(renderer: rm.Renderer, size: float) -> None:
    """In a coarse picture. Two epsilons below the floor would add a sixth to what is seen of it."""
    ball = rm.SphereLight((0, -0.03 * size, 0), 0.12 * size, intensity=size**2, shadow=True, visible=True)
    floor = rm.box((3 * size, 0.2 * size, 3 * size)).translate((0, -0.1 * size, 0)).material(WHITE)
    camera = rm.Camera((0, 0.8 * size, 3 * size), (0, 0, 0), fov=30)

    def shown(quality: rm.Quality) -> float:
        seen = scene(ball, camera, floor, quality=quality)
        hidden = seen.replace(lights=[ball.replace(visible=False, penumbra="sampled")])
        return float((renderer.render(seen).color - renderer.render(hidden).color).sum())

    assert shown(rm.Quality(samples=64)) < 1.07 * shown(rm.Quality(samples=64, epsilon=0.002))


@pytest.mark.parametrize("integrator", ["path", "whitted"])
@pytest.mark.parametrize("bounces", [0, 1])
@pytest.mark.parametrize(
    ("planes", "seen"), [((0, None), 3), ((2.2, None), 1), ((4.5, None), 0), ((0, 1), 0), ((0, 3), 3)]
)
def test_clip_planes_hide_lights(
    renderer: rm.Renderer, planes: tuple[float, float | None], seen: float, bounces: int, integrator: str
) -> None:
    """A camera looks at a ball before a plate."""
    lights = [
        rm.SphereLight((0, 0, 2), 0.5, intensity=0.75, visible=True),
        rm.RectLight((0, 0, 1), 2, 2, intensity=4 / math.pi, direction=(0, 0, 1), visible=True),
    ]
    camera = rm.Camera((0, 0, 4), (0, 0, 0), near=planes[0], far=planes[1])
    given = scene(lights[0], camera, rm.sphere().translate((0, 99, 0)), bounces=bounces).replace(lights=lights)
    given = given.replace(quality=rm.Quality(integrator=integrator))
    np.testing.assert_allclose(renderer.render(given).color[N // 2, N // 2], seen, rtol=1e-4)
    if not bounces:
        np.testing.assert_allclose(rm.truth(given, (N, N)).color[N // 2, N // 2], seen, rtol=1e-4)
