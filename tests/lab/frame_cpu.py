"""The CPU's part of a frame: time of the calling thread, expressions made and draw calls of frames of 2x2 pixels.

python -m tests.lab.frame_cpu                      # all examples
python -m tests.lab.frame_cpu hello village -n 50  # some of them
python -m tests.lab.frame_cpu --profile lamps      # where the time goes

The camera moves from frame to frame, so nothing that depends on it can be kept. On a GPU this time limits small
pictures, films and the window. The software renderer draws in threads of its own; their time is not counted, but what
the driver does in the calling thread is.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import raymarch as rm
from raymarch.expr import node
from raymarch.scene import load
from raymarch.scene.camera import Pose
from raymarch.scene.parameter import set_values

EXAMPLES = Path(__file__).parents[2] / "examples"
SIZE, PLANNED = (2, 2), (640, 360)


@dataclass(frozen=True)
class Part:
    """Of one frame: milliseconds of the calling thread (median and least), expressions made, draw calls."""

    median: float
    least: float
    made: int
    calls: int

    @property
    def limit(self) -> float:
        """What it may take, in milliseconds."""
        return 1.5 + 0.15 * self.calls


@contextmanager
def expressions_made() -> Iterator[list[int]]:
    """Counts the expressions that are made inside: the last element of the list is their number."""
    counted, kept = [0], node._Interned

    class Counted(kept):  # type: ignore[misc, valid-type]
        def __init__(self, *args: Any) -> None:
            super().__init__(*args)
            counted[0] += 1

    node._Interned = Counted  # type: ignore[misc]
    try:
        yield counted
    finally:
        node._Interned = kept  # type: ignore[misc]


def moved(pose: Pose, share: float) -> Pose:
    """The pose, moved to the right by a share of its distance from the origin."""
    way = share * max(float(np.linalg.norm(pose.position)), 1e-3)
    return replace(pose, position=pose.position + way * pose.frame[:, 0])


def part_of(scene: rm.Scene, frames: int = 30) -> Part:
    """The CPU's part of the frames of a scene, as soon as its programs are compiled."""
    with rm.Renderer(SIZE) as renderer:
        renderer.planned_for = PLANNED
        pose = scene.pose(set_values(renderer.prepared(scene).plan.parameters), PLANNED[0] / PLANNED[1])
        for i in range(3):
            renderer.render(scene, pose=moved(pose, 1e-3 * i))
        spent = []
        for i in range(frames):
            at = moved(pose, 1e-3 * (i + 3))
            start = time.thread_time()
            frame = renderer.render(scene, pose=at)
            spent.append(1e3 * (time.thread_time() - start))
        with expressions_made() as made:
            renderer.render(scene, pose=moved(pose, 0.05))
        return Part(float(np.median(spent)), min(spent), made[0], len(frame.timings))


def profile(scene: rm.Scene, frames: int = 50) -> None:
    """Prints the functions that take most of the time of a frame."""
    with rm.Renderer(SIZE) as renderer:
        renderer.planned_for = PLANNED
        pose = scene.pose(set_values(renderer.prepared(scene).plan.parameters), PLANNED[0] / PLANNED[1])
        for i in range(3):
            renderer.render(scene, pose=moved(pose, 1e-3 * i))
        measured = cProfile.Profile(time.thread_time)
        with measured:
            for i in range(frames):
                renderer.render(scene, pose=moved(pose, 1e-3 * (i + 3)))
        pstats.Stats(measured).sort_stats("cumulative").print_stats(60)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="names of examples; all by default")
    parser.add_argument("-n", type=int, default=30, help="frames of each")
    parser.add_argument("--profile", action="store_true")
    given = parser.parse_args()
    files = [f for f in sorted(EXAMPLES.rglob("*.py")) if not given.names or f.stem in given.names]
    print(f"{'example':16} {'median ms':>9} {'least':>7} {'limit':>7} {'calls':>6} {'expressions made':>17}")
    for file in files:
        scene = load(file)
        if given.profile:
            profile(scene)
            continue
        found = part_of(scene, given.n)
        name = file.relative_to(EXAMPLES).with_suffix("").as_posix()
        late = "" if found.median <= found.limit and not found.made else "  over"
        print(
            f"{name:24} {found.median:9.2f} {found.least:7.2f} {found.limit:7.2f} {found.calls:6} {found.made:9}{late}",
            flush=True,
        )


if __name__ == "__main__":
    main()
