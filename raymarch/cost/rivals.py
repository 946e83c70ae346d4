"""Which setting to recommend: judged in several views, compared by times taken in turns, ties to the sturdier one.

The times of two settings are compared frame by frame within a turn, so that load on the machine cancels. A setting is
faster only if the 95 % interval of these ratios lies below what is worth a change; else the two tie, and the sturdier
one is recommended, the scene's own first. So noise decides nothing. Rivals that are close are timed again.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from raymarch.cost.drawing import timed
from raymarch.cost.errors import Errors
from raymarch.cost.settings import marches_alone
from raymarch.cost.statistics import Median, median
from raymarch.cost.sweep import Point, Progress, Sweep
from raymarch.scene.quality import PROMISED, Quality
from raymarch.scene.scene import Scene

METRIC = "pixels_p99"
"""The error that is bounded: 99 % of the hits away from silhouettes lie within it."""
WORTH = 0.9
"""A setting is worth a change if it takes less than this many times as long."""
REST = 10.0
"""Of the other hits, all but one in a thousand lie within this many times the bound. So a whole face that is wrong is
not hidden by a large floor that is right."""
SAME = 1.1
"""Errors within this factor tie."""
FINEST = PROMISED["exact"]
"""Errors in pixels that tie, as float32 allows no better ones in general."""
MOST = 8
"""Largest number of rivals that are timed again."""
TURNS = (12, 24, 36)
"""Numbers of turns after which the rivals may be decided."""

_REFINEMENTS = ("none", "slope", "proven")


def candidates(made: Sweep) -> list[Point]:
    """The sound settings that change the marching alone, so that their pictures differ from the scene's by error only.

    Fewer rays per pixel, other normals or another resolution would be cheaper in ways that the distance of hits does
    not show. Sound means that no hit is missed or false away from silhouettes, in the picture and in the other views.
    """
    base = made.base.setting.quality
    return [
        p
        for p in made.comparable(METRIC)
        if p.error(METRIC) < float("inf") and all(errors.sound for errors in p.views) and marches_alone(p.setting, base)
    ]


def reach(point: Point) -> float:
    """The least bound in pixels that a setting keeps in all views: 99 % of its hits within it, and 99.9 % within ten
    times of it."""
    return max(point.error(METRIC), *(_reach(errors) for errors in (point.errors, *point.views)))


def _reach(errors: Errors) -> float:
    """The same of one picture; 0 if nothing could be compared."""
    found = max(errors.pixels_p99, errors.pixels_p999 / REST)
    return 0.0 if found != found else found


def ratio(point: Point, other: Point) -> Median:
    """Times of a setting over those of another, turn by turn, with their interval; evaluations without times."""
    if not (point.times and other.times):
        found = (point.evaluations + 1e-9) / (other.evaluations + 1e-9)
        return Median(found, found, found, 1.0, 0)
    one, two = (point.again, other.again) if point.again and other.again else (point.times, other.times)
    return median([a / b for a, b in zip(one, two, strict=False)])


def ties(point: Point, other: Point) -> bool:
    """True if a setting does not surely take longer than another by as much as is worth a change."""
    return point is other or ratio(point, other).low <= 1.0 / WORTH


def sturdiness(point: Point, base: Quality) -> tuple[int, int, bool]:
    """The order of settings that tie, the sturdiest first: the scene's own; then those that weaken the fewest of its
    limits (steps, epsilon, refinement, length of steps); then those with the fewest changes; then presets."""
    own = point.setting.quality
    wider = (own.epsilon or 0.0) > (base.epsilon or 0.1) or (own.epsilon is None and (base.epsilon or 0.1) < 0.1)
    weaker = (
        own.max_steps < base.max_steps,
        wider,
        _REFINEMENTS.index(own.refinement) < _REFINEMENTS.index(base.refinement),
        own.step_scale > base.step_scale,
    )
    changed = sum(getattr(own, name) != getattr(base, name) for name in own.__dataclass_fields__)
    return sum(weaker), changed, point.setting.preset is None


def chosen(able: Sequence[Point], made: Sweep, finer: Point | None = None) -> Point:
    """The setting to recommend of at least one: the sturdiest of those that tie with the fastest.

    finer : the one that is recommended within a narrower bound. It is kept if it ties, unless the scene's own does.
    """
    timed = [p for p in able if p.again] or able
    fastest = min(timed, key=lambda p: (ratio(p, made.base).value, reach(p)))
    tied = [p for p in timed if ties(p, fastest)]
    kept = [p for wanted in (made.base, finer) for p in tied if p is wanted]
    return kept[0] if kept else _sturdiest(tied, made)


def most_exact(able: Sequence[Point], made: Sweep) -> Point:
    """The most exact of at least one setting: the sturdiest of those whose errors tie with the least."""
    least = max(min(map(reach, able)) * SAME, FINEST)
    return _sturdiest([p for p in able if reach(p) <= least], made)


def _sturdiest(points: Iterable[Point], made: Sweep) -> Point:
    base = made.base.setting.quality
    return min(points, key=lambda p: sturdiness(p, base))


def time_again(
    made: Sweep,
    scene: Scene,
    renderer: Any,
    bounds: Sequence[float],
    time: float = 0.0,
    params: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> None:
    """Time the settings that may be recommended within some bounds again, in turns with the scene's own, until each is
    surely worth a change or surely not, or `TURNS` are over."""
    rivals = _rivals(made, bounds)
    if not rivals:
        return
    tell, chance = progress or (lambda _what, _share: None), random.Random(made.seed)
    drawn = [made.base, *(p for p in rivals if p is not made.base)]
    again: dict[int, list[float]] = {id(p): [] for p in drawn}
    for turn in range(TURNS[-1]):
        tell("time: rivals again", turn / TURNS[-1])
        chance.shuffle(drawn)
        for point in drawn:
            again[id(point)].append(timed(scene, point.setting, renderer, time, params).drawing)
        if turn + 1 in TURNS:
            for point in drawn:
                point.again = list(again[id(point)])
            if all(_decided(p, made.base) for p in rivals):
                break


def _decided(point: Point, base: Point) -> bool:
    found = ratio(point, base)
    return found.high < WORTH or found.low > WORTH


def _rivals(made: Sweep, bounds: Sequence[float]) -> list[Point]:
    """The settings within some bound that may be worth a change: the fastest, and the sturdiest of them; [] if none."""
    able, found = candidates(made), dict[int, Point]()
    for bound in bounds:
        within = [p for p in able if reach(p) <= bound]
        faster = [p for p in within if ratio(p, made.base).low < WORTH]
        faster.sort(key=lambda p: ratio(p, made.base).value)
        near = sorted(faster[: 2 * MOST], key=lambda p: sturdiness(p, made.base.setting.quality))
        found.update((id(p), p) for p in (*faster[:2], *near[:2]))
    return list(found.values())[:MOST]
