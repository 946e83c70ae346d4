"""Samples of a field that contradict the facts of its node.

A sample can refute a fact, it cannot prove one. The tests check the definitions of this package more thoroughly.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError, is_users
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import const
from raymarch.sdf.facts import Facts, beyond
from raymarch.sdf.node import Node
from raymarch.sdf.same import remembered

SAMPLES = 2048
"""Points in the box; as many lie in and around it, and as many close to its faces."""

FEW = 0.001
"""Fraction of the points at which an exact field may miss the surface: points on its edges and medial axes. No exact
node of this package misses it at any point."""

Points = NDArray[np.float64]


STATED = ("raw_field",)
"""Definitions of this package whose facts are arguments of the user's call."""


def stated_by_user(node: Node) -> bool:
    """True for a node with facts that the user wrote: its definition is not in this package, or takes them."""
    return is_users(node.definition.where.file) or node.definition.name in STATED


def contradictions(node: Node, samples: int = SAMPLES) -> Iterator[str]:
    """A sentence for each fact (bounds, spread, exactness, symmetry, placing) that samples of the field refute.

    The field is evaluated in float64, for the bound values of parameters and time (`raymarch.expr.arrays.bound`).
    Positions are in the space of the node. A node without a float64 field gives no sentence.
    """
    facts = node.facts
    if facts.empty:
        return
    points = _points(facts, node.dimension, samples)
    try:
        field = node.distance(points)
    except SceneError:  # a GLSL node without a NumPy function
        return
    size = _size(facts)
    if node.definition.estimates(node):
        yield from _cut(node, points, size)
    else:
        yield from _outside(facts, points, field, size)
    if facts.exactness == "exact":
        yield from _inexact(node, points, field, size)
    for axis in facts.symmetry:
        yield from _asymmetric(node, points, field, size, axis)
    if node.placed_as in ("rigid", "scale"):
        yield from _misplaced(node, points)


@remembered
def quick_contradictions(node: Node) -> tuple[str, ...]:
    """`contradictions` on fewer points, remembered for each node: the values bound at the first call count."""
    return tuple(contradictions(node, SAMPLES // 4))


def _outside(facts: Facts, points: Points, field: Points, size: float) -> Iterator[str]:
    """Solid points outside of the box, and fields that rise more slowly than the spread states."""
    apart = beyond(facts.lower, facts.upper, points)
    away = np.max(np.where(np.isfinite(apart), apart, 0.0), axis=-1)
    solid = (away > 1e-6 * size) & (field < 0.0)
    if np.any(solid):
        k = int(np.argmax(np.where(solid, away, 0.0)))
        yield f"the solid reaches {away[k]:.3g} outside its bounds, at {_shown(points[k])}"
    elif np.isfinite(facts.spread):
        excess = np.where(away > 0.0, away - facts.spread * np.maximum(field, 0.0), -np.inf)
        k = int(np.argmax(excess))
        if excess[k] > 1e-6 * size:
            yield (
                f"the field is {field[k]:.4g} at {_shown(points[k])}, {away[k]:.4g} outside the bounds: more than its "
                f"spread, {facts.spread:.4g}, times the field"
            )


def _cut(node: Node, points: Points, size: float) -> Iterator[str]:
    """Solid points on the faces of the box of an estimate, whose field is evaluated in the box only."""
    faces = np.clip(points, node.facts.lower, node.facts.upper)
    field = np.where(np.any(faces != points, axis=-1), node.distance(faces), np.inf)
    k = int(np.argmin(field))
    if field[k] < -1e-6 * size:
        yield f"the solid reaches outside its bounds, at {_shown(faces[k])}"


def _inexact(node: Node, points: Points, field: Points, size: float) -> Iterator[str]:
    """A field is the distance if the point at that distance along the gradient is on the surface."""
    gradient = node.gradient(points)
    with np.errstate(all="ignore"):
        left = np.abs(node.distance(points - field[..., None] * gradient))
    k = _worst(np.nan_to_num(left, nan=np.inf), 1e-5 * (size + np.abs(field)))
    if k is not None:
        yield (
            f"the field is {field[k]:.4g} at {_shown(points[k])}, but the surface is not at that distance along the "
            f"gradient: not exact"
        )


def _asymmetric(node: Node, points: Points, field: Points, size: float, axis: str) -> Iterator[str]:
    """Fields that differ at mirrored points."""
    mirrored = points * np.where(np.arange(node.dimension) == "xyz".index(axis), -1.0, 1.0)
    with np.errstate(all="ignore"):
        gap = np.abs(node.distance(mirrored) - field)
    k = _worst(gap, 1e-6 * (size + np.abs(field)))
    if k is not None:
        yield (
            f"the field is {field[k]:.4g} at {_shown(points[k])}, and differs by {gap[k]:.3g} if {axis} changes sign"
        )


def _misplaced(node: Node, points: Points) -> Iterator[str]:
    """Pairs of points whose distance changes by another factor than that of the field."""
    point, child, factor = node.definition.placement(node.params)
    moved, scale = evaluator([child, const(1.0) if factor is None else factor], [point])(points)
    apart, now = (np.linalg.norm(p[:-1] - p[1:], axis=-1) for p in (points, np.broadcast_to(moved, points.shape)))
    k = int(np.argmax(gap := np.abs(scale * now - apart)))
    if gap[k] > 1e-6 * apart[k]:
        what = f"points {apart[k]:.4g} apart, at {_shown(points[k])}, are {now[k]:.4g} apart in the child's space"
        yield f"placing = {node.placed_as!r}, but {what}"


def _worst(errors: Points, legal: Points) -> int | None:
    """The number of the point with the largest error; None if no more than `FEW` are larger than is legal."""
    wrong = errors > legal
    return int(np.argmax(np.where(wrong, errors, -1.0))) if np.count_nonzero(wrong) > FEW * len(wrong) else None


def _size(facts: Facts) -> float:
    edges = facts.size[np.isfinite(facts.size)]
    return float(np.max(edges, initial=0.0)) or 2.0


def _points(facts: Facts, dimension: int, samples: int) -> Points:
    """Points in the box, points around it, and points close to its faces, where a solid leaves it first."""
    random = np.random.default_rng(7)
    size = _size(facts)
    anchor = np.where(np.isfinite(facts.lower), facts.lower, np.where(np.isfinite(facts.upper), facts.upper, 0.0))
    lower = np.where(np.isfinite(facts.lower), facts.lower, np.minimum(anchor, 0.0) - size)
    upper = np.where(np.isfinite(facts.upper), facts.upper, np.maximum(anchor, 0.0) + size)
    inside = random.uniform(lower, upper, (samples, dimension))
    around = random.uniform(lower - 0.5 * size, upper + 0.5 * size, (samples, dimension))
    near = random.uniform(lower, upper, (samples, dimension))
    axis = random.integers(0, dimension, samples)
    side = random.integers(0, 2, samples).astype(bool)
    row = np.arange(samples)
    gap = size * 10.0 ** random.uniform(-3.0, -0.5, samples)
    near[row, axis] = np.where(side, upper[axis] + gap, lower[axis] - gap)
    return np.concatenate([inside, around, near])


def _shown(point: Points) -> str:
    return "({})".format(", ".join(f"{v:.4g}" for v in point))
