"""Solids that rays hit in closed form: the same surfaces as marched, in all kinds of rays and cameras."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu import Renderer
from raymarch.plan import plan

SIZE = (48, 36)
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
    return rm.Scene(things() if node is None else node, camera, parts.pop("lights", [SUN]), **parts)


def drawn(renderer: Renderer, made: rm.Scene, analytic: bool | None = True) -> Any:
    renderer.resize(SIZE)
    quality = made.quality.replace(analytic=analytic)
    return renderer.render(made.replace(quality=quality), outputs=("color", "depth", "evaluations"))


def wrong(frame: Any, truth: rm.Truth) -> tuple[int, int, int]:
    """Numbers of pixels with a hit that is missed or not there, with a wrong depth, and with a wrong colour."""
    hit = np.isfinite(truth.depth)
    with np.errstate(invalid="ignore"):
        apart = hit & (np.abs(frame.depth - truth.depth) > 2e-3 * truth.depth)
    colored = (np.abs(frame.color - truth.color) > 0.02).any(axis=-1)
    return int((np.isfinite(frame.depth) != hit).sum()), int(apart.sum()), int(colored.sum())


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
        things(marched=False).rotate(0.3, "y").rotate(-0.3, "y").translate((1e4, 0, 0)) | RING.translate((1e4, 0, 0)),
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
    "mirror ball": lambda: scene(things() | BALL.material(MIRROR), quality=WHITTED, bounces=1),
    "mirror floor": lambda: scene(rm.plane().material(MIRROR) | BALL | RING, quality=WHITTED, bounces=2),
    "glass ball": lambda: scene(things() | BALL.material(GLASS), quality=WHITTED, bounces=2),
    "glass ball in the floor": lambda: scene(
        things() | rm.sphere(0.6).translate((0, 0.2, 0.5)).material(GLASS), quality=WHITTED, bounces=2
    ),
    "glass ring": lambda: scene(
        rm.plane() | BALL.translate((0, 0, -1)) | RING.material(GLASS), quality=WHITTED, bounces=2
    ),
    "soft shadow": lambda: scene(lights=[DISC]),
    "sampled disc and samples": lambda: scene(
        lights=[DISC.replace(penumbra="sampled")],
        quality=rm.Quality(samples=4, schedule="cone"),
        camera=rm.Camera((0.5, 5, 1), (0, 0, 0), fov=45),
    ),
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


@cache
def truth_of(name: str) -> rm.Truth:
    return rm.truth(CASES[name](), size=SIZE)


EDGES = 10
"""Pixels of 1,728 that may have another colour: rays that just meet an edge or the border of a shadow."""

AS_MARCHED = ("near and far planes", "from below the floor", "in a box", "sampled disc and samples")
"""Cases that must look as marched: where rays start inside a solid, the reference shades some pixels differently; of a
sampled light it takes long."""


@pytest.mark.parametrize("name", AS_MARCHED)
def test_solved_solids_look_as_marched(renderer: Renderer, name: str) -> None:
    made = CASES[name]()
    solved, marched = drawn(renderer, made), drawn(renderer, made, analytic=False)
    assert np.array_equal(np.isfinite(solved.depth), np.isfinite(marched.depth))
    assert np.allclose(solved.depth, marched.depth, rtol=2e-3)
    assert (np.abs(solved.color - marched.color).max(axis=-1) > 0.02).sum() <= EDGES


@pytest.mark.parametrize("name", [name for name in CASES if name not in AS_MARCHED])
def test_solved_solids_are_true(renderer: Renderer, name: str) -> None:
    made = CASES[name]()
    frame = drawn(renderer, made)
    assert np.isfinite(frame.color).all()
    missed, apart, colored = wrong(frame, truth_of("plain" if name in ("cones", "steps in passes") else name))
    assert missed == 0 and apart <= 5
    assert colored <= EDGES


def test_a_moved_parameter_moves_a_solved_solid(renderer: Renderer) -> None:
    x = rm.Param("x", 0.0, -2.0, 2.0)
    moving, still = scene(things(x=x)), scene(things(x=0.4))
    drawn(renderer, moving)
    quality = rm.Quality(analytic=True)
    moved = renderer.render(moving.replace(quality=quality), params={"x": 0.4}, outputs=("color", "depth"))
    expected = drawn(renderer, still)
    assert np.allclose(moved.depth, expected.depth, rtol=1e-4) and plan(moving).analytic.used
    assert (np.abs(moved.color - expected.color).max(axis=-1) > 0.01).sum() <= 3


def test_solving_saves_evaluations_and_error(renderer: Renderer) -> None:
    """The march is 2e-3 of the depth off, or more, along the horizon."""
    made = scene()
    truth = truth_of("plain")
    solved, marched = drawn(renderer, made), drawn(renderer, made, analytic=False)
    assert solved.evaluations.mean() < 0.1 * marched.evaluations.mean()
    assert wrong(solved, truth)[1] <= wrong(marched, truth)[1]
    assert np.array_equal(drawn(renderer, made, None).depth, solved.depth)
