"""The draws of a frame, in their order: cones from coarse to fine, then what was asked for, once for each sample."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from raymarch.gpu.jitter import r2
from raymarch.gpu.prepare import Prepared
from raymarch.gpu.program import Program
from raymarch.gpu.store import Store
from raymarch.gpu.targets import Target
from raymarch.plan import Pass
from raymarch.plan.schedule import Level


@dataclass(frozen=True, slots=True)
class Draft:
    """A pass with its program, target and uniforms, ready to be drawn, whole or tile by tile.

    `compile` is what the driver took to compile the program for it, in milliseconds; 0 if it had been.
    """

    chosen: Pass
    program: Program
    target: Target
    uniforms: Mapping[str, Any]
    compile: float

    def draw(self, tile: tuple[int, int, int, int] | None = None) -> None:
        """Draw without waiting for the device; `tile` as in `Program.draw`."""
        self.program.draw(self.target, self.uniforms, tile)


@dataclass(slots=True)
class History:
    """What earlier frames left for the next one.

    Attributes
    ----------
    still : all that the picture depends on; a frame with the same goes on from it.
    samples : how many of a pixel were averaged so far. cones : whether the frame drew its cones itself.
    """

    still: Any = None
    samples: int = 0
    cones: bool = True

    def begin(self, still: Any, keep: bool) -> None:
        """A frame of a picture: the same as before, or another, or one that takes nothing from those before."""
        self.cones = not (keep and still == self.still)
        if self.cones:
            self.still, self.samples = still, 0


def drafts_of(
    store: Store, ready: Prepared, uniforms: Mapping[str, Any], size: tuple[int, int], history: History
) -> list[Draft]:
    """All draws of a frame. `history` is brought up to date as if they had been drawn."""
    drafts: list[Draft] = []
    quality = ready.plan.scene.quality
    colored = any(chosen.name == "color" for chosen in ready.plan.passes)
    if colored:
        history.begin(still_of(ready, uniforms, size), quality.temporal != "off")
    rays = dict(uniforms)
    if ready.plan.marching.cones:
        cones, carried = _cones(store, ready, uniforms, size)
        drafts += cones if history.cones else []
        rays.update(carried, u_spent=1.0 if history.cones else 0.0)
    for chosen in ready.plan.passes:
        if chosen.name == "color" and chosen.module == "view/accumulate":
            drafts += _samples(store, ready, chosen, rays, size, history)
        elif chosen.name != "cone":
            target = store.target(chosen.name, size, chosen.textures)
            drafts.append(_draft(store, ready, chosen, target, rays))
    return drafts


def still_of(ready: Prepared, uniforms: Mapping[str, Any], size: tuple[int, int]) -> Any:
    """All that a picture depends on, as something to compare."""
    read = {name: value for name, value in uniforms.items() if name != "u_time" or ready.shader.uses_time}
    numbers = tuple(
        (
            name,
            np.asarray(value, np.float64).tobytes()
            if isinstance(value, int | float | tuple | list | np.ndarray)
            else id(value),
        )
        for name, value in sorted(read.items())
    )
    return ready.texts["color"], numbers, tuple(size)


def _draft(store: Store, ready: Prepared, chosen: Pass, target: Target, uniforms: Mapping[str, Any]) -> Draft:
    program, compiling = store.program(ready, chosen.name)
    return Draft(chosen, program, target, uniforms, compiling)


def _samples(
    store: Store, ready: Prepared, chosen: Pass, uniforms: Mapping[str, Any], size: tuple[int, int], history: History
) -> Iterator[Draft]:
    """A draw for each sample, in turn into one target and the other."""
    pair = store.pair("history", size)
    for _ in range(ready.plan.scene.quality.samples):
        own = {
            **uniforms,
            "u_history": pair.front,
            "u_keep": history.samples > 0,
            "u_jitter": r2(history.samples),
            "u_sample": history.samples,
        }
        yield _draft(store, ready, chosen, pair.back, own)
        pair.swap()
        history.samples += 1


# Cones


def _cones(
    store: Store, ready: Prepared, uniforms: Mapping[str, Any], size: tuple[int, int]
) -> tuple[list[Draft], dict[str, Any]]:
    """The draws of the levels, and what the rays take over from the last."""
    plan = ready.plan
    (chosen,) = (p for p in plan.passes if p.name == "cone")
    steps = plan.scene.quality.max_steps
    jittered = any(p.module == "view/accumulate" for p in plan.passes)
    carried: dict[str, Any] = {"u_carried_cell": (0.0, 0.0)}
    drafts = []
    for i, level in enumerate(plan.marching.schedule.levels):
        target = store.target(f"cone {i}", level.size(size), chosen.textures)
        cell, footprint = cells(level, size, jittered)
        own = {
            **uniforms,
            **carried,
            "u_cell": cell,
            "u_footprint": footprint,
            "u_cone": widest(footprint, uniforms["u_pixel"]),
            "march_steps": max(1, round(level.share * steps)),
        }
        drafts.append(_draft(store, ready, chosen, target, own))
        carried = {"u_carried": target, "u_carried_cell": cell}
    rays = {
        "u_cell": (1.0, 1.0),
        "u_footprint": (0.5, 0.5) if jittered else (0.0, 0.0),
        "u_cone": 0.0,
        "march_steps": max(1, round(plan.marching.schedule.share * steps)),
    }
    return drafts, {**carried, **rays}


def cells(level: Level, size: tuple[int, int], jittered: bool) -> tuple[tuple[float, float], tuple[float, float]]:
    """Width and height in pixels of a level's cells, and half the part of a cell that rays come from.

    Rays come from the middles of pixels unless they are jittered. Where cells hold whole pixels, no ray comes
    from the outer half pixel of a cell.
    """
    cell, footprint = [], []
    for pixels, count in zip(size, level.size(size), strict=True):
        edge = pixels / count
        cell.append(edge)
        footprint.append(0.5 * (edge - 1.0) if pixels % count == 0 and not jittered else 0.5 * edge)
    return (cell[0], cell[1]), (footprint[0], footprint[1])


def widest(footprint: tuple[float, float], pixel: float) -> float:
    """The largest distance between the direction in a cell's middle and another of its rays, both of length 1.

    footprint : half of the part that rays come from, in pixels. pixel : width of a pixel at distance 1.

    A chord of the unit sphere; for an offset h in the plane of the picture it is the longest, 2 sin(atan(h / 2)), where
    the camera's axis halves it. Padded by 2 ulp, by which directions are rounded.
    """
    offset = math.hypot(*footprint) * pixel
    return 2.0 * math.sin(math.atan(0.5 * offset)) + 2.0**-22
