"""The verdict about each ray: free up to its hit, and a change of sign there, or neither.

Stretches whose range is above 0 are free. Others are halved, until they are free, or hold a point that is certainly in
the solid, or are too short or too many to go on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raymarch.proof.beams import beside_beams
from raymarch.proof.parts import Operands
from raymarch.proof.rays import Rays, Stretch, Whole
from raymarch.proof.rounding import Array, Interval

PROVED, CONTRADICTED, OPEN = 0, 1, 2

MOST = 5000
"""Evaluations for a ray: what is undecided then stays open."""

TOGETHER = 1 << 17
"""Stretches in work at once; this bounds the memory."""

FEW = MOST // 10
"""The same for what lies behind a stretch that stays undecided: the ray is open already; and for all rays once they
have taken `ENOUGH` together."""

ENOUGH = 1 << 21
"""Evaluations of rays that are judged together. Only fractals and other estimates come near: theirs take 20 us each."""

BLIND = 1.0
"""Length of a stretch, in tolerances, that is not halved if its enclosure and that of its centre are unbounded."""

LOST = 16
"""Stretches of a ray along which the value is not known to a tolerance. If it is not known at places around the centre
of one of them either, as where GLSL of your own counts, such stretches are not halved: the ray stays open.
"""

SLIVER = 1.0 / 8.0
"""Length of a stretch that is judged by the points around it, in tolerances."""

AROUND = 96
"""Directions in which a point in the solid, or outside of it, is looked for."""

FIRST = 8
"""Directions of these that are tried before the others."""

STEP = AROUND // FIRST

WITHIN = (1.0, 0.5, 0.25, 0.0, -0.5)
"""Where the change of sign is looked for, in tolerances behind the hit."""


def spiral(count: int) -> NDArray[np.float64]:
    """Even unit directions, (count, 3): a Fibonacci spiral (Gonzalez 2010)."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.pi * (1.0 + 5.0**0.5) * np.arange(count)
    beside = np.sqrt(1.0 - height * height)
    return np.stack([beside * np.cos(turn), height, beside * np.sin(turn)], axis=1)


EVERY = spiral(AROUND)


@dataclass(eq=False, slots=True)
class Verdict:
    """What is known of N rays, (N,) each.

    low : no surface lies before it. high : a surface lies before it, inf if none is known.
    state : PROVED, CONTRADICTED or OPEN. grazing : the surface is near the hit, but not there on the ray.
    left : stretches that are not free.
    """

    state: NDArray[np.uint8]
    grazing: NDArray[np.bool_]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    left: Stretch
    evaluations: NDArray[np.int64]

    @classmethod
    def unknown(cls, low: Array) -> Verdict:
        n = len(low)
        state, grazing = np.full(n, OPEN, np.uint8), np.zeros(n, bool)
        return cls(state, grazing, low.copy(), np.full(n, np.inf), EMPTY, np.zeros(n, np.int64))

    def take(self, rows: Whole, other: Verdict) -> None:
        """Take over the stretches and the evaluations of another verdict, about some of the rays."""
        self.evaluations[rows] += other.evaluations
        left = other.left
        self.left = Stretch.joined([self.left, Stretch(rows[left.rays], left.operands, left.start, left.end)])


_NONE, _NOTHING = np.zeros(0, np.int64), np.zeros(0)
EMPTY = Stretch(_NONE, _NONE, _NOTHING, _NOTHING)


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """What is judged: N rays, (N,) each.

    start, end : of each ray. hit : distance of the reported hit, inf for none. within : the tolerance, a length.
    shortest : length of a stretch that is not halved.
    """

    operands: Operands
    rays: Rays
    start: Array
    end: Array
    hit: Array
    within: Array
    shortest: Array

    def __len__(self) -> int:
        return len(self.start)

    def __getitem__(self, rows: Whole) -> Given:
        own = (self.start, self.end, self.hit, self.within, self.shortest)
        return Given(self.operands, self.rays[rows], *(v[rows] for v in own))


