"""The inputs of a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from raymarch.plan import lights
from raymarch.scene.camera import Pose
from raymarch.scene.scene import Scene

FEW = 8
"""Samples of light up to which one pass adds all."""


def progressive(scene: Scene) -> Scene:
    """The scene as the window draws it: one sample a frame, accumulated while nothing moves, and light over several
    passes if it has many samples.

    The first frame looks the same as that of the scene. One plan and one program serve moving and still pictures.
    """
    quality = scene.quality  # its edges are smoothed by the samples of the mean
    temporal = "accumulate" if quality.temporal == "off" else quality.temporal
    several = quality.lights_per_pass
    if several is None and temporal == "accumulate" and lights.splittable(scene) > FEW:
        several = "auto"
    made = quality.replace(samples=1, edges="samples", temporal=temporal, lights_per_pass=several)
    return scene if made == quality else scene.replace(quality=made)


DRAFT = {"tracer": "plain", "max_steps": 64, "epsilon": 1.0}
"""The quality of a preview."""


def preview(scene: Scene) -> Scene | None:
    """A cheap picture of a scene, which shows its shapes and materials: no shadows, reflections and ambient occlusion,
    and few steps. None if the scene has none of these but hard shadows, and so little is saved.

    scene : as `progressive` gives it.
    """
    if scene.bounces == 0 and scene.occlusion is None and not any(light.soft for light in scene.lights):
        return None
    lights = [light.replace(shadow=False) if light.shadow else light for light in scene.lights]
    return scene.replace(lights=lights, occlusion=None, bounces=0, quality=scene.quality.replace(**DRAFT))


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """The inputs of a picture: a change of any of them makes a new picture."""

    scene: Scene
    time: float
    params: Mapping[str, Any]
    pose: Pose
    view: str = "final"
    samples: int = 1

    def same(self, other: Shot | None) -> bool:
        """True if another shot gives the same picture."""
        if other is None or self.scene is not other.scene or self.view != other.view or self.time != other.time:
            return False
        mine, its = self.pose, other.pose
        return mine.same(its) and self.params == other.params
