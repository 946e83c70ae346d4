"""The part of a scene that one ray can meet: the reference of a pixel of a large scene needs no other objects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.scene.camera import Pose
from raymarch.sdf.booleans import hard_union
from raymarch.sdf.node import Node
from raymarch.sdf.placing import labelled

ROWS = 256
"""Rows of a picture whose pixel is the width of the ray: a hit of the picture may lie a pixel beside an object."""

SPINE = (hard_union.definition, labelled.definition)  # type: ignore[attr-defined]
"""Operators at the root of a tree that are searched for objects."""


def along_ray(root: Node, pose: Pose, origin: NDArray[Any], ray: NDArray[Any]) -> Node:
    """The tree without the operands of outermost hard unions whose bounding spheres a ray passes at more than a pixel.

    It has the same surface along the ray, and the field is never smaller. origin, ray : shape (3,), the ray unit.
    """
    above = [root]
    for node in above:
        above += [child for child in node.children if child.definition in SPINE] if node.definition in SPINE else []
    kept: dict[int, Node] = {}
    for node in reversed(above):
        children = [kept.get(id(child), child) for child in node.children]
        if node.definition is SPINE[0]:
            near = _near([child.facts for child in children], pose, origin, ray)
            children = [child for child, is_near in zip(children, near, strict=True) if is_near] or children[:1]
        if len(children) < len(node.children) or any(a is not b for a, b in zip(children, node.children, strict=True)):
            made = Node(node.definition, tuple(children), node.params, node.facts, node.label)
            made.where, made.variable = node.where, node.variable
            kept[id(node)] = made
    return kept.get(id(root), root)


def _near(facts: list[Any], pose: Pose, origin: NDArray[Any], ray: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether a ray comes within a pixel of the sphere around each box; True for boxes that are not bounded."""
    lower, upper = np.array([f.lower for f in facts]), np.array([f.upper for f in facts])
    bounded = np.isfinite(lower).all(axis=1) & np.isfinite(upper).all(axis=1)
    lower, upper = np.where(bounded[:, None], lower, 0.0), np.where(bounded[:, None], upper, 0.0)
    away, radius = 0.5 * (lower + upper) - origin, 0.5 * np.linalg.norm(upper - lower, axis=1)
    t = np.maximum(away @ ray, 0.0)
    beside = np.linalg.norm(away - t[:, None] * ray, axis=1)
    return ~bounded | (beside <= radius + pose.footprint(t + radius, ROWS))
