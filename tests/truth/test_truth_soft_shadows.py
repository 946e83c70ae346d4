"""Soft shadows against the share of a light's disc that is really seen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raymarch.scene import Camera, Material, Scene, SphereLight, Sun
from raymarch.scene.light import PENUMBRAS
from raymarch.sdf import box, cylinder, plane, sphere
from raymarch.truth import truth
from raymarch.truth.light import soft_visibility
from raymarch.truth.rays import Rays

WHITE = Material((1, 1, 1), specular=0, ambient=0)


def floor_picture(occluder: Any, light: Any, width: float = 1.2) -> tuple[Any, Any]:
    """Positions on the floor, and how much of the light is seen there: a picture with a shadow over one without."""
    camera = Camera((0, 0.2, 0.01), (0, 0, 0), up=(0, 0, 1), fov=np.degrees(2 * np.arctan(5 / 61 * width / 0.2)))
    pictures = []
    for shadow in (True, False):
        lights = [light.replace(shadow=shadow)]
        pictures.append(truth(Scene((plane() | occluder).material(WHITE), camera=camera, lights=lights), (61, 5)))
    lit, free = pictures
    where = lit.position + lit.depth[..., None] * lit.direction
    return where[2], lit.color[2, :, 0] / free.color[2, :, 0]


def disc_seen(points: Any, centre: Any, size: float, blocked: Any) -> Any:
    """Share of a ball's disc, as each point sees it, whose rays are not blocked; by 4,000 even samples."""
    k = np.arange(4000) + 0.5
    r, turn = np.sqrt(k / 4000), k * 2.399963
    seen = []
    for p in points:
        way = centre - p
        far = np.linalg.norm(way)
        axis = way / far
        side = np.cross(axis, (0, 0, 1))
        side /= np.linalg.norm(side)
        up = np.cross(axis, side)
        spread = size / far
        rays = axis + spread * r[:, None] * (np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up)
        seen.append(1 - np.mean(blocked(p, rays / np.linalg.norm(rays, axis=1, keepdims=True))))
    return np.array(seen)


def test_penumbra_of_an_edge() -> None:
    """A long block's edge across the light; its shadow is half where the edge hides half of the light."""
    centre, size = np.array([0.0, 6.0, 0.0]), 0.5
    block = box((4, 2, 40)).translate((2.0, 3.0, 0))  # its edge runs along z at x = 0, from y = 2 to 4
    where, shown = floor_picture(block, SphereLight(centre, size))

    def blocked(p: Any, rays: Any) -> Any:
        t = np.stack([(y - p[1]) / rays[:, 1] for y in np.linspace(2, 4, 41)])
        return np.any(p[0] + t * rays[:, 0] > 0, axis=0)

    wanted = disc_seen(where, centre, size, blocked)
    assert wanted.min() == 0 and wanted.max() == 1 and np.sum((wanted > 0) & (wanted < 1)) > 5
    assert np.abs(shown - wanted).max() <= 0.05


def test_penumbra_of_a_ball() -> None:
    centre, size, ball = np.array([0.0, 5.0, 0.0]), 0.4, np.array([0.0, 2.0, 0.0])
    where, shown = floor_picture(sphere(0.6).translate(ball), SphereLight(centre, size), 2.0)

    def blocked(p: Any, rays: Any) -> Any:
        way = ball - p
        along = rays @ way
        return way @ way - along**2 < 0.6**2

    wanted = disc_seen(where, centre, size, blocked)
    assert wanted.min() == 0 and wanted.max() == 1
    assert np.abs(shown - wanted).max() <= 0.05


def bends(values: Any, lag: int) -> float:
    """The greatest second difference of some values."""
    return float(np.abs(values[2 * lag :] - 2.0 * values[lag:-lag] + values[: -2 * lag]).max())


@pytest.mark.parametrize("turn", [0.16, 0.32, 0.48])
def test_the_shadow_of_a_thin_pole_has_no_streaks(turn: float) -> None:
    """Across and along it, what is seen bends at most three times as much as the part of the disc.

    The lines are as wide as the whole shadow, 201 points. A streak is a bend within a few of these.
    """
    radius, sine = 0.12, 0.12
    light = np.array([0.6 * np.cos(turn), 0.8, 0.6 * np.sin(turn)])
    away, beside = np.array([-np.cos(turn), 0.0, -np.sin(turn)]), np.array([np.sin(turn), 0.0, -np.cos(turn)])
    pole = cylinder(radius, 20.0).translate((0, 9.5, 0))

    def blocked(p: Any, rays: Any) -> Any:
        return np.abs(p[0] * rays[:, 2] - p[2] * rays[:, 0]) < radius * np.hypot(rays[:, 0], rays[:, 2])

    steps = np.linspace(-1.0, 1.0, 201)[:, None]
    lines = [far * away + steps * (radius + 0.24 * far) * beside for far in (1.5, 2.5)]
    lines += [(1.7 + 1.3 * steps) * (away + aside * beside) for aside in (0.0, 0.05)]
    for line in lines:
        n = len(line)
        rays = Rays(line, np.tile(light, (n, 1)))
        seen = soft_visibility(
            "two-sided", np.full(n, sine), pole.distance, rays, pole.facts, np.full(n, 1e-3), np.full(n, 9.0)
        )
        wanted = np.concatenate([disc_seen([p], p + light, sine / np.sqrt(1.0 - sine**2), blocked) for p in line])
        assert np.ptp(wanted) > 0.1 and np.abs(seen - wanted).max() <= 0.1
        assert bends(seen, 4) <= 3.0 * bends(wanted, 4)


@pytest.mark.parametrize("thickness", [0.2, 0.05, 0.002])
def test_a_thin_wall_hides_all(thickness: float) -> None:
    """Its depth says nothing of how far it reaches to the side."""
    roof = box((4, thickness, 4)).translate((0, 2, 0))
    for penumbra in PENUMBRAS:
        for direction in ((0, 1, 0), (0.3, 1, 0.2)):
            light = Sun(direction, softness=0.2, penumbra=penumbra)
            assert floor_picture(roof, light, 0.5)[1].max() == 0.0


@pytest.mark.parametrize("penumbra", PENUMBRAS)
def test_the_choices_agree_on_light_and_dark(penumbra: str) -> None:
    """What is far from the edge on either side is 1 or 0; only the edge is a matter of taste."""
    where, shown = floor_picture(
        sphere(0.6).translate((0, 2, 0)), Sun((0, 1, 0), softness=0.05, penumbra=penumbra), 2.0
    )
    x = np.abs(where[:, 0])
    assert np.all(shown[x < 0.48] == 0) and np.allclose(shown[x > 0.8], 1, atol=2e-3)
    _, places = np.unique(x.round(9), return_inverse=True)  # two points beside the ball are as far from its centre
    assert np.all(np.diff(np.bincount(places, shown) / np.bincount(places)) > -0.02)


def test_the_cone_is_dark_where_half_is_right() -> None:
    """The reason for the two-sided form."""
    values = {}
    for penumbra in PENUMBRAS:
        light = Sun((0, 1, 0), softness=0.1, penumbra=penumbra)
        where, shown = floor_picture(box((4, 2, 40)).translate((2, 3, 0)), light)
        order = where[:, 0].argsort()
        values[penumbra] = float(np.interp(0.0, where[order, 0], shown[order]))
    assert abs(values["two-sided"] - 0.5) < 0.06
    assert abs(values["sampled"] - 0.5) < 0.06
    assert values["cone"] < 0.12 and values["triangulated"] < 0.12
