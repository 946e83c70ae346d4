"""Proofs of hard shadows: what each ray from a hit to a light meets, held against a picture that shows it alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import bound
from raymarch.gpu.renderer import Renderer
from raymarch.proof.parts import Operands
from raymarch.proof.rays import Rays
from raymarch.proof.rounding import Array
from raymarch.proof.search import CONTRADICTED, OPEN, PROVED, Given, Verdict, judge
from raymarch.proof.search import free as unhindered
from raymarch.scene.light import Light
from raymarch.scene.light_kinds import RectLight, SphereLight
from raymarch.scene.material import Material
from raymarch.scene.parameter import ParamValue, Values
from raymarch.scene.scene import Scene
from raymarch.scene.sky import Sky
from raymarch.sdf.evaluation import evaluate_gradient
from raymarch.sdf.labels import relabelled
from raymarch.sdf.node import Node
from raymarch.truth.light import Incoming, incoming

NOT_ASKED = 3
"""The state of a pixel whose shadow is not asked for: no hit is proved there, the light does not reach it, or the
picture of the light shows another hit, as it may at a silhouette."""

LIFTS = (0.1, 1.0, 4.0)
"""Where the rays to a light start above the hit, in tolerances. Where they disagree, the hit is at the edge of what
touches it."""

FACING = 0.02
"""Least cosine between normal and light: below, a picture does not show whether light arrives."""

AWAY = 0.25
"""Cosine between normal and ray from which a hit is on the far side of a thin solid. Normals that face away by less are
those of silhouettes, as in the shader."""

MOST = 1 << 20
"""Ways from hits to lights that are searched; the others stay open."""

TILE = 1 << 14
"""Ways that are judged together."""

AROUND = 8
"""Rays beside that of a dark pixel which nothing blocks."""

_WHITE = Material(color=(1.0, 1.0, 1.0), specular=0.0, ambient=0.0)


@dataclass(slots=True, eq=False)
class Shadows:
    """What is proved about the hard shadow of one light.

    light : its index in `scene.lights`, from 0. name : its class.
    state : (H, W) uint8. 0 proved: the picture is lit, and nothing on the way to the light is deeper than the
        tolerance; or it is dark, and a solid is on the way. 1 contradicted. 2 open. 3 not asked: no hit is proved, the
        light does not reach the surface, or the picture of the light has another hit at a silhouette.
    unsearched : pixels among the open ones whose way to the light was not searched, behind those of others.
    """

    light: int
    name: str
    state: NDArray[np.uint8]
    unsearched: int = 0

    def count(self, state: int) -> int:
        """Number of pixels with a state."""
        return int(np.sum(self.state == state))

    @property
    def asked(self) -> int:
        """Number of pixels whose shadow is asked for."""
        return self.state.size - self.count(NOT_ASKED)

    def __str__(self) -> str:
        parts = [f"{self.count(PROVED):,} of {self.asked:,} hard shadows of {self.name} {self.light} proved"]
        parts += [f"{count:,} {word}" for state, word in _WORDS if (count := self.count(state))]
        parts += [f"{self.unsearched:,} beyond {MOST:,} ways to lights"] if self.unsearched else []
        return ", ".join(parts)


_WORDS = ((CONTRADICTED, "contradicted"), (OPEN, "open"))


@dataclass(frozen=True, slots=True, eq=False)
class Lit:
    """Proved hits: the camera's rays and the distances along them, points, unit normals of the visible side,
    tolerances, the pixels they belong to, and the shape (H, W) of the picture."""

    rays: Rays
    points: Array
    normals: Array
    within: Array
    depth: Array
    pixels: NDArray[np.int64]
    shape: tuple[int, ...]

    def __getitem__(self, rows: NDArray[np.int64]) -> Lit:
        own = (self.rays, self.points, self.normals, self.within, self.depth, self.pixels)
        return Lit(*(each[rows] for each in own), shape=self.shape)  # type: ignore[arg-type, misc]  # all fields in order

    @classmethod
    def seen(
        cls,
        node: Node,
        values: Values,
        rays: Rays,
        depth: Array,
        within: Array,
        pixels: NDArray[np.int64],
        shape: tuple[int, ...],
    ) -> Lit:
        """Hits of rays at some distances."""
        directions = rays.directions
        points = rays.origins + depth[:, None] * directions
        with bound(values.params, values.time):
            gradient = evaluate_gradient(node, points) if len(points) else np.zeros((0, 3))
        size = np.linalg.norm(gradient, axis=1)
        normals = gradient / np.where(size > 0.0, size, 1.0)[:, None]
        turned = np.sum(normals * directions, axis=1) > AWAY
        return cls(rays, points, np.where(turned[:, None], -normals, normals), within, depth, pixels, shape)


def lit_pixels(
    scene: Scene,
    channels: Sequence[Sequence[Light]],
    size: tuple[int, int],
    time: float,
    params: Mapping[str, ParamValue] | None,
) -> tuple[NDArray[np.bool_], Array]:
    """Which pixels of a white copy of the scene lights reach, (H, W, 3): the tracer's verdict about their shadows; and
    the depths of these pixels. channels : at most three, the lights that are drawn in red, green and blue."""
    lights = [light.replace(color=tuple(np.eye(3)[number])) for number, own in enumerate(channels) for light in own]
    alone = scene.replace(
        node=relabelled(scene.node, lambda _: _WHITE).material(_WHITE),
        lights=lights,
        sky=Sky((0.0, 0.0, 0.0)),
        fog=None,
        occlusion=None,
        bounces=None,
        post=(),
        quality=scene.quality.replace(samples=1, temporal="off", lights_per_pass=None),
    )
    known = {name: value for name, value in (params or {}).items() if name in alone.parameters}
    with Renderer(size) as renderer:
        frame = renderer.render(alone, time, known, outputs=("color", "depth"))
    return np.asarray(frame.color) > 0.0, np.asarray(frame.depth, np.float64)


Draw: TypeAlias = Callable[[Sequence[Sequence[int]]], tuple[NDArray[np.bool_], Array]]


def shadows_of(
    scene: Scene,
    values: Values,
    far: float,
    found: Lit,
    draw: Draw,
    progress: Callable[[float], None] | None = None,
) -> tuple[Shadows, ...]:
    """The verdicts about the shadows of all lights that have hard ones.

    far : where camera rays end. draw : of the indices of lights, drawn in up to three colours, where they reach the
    surface, (H, W, 3), and the depths there; called for lights that may reach a hit.
    """
    lights = hard_lights(scene, values)
    result = {
        index: Shadows(index, type(scene.lights[index]).__name__, np.full(found.shape, NOT_ASKED, np.uint8))
        for index in lights
    }
    pictures = _pictures({index: _lights_up(scene.lights[index], values, far, found) for index in lights})
    operands = Operands(scene.node, values, "shadow", whole=False)
    searched = 0
    for done, channels in enumerate(pictures):
        lit, depth = draw(channels)
        near = np.abs(depth.ravel()[found.pixels] - found.depth) <= found.within
        same = found[np.flatnonzero(near)]
        drawn = Lit.seen(
            scene.node, values, same.rays, depth.ravel()[same.pixels], same.within, same.pixels, found.shape
        )
        asked = [
            _asked(scene.lights[index], values, far, (same, drawn), lit.reshape(-1, 3)[same.pixels, number], index)
            for number, own in enumerate(channels)
            for index in own
        ]
        ways = Ways._make(np.concatenate(each) for each in zip(*asked, strict=True))
        if progress is not None:
            progress((done + 0.5) / len(pictures))
        for first in range(0, len(ways.hits), TILE):
            part = Ways._make(each[first : first + TILE] for each in ways)
            searched += len(part.hits)
            hits = same[part.hits]
            own = _verdicts(operands, hits, part) if searched <= MOST else np.full(len(part.hits), OPEN, np.uint8)
            for index in np.unique(part.light):
                of = part.light == index
                result[index].state.ravel()[hits.pixels[of]] = own[of]
                result[index].unsearched += int(of.sum()) * (searched > MOST)
            if progress is not None:
                progress((done + 0.5 + 0.5 * min(first + TILE, len(ways.hits)) / len(ways.hits)) / len(pictures))
    if progress is not None:
        progress(1.0)
    return tuple(result.values())


def _lights_up(light: Light, values: Values, far: float, found: Lit) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which hits a light may reach on their front, and which ones at all, or somewhat nearer, for rounding."""
    reached, at = _reached(light, values, far, (found,))[:2]
    off = 0.01 * np.minimum(at.distance, far)[:, None] * at.direction
    nearer = incoming(light, values, found.points + off, far)
    return reached, np.maximum(at.radiance, nearer.radiance).max(axis=1) > 0.0


