"""Rays at closed random solids against float64: how many go through a surface.

python -m tests.hard.watertight --rays 1e7

A ray is transverse if it enters the solid by more than a contact, the size of the field that a hit may have; such a ray
must not be lost. Rays that only graze it, by less, may pass; their share is told.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass

import numpy as np
import test_random_trees

import raymarch as rm
from tests.hard.fuzz import scene_of
from tests.hard.referee import Referee
from tests.hard.world import World


@dataclass
class Count:
    """Rays of which float64 knows that they hit; those lost among them, and those that grazed and passed."""

    rays: int = 0
    hits: int = 0
    lost: int = 0
    grazing: int = 0


def solid(seed: int) -> rm.Node:
    """A closed solid of two or three operators about random shapes."""
    random = np.random.default_rng(seed)
    shapes, one, many = ([d.name for d in test_random_trees.BY_ARITY[arity]] for arity in ("none", "one", "many"))
    node = test_random_trees.made(str(random.choice(shapes)), [], int(random.integers(200)))
    for _ in range(2):
        node = test_random_trees.made(str(random.choice(one)), [node], int(random.integers(200)))
    other = test_random_trees.made(str(random.choice(shapes)), [], int(random.integers(200)))
    return test_random_trees.made(str(random.choice(many)), [node, other], int(random.integers(200)))


def shoot(world: World, seed: int, size: tuple[int, int], count: Count) -> None:
    """Add the rays of one picture of a solid."""
    node = solid(seed)
    if node.exactness == "estimate" or node.facts.empty:
        return
    referee = Referee(scene_of(node, seed), size)
    frame = world.draw(referee.scene, size, ("depth",))
    through = referee.through(frame.depth.astype(np.float64))
    missing = referee.known.hit & ~np.isfinite(frame.depth)
    count.rays += frame.depth.size
    count.hits += int(referee.known.hit.sum())
    count.lost += int(through.sum())
    count.grazing += int((missing & ~through).sum())


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rays", type=float, default=1e5)
    wanted = parser.parse_args(arguments).rays
    count, seed = Count(), 1
    size = (320, 240) if wanted > 1e6 else (96, 72)
    with World() as world:
        while count.rays < wanted:
            shoot(world, seed, size, count)
            seed += 1
            if seed % 20 == 0:
                print(count, flush=True)
    share = count.grazing / max(count.hits, 1)
    print(
        f"{count.rays} rays at {seed - 1} solids, {count.hits} hits: {count.lost} lost; {share:.2g} grazed and passed"
    )
    return 1 if count.lost else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
