"""Cases of metal: light that goes from facet to facet before it leaves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import raymarch as rm
from tests.hard.world import Figure, World, case

LEAST, MOST = 0.97, 1.005
CAMERA = rm.Camera((0, 0, 6), (0, 0, 0), fov=20)
ROUGH = (0.0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0)
METAL = (0.0, 0.3, 0.7, 1.0)


def even_suns(n: int) -> list[rm.Light]:
    """Suns from all around, as bright together as a white sky."""
    k = np.arange(n) + 0.5
    z, turn = 1 - 2 * k / n, k * 2.399963229728653
    r = np.sqrt(1 - z * z)
    return [rm.Sun((x, y, w), intensity=4 / n) for x, y, w in zip(r * np.cos(turn), r * np.sin(turn), z, strict=True)]


def furnace(world: World, roughness: float, metalness: float, samples: int, size: Any, **light: Any) -> Any:
    """What a white sphere in a white room gives back, pixel by pixel off the silhouette, and at every angle."""
    skin = rm.Material(albedo=(1, 1, 1), metalness=metalness, roughness=roughness)
    quality = rm.Quality(samples=samples, masking=light.pop("masking", "correlated"))
    scene = rm.Scene(rm.sphere().material(skin), CAMERA, light.pop("lights", []), quality=quality, **light)
    frame = world.draw(scene, size, ("color", "depth"))
    hit = np.isfinite(frame.depth)
    hit[1:-1, 1:-1] &= hit[2:, 1:-1] & hit[:-2, 1:-1] & hit[1:-1, 2:] & hit[1:-1, :-2]
    return frame.color[hit].astype(np.float64)


@case(74, "rough white metal", before="41 % of the light at roughness 1")
def white_metal(world: World) -> Iterator[Figure]:
    """Light that other facets hide is not lost: they mirror it again. In a white room metal is as white as the room, by
    the sky's mean light, by lights, and by light that bounces."""
    for masking in ("correlated", "separable"):
        found = [
            furnace(world, r, m, 1, (64, 48), sky=rm.Sky((1, 1, 1), light=True), masking=masking)
            for r in ROUGH
            for m in METAL
        ]
        yield from limits(f"the sky's light, {masking}", found)
        suns = even_suns(1024)
        found = [
            furnace(world, r, m, 1, (24, 18), lights=suns, sky=(0, 0, 0), masking=masking)
            for r in (0.6, 0.8, 1.0)
            for m in (0.5, 1.0)
        ]
        yield from limits(f"1,024 suns, {masking}", found)
        bounced = [
            furnace(world, r, m, 64, (24, 18), sky=(1, 1, 1), bounces=1, masking=masking).mean()
            for r in ROUGH
            for m in (0.5, 1.0)
        ]
        yield from limits(f"bounces, {masking}", bounced)


def limits(what: str, found: list[Any]) -> Iterator[Figure]:
    yield Figure(
        f"most light that white metal loses, {what}", 1 - min(np.min(f) for f in found), 1 - LEAST, "energy: given back"
    )
    yield Figure(
        f"most light that white metal adds, {what}", max(np.max(f) for f in found) - 1, MOST - 1, "energy: none is made"
    )
