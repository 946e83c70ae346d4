"""Facts of nodes that intervals contradict: a point, a stretch or a ball for which a stated fact is certainly wrong.

Where to look is chosen by random numbers and by the field's own gradient. What is found is certain, because all values
are enclosed. Facts that no such place contradicts may still be wrong.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from raymarch.expr.arrays import bound
from raymarch.expr.evaluate import Program
from raymarch.expr.walk import topological
from raymarch.proof.enclosure import ENCLOSURES
from raymarch.proof.rays import Rays
from raymarch.proof.rounding import Array, Interval, up
from raymarch.proof.span import Span, stretches
from raymarch.scene.parameter import Values
from raymarch.sdf.lower import Lowering
from raymarch.sdf.node import Node

OURS = "raymarch."
"""Modules whose definitions are tested by this project."""

POINTS = 2000
"""Points of a node that are tried."""

NODES = 64
"""Most nodes of a tree that are tried."""

BALLS, CELLS = 40, 9
"""Balls that should hold no surface, and the cubes along each edge of the cube around one."""

OFF = 1e-6
"""Relative error of a stated number that is not called wrong."""


def wrong_facts(root: Node, values: Values, every: bool) -> tuple[str, ...]:
    """Sentences about wrong facts of the nodes of a tree, without those of nodes above them.

    every : True also tries the definitions of the library.
    """
    found: list[str] = []
    bad: set[Node] = set()
    tried = 0
    for node in topological([root], lambda node: node.children):
        if any(child in bad for child in node.children):
            bad.add(node)
        elif tried < NODES and (every or not node.definition.source.__module__.startswith(OURS)):
            tried += 1
            own = list(_Tried(node, values).wrong())
            if own:
                bad.add(node)
                used = f", used at {node.where}" if node.where else ""
                found += [f"{node.name} ({node.definition.where}{used}): {what}" for what in own]
    return tuple(found)


def _shown(point: Array) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"


@dataclass(slots=True)
class _Tried:
    """One node, and places around it."""

    node: Node
    values: Values
    program: Program = field(init=False)

    def __post_init__(self) -> None:
        lowered = Lowering(rays="camera").field(self.node)
        self.program = Program([lowered.body], lowered.params, ENCLOSURES)

    def wrong(self) -> Iterator[str]:
        """What is wrong, one sentence for each fact."""
        facts = self.node.facts
        if facts.empty or facts.exactness == "estimate":
            return
        size = np.where(np.isfinite(facts.size), facts.size, 4.0)
        known_low, known_high = np.isfinite(facts.lower), np.isfinite(facts.upper)
        middle = np.where(known_low, facts.lower, np.where(known_high, facts.upper - size, -0.5 * size)) + 0.5 * size
        random = np.random.default_rng(1)
        points = middle + size * random.uniform(-1.2, 1.2, (POINTS, len(size)))
        near = middle + size * random.uniform(-0.5, 0.5, (POINTS, len(size)))
        with np.errstate(all="ignore"), bound(self.values.params, self.values.time):
            for rule in (self._box, self._steep, self._far, self._near, self._convex, self._mirrored):
                yield from rule(np.concatenate([points, near]), self.enclosed(np.concatenate([points, near])).range)

    def enclosed(
        self, points: Array, directions: Array | None = None, length: float = 0.0, half: Array | None = None
    ) -> Span:
        """The field on stretches from some points, or in cubes around them of half an edge `half`, (n,)."""
        n, dimension = points.shape

        def solid(v: Array) -> Array:
            return np.pad(v, ((0, 0), (0, 3 - dimension)))

        rays = Rays(solid(points), solid(np.zeros_like(points) if directions is None else directions))
        if half is not None:
            rays = Rays(rays.origins, rays.directions, beside=solid(np.broadcast_to(half[:, None], points.shape)))
        ends = np.zeros(n), np.full(n, length), np.full(n, 0.5 * length)
        whole = rays.points(np.arange(n), *ends)
        slope = whole.slope or (np.zeros((n, 3)), np.zeros((n, 3)))
        at = whole.at[0][:, :dimension], whole.at[1][:, :dimension]
        here = Span(
            whole.low[:, :dimension], whole.high[:, :dimension], at, (slope[0][:, :dimension], slope[1][:, :dimension])
        )
        with stretches(up(ends[2]), up(ends[2])):
            found = self.program(here)[0]

        def wide(v: Interval) -> Interval:
            low, high = np.broadcast_to(v[0], n), np.broadcast_to(v[1], n)
            return np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)

        return Span(*wide(found.range), wide(found.at), wide(found.slope or (np.zeros(n), np.zeros(n))))

    def _box(self, points: Array, value: Interval) -> Iterator[str]:
        facts = self.node.facts
        deeper = (np.where(np.isfinite(value[1]), value[1], 0.0) + 0.01 * np.abs(points).max())[:, None]
        points = np.concatenate([points, points + deeper * self._towards(points)])  # also a little below the surface
        value = self.enclosed(points).range
        beyond = np.maximum(facts.lower - points, points - facts.upper).max(axis=1)
        least = OFF * np.max(np.abs(points), axis=1)
        outside = np.flatnonzero((value[1] < 0.0) & (beyond > least))
        if len(outside):
            i = outside[np.argmax(beyond[outside])]
            yield f"its box is wrong: {_shown(points[i])} lies in the solid, {beyond[i]:.4g} outside of the box"
            return
        far = beyond - facts.spread * np.maximum(value[1], 0.0) * (1.0 + OFF) - least
        if np.isfinite(facts.spread) and np.any(far > 0.0):
            i = int(np.argmax(far))
            yield (
                f"its spread {facts.spread:.4g} is wrong: the value {value[1][i]:.4g} at {_shown(points[i])} is "
                f"reached {beyond[i]:.4g} outside of the box"
            )

    def _steep(self, points: Array, _value: Interval) -> Iterator[str]:
        """The slope along the gradient."""
        facts = self.node.facts
        directions = self._towards(points)
        size = float(np.abs(points).max())
        slope = self.enclosed(points, directions, 1e-5 * size).slope
        assert slope is not None
        least = np.maximum(slope[0], -slope[1])
        if np.any(least > facts.lipschitz * (1.0 + OFF)):
            i = int(np.argmax(least))
            stated = facts.lipschitz * facts.divisor
            what = f"divisor {facts.divisor:.4g}" if facts.divisor > 1.0 else f"Lipschitz constant {stated:.4g}"
            yield f"its {what} is wrong: the field rises by {least[i] * facts.divisor:.4g} at {_shown(points[i])}"

    def _towards(self, points: Array) -> Array:
        """Unit directions in which the field falls."""
        gradient = -np.nan_to_num(self.node.gradient(points))
        length = np.linalg.norm(gradient, axis=1, keepdims=True)
        return np.asarray(
            np.where(length > 0.0, gradient / np.where(length > 0.0, length, 1.0), np.eye(points.shape[1])[0])
        )

    def _far(self, points: Array, value: Interval) -> Iterator[str]:
        """Values larger than the distance: the solid, or the outside, begins before."""
        value_there = np.where(value[0] > 0.0, value[0], np.where(value[1] < 0.0, value[1], 0.0))
        axes = np.eye(points.shape[1])
        for share, direction in product((0.95, 0.5), (self._towards(points), *axes, *-axes)):
            there = self.enclosed(points + share * value_there[:, None] * direction).range
            wrong = np.where(value_there > 0.0, there[1] < 0.0, (there[0] > 0.0) & (value_there < 0.0))
            if wrong.any():
                i = int(np.flatnonzero(wrong)[0])
                yield (
                    f'exactness "{self.node.facts.exactness}" is wrong: the value {value_there[i]:.4g} at '
                    f"{_shown(points[i])} is larger than the distance, less than {share * abs(value_there[i]):.4g}"
                )
                return

    def _near(self, points: Array, value: Interval) -> Iterator[str]:
        """Values smaller than the distance, which no exact field has: a larger ball is free of the surface."""
        if self.node.facts.exactness != "exact":
            return
        dimension = points.shape[1]
        edge = (np.arange(CELLS) + 0.5) * (2.0 / CELLS) - 1.0
        cells = np.stack(np.meshgrid(*[edge] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
        cells = cells[np.linalg.norm(np.maximum(np.abs(cells) - 1.0 / CELLS, 0.0), axis=1) <= 1.0]
        outside = np.flatnonzero(value[0] > 0.0)[:BALLS]
        radii = 1.1 * value[1][outside]
        centres = (points[outside, None] + radii[:, None, None] * cells).reshape(-1, dimension)
        halves = np.repeat(radii / CELLS * (1.0 + OFF), len(cells))
        least = self.enclosed(centres, half=halves).low.reshape(len(outside), -1).min(axis=1)
        for i, radius in zip(outside[least > 0.0][:1], radii[least > 0.0], strict=False):
            yield (
                f'exactness "exact" is wrong: the value {value[1][i]:.4g} at {_shown(points[i])} is smaller than the '
                f"distance, more than {radius:.4g}"
            )

    def _convex(self, points: Array, value: Interval) -> Iterator[str]:
        inside = np.flatnonzero(value[1] < 0.0)
        if not self.node.facts.convex or len(inside) < 2:
            return
        other = np.roll(inside, 1)
        for share in (0.5, 0.3):
            between = (1.0 - share) * points[inside] + share * points[other]
            outside = self.enclosed(between).low > OFF * np.abs(points).max()
            if outside.any():
                i = int(np.flatnonzero(outside)[0])
                ends = f"{_shown(points[inside[i]])} and {_shown(points[other[i]])}"
                yield f"it is not convex: {_shown(between[i])} lies outside, between {ends} inside"
                return

    def _mirrored(self, points: Array, value: Interval) -> Iterator[str]:
        for axis in self.node.facts.symmetry:
            image = points.copy()
            image[:, "xyz".index(axis)] *= -1.0
            there = self.enclosed(image).range
            apart = np.maximum(there[0] - value[1], value[0] - there[1])
            if np.any(apart > OFF * np.abs(points).max()):
                i = int(np.argmax(apart))
                yield f'its symmetry "{axis}" is wrong: {_shown(points[i])} and its image differ by {apart[i]:.4g}'
                return
