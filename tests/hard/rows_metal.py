"""Cases of metal: light that goes from facet to facet before it leaves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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


def furnace(
    world: World, roughness: Sequence[float], metalness: Sequence[float], size: tuple[int, int], **parts: Any
) -> Iterator[Any]:
    """What a white sphere in a white room gives back, pixel by pixel off the silhouette, and so at every angle."""
    skin = rm.Material((1, 1, 1), **{name: rm.Param(name, 0.5, 0, 1) for name in ("metalness", "roughness")})
    scene = rm.Scene(rm.sphere().material(skin), CAMERA, **{"lights": [], **parts})
    for r in roughness:
        for m in metalness:
            frame = world.draw(scene, size, ("color", "depth"), params={"roughness": r, "metalness": m})
            hit = np.isfinite(frame.depth)
            hit[1:-1, 1:-1] &= hit[2:, 1:-1] & hit[:-2, 1:-1] & hit[1:-1, 2:] & hit[1:-1, :-2]
            yield frame.color[hit].astype(np.float64)


@case(74, "rough white metal", before="41 % of the light at roughness 1")
def white_metal(world: World) -> Iterator[Figure]:
    """Light that other microfacets block is not lost: they reflect it again. In a white furnace metal is white under
    the mean light of the sky, under lights, and with bounces."""
    for masking in ("correlated", "separable"):
        one, many = (rm.Quality(samples=n, masking=masking) for n in (1, 64))
        found = furnace(world, ROUGH, METAL, (48, 36), sky=rm.Sky((1, 1, 1), light=True), quality=one)
        yield from limits(f"the sky's light, {masking}", list(found))
        dark = {"sky": (0, 0, 0), "quality": one}
        found = furnace(world, (0.6, 0.8, 1.0), (0.5, 1.0), (16, 12), lights=even_suns(1024), **dark)
        yield from limits(f"1,024 suns, {masking}", list(found))
        found = furnace(world, ROUGH, (0.5, 1.0), (24, 18), sky=(1, 1, 1), bounces=1, quality=many)
        yield from limits(f"bounces, {masking}", [color.mean() for color in found])


def limits(what: str, found: list[Any]) -> Iterator[Figure]:
    yield Figure(
        f"most light that white metal loses, {what}", 1 - min(np.min(f) for f in found), 1 - LEAST, "energy: given back"
    )
    yield Figure(
        f"most light that white metal adds, {what}", max(np.max(f) for f in found) - 1, MOST - 1, "energy: none is made"
    )