def judge(given: Given, progress: Callable[[float], None] | None = None) -> Verdict:
    """Judge reported hits."""
    hit, within = given.hit, given.within
    found = np.isfinite(hit)
    free_to = np.where(found, np.minimum(hit - within, given.end), given.end)
    verdict = Verdict.unknown(free_to)
    work = given.operands.met(given.rays, given.start, free_to)
    work = beside_beams(given.operands, given.rays, work, verdict.evaluations)
    thin = free(given, work, free_to, given.shortest, verdict, progress)
    _late(given, thin, free_to, found, verdict)
    stuck = verdict.low < free_to
    changes = _change(given, np.flatnonzero(found & ~stuck & ~verdict.grazing), verdict)
    verdict.high[changes] = np.minimum(verdict.high, hit + within)[changes]
    inside = verdict.high <= free_to  # a point in the solid before the reported hit
    beside = found & ~stuck & ~verdict.grazing
    beside[changes] = False
    verdict.state[:] = np.where(inside, CONTRADICTED, np.where(stuck | beside, OPEN, PROVED))
    _beside(given, np.flatnonzero(beside), verdict)
    return verdict


def free(
    given: Given,
    work: Stretch,
    free_to: Array,
    shortest: Array,
    verdict: Verdict,
    progress: Callable[[float], None] | None = None,
    slivers: bool = True,
) -> Stretch:
    """Prove stretches free. `verdict.low` becomes the start of the first one that is not.

    slivers : a short stretch is no obstacle, even if it crosses a surface, if a point within the tolerance lies
        outside; and neither is a longer one, if all points at one offset from it do. These stretches are returned.
    """
    left, thin = [verdict.left], [EMPTY]
    pending, within = [work], given.within
    stuck, lost = np.full(len(given), np.inf), Lost(given)
    while pending:
        now = pending.pop()
        if len(now) > TOGETHER:
            pending += [now[TOGETHER:], now[:TOGETHER]]
            continue
        # of a ray that lies before a known point in the solid, nothing behind it matters
        now = now[now.start < verdict.high[now.rays]]
        if not len(now):
            continue
        verdict.evaluations += np.bincount(now.rays, minlength=len(given))
        last = now.end >= free_to[now.rays]
        centre = np.where(last, now.end, 0.5 * (now.start + now.end))
        range_, at, slope = given.operands.enclose(given.rays, now, centre)
        is_free = range_[0] > 0.0
        length = now.end - now.start
        in_solid = ~is_free & (at[1] < 0.0)
        stop = in_solid.copy()
        blind = ~_bounded(range_) & ~_bounded(at)
        unknown = ~is_free & _unknown(at, within[now.rays])
        stop |= unknown & lost.found(now.rays, centre, unknown, verdict)
        if slivers:
            tiny = ~blind & (length <= SLIVER * within[now.rays])
            shallow, rows = _slivers(given, now, centre, (tiny, np.flatnonzero(~is_free & (in_solid | tiny))), verdict)
            in_solid[shallow] = stop[shallow] = False
            thin.append(now[rows])
            is_free[rows] = True
        np.minimum.at(verdict.high, now.rays[in_solid], centre[in_solid])
        stop |= blind & (length <= BLIND * within[now.rays])
        enough = verdict.evaluations.sum() > ENOUGH
        most = np.where(enough | (now.start > stuck[now.rays]), FEW, MOST)
        stop |= (length <= shortest[now.rays]) | (verdict.evaluations[now.rays] > most)
        left.append(now[~is_free & stop])
        np.minimum.at(stuck, left[-1].rays, left[-1].start)
        go = np.flatnonzero(~is_free & ~stop)
        if len(go):
            pending.append(now[go].rest(centre[go], at[0][go], (slope[0][go], slope[1][go])))
        if progress is not None:
            open_ = np.unique(np.concatenate([_NONE, *(part.rays for part in pending)]))
            progress(1.0 - len(open_) / len(given))
    verdict.left = Stretch.joined(left)
    np.minimum.at(verdict.low, verdict.left.rays, verdict.left.start)
    return Stretch.joined(thin)


def _slivers(
    given: Given, now: Stretch, centre: Array, asked: tuple[NDArray[np.bool_], Whole], verdict: Verdict
) -> tuple[Whole, Whole]:
    """The stretches whose centre has a point outside within the tolerance, and those of them that are no obstacle.

    asked : which stretches are so short that their centre decides, (n,), and the numbers of those that are asked.
    """
    tiny, rows = asked
    shallow, off = _around(given, now.rays[rows], centre[rows], verdict, outside=True)
    rows, off = rows[shallow], off[shallow]
    thin, long = tiny[rows], np.flatnonzero(~tiny[rows])
    thin[long] = _beside_free(given, now[rows[long]], off[long], verdict)
    return rows, rows[thin]


