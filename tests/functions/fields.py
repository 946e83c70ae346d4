"""Many fields along a ray for tracers to march, and what holds for each of them."""

from __future__ import annotations

from functools import cache

import numpy as np

from tests.functions.profiles import PIXEL, Marched, Profiles, contact, deepest

FAR = 20.0
MANY = 1000


def random(rng: np.random.Generator, count: int = 4 * MANY) -> Profiles:
    """Slopes and lengths of all sizes, with walls that are met head on and rays that recede head on."""
    slopes = rng.uniform(-1, 1, (count, 7))
    slopes[rng.random((count, 7)) < 0.2] = -1
    slopes[rng.random((count, 7)) < 0.1] = 1
    return Profiles.of(10 ** rng.uniform(-2.5, 0.5, (count, 7)), slopes, 10 ** rng.uniform(-2, 0.3, count))


def _kinked(rng: np.random.Generator) -> Profiles:
    """A wall whose slope changes right before it is met, at heights from far below a pixel to many pixels."""
    slopes = -(10 ** rng.uniform(-1, 0, (MANY, 7)))
    kink = 10 ** rng.uniform(-6, -1, MANY)
    first = np.maximum(10 ** rng.uniform(-1, 0, MANY), 2 * kink)
    lengths = np.full((MANY, 7), 1.0)
    lengths[:, 0] = (first - kink) / -slopes[:, 0]
    return Profiles.of(lengths, slopes, first)


def _slabs(rng: np.random.Generator) -> Profiles:
    """Through a slab of some pixels or more and out again, towards the far end."""
    width, there, slope = 10 ** rng.uniform(-1.5, 0, MANY), rng.uniform(0.5, 3, MANY), rng.uniform(0.3, 1, MANY)
    lengths, slopes = np.ones((MANY, 7)), np.full((MANY, 7), 0.5)
    lengths[:, 0], lengths[:, 1], lengths[:, 2] = there, width / 2, width / 2
    slopes[:, 0] = slopes[:, 1] = -slope
    slopes[:, 2] = slope
    return Profiles.of(lengths, slopes, there * slope)


def _beside(rng: np.random.Generator) -> Profiles:
    """Down to a wall, along it within a tenth of a pixel or some pixels, then onto a post or away from it."""
    there, slope = rng.uniform(0.5, 3, MANY), rng.uniform(0.3, 1, MANY)
    height = PIXEL * there * 10 ** rng.uniform(-1.15, 1, MANY)
    lengths, slopes = np.ones((MANY, 7)), np.zeros((MANY, 7))
    lengths[:, 0], slopes[:, 0] = there, -slope
    lengths[:, 1], slopes[:, 1] = 9 * height / slope, -slope
    first = there * slope + 10 * height
    lengths[:, 2] = 10 ** rng.uniform(-3, -0.5, MANY)
    slopes[:, 3:] = np.where(rng.random(MANY) < 0.5, 1.0, -1.0)[:, None]
    return Profiles.of(lengths, slopes, first)


def _at_the_end(rng: np.random.Generator) -> Profiles:
    """Walls about where the ray ends, before it and beyond it."""
    slopes = np.repeat(-rng.uniform(0.05, 1, (MANY, 1)), 7, axis=1)
    first = -slopes[:, 0] * rng.uniform(FAR - 2, FAR + 2, MANY)
    return Profiles.of(np.full((MANY, 7), 3.0), slopes, first)


@cache
def everything() -> Profiles:
    rng = np.random.default_rng(20)
    return random(rng) + _kinked(rng) + _slabs(rng) + _beside(rng) + _at_the_end(rng)


def assert_true(of: Profiles, got: Marched, far: float, steps: int) -> None:
    """What holds for all rays of all tracers."""
    met = got.found & got.done
    f, least = of.at(got.t), of.least(got.t)
    assert np.all(np.abs(f[met]) <= deepest(got.t)[met])
    assert np.all(least[met] >= -deepest(got.t)[met])  # nothing is passed
    assert np.all(got.residual[met] <= contact(got.t)[met])
    assert np.all(of.root_of_cut()[got.done & ~got.found] > far * (1 - 1e-6))
    assert np.all(got.furthest <= 2 * far)  # a sphere at the end reaches beyond it by its radius
    np.testing.assert_allclose(got.residual[~met], np.abs(f[~met]), rtol=1e-4, atol=2e-6)
    assert np.all(got.residual >= 0)
    assert np.all(got.iterations <= steps)
    assert np.all(got.iterations[~got.done] == steps)
    assert np.all(got.evaluations == got.asked) and np.all(got.evaluations >= 1)
    assert np.all(got.evaluations == got.iterations)
    assert np.all(got.fallbacks <= got.iterations)
    assert np.all(got.twice <= 2)
