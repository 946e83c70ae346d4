"""The studio in which a picture shows a bare node: what the user did not state."""

from __future__ import annotations

import math

import numpy as np

from raymarch.errors import SceneError, warn
from raymarch.expr.calls import checked
from raymarch.expr.convert import described
from raymarch.scene.ambient_occlusion import AmbientOcclusion
from raymarch.scene.light_kinds import Sun
from raymarch.scene.material import Material
from raymarch.scene.quality import Quality
from raymarch.scene.scene import DEEPEST, DEFAULT, Scene, scene_of
from raymarch.scene.sky import GradientSky
from raymarch.scene.tone import ToneMapping
from raymarch.sdf.booleans import union
from raymarch.sdf.node import Node
from raymarch.sdf.solids import box, plane

CLAY = Material(color=(0.55, 0.24, 0.1), specular=0.12, shininess=24.0, ambient=0.0)
"""Of a solid without any material: not white, so that light and shadow are seen, and unlike the ground."""

GROUND = Material(color=(0.45, 0.45, 0.45), specular=0.0, ambient=0.0)
SKY = GradientSky((0.2, 0.25, 0.34), (0.49, 0.51, 0.53), (0.12, 0.11, 0.1), light=True)
SUN = Sun((-0.55, 1.0, 0.6), (1.0, 0.94, 0.86), 1.0, shadow=True, softness=0.08)
OPEN = Sun((-0.55, 1.0, 0.6), (1.0, 0.94, 0.86), 1.0)
"""Of a solid without end, which would shade itself."""

OCCLUSION = AmbientOcclusion(steps=4)

BRIGHTEST = 1.29
"""Light of a white surface that faces the sun. A lighter solid than its inverse is exposed less, so that none clips."""

SAMPLES = 4
"""Rays per pixel of a picture of a bare node, so that edges are smooth."""


def in_studio(scene: Scene) -> bool:
    """True for a scene that `staged` made."""
    return scene.sky == SKY and scene.occlusion == OCCLUSION


@checked
def studio(solid: Node) -> Scene:
    """The scene in which `render` and the window show a solid alone, to start from.

    A ground below it, a soft sun, a lit sky, ambient occlusion, 4 rays per pixel, and clay if no part of it has a
    material. A solid without end has no ground; it is cut by a cube, with a SceneWarning, if a camera sees it from
    inside only.

    Parameters
    ----------
    solid : a node of three dimensions.

    Returns
    -------
    Scene
        Its parts are those of any scene: `replace` states others.

    Raises
    ------
    SceneError : no solid, or a flat one.

    Examples
    --------
    >>> scene = rm.studio(rm.torus()).replace(lights=[rm.Sun((1, 2, 1), shadow=True)])
    """
    if not isinstance(solid, Node):
        raise SceneError(f"studio of {described(solid)}", legal="a solid")
    made = staged(scene_of(solid))
    made._set(of_a_node=False)
    return made


def staged(scene: Scene) -> Scene:
    """The scene of a bare node in a studio, see `studio`. Any other scene, and one in a studio, is unchanged."""
    if not scene.of_a_node or in_studio(scene):
        return scene
    where, framed = scene.node.where, scene.framed
    if framed is not None and framed.cube:
        edge = framed.cube
        what = f"{scene.node.name} has no end: the picture shows a cube of edge {edge:.3g} of it"
        warn(f"{what}; Scene(node, camera=Camera(position=...)) shows it from inside", scene.where)
        scene = scene_of(scene.node & box((edge, edge, edge)))
        framed = scene.framed
    elif framed is not None and not framed.sees:
        warn(f"no place is known from which a camera sees {scene.node.name}; state Camera(position=...)", scene.where)
    node = _colored(scene.node) if scene.materials == (DEFAULT,) else scene.node
    floor = None if framed is None else framed.floor
    if floor is not None:
        node = node | plane(offset=floor).material(GROUND)
    node.where = where
    clear = any(m.transmits for m in scene.materials) and not any(m.frosted for m in scene.materials)
    lightest = max((float(np.min(m.color.data)) for m in scene.materials if m.color.is_constant), default=0.0)
    light = BRIGHTEST * lightest
    made = scene.replace(
        node=node,
        tone=ToneMapping(exposure=-math.log2(light)) if light > 1.0 else scene.tone,
        lights=[OPEN if floor is None and not _on_ground(scene.node) else SUN],
        sky=SKY,
        occlusion=OCCLUSION,
        quality=Quality(samples=SAMPLES, integrator="whitted" if clear else "path"),
        bounces=DEEPEST["whitted"] if clear else scene.bounces,
    )
    made._set(where=where, of_a_node=True)
    return made


def _on_ground(node: Node) -> bool:
    """True for a hard union of bounded and other solids, as of things on a floor."""
    return node.name == "union" and any(child.facts.bounded for child in node.children)


def _colored(node: Node) -> Node:
    """A solid without materials in the colours of the studio."""
    if not node.facts.bounded and _on_ground(node):
        return union(*(part.material(CLAY if part.facts.bounded else GROUND) for part in node.children))
    return node.material(CLAY)