def _pictures(
    lit: Mapping[int, tuple[NDArray[np.bool_], NDArray[np.bool_]]],
) -> list[list[list[int]]]:
    """Lights that are drawn together, in three colours: no two of one colour reach the same hit, so that each is seen
    alone. lit : by light, as of `_lights_up`."""
    colors: list[tuple[NDArray[np.bool_], list[int]]] = []
    for index, (reached, hits) in lit.items():
        if not reached.any():
            continue
        for taken, own in colors:
            if not np.any(taken & hits):
                taken |= hits
                own.append(index)
                break
        else:
            colors.append((hits.copy(), [index]))
    return [[own for _, own in colors[i : i + 3]] for i in range(0, len(colors), 3)]


def _reached(
    light: Light, values: Values, far: float, hits: Sequence[Lit]
) -> tuple[NDArray[np.bool_], Incoming, Array]:
    """Which hits a light may reach, with the incident light and the least cosine."""
    at = incoming(light, values, hits[0].points, far)
    facing = np.min([np.sum(each.normals * at.direction, axis=1) for each in hits], axis=0)
    return (facing > FACING) & (at.radiance.max(axis=1) > 0.0), at, facing


class Ways(NamedTuple):
    """N ways from hits to lights, (N,) or (N, 3): the hit, the unit direction and the length, the cosine at the
    surface, whether a picture is lit, and the index of the light."""

    hits: NDArray[np.int64]
    directions: Array
    distance: Array
    facing: Array
    lit: NDArray[np.bool_]
    light: NDArray[np.int64]


