"""The scene that shows what share of each pixel is covered by surfaces."""

from __future__ import annotations

from dataclasses import replace

from raymarch.scene.fog import Fog
from raymarch.scene.post import PostEffect
from raymarch.scene.scene import Scene
from raymarch.scene.sky import Sky

BLACK = Sky((0, 0, 0))


def silhouette(
    scene: Scene, samples: int, surface: float = 1.0, sky: Sky = BLACK, post: tuple[PostEffect, ...] = ()
) -> Scene:
    """The scene with white surfaces under a black sky. Its colour is the fraction of a pixel that surfaces cover.

    samples : of which the picture is the mean. surface : level of grey of the surfaces. sky, post : in place of the
        black sky and of no post effect.
    """
    quality = replace(scene.quality, samples=samples, temporal="off", steps_per_pass=None, lights_per_pass=None)
    fog = Fog((surface,) * 3, 1e30)  # it covers surfaces, not the sky
    return scene.replace(lights=[], sky=sky, fog=fog, bounces=0, occlusion=None, quality=quality, post=post)
