"""Cases of rays that pass the first surface, hit one that they only pass, or end before it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import var
from raymarch.expr.types import FLOAT
from raymarch.scene.parameter import Values
from raymarch.sdf.blends import root_min
from tests.hard.world import Figure, World, case


@case(81, "roofs thinner than a pixel", "a step of a pixel beyond what is certified ends on the inner side")
def thin_roofs(world: World) -> Iterator[Figure]:
    """With a coarse epsilon the last steps of a ray may pass a thin solid. The first step along the slope is therefore
    at most half a pixel longer than the distance."""
    plate = rm.box((1.2, 0.14, 2.2)).translate((0.6, -0.07, 0)).rotate(-0.8, "z").translate((0, 1.2, 0)).mirror("x")
    house = rm.union(plate, rm.box((1.4, 0.8, 1.9)).translate((0, 0.4, 0)), k=1e-3)
    village = rm.union(house.repeat((3.0, None, 3.6), (4, 1, 4)), rm.plane(), k=1e-3)
    scene = rm.Scene(village, rm.Camera((16 * np.sin(1.2), 9, 16 * np.cos(1.2)), (0, 0, 0), fov=40))
    exact, draft = (_marched(world, scene, epsilon=epsilon).normal for epsilon in (0.02, 0.5))
    beside = [np.roll(exact, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    flat = np.max([np.linalg.norm(other - exact, axis=-1) for other in beside], axis=0) < 0.01
    assert flat.sum() > 4000
    turned = int(np.sum(flat & (np.sum(exact * draft, axis=-1) < 0.0)))
    yield Figure("normals at epsilon 0.5 that face away, of 4,000", turned, 0, "half a pixel passes no such roof")


def _marched(world: World, scene: rm.Scene, size: tuple[int, int] = (96, 64), **quality: Any) -> rm.Frame:
    """A frame of a scene whose solids are all marched."""
    return world.draw(scene.replace(quality=rm.Quality(analytic=False, **quality)), size, ("depth", "normal"))


@case(82, "rays that rise out of steps", "hits of surfaces that the ray has passed")
def rising_rays(world: World) -> Iterator[Figure]:
    """A ray out of steps takes its nearest sample within a pixel. If it rises from that surface, it has passed it, and
    hits nothing."""
    ring = rm.torus(1.0, 0.3).rotate(0.3, "x").translate((0, 0.3, 0))
    scene = rm.Scene(rm.union(ring, rm.plane(), k=0.2), rm.Camera((0, 0.35, 5), (0, 0.35, 0), fov=40))
    known = np.isfinite(_marched(world, scene, (96, 54), max_steps=4096).depth)
    for tracer in ("bracketing", "relaxed"):
        depth = _marched(world, scene, (96, 54), max_steps=64, tracer=tracer).depth
        wrong = int(np.sum(np.isfinite(depth) & ~known))
        yield Figure(f"hits of {tracer} where nothing is", wrong, 0, "the ray rises from the surface")


@case(83, "walls that are faces of the scene's box", "holes, with solids in closed form or clip planes")
def walls_of_the_box(world: World) -> Iterator[Figure]:
    """Rays end at the bounding box of the scene. Around a camera inside of a solid the walls are its faces, and
    rounding puts some hits behind that end."""
    node = rm.box((30.1, 11.3, 20.7)) | rm.sphere(0.5).translate((-2, 0, 0))
    clipped = {"near": 0.1, "far": 300.0}
    for what, lens, quality in (
        ("closed forms", {}, {"analytic": True}),
        ("passes of 4 steps", {}, {"analytic": True, "steps_per_pass": 4}),
        ("clip planes", clipped, {}),
    ):
        camera = rm.Camera((3.3, 0.15, 0.1), (0, 0, 0), fov=60, **lens)
        frame = world.draw(rm.Scene(node, camera, quality=rm.Quality(**quality)), (96, 72), ("depth",))
        yield Figure(f"holes, {what}", int(np.sum(~np.isfinite(frame.depth))), 0, "a closed wall all around")


@case(84, "root blend beside a far operand", "the sum of both distances rounds the near one: stripes, or no surface")
def far_operand(_: World) -> Iterator[Figure]:
    """(a + b - sqrt((a - b)^2 + k'^2)) / 2 adds a small distance to a large one. The smaller one is factored out."""
    a, b, k = (var(name, FLOAT) for name in "abk")
    value = root_min(a, b, k)
    near = np.concatenate([10.0 ** np.linspace(-6, 0, 200), -(10.0 ** np.linspace(-6, 0, 200))])
    for far in (1e3, 1e6, 1e12, 1e20):
        single, double = (
            evaluator([value], [a, b, k], kind)(*(np.asarray(x, kind) for x in (near, np.full(400, far), 0.5)))[0]
            for kind in (np.float32, np.float64)
        )
        ulp = 2.0**-23 * np.maximum(np.abs(near), 0.25 * 0.5**2 / far)
        yield Figure(
            f"error in ulp beside {far:g}", float(np.max(np.abs(single - double) / ulp)), 4, "a sum and a quotient"
        )
    by_hand = 0.5 * (near + 0.7 - np.sqrt((near - 0.7) ** 2 + 0.25**2))
    found = evaluator([value], [a, b, k])(near, np.full(400, 0.7), 0.5)[0]
    yield Figure("difference from the formula in float64", float(np.max(np.abs(found - by_hand))), 1e-15, "rounding")


@case(85, "a solid that is moved beyond the horizon", "rays end before it: an empty sky")
def beyond_the_horizon(_: World) -> Iterator[Figure]:
    """Unbounded scenes end at 1,000 times the distance of what the camera looks at. Time or a `Param` without a range
    may move a bounded solid farther away, and rays reach it there."""
    x = rm.Param("x", 1.0)
    scene = rm.Scene(rm.sphere(3e5).translate((0, 1, 0)).translate((x, 0, 0)) | rm.sphere(), rm.Camera((0, 0, 5)))
    reached = []
    for away in (1.0, 1e6, -1e9):
        values = Values({"x": away})
        reached.append(scene.far(scene.pose(values), values) > abs(away) + 3e5)
    yield Figure("positions that rays do not reach, of 3", reached.count(False), 0, "its box at that frame")


@case(86, "a reflected ray that starts in a hidden solid", "a hit far behind the start")
def hidden_start(world: World) -> Iterator[Figure]:
    """A mirror in a solid that the camera does not see: reflected rays start inside of it, and hit at once."""
    around = (
        rm.box((8, 4, 8)).translate((0, -1.5, 0)).material(rm.Material(color=rm.checker((1, 0, 0), (0, 0, 1), 0.5)))
    )
    ball = rm.sphere(0.6).translate((0, 0.2, 0)).material(rm.Material(albedo=(1, 1, 1), metalness=1, roughness=0))
    node = ball | around.visible(camera=False, shadow=False)
    quality = rm.Quality(integrator="whitted")
    scene = rm.Scene(node, rm.Camera((1, 1.6, 5), (0, 0.2, 0), fov=20), bounces=1, quality=quality)
    size = (32, 24)
    off = np.abs(world.draw(scene, size, ("color",)).color - rm.truth(scene, size).color).max(axis=-1)
    yield Figure("share of the pixels that differ from float64", float(np.mean(off > 0.02)), 0.06, "borders of cells")