def _asked(light: Light, values: Values, far: float, hits: tuple[Lit, Lit], lit: NDArray[np.bool_], index: int) -> Ways:
    """The ways to one light. hits : those that are proved, and those of the picture of the light. At an edge they may
    have other normals."""
    reached, at, facing = _reached(light, values, far, hits)
    rows = np.flatnonzero(reached)
    return Ways(rows, at.direction[rows], at.distance[rows], facing[rows], lit[rows], np.full(len(rows), index))


def _verdicts(operands: Operands, found: Lit, ways: Ways) -> NDArray[np.uint8]:
    """The states of some ways to lights, each from its hit in `found`."""
    n, lit, within, points = len(ways.lit), ways.lit, found.within, found.points
    free, blocked = np.ones(n, bool), np.ones(n, bool)
    for lift in LIFTS:
        away = lift * within
        origins = points + away[:, None] * found.normals
        rays = Rays(np.ascontiguousarray(origins), np.ascontiguousarray(ways.directions))
        start, end = np.zeros(n), np.maximum(ways.distance - away, 0.0)
        verdict = judge(Given(operands, rays, start, end, np.full(n, np.inf), within, within / 64.0))
        free &= verdict.state == PROVED
        blocked &= verdict.state == CONTRADICTED
    doubtful = np.flatnonzero(free & ~lit)
    if len(doubtful):  # what is no deeper than the tolerance does not count above, and darkens a picture
        beside = within[doubtful]
        start = LIFTS[0] * beside / ways.facing[doubtful]  # off the surface of the hit
        last = np.maximum(ways.distance[doubtful] - 0.01 * beside, 0.0)  # a light on a surface is not blocked by it
        thin = _thin(operands, points[doubtful], ways.directions[doubtful], start, last, beside)
        blocked[doubtful] |= thin == CONTRADICTED
        free[doubtful] &= thin == PROVED
    near = np.zeros(n, bool)
    for i in np.flatnonzero(free & ~lit):  # off its own surface
        begin = 3.0 * within[i] / ways.facing[i]
        near[i] = _nearly_touched(
            operands, points[i], ways.directions[i], float(begin), float(end[i]), float(within[i])
        )
    agrees, differs = (lit & free) | (~lit & blocked), (lit & blocked) | (~lit & free & ~near)
    return np.where(agrees, PROVED, np.where(differs, CONTRADICTED, OPEN)).astype(np.uint8)


def _thin(
    operands: Operands, origins: Array, directions: Array, start: Array, end: Array, within: Array
) -> NDArray[np.uint8]:
    """What rays meet if solids count that are no deeper than the tolerance: PROVED for nothing at all, CONTRADICTED for
    a solid, else OPEN."""
    rays = Rays(np.ascontiguousarray(origins), np.ascontiguousarray(directions))
    given = Given(operands, rays, start, end, np.full(len(end), np.inf), within, within / 1024.0)
    verdict = Verdict.unknown(end)
    unhindered(given, operands.met(rays, start, end), end, given.shortest, verdict, slivers=False)
    found = np.where(verdict.high <= end, CONTRADICTED, np.where(verdict.low < end, OPEN, PROVED))
    return found.astype(np.uint8)


def _nearly_touched(
    operands: Operands, origin: Array, direction: Array, start: float, end: float, within: float
) -> bool:
    """True if a ray beside a free one, by two tolerances, is blocked: the pixel is at the edge of a shadow."""
    across = np.linalg.svd(direction[None])[2][1:]
    turns = 2.0 * np.pi * np.arange(AROUND) / AROUND
    around = np.cos(turns)[:, None] * across[0] + np.sin(turns)[:, None] * across[1]
    rays = Rays(origin + 2.0 * within * around, np.repeat(direction[None], AROUND, axis=0))
    first, last, beside = (np.full(AROUND, length) for length in (min(start, end), end, within))
    given = Given(operands, rays, first, last, np.full(AROUND, np.inf), beside, beside / 64.0)
    return bool(np.any(judge(given).state != PROVED))


def hard_lights(scene: Scene, values: Values) -> list[int]:
    """The indices of the lights with hard shadows."""
    return [
        i
        for i, light in enumerate(scene.lights)
        if light.shadow
        and not light.soft
        and not isinstance(light, (SphereLight, RectLight))
        and _shines(light, values)
    ]


def _shines(light: Light, values: Values) -> bool:
    return float(np.max(values.of(light.radiance))) > 0.0
