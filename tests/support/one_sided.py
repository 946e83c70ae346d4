"""Gradients on both sides of a plane of symmetry, from differences of the distance alone, and fields to ask there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.vocabulary import length, max, min, vec2
from raymarch.sdf import Node
from raymarch.sdf.blends import FAMILIES
from raymarch.sdf.definition import combination

Array = NDArray[np.float64]

STEP = 1e-3
SURE = 1e-8
"""Two estimates of a derivative that differ by less are taken as right; else another kink is near."""


def one_sided(distance: Callable[[Array], Array], points: Array, direction: Array) -> tuple[Array, NDArray[np.bool_]]:
    """The derivative in a direction from its own side, and where it is sure: differences, extrapolated three times."""
    steps = STEP * 0.5 ** np.arange(5)
    asked = points + np.append(0.0, steps)[:, None, None] * direction
    here, *there = distance(asked.reshape(-1, 3)).reshape(asked.shape[:2])
    row = [(value - here) / h for value, h in zip(there, steps, strict=True)]
    for order in (1, 2, 3):
        row = [(2**order * fine - coarse) / (2**order - 1) for coarse, fine in pairwise(row)]
    return row[1], np.abs(row[1] - row[0]) < SURE


class Limits(NamedTuple):
    """The gradient's limits from both sides of x = 0, and where they are sure."""

    right: Array
    left: Array
    sure: NDArray[np.bool_]

    @property
    def agree(self) -> NDArray[np.bool_]:
        return np.abs(self.right - self.left).max(axis=-1) < 10 * SURE

    def missed(self, gradient: Array) -> Array:
        """How far a gradient is from the segment between both limits."""
        along = self.right - self.left
        size = np.maximum(np.sum(along * along, axis=-1), 1e-30)
        share = np.clip(np.sum((gradient - self.left) * along, axis=-1) / size, 0.0, 1.0)
        return np.linalg.norm(gradient - self.left - share[:, None] * along, axis=-1)


def limits(distance: Callable[[Array], Array], points: Array) -> Limits:
    """The limits at points with x = 0. Along the plane both are the slope of the field on the plane."""
    right, sure = one_sided(distance, points, np.array([1.0, 0.0, 0.0]))
    left, sure_too = one_sided(distance, points, np.array([-1.0, 0.0, 0.0]))
    sides = np.stack([right, -left])[..., None] * np.array([1.0, 0.0, 0.0])
    sure &= sure_too
    for axis in np.eye(3)[1:]:
        forward, first = one_sided(distance, points, axis)
        backward, second = one_sided(distance, points, -axis)
        sides += 0.5 * (forward - backward)[:, None] * axis
        sure &= first & second & (np.abs(forward + backward) < 10 * SURE)
    return Limits(sides[0], sides[1], sure)


def on_the_plane(seed: int, count: int, size: float = 1.2) -> Array:
    points = np.random.default_rng(seed).uniform(-size, size, (count, 3))
    points[:, 0] = 0.0
    return points


# Fields that are their own mirror image in x = 0


def _rod(x: float = 1.0, z: float = 1.0) -> Node:
    return rm.capsule((0.1 * x, -0.5, 0.2 * z), (0.7 * x, 0.3, 0.5 * z), 0.3)


def _ball(x: float = 1.0, z: float = 1.0) -> Node:
    return rm.sphere(0.45).translate((0.35 * x, 0.1, 0.3 * z))


@combination(bounds=lambda children, k: (children[0].lower, children[0].upper))
def textbook_intersection(p: Any, children: Any, k: Any = 0.4) -> Any:
    """As a user writes it: max and an abs of the difference the other way round."""
    a, b = children[0](p), children[1](p)
    h = max(k - abs(b - a), 0.0) / k
    return max(a, b) + h * h * k * 0.25


@combination(bounds=lambda children, k: (children[0].lower, children[0].upper))
def textbook_round(p: Any, children: Any, k: Any = 0.4) -> Any:
    """As hg_sdf writes it."""
    a, b = children[0](p), children[1](p)
    return max(k, min(b, a)) - length(max(vec2(k - a, k - b), 0.0))


def _aside() -> Node:
    return rm.sphere(0.3).translate((0.2, 0.3, -0.1))


def mirrored_fields() -> Iterator[tuple[str, Callable[[], Node]]]:
    """Every family and operator of two mirrored solids, of four, and nested; and what else is symmetric about x = 0."""
    for family in FAMILIES:
        for k in (0.15, 0.6):
            how: dict[str, Any] = {"k": k, "blend": family}
            name = f"{family} {k}"
            yield f"union {name}", lambda how=how: rm.union(_rod(), _rod(-1), **how)
            yield f"intersection {name}", lambda how=how: rm.intersection(_ball(), _ball(-1), **how)
            yield f"difference {name}", lambda how=how: rm.difference(_rod(), _rod(-1).complement(), **how)
            yield (
                f"union of 4 {name}",
                lambda how=how: rm.union(_rod(), _rod(-1), _rod(1, -1), _rod(-1, -1), **how),
            )
            yield (
                f"nested {name}",
                lambda how=how: rm.intersection(
                    rm.union(_ball(), _ball(-1), **how), rm.union(_rod(), _rod(-1), **how), **how
                ),
            )
    pair = (_rod(), _rod(-1))
    yield "hard union", lambda: rm.union(*pair)
    yield "hard intersection", lambda: rm.intersection(*pair)
    yield "hard difference", lambda: rm.difference(_rod(), _rod(-1).complement())
    yield "xor", lambda: rm.xor(*pair)
    yield "pipe", lambda: rm.pipe(*pair, 0.2)
    yield "engrave", lambda: rm.engrave(_rod().union(_rod(-1), k=0.3), rm.plane((1, 0, 0)), 0.1)
    yield "groove", lambda: rm.groove(_rod().union(_rod(-1), k=0.3), rm.plane((1, 0, 0)), 0.1, 0.2)
    yield "tongue", lambda: rm.tongue(_rod().union(_rod(-1), k=0.3), rm.plane((1, 0, 0)), 0.1, 0.2)
    yield "morph", lambda: rm.morph(*pair, 0.5)
    yield "mirror", lambda: _rod().mirror("x")
    yield "blend of a mirror", lambda: _rod().mirror("x").union(_ball(), _ball(-1), k=0.4)
    yield "border of cells", lambda: _ball().repeat((1.1, None, None)).translate((0.55, 0.0, 0.0))
    yield "pole and middle of a polar repetition", lambda: _ball().translate((0.5, 0, 0)).polar(6)
    yield "axis of a revolution", lambda: rm.torus(0.5, 0.3)
    yield "elongated along x alone", lambda: rm.sphere(0.5).elongate((0.4, 0.0, 0.0))
    yield "elongated along y alone", lambda: _aside().elongate((0.0, 0.6, 0.0))
    yield "box", lambda: rm.box((1.0, 0.7, 1.3))
    yield "textbook intersection", lambda: textbook_intersection((_ball(), _ball(-1)))
    yield "textbook round", lambda: textbook_round((_rod(), _rod(-1)))
