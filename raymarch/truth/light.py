"""Incident light of emitters and soft shadows in float64."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

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
    Dimming,
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

AT_ONCE = 1 << 17
"""Rays beside others that are marched together; this bounds the memory."""

PATIENT, LEAST_GAIN = 300, 0.05
"""Steps after which a ray of a soft shadow that grazes a surface goes on by at least this fraction of its way. The
ratio of the clearance to the way, which it looks for, changes little on such a step; without it, a few rays take as
long as all others together."""


@dataclass(frozen=True, slots=True)
class Incoming:
    """Light at N points: unit directions towards its source (N, 3), distances (N,), radiance (N, 3)."""

    direction: Array
    distance: Array
    radiance: Array


def incoming(
    light: Light,
    values: Values,
    points: Array,
    far: float,
    u: tuple[float, float] = (0.5, 0.5),
    dimming: Dimming | None = None,
) -> Incoming:
    """Incident light of an emitter at some points, by its `sample_direction`.

    far : far distance of camera rays. No two points of the scene are farther apart than twice that. u : the random
    numbers of a light with an area. dimming : as for `sample_of`.
    """
    shape = points.shape
    with bound(values.params, values.time):
        found = evaluator(sample_of(light, dimming=dimming), [POINT, SAMPLE, FAR])
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


def met_by(
    light: Light, values: Values, points: Array, far: float, dimming: Dimming | None, directions: Array
) -> Incoming:
    """Incident light from some directions, (N, 3), by the light's `eval_direction`. dimming : as for `sample_of`."""
    density = density_of(light, dimming=dimming)
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
    divisor: float | None = None,
) -> Array:
    """Visible fraction of a soft light along each ray, (N,), by a method of `penumbra`.

    width : sine of the light's angular radius, (N,). field : distances, positive outside. near : start of the rays,
    > 0. end : distance of the light. divisor : of safe steps, which are half of the distance over it; None if spheres
    of the field are proven to be empty.

    These forms approximate the visible fraction of the disc. They follow the modules `light/two_sided` and `clearance`
    of the shader, in float64. `python -m tests.lab.penumbras` measures their errors against the disc.
    """
    width = np.minimum(width, 0.999)
    start, stop = _inside_cone(rays, box, width, near, end)
    if penumbra == "triangulated":
        return _triangulated(field, rays, start, stop, width, near, divisor)
    cones = _Cones(field, rays, 0.125 * near if penumbra == "cone" else 0.0 * near, divisor)
    every = np.flatnonzero(start < stop)
    visible = np.ones(len(width))
    middle, free = cones.clearance(
        every, rays.directions[every], start[every], stop[every], width[every], penumbra != "cone"
    )
    if penumbra == "cone":
        visible[every] = np.maximum(middle, 0.0)
        return visible
    edge = np.maximum(_beside_edge(middle), 0.0)
    visible[every] = edge
    part = np.abs(middle) <= 0.95
    rows, middle, edge = every[part], middle[part], edge[part]
    start, stop = (end[part] for end in free)
    around = _free(cones.beside(rows, _HEXAGON, start, stop, width[rows], width[rows]))
    fitted, few = _by_seven(middle, edge, around)
    seen = np.zeros(len(rows))
    k = np.flatnonzero(few > 0.0)
    found = cones.beside(rows[k], _SPIRAL, start[k], stop[k], width[rows[k]], 0.15 * width[rows[k]])
    seen[k] = np.maximum(2.0 * _beside_edge(found) - 1.0, 0.0).sum(axis=0)
    seen /= 24.0
    visible[rows] = (1.0 - few) * fitted + few * 1.35 * seen / (1.0 + 0.35 * seen)
    return visible


