"""Scenes with closed-form hits on and off: evaluations, CPU time of frames drawn in turn, depth error.

python -m tests.lab.closed_forms [NAME...] [--size 640x360] [--frames 9]

Frames are drawn in the calling thread (LP_NUM_THREADS=0), so the CPU time of the process is that of the frames.
"""

from __future__ import annotations

import os

os.environ["LP_NUM_THREADS"] = "0"

import argparse
import math
import runpy
import statistics
import sys
import time

import numpy as np

import raymarch as rm
from tests.support.timing import frame_times

SUN = rm.Sun(sun_direction=(1, 2, 1.5), shadow=True)


def interior(mirror: bool = False) -> rm.Scene:
    """An interior: walls, furniture of simple shapes, and one smooth blend. No ray escapes."""
    wall = rm.Material(color=(0.8, 0.78, 0.72))
    wood = rm.Material(color=(0.45, 0.28, 0.15))
    walls = [
        rm.plane((0, 1, 0), 0.0).material(rm.Material(color=(0.35, 0.3, 0.28))),
        rm.plane((0, -1, 0), -3.0).material(wall),
        *(rm.plane(n, -4.0).material(wall) for n in ((1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 0, -1))),
    ]
    top = rm.box((2.0, 0.1, 1.2)).translate((0, 0.9, 0)).material(wood)
    legs = [rm.cylinder(0.05, 0.85).translate((x, 0.425, z)).material(wood) for x in (-0.9, 0.9) for z in (-0.5, 0.5)]
    glossy = (
        rm.Material(albedo=(0.9, 0.9, 0.9), metalness=1, roughness=0) if mirror else rm.Material(color=(0.8, 0.2, 0.2))
    )
    things = [
        rm.sphere(0.25).translate((0.5, 1.2, 0.1)).material(glossy),
        rm.cone(0.2, 0.5).translate((-0.6, 1.2, 0.3)).material(rm.Material(color=(0.2, 0.5, 0.3))),
        rm.capsule((-2.5, 0.3, -2), (-1.5, 0.3, -2.5), 0.3).material(rm.Material(color=(0.3, 0.4, 0.7))),
        rm.ellipsoid((0.8, 1.2, 0.8)).translate((2.2, 0.6, -1.8)).material(rm.Material(color=(0.8, 0.7, 0.3))),
    ]
    blob = rm.union(
        rm.sphere(0.3), rm.box((0.5, 0.2, 0.5)).translate((0.25, 0.2, 0)), rm.torus(0.3, 0.1), k=0.15
    ).translate((-0.1, 1.25, -0.2))
    camera = rm.Camera(position=(2.8, 1.9, 3.4), target=(-0.3, 0.8, -0.5), fov=60)
    lamp = rm.PointLight(position=(0.5, 2.7, 1.0), intensity=6, shadow=True)
    quality = rm.Quality(integrator="whitted") if mirror else rm.Quality()
    solid = rm.union(*walls, top, *legs, *things, blob.material(rm.Material(color=(0.7, 0.7, 0.75))))
    return rm.Scene(solid, camera, [lamp], quality=quality, bounces=2 if mirror else 0)


def balls(count: int) -> rm.Scene:
    """Solved balls beside one marched torus."""
    random = np.random.default_rng(0)
    places = random.uniform(-3, 3, (count, 3)) * (1, 0.3, 1)
    solid = [rm.sphere(r).translate(tuple(p)) for r, p in zip(random.uniform(0.2, 0.5, count), places, strict=True)]
    camera = rm.Camera(position=(4, 3, 6), target=(0, 0, 0))
    made = rm.union(*solid, rm.torus(1.5, 0.4).rotate(0.6, "x"), rm.plane(offset=-1.5))
    return rm.Scene(made, camera, [SUN], quality=rm.Quality(objects="text"))


def beside(cost: int) -> rm.Scene:
    """One floor beside a repeated solid without a box, with `cost` twisted parts."""
    part = rm.union(*[rm.torus(0.3, 0.1).translate((0, 0.4 * i, 0)).rotate(0.3 * i, "x") for i in range(cost)], k=0.1)
    camera = rm.Camera(position=(1, 1.5, 3), target=(0, 0, -4))
    return rm.Scene(part.repeat((2.5, None, 2.5)) | rm.plane(offset=-0.6), camera, [SUN])


SCENES = {
    **{name: lambda name=name: runpy.run_path(f"examples/{name}.py")["scene"] for name in ("hello", "csg", "columns")},
    **{name: lambda name=name: runpy.run_path(f"examples/{name}.py")["scene"] for name in ("primitives", "village")},
    "interior": interior,
    "mirrors": lambda: interior(True),
    **{f"balls {n}": lambda n=n: balls(n) for n in (1, 4, 16, 40)},
    **{f"beside {n}": lambda n=n: beside(n) for n in (1, 2, 4)},
}


def compare(scene: rm.Scene, size: tuple[int, int], frames: int) -> dict[str, list[float]]:
    """Of each choice: seconds to the first frame, milliseconds and spread of a frame, evaluations, depth error."""
    choices = {"off": False, "on": True, "auto": None}
    found: dict[str, list[float]] = {}
    small = (max(1, size[0] // 4), max(1, size[1] // 4))
    truth = rm.truth(scene, size=small)
    with rm.Renderer(size) as renderer:
        scenes = {n: scene.replace(quality=scene.quality.replace(analytic=c)) for n, c in choices.items()}
        for name, made in scenes.items():
            begin = time.process_time()
            _ = renderer.render(made).color
            first = time.process_time() - begin
            evaluations = renderer.render(made, outputs=("evaluations",)).evaluations.mean()
            with rm.Renderer(small) as other:
                depth = other.render(made, outputs=("depth",)).depth
            hit = np.isfinite(depth) & np.isfinite(truth.depth)
            error = np.abs(depth[hit] - truth.depth[hit]) / truth.depth[hit]
            missed = int((np.isfinite(truth.depth) & ~np.isfinite(depth)).sum())
            found[name] = [first, 0.0, 0.0, evaluations, float(np.quantile(error, 0.99)), float(error.max()), missed]
        times = frame_times(renderer, scenes, frames)
    for name, row in found.items():
        row[1], row[2] = statistics.median(times[name]), min(times[name])
    return found


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=[*SCENES])
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--frames", type=int, default=9)
    given = parser.parse_args(arguments)
    size = tuple(map(int, given.size.split("x")))
    print("| scene | | first s | frame ms | least ms | evaluations | p99 error | largest | missed | times faster |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name in given.names:
        rows = compare(SCENES[name](), (size[0], size[1]), given.frames)
        for choice, row in rows.items():
            gain = rows["off"][1] / row[1] if row[1] else math.nan
            print(
                f"| {name} | {choice} | {row[0]:.2f} | {row[1]:.1f} | {row[2]:.1f} | {row[3]:.2f} | {row[4]:.1e} | "
                f"{row[5]:.1e} | {row[6]:.0f} | {gain:.2f} |",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
