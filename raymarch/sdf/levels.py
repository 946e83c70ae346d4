"""Where the surface of a field is: whether it is where the field is 0, and how far it may be from a small value."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.arrays import SMALLEST
from raymarch.expr.intervals import interval_of
from raymarch.expr.samples import Samples
from raymarch.sdf.node import Node, all_nodes

PROBES = 4096
"""Number of points at which `has_levels` evaluates an estimate."""


def flatness(root: Node) -> float:
    """How many times as large as the field the distance to a surface may be: 1 or more.

    It is the largest spread of the nodes of a tree, such as the ratio of the factors of an uneven scale, and of sampled
    fields the largest ratio at a sample. Nodes whose spread is not known are left out.
    """
    nodes = all_nodes(root)
    known = [node.facts.spread for node in nodes if math.isfinite(node.facts.spread)]
    return max([1.0, *known, *(_of_samples(node) for node in nodes if node.name == "sampled_grid")])


@lru_cache(maxsize=64)
def _of_samples(node: Node) -> float:
    """The largest ratio of a sample's distance to the surface, along the axes, to its value."""
    data: Samples = node.params["data"]
    cell = (interval_of(node.params["size"])[1] / (np.array(data.size) - 1.0))[::-1]
    values = data.values.astype(np.float64)
    outside = values > 0.0
    if outside.all() or not outside.any():
        return 1.0
    distance = _along_axes(values, cell)
    return float(np.max(distance[outside] / np.maximum(values[outside], SMALLEST))) * node.facts.divisor


def _along_axes(values: NDArray[np.float64], cell: NDArray[np.float64]) -> NDArray[np.float64]:
    """An upper bound of the distance of each sample to the surface of linear interpolation: a path along the axes."""
    found = np.where(values > 0.0, np.inf, 0.0)
    for axis in range(3):  # to a neighbour inside
        value, distance = np.moveaxis(values, axis, 0), np.moveaxis(found, axis, 0)
        for here, there in ((np.s_[:-1], np.s_[1:]), (np.s_[1:], np.s_[:-1])):
            leaves = (value[here] > 0.0) & (value[there] <= 0.0)
            share = np.divide(value[here], value[here] - value[there], out=np.full(leaves.shape, np.inf), where=leaves)
            distance[here] = np.minimum(distance[here], cell[axis] * share)
    for axis in range(3):  # to a neighbour outside
        distance = np.moveaxis(found, axis, 0)
        at = (cell[axis] * np.arange(len(distance)))[:, None, None]
        for way in (np.s_[:], np.s_[::-1]):
            ahead = at if way == np.s_[:] else -at
            distance[way] = np.minimum.accumulate((distance - ahead)[way], axis=0) + ahead[way]
    return found


def has_levels(root: Node) -> bool:
    """True if every estimate in a tree is negative somewhere in its box, so that its surface is where it is 0.

    Others, such as |z| over the growth of a Mandelbox, only fall towards their solid: what is drawn of it is the points
    near which they are small. Judged by `PROBES` points of the box; an estimate without a box, or one in GLSL that only
    a GPU evaluates, counts as one of those.
    """
    estimates = [node for node in all_nodes(root) if node.exactness == "estimate"]
    return all(_is_negative_somewhere(n) for n in estimates if all(c.exactness != "estimate" for c in n.children))


@lru_cache(maxsize=64)
def _is_negative_somewhere(node: Node) -> bool:
    lower, upper = node.bounds
    if node.facts.empty or not (np.all(np.isfinite(lower)) and np.all(np.isfinite(upper))):
        return False
    points = np.random.default_rng(0).uniform(lower, upper, (PROBES, len(lower)))
    try:
        return bool(np.any(node.distance(points) < 0.0))
    except SceneError:
        return False
