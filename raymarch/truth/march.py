"""First roots of many 1-Lipschitz functions of one variable.

Along a unit ray a 1-Lipschitz field is such a function f(t). A sample r = f(c) > 0 proves the interval (c - r, c + r)
free of roots. Results rely on this fact alone: everything before a ray's `front` is proved free, sample by sample.
Estimates (the slope so far) only choose the next sample. An estimate that leaps too far leaves an `island`: a free
interval that the front does not touch yet. The gap before it is then bisected until it is closed. The front continues
behind the island, so no sample is wasted.

Next to a root of slope -k a front gains a factor (1 - k) / (1 + k) per sample, twice the gain of plain sphere tracing.
No method that uses values alone gains more. The proof therefore stops at a gap of `GAP` times the distance. If the sign
changes inside, bracketing finds the root. A ray that still creeps after `PATIENCE` samples (it touches a surface, or
grazes it below a tenth of a degree) may leave larger gaps; these are reported.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[Any]
Value: TypeAlias = Callable[[Array, Array], Array]
"""Value of the functions `rows`, shape (n,), at the arguments t, shape (n,)."""

ULP = float(np.finfo(np.float64).eps)
NOISE = 8 * ULP
"""Values up to this many times the size of the coordinates count as 0: the rounding error of a sum of a few terms."""
GAP = math.sqrt(ULP)
"""Widest interval before a root that needs no proof, over the distance: 1.5e-8. Each secant step halves the number of
missing digits, so a root is exact after two or three steps from here."""
PATIENCE = 6000
"""Samples after which a ray may leave larger gaps: enough for a gap of `GAP` at 0.1 degrees."""
CREEPING = 1e-5
"""A ray creeps while its values are below this fraction of the distance: 1/100 of a pixel of a picture 1,000 high. A
ray with larger values is never allowed a larger gap: it reaches its end in some 1 / `CREEPING` samples at most."""
DOUBLING = 250
"""Creeping samples after which the allowed gap doubles; after 26 times as many it is the whole distance."""
RISE = 0.9
"""Largest slope in an estimate; the true slope stays below 1, where the next sample would be at infinity."""
STEPS_BEHIND = tuple(4.0 ** np.arange(2, 22))
"""Distances behind a root at which `first_crossing` takes samples, in rounding errors."""
MOST_TOUCHED = 64
"""Largest number of roots of a line that `first_crossing` passes: one that lies in a membrane touches it all along."""
AT_ONCE = 1e-7
"""Distance behind a root, over the distance of the root, at which a sample decides for nearly all."""
LEAPS = ((48, 64), (16, 16))
"""After so many samples one by one, a ray takes so many at once. Most rays end before; for the few that are left, the
calls of NumPy take longer than the evaluation. The counts depend on no other ray, so a root does not either."""
CAUTION = 0.01
"""Relative reduction of the slope that `_Rays.leap` expects: the samples overlap where a field is not quite linear."""
STEEP = 0.75
"""Largest slope, of either sign, at which a ray leaps: a steeper one has few samples left."""
FAINT = 0.25
"""A ray leaps by steps above this fraction of the first: they add up to 3/4 of the distance to a root."""
HALF = 0.5
"""Fraction of an estimated distance that `first_root_of_estimate` steps."""


@dataclass(frozen=True, slots=True)
class Lines:
    """The search interval of each line, and the lengths that scale its tolerances.

    start, end : the interval, each of shape (N,), finite; nothing is found where end <= start.
    size : size of the coordinates at t = 0: rounding errors are measured in size + t.
    travelled : length of the path up to t = 0: gaps are measured in travelled + t.
    """

    start: Array
    end: Array
    size: Array
    travelled: Array

    def noise(self, rows: Array, t: Array) -> Array:
        """Values up to this count as 0."""
        return NOISE * (self.size[rows] + t)

    def gap(self, rows: Array, t: Array) -> Array:
        """The widest interval before a root that needs no proof."""
        return np.maximum(GAP * (self.travelled[rows] + t), 8 * self.noise(rows, t))


@dataclass(frozen=True, slots=True)
class Roots:
    """The first root on each line.

    t : position of the root, inf if there is none; shape (N,).
    evaluations : number of evaluations, integers of shape (N,).
    gap : length before the root that was not proved free; shape (N,).
    """

    t: Array
    evaluations: Array
    gap: Array


@dataclass(slots=True)
class _Rays:
    """Rays whose search is not finished. All arrays have shape (n,).

    row : index of the ray. front : up to here there is no root. near, near_value : the sample that set the front.
    slope : estimate of df/dt. end : end of the search; end_value : the value there, once a sample has found it to be 0
    or less. low : start of the island, inf for none; island, island_value : the sample of the island. creeping : number
    of samples below `CREEPING` after `PATIENCE`. skipped : length of the gaps left so far.
    """

    row: Array
    front: Array
    near: Array
    near_value: Array
    slope: Array
    end: Array
    end_value: Array
    low: Array
    island: Array
    island_value: Array
    creeping: Array
    skipped: Array

    def only(self, mask: Array) -> _Rays:
        return _Rays(*[getattr(self, f.name)[mask] for f in fields(self)])

    @property
    def bracketed(self) -> Array:
        return self.end_value <= 0.0

    def next_sample(self, widest: Array, bold: Array) -> Array:
        """Position of the next sample, whose sphere is expected to just touch the front.

        widest : the gap allowed before a root. If a root is expected within it, the sample lies beyond it. bold : the
        sample lies at least this gap beyond the front.
        """
        slope = np.clip(self.slope, -1.0, RISE)
        at_front = self.near_value * (1.0 + slope)
        sample = self.front + at_front / (1.0 - slope)
        root_is_near = (slope < 0.0) & (at_front <= 0.5 * widest * -slope)
        sample = np.where(root_is_near | bold, np.maximum(sample, self.front + widest), sample)
        sample = np.where(self.low < np.inf, 0.5 * (self.front + self.low), sample)
        return np.where(sample < self.end, sample, np.where(self.bracketed, 0.5 * (self.front + self.end), self.end))

    def take(self, c: Array, r: Array, noise: Array) -> None:
        """Update the state with the samples r = f(c)."""
        zero = r <= noise
        touches = ~zero & (c - r <= self.front + ULP * c)
        apart = ~zero & ~touches
        old, old_value = self.near, self.near_value
        self.slope = np.where(c != old, (r - old_value) / (c - old), self.slope)

        self.end = np.where(zero, c, self.end)
        self.end_value = np.where(zero, np.minimum(r, 0.0), self.end_value)
        self.low = np.where(zero, np.inf, self.low)

        moved = touches & (c + r > self.front)
        self.front = np.where(moved, c + r, self.front)
        self.near = np.where(moved, c, old)
        self.near_value = np.where(moved, r, old_value)
        self._cross(touches & (self.front >= self.low))

        joined = apart & (c + r >= self.low)
        self.island = np.where(apart & ~joined, c, self.island)
        self.island_value = np.where(apart & ~joined, r, self.island_value)
        self.low = np.where(apart, c - r, self.low)

    def leap(self, value: Value, lines: Lines, evaluations: Array, count: int, widest: Array) -> None:
        """Move the fronts by up to `count` samples at once, where those of a linear function would touch one another.

        A function of slope s that is r at `near` has the next samples near + 2 r / (1 - s) (1 + g + g^2 + ...), where
        g = (1 + s) / (1 - s). A ray uses its samples up to the first that does not touch the front.
        """
        slope = np.clip(self.slope, -1.0, RISE)
        slope -= CAUTION * np.abs(slope)
        steady = (np.abs(slope) < STEEP) & (self.low == np.inf) & (evaluations[self.row] < PATIENCE)
        who = np.flatnonzero(steady & (self.near_value * (1.0 + slope) > -widest * slope))
        if not who.size:
            return
        row, near, near_value, end = self.row[who], self.near[who], self.near_value[who], self.end[who]
        slope = slope[who, None]
        ratio = ((1.0 + slope) / (1.0 - slope)) ** np.arange(count)
        c = near[:, None] + np.cumsum(2.0 * near_value[:, None] / (1.0 - slope) * ratio, axis=1)
        taken = (c < end[:, None]) & (ratio > FAINT)
        rows = np.broadcast_to(row[:, None], c.shape)[taken]
        r = np.full(c.shape, -np.inf)
        r[taken] = value(rows, c[taken])
        evaluations[row] += taken.sum(axis=1)

        zero = np.zeros(c.shape, bool)
        zero[taken] = r[taken] <= lines.noise(rows, c[taken])
        reach = np.maximum.accumulate(np.concatenate([self.front[who, None], c + r], axis=1), axis=1)
        touches = np.logical_and.accumulate(taken & ~zero & (c - r <= reach[:, :-1] + ULP * c), axis=1)
        used, each = touches.sum(axis=1), np.arange(len(who))
        first_zero = np.minimum(used, count - 1)
        ended = ~touches[each, first_zero] & zero[each, first_zero]
        self.end[who[ended]] = c[ended, first_zero[ended]]
        self.end_value[who[ended]] = np.minimum(r[ended, first_zero[ended]], 0.0)

        last = np.where(touches, c + r, -np.inf).argmax(axis=1)
        moved = (used > 0) & (reach[each, used] > self.front[who])
        at, at_value = c[each, last], r[each, last]
        before = np.where(last > 0, c[each, last - 1], near)
        before_value = np.where(last > 0, r[each, last - 1], near_value)
        now = who[moved]
        self.slope[now] = np.where(at > before, (at_value - before_value) / (at - before), self.slope[who])[moved]
        self.front[now] = reach[each, used][moved]
        self.near[now], self.near_value[now] = at[moved], at_value[moved]

    def stride(self, value: Value, lines: Lines, evaluations: Array, count: int) -> None:
        """Move the fronts by up to `count` steps of at most `HALF` of the value at once.

        The steps are those of a linear function, r (1 + q + q^2 + ...) HALF with q = 1 + HALF s. A ray uses its samples
        up to the first that is too far from the one before.
        """
        slope = np.clip(self.slope, -1.0, RISE)
        shrink = 1.0 + HALF * (slope - CAUTION * (1.0 + np.abs(slope)))
        steps = HALF * self.near_value[:, None] * shrink[:, None] ** np.arange(count)
        c = self.near[:, None] + np.cumsum(steps, axis=1)
        taken = c < self.end[:, None]
        rows = np.broadcast_to(self.row[:, None], c.shape)[taken]
        r = np.full(c.shape, np.nan)
        r[taken] = value(rows, c[taken])
        evaluations[self.row] += taken.sum(axis=1)

        zero = np.zeros(c.shape, bool)
        zero[taken] = r[taken] <= lines.noise(rows, c[taken])
        taken[:, 1:] &= steps[:, 1:] <= HALF * r[:, :-1]
        used = np.logical_and.accumulate(taken & ~zero, axis=1).sum(axis=1)
        each, after = np.arange(len(c)), np.minimum(used, count - 1)
        ended = (used < count) & taken[each, after] & zero[each, after]
        self.end = np.where(ended, c[each, after], self.end)
        self.end_value = np.where(ended, np.minimum(r[each, after], 0.0), self.end_value)

        moved, last = used > 0, np.maximum(used - 1, 0)
        at, at_value = c[each, last], r[each, last]
        rise = (at_value - self.near_value) / (at - self.near)  # of all steps: a short one says little of a fractal
        self.slope = np.where(moved & (at > self.near), rise, self.slope)
        self.near, self.near_value = np.where(moved, at, self.near), np.where(moved, at_value, self.near_value)
        self.front = np.where(moved, at + HALF * at_value, self.front)

    def skip(self, now: Array) -> None:
        """Skip the gap before the island without a proof."""
        self.skipped = np.where(now, self.skipped + (self.low - self.front), self.skipped)
        self._cross(now)

    def _cross(self, now: Array) -> None:
        """Move the front behind the island."""
        further = now & (self.island + self.island_value > self.front)
        rise = (self.island_value - self.near_value) / (self.island - self.near)
        self.slope = np.where(further & (self.island > self.near), rise, self.slope)
        self.front = np.where(further, self.island + self.island_value, self.front)
        self.near = np.where(further, self.island, self.near)
        self.near_value = np.where(further, self.island_value, self.near_value)
        self.low = np.where(now, np.inf, self.low)


def _leap_of(turn: int) -> int:
    """How many samples a ray takes at once in a turn; 0 for one by one."""
    return next((count for first, count in LEAPS if turn >= first), 0)


def first_root(value: Value, lines: Lines) -> Roots:
    """The first root of each function; no earlier root exists outside `Roots.gap`.

    value : 1-Lipschitz functions that start above 0. A value that is 0 within rounding is a root.
    """
    found = _Found(lines)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        rays, turn = found.start(value), 0
        while rays.row.size:
            widest = lines.gap(rays.row, rays.front)
            if count := _leap_of(turn):
                rays.leap(value, lines, found.evaluations, count, widest)
                widest = lines.gap(rays.row, rays.front)
            turn += 1
            late = found.evaluations[rays.row] >= PATIENCE
            creeps = late & (rays.near_value < CREEPING * (lines.travelled[rays.row] + rays.near))
            if late.any():
                rays.creeping += creeps
                widest = np.where(creeps, widest * 2.0 ** (rays.creeping // DOUBLING), widest)
            c = rays.next_sample(widest, bold=creeps & (rays.creeping % 2 == 0))
            r = value(rays.row, c)
            found.evaluations[rays.row] += 1
            rays.take(c, r, lines.noise(rays.row, c))
            if late.any():
                rays.skip(creeps & (rays.low - rays.front <= widest))
            hit = rays.bracketed & (rays.end - rays.front <= widest)
            over = hit | (rays.front >= rays.end)
            if over.any():
                found.keep(rays.only(over & rays.bracketed))
                found.roots.gap[rays.row[over]] += rays.skipped[over]
                rays = rays.only(~over)
        return found.finish(value)


def first_root_of_estimate(value: Value, lines: Lines) -> Roots:
    """The first root of an estimate, by steps of half the value. Nothing is proved; `Roots.gap` is inf.

    A ray that is not finished after `PATIENCE` samples has a root at its last sample if the value there is below the
    allowed gap, else none.
    """
    found = _Found(lines)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        rays, turn = found.start(value, step_scale=HALF), 0
        while rays.row.size:
            if count := _leap_of(turn):
                rays.stride(value, lines, found.evaluations, count)
            else:
                c = rays.front
                r = value(rays.row, c)
                found.evaluations[rays.row] += 1
                zero = r <= lines.noise(rays.row, c)
                rays.end = np.where(zero, c, rays.end)
                rays.end_value = np.where(zero, np.minimum(r, 0.0), rays.end_value)
                rays.slope = np.where(c > rays.near, (r - rays.near_value) / (c - rays.near), rays.slope)
                rays.near = np.where(zero, rays.near, c)
                rays.near_value = np.where(zero, rays.near_value, r)
                rays.front = np.where(zero, rays.front, c + HALF * r)
            turn += 1
            found.keep(rays.only(rays.bracketed))
            late = rays.only(~rays.bracketed & (found.evaluations[rays.row] > PATIENCE))
            close = late.near_value <= lines.gap(late.row, late.near)
            found.roots.t[late.row[close]] = late.near[close]
            over = rays.bracketed | (found.evaluations[rays.row] > PATIENCE) | (rays.front >= rays.end)
            rays = rays.only(~over)
        roots = found.finish(value)
    roots.gap[:] = np.inf
    return roots


def first_crossing(search: Callable[[Value, Lines], Roots], value: Value, lines: Lines) -> Roots:
    """The first root of each function behind which it is negative. Roots at which it only touches 0 are passed.

    search : the search for a root. The first value behind a root that is more than rounding errors decides.
    """
    found = search(value, lines)
    rows = np.flatnonzero(np.isfinite(found.t))
    for _ in range(MOST_TOUCHED):
        noise = lines.noise(rows, found.t[rows])
        open_, touched, behind = np.arange(len(rows)), np.zeros(rows.shape, bool), found.t[rows]
        for step in (None, *STEPS_BEHIND):
            row, t = rows[open_], found.t[rows[open_]]
            c = t + (AT_ONCE * (lines.travelled[row] + t) if step is None else step * noise[open_])
            r = value(row, c)
            found.evaluations[row] += 1
            inside, outside = r < -noise[open_], (r > 2.0 * noise[open_]) & (step is not None)
            behind[open_], touched[open_] = c, ~inside
            open_ = open_[~inside & ~outside]
        rows, behind = rows[touched], behind[touched]
        if not rows.size:
            return found
        rest = Lines(behind, lines.end[rows], lines.size[rows], lines.travelled[rows])
        again = search(lambda i, t, rows=rows: value(rows[i], t), rest)  # type: ignore[misc]
        found.t[rows] = again.t
        found.evaluations[rows] += again.evaluations
        found.gap[rows] += again.gap
        rows = rows[np.isfinite(again.t)]
    found.t[rows] = np.inf
    return found


class _Found:
    """Collects the results."""

    def __init__(self, lines: Lines) -> None:
        n = lines.start.shape[0]
        self.lines = lines
        self.evaluations = np.zeros(n, np.int64)
        self.roots = Roots(np.full(n, np.inf), self.evaluations, np.zeros(n))
        self._brackets: list[_Rays] = []

    def start(self, value: Value, step_scale: float = 1.0) -> _Rays:
        """Take the first sample of each line; returns the rays that continue."""
        row = np.flatnonzero(self.lines.end > self.lines.start)
        t = self.lines.start[row]
        r = value(row, t)
        self.evaluations[row] += 1
        zero = r <= self.lines.noise(row, t)
        self.roots.t[row[zero]] = t[zero]
        nowhere, unknown = np.full(row.shape, np.inf), np.full(row.shape, np.nan)
        rays = _Rays(
            row=row,
            front=t + step_scale * r,
            near=t,
            near_value=r,
            slope=np.full(row.shape, -1.0),  # the first step is a plain one
            end=self.lines.end[row],
            end_value=unknown,
            low=nowhere,
            island=nowhere,
            island_value=unknown,
            creeping=np.zeros(row.shape, np.int64),
            skipped=np.zeros(row.shape),
        )
        return rays.only(~zero & (rays.front < rays.end))

    def keep(self, rays: _Rays) -> None:
        """Store rays with a bracket: positive at `near`, free up to `front`, 0 or less at `end`."""
        if rays.row.size:
            self.roots.gap[rays.row] = np.maximum(rays.end - rays.front, 0.0)
            self._brackets.append(rays)

    def finish(self, value: Value) -> Roots:
        if self._brackets:
            parts = [(b.row, b.near, b.near_value, b.end, b.end_value) for b in self._brackets]
            row, a, fa, b, fb = (np.concatenate(column) for column in zip(*parts, strict=True))
            self.roots.t[row] = self._refine(value, row, a, fa, b, fb)
        return self.roots

    def _refine(self, value: Value, row: Array, a: Array, fa: Array, b: Array, fb: Array) -> Array:
        """A root between a (positive value) and b (0 or less) by the Illinois method, a regula falsi.

        It ends at a value below rounding, or at a bracket of a few units in the last place.
        """
        best, best_value = b.copy(), np.abs(fb)
        active = np.flatnonzero(fb < 0.0)
        side = np.zeros(row.shape)
        for _ in range(100):
            if not active.size:
                break
            x0, x1, f0, f1 = a[active], b[active], fa[active], fb[active]
            x = x0 + (x1 - x0) * (f0 / (f0 - f1))
            x = np.where((x > x0) & (x < x1), x, 0.5 * (x0 + x1))
            f = value(row[active], x)
            self.evaluations[row[active]] += 1
            better = np.abs(f) < best_value[active]
            best[active[better]], best_value[active[better]] = x[better], np.abs(f[better])
            up = f > 0.0
            stuck_up, stuck_down = up & (side[active] > 0), ~up & (side[active] < 0)
            a[active], fa[active] = np.where(up, x, x0), np.where(up, f, np.where(stuck_down, 0.5 * f0, f0))
            b[active], fb[active] = np.where(up, x1, x), np.where(up, np.where(stuck_up, 0.5 * f1, f1), f)
            side[active] = np.where(up, 1.0, -1.0)
            grain = ULP * (self.lines.size[row[active]] + x)
            active = active[(np.abs(f) > grain) & (b[active] - a[active] > 4 * grain)]
        return best
