"""Cases of motion: what earlier frames saw of things that move, and of the light on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.expr.node import Expr
from raymarch.expr.vocabulary import cos, sin
from raymarch.gpu import Renderer
from tests.hard.world import Figure, World, case

STEP = 1 / 30
"""Seconds between two frames."""

CHANGE = 0.004
"""Of a colour between two frames, from which a pixel counts as one that changes: about an 8-bit step."""


@dataclass(frozen=True)
class Motion:
    """A scene for a quality, and the parameters of each frame."""

    scene: Callable[[rm.Quality], rm.Scene]
    params: Callable[[int], dict[str, Any]] = lambda frame: {}


def _motions() -> dict[str, Motion]:
    t, x = rm.time, rm.Param("x", 0.0, -2.0, 2.0)
    painted = rm.Material(rm.checker((0.9, 0.5, 0.2), (0.15, 0.3, 0.7), 0.25))
    grey, green = rm.Material((0.7, 0.7, 0.7)), rm.Material((0.2, 0.8, 0.3))
    ball, cube = rm.sphere(0.6).material(painted), rm.box((0.9, 0.9, 0.9)).material(painted)
    there: Expr = 0.5 * sin(2.0 * t)

    def of(node: rm.Node, floor: rm.Material = grey, light: Any = (0.4, 0.8, 0.5), **parts: Any) -> Motion:
        lights = [rm.Sun(light, shadow=True)] if isinstance(light, tuple) else [light]
        camera = rm.Camera((0.3, 1.0, 3.0), (0, -0.2, 0), fov=45)
        whole = node | rm.plane(offset=-0.8).material(floor)
        steps = {"x": (-0.5, -0.45, -0.4, 0.1, 0.2, 0.25, 0.3, 0.2, -0.6, -0.55)}

        def scene(quality: rm.Quality) -> rm.Scene:
            return rm.Scene(whole, camera, lights, quality=quality, **parts)

        return Motion(scene, lambda frame: {n: v[frame % len(v)] for n, v in steps.items() if n in names})

    names: set[str] = set()
    made = {
        "translated": of(ball.translate((there, 0, 0))),
        "rotated under its silhouette": of(ball.rotate(t, "y")),
        "rotated": of(cube.rotate(t, (1, 2, 0.5))),
        "scaled": of(ball.scale(1 + 0.3 * sin(2.0 * t))),
        "grown": of(rm.sphere(0.5 + 0.2 * sin(2.0 * t))),
        "blended": of(
            rm.union(
                rm.sphere(0.45).material(painted).translate((-0.6 + there, 0, 0)),
                rm.box((0.7, 0.7, 0.7)).material(green).translate((0.6 - there, 0, 0)),
                k=0.3,
            )
        ),
        "twisted": of(rm.box((0.7, 1.2, 0.7)).material(painted).twist(sin(2.0 * t))),
        "shadow of what is out of sight": of(rm.box((0.5, 0.5, 0.5)).translate((there, 1.5, 0.3)), light=(0, 1, 0.2)),
        "moving light": of(ball, light=(sin(t), 1.0, 0.5 * cos(t))),
        "mirrored": of(
            rm.sphere(0.5).material(painted).translate((there, 0, 0.2)),
            floor=rm.Material((0.9, 0.9, 0.9), metalness=1.0, roughness=0.0),
            bounces=2,
        ),
    }
    names.add("x")
    made["stepped by hand"] = of(ball.translate((x, 0, 0)))
    made["light stepped by hand"] = of(ball, light=rm.PointLight((x, 2.0, 1.0), intensity=6.0, shadow=True))
    return {name: Motion(m.scene, m.params if "hand" in name else lambda frame: {}) for name, m in made.items()}


MOTIONS = _motions()


def quality_of(name: str, **parts: Any) -> rm.Quality:
    """Mirrors are followed without noise."""
    return rm.Quality(integrator="whitted", **parts) if name == "mirrored" else rm.Quality(**parts)


def rms(a: NDArray[Any], b: NDArray[Any], where: NDArray[Any]) -> float:
    return float(np.sqrt(np.mean((a - b)[where] ** 2))) if where.any() else 0.0


@dataclass(frozen=True)
class Errors:
    """Root mean square errors of a picture with a history and of one without, by where the picture changes."""

    moving: float
    moving_alone: float
    still: float
    still_alone: float


def errors_of(renderer: Renderer, name: str, frames: Sequence[int] = (10,), samples: int = 256) -> list[Errors]:
    """Of the last of some frames, for each of their numbers, against the mean of many samples of the same moment.

    The single picture has its samples in the middles of pixels. Pixels around one that changes count as changing: those
    of a silhouette are of both.
    """
    motion = MOTIONS[name]

    def draw(frame: int, **parts: Any) -> NDArray[np.float32]:
        scene = motion.scene(quality_of(name, **parts))
        return renderer.render(scene, time=0.4 + frame * STEP, params=motion.params(frame)).color

    def errors(frame: int, joined: NDArray[np.float32]) -> Errors:
        alone, truth = draw(frame), draw(frame, samples=samples)
        changes = np.abs(several(frame) - several(frame - 1)).max(axis=2) > CHANGE
        wide = np.pad(changes, 1)
        h, w = changes.shape
        still = ~np.any([wide[y : y + h, x : x + w] for y in range(3) for x in range(3)], axis=0)
        return Errors(*(rms(picture, truth, where) for where in (~still, still) for picture in (joined, alone)))

    several = cache(partial(draw, samples=16))
    renderer.forget()
    joined = [draw(frame, temporal="reproject") for frame in range(max(frames))]
    return [errors(count - 1, joined[count - 1]) for count in frames]


@case(75, "history of what moves", "rms .024 where .020 is without any")
def moved(world: World) -> Iterator[Figure]:
    """A history that follows only the camera is read at wrong positions if objects move. Positions are mapped back by
    the objects' transforms and shaded with the previous values; where the result differs, the history is discarded."""
    if world.renderer.size != (96, 72):
        world.renderer.resize((96, 72))
    for name in ("translated", "blended", "shadow of what is out of sight", "mirrored"):
        each = errors_of(world.renderer, name, (8, 9, 10, 11), samples=64)
        share = np.sqrt(sum(e.moving**2 for e in each) / sum(e.moving_alone**2 for e in each))
        quantity = f"error in what changes over that of single frames, {name}"
        yield Figure(quantity, float(share), 1.0, "never worse than alone")
