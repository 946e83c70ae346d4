"""How effects and rays read the field of a scene: how far as a distance, and where a value of 0 is no surface."""

from __future__ import annotations

import numpy as np

from raymarch.expr.intervals import interval_of
from raymarch.scene.light import Light
from raymarch.scene.material import Material
from raymarch.scene.scene import Scene, all_nodes
from raymarch.sdf.labels import seen_labels
from raymarch.sdf.levels import may_touch, touching
from raymarch.sdf.node import Node
from raymarch.sdf.tools import with_longer_tools

MEASURED = 64
"""Maximum number of nodes of a tree of which touching children are looked for."""


def exact_distance(scene: Scene) -> float:
    """The distance to surfaces up to which effects read the field, so that it must be exact: ambient occlusion, and
    shadows of lights that have a size. Infinite if the reach of ambient occlusion has no limit."""
    found = [0.0]
    occlusion = scene.ambient_occlusion
    if occlusion is not None and occlusion.reach is not None:
        found.append(float(interval_of(occlusion.reach)[1]))
    size = largest_size(scene)
    for light in scene.lights:
        if reads_field(light):
            wide = float(interval_of(light.softness)[1]) * (1.0 if light.has_position else size)
            found.append(float(np.minimum(wide, size)))
    return float(np.max(found))


def reads_field(light: Light) -> bool:
    """True if the penumbra of a light follows from values of the field."""
    return light.soft and light.penumbra != "sampled"


def largest_size(scene: Scene) -> float:
    """The diagonal of the box around all bounded parts, or of the largest bounded part where parts are transformed
    together with unbounded ones."""
    facts = [scene.subject] if scene.subject is not None else [node.facts for node in all_nodes(scene.node)]
    return max((float(np.linalg.norm(f.size)) for f in facts if f.bounded and not f.empty), default=0.0)


def read_as_distance(scene: Scene, node: Node) -> Node:
    """The solid of a scene, or a part of it, without ends of tools that an effect would read as surfaces."""
    return with_longer_tools(node, 0.5 * exact_distance(scene))


def passes_zeros(scene: Scene, node: Node) -> bool:
    """True if rays may meet a value of 0 of a solid where it has no surface, as where glass solids touch."""
    return may_touch(node) or touching_glass(scene, node) == {True}


def touching_glass(scene: Scene, root: Node) -> set[bool]:
    """Of the faces at which glass touches a solid: True if one of them is glass as well, False if one is not.

    Glass that touches glass is one solid, so there is no face. The surface of what it stands on is one.
    """
    if not scene.bounces or not any(material.transmits for material in scene.materials):
        return set()
    faces = touching_materials(scene, root)
    return {all(m.transmits for m in of) for of in faces if any(m.transmits for m in of)}


def touching_materials(scene: Scene, root: Node) -> list[set[Material]]:
    """The materials at each face at which solids touch."""
    pending, found = [(root, scene.materials[0])], []
    visited: set[tuple[int, Material]] = set()
    while pending and len(visited) < MEASURED:
        node, outer = pending.pop()
        if (id(node), outer) in visited:
            continue
        visited.add((id(node), outer))
        inner = outer if node.label is None else node.label
        pending += [(child, inner) for child in node.children]
        for pair in touching(node):
            sides = [node.children[i] for i in pair] if node.children else [node]
            found.append(set().union(*(seen_labels(side, inner) for side in sides)))
    return found
