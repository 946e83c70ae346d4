"""Incident light of emitters and soft shadows in float64."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.node import Expr, var
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import get, record
from raymarch.expr.walk import free_variables, substitute
from raymarch.scene.light import (
    DIRECTION,
    DIRECTION_SAMPLE,
    FAR,
    LIGHT,
    POINT,
    SAMPLE,
    Light,
    above_horizon,
    density_of,
    eval_disc,
    part_above_horizon,
    pdf_disc,
    ray_hit_of,
    sample_disc,
    sample_of,
)
from raymarch.scene.parameter import Values
from raymarch.sdf.facts import Facts
from raymarch.truth.rays import Rays

Array = NDArray[np.float64]

MAX_STEPS = 5_000
"""Maximum steps of a soft shadow; after these the visibility found so far is used."""


@dataclass(frozen=True, slots=True)
class Incoming:
    """Light at N points: unit directions towards its source (N, 3), distances (N,), radiance (N, 3)."""

    direction: Array
    distance: Array
    radiance: Array


def incoming(light: Light, values: Values, points: Array, far: float, u: tuple[float, float] = (0.5, 0.5)) -> Incoming:
    """Incident light of an emitter at some points, by its `sample_direction`.

    far : far distance of camera rays. No two points of the scene are farther apart than twice that. u : the random
    numbers of a light with an area.
    """
    shape = points.shape
    with bound(values.params, values.time):
        found = evaluator(sample_of(light), [POINT, SAMPLE, FAR])
        direction, distance, radiance = found(
            points, np.broadcast_to(u, (len(points), 2)), np.full(len(points), 2.0 * far)
        )
    return Incoming(
        np.broadcast_to(direction, shape), np.broadcast_to(distance, shape[:1]), np.broadcast_to(radiance, shape)
    )


GOLDEN_ANGLE = (3.0 - math.sqrt(5.0)) / 2.0
"""Of a turn: the angle between successive points of a spiral that covers a disc evenly (Vogel 1979)."""

DISC_SAMPLES = 64
"""Number of points that replace the shader's random point on the disc of a light."""


LOBE_SAMPLES = 64
"""Number of directions that replace the shader's random direction of a lobe."""


def lobe_numbers() -> Array:
    """Random numbers for directions of lobes, evenly spread, (`LOBE_SAMPLES`, 3)."""
    plastic = 1.2207440846057596  # x^4 = x + 1: its inverse powers fill a cube evenly (Roberts 2018)
    steps: Array = (np.arange(LOBE_SAMPLES)[:, None] / plastic ** np.arange(1, 4) + 0.5) % 1.0
    return steps


def area_samples(light: Light) -> list[tuple[float, float]]:
    """Random numbers for the reference: evenly spread for a light with an area, else a single pair."""
    if SAMPLE not in free_variables(sample_of(light)):
        return [(0.5, 0.5)]
    side = math.isqrt(DISC_SAMPLES)
    return [((i + 0.5) / side, (j + 0.5) / side) for i in range(side) for j in range(side)]


_DIRECTION, _DISTANCE, _RADIANCE = var("direction", VEC3), var("distance", FLOAT), var("radiance", VEC3)
_WIDTH, _NORMAL = var("width", FLOAT), var("normal", VEC3)
_CENTRE, _GIVEN = record(LIGHT, _DIRECTION, _DISTANCE, _RADIANCE), [_DIRECTION, _DISTANCE, _RADIANCE, _WIDTH]


def _parts(light: Expr) -> list[Expr]:
    return [get(light, name) for name in ("direction", "distance", "radiance")]


_DISC_MET = evaluator(_parts(eval_disc(_CENTRE, _WIDTH, DIRECTION)), [*_GIVEN, DIRECTION])
_DISC_DENSITY = evaluator([pdf_disc(_CENTRE, _WIDTH, DIRECTION)], [*_GIVEN, DIRECTION])
_POINT_OF_DISC = evaluator(_parts(sample_disc(_CENTRE, _WIDTH, SAMPLE)), [*_GIVEN, SAMPLE])
_ABOVE = evaluator(
    [*_parts(above_horizon(_CENTRE, _WIDTH, _NORMAL)), part_above_horizon(_CENTRE, _WIDTH, _NORMAL)],
    [*_GIVEN, _NORMAL],
)


