"""Tools of differences that end at a face, or soon beyond it, made longer: the solid is the same, and the field beside
it is the distance to what is left, not to the end of a tool, where nothing is drawn."""

from __future__ import annotations

from collections.abc import Callable
from operator import is_
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.errors import SceneError
from raymarch.expr.node import const
from raymarch.sdf.definition import definition_of
from raymarch.sdf.evaluation import evaluate_distance
from raymarch.sdf.facts import lattice
from raymarch.sdf.flat import rectangle
from raymarch.sdf.levels import scaled
from raymarch.sdf.node import Node, all_nodes, at_line_of, folded, has_constants, rederived, replaced
from raymarch.sdf.placement import affine_of
from raymarch.sdf.placing import translate
from raymarch.sdf.prisms import FLUSH, with_prisms
from raymarch.sdf.profiles import straight_extrusion
from raymarch.sdf.same import remembered
from raymarch.sdf.solids import box, cylinder

Array: TypeAlias = NDArray[np.float64]

GRID = 12
"""Points of an end along each of its axes."""
MEASURED = 16
"""Maximum number of differences of a tree that are measured."""

ENDS = {
    definition_of(box): ("size", (0, 1, 2)),
    definition_of(rectangle): ("size", (0, 1)),
    definition_of(cylinder): ("height", (1,)),
    definition_of(straight_extrusion): ("height", (2,)),
}
"""Shapes of one section between two flat ends: the parameter of their extents, and the axes of the ends."""


def with_longer_tools(root: Node, reach: float) -> Node:
    """The same solid; tools of hard differences that end flush with a face, or less than `reach` beyond it, go on.

    Tools that go through a prism along its axis are first made parts of it; see `raymarch.sdf.prisms`. The others are
    boxes, cylinders, extrusions and rectangles, placed and united, of constant numbers. An end is moved as far as
    nothing of the solid that is cut lies before it. It is found by points on it. Other tools are left.
    """
    root = with_prisms(root) if reach > 0.0 else root
    cuts = [node for node in all_nodes(root) if _is_hard(node, "difference") and _is_constant(node)]
    factors = {id(node): factor for node, factor in scaled(root)}  # `reach` is a length outside of all of them
    chosen = {id(node) for node in cuts[:MEASURED] if factors[id(node)] * _longer(node)[1] < reach}
    if not chosen:
        return root

    def made(node: Node, children: list[Node]) -> Node:
        if id(node) in chosen:
            return replaced(node, (children[0], *_longer(node)[0].children[1:]))
        return node if all(map(is_, children, node.children)) else replaced(node, tuple(children))

    return folded(root, made)


def _is_hard(node: Node, name: str) -> bool:
    return node.name == name and not node.params


def _is_constant(node: Node) -> bool:
    return all(map(has_constants, all_nodes(node)))


@remembered
def _longer(node: Node) -> tuple[Node, float]:
    """A difference with longer tools, and the least distance beyond a face at which one of them ended."""
    base, *tools = node.children
    if base.exactness == "estimate":
        return node, np.inf
    try:
        made = [_tool(tool, base, lambda points: points) for tool in tools]
    except SceneError:  # GLSL without a NumPy function
        return node, np.inf
    return replaced(node, (base, *(tool for tool, _ in made)), facts=node.facts), min(beyond for _, beyond in made)


def _tool(tool: Node, base: Node, above: Callable[[Array], Array]) -> tuple[Node, float]:
    """A tool, longer where it may be, and the least distance beyond a face at which it ended; infinite if it stays.

    above : from points of the tool to those of the base.
    """
    if tool.definition in ENDS:
        return _shape(tool, base, above)
    if _is_hard(tool, "union") or tool.label is not None:
        inner = above
    elif (placed := affine_of(tool)) is not None:
        matrix, offset, _ = placed
        back = np.linalg.inv(matrix)

        def inner(points: Array) -> Array:
            return above((points - offset) @ back.T)

    else:
        return tool, np.inf
    made = [_tool(child, base, inner) for child in tool.children]
    beyond = min(found for _, found in made)
    return (tool if beyond == np.inf else rederived(tool, tuple(child for child, _ in made), tool.params)), beyond


