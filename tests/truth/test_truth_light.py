"""Light, shadow, fog and sky against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raymarch.scene import Camera, Fog, Material, PointLight, Scene, Sun
from raymarch.scene.light import Light
from raymarch.scene.light_kinds import KINDS
from raymarch.scene.parameter import Values, as_direction
from raymarch.scene.value import value
from raymarch.sdf import box, plane, sphere
from raymarch.truth import truth
from raymarch.truth.light import soft_visibility
from raymarch.truth.rays import Rays
from tests.support.analytic import unit

WHITE = Material((1, 1, 1), specular=0.0, ambient=0.0)
ABOVE = Camera((0.3, 6, 5), (0, 0, 0), fov=25.0)


def points(made: Any) -> Any:
    return made.position + made.depth[made.hit][:, None] * made.direction[made.hit]


@pytest.mark.parametrize("direction", [(1, 2, 1), (1, 0.3, -0.5)])
def test_phong_of_one_sun(direction: Any) -> None:
    """The formula, written out once more, on a ball; what faces away has no highlight."""
    skin = Material((0.7, 0.4, 0.2), shininess=2.0, specular=0.6, ambient=0.15)
    sun = Sun(direction, color=(1.0, 0.9, 0.8), intensity=1.5)
    made = truth(Scene(sphere().material(skin), camera=Camera((0, 0, 4), (0, 0, 0)), lights=[sun]), (31, 31))
    n, v, light = points(made), -made.direction[made.hit], unit(direction)
    cosine = n @ light
    r = 2 * cosine[:, None] * n - light
    highlight = np.maximum(np.einsum("ij,ij->i", r, v), 0) ** 2 * (cosine > 0)
    tint = np.array([0.7, 0.4, 0.2])
    wanted = (
        1.5
        * np.array([1.0, 0.9, 0.8])
        * (0.15 * tint + np.maximum(cosine, 0)[:, None] * tint + 0.6 * highlight[:, None])
    )
    np.testing.assert_allclose(made.color[made.hit], wanted, atol=1e-12)
    assert highlight.max() > 0.7 and np.any(cosine < 0)


def test_light_falls_off_with_the_square_of_the_distance() -> None:
    def brightness(height: float) -> float:
        lamp = PointLight((0, height, 0), color=(1, 0.5, 0.25), intensity=3.0)
        scene = Scene(plane().material(WHITE), camera=Camera((0, 5, 0), (0, 0, 0), up=(0, 0, 1)), lights=[lamp])
        return float(truth(scene, (1, 1)).color[0, 0, 0])

    np.testing.assert_allclose([brightness(h) * h * h for h in (0.5, 1.0, 2.0, 8.0)], 3.0, rtol=1e-12)


def test_lights_add_up_and_none_is_black() -> None:
    def picture(*lights: Any) -> Any:
        return truth(Scene(sphere(), camera=ABOVE, lights=lights, sky=(0, 0, 0)), (16, 12)).color

    lamps = Sun((1, 1, 0)), PointLight((0, 2, 2), color=(1, 0, 0), shadow=True)
    np.testing.assert_allclose(picture(*lamps), picture(lamps[0]) + picture(lamps[1]), atol=1e-15)
    assert not picture().any()


@pytest.mark.parametrize("direction", [(0, 1, 0), (0.5, 1, 0.2), (1, 0.4, -0.3)])
@pytest.mark.parametrize("floor", ["plane", "box"])
def test_shadow_of_a_ball_from_the_sun(direction: Any, floor: str) -> None:
    """A floor point is dark if the line to the sun passes the ball's centre closer than its radius."""
    centre, radius = np.array([0.2, 0.9, -0.1]), 0.6
    ground = plane() if floor == "plane" else box((40, 1, 40)).translate((0, -0.5, 0))
    node = (ground | sphere(radius).translate(centre)).material(WHITE)
    made = truth(Scene(node, camera=ABOVE, lights=[Sun(direction, shadow=True)]), (150, 100))
    where = points(made)
    on_floor = np.abs(where[:, 1]) < 1e-9
    way, light = centre - where[on_floor], unit(direction)
    passing = np.linalg.norm(np.cross(way, light), axis=1)
    lit = made.color[made.hit][on_floor][:, 0] > 0
    sure = np.abs(passing - radius) > 1e-6
    assert np.array_equal(lit[sure], (passing > radius)[sure])
    assert (~lit).sum() > 300
    nearest = np.abs(passing - radius)
    assert nearest[lit].min() < 1e-3 and nearest[~lit].min() < 1e-3  # the edge was looked at closely


