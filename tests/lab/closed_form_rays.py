"""Random flat, long, small and distant solids with closed forms: where float32 says that a line enters and leaves them.

python -m tests.lab.closed_form_rays [--seeds 20] [--rays 400] [--shape NAME]

The judge is the field of the solid in float64, a convex function along a line: it is 0 at the ends, positive before and
behind them, and nowhere negative on a line that misses. Errors are in units of an ulp of the numbers by which line and
solid are given. Of each shape, the largest error at each ratio of two of its sizes (1e-6 to 1e6) is printed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import var
from raymarch.expr.types import VEC3
from raymarch.sdf.intersections import interval_of_ray

Array = NDArray[np.float64]
ORIGIN, DIRECTION = var("o", VEC3), var("d", VEC3)
ULP = 2.0**-23
RATIOS = tuple(10.0**e for e in range(-6, 7))
MOST = 4.0
"""Largest error in ulp: the sum of the roundings of origin, transform, discriminant and root, each at most one."""

SHAPES: dict[str, Callable[[float], rm.Node]] = {
    "plane": lambda ratio: rm.plane((1, 2, 0.5), ratio),
    "sphere": lambda ratio: rm.sphere(ratio),
    "box": lambda ratio: rm.box((1, ratio, 0.7)),
    "rod": lambda ratio: rm.box((ratio, 1, ratio)),
    "cylinder": lambda ratio: rm.cylinder(1, ratio),
    "capsule": lambda ratio: rm.capsule((0, -ratio, 0), (0.3 * ratio, ratio, 0), 1),
    "cone": lambda ratio: rm.cone(1, ratio),
    "cone upside down": lambda ratio: rm.cone(0, ratio, 1),
    "frustum": lambda ratio: rm.cone(1, ratio, 0.4),
    "almost a cylinder": lambda ratio: rm.cone(1, 2, 1 + 0.9 * min(ratio, 1 / ratio)),
    "long frustum": lambda ratio: rm.cone(1, ratio, 0.999),
    "ellipsoid": lambda ratio: rm.ellipsoid((1, ratio, 0.8)),
    "needle": lambda ratio: rm.ellipsoid((ratio, 1, ratio)),
}
"""Solids by the ratio of two of their sizes."""


def placed(solid: rm.Node, kind: int, random: np.random.Generator) -> rm.Node:
    """The solid at the origin, turned, far from the origin, or large."""
    if kind == 1:
        solid = solid.rotate(float(random.uniform(0, 6)), tuple(random.normal(size=3)))
    if kind == 2:
        solid = solid.translate(tuple(1e4 * random.normal(size=3)))
    return solid.scale(1e3) if kind == 3 else solid


def lines(solid: rm.Node, ratio: float, n: int, random: np.random.Generator) -> tuple[Array, Array]:
    """Origins and unit directions in float32 of lines towards points on and beside the surface; some along the axes."""
    lower, upper = (np.where(np.isfinite(b), b, np.sign(b) * 1e4 * max(ratio, 1)) for b in solid.bounds)
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    place = random.uniform(-1.05, 1.05, (n, 3))
    ends = np.arange(n) % 4 == 0  # towards tips and rims
    place[ends] = np.sign(place[ends]) * random.choice([0.0, 0.5, 1.0], (ends.sum(), 3))
    target = middle + place * half
    away = 10.0 ** random.uniform(-3, 2, (n, 1)) * half.max()
    toward = random.normal(size=(n, 3))
    toward[:, random.integers(3)] *= 10.0 ** random.uniform(-6, 1)  # grazing
    toward[: n // 8] = np.eye(3)[random.integers(0, 3, n // 8)] * random.choice([-1, 1], (n // 8, 1))
    toward[n // 8 : n // 4] *= half  # along the diagonals of the box
    toward /= np.linalg.norm(toward, axis=1)[:, None]
    return (target - away * toward).astype(np.float32), toward.astype(np.float32)


def intervals(solid: rm.Node, o: Array, d: Array) -> Array:
    """Where the lines enter and leave the solid, (n, 2)."""
    found = evaluator([interval_of_ray(solid, ORIGIN, DIRECTION)], (ORIGIN, DIRECTION), np.float32)(o, d)[0]
    return np.broadcast_to(found, (len(o), 2))


def least(field: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """The least value of a convex function between two arguments, by golden sections."""
    share = (5**0.5 - 1) / 2
    found = np.minimum(field(low), field(high))
    for _ in range(44):
        a, b = high - share * (high - low), low + share * (high - low)
        at_a, at_b = field(a), field(b)
        found = np.minimum(found, np.minimum(at_a, at_b))
        low, high = np.where(at_a < at_b, low, a), np.where(at_a < at_b, b, high)
    return found


def errors(solid: rm.Node, o: Array, d: Array) -> Array:
    """How far the ends are from the surface, or how deep a line is in the solid where it should not be, in ulp."""
    found = intervals(solid, o, d).astype(float)
    o, d = o.astype(float), d.astype(float)
    size = np.abs(np.where(np.isfinite(solid.bounds), solid.bounds, 0.0)).max()
    far = 4 * (np.linalg.norm(o, axis=1) + size)

    def field(t: Array) -> Array:
        return solid.distance(o + t[:, None] * d)

    def scale(t: Array) -> Array:
        return ULP * (np.linalg.norm(o, axis=1) + np.abs(t) + size)

    enter, leave = np.clip(found, -far[:, None], far[:, None]).T
    met = found[:, 0] <= found[:, 1]
    split = np.where(met, enter, far)
    before = -least(field, -far, split) / scale(split * met)  # in the solid before the first end
    wrong = np.maximum(np.where(split > -far, before, 0.0), 0.0)
    wrong = np.maximum(wrong, np.where(met & (leave < far), -least(field, leave, far), 0.0) / scale(leave))
    for t in (enter, leave):
        ends = met & (np.abs(t) < far)
        wrong = np.maximum(wrong, np.where(ends, np.abs(field(t)), 0.0) / scale(t))
    return np.where(np.isnan(found).any(axis=1), np.inf, wrong)


def trial(name: str, ratio: float, seed: int, rays: int) -> Array:
    """The errors of random lines for a solid at a random place."""
    random = np.random.default_rng(seed)
    solid = placed(SHAPES[name](ratio), seed % 4, random)
    return errors(solid, *lines(solid, ratio, rays, random))


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--rays", type=int, default=400)
    parser.add_argument("--shape", default="")
    given = parser.parse_args(arguments)
    failed = False
    for name in [given.shape] if given.shape else SHAPES:
        found = [[trial(name, ratio, seed, given.rays) for seed in range(given.seeds)] for ratio in RATIOS]
        print(f"{name}: " + ", ".join(f"{np.max(each):.3g}" for each in found), flush=True)
        failed = failed or bool(np.max(found) > MOST)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
