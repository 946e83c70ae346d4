"""Implicit surfaces, held against tiny steps in float64, and their cost beside sphere tracing.

python -m tests.lab.implicit [--proofs] [--times] [NAME ...]     # twelve surfaces; see tests.support.surfaces
python -m tests.lab.implicit --forms                             # readings along a stretch: evaluations and operations
python -m tests.lab.implicit --terrain                           # seven octaves of value noise, by four tracers

For each surface at 160x90: hits of the reference, missed and invented pixels, p50 and p99 of the distance of hits in
pixel footprints, evaluations a ray in the box, of the default and of sphere tracing with the least safe constant. This
is found by a search: the least constant with which at most one hit in a thousand is missed or late. CPU times are those
of frames of 320x180 over those of sphere tracing; then the same, less that of a frame without a solid.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.function import trace
from raymarch.expr.node import var
from raymarch.expr.operations import operations
from raymarch.expr.stretch import free_along
from raymarch.expr.types import FLOAT, VEC3
from raymarch.gpu import Renderer
from raymarch.sdf.implicit import implicit_solid
from tests.support.surfaces import SURFACES, Surface

SIZE, TIMED = (160, 90), (640, 360)
STEPS = 3000
FOV = 45.0
TURNS = 9
Array = NDArray[Any]


def scene_of(surface: Surface, node: rm.Node, **quality: Any) -> rm.Scene:
    eye = tuple(np.array([1.5, 1.1, 2.2]) * surface.bounds)
    return rm.Scene(node, camera=rm.Camera(eye, (0, 0, 0), fov=FOV), quality=rm.Quality(**quality))


@dataclass(frozen=True)
class Rays:
    """The rays of a picture that meet the box, with their first change of sign, by tiny steps; inf for none."""

    origin: Array
    directions: Array
    inside: Array
    first: Array
    pixel: float
    size: tuple[int, int]

    def picture(self, values: Array, empty: float) -> Array:
        whole = np.full(len(self.inside), empty)
        whole[self.inside] = values
        return whole.reshape(self.size[1], self.size[0])


def directions_of(eye: Array, target: Array, size: tuple[int, int], fov: float) -> tuple[Array, float]:
    """Unit directions of the pixels (N, 3), by a camera written anew, and the width of a pixel at distance 1."""
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    half = np.tan(np.radians(fov) / 2.0)
    x = (2.0 * np.arange(size[0]) + 1.0 - size[0]) / size[1] * half
    y = (size[1] - 1.0 - 2.0 * np.arange(size[1])) / size[1] * half
    d = ahead + x[None, :, None] * right + y[:, None, None] * np.cross(right, ahead)
    return (d / np.linalg.norm(d, axis=-1, keepdims=True)).reshape(-1, 3), 2.0 * half / size[1]


def rays_of(surface: Surface, size: tuple[int, int] = SIZE, steps: int = STEPS) -> Rays:
    """A hit is the box where the solid is cut, or a change of sign, bisected."""
    b, eye = surface.bounds, np.array([1.5, 1.1, 2.2]) * surface.bounds
    d, pixel = directions_of(eye, np.zeros(3), size, FOV)
    ends = (-b - eye) / d, (b - eye) / d
    near, far = np.minimum(*ends).max(axis=1), np.maximum(*ends).min(axis=1)
    inside = far > near
    d, near, far = d[inside], near[inside], far[inside]

    def value(t: Array, rows: Any = slice(None)) -> Array:
        return surface.function((eye + t[:, None] * d[rows]).T)

    first = np.where(value(near) < 0.0, near, np.inf)
    step = (far - near) / steps
    for k in range(1, steps + 1):
        rows = np.flatnonzero(np.isinf(first))
        places = near[rows] + k * step[rows]
        crossed = value(places, rows) < 0.0
        first[rows[crossed]] = places[crossed]
    rows = np.flatnonzero(np.isfinite(first) & (first > near))
    low, high = first[rows] - step[rows], first[rows]
    for _ in range(50):
        middle = 0.5 * (low + high)
        below = value(middle, rows) < 0.0
        low, high = np.where(below, low, middle), np.where(below, middle, high)
    first[rows] = high
    return Rays(eye, d, inside, first, pixel, size)


@dataclass(frozen=True)
class Row:
    """What a picture is worth."""

    hits: int
    missed: int
    invented: int
    p50: float
    p99: float
    evaluations: float
    most: int


def confirm(surface: Surface, depth: Array, rays: Rays) -> None:
    """Hits where tiny steps found none, but which a finer search confirms, become hits of the reference."""
    found = depth.ravel()[rays.inside]
    for row in np.flatnonzero(np.isfinite(found) & np.isinf(rays.first)):
        near = found[row] + rays.pixel * found[row] * np.linspace(-1.0, 1.0, 100_001)
        below = surface.function((rays.origin + near[:, None] * rays.directions[row]).T) < 0.0
        if below.any():
            rays.first[row] = near[np.argmax(below)]


def compared(surface: Surface, frame: Any, rays: Rays) -> Row:
    depth, evaluations = frame.array("depth"), frame.array("evaluations")
    confirm(surface, depth, rays)
    wanted = rays.picture(rays.first, np.inf)
    found, true = np.isfinite(depth) & (depth > 0.0), np.isfinite(wanted)
    both = found & true
    off = np.abs(depth[both] - wanted[both]) / (rays.pixel * wanted[both])
    inside = rays.inside.reshape(found.shape)
    p50, p99 = np.quantile(off, [0.5, 0.99]) if both.any() else (np.nan, np.nan)
    return Row(
        int(true.sum()),
        int((true & ~found).sum()),
        int((found & ~true).sum()),
        float(p50),
        float(p99),
        float(evaluations[inside].mean()),
        int(evaluations.max()),
    )


# Sphere tracing with a constant, and the cost of both


def with_constant(surface: Surface, constant: float) -> rm.Scene:
    """The same solid divided by a constant, by the plain tracer."""
    params = dict(surface.node().params) | {"unit": constant, "steepest": constant}
    return scene_of(surface, implicit_solid(**params), tracer="plain", max_steps=4000)


def least_safe(surface: Surface, rays: Rays, renderer: Renderer) -> float:
    """The least constant with which at most one hit in a thousand is missed or late, of 120 from 1e-3 to 1e6."""
    constants, low, high = np.geomspace(1e-3, 1e6, 120), 0, 119
    wanted = rays.picture(rays.first, np.inf)
    true = np.isfinite(wanted)
    while low < high:
        middle = (low + high) // 2
        depth = renderer.render(with_constant(surface, float(constants[middle]))).array("depth")
        found = np.isfinite(depth)
        late = true & found & (depth > wanted * (1.0 + rays.pixel))
        if (late | (true & ~found)).sum() <= 1e-3 * true.sum():
            high = middle
        else:
            low = middle + 1
    return float(constants[low])


def cpu_times(scenes: list[rm.Scene]) -> list[float]:
    """Median CPU times of frames of 640x360 pixels, drawn in turn, and of a frame without a solid, ms."""
    nothing = rm.Scene(rm.sphere(0.5), camera=rm.Camera((0, 0, 5), (0, 0, 10)))
    drawn = [(scene, Renderer(TIMED)) for scene in (*scenes, nothing)]
    times: list[list[float]] = []
    for _ in range(TURNS + 1):
        times.append([])
        for scene, renderer in drawn:
            start = time.process_time()
            _ = renderer.render(scene).color
            times[-1].append(1e3 * (time.process_time() - start))
    for _, renderer in drawn:
        renderer.close()
    return [float(t) for t in np.median(times[1:], axis=0)]


def surfaces(names: list[str], proofs: bool, times: bool) -> None:
    print("| surface | hits, missed, invented | p50, p99 px | evaluations, most | proved | sphere tracing | CPU |")
    for name in names or SURFACES:
        surface, rays = SURFACES[name], rays_of(SURFACES[name])
        scene = scene_of(surface, surface.node())
        with Renderer(SIZE) as renderer, Renderer(SIZE) as other:
            row = compared(surface, renderer.render(scene), rays)
            share = f"{np.mean(rm.prove(scene, size=(96, 54)).state == 0):.4f}" if proofs else ""
            beside = cpu = ""
            if times:
                constant = least_safe(surface, rays, other)
                plain = with_constant(surface, constant)
                sphere = compared(surface, other.render(plain), rays)
                ours, theirs, empty = cpu_times([scene, plain])
                beside = f"{constant:.3g}: {sphere.evaluations:.1f}, missed {sphere.missed}, invented {sphere.invented}"
                cpu = f"{ours / theirs:.2f}, {(ours - empty) / (theirs - empty):.2f}"
        evaluations = f"{row.evaluations:.2f}, {row.most}"
        print(
            f"| {name} | {row.hits}, {row.missed}, {row.invented} | {row.p50:.2g}, {row.p99:.2g} | {evaluations} "
            f"| {share} | {beside} | {cpu} |",
            flush=True,
        )


# Readings along a stretch

FORMS = {"slope": {"exact": False, "smooth": False}, "curvature": {"exact": False}, "polynomial": {}}


def walked(evaluate: Any, rays: Rays, near: Array, far: Array, epsilon: float) -> tuple[float, int]:
    """Evaluations a ray of a walk by the free stretches, in float64, and rays without an end after 500."""
    t, w, n = near.copy(), 0.25 * (far - near), len(near)
    counts, active = np.zeros(n), np.arange(n)
    sign = np.zeros(n)
    for _ in range(500):
        d = rays.directions[active]
        rest = far[active] - t[active]
        stretch = np.minimum(w[active], rest)
        (found,) = evaluate(rays.origin + t[active, None] * d, d, np.zeros(len(active)), stretch, rest)
        value, free = found[:, 0], found[:, 1]
        counts[active] += 1
        sign[active] = np.where(sign[active] == 0.0, np.where(value < 0.0, -1.0, 1.0), sign[active])
        hit = (value * sign[active] <= 0.0) | ((free < epsilon) & (free < stretch))
        t[active] += free
        w[active] = np.where(free >= stretch, 2.0 * stretch, np.maximum(1.5 * free, 2.0 * epsilon))
        active = active[~hit & (t[active] < far[active] * (1.0 - 1e-12))]
        if not active.size:
            break
    return float(counts.mean()), len(active)


def forms() -> None:
    print("| surface | " + " | ".join(f"{name}: evaluations, operations, product" for name in FORMS) + " |")
    p, d, level, w, end = var("p", VEC3), var("d", VEC3), var("level", FLOAT), var("w", FLOAT), var("end", FLOAT)
    for name, surface in SURFACES.items():
        rays, b = rays_of(surface, steps=2), surface.bounds
        ends = (-b - rays.origin) / rays.directions, (b - rays.origin) / rays.directions
        near, far = np.minimum(*ends).max(axis=1), np.maximum(*ends).min(axis=1)
        definition = trace(name, surface.expression, [("p", VEC3)], surface.of.__code__)
        cells = []
        for form in FORMS.values():
            free = free_along(definition, p, d, level, w, end, **form)
            epsilon = 0.02 * rays.pixel * float(np.linalg.norm(rays.origin))
            count, left = walked(evaluator([free], [p, d, level, w, end]), rays, near, far, epsilon)
            work = operations([free])
            cells.append(f"{count:.2f}, {work}, {count * work:.0f}" + f", {left} without end" * (left > 0))
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


# A terrain of seven octaves of value noise

OCTAVES = 7
EYE, TARGET, TERRAIN_FOV = np.array([0.0, 2.5, 6.0]), np.array([0.0, 2.2, 5.0]), 49.4
LOWER, UPPER = (-36.0, -2.0, -54.0), (36.0, 2.0, 6.0)
SAFE = 2.5
"""The least constant with which sphere tracing loses nothing; with 2 it misses or is late at one hit in a thousand."""


def land(p: Any) -> Any:
    return p.y - (2.0 - 0.5 ** (OCTAVES - 1)) * rm.fbm(0.5 * p.xz, OCTAVES, noise="value")


def land_depths(d: Array, pixel: float) -> Array:
    """The first hits in float64, by steps that no slope allows to pass it: each octave has a slope of at most pi / 2
    along a unit direction. A step is at least a hundredth of a pixel."""
    function = trace("land", land, [("p", VEC3)], land.__code__)
    value = evaluator([function.body], function.params)
    with np.errstate(divide="ignore"):
        ends = (np.array(LOWER) - EYE) / d, (np.array(UPPER) - EYE) / d
    near, far = np.maximum(np.minimum(*ends).max(axis=1), 0.0), np.maximum(*ends).min(axis=1)
    depth, t = np.full(len(d), np.inf), near.copy()
    active = np.flatnonzero(near < far)
    while active.size:
        (heights,) = value(EYE + t[active, None] * d[active])
        hit = heights <= 0.0
        depth[active[hit]] = t[active[hit]]
        t[active] += np.maximum(heights / (1.0 + 0.5 * np.pi * OCTAVES), 0.01 * pixel * t[active])
        active = active[~hit & (t[active] < far[active])]
    return depth


def terrain() -> None:
    d, pixel = directions_of(EYE, TARGET, SIZE, TERRAIN_FOV)
    true = land_depths(d, pixel).reshape(SIZE[::-1])
    camera = rm.Camera(tuple(EYE), tuple(TARGET), fov=TERRAIN_FOV)
    node = rm.implicit(land, (LOWER, UPPER))
    safe = implicit_solid(**dict(node.params) | {"unit": SAFE, "steepest": SAFE})
    scenes = {"default": rm.Scene(node, camera)}
    for name, solid, tracer in (
        ("derived constant, sphere tracing", node, "plain"),
        ("derived constant, bracketing", node, "bracketing"),
        (f"constant {SAFE}, sphere tracing", safe, "plain"),
    ):
        scenes[name] = rm.Scene(solid, camera, quality=rm.Quality(tracer=tracer, max_steps=4000, schedule="single"))
    renderers = {name: Renderer(SIZE) for name in scenes}
    times: dict[str, list[float]] = {name: [] for name in scenes}
    for turn in range(TURNS + 1):
        for name, scene in scenes.items():
            start = time.process_time()
            renderers[name].render(scene).image()
            times[name] += [time.process_time() - start] * (turn > 0)
    print("| | evaluations, most | out of steps | missed, invented, late | p50, p99 px | CPU over the least safe |")
    last = np.array(times[f"constant {SAFE}, sphere tracing"])
    for name, scene in scenes.items():
        frame = renderers[name].render(scene, outputs=("depth", "evaluations"))
        found, real, most = np.isfinite(frame.depth), np.isfinite(true), scene.quality.camera_steps
        both = found & real
        off = (frame.depth[both] - true[both]) / (pixel * true[both])
        p50, p99 = np.quantile(np.abs(off), (0.5, 0.99))
        counts = f"{(real & ~found).sum()}, {(found & ~real).sum()}, {(off > 1.0).sum()}"
        ended = f"{frame.evaluations.mean():.1f}, {frame.evaluations.max():.0f} | {(frame.evaluations >= most).sum()}"
        print(f"| {name} | {ended} | {counts} | {p50:.1e}, {p99:.1e} | {np.median(times[name] / last):.2f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    for flag in ("--proofs", "--times", "--forms", "--terrain"):
        parser.add_argument(flag, action="store_true")
    given = parser.parse_args()
    if given.forms:
        forms()
    elif given.terrain:
        terrain()
    else:
        surfaces(given.names, given.proofs, given.times)


if __name__ == "__main__":
    main()