def met_by(light: Light, values: Values, points: Array, far: float, directions: Array) -> Incoming:
    """Incident light from some directions, (N, 3), by the light's `eval_direction`."""
    density = density_of(light)
    assert density is not None
    with bound(values.params, values.time):
        found = evaluator(density[0], [POINT, DIRECTION, FAR])
        direction, distance, radiance = found(points, directions, np.full(len(points), 2.0 * far))
    return Incoming(direction, distance, np.broadcast_to(radiance, points.shape))


def light_density(light: Light, values: Values, points: Array, incident: Incoming) -> Array:
    """The density of incident light by the light's `pdf_direction`, (N,)."""
    density = density_of(light)
    assert density is not None
    symbols = {name: var(name, type) for name, type in LIGHT.fields}
    pdf = substitute([density[1]], {DIRECTION_SAMPLE: record(LIGHT, *symbols.values())})[0]
    with bound(values.params, values.time):
        found = evaluator([pdf], [POINT, *symbols.values()])
        result = found(points, incident.direction, incident.distance, incident.radiance)[0]
    return np.broadcast_to(result, incident.distance.shape)


def disc_met(incident: Incoming, width: Array, directions: Array) -> Incoming:
    """The light of a disc from some directions, (N, 3)."""
    return Incoming(*_DISC_MET(incident.direction, incident.distance, incident.radiance, width, directions))


def disc_density(centre: Incoming, width: Array, incident: Incoming) -> Array:
    """The density of the points of a disc, (N,)."""
    return np.asarray(_DISC_DENSITY(centre.direction, centre.distance, centre.radiance, width, incident.direction)[0])


def disc_samples(incident: Incoming, width: Array) -> Iterator[Incoming]:
    """The same light from evenly spread points of its disc; `width` is the sine of its angular radius, (N,)."""
    for k in range(DISC_SAMPLES):
        u = np.broadcast_to(((k + 0.5) / DISC_SAMPLES, (k * GOLDEN_ANGLE + 0.25) % 1.0), (len(width), 2))
        yield Incoming(*_POINT_OF_DISC(incident.direction, incident.distance, incident.radiance, width, u))


def of_sphere(incident: Incoming, width: Array, normals: Array) -> tuple[Incoming, Array]:
    """The light of a sphere that horizons may cut, and the part of it above them, (N,)."""
    *found, part = _ABOVE(incident.direction, incident.distance, incident.radiance, width, normals)
    return Incoming(*found), part


def lights_shown(
    lights: Sequence[Light], values: Values, origins: Array, directions: Array, ends: Array
) -> tuple[Array, Array]:
    """Radiance, (N, 3), and distance of the nearest visible light before the end of each ray, (N,); inf for none.

    A light that touches a surface is in front of it.
    """
    color, nearest = np.zeros_like(directions), np.full(len(directions), np.inf)
    for light in lights:
        hit = ray_hit_of(light, light.emitter_values())
        if hit is None:
            continue
        with bound(values.params, values.time):
            found = evaluator([*hit], [POINT, DIRECTION])
            distance, _, radiance = found(np.broadcast_to(origins, directions.shape), directions)
        distance = np.broadcast_to(distance, ends.shape)
        first = (distance > 0.0) & (distance < nearest) & (distance <= ends * (1.0 + 1e-6))
        color[first], nearest[first] = np.broadcast_to(radiance, color.shape)[first], distance[first]
    return color, nearest


