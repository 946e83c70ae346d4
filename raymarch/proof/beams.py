"""Beams around neighbouring rays: what is free for a beam is free for each of its rays.

Far from a blend of many operands, one enclosure for a beam takes the place of those of all its rays.
"""

from __future__ import annotations

import numpy as np

from raymarch.proof.groups import close
from raymarch.proof.parts import Operands
from raymarch.proof.rays import Rays, Stretch, Whole
from raymarch.proof.rounding import Array

RAYS = (64, 16)
"""Rays of a beam, of each size in turn."""

SHORT = 1.0
"""Length of a stretch that is not halved, in widths of its beam."""

WIDER = 1e-12
"""Relative margin of a beam, far above the rounding of its middle and its width."""


def beside_beams(operands: Operands, rays: Rays, work: Stretch, evaluations: Whole) -> Stretch:
    """Stretches of rays up to the first and from the last part of a beam that is not free. Asked are blends alone.

    evaluations : of each ray, (N,); those of a beam are counted for one of its rays.
    """
    blended = operands.blends[work.operands]
    own, others = work[blended], work[~blended]
    if len(own) < RAYS[-1]:
        return work
    reach = np.max(own.end)
    order = close(np.concatenate([rays.origins, rays.origins + reach * rays.directions], axis=1), RAYS[-1])
    for each in RAYS:
        own = _beside(operands, rays, own, order, each, evaluations)
    return Stretch.joined([own, others])


def _beside(operands: Operands, rays: Rays, own: Stretch, order: Whole, each: int, evaluations: Whole) -> Stretch:
    """The same by beams of so many rays. own : stretches of blends. order : of rays, neighbours in space."""
    beam_of = np.empty(len(order), np.int64)
    beam_of[order] = np.arange(len(order)) // each
    parts, part = np.unique(beam_of[own.rays] * len(operands) + own.operands, return_inverse=True)
    wide = Stretch(*np.divmod(parts, len(operands)), *_ends(len(parts), part, own.start, own.end))
    first, last = _held(operands, _beams(rays, order, each), wide, evaluations, order[::each])
    start, end = np.maximum(own.start, first[part]), np.minimum(own.end, last[part])
    kept = start <= end
    return Stretch(own.rays[kept], own.operands[kept], start[kept], end[kept])


def _ends(n: int, part: Whole, start: Array, end: Array) -> tuple[Array, Array]:
    """The least start and the greatest end of the stretches of n parts."""
    first, last = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(first, part, start)
    np.maximum.at(last, part, end)
    return first, last


def _beams(rays: Rays, order: Whole, each: int) -> Rays:
    """The beams around so many rays each, in an order."""
    found = []
    for values in (rays.origins, rays.directions):
        first = np.arange(0, len(order), each)
        low, high = (least.reduceat(values[order], first, axis=0) for least in (np.minimum, np.maximum))
        middle = 0.5 * (low + high)
        found.append((middle, (high - low) * (0.5 + WIDER) + np.abs(middle) * WIDER))
    (origins, beside), (directions, spread) = found
    return Rays(origins, directions, beside, spread)


def _held(operands: Operands, beams: Rays, wide: Stretch, evaluations: Whole, owner: Whole) -> tuple[Array, Array]:
    """Of each stretch of a beam the first and the last place that may not be free; (n,) each, crossed if it is free.

    owner : the ray of each beam to which evaluations are counted.
    """
    assert beams.beside is not None and beams.spread is not None
    beside, spread = (2.0 * np.max(half, axis=1) for half in (beams.beside, beams.spread))
    parts, now = wide.rays * len(operands) + wide.operands, wide
    first, last = np.full(len(wide), np.inf), np.full(len(wide), -np.inf)
    while len(now):
        np.add.at(evaluations, owner[now.rays], 1)
        centre = 0.5 * (now.start + now.end)
        range_, at, slope = operands.enclose(beams, now, centre)
        go = np.flatnonzero(~(range_[0] > 0.0))
        now = now[go].rest(centre[go], at[0][go], (slope[0][go], slope[1][go]))
        part = np.searchsorted(parts, now.rays * len(operands) + now.operands)
        short = now.end - now.start <= SHORT * (beside[now.rays] + spread[now.rays] * now.end)
        found = _ends(len(parts), part[short], now.start[short], now.end[short])
        first, last = np.minimum(first, found[0]), np.maximum(last, found[1])
        now = now[~short & ((now.start < first[part]) | (now.end > last[part]))]
    return first, last