def _shape(tool: Node, base: Node, above: Callable[[Array], Array]) -> tuple[Node, float]:
    """The same for a shape between two ends."""
    name, axes = ENDS[tool.definition]
    if not tool.facts.bounded or tool.facts.empty:
        return tool, np.inf
    lower, upper = tool.bounds
    low, high = lower.copy(), upper.copy()
    extent = float(np.linalg.norm(np.diff(above(np.array([lower, upper])), axis=0)))
    most = extent + (float(np.linalg.norm(base.facts.size)) if base.facts.bounded else 0.0)
    least = np.inf
    for axis in axes:
        for ends, side in ((low, -1.0), (high, 1.0)):
            points, beside = _end(tool, low, high, axis)
            points[:, axis] = ends[axis]
            one = np.diff(above(np.array([0.0 * lower, side * np.eye(len(lower))[axis]])), axis=0)[0]
            unit = float(np.linalg.norm(one))
            beyond, free = _free(base, above(points), unit * beside, one / unit, most)
            if free > 0.05 * extent:
                ends[axis] += side * free / unit
                least = min(least, beyond)
    if least == np.inf:
        return tool, np.inf
    size = high - low
    made = rederived(tool, tool.children, {**tool.params, name: const(size if name == "size" else size[axes[0]])})
    moved = translate(made, tuple((0.5 * (low + high - lower - upper)).tolist()))
    return at_line_of(tool, moved), least


def _end(tool: Node, low: Array, high: Array, axis: int) -> tuple[Array, Array]:
    """Points of a section between two ends, (N, d), and how far each lies beyond the ends that were moved, (N,)."""
    lower, upper = tool.bounds
    sides, longer = [], 2.0 ** np.arange(-9.0, 1.0)
    for i, (a, b, c, d) in enumerate(zip(low, lower, upper, high, strict=True)):
        further = [end + by * longer for end, by in ((b, a - b), (c, d - c)) if by]
        sides.append(np.zeros(1) if i == axis else np.concatenate([np.linspace(b, c, GRID), *further]))
    points = lattice(sides)
    if ENDS[tool.definition][0] == "height":
        points = points[evaluate_distance(tool, points) <= 0.0]  # at 0, in the middle, the section decides
    beside = np.maximum(np.maximum(lower - points, points - upper), 0.0)
    beside[:, axis] = 0.0
    return points, beside.max(axis=1)


def _free(base: Node, points: Array, beside: Array, way: Array, most: float) -> tuple[float, float]:
    """How far beyond the base an end is at least, and how far it may go on, at most `most`; 0 where it is in the base.

    The empty balls of the field at the points cover the way of the end, but for what is thinner than the distance of
    two points and as near to the end.
    """
    if not len(points):
        return np.inf, 0.0
    values = evaluate_distance(base, points)
    flush = FLUSH * most
    if values.min() < -flush:
        return np.inf, 0.0
    apart = float(np.max(np.ptp(points[beside == 0.0], axis=0))) / (GRID - 1)
    beyond, at, free = max(float(values.min()), 0.0), np.full(len(points), flush), most
    for _ in range(200):
        values = evaluate_distance(base, points + at[:, None] * way)
        around = np.minimum(0.5 * (at + beside), np.maximum(apart, beside))
        free = min(free, float(at[values < around - flush].min(initial=np.inf)))
        at = at + np.maximum(values - 0.75 * apart, 0.25 * np.clip(at, 0.01 * apart, apart))
        points, beside, at = points[at < free], beside[at < free], at[at < free]
        if not len(points):
            return beyond, free
    return beyond, min(free, float(at.min()))
