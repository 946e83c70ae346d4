"""The Pareto front: the settings that no other beats in both error and cost."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

T = TypeVar("T")


def pareto(points: Sequence[T], cost: Callable[[T], float], error: Callable[[T], float]) -> list[T]:
    """The Pareto-optimal points, by ascending cost: no other is at least as good in both and better in one.

    Points whose cost or error is nan are never on the front.
    """
    usable = [p for p in points if cost(p) == cost(p) and error(p) == error(p)]
    best, found = float("inf"), []
    for point in sorted(usable, key=lambda p: (cost(p), error(p))):
        if error(point) < best:
            found.append(point)
            best = error(point)
    return found


def behind(point: T, points: Sequence[T], cost: Callable[[T], float], error: Callable[[T], float]) -> float:
    """Cost of a point over that of the cheapest one with no larger error; 1 on the front."""
    rivals = [cost(p) for p in points if error(p) <= error(point)]
    return cost(point) / min([*rivals, cost(point)])
