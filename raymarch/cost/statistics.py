"""Medians with confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Median:
    """A median with a confidence interval for the true one.

    The ends of the interval are order statistics, so no distribution is assumed. Fewer than 6 values cannot reach 95 %:
    the interval then extends from the smallest to the largest value.
    """

    value: float
    low: float
    high: float
    confidence: float
    count: int

    def overlaps(self, other: Median) -> bool:
        """True if the two intervals intersect."""
        return self.low <= other.high and other.low <= self.high

    def as_dict(self) -> dict[str, float | None]:
        """Plain data for JSON; None for nan."""
        found = {"median": self.value, "low": self.low, "high": self.high, "confidence": self.confidence}
        return {name: None if value != value else value for name, value in found.items()}

    def __str__(self) -> str:
        return f"{self.value:.4g} [{self.low:.4g}, {self.high:.4g}]"


def median(values: Sequence[float]) -> Median:
    """The median of at least one value. ValueError for none."""
    if not values:
        raise ValueError("median of no values; legal: at least one")
    ordered = sorted(values)
    n = len(ordered)
    middle = 0.5 * (ordered[(n - 1) // 2] + ordered[n // 2])
    rank = 0  # values outside of the interval on each side
    while 2 * (rank + 1) < n and _coverage(n, rank + 1) >= CONFIDENCE:
        rank += 1
    return Median(middle, ordered[rank], ordered[n - 1 - rank], _coverage(n, rank), n)


def _coverage(n: int, rank: int) -> float:
    """Probability that the true median lies between the (rank+1)-th smallest and largest of n values."""
    return 1.0 - 2.0 * sum(comb(n, k) for k in range(rank + 1)) / 2.0**n
