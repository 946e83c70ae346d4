"""The scene that these tests measure, and a renderer whose errors and times are known."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

import raymarch as rm
from raymarch.gpu.prepare import prepare

SIZE = (64, 36)


def make_scene(color: tuple[float, float, float] = (0.8, 0.8, 0.8)) -> rm.Scene:
    parts = rm.box((1.5, 1, 1)).rotate(0.5), rm.sphere(0.6).translate((0.9, 0.3, 0.4)), rm.plane(offset=-0.6)
    solid = rm.union(*parts, k=1e-3)  # solids in a blend are marched, not hit in closed form
    solid = solid.material(rm.Material(color=color))
    return rm.Scene(solid, camera=rm.Camera(position=(1.5, 1.2, 4), target=(0, 0.5, 0)), lights=[rm.Sun(shadow=True)])


@dataclass
class FakeRenderer:
    """Draws the truth plus an error of `epsilon` pixels, in 1 / `epsilon` milliseconds; 16 steps find nothing."""

    known: Any
    kept: int = 1
    calls: list[rm.Quality] = field(default_factory=list)
    clock: Any = field(default_factory=lambda: SimpleNamespace(kind="wall clock", verdict="ours", by_cpu=False))
    context: Any = field(
        default_factory=lambda: SimpleNamespace(
            backend="none", driver=SimpleNamespace(renderer="ours", vendor="us", version="1", is_software=True)
        )
    )

    def forget(self):
        pass

    def prepared(self, scene):
        return prepare(scene, size=self.known.size)

    def render(self, scene, time=0.0, params=None, outputs=("color",)):
        quality = scene.quality
        first = quality not in self.calls
        if "color" in outputs:
            self.calls.append(quality)
        epsilon = quality.near(refined=True)
        milliseconds = 1000.0 if first else 1.0 / epsilon
        depth = self.known.depth * (1.0 + epsilon * self.known.pixel)
        if quality.max_steps == 16:
            depth[:] = np.inf
        shape = depth.shape
        arrays = {
            "color": self.known.picture,
            "depth": depth,
            "normal": self.known.normal,
            "evaluations": np.full(shape, 8),
            "iterations": np.full(shape, 7),
            "done": np.isfinite(depth),
            "reach": np.zeros(shape),
        }
        timing = SimpleNamespace(compile=30.0 if first else 0.0, draw=milliseconds, first=first)
        return SimpleNamespace(timings=[timing], milliseconds=milliseconds, array=arrays.__getitem__)
