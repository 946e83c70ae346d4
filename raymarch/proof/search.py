"""The verdict about each ray: free up to its hit, and a change of sign there, or neither.

Stretches whose range is above 0 are free. Others are halved, until they are free, or hold a point that is certainly in
the solid, or are too short or too many to go on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raymarch.proof.parts import Operands, Rays, Stretch, Whole
from raymarch.proof.rounding import Array

PROVED, CONTRADICTED, OPEN = 0, 1, 2

MOST = 5000
"""Evaluations for a ray: what is undecided then stays open."""

TOGETHER = 1 << 17
"""Stretches in work at once; this bounds the memory."""

BLIND = 32.0
"""Length of a stretch, in tolerances, that is not halved if its enclosure has no bounds at all."""

SLIVER = 1.0 / 8.0
"""Length of a stretch that is judged by the points around it, in tolerances."""

AROUND = 96
"""Directions in which the solid is looked for around a hit that its ray only touches."""

WITHIN = (1.0, 0.5, 0.25, 0.0, -0.5)
"""Where the change of sign is looked for, in tolerances behind the hit."""


@dataclass(eq=False, slots=True)
class Verdict:
    """What is known of N rays, (N,) each.

    low : no surface lies before it. high : a surface lies before it, inf if none is known.
    state : PROVED, CONTRADICTED or OPEN. blocked : an open stretch of each ray: an index into `left`, -1 for none.
    """

    state: NDArray[np.uint8]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    left: Stretch
    evaluations: NDArray[np.int64]

    @classmethod
    def unknown(cls, count: int, left: Stretch) -> Verdict:
        return cls(
            np.full(count, OPEN, np.uint8), np.zeros(count), np.full(count, np.inf), left, np.zeros(count, np.int64)
        )


def judge(
    operands: Operands,
    rays: Rays,
    start: Array,
    end: Array,
    hit: Array,
    within: Array,
    shortest: Array,
    progress: Callable[[float], None] | None = None,
) -> Verdict:
    """Judge reported hits.

    start, end : of each ray. hit : distance of the reported hit, inf for none. within : tolerance of each, a length.
    shortest : length of a stretch that is not halved.
    """
    n = len(start)
    found = np.isfinite(hit)
    free_to = np.where(found, np.minimum(hit - within, end), end)
    verdict = Verdict.unknown(n, operands.met(rays, start, start)[:0])
    verdict.low[:] = free_to
    _free(operands, rays, operands.met(rays, start, free_to), free_to, within, shortest, verdict, progress)
    stuck = verdict.low < free_to
    changes = _change(operands, rays, start, hit, within, np.flatnonzero(found & ~stuck), verdict)
    verdict.high[changes >= 0] = np.minimum(verdict.high, hit + within)[changes >= 0]
    inside = verdict.high <= free_to  # a point in the solid before the reported hit
    beside = found & ~stuck & (changes < 0)
    rows = np.flatnonzero(beside)
    beside[rows] = ~_around(operands, rays, rows, hit[rows], within, verdict)
    verdict.state[:] = np.where(inside, CONTRADICTED, np.where(stuck | beside, OPEN, PROVED))
    _invented(operands, rays, hit, within, end, shortest, np.flatnonzero(beside), verdict)
    return verdict


def _free(
    operands: Operands,
    rays: Rays,
    work: Stretch,
    free_to: Array,
    within: Array,
    shortest: Array,
    verdict: Verdict,
    progress: Callable[[float], None] | None = None,
    slivers: bool = True,
) -> None:
    """Prove stretches free. `verdict.low` becomes the start of the first one that is not.

    slivers : a short stretch is no obstacle, even if it crosses a surface, if a point within the tolerance lies
        outside: what the ray meets there is a sliver.
    """
    left: list[Stretch] = []
    pending, whole = [work], max(len(work), 1)
    while pending:
        now = pending.pop()
        if len(now) > TOGETHER:
            pending += [now[TOGETHER:], now[:TOGETHER]]
            continue
        # of a ray that lies before a known point in the solid, nothing behind it matters
        now = now[now.start < verdict.high[now.rays]]
        if not len(now):
            continue
        np.add.at(verdict.evaluations, now.rays, 1)
        last = now.end >= free_to[now.rays]
        centre = np.where(last, now.end, 0.5 * (now.start + now.end))
        range_, at, _ = operands.enclose(rays, now, centre)
        is_free = range_[0] > 0.0
        sliver = slivers & (now.end - now.start <= SLIVER * within[now.rays])
        in_solid = ~is_free & (at[1] < 0.0)
        rows = np.flatnonzero(in_solid | (~is_free & sliver))
        if slivers:
            shallow = _around(operands, rays, now.rays[rows], centre[rows], within, verdict, outside=True)
            in_solid[rows[shallow]] = False
            is_free[rows] |= shallow & sliver[rows]
        np.minimum.at(verdict.high, now.rays[in_solid], centre[in_solid])
        length = now.end - now.start
        blind = np.isinf(range_[0]) & np.isinf(range_[1]) & (length <= BLIND * within[now.rays])
        short = (length <= shortest[now.rays]) | (verdict.evaluations[now.rays] > MOST) | blind
        stop = ~is_free & (short | in_solid)
        left.append(now[stop])
        go = now[~is_free & ~stop]
        middle = 0.5 * (go.start + go.end)
        if len(go):
            pending.append(
                Stretch(
                    np.concatenate([go.rays, go.rays]),
                    np.concatenate([go.operands, go.operands]),
                    np.concatenate([go.start, middle]),
                    np.concatenate([middle, go.end]),
                )
            )
        if progress is not None:
            progress(1.0 - min(sum(map(len, pending)) / whole, 1.0))
    verdict.left = Stretch.joined([verdict.left, *left])
    np.minimum.at(verdict.low, verdict.left.rays, verdict.left.start)


def _change(
    operands: Operands, rays: Rays, start: Array, hit: Array, within: Array, some: Whole, verdict: Verdict
) -> NDArray[np.int64]:
    """Which of the places `WITHIN` lies in the solid for certain; -1 for none."""
    result = np.full(len(hit), -1, np.int64)
    for number, share in enumerate(WITHIN):
        if not len(some):
            break
        place = hit[some] + share * within[some]
        place = np.maximum(place, start[some])
        part = Rays(rays.origins[some], rays.directions[some])
        work = operands.met(part, place, place)
        _, at, _ = operands.enclose(part, work, work.start)
        np.add.at(verdict.evaluations, some[work.rays], 1)
        inside = np.zeros(len(some), bool)
        inside[work.rays[at[1] < 0.0]] = True
        result[some[inside]] = number
        some = some[~inside]
    return result


def _around(
    operands: Operands, rays: Rays, some: Whole, at: Array, within: Array, verdict: Verdict, outside: bool = False
) -> NDArray[np.bool_]:
    """Whether a point in the solid, or outside of it, lies within the tolerance of points on rays.

    some : the rays. at : the points on them. Asked are places on a sphere: of a sharp edge, the solid fills a small
    part of it.
    """
    found = np.zeros(len(some), bool)
    if not len(some):
        return found
    places = rays.origins[some] + at[:, None] * rays.directions[some]
    directions = spiral(AROUND)
    points = (places[:, None] + (1.0 - SLIVER) * within[some, None, None] * directions).reshape(-1, 3)
    owners = np.repeat(np.arange(len(some)), AROUND)
    part = Rays(points, np.broadcast_to(directions, (len(some), AROUND, 3)).reshape(-1, 3))
    work = operands.near(part, np.zeros(len(points)))
    _, value, _ = operands.enclose(part, work, work.start)
    np.add.at(verdict.evaluations, some[owners[work.rays]], 1)
    if not outside:
        found[owners[work.rays[value[1] < 0.0]]] = True
        return found
    low = np.full(len(points), np.inf)
    np.minimum.at(low, work.rays, value[0])
    found[owners[low > 0.0]] = True
    return found


def spiral(count: int) -> NDArray[np.float64]:
    """Even unit directions, (count, 3): a Fibonacci spiral (Gonzalez 2010)."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn = np.pi * (1.0 + 5.0**0.5) * np.arange(count)
    beside = np.sqrt(1.0 - height * height)
    return np.stack([beside * np.cos(turn), height, beside * np.sin(turn)], axis=1)


def _invented(
    operands: Operands,
    rays: Rays,
    hit: Array,
    within: Array,
    end: Array,
    shortest: Array,
    some: Whole,
    verdict: Verdict,
) -> None:
    """Hits without a surface: free up to the tolerance behind them."""
    if not len(some):
        return
    first, last = np.maximum(hit[some] - within[some], 0.0), np.minimum(hit[some] + within[some], end[some])
    part = Rays(rays.origins[some], rays.directions[some])
    empty = verdict.left[:0]
    own = Verdict.unknown(len(some), empty)
    own.low[:] = last
    work, shortest = operands.met(part, first, last), shortest[some] / 16.0
    _free(operands, part, work, last, within[some], shortest, own, slivers=False)
    verdict.evaluations[some] += own.evaluations
    solid = own.high <= last
    verdict.high[some[solid]] = own.high[solid]
    free = own.low >= last
    verdict.state[some] = np.where(free, CONTRADICTED, np.where(solid, PROVED, OPEN))
    verdict.low[some[free]] = last[free]
    verdict.left = Stretch.joined(
        [verdict.left, Stretch(some[own.left.rays], own.left.operands, own.left.start, own.left.end)]
    )
