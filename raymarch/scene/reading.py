"""How far effects read the field of a scene as a distance, and the field that they read."""

from __future__ import annotations

import numpy as np

from raymarch.expr.intervals import interval_of
from raymarch.scene.light import Light
from raymarch.scene.scene import Scene, all_nodes
from raymarch.sdf.node import Node
from raymarch.sdf.tools import with_longer_tools


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
