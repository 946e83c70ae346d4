"""Solids that rays hit in closed form: the same surfaces as marched, in all kinds of rays and cameras."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu import Renderer

SIZE = (64, 48)
RED, GREEN, BLUE = (rm.Material(color=c) for c in ((0.9, 0.2, 0.1), (0.2, 0.8, 0.2), (0.2, 0.3, 0.9)))
SUN = rm.Sun((0.5, 1.0, 0.7), shadow=True)
RING = rm.union(rm.torus(0.6, 0.2).rotate(1.2, "x"), rm.sphere(0.3), k=0.2).translate((0.2, 0.7, -0.4))


def things(s: float = 1.0, x: Any = 0.0, marched: bool = True) -> rm.Node:
    """One of each shape with a closed form, on a floor, beside a blend."""
    found = [
        rm.plane().material(GREEN),
        rm.sphere(0.4).translate((-1.2 + x, 0.4, 0.3)).material(RED),
        rm.box((0.7, 0.5, 0.6)).rotate(0.7, "y").translate((-0.3, 0.25, 0.9)),
        rm.cylinder(0.25, 0.8).translate((1.0, 0.4, 0.6)).material(BLUE),
        rm.capsule((-0.2, 0.2, 0), (0.5, 0.3, 0.1), 0.2).translate((-0.6, 0, -0.9)),
        rm.cone(0.4, 0.9).translate((1.5, 0.45, -0.5)).material(RED),
        rm.cone(0.3, 0.5, 0.15).rotate(1.1, (1, 2, 0)).translate((-1.6, 0.5, -0.7)),
        rm.ellipsoid((0.9, 0.5, 0.5)).scale(0.8).rotate(0.4, "z").translate((0.6, 0.3, 1.3)).material(BLUE),
    ]
    found += [RING.material(RED)] if marched else []
    return rm.union(*(part.scale(s) for part in found) if s != 1.0 else found)


def scene(node: rm.Node | None = None, **parts: Any) -> rm.Scene:
    camera = parts.pop("camera", rm.Camera((1.0, 1.7, 4.0), (0, 0.3, 0), fov=45))
    return rm.Scene(node or things(), camera, parts.pop("lights", [SUN]), **parts)


def both(renderer: Renderer, made: rm.Scene, **how: Any) -> tuple[Any, Any]:
    renderer.resize(SIZE)
    drawn = []
    for choice in (True, False):
        frame = renderer.render(
            made.replace(quality=made.quality.replace(analytic=choice)), outputs=("color", "depth"), **how
        )
        drawn.append(frame)
    return drawn[0], drawn[1]


def assert_alike(a: Any, b: Any, edges: float = 0.01) -> None:
    """The same hits, but for a few pixels at edges and borders of shadows."""
    hit = np.isfinite(b.depth)
    assert np.isfinite(a.color).all()
    assert (np.isfinite(a.depth) != hit).mean() <= edges
    with np.errstate(invalid="ignore"):
        apart = np.abs(a.depth - b.depth) > 2e-3 * b.depth
    assert (apart & hit).mean() <= edges, (apart & hit).sum()
    colored = (np.abs(a.color - b.color) > 0.02).any(axis=-1)
    assert colored.mean() <= 2 * edges, colored.sum()


GLASS = rm.Material(albedo=(1, 1, 1), roughness=0, transmission=1, ior=1.5)
MIRROR = rm.Material(albedo=(0.9, 0.9, 0.9), roughness=0, metalness=1)
WHITTED = rm.Quality(integrator="whitted")
DISC = rm.Sun((0.5, 1.0, 0.7), shadow=True, softness=0.1)
BALL = rm.sphere(0.6).translate((0, 0.6, 0.5))

CASES: dict[str, Callable[[], rm.Scene]] = {
    "plain": scene,
    "nothing marched": lambda: scene(things(marched=False)),
    "a thousand times the size": lambda: scene(
        things(1000.0), camera=rm.Camera((1e3, 1.7e3, 4e3), (0, 300, 0), fov=45)
    ),
    "a thousandth of the size": lambda: scene(
        things(1e-3), camera=rm.Camera((1e-3, 1.7e-3, 4e-3), (0, 3e-4, 0), fov=45)
    ),
    "far away": lambda: scene(
        rm.union(*(part.translate((1e4, 0, 0)) for part in things().children)),
        camera=rm.Camera((1e4 + 1, 1.7, 4), (1e4, 0.3, 0), fov=45),
    ),
    "orthographic": lambda: scene(camera=rm.Camera((1, 1.7, 4), (0, 0.3, 0), projection="orthographic", height=3)),
    "near and far planes": lambda: scene(camera=rm.Camera((1, 1.7, 4), (0, 0.3, 0), fov=45, near=3.2, far=5)),
    "from below the floor": lambda: scene(camera=rm.Camera((1, -1.7, 4), (0, 0.3, 0), fov=45)),
    "in a box": lambda: scene(things() | rm.box(1.0).translate((1, 1.7, 4))),
    "in a blend": lambda: scene(things() | rm.torus(1, 0.4).rotate(1.3, "x").translate((1, 1.7, 4.9))),
    "on the floor": lambda: scene(camera=rm.Camera((1, 0, 4), (0, 0.3, 0), fov=45)),
    "steps in passes": lambda: scene(quality=rm.Quality(steps_per_pass=4)),
    "steps in passes, orthographic": lambda: scene(
        camera=rm.Camera((1, 1.7, 4), (0, 0.3, 0), projection="orthographic", height=3),
        quality=rm.Quality(steps_per_pass=4),
    ),
    "cones": lambda: scene(quality=rm.Quality(schedule="cones")),
    "cones, orthographic": lambda: scene(
        camera=rm.Camera((1, 1.7, 4), (0, 0.3, 0), projection="orthographic", height=3),
        quality=rm.Quality(schedule="cones"),
    ),
    "samples": lambda: scene(quality=rm.Quality(samples=4, schedule="cone")),
    "mirror ball": lambda: scene(things() | BALL.material(MIRROR), quality=WHITTED, bounces=3),
    "mirror floor": lambda: scene(rm.plane().material(MIRROR) | BALL | RING, quality=WHITTED, bounces=2),
    "glass ball": lambda: scene(things() | BALL.material(GLASS), quality=WHITTED, bounces=4),
    "glass ball in the floor": lambda: scene(
        things() | rm.sphere(0.6).translate((0, 0.2, 0.5)).material(GLASS), quality=WHITTED, bounces=4
    ),
    "glass ring": lambda: scene(
        rm.plane() | BALL.translate((0, 0, -1)) | RING.material(GLASS), quality=WHITTED, bounces=4
    ),
    "soft shadow": lambda: scene(lights=[DISC]),
    "sampled disc": lambda: scene(lights=[DISC.replace(penumbra="sampled")], quality=rm.Quality(samples=8)),
    "ambient occlusion": lambda: scene(occlusion=rm.AmbientOcclusion(), sky=rm.Sky((0.5, 0.6, 0.8), light=True)),
    "point light at a wall": lambda: scene(lights=[rm.PointLight((-0.3, 0.500001, 0.9), intensity=3, shadow=True)]),
    "faces that touch": lambda: scene(
        rm.plane()
        | rm.box(1.0).translate((0, 0.5, 0)).material(RED)
        | rm.box(1.0).translate((1, 0.5, 0)).material(BLUE)
        | rm.box((0.5, 0.5, 0.5)).round(0.1).translate((-1, 0.35, 0))
    ),
    "thin plates": lambda: scene(
        rm.plane() | RING | rm.union(*[rm.box((2, 1e-4, 2)).translate((0.3 * i, 0.2 * i, 0)) for i in range(4)])
    ),
    "a very large ball": lambda: scene(rm.sphere(1e4).translate((0, -1e4, 0)) | BALL | RING),
}


@pytest.mark.parametrize("name", CASES)
def test_solved_and_marched_solids_look_alike(renderer: Renderer, name: str) -> None:
    a, b = both(renderer, CASES[name]())
    assert_alike(a, b, 0.02 if name == "sampled disc" else 0.01)