def test_shadow_from_a_lamp_ends_at_the_lamp() -> None:
    """What stands between darkens; what stands behind the lamp does not."""
    lamp = np.array([0.0, 2.0, 0.0])
    between, behind = sphere(0.3).translate((0, 1, 0)), box((9, 0.1, 9)).translate((0, 3, 0))
    node = (plane() | between | behind).material(WHITE)
    made = truth(Scene(node, camera=Camera((0, 1.6, 6), (0, 0, 0)), lights=[PointLight(lamp, shadow=True)]), (120, 80))
    where = points(made)
    on_floor = np.abs(where[:, 1]) < 1e-9
    way = unit(lamp - where[on_floor])
    passing = np.linalg.norm(np.cross((0, 1, 0) - where[on_floor], way), axis=1)
    lit = made.color[made.hit][on_floor][:, 0] > 0
    sure = np.abs(passing - 0.3) > 1e-6
    assert np.array_equal(lit[sure], (passing > 0.3)[sure])
    assert lit.any() and (~lit).any()


def test_a_lone_convex_solid_does_not_shadow_itself() -> None:
    """Its light with a shadow is that without, up to the edge where the light only grazes it."""
    for node in (sphere(1.0), box((1, 2, 1)), sphere(1e4).translate((0, -1e4, 0))):
        pictures = [
            truth(
                Scene(node.material(WHITE), camera=Camera((2, 2, 3), (0, 0, 0)), lights=[Sun((1, 1, 0), shadow=s)]),
                (60, 40),
            )
            for s in (False, True)
        ]
        np.testing.assert_allclose(pictures[0].color, pictures[1].color, atol=1e-6)


def test_from_inside_walls_are_lit_by_a_lamp_inside() -> None:
    lamp = PointLight((0.0, 0.0, 0.0), shadow=True)
    scene = Scene(sphere(2.0).material(WHITE), camera=Camera((0, 0, 1), (0, 0, 0)), lights=[lamp])
    made = truth(scene, (8, 6))
    np.testing.assert_allclose(made.color, 0.25, rtol=1e-9)
    outside = Scene(scene.node, camera=scene.camera, lights=[Sun(shadow=True)])
    assert not truth(outside, (8, 6)).color.any()


def test_a_lamp_on_the_surface_stays_finite() -> None:
    scene = Scene(sphere(), camera=Camera((0, 0, 4), (0, 0, 0)), lights=[PointLight((0, 0, 1), shadow=True)])
    assert np.isfinite(truth(scene, (5, 5)).color).all()


def test_the_softness_of_a_light_without_a_position_is_the_tangent_of_an_angle() -> None:
    @value
    class Beam(Light):
        """A further kind of light without a position."""

        direction: Any

        def __init__(self, direction: Any, softness: float) -> None:
            Light.__init__(self, (1, 1, 1), 1.0, True, softness, "two-sided")
            self._set(direction=as_direction("Beam: direction", direction))

    assert [kind.__name__ for kind in KINDS if _made(kind).has_position] == [
        "PointLight",
        "SpotLight",
        "SphereLight",
        "RectLight",
    ]
    ball = sphere()
    height = np.linspace(0.9, 1.1, 9)
    rays = Rays(np.stack([np.full(9, -2.0), height, np.zeros(9)], 1), np.tile([1.0, 0.0, 0.0], (9, 1)))
    near, end = np.full(9, 1e-3), np.full(9, 20.0)

    def visible(light: Light) -> Any:
        width = np.broadcast_to(Values({}).of(light.disc_width) / (end if light.has_position else 1.0), end.shape)
        return soft_visibility("two-sided", width, ball.distance, rays, ball.facts, near, end)

    sun = visible(Sun((1, 0, 0), shadow=True, softness=0.05))
    assert np.ptp(sun) > 0.5
    np.testing.assert_array_equal(visible(Beam((1, 0, 0), 0.05)), sun)
    assert not np.allclose(visible(PointLight((20, 0, 0), shadow=True, radius=0.05)), sun, atol=0.1)


def _made(kind: Any) -> Light:
    light: Light = kind() if kind is Sun else kind((0, 3, 0))
    return light


def test_fog_covers_surfaces_and_not_the_sky() -> None:
    haze = Fog((0.2, 0.4, 0.9), density=0.3)
    node, camera = plane() | sphere().translate((0, 1, 0)), Camera((0, 2, 6), (0, 1, 0))
    clear = truth(Scene(node, camera=camera, sky=(0.9, 0.1, 0.1)), (24, 16))
    foggy = truth(Scene(node, camera=camera, sky=(0.9, 0.1, 0.1), fog=haze), (24, 16))
    assert 0 < clear.hit.mean() < 1
    through = np.exp(-0.3 * clear.depth[clear.hit])[:, None]
    wanted = np.array([0.2, 0.4, 0.9]) * (1 - through) + clear.color[clear.hit] * through
    np.testing.assert_allclose(foggy.color[clear.hit], wanted, rtol=1e-13)
    assert np.all(foggy.color[~clear.hit] == (0.9, 0.1, 0.1))
