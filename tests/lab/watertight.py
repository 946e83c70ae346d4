"""Rays at closed random solids against float64: how many go through a surface.

python -m tests.lab.watertight --rays 1e7 [--seed 1] [--keep]

A ray is transverse if it enters the solid by more than an epsilon, a tenth of a pixel; such a ray must not be lost.
Rays that only dip into it, by less, may be drawn farther on; those that are by more than a contact are counted. Rays
that graze it by less than that may pass; their share is told, by the angle at which they touch.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.truth.rays import camera_rays
from tests.hard.referee import Referee
from tests.hard.world import EPSILON, World
from tests.lab.fuzz import scene_of
from tests.lab.long_runs import keep
from tests.support import random_trees

ANGLES = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 90.0)
"""Upper ends of the bins, degrees between ray and surface."""
STEPS = 1500
"""Of the float64 march; a ray that is not done is left out, and counted."""


@dataclass
class Count:
    """Rays; those that float64 knows to meet a solid; of them, those lost, drawn behind a dip, and grazed and passed.

    met, passed : by the angle, of those that meet a solid and of those that grazed and passed.
    """

    rays: int = 0
    hits: int = 0
    lost: int = 0
    dipped: int = 0
    grazing: int = 0
    unknown: int = 0
    met: NDArray[Any] = field(default_factory=lambda: np.zeros(len(ANGLES), int))
    passed: NDArray[Any] = field(default_factory=lambda: np.zeros(len(ANGLES), int))

    def table(self) -> list[str]:
        """A line for each bin."""
        lines = []
        for low, high, met, passed in zip((0.0, *ANGLES), ANGLES, self.met, self.passed, strict=False):
            lines.append(f"{low:g} to {high:g} degrees: {passed} of {met:,} pass")
        return lines


def solid(seed: int) -> rm.Node:
    """A closed solid of two or three operators about random shapes."""
    random = np.random.default_rng(seed)
    shapes, one, many = ([d.name for d in random_trees.BY_ARITY[arity]] for arity in ("none", "one", "many"))
    node = random_trees.made(str(random.choice(shapes)), [], int(random.integers(200)))
    for _ in range(2):
        node = random_trees.made(str(random.choice(one)), [node], int(random.integers(200)))
    other = random_trees.made(str(random.choice(shapes)), [], int(random.integers(200)))
    return random_trees.made(str(random.choice(many)), [node, other], int(random.integers(200)))


def first_contact(referee: Referee) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Where plain float64 steps come within a contact of the solid, (H, W), inf where they leave its box; which ended.

    A certified field is never larger than the distance, so nothing lies before it.
    """
    node, (width, height) = referee.scene.node, referee.size
    rays = camera_rays(referee.pose, width, height)
    lines = rays.lines(node.facts, np.inf)
    found = np.full(width * height, np.inf)
    rows = np.flatnonzero(lines.end > lines.start)
    t = lines.start[rows]
    for _ in range(STEPS):
        if not rows.size:
            break
        value = node.distance(rays.at(rows, t))
        near = value <= referee.contact(t)
        found[rows[near]] = t[near]
        t = t + value
        going = ~near & (t < lines.end[rows])
        rows, t = rows[going], t[going]
    known = np.ones(width * height, bool)
    known[rows] = False
    return found.reshape(height, width), known.reshape(height, width)


def shoot(world: World, seed: int, size: tuple[int, int], count: Count) -> None:
    """Add the rays of one picture of a solid."""
    node = solid(seed)
    if node.exactness == "estimate" or node.facts.empty:
        return
    scene = scene_of(node, seed)
    scene = scene.replace(
        camera=rm.Camera(scene.camera.position, scene.camera.target, fov=36.0)
    )  # the solid fills the picture
    referee = Referee(scene, size)
    frame = world.draw(referee.scene, size, ("depth", "normal"))
    first, known = first_contact(referee)
    depth = frame.depth.astype(np.float64)
    through = referee.through(depth, first, EPSILON)
    dipped = referee.through(depth, first) & ~through
    missing = np.isfinite(first) & ~np.isfinite(depth)
    missing[missing] = referee.deepest(missing, first, depth) > 0  # the others came near, and went by
    seen = np.isfinite(first) & np.isfinite(depth)
    hit = seen | missing
    count.rays += depth.size
    count.hits += int(hit.sum())
    count.lost += int(through.sum())
    count.dipped += int(dipped.sum())
    count.grazing += int((missing & ~through & ~dipped).sum())
    count.unknown += int((~known).sum())
    passed = _angles(node.gradient(referee.at(first)[missing]), referee.direction[missing])
    count.passed += _binned(passed)
    count.met += _binned(_angles(frame.normal[seen], referee.direction[seen])) + _binned(passed)


def _angles(normals: NDArray[Any], directions: NDArray[Any]) -> NDArray[np.float64]:
    length = np.maximum(np.linalg.norm(normals, axis=-1), 1e-9)
    return np.degrees(np.arcsin(np.clip(np.abs(np.sum(normals * directions, axis=-1)) / length, 0, 1)))


def _binned(angles: NDArray[Any]) -> NDArray[np.int64]:
    return np.bincount(np.searchsorted(ANGLES[:-1], angles), minlength=len(ANGLES))


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rays", type=float, default=1e5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", action="store_true", help="put the figures into docs/figures/long_runs.json")
    given = parser.parse_args(arguments)
    count, seed = Count(), given.seed
    size = (320, 240) if given.rays > 1e6 else (96, 72)
    with World() as world:
        while count.rays < given.rays:
            before = count.lost
            shoot(world, seed, size, count)
            if count.lost > before:
                print(f"solid {seed}: {count.lost - before} lost", flush=True)
            seed += 1
            if seed % 10 == 0:
                print(
                    f"{seed - given.seed} solids: {count.rays} rays, {count.hits} hits, {count.lost} lost", flush=True
                )
    figures = {
        "solids": seed - given.seed,
        "rays": count.rays,
        "rays that meet one, by float64": count.hits,
        "rays lost": count.lost,
        "rays drawn behind a dip of less than an epsilon": count.dipped,
        "rays that grazed and passed": count.grazing,
        "rays that float64 left open": count.unknown,
        "rays that pass, by the angle between ray and surface": count.table(),
    }
    print(json.dumps(figures, indent=1))
    if given.keep:
        keep("watertight", **figures)
    return 1 if count.lost else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