def _by_seven(middle: Array, edge: Array, around: Array) -> tuple[Array, Array]:
    """What seven rays tell of the visible fraction, and how far they are too few, from 0 to 1."""
    rise = around.T @ _HEXAGON
    sided = np.linalg.norm(rise, axis=1)
    rise /= np.maximum(sided, 1e-6)[:, None]
    beside, sum_ = _free(np.minimum(middle + _HEXAGON @ rise.T, 1.0)), around.sum(axis=0)
    counted, expected = _counted(_free(middle), around), _counted(_free(middle), beside)
    expected = np.clip(expected, 0.01, 0.99)
    odds = np.log(np.clip(edge * (1.0 - expected) / (expected * (1.0 - edge)), 0.3, 6.0))
    centred = 1.15 + 1.2 * np.sum(around[:3] * around[3:], axis=0)
    odds = np.exp(centred + _smooth(sided / (0.1 + 0.85 * sum_)) * (odds - centred))
    counted = odds * counted / (1.0 + (odds - 1.0) * counted)
    counted = np.where(middle > 0.0, np.maximum(counted, 2.0 * edge - 1.0), counted)
    share = _smooth((np.abs(middle) - 0.5) / 0.4)
    few = _few(middle, np.abs(around - beside).sum(axis=0), sum_, sided)
    return (1.0 - share) * counted + share * edge, few


def _few(middle: Array, off: Array, total: Array, sided: Array) -> Array:
    """How far seven rays are too few, from 0 to 1, as the shader's `few_of_seven`."""
    both = 1.0 - _smooth((sided / np.maximum(0.92 * total, 0.02) - 0.55) / 0.3)
    rod = both * (1.0 - _smooth((middle + 0.5) / 0.5))
    gap = _smooth((off - 0.8) / 0.8) * (1.0 - _smooth(total - 1.5)) * (1.0 - rod)
    hidden = (1.0 - _smooth(total / 0.1)) * (1.0 - _smooth((np.abs(middle) - 0.05) / 0.15))
    return np.asarray(np.maximum(gap, hidden) * (1.0 - _smooth((np.abs(middle) - 0.8) / 0.15)))


