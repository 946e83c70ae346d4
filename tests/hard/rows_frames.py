"""Cases of frames: histories, tiles, coarse passes, empty scenes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import raymarch as rm
from raymarch.gpu import Frame
from raymarch.gpu.tiles import tiles_of
from raymarch.truth import silhouettes
from tests.hard.world import ULP, Figure, World, case

SIZE = (48, 36)
NODE = rm.box(1) - rm.sphere(0.65)
KEEP = rm.Quality(temporal="accumulate")
HERE, THERE = rm.Camera((2, 1.5, 3), (0, 0, 0)), rm.Camera((-2, 1.0, 2), (0, 0.1, 0))


def next_frame(world: World, scene: rm.Scene) -> Frame:
    """A frame that may take something from the one before."""
    return world.renderer.render(scene)


def fresh(world: World, scene: rm.Scene, size: tuple[int, int] = SIZE) -> Frame:
    return world.draw(scene, size, ("color",))


def poison(world: World, size: tuple[int, int] = SIZE, texel: tuple[int, int] | None = None) -> None:
    """Write NaN over the history, or over one texel of it."""
    pair = world.renderer.resources.pair("color history", size)
    for target in (pair.front, pair.back):
        for k in range(target.attachments):
            texels = target.read(k)
            if texel is None:
                texels[...] = np.nan
            else:
                texels[texel] = np.nan
            target.write(texels, k)


def unlike(a: Frame, b: Frame) -> int:
    """Pixels that differ in a bit, or are not finite."""
    return int(np.sum(np.any((a.color != b.color) | ~np.isfinite(a.color), axis=-1)))


@case(42, "history on the first frame")
def first_history(world: World) -> Iterator[Figure]:
    """A new texture contains arbitrary memory. The test fills it with NaN."""
    scene = rm.Scene(NODE, HERE, quality=KEEP)
    known = fresh(world, scene)
    poison(world)
    world.renderer.forget()
    yield Figure("pixels that a poisoned history changes", unlike(next_frame(world, scene), known), 0, "none is read")
    for size in ((33, 25), SIZE):
        world.renderer.resize(size)
        poison(world, size)
        found = next_frame(world, scene)
        expected = fresh(world, scene, size)
        yield Figure(f"pixels after a resize to {size[0]} x {size[1]}", unlike(found, expected), 0, "none is read")


@case(43, "camera cut")
def cut(world: World) -> Iterator[Figure]:
    """After a camera cut, pixels of the previous picture remain visible."""
    for name, other in (
        ("camera", rm.Scene(NODE, THERE, quality=KEEP)),
        ("scene", rm.Scene(rm.torus(), HERE, quality=KEEP)),
    ):
        known = fresh(world, other)
        fresh(world, rm.Scene(NODE, HERE, quality=KEEP))
        next_frame(world, rm.Scene(NODE, HERE, quality=KEEP))
        yield Figure(
            f"pixels unlike a fresh frame, another {name}",
            unlike(next_frame(world, other), known),
            0,
            "the history is of something else",
        )


@case(44, "one NaN in the history")
def one_nan(world: World) -> Iterator[Figure]:
    """A running mean that contains a NaN remains NaN."""
    scene = rm.Scene(NODE, HERE, quality=KEEP)
    fresh(world, scene)
    poison(world, texel=(18, 24))
    after = next_frame(world, scene)
    yield Figure(
        "values that are not finite in the next frame",
        int(np.sum(~np.isfinite(after.color))),
        0,
        "such a history is dropped",
    )


@case(45, "a still scene")
def still(world: World) -> Iterator[Figure]:
    """A running mean drifts if its weights are rounded. After n frames it must be the mean of n samples."""
    n = 32
    sampled = fresh(world, rm.Scene(NODE, HERE, quality=rm.Quality(samples=n)))
    scene = rm.Scene(NODE, HERE, quality=KEEP)
    found = fresh(world, scene)
    for _ in range(n - 1):
        found = next_frame(world, scene)
    apart = float(np.abs(found.color - sampled.color).max())
    yield Figure(f"difference of {n} frames from {n} samples", apart, n * ULP, "one rounding a sample")
    total = np.zeros(found.color.shape)
    for i in range(n):
        total += _sample(world, i)
    yield Figure(
        "difference from the float64 mean of the samples",
        float(np.abs(found.color - total / n).max()),
        n * ULP,
        "one rounding a sample",
    )


def _sample(world: World, i: int) -> np.ndarray:
    """Sample i alone, by a history that is told to be empty."""
    world.renderer.forget()
    scene = rm.Scene(NODE, HERE, quality=KEEP)
    *cones, call = world.renderer.draw_calls(scene)
    for each in cones:
        each.draw()
    from dataclasses import replace

    from raymarch.gpu.sequences import r2

    replace(call, uniforms={**call.uniforms, "u_keep": False, "u_jitter": r2(i), "u_sample": i}).draw()
    return call.target.read()[..., :3].astype(np.float64)


@case(47, "coarse passes")
def coarse(world: World) -> Iterator[Figure]:
    """Results of a coarse grid bleed over edges when they are enlarged. Cones are the only coarse pass: they determine
    where a ray starts, never what it hits."""
    node = NODE | rm.box((0.01, 3, 0.01)).translate((0.8, 0, 0.5)) | rm.plane(offset=-0.5)
    frames = [
        world.draw(rm.Scene(node, HERE, quality=rm.Quality(schedule=schedule)), SIZE, ("depth",))
        for schedule in ("single", "cone", "cones", "six")
    ]
    full, calm = frames[0], ~silhouettes(rm.truth(rm.Scene(node, HERE), SIZE))
    masks = jumps = 0
    for f in frames[1:]:
        masks += int(np.sum(np.isfinite(f.depth) != np.isfinite(full.depth)))
        both = np.isfinite(f.depth) & np.isfinite(full.depth) & calm
        jumps += int(np.sum(np.abs(f.depth - full.depth)[both] > 0.02 * full.depth[both]))
    yield Figure("pixels of the mask unlike full resolution, of 3 schedules", masks, 0, "each ray finds its own hit")
    yield Figure("pixels that show another surface, silhouettes apart", jumps, 0, "a pixel's width of depth")


@case(48, "tiles")
def tiles(world: World) -> Iterator[Figure]:
    """A picture drawn in tiles must equal the whole picture to the last bit."""
    size = (80, 60)
    for quality in (rm.Quality(), rm.Quality(schedule="cone"), rm.Quality(rays="interpolated")):
        scene = rm.Scene(NODE | rm.plane(offset=-0.5), HERE, [rm.Sun(shadow=True)], quality=quality)
        known = world.draw(scene, size, ("color",))
        wrong = 0
        for edge in (32, 64):
            for call in world.renderer.draw_calls(scene):
                for tile in tiles_of(call.target.size, edge):
                    call.draw(tile)
                shown = call.target.read()[..., :3]
            wrong += int(np.sum(shown != known.color))
        what = quality.schedule if quality.schedule != "auto" else quality.rays
        yield Figure(f"values that tiles of 32 and 64 change, {what}", wrong, 0, "pixels do not depend on tiles")


@case(50, "empty scene")
def empty(world: World) -> Iterator[Figure]:
    """Without solids and lights, the picture is the background."""
    nothing = rm.sphere().translate((-3, 0, 0)) & rm.sphere().translate((3, 0, 0))
    for name, scene in (
        ("solid", rm.Scene(nothing, HERE, sky=(0.25, 0.5, 1.0))),
        ("solid and no light", rm.Scene(nothing, HERE, [], sky=(0.25, 0.5, 1.0))),
        ("solid without a camera", rm.Scene(nothing, sky=(0.25, 0.5, 1.0))),
    ):
        frame = world.draw(scene, SIZE, ("color", "depth"))
        wrong = int(np.sum(frame.color != np.float32((0.25, 0.5, 1.0))) + np.sum(np.isfinite(frame.depth)))
        yield Figure(f"values unlike the sky, no {name}", wrong, 0, "nothing is hit")
    dark = world.draw(rm.Scene(NODE, HERE, []), SIZE, ("color", "depth"))
    yield Figure(
        "light on a solid without lights",
        float(dark.color[np.isfinite(dark.depth)].max()),
        0,
        "without lights all is black",
    )