def _beside_free(given: Given, some: Stretch, off: Array, verdict: Verdict) -> NDArray[np.bool_]:
    """Whether stretches are free if they are moved: then each of their points has one beside it that is outside."""
    rays, free_ = given.rays[some.rays], np.ones(len(some), bool)
    moved = Rays(rays.origins + off, rays.directions)
    work = given.operands.met(moved, some.start, some.end)
    range_, _, _ = given.operands.enclose(moved, work, 0.5 * (work.start + work.end))
    verdict.evaluations += np.bincount(some.rays[work.rays], minlength=len(given))
    free_[work.rays[~(range_[0] > 0.0)]] = False
    return free_


def _bounded(value: Interval) -> NDArray[np.bool_]:
    return np.isfinite(value[0]) & np.isfinite(value[1])


def _unknown(value: Interval, within: Array) -> NDArray[np.bool_]:
    """Whether a number is not known to a tolerance, and neither is its sign."""
    return (value[0] <= 0.0) & (value[1] >= 0.0) & (value[1] - value[0] > within)


def _late(given: Given, thin: Stretch, free_to: Array, found: NDArray[np.bool_], verdict: Verdict) -> None:
    """Slivers that reach the hit: the hit is late along the ray, unless they are free at closer sight."""
    begin = free_to.copy()
    while True:  # stretches that touch are one sliver
        more = (thin.end >= begin[thin.rays]) & (thin.start < begin[thin.rays])
        if not more.any():
            break
        np.minimum.at(begin, thin.rays[more], thin.start[more])
    rows = np.flatnonzero((begin < free_to) & found & (verdict.low >= free_to))
    if not len(rows):
        return
    part, last = given[rows], free_to[rows]
    own = Verdict.unknown(last)
    free(part, part.operands.met(part.rays, begin[rows], last), last, part.shortest, own, slivers=False)
    late = np.flatnonzero(own.low < last)
    shallow, _ = _around(part, late, part.hit[late], own, outside=True)
    verdict.grazing[rows[late[shallow]]] = True
    deep = late[~shallow]
    own.left = own.left[np.isin(own.left.rays, deep)]
    verdict.take(rows, own)
    verdict.low[rows[deep]], verdict.high[rows[deep]] = own.low[deep], own.high[deep]


def _change(given: Given, some: Whole, verdict: Verdict) -> Whole:
    """The rays of which one of the places `WITHIN` lies in the solid for certain."""
    result = []
    for share in WITHIN:
        part = given[some]
        inside = _inside(part, np.maximum(part.hit + share * part.within, part.start), verdict, some)
        result.append(some[inside])
        some = some[~inside]
    return np.concatenate(result)


def _inside(given: Given, at: Array, verdict: Verdict, some: Whole) -> NDArray[np.bool_]:
    """Whether one point of each ray lies in the solid for certain."""
    inside = np.zeros(len(given), bool)
    work = given.operands.met(given.rays, at, at)
    _, value, _ = given.operands.enclose(given.rays, work, work.start)
    verdict.evaluations[some] += np.bincount(work.rays, minlength=len(given))
    inside[work.rays[value[1] < 0.0]] = True
    return inside


def _around(given: Given, some: Whole, at: Array, verdict: Verdict, outside: bool) -> tuple[NDArray[np.bool_], Array]:
    """Whether a point in the solid, or outside of it, lies within the tolerance of points on rays; and its offset.

    some : the rays. at : the points on them. Asked are the points and places on a sphere: of a sharp edge, the solid
    fills a small part of it. Where the cube around the sphere is all outside, or all in the solid, there is none.
    """
    found, offset = np.zeros(len(some), bool), np.zeros((len(some), 3))
    possible = _may_differ(given, some, at, verdict, outside)
    for directions in (np.zeros((1, 3)), EVERY[::STEP], np.delete(EVERY, np.s_[::STEP], axis=0)):
        open_ = np.flatnonzero(possible & ~found)
        if not len(open_):
            break
        free_, solid, unknown = _near(given, some[open_], at[open_], directions, verdict)
        asked = free_ if outside else solid
        found[open_] = np.any(asked, axis=1)
        offset[open_] = _length(given, some[open_]) * directions[np.argmax(asked, axis=1)]
        if len(directions) == FIRST:
            possible[open_] &= ~unknown.all(axis=1)
    return found, offset


