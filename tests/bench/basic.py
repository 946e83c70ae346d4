"""raymarch beside a sphere tracer written by hand: one scene, one context, draws in turn, CPU time and depth error.

python -m tests.bench.basic [--size 640x360] [--draws 31]

basic.glsl is the hand-written shader. Both draw linear colours into a float32 texture, one ray a pixel.
"""

from __future__ import annotations

import os

os.environ.setdefault("LP_NUM_THREADS", "1")

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.cost.errors import measure
from raymarch.cost.reference import reference
from raymarch.gpu.context import Context
from raymarch.gpu.draw_calls import DrawCall
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target
from tests.support.timing import cpu_time

TEXT = (Path(__file__).parent / "basic.glsl").read_text(encoding="utf-8")
EPSILONS = {"epsilon 1e-4 t": "0.0001 * t", "epsilon 1e-3": "0.001"}
"""Where the hand-written tracer ends: in the ratio of the distance, or at one value for all rays."""


def scene() -> rm.Scene:
    cut = (rm.box((1.6, 1.6, 1.6)) - rm.sphere(1.0)).translate((-1.3, 0, 0))
    ring = rm.union(rm.torus(0.8, 0.3), rm.sphere(0.6), k=0.3).rotate(1.1, "x").translate((1.3, 0.2, 0))
    camera = rm.Camera(position=(1.5, 2.5, 6.5), target=(0, 0, 0), fov=50)
    return rm.Scene(cut | ring | rm.plane(offset=-0.9), camera, [rm.Sun(sun_direction=(0.5, 1, 0.7), shadow=True)])


def compile_basic(context: Context, epsilon: str = EPSILONS["epsilon 1e-4 t"]) -> Program:
    text = f"#version 330 core\n#define EPSILON {epsilon}\n{TEXT}"
    return Program(context, FULL_SCREEN, text, lambda line: (text.splitlines()[line - 1], None), "basic")


def draw_basic(context: Context, size: tuple[int, int]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Colours and depth of the hand-written shader; row 0 is the top, and inf is the depth of no hit."""
    with compile_basic(context) as program, Target(context, size) as target:
        program.draw(target, {"resolution": size})
        return separate(target)


def separate(target: Target) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    texels = target.read()
    return texels[..., :3], np.where(texels[..., 3] < 0.0, np.inf, texels[..., 3])


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--draws", type=int, default=31)
    given = parser.parse_args(arguments)
    width, height = map(int, given.size.split("x"))
    known = reference(scene(), (width, height), samples=0)
    with rm.Renderer((width, height)) as renderer:
        renderer.render(rm.Scene(rm.sphere()))  # modules are imported
        entries = [*basic(renderer), *ours(renderer)]
        first = [cpu_time(renderer.context, entry.first) for entry in entries]
        times: list[list[float]] = [[] for _ in entries]
        for _ in range(given.draws):
            for entry, found in zip(entries, times, strict=True):
                found.append(cpu_time(renderer.context, entry.draw))
        depths = [entry.depth() for entry in entries]
        print(f"{width}x{height}, {renderer.context.driver.renderer}, {known.hit.sum()} hits")
    titles = (
        "",
        "first frame ms",
        "draw ms",
        "times faster",
        "p50 px",
        "p99 px",
        "max px",
        "rms",
        "missed",
        "at edges",
    )
    print(f"| {' | '.join(titles)} |\n{'|---' * len(titles)}|")
    for entry, begin, found, depth in zip(entries, first, times, depths, strict=True):
        low, middle, high = np.quantile(found, [0.25, 0.5, 0.75])
        faster = np.median(np.divide(times[0], found))
        e = measure(known, depth)
        print(
            f"| {entry.name} | {begin:.0f} | {middle:.1f} ({low:.1f}..{high:.1f}) | {faster:.2f} | {e.pixels_p50:.1e} |"
            f" {e.pixels_p99:.1e} | {e.pixels_max:.1e} | {e.depth_rms:.1e} | {e.missed} | {e.missed_at_edges} |"
        )
    return 0


@dataclass(frozen=True)
class Entry:
    """One row: its first frame, a further draw of its picture, and its depth, inf where nothing was hit."""

    name: str
    first: Callable[[], object]
    draw: Callable[[], object]
    depth: Callable[[], NDArray[np.float32]]


def basic(renderer: rm.Renderer) -> Iterator[Entry]:
    context, size = renderer.context, renderer.size
    for name, epsilon in EPSILONS.items():
        made: list[tuple[Program, Target]] = []

        def draw(made: list[tuple[Program, Target]] = made, epsilon: str = epsilon) -> None:
            if not made:
                made.append((compile_basic(context, epsilon), Target(context, size)))
            made[0][0].draw(made[0][1], {"resolution": size})

        yield Entry(f"by hand, {name}", draw, draw, lambda made=made: separate(made[0][1])[1])


def ours(renderer: rm.Renderer) -> Iterator[Entry]:
    for name, analytic in {"raymarch": None, "raymarch, analytic=False": False}.items():
        made = scene().replace(quality=rm.Quality(analytic=analytic))
        calls: list[DrawCall] = []

        def draw(made: rm.Scene = made, calls: list[DrawCall] = calls) -> None:
            calls[:] = calls or renderer.draw_calls(made)
            for call in calls:
                call.draw()

        yield Entry(name, draw, draw, lambda made=made: renderer.render(made, outputs=("depth",)).depth)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