def _smooth(x: Array) -> Array:
    """`smoothstep` from 0 to 1."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))


def _around(radius: Array, angle: Array) -> Array:
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


_PLACES = np.linspace(0.3, 23.3, 24)
_HEXAGON = _around(np.full(6, 0.92), np.linspace(1.0, 6.0, 6) * math.pi / 3.0)
_SPIRAL = _around(0.95 * np.sqrt(_PLACES / 24.0), 2.399963 * _PLACES)


def _triangulated(
    field: Callable[[Array], Array], rays: Rays, t: Array, stop: Array, width: Array, near: Array, divisor: float | None
) -> Array:
    """The visible fractions by the module `light/triangulated`: the least clearance, with that between samples."""
    least, z, r, slope = np.ones(len(t)), np.zeros(len(t)), np.zeros(len(t)), np.ones(len(t))
    row = np.flatnonzero(t < stop)
    for turn in range(MAX_STEPS):
        if not row.size:
            break
        gain = LEAST_GAIN if turn >= PATIENT else 0.0
        step, last, s = z[row], r[row], t[row] + z[row]
        d = field(rays.at(row, s))
        sine = least[row] * width[row]
        cosine = np.sqrt(1.0 - sine * sine)
        before, here = _half_chord(last, t[row], sine), _half_chord(d, s, sine)
        lit = d > 0.125 * near[row]
        longer = (step > np.maximum(last, gain * t[row])) & (step > 0.0) & (divisor is None)
        again = lit & longer & (before + here < step * cosine)
        z[row[again]] = last[again]
        least[row[~lit]] = 0.0
        rise = np.where(step > 0.0, here - before, d) / np.where(step > 0.0, step, s)
        slope[row] = np.clip(np.minimum(rise, np.where(longer, 1.0, slope[row])), -1.0, 0.99)
        kept = lit & ~again
        k, longer = row[kept], longer[kept]
        d, s, step, last, cosine = (values[kept] for values in (d, s, step, last, cosine))
        back = np.where(longer | (step == 0.0), 0.0, 0.5 * (step + (d - last) * (d + last) / np.maximum(step, 1e-300)))
        back = np.where((back < 0.0) | (back > np.minimum(step, d)), 0.0, back)
        found = np.sqrt(d * d - back * back) / (width[k] * (s - back))
        leaps = found >= least[k]
        least[k] = np.minimum(least[k], found)
        t[k], r[k] = s, d
        alone = ahead = np.maximum(d / (divisor or 1.0), gain * s)
        if divisor is None:
            chord = _half_chord(d, s, least[k] * width[k])
            ahead = np.maximum(alone, leaps * 1.9 * chord / np.maximum(cosine - slope[k], 0.01))
        z[k] = np.minimum(ahead, stop[k] - s)
        row = np.union1d(row[again], k[s + alone < stop[k]])
    return least


def _beside_edge(c: Array) -> Array:
    """The fraction of a disc that a straight edge leaves visible, at a fraction of its radius from its middle."""
    c = np.clip(c, -1.0, 1.0)
    return np.asarray(0.5 + (c * np.sqrt(1.0 - c * c) + np.arcsin(c)) / np.pi)


def _free(clearance: Array) -> Array:
    """How free a ray of seven is, by its clearance, without a step where it meets a solid."""
    return np.asarray(np.maximum(clearance - 0.02, 0.0) / 0.98)


def _counted(middle: Array, around: Array) -> Array:
    """What seven rays count, from 0 to 1, by how free those of the middle, (N,), and of the hexagon are, (6, N)."""
    shares = [np.maximum(2.0 * _beside_edge(free) - 1.0, 0.0) for free in (middle, around)]
    return np.asarray((2.0 * shares[0] + 5.0 / 6.0 * shares[1].sum(axis=0)) / 7.0)


def _beside_axis(axis: Array, beside: Array) -> Array:
    """Unit directions beside others, (N, 3), by sines to the right and up, (N, 2), as in `light/two_sided`."""
    x, y, z = axis.T
    zero = np.zeros_like(x)
    steep = np.abs(y) >= 0.7
    right = np.where(steep, np.stack((zero, z, -y)), np.stack((z, zero, -x))).T
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    along = np.sqrt(1.0 - np.sum(beside * beside, axis=1, keepdims=True))
    result: Array = beside[:, :1] * right + beside[:, 1:] * np.cross(axis, right) + along * axis
    return result


@dataclass(frozen=True)
class _Cones:
    """Cones that are marched through a field; see `soft_visibility`. near : distance of a hit."""

    field: Callable[[Array], Array]
    rays: Rays
    near: Array
    divisor: float | None

    def beside(
        self, rows: NDArray[np.int64], places: Array, start: Array, stop: Array, width: Array, own: Array
    ) -> Array:
        """The least clearances of rays beside some, at places of their discs, (places, n).

        All march together, in parts of a limited number of rays. start, stop, width : of those that they are beside.
        own : the sines of the half angles of the cones beside them.
        """
        found, count = np.empty((len(places), len(rows))), len(places)
        for first in range(0, len(rows), AT_ONCE // count):
            some = slice(first, first + AT_ONCE // count)
            axes = self.rays.directions[rows[some]]
            aside = np.concatenate([_beside_axis(axes, place * width[some, None]) for place in places])
            near, far, sine = (np.tile(each[some], count) for each in (start, stop, own))
            least, _ = self.clearance(np.tile(rows[some], count), aside, near, far, sine, False)
            found[:, some] = least.reshape(count, -1)
        return found

    def clearance(
        self, rows: NDArray[np.int64], directions: Array, start: Array, stop: Array, width: Array, deep: bool
    ) -> tuple[Array, tuple[Array, Array]]:
        """The least clearance of some rays, (n,), and the parts of them in which anything reaches into their cones.

        directions, start, stop, width : of these rays. deep : whether to march on in solids, and return minus the depth
        as a fraction of the radius.
        """
        n = len(rows)
        least, depth, slope = np.ones(n), np.zeros(n), np.zeros(n)
        t, z, r = start.copy(), np.zeros(n), np.zeros(n)
        undone, met, left = np.zeros(n, bool), np.zeros(n, bool), np.ones(n, bool)
        first, last = start.copy(), stop.copy()
        for step in range(MAX_STEPS):
            k = np.flatnonzero(left)
            if not k.size:
                break
            s = t[k] + z[k]
            d = self.field(self.rays.origins[rows[k] if len(self.rays.origins) > 1 else 0] + s[:, None] * directions[k])
            radius = width[k] * s
            leapt = (z[k] > r[k] + np.abs(d)) & ~undone[k] & ~met[k] & (z[k] > 0.0) & (self.divisor is None)
            hit = met[k] | ((d <= np.maximum(self.near[rows[k]], 0.02 * radius)) & ~(leapt & deep))
            self._inside(k[hit], d[hit], s[hit], radius[hit], stop, (t, z, depth, met, left), deep)
            last[k[hit]] = stop[k[hit]]
            k, s, d, radius, leapt = k[~hit], s[~hit], d[~hit], radius[~hit], leapt[~hit]
            here = np.where(leapt, least[k], np.minimum(least[k], d / radius))
            sine = 0.9375 * here * width[k]
            before, after = (r[k], d) if self.divisor else (_half_chord(r[k], t[k], sine), _half_chord(d, s, sine))
            if self.divisor is None:
                again = ~undone[k] & (before + after < z[k] * np.sqrt(1.0 - sine * sine)) & (z[k] > 0.0)
                chords = _half_chord(r[k], t[k], width[k]) + _half_chord(d, s, width[k])
                clear = (d >= radius) & (chords >= z[k] * np.sqrt(1.0 - width[k] ** 2))
            else:
                again, clear = np.zeros(len(k), bool), d >= 2.0 * radius
            least[k] = here
            rise = np.where(z[k] > 0.0, after - before, d) / np.where(z[k] > 0.0, z[k], s)
            slope[k] = np.clip(np.minimum(rise, np.where(undone[k], slope[k], 1.0)), -1.0, 0.99)
            undone[k] = again
            redo, k, s, d, clear = k[again], k[~again], s[~again], d[~again], clear[~again]
            z[redo] = _alone(r[redo], t[redo], 0.9375 * least[redo] * width[redo])
            t[k], r[k] = s, d
            first[k] = np.where(least[k] >= 1.0, s, first[k])
            last[k] = np.where(clear, np.minimum(last[k], s), stop[k])
            if self.divisor is None:
                sine = 0.9375 * least[k] * width[k]
                chord, cosine = _half_chord(d, s, sine), np.sqrt(1.0 - sine * sine)
                ahead = np.maximum(1.9 * chord / np.maximum(cosine - slope[k], 0.01), -slope[k] * d)
                alone, z[k] = chord / cosine, np.minimum(ahead, stop[k] - s)
            else:
                alone = (
                    np.maximum(0.5 * d, (d - (1.0 if deep else least[k]) * radius) / (1.0 + width[k])) / self.divisor
                )
                z[k] = alone
            if step >= PATIENT:
                alone = np.maximum(alone, LEAST_GAIN * s)
                z[k] = np.maximum(z[k], alone)
            left[k] = s + alone < stop[k]
        return np.where(met, -np.minimum(depth, 1.0), least), (first, last)

    @staticmethod
    def _inside(
        k: NDArray[np.int64], d: Array, s: Array, radius: Array, stop: Array, state: tuple[Array, ...], deep: bool
    ) -> None:
        """The next steps of rays k that are in solids, at s."""
        t, z, depth, met, left = state
        depth[k] = np.maximum(depth[k], -d / radius)
        t[k], z[k] = s, np.minimum(np.maximum(np.abs(d), 0.25 * radius), stop[k] - s)
        shallow = (depth[k] < 1.0) & (s < stop[k])
        left[k] = (shallow & ~((met[k] != 0.0) & (d > 0.0))) if deep else False
        met[k] = True


def _half_chord(r: Array, t: Array, sine: Array) -> Array:
    """Half of the chords that spheres of radius r, about points of the axes at t, cut from the sides of cones."""
    return np.asarray(np.sqrt(np.maximum(r * r - t * t * sine * sine, 0.0)))


def _alone(r: Array, t: Array, sine: Array) -> Array:
    """The steps that spheres prove alone in cones with given sines of their half angles."""
    return np.asarray(_half_chord(r, t, sine) / np.sqrt(1.0 - sine * sine))


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
