"""Cases of rays that leave surfaces, and of marches in pieces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import raymarch as rm
from raymarch.expr.vocabulary import length, max, min
from raymarch.scene.quality import TRACERS
from raymarch.sdf.definition import cube
from tests.hard.world import Figure, World, case
from tests.lab.shadows import SIZE, Pair, pairs, wrong

WHITE = rm.Material((1.0, 1.0, 1.0), ambient=0.0, specular=0.0)


@case(
    63,
    "hard shadow of a far occluder",
    "a threshold that does not grow along the ray; a ray out of steps counts as lit",
)
def far_occluder(world: World) -> Iterator[Figure]:
    """In float32, distances to a far occluder are coarser than at the lit point: 19 % of the pixels were lit at 500
    units."""
    lit, dark, too_dark, too_light = 0, 0, 0, 0
    ball = Pair("floor", 20.0, 500.0, "ball", 100.0, "hard", 0.0, "sun", 2.0)
    grazing = Pair("floor", 88.5, 3e4, "ball", 30.0, "hard", 0.0, "sun", 0.7)
    far = [replace(ball, distance=float(d), size=d / 5) for d in (1, 20, 200, 500, 5e3, 5e4)]
    soft = [replace(ball, penumbra=kind, softness=1e-3) for kind in ("two-sided", "cone", "triangulated", "sampled")]
    if world.renderer.size != SIZE:
        world.renderer.resize(SIZE)
    for pair in (*far, *soft, grazing, *pairs(8, 5)):
        found = wrong(pair, world.renderer)
        lit, dark, too_dark, too_light = lit + found[0], dark + found[1], too_dark + found[2], too_light + found[3]
    assert dark > 60_000 and lit > 5_000
    yield Figure("pixels of a shadow that are lit, of 60,000", too_light, 0, "closed forms, off the border")
    yield Figure("lit pixels that are dark, of 5,000", too_dark, 0, "closed forms, off the border")


@rm.shape(exactness="estimate", bounds=lambda: cube(2.0))
def _steep(p):  # type: ignore[no-untyped-def]
    """A thin plate over a ball, three times too steep, as an estimate that is said to be none."""
    plate = max(abs(p.y - 1.0) - 0.02, length(p.xz) - 0.9)
    return 3.0 * min(plate, length(p) - 0.5)


@rm.shape(exactness="bound", bounds=lambda: cube(2.0))
def _plain(p):  # type: ignore[no-untyped-def]
    """The same plate and ball, by their distance."""
    plate = max(abs(p.y - 1.0) - 0.02, length(p.xz) - 0.9)
    return min(plate, length(p) - 0.5)


@rm.shape(exactness="bound", bounds=lambda: cube(2.0))
def _false(p):  # type: ignore[no-untyped-def]
    """Three times too steep, and said to be a bound."""
    plate = max(abs(p.y - 1.0) - 0.02, length(p.xz) - 0.9)
    return 3.0 * min(plate, length(p) - 0.5)


@case(65, "steps shortened for all rays", "only the tracer of the camera's rays knew the factor")
def shortened(world: World) -> Iterator[Figure]:
    """A field that exceeds its Lipschitz bound needs short steps also for shadow and reflection rays."""
    mirror = rm.Material((1.0, 1.0, 1.0), metalness=1.0, roughness=0.0)

    def scene(node: rm.Node, quality: rm.Quality, bounces: int) -> rm.Scene:
        floor = rm.plane(offset=-0.6)
        return rm.Scene(
            node.material(WHITE) | (floor.material(mirror) if bounces else floor.material(WHITE)),
            rm.Camera((2.5, 1.6, 3.0), (0, 0, 0), fov=45),
            lights=[rm.Sun((0.3, 1.0, 0.2), shadow=True)],
            sky=(0.2, 0.3, 0.5),
            bounces=bounces,
            quality=quality,
        )

    for name, steep in (("an estimate", _steep()), ("a bound that is none", _false())):
        for what, bounces in (("hard shadow", 0), ("mirror", 2)):
            way = "whitted" if bounces else "path"
            known = world.draw(
                scene(_plain(), rm.Quality(integrator=way), bounces), (96, 64), outputs=("color", "depth")
            )
            quality = rm.Quality(integrator=way, step_scale=1 / 3, max_steps=2048)
            found = world.draw(scene(steep, quality, bounces), (96, 64), outputs=("color", "depth"))
            off = np.abs(found.color - known.color).max(axis=-1) > 0.1
            # borders of shadows and silhouettes may shift by a pixel: what stands alone is an edge
            alone = off & np.roll(off, 1, 0) & np.roll(off, -1, 0) & np.roll(off, 1, 1) & np.roll(off, -1, 1)
            yield Figure(f"pixels of {name} that are wrong in a {what}", int(alone.sum()), 0, "the same solid")
    far = Pair("floor", 20.0, 5.2e4, "slab", 1e4, "hard", 0.0, "sun", 2.0).scene()
    lit = 0
    for short in ({"step_scale": 0.3}, {"step_scale": 0.001}, {"step_variation": 0.7}):
        shaded = far.replace(quality=far.quality.replace(max_steps=8192, **short))
        lit += int((world.draw(shaded, (24, 18), outputs=("color",)).color > 0.0).any(axis=-1).sum())
    yield Figure("pixels of a far occluder's shadow that are lit, of 1,296", lit, 0, "a step is an ulp or more")


@case(66, "bounces that run out of steps", "rays out of steps saw the sky")
def endless_wall(world: World) -> Iterator[Figure]:
    """An infinite black wall covers half of the sky. Rays close to it never hit it, and returned the sky."""
    wall = rm.plane((1, 0, 0), -1.0).material(rm.Material((0.0, 0.0, 0.0), ambient=0.0, specular=0.0))
    scene = rm.Scene(
        rm.plane().material(WHITE) | wall,
        rm.Camera((0.0, 3.0, 0.01), (0, 0, 0), fov=0.1),
        lights=[],
        sky=(1, 1, 1),
        bounces=1,
        quality=rm.Quality(samples=1024, analytic=False),
    )
    mean = float(world.draw(scene, (40, 40), outputs=("color",)).color.mean())
    yield Figure("excess over half of the sky's light", abs(mean - 0.5), 1e-3, "4 standard errors of 1,638,400 rays")


@case(73, "march in pieces", "the last slope was not carried, and 67 of 57,600 pixels differed")
def in_pieces(world: World) -> Iterator[Figure]:
    """A march over several passes evaluates the field at the same points as a march in one pass."""
    ring = rm.union(rm.torus(0.7, 0.2).rotate(1.2, "x"), rm.sphere(0.4), k=0.2)
    scene = rm.Scene(ring | rm.plane(offset=-0.8), rm.Camera((1.2, 0.8, 3.2), (0, -0.1, 0), fov=50))
    names = ("depth", "iterations", "evaluations", "residual", "fallbacks")
    differing = 0
    for tracer in (name for name in TRACERS if name not in ("auto", "advance")):
        quality = rm.Quality(tracer=tracer, schedule="single", max_steps=100)
        whole = world.draw(scene.replace(quality=quality), (96, 64), outputs=names)
        for steps_per_pass in (7, 32):
            parts = world.draw(
                scene.replace(quality=replace(quality, steps_per_pass=steps_per_pass)), (96, 64), outputs=names
            )
            off = [whole.array(name) != parts.array(name) for name in names]
            differing += int(np.sum(np.any(off, axis=0)))
    yield Figure("pixels that differ in any bit, of all tracers", differing, 0, "the stored state is complete")
