"""Rows 16, 19, 20, 21, 23 and 26a: penumbras, rooms, bloom, accumulated patterns, budgets, hidden isosurfaces."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

import numpy as np

import raymarch as rm
from tests.lab.penumbras import KINDS, SIZE, drawn
from tests.lab.trials import row
from tests.lab.trials.row import WHITE, Array, Figure, looking_down, pixels, quiet


def penumbras() -> Iterator[Figure]:
    """Two-sided penumbras of random blockers against 2,000 rays, with and without a doubt (`tests.lab.penumbras`)."""
    rng = np.random.default_rng(16)
    every, undoubted, worst = [], [], ("", 0.0)
    with quiet(), rm.Renderer(SIZE) as renderer:
        for index in range(3 * len(KINDS)):
            pair = drawn(rng, KINDS[index % len(KINDS)])
            wanted = pair.visible()
            frame = renderer.render(pair.scene("two-sided"))
            free = renderer.render(pair.scene("cone", shadow=False)).color[..., 0]
            error = np.abs(frame.color[..., 0] / free - wanted)[(wanted > 0) & (wanted < 1)]
            every.append(error)
            if not any("penumbra" in str(doubt) for doubt in frame.doubts()):
                undoubted.append(error)
                worst = max(worst, (pair.kind, float(error.max(initial=0))), key=lambda each: each[1])
    whole, rest = np.concatenate(every), np.concatenate([np.zeros(1), *undoubted])
    yield Figure("penumbra pixels off by more than .05, of all", ".104", float((whole > 0.05).mean()), 0.15)
    yield Figure("the same where nothing is doubted", ".104", float((rest > 0.05).mean()), 0.02)
    yield Figure(f"worst error without a doubt, {worst[0]}", ".49", worst[1], 0.15)


def rooms() -> Iterator[Figure]:
    """The Cornell box and three random scenes against Mitsuba: the mean in standard deviations, and relative."""
    try:
        import mitsuba as mi
    except ImportError:
        return
    from tests.lab.rooms import CASES, judged

    mi.set_variant("scalar_rgb")
    z, off = 0.0, 0.0
    for name, size in (("cornell", 16), ("cornell", 48), ("area3", 32), ("room1", 16), ("thin2", 32)):
        with quiet():
            verdict, apart, _ = judged(mi, CASES[name](), size, 1 << 18)
        z, off = max(z, abs(verdict.whole)), max(off, abs(apart))
    yield Figure(f"5 path-traced pictures: sigmas off Mitsuba ({off:.2%} at most)", "6.5 (-3.4 % at 16^2)", z, 3.3)


def blooms() -> Iterator[Figure]:
    """The sum of a picture with bloom over that without, at odd sizes and wide radii."""
    worst, which = 0.0, ""
    node = rm.sphere(0.2).material(rm.Material(emission=(20, 8, 3)))
    for size, radius in (
        ((320, 180), 0.2),
        ((320, 180), 0.4),
        ((97, 61), 1.0),
        ((200, 150), 1.0),
        ((33, 97), 0.05),
        ((64, 64), 0.7),
    ):
        for at in ((0.0, 0.0, 0.0), (1.6, 1.0, 0.0)):
            scene = rm.Scene(
                node.translate(at),
                rm.Camera((0, 0, 4), (0, 0, 0)),
                [],
                sky=(0.1, 0.2, 0.1),
                post=[rm.Bloom(0.5, radius)],
            )
            with_it = row.drawn(scene, size).color.astype(float).sum()
            without = row.drawn(scene.replace(post=[]), size).color.astype(float).sum()
            if abs(with_it / without - 1) > worst:
                worst, which = abs(with_it / without - 1), f"{size[0]}x{size[1]}, r = {radius}"
    yield Figure(f"light lost by bloom, worst {which}", ".129", float(worst), 1e-4)


def patterns() -> Iterator[Figure]:
    """A filtered grid over 64 frames that accumulate and in 64 samples, against its coverage in NumPy."""
    size, wide, cell, line = (40, 24), 2.0, 0.31, 0.06
    floor = rm.plane().material(rm.Material(rm.grid_lines((0, 0, 0), (1, 1, 1), cell, line), specular=0, ambient=0))
    scene = rm.Scene(floor, looking_down(wide), [rm.Sun((0, 1, 0))], sky=(0, 0, 0))
    x, z = pixels(wide, size)
    fine = (np.arange(64) + 0.5) / 64 - 0.5
    step = wide / size[1]

    def covered(at: Array) -> Array:
        u = at[..., None] + fine * step
        return np.abs(u - cell * np.round(u / cell)) < line / 2

    on_x, on_z = covered(x), covered(z)
    wanted = 1 - (1 - on_x.mean(axis=-1)) * (1 - on_z.mean(axis=-1))
    rms = {}
    with quiet(), rm.Renderer(size) as renderer:
        going = scene.replace(quality=rm.Quality(temporal="accumulate"))
        for _ in range(64):
            frame = renderer.render(going)
        rms["frames"] = float(np.sqrt(np.mean((frame.color[..., 0] - wanted) ** 2)))
        still = renderer.render(scene.replace(quality=rm.Quality(samples=64)))
        rms["samples"] = float(np.sqrt(np.mean((still.color[..., 0] - wanted) ** 2)))
    yield Figure("rms of 64 frames over that of 64 samples", "2 (.0141, .0071)", rms["frames"] / rms["samples"], 1.2)


def budgets() -> Iterator[Figure]:
    """Pictures of several passes against those of one: albedo and three lights."""
    node = rm.torus().twist(1).material(rm.Material(albedo=(0.3, 0.6, 0.9), roughness=0.4)) | rm.plane(offset=-1)
    lights = [rm.Sun((1, 2, 1), shadow=True), rm.PointLight((2, 2, 1)), rm.SphereLight((-2, 2, 1), 0.3, shadow=True)]
    scene = rm.Scene(node, rm.Camera((0, 2, 5), (0, 0, 0)), lights)
    whole = row.drawn(scene, (96, 54)).color
    worst = 0.0
    for steps in (8, 40):
        quality = dataclasses.replace(scene.quality, steps_per_pass=steps)
        split = row.drawn(scene.replace(quality=quality), (96, 54)).color
        worst = max(worst, float(np.abs(split - whole).max()))
    yield Figure("colours of pictures in several passes", "1e-6, said to be equal", worst, 1e-6)


def hidden() -> Iterator[Figure]:
    """Isosurfaces of which parts are hidden from shadows: the floor's shadow against brute force on the samples."""
    count, pixels_seen = 0, 0
    axis = np.linspace(-1, 1, 24)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    for seed in range(4):
        random = np.random.default_rng(seed)
        blobs = random.uniform(-0.5, 0.5, (3, 3))
        values = sum(np.exp(-6 * ((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2)) for a, b, c in blobs)
        solid = rm.isosurface(values, 0.5, size=2.0).translate((0, 1.2, 0))
        ball = rm.sphere(0.4).translate((0.6, 2.4, 0))
        floor = rm.plane().material(WHITE)
        node = {
            0: floor | solid | ball.visible(shadow=False),
            1: floor | solid.visible(shadow=False) | ball,
            2: floor | rm.union(solid, ball.visible(shadow=False), k=0.3),
            3: floor | (solid - ball.visible(shadow=False)),
        }[seed]
        with quiet():
            sun = rm.Sun((0.4, 1, 0.3), shadow=True)
            camera = looking_down(4.0, (-0.4, 0.15, -0.3))
            shown = row.drawn(rm.Scene(node, camera, [sun], sky=(0, 0, 0)), (60, 60)).color[..., 0] > 0.3
        right, sure = _shadow(values, seed, ball)
        count, pixels_seen = count + int((shown != right)[sure].sum()), pixels_seen + int(sure.sum())
    yield Figure(f"points of {pixels_seen} with a wrong shadow of a part that is hidden", "293 of a picture", count, 0)


def _shadow(values: Array, seed: int, ball: rm.Node) -> tuple[Array, Array]:
    """Which points of the floor are lit, by tiny steps through the samples, and where that is beyond doubt."""
    x, z = pixels(4.0, (60, 60), (-0.4, -0.3))
    start = np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3)
    way = np.array((0.4, 1.0, 0.3)) / math.sqrt(1.25)
    most, near_ball = np.full(len(start), -np.inf), np.full(len(start), np.inf)
    for t in np.arange(0.02, 4.5, 0.005):
        p = start + t * way
        most = np.maximum(most, _trilinear(values, p - (0, 1.2, 0)))
        near_ball = np.minimum(near_ball, np.linalg.norm(p - (0.6, 2.4, 0), axis=1) - 0.4)
    lit, doubt = most < 0.5, np.abs(most - 0.5) < 0.02
    if seed == 1:
        lit, doubt = near_ball > 0, np.abs(near_ball) < 0.01
    return lit.reshape(60, 60), ~doubt.reshape(60, 60)


def _trilinear(values: Array, p: Array) -> Array:
    """Values between the samples of a cube from -1 to 1; minus infinity outside of it."""
    n = values.shape[0]
    u = (p + 1) / 2 * (n - 1)
    inside = ((u >= 0) & (u <= n - 1)).all(axis=1)
    cell = np.clip(np.floor(u).astype(int), 0, n - 2)
    f = u - cell
    total = np.zeros(len(p))
    for i in (0, 1):
        for j in (0, 1):
            for k in (0, 1):
                weight = np.prod(np.where((i, j, k), f, 1 - f), axis=1)
                total += weight * values[cell[:, 0] + i, cell[:, 1] + j, cell[:, 2] + k]
    return np.where(inside, total, -np.inf)
