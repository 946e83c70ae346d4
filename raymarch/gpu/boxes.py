"""Bounding boxes of a scene and its operands, drawn over the picture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.camera import Pose
from raymarch.scene.scene import Scene
from raymarch.sdf.node import Node

Array = NDArray[np.float64]

OUTERMOST = (0.95, 0.08, 0.05)
"""Colour of the scene's box, inside which rays are marched: red."""
INNER = ((0.1, 0.35, 1.0), (0.1, 0.65, 0.15), (0.85, 0.15, 0.8), (1.0, 0.55, 0.05))
"""Colours of operands by their depth in the tree: blue, green, magenta, orange, repeated."""
HIDDEN = 0.3
"""Opacity of an edge that is behind a surface."""
NEAR = 1e-6
"""Edges are clipped where their depth is below this fraction of their length, since closer points cannot be
projected."""


@dataclass(frozen=True, slots=True)
class Box:
    """The bounding box of a node: corners of shape (3,), infinite where unbounded. `depth` 0 is the scene's box."""

    name: str
    lower: Array
    upper: Array
    depth: int


def boxes_of(scene: Scene) -> list[Box]:
    """The boxes of the scene and of the operands of its booleans, outermost first, without empty ones.

    Parts inside a transform or a repetition are omitted, because their boxes are in another space.
    """
    found: list[Box] = []
    pending = [(scene.node, 0)]
    for node, depth in pending:
        if not node.facts.empty:
            found.append(Box(node.name, node.facts.lower, node.facts.upper, depth))
        pending += [(child, depth + 1) for child in _operands(node)]
    return found


def _operands(node: Node) -> Iterator[Node]:
    """The operands of a boolean in the same space; materials around it are skipped."""
    while node.label is not None and node.definition.arity != "many":
        (node,) = node.children
    if node.definition.arity == "many":
        yield from node.children


def edges_of(box: Box, far: float) -> Iterator[tuple[Array, Array]]:
    """The two end points of each edge, each of shape (3,). Edges at infinity are omitted; infinite edges are clipped at
    `far` from the origin."""
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        ends = [(box.lower[k], box.upper[k]) for k in others]
        for u in ends[0]:
            for v in ends[1]:
                if np.isfinite(u) and np.isfinite(v):
                    a, b = np.empty(3), np.empty(3)
                    a[others] = b[others] = u, v
                    a[axis], b[axis] = max(box.lower[axis], -far), min(box.upper[axis], far)
                    yield a, b


def draw_boxes(picture: Array, depth: NDArray[np.floating], pose: Pose, boxes: list[Box], far: float) -> Array:
    """Draw boxes over a picture, sRGB (H, W, 3). Edges behind the surfaces of `depth`, (H, W), are translucent."""
    made = np.array(picture, np.float64)
    for box in reversed(boxes):  # the outermost last, over those that coincide with it
        color = np.array(OUTERMOST if box.depth == 0 else INNER[(box.depth - 1) % len(INNER)])
        for a, b in edges_of(box, far):
            rows, columns, distance = project(a, b, pose, depth.shape)
            opacity = np.where(distance <= depth[rows, columns] * (1 + 1e-3), 1.0, HIDDEN)[:, None]
            made[rows, columns] = opacity * color + (1 - opacity) * picture[rows, columns]
    return made


def project(a: Array, b: Array, pose: Pose, shape: tuple[int, ...]) -> tuple[NDArray[np.int_], NDArray[np.int_], Array]:
    """Project a line segment from a to b onto a picture of `shape` (H, W): rows and columns of its pixels, each once,
    and its distance from the camera there."""
    height, width = shape[:2]
    start, end = ((p - pose.position) @ pose.frame for p in (a, b))
    cut = _in_front(start, end)
    if cut is None:
        return np.empty(0, int), np.empty(0, int), np.empty(0)
    start, end = cut

    def screen(p: Array) -> Array:
        flat = p[:2] / (-p[2] * pose.tan_half_fov if pose.half_height is None else pose.half_height)
        return np.array([0.5 * (width + flat[0] * height), 0.5 * height * (1.0 - flat[1])])

    first, last = screen(start), screen(end)
    inside = _within(first, last, (width, height))
    if inside is None:
        return np.empty(0, int), np.empty(0, int), np.empty(0)
    s0, s1 = inside
    steps = int(np.ceil(np.abs(last - first).max() * (s1 - s0))) + 1
    s = np.linspace(s0, s1, steps)
    at = first + s[:, None] * (last - first)
    columns, rows = (np.clip(at[:, k].astype(int), 0, n - 1) for k, n in ((0, width), (1, height)))
    # the reciprocal of the depth, and the point divided by the depth, are linear on the screen
    if pose.orthographic:
        return rows, columns, -start[2] - s * (end[2] - start[2])
    w = (1 - s) / -start[2] + s / -end[2]
    points = ((1 - s)[:, None] * start / -start[2] + s[:, None] * end / -end[2]) / w[:, None]
    return rows, columns, np.linalg.norm(points, axis=1)


def _in_front(start: Array, end: Array) -> tuple[Array, Array] | None:
    """Clip a segment, in the camera's frame, to the part in front of the camera."""
    near = NEAR * float(np.linalg.norm(end - start)) + 1e-12
    if max(-start[2], -end[2]) <= near:
        return None
    ends = []
    for p, other in ((start, end), (end, start)):
        ends.append(p if -p[2] >= near else p + (other - p) * ((-near - p[2]) / (other[2] - p[2])))
    return ends[0], ends[1]


def _within(first: Array, last: Array, size: tuple[int, int]) -> tuple[float, float] | None:
    """Clip a segment on the screen to the picture (Liang and Barsky 1984); returns its range of parameters, 0 to 1."""
    low, high = 0.0, 1.0
    for p, q, n in zip(first, last, size, strict=True):
        delta = q - p
        if delta == 0.0:
            if not 0.0 <= p < n:
                return None
            continue
        bounds = sorted(((0.0 - p) / delta, (n - p) / delta))
        low, high = max(low, bounds[0]), min(high, bounds[1])
    return (low, high) if low <= high else None
