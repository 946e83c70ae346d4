"""Random scenes from the whole catalogue, held against the truth, the proof of their hits and each other.

python -m tests.lab.fuzz --minutes 10 [--seed 1] [--keep]   (or --scenes 5000)

A failure is shrunk by Hypothesis to the smallest scene that shows it, and printed as Python.
"""

from __future__ import annotations

import argparse
import sys
import time
import zlib
from collections import Counter

import hypothesis
import numpy as np
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import raymarch as rm
from raymarch.errors import RaymarchError
from tests.hard.proofs import contradicted
from tests.hard.python import as_python
from tests.hard.referee import Referee
from tests.hard.relations import RELATIONS, Seen
from tests.hard.world import World
from tests.lab.long_runs import keep
from tests.support import random_trees

SIZE = (64, 64)
random_trees.OWN["labelled"] = lambda node, random: node.material(rm.Material(tuple(random.uniform(size=3))))

small = random_trees.shapes
for _ in range(3):
    small = random_trees.shapes | random_trees.grown(small)

EACH = 2
"""Relations that each scene is held against, of those that its number chooses."""


def scene_of(node: rm.Node, seed: int) -> rm.Scene:
    """The whole solid, seen from a side that the seed chooses."""
    if not node.facts.bounded:
        node = node & rm.box(2.4)
    low, high = node.bounds
    centre, reach = 0.5 * (low + high), max(0.5 * float(np.linalg.norm(high - low)), 1e-3)
    random = np.random.default_rng(seed)
    towards = random.normal(size=3) * (1.0, 0.5, 1.0)
    eye = centre + random.uniform(1.6, 3.0) * reach * towards / np.linalg.norm(towards)
    lights = [rm.Sun((0.5, 1.0, 0.7), shadow=bool(seed % 2))]
    if seed % 3 == 1:
        node = rm.union(node, *(_solvable(random, centre, reach) for _ in range(1 + seed % 4)))
    closed, boxes = (None, True, False)[seed % 7 % 3], (None, True, False)[seed % 5 % 3]
    objects = ("auto", "data", "text")[seed % 11 % 3]
    quality = rm.Quality(max_steps=4096, analytic=closed, bounding_volumes=boxes, objects=objects)
    return rm.Scene(node, rm.Camera(tuple(eye), tuple(centre), fov=52.0), lights, quality=quality)


def _solvable(random: np.random.Generator, centre: np.ndarray, reach: float) -> rm.Node:
    """A solid that rays hit in closed form, near a solid."""
    a, b, c = reach * random.uniform(0.05, 0.6, 3)
    made = (
        rm.sphere(a),
        rm.box((a, b, c)),
        rm.cylinder(a, b),
        rm.capsule((0, -b, 0), (c, b, 0), a),
        rm.cone(a, b, float(random.choice([0.0, c]))),
        rm.ellipsoid((a, b, c)),
    )[random.integers(6)]
    if random.random() < 0.5:
        made = made.rotate(float(random.uniform(-3, 3)), tuple(random.normal(size=3)))
    if random.random() < 0.3:
        made = made.scale(float(random.uniform(0.3, 2.0)))
    return made.translate(tuple(centre + reach * random.uniform(-0.8, 0.8, 3)))


def faults(world: World, node: rm.Node, seed: int, only: tuple[str, ...] = (), each: int = EACH) -> list[str]:
    """What is wrong with a scene and some relations, in words."""
    scene = scene_of(node, seed)
    frame = world.draw(scene, SIZE, ("depth", "normal", "iterations"))
    referee = Referee(scene, SIZE)
    found = [
        f"against the truth: {what}"
        for what in (*referee.unexplained(frame.depth, frame.iterations), *referee.turned(frame))
    ]
    found += [f"against the proof: {what}" for what in contradicted(scene, frame)]
    if seed % 4 == 0 and not np.all(np.isfinite(frame.color)):
        found.append("colours are not finite")
    names = list(RELATIONS)
    start = zlib.crc32(str(seed).encode())
    chosen = only or tuple(names[(start + 7 * k) % len(names)] for k in range(each))
    for name in chosen:
        depth, iterations, wrong = RELATIONS[name](Seen(world, scene, SIZE, frame, seed))
        if depth is not None:
            wrong = [*wrong, *referee.unexplained(depth, iterations)]
        found += [f"{name}: {what}" for what in wrong]
    return found


DEEP = 40
"""Every batch of this many is one of trees up to eight deep; the others have up to three operators on each other."""

REFUSED = " of instances ("
"""In the message of a plan that refuses an operation on instances, which only some operations take."""

SHRINK = 60
"""Scenes that are tried to make a failure smaller."""


class Search:
    """Batches of scenes, until the time is up."""

    def __init__(self, world: World, each: int = EACH) -> None:
        self.world, self.each = world, each
        self.scenes = self.refused = 0
        self.failed: Counter[str] = Counter()

    def batch(self, seed: int, examples: int = 12) -> str | None:
        """Some scenes; the report of the smallest that fails, if one does."""
        smallest: list[str] = []
        shrinking_left = [True] * SHRINK

        @hypothesis.seed(seed)
        @settings(
            max_examples=examples,
            database=None,
            deadline=None,
            derandomize=False,
            suppress_health_check=list(HealthCheck),
            phases=(Phase.generate, Phase.shrink),
            report_multiple_bugs=False,
            print_blob=False,
            verbosity=hypothesis.Verbosity.quiet,
        )
        @given(small if seed % DEEP else random_trees.trees, st.integers(0, 10_000))
        def look(node: rm.Node, view: int) -> None:
            if smallest and not (shrinking_left and shrinking_left.pop()):
                return  # small enough
            self.scenes += 1
            try:
                wrong = faults(self.world, node, view, each=self.each)
            except RaymarchError as error:
                if REFUSED in str(error):
                    self.refused += 1
                    return
                wrong = [f"{type(error).__name__}: {error}"]
            if wrong:
                smallest[:] = [*wrong, f"view {view}", as_python(node)]
                raise AssertionError(wrong[0].partition(":")[0])

        try:
            look()
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt) or not smallest:
                raise
            self.failed[smallest[0].partition(":")[0]] += 1
            return "\n".join(smallest)
        return None


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--minutes", type=float, default=1.0)
    length.add_argument("--scenes", type=int, help="go on until so many were drawn, however long it takes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", action="store_true", help="put the figures into docs/figures/long_runs.json")
    given_ = parser.parse_args(arguments)
    end, seed = time.monotonic() + 60 * given_.minutes, given_.seed
    with World() as world:
        search = Search(world)
        while search.scenes < given_.scenes if given_.scenes else time.monotonic() < end:
            report = search.batch(seed)
            if report:
                print(f"--- seed {seed}\n{report}", flush=True)
            seed += 1
            if seed % 5 == 0:
                print(f"{search.scenes} scenes", flush=True)
        print(
            f"{search.scenes} scenes, {EACH} of {len(RELATIONS)} relations each; failures: {dict(search.failed)}; "
            f"{search.refused} refused, because only some operations take instances"
        )
    if given_.keep:
        keep(
            "fuzz",
            **{
                "random scenes": search.scenes,
                "size of each picture": f"{SIZE[0]}x{SIZE[1]}",
                "relations of each": f"{EACH} of {len(RELATIONS)}",
                "unexplained differences": search.failed.total(),
            },
        )
    return 1 if search.failed else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
