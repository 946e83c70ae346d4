"""Pictures of implicit surfaces: held against tiny steps in float64, alone, and as parts of solids."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.context import Context
from raymarch.plan import plan
from tests.lab.implicit import SIZE, compared, directions_of, rays_of, scene_of
from tests.support.surfaces import SURFACES

WHISKERS = {"roman": 4}
"""The Roman surface touches 0 along lines outside of it: rays within rounding errors of them may hit them."""


QUICK = ("klein", "heart")


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.long) for n in SURFACES])
def test_no_pixel_is_missed_and_hits_are_where_tiny_steps_find_them(name: str, egl: Context) -> None:
    surface = SURFACES[name]
    scene = scene_of(surface, surface.node())
    assert plan(scene).marching.tracer == "advance"
    with rm.Renderer(SIZE, context=egl) as renderer:
        row = compared(surface, renderer.render(scene), rays_of(surface, steps=400))
    assert row.missed == 0
    assert row.invented <= WHISKERS.get(name, 0)
    assert row.p99 <= 0.05
    assert row.evaluations < (6.0 if name == "lidinoid" else 4.0)  # no polynomial
    assert row.most < 40


INSIDE = {"klein": (1.0, 0.4, -2.2), "heart": (0.2, 0.3, 0.1)}


@pytest.mark.parametrize("name", INSIDE)
def test_from_inside_the_far_side_is_seen(name: str, egl: Context) -> None:
    """The ray is known to stay inside up to there, though the divided function is small."""
    surface, size, eye = SURFACES[name], (32, 18), np.array(INSIDE[name])
    scene = rm.Scene(surface.node() | rm.sphere(0.1).translate((9, 0, 0)), rm.Camera(INSIDE[name], (0, 0, 0), fov=60))
    with rm.Renderer(size, context=egl) as renderer:
        frame = renderer.render(scene, outputs=("depth", "evaluations"))
    d, pixel = directions_of(eye, np.zeros(3), size, 60.0)
    share = np.concatenate([np.linspace(0.0, 1.0 - 0.01 * pixel, 200), [1.0 + 0.01 * pixel]])
    places = eye + share[:, None, None] * frame.depth.reshape(-1, 1) * d
    inside = (surface.function(np.moveaxis(places, -1, 0)) < 0.0) & (np.abs(places) < surface.bounds).all(axis=-1)
    assert inside[:-1].all() and not inside[-1].any()
    assert frame.evaluations.mean() < 12.0


def pictures(egl: Context, *scenes: rm.Scene) -> list[Any]:
    with rm.Renderer(SIZE, context=egl) as renderer:
        return [np.asarray(renderer.render(scene).image(), np.int64) for scene in scenes]


def quadric(factor: float = 40.0) -> rm.Node:
    return rm.implicit(lambda p: factor * (rm.dot(p, p) - 1.0), 1.5)


METAL = rm.Material(metalness=1.0, roughness=0.0)

PARTS: dict[str, Any] = {
    "union": lambda ball: ball | rm.box((0.6, 2.6, 0.6)),
    "carved": lambda ball: ball - rm.box((0.8, 0.8, 4.0)),
    "carving": lambda ball: rm.box((1.7, 1.7, 1.7)) - ball.translate((0.6, 0.6, 0.6)),
    "moved": lambda ball: ball.scale((1.0, 0.6, 1.2)).rotate(0.7, (1, 1, 0)).translate((0.2, 0.1, 0.0)),
    "repeated": lambda ball: ball.scale(0.4).repeat(1.0, 3),
    "cut": lambda ball: ball & rm.plane((1, 1, 0), 0.2),
    "mirror": lambda ball: (
        ball.material(rm.Material(metalness=1.0, roughness=0.0))
        | rm.plane(offset=-1.0)
        | rm.box(0.5).translate((1.5, -0.5, 0.5))
    ),
}


@pytest.mark.parametrize("name", PARTS)
def test_a_quadric_ball_is_a_ball_in_every_solid(name: str, egl: Context) -> None:
    """Shadows and mirrors, too. Pixels at edges differ."""
    camera, lights = rm.Camera((3.0, 2.4, 4.0), (0, 0, 0)), [rm.Sun((1, 2, 1.5), shadow=True)]
    scenes = [rm.Scene(PARTS[name](ball), camera=camera, lights=lights) for ball in (quadric(), rm.sphere())]
    made, wanted = pictures(egl, *scenes)
    different = np.abs(made - wanted).max(axis=-1) > 8
    assert different.mean() < 0.004


def test_blends_and_shells_act_on_about_the_distance(egl: Context) -> None:
    """The unit of a quadric is its slope at the surface, so its blend is nearly that of the ball."""
    for solid in (
        lambda ball: rm.union(ball, rm.plane(offset=-0.8), k=0.4),
        lambda ball: ball.shell(0.1) - rm.box(1.2),
    ):
        made, wanted = pictures(egl, *[rm.Scene(solid(ball)) for ball in (quadric(), rm.sphere())])
        assert 0.0 < (np.abs(made - wanted).max(axis=-1) > 24).mean() < 0.06


def test_a_parameter_of_the_level_and_of_the_function_moves_the_surface(egl: Context) -> None:
    level, power = rm.Param("level", 1.0, 0.5, 1.5), rm.Param("squash", 1.0, 0.5, 2.0)
    node = rm.implicit(lambda p: p.x**2 + power * p.y**2 + p.z**2, 2.0, level)
    scene = rm.Scene(node, camera=rm.Camera((0, 0, 5)))
    assert plan(scene).marching.tracer == "advance"
    with rm.Renderer(SIZE, context=egl) as renderer:
        shares = [
            np.isfinite(renderer.render(scene, params=given).array("depth")).mean()
            for given in ({}, {"level": 1.5}, {"squash": 2.0})
        ]
    assert shares[2] < 0.85 * shares[0] < 0.85 * shares[1] / 1.2
