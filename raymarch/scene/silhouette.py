"""The scene that shows what share of the sky is seen in each pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from raymarch.errors import Location
from raymarch.expr.convert import instance, optional
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import vec3, where
from raymarch.scene.fog import COLOR, LENGTH, SKY_DISTANCE, Atmosphere
from raymarch.scene.light import Light
from raymarch.scene.post import PostEffect
from raymarch.scene.scene import Scene
from raymarch.scene.sky import Sky
from raymarch.scene.value import value

WHITE = Sky((1, 1, 1))


@value
class Veil(Atmosphere):
    """Black surfaces and lights before the sky. fog : of the scene, which dims the sky."""

    fog: Atmosphere | None

    def __init__(self, fog: Atmosphere | None) -> None:
        self._set(fog=optional(instance, "Veil: fog", fog, Atmosphere, "one Fog(...), one Medium(...) or None"))

    @property
    def covers_sky(self) -> bool:
        return self.fog is not None and self.fog.covers_sky

    @property
    def box(self) -> Sequence[Sequence[float]] | None:
        return None if self.fog is None else self.fog.box

    @property
    def expressions(self) -> list[Expr]:
        """All values that may depend on parameters or time."""
        return [] if self.fog is None else self.fog.expressions

    def moved(self, origin: Any) -> Veil:
        """The same, relative to an origin."""
        return self if self.fog is None else Veil(self.fog.moved(origin))

    def applied(self, sky: Sky, lights: Sequence[Light], place: Location | None) -> Expr:
        """The radiance that arrives at ORIGIN of COLOR: of a surface none."""
        passed = COLOR if self.fog is None or not self.covers_sky else self.fog.absorbing().applied(sky, (), place)
        return where(LENGTH < SKY_DISTANCE, vec3(0.0), passed)


def silhouette(scene: Scene, samples: int, sky: Sky = WHITE, post: tuple[PostEffect, ...] = ()) -> Scene:
    """The scene in which the sky alone shines. Its colour is that fraction of the sky which surfaces, visible lights
    and fog let through.

    samples : of which the picture is the mean. sky, post : in place of the white sky and of no post effect.
    """
    quality = replace(scene.quality, samples=samples, temporal="off", steps_per_pass=None, lights_per_pass=None)
    seen, fog = [light for light in scene.lights if light.visible], Veil(scene.fog)
    return scene.replace(lights=seen, sky=sky, fog=fog, bounces=0, occlusion=None, quality=quality, post=post)