def soft_visibility(
    penumbra: str,
    width: Array,
    field: Callable[[Array], Array],
    rays: Rays,
    box: Facts,
    near: Array,
    end: Array,
    divisor: float = 1.0,
) -> Array:
    """Visible fraction of a soft light along each ray, (N,), by a method of `penumbra`.

    width : sine of the light's angular radius, (N,). field : distances, positive outside; over the divisor they are
    safe steps. near : start of the rays, > 0. end : distance of the light.

    These forms approximate the visible fraction of the disc. They are evaluated with the steps of the shader, in
    float64. `tests/truth/test_truth_soft_shadows.py` measures their errors against the disc.
    """
    s, stop = _inside_cone(rays, box, width, near, end)
    rule = {"two-sided": _TwoSided, "cone": _Cone, "triangulated": _Triangulated}[penumbra](len(end))
    row = np.flatnonzero(s < stop)
    for _ in range(MAX_STEPS):
        if not row.size:
            break
        r = field(rays.at(row, s[row]))
        s[row] += rule.step(row, r, r / divisor, s[row], width[row], near[row])
        row = row[(rule.least[row] > -1.0) & (s[row] < stop[row])]
    return rule.visibility()


class _Cone:
    """The smallest clearance over the disc's radius so far, from -1 (fully occluded) to 1; (N,)."""

    def __init__(self, n: int) -> None:
        self.least = np.ones(n)

    def step(self, row: NDArray[Any], r: Array, safe: Array, s: Array, width: Array, near: Array) -> Array:
        """Update with the distances r at s on some rays, and safe steps there; returns the length of the next step."""
        least = np.minimum(self.least[row], r / (width * s))
        self.least[row] = np.where(r <= 0.125 * near, -1.0, least)
        return safe

    def visibility(self) -> Array:
        """Visible fraction of the light, (N,)."""
        result: Array = np.maximum(self.least, 0.0)
        return result


class _Triangulated(_Cone):
    """`_Cone` with the clearance between samples estimated; `last` is the previous distance, 0 for none."""

    def __init__(self, n: int) -> None:
        super().__init__(n)
        self.last, self.before = np.zeros(n), np.ones(n)

    def step(self, row: NDArray[Any], r: Array, safe: Array, s: Array, width: Array, near: Array) -> Array:
        last = self.last[row]
        z = np.where(last > 0.0, self.before[row], 1.0)
        back = np.where(last > 0.0, 0.5 * (z + (r - last) * (r + last) / z), 0.0)
        back = np.where((back < 0.0) | (back > np.minimum(z, np.abs(r))), 0.0, back)
        found = np.sqrt(np.maximum(r * r - back * back, 0.0)) / (width * np.maximum(s - back, near))
        self.least[row] = np.where(r <= 0.125 * near, -1.0, np.minimum(self.least[row], found))
        self.last[row], self.before[row] = r, safe
        return safe


class _TwoSided(_Cone):
    """`_Cone` with signed clearance: negative inside of an occluder."""

    def step(self, row: NDArray[Any], r: Array, safe: Array, s: Array, width: Array, near: Array) -> Array:
        reach = width * s
        self.least[row] = np.maximum(np.minimum(self.least[row], r / reach), -1.0)
        result: Array = np.maximum(np.maximum(0.5 * np.abs(safe), safe - width * (s + safe)), 0.05 * reach)
        return result

    def visibility(self) -> Array:
        r = self.least
        result: Array = 0.5 + (r * np.sqrt(1.0 - r * r) + np.arcsin(r)) / np.pi
        return result


def _inside_cone(rays: Rays, box: Facts, width: Array, near: Array, end: Array) -> tuple[Array, Array]:
    """Distances at which cones about the rays enter and leave a box; `width` is the sine of their half angle."""
    start, stop = near.copy(), end.copy()
    for axis in range(3):
        o, d = rays.origins[:, axis], rays.directions[:, axis]
        for side, plane in ((1.0, box.upper[axis]), (-1.0, -box.lower[axis])):
            if not np.isfinite(plane):
                continue
            slope = side * d - width
            slope = np.where(np.abs(slope) < 1e-20, 1e-20, slope)
            t = (plane - side * o) / slope
            stop = np.where(slope > 0.0, np.minimum(stop, t), stop)
            start = np.where(slope > 0.0, start, np.maximum(start, t))
    return start, stop
