"""Whether two renderers draw the same picture, as a test of significance: each pixel's difference over its own noise.

Both pictures are drawn in independent batches, of which each pixel's mean and the variance of that mean are known. The
difference over its standard deviation then follows Student's distribution (Welch 1947). With N pixels some are far out
by chance alone, so a pixel counts as different if its probability is below 1 - (1 - ALPHA)^(1/N) (Šidák 1967): of
pictures that are the same, one in 1 / ALPHA has any such pixel. The mean over all pixels is tested too; it sees what is
far below the noise of one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtr

import raymarch as rm

ALPHA = 0.01
"""How often two pictures of the same light may be called different."""

GRAIN = 1e-4
"""Differences below this share of a pixel's light are none: what float32, and a hit near its surface, may do."""

Array = NDArray[Any]


@dataclass(frozen=True)
class Verdict:
    """What the test says of two pictures.

    pixels : compared. different : of them, beyond what chance allows. worst : the largest difference, whole : that of
    the mean over the picture, both in standard deviations of a normal law. allowed : what chance leaves the worst.
    """

    pixels: int
    different: int
    worst: float
    whole: float
    allowed: float


def our_batches(renderer: rm.Renderer, scene: rm.Scene, batches: int, samples: int) -> Array:
    """Independent means of our picture, (batches, H, W, 3): frames that accumulate, taken apart again."""
    renderer.forget()
    going = scene.replace(quality=replace(scene.quality, temporal="accumulate", samples=samples))
    sums = [np.zeros(())]
    for k in range(batches):
        sums.append(renderer.render(going).color.astype(np.float64) * (k + 1))
    return np.stack([after - before for before, after in pairwise(sums)])


def verdict(ours: Array, theirs: Array, seen: Array) -> Verdict:
    """The test of two pictures in batches, (batches, H, W, 3), of the mean of their channels, where `seen` (H, W)."""
    a, b = (batches.mean(axis=-1)[:, seen] for batches in (ours, theirs))
    chance = -np.expm1(np.log1p(-ALPHA) / seen.sum())
    single, whole = _probability(a, b), _probability(a.mean(axis=1), b.mean(axis=1))
    return Verdict(
        pixels=int(seen.sum()),
        different=int(np.sum(single < chance)),
        worst=_deviations(single.min()),
        whole=_deviations(whole),
        allowed=_deviations(chance),
    )


def _probability(ours: Array, theirs: Array) -> Array:
    """How probable it is that means of the same light lie so far apart, (batches, ...) -> (...).

    The means may differ by `GRAIN` of the light for free. Where nothing varies, what is beyond that is impossible.
    """
    free = GRAIN * np.maximum(np.abs(theirs.mean(axis=0)), 1e-3)
    off = np.maximum(np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) - free, 0.0)
    each = [(batches.var(axis=0, ddof=1) + (1e-3 * free) ** 2) / len(batches) for batches in (ours, theirs)]
    variance = each[0] + each[1]
    freedom = variance**2 / (each[0] ** 2 / (len(ours) - 1) + each[1] ** 2 / (len(theirs) - 1))
    return np.asarray(2.0 * stdtr(freedom, -off / np.sqrt(variance)))


def _deviations(probability: Any) -> float:
    """How far out a normal law is so improbable on both sides."""
    return float(-ndtri(max(float(probability), 1e-300) / 2.0))