def _length(given: Given, some: Whole) -> Array:
    """How far places around points lie from them, (n, 1)."""
    return (1.0 - SLIVER) * given.within[some, None]


def _near(given: Given, some: Whole, at: Array, directions: Array, verdict: Verdict) -> tuple[Array, Array, Array]:
    """Of places on a sphere around points on rays, (n, directions) each: whether they are outside for certain, in the
    solid for certain, or neither, where a value is not known to the tolerance."""
    count = len(directions)
    places = given.rays.origins[some] + at[:, None] * given.rays.directions[some]
    points = (places[:, None] + _length(given, some)[:, None] * directions).reshape(-1, 3)
    owners, zero = np.repeat(some, count), np.zeros(len(points))
    part = Rays(points, np.zeros((len(points), 3)))
    work = given.operands.met(part, zero, zero)
    _, value, _ = given.operands.enclose(part, work, work.start)
    verdict.evaluations += np.bincount(owners[work.rays], minlength=len(given))
    low, high = np.full(len(points), np.inf), np.full(len(points), np.inf)
    np.minimum.at(low, work.rays, value[0])
    np.minimum.at(high, work.rays, value[1])
    unknown = np.zeros(len(points), bool)
    unknown[work.rays[_unknown(value, given.within[owners[work.rays]])]] = True
    solid, shape = high < 0.0, (-1, count)
    return (low > 0.0).reshape(shape), solid.reshape(shape), (unknown & ~solid).reshape(shape)


class Lost:
    """The rays that are given up, since their field is not known at many places, nor around one of them."""

    def __init__(self, given: Given) -> None:
        self.given, self.count = given, np.zeros(len(given), np.int64)
        self.rays = np.zeros(len(given), bool)

    def found(self, rays: Whole, centre: Array, unknown: NDArray[np.bool_], verdict: Verdict) -> NDArray[np.bool_]:
        """Whether the ray of each stretch is given up. unknown : whether the value at its centre is not known."""
        self.count += np.bincount(rays[unknown], minlength=len(self.count))
        rows = np.flatnonzero(unknown & (self.count[rays] > LOST) & ~self.rays[rays])
        asked, first = np.unique(rays[rows], return_index=True)
        if len(asked):
            around = _near(self.given, asked, centre[rows[first]], EVERY[::STEP], verdict)[2]
            self.rays[asked] = around.sum(axis=1) > 1  # places are known where a choice is open along a stretch
            self.count[asked] = 0
        return self.rays[rays]


def _may_differ(given: Given, some: Whole, at: Array, verdict: Verdict, outside: bool) -> NDArray[np.bool_]:
    """False where the cube around a point of a ray is all in the solid, or all outside unless `outside`."""
    rays, zero = given.rays[some], np.zeros(len(some))
    half = np.broadcast_to(given.within[some, None], (len(some), 3))
    part = Rays(rays.origins + at[:, None] * rays.directions, np.zeros_like(half), beside=half)
    work = given.operands.met(part, zero, zero)
    cube, _, _ = given.operands.enclose(part, work, work.start)
    verdict.evaluations += np.bincount(some[work.rays], minlength=len(given))
    found = np.full(len(some), outside)
    found[work.rays[cube[1] < 0.0 if outside else ~(cube[0] > 0.0)]] = not outside
    return found


def _beside(given: Given, some: Whole, verdict: Verdict) -> None:
    """Hits at which no point of the ray lies in the solid for certain: the ray grazes it, or the hit is wrong."""
    if not len(some):
        return
    part = given[some]
    first, last = np.maximum(part.hit - part.within, 0.0), np.minimum(part.hit + part.within, part.end)
    own = Verdict.unknown(last)
    free(part, part.operands.met(part.rays, first, last), last, part.shortest / 16.0, own, slivers=False)
    solid, is_free = own.high <= last, own.low >= last
    grazing = np.flatnonzero(~solid)
    grazing = grazing[_around(part, grazing, part.hit[grazing], own, outside=False)[0]]
    verdict.grazing[some[grazing]] = True
    verdict.high[some[solid]] = own.high[solid]
    verdict.low[some[is_free]] = last[is_free]
    state = np.where(is_free, CONTRADICTED, OPEN)
    state[solid] = state[grazing] = PROVED
    verdict.state[some] = state
    own.left = own.left[state[own.left.rays] == OPEN]
    verdict.take(some, own)
