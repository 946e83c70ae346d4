"""Many renders of changing scenes and sizes in one process: nothing may grow.

python -m tests.lab.soak --renders 2000 [--keep]
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
from dataclasses import dataclass
from pathlib import Path

import raymarch as rm
from raymarch.gpu import Renderer
from tests.hard.failing import scenes
from tests.hard.world import World
from tests.lab.long_runs import keep
from tests.support.gl_objects import alive

SIZES = ((32, 24), (17, 31), (64, 48), (1, 5), (40, 40))
SIZE = rm.Param("size", 1.0, 0.1, 2.0)
QUALITIES = (
    rm.Quality(),
    rm.Quality(schedule="cone"),
    rm.Quality(samples=2),
    rm.Quality(temporal="accumulate"),
    rm.Quality(temporal="reproject"),
)


@dataclass(frozen=True)
class State:
    """What a process holds: objects of OpenGL, as that says itself, open files, kilobytes of memory."""

    objects: int
    files: int
    memory: int


def state(renderer: Renderer) -> State:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return State(
        sum(alive(renderer.context).values()), len(os.listdir("/proc/self/fd")), pages * resource.getpagesize() // 1024
    )


def soak(world: World, renders: int) -> tuple[State, State]:
    """The state after a quarter of the renders, when all caches are full, and at the end; both of the same picture."""
    renderer, some = world.renderer, scenes()

    def draw(i: int) -> None:
        renderer.resize(SIZES[i % len(SIZES)])
        params = {}
        if i % 7 == 0:
            scene = some[i % len(some)]
        elif i % 11 == 0:  # new numbers are a new text
            scene = rm.Scene(rm.box(0.5 + i % 41 / 41) - rm.sphere(0.3))
        else:
            scene, params = rm.Scene(rm.box(SIZE) - rm.sphere(0.3)), {"size": 0.5 + i % 41 / 41}
        scene = scene.replace(quality=QUALITIES[i % len(QUALITIES)])
        frame = renderer.render(scene, params=params)
        if i % 3 == 0:
            assert frame.depth.shape == frame.color.shape[:2]

    first = renders // 4
    for i in range(first):
        draw(i)
    draw(0)
    before = state(renderer)
    for i in range(first, renders):
        draw(i)
    draw(0)
    return before, state(renderer)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--renders", type=int, default=2000)
    parser.add_argument("--keep", action="store_true", help="put the figures into docs/figures/long_runs.json")
    given = parser.parse_args(arguments)
    renders = given.renders
    with World() as world:
        before, after = soak(world, renders)
    print(f"after a quarter of {renders} renders: {before}\nat the end: {after}")
    if given.keep:
        keep(
            "soak",
            **{
                "renders": renders,
                "objects of OpenGL, after a quarter and at the end": f"{before.objects}, {after.objects}",
                "open files": f"{before.files}, {after.files}",
                "MB of memory": f"{before.memory // 1000}, {after.memory // 1000}",
            },
        )
    return 1 if after.objects > before.objects or after.files > before.files else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
