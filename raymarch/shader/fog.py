"""Generated code of fog between the camera and the first surface."""

from __future__ import annotations

from raymarch.scene.scene import Scene
from raymarch.shader.chunk import Lines


def keep_direction(text: Lines, scene: Scene) -> None:
    """Keep the direction of the camera ray as `view`, where `ray` is reused and the fog has the colour of the sky."""
    if scene.fog is not None and scene.fog.color is None:
        text.add("    vec3 view = ray.direction;")


def add_fog(text: Lines, scene: Scene, distance: str, direction: str) -> None:
    """Attenuate `color` by the fog over a distance along the camera ray of a direction."""
    if scene.fog is None:
        return
    line = f"    color = apply_fog(color, {distance});"
    if scene.fog.color is None:
        line = f"    color = mix(sky({direction}), color, exp(-fog_density() * {distance}));"
    text.add(line, by="Scene(fog=...)", where=scene.where)
