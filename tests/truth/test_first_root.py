"""The search for first roots, on functions whose roots are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from raymarch.truth.march import GAP, PATIENCE, Lines, first_crossing, first_root, first_root_of_estimate


def lines(start: Any, end: Any) -> Lines:
    start, end = np.broadcast_arrays(np.asarray(start, np.float64), np.asarray(end, np.float64))
    return Lines(start.copy(), end.copy(), np.zeros(start.shape), np.zeros(start.shape))


class Polygons:
    """Random polygonal functions that start above 0 and are never steeper than 1."""

    def __init__(self, slopes: Any, lengths: Any, first: Any) -> None:
        zero = np.zeros((len(first), 1))
        self.x = np.concatenate([zero, np.cumsum(lengths, axis=1)], axis=1)
        self.y = np.concatenate([zero, np.cumsum(lengths * slopes, axis=1)], axis=1) + first[:, None]

    def __call__(self, rows: Any, t: Any) -> Any:
        x, y, i = self.x[rows], self.y[rows], np.arange(len(rows))
        k = np.clip((x <= t[:, None]).sum(axis=1) - 1, 0, x.shape[1] - 2)
        return y[i, k] + (y[i, k + 1] - y[i, k]) * (t - x[i, k]) / (x[i, k + 1] - x[i, k])

    @property
    def roots(self) -> Any:
        i, below = np.arange(len(self.x)), self.y[:, 1:] <= 0
        k = np.argmax(below, axis=1)
        drop = self.y[i, k] - self.y[i, k + 1]
        share = self.y[i, k] / np.where(below.any(axis=1), drop, 1.0)
        return np.where(below.any(axis=1), self.x[i, k] + (self.x[i, k + 1] - self.x[i, k]) * share, np.inf)


@pytest.mark.parametrize("kind", ["any slope", "saw", "needles"])
def test_no_root_is_stepped_over(kind: str) -> None:
    random = np.random.default_rng(7)
    shape = (3000, 60)
    if kind == "any slope":
        slopes, lengths = random.uniform(-1, 1, shape), random.exponential(0.3, shape)
    elif kind == "saw":
        slopes, lengths = random.choice([-1, 1, 0.99, -0.99, -0.02], shape), random.exponential(0.3, shape) ** 2 + 1e-9
    else:  # flat, but for a dip of a hair's breadth that goes just below 0
        slopes = np.tile([0.0, -1.0, 1.0], 20) * np.ones(shape)
        lengths = np.where(slopes == 0.0, random.exponential(0.3, shape), 1e-3)
        dip = random.integers(0, 20, 3000)
        i = np.arange(3000)
        for k in (1, 2):
            lengths[i, 3 * dip + k] = 0.0501
    first = np.full(3000, 0.05) if kind == "needles" else random.uniform(0.1, 2.0, 3000)
    f = Polygons(slopes, lengths, first)
    found = first_root(f, lines(0.0, f.x[:, -1]))
    wanted = f.roots
    assert np.isfinite(wanted).mean() > 0.3
    assert np.array_equal(np.isfinite(found.t), np.isfinite(wanted))
    there = np.isfinite(wanted)
    np.testing.assert_allclose(found.t[there], wanted[there], rtol=1e-12, atol=1e-12)
    assert np.all(found.gap[there] <= GAP * found.t[there] * 1.001)
    assert np.all(found.gap[~there] == 0.0)


@pytest.mark.parametrize("slope", [1.0, 0.5, 0.1, 0.01, 0.002])
def test_samples_on_a_straight_descent(slope: float) -> None:
    """A front gains (1 - k) / (1 + k) a sample; the root itself is exact."""
    found = first_root(lambda _rows, t: slope * (3.0 - t), lines([0.0], [10.0]))
    least = np.log(1 / GAP) / np.log((1 + slope) / (1 - slope)) if slope < 1 else 0
    assert abs(found.t[0] - 3.0) < 1e-14 / slope
    assert found.evaluations[0] <= 1.05 * least + 6
    assert found.gap[0] <= GAP * 3.0 * 1.001


def test_a_kink_beside_the_root() -> None:
    """One secant step over the last bracket would end at the wrong place."""
    f = Polygons(np.array([[-1.0, -0.2, -1.0]]), np.array([[3.0 - 4e-9, 4e-8, 1.0]]), np.array([3.0]))
    found = first_root(f, lines(np.zeros(1), f.x[:, -1]))
    assert abs(found.t[0] - (3.0 + 1.6e-8)) < 1e-14


def test_a_root_beyond_the_end_is_none() -> None:
    found = first_root(lambda _rows, t: 3.0 - t, lines([0.0, 0.0, 3.5, 1.0], [2.999, 3.001, 3.4, 1.0]))
    assert found.t[0] == np.inf and abs(found.t[1] - 3.0) < 1e-15
    assert np.all(found.t[2:] == np.inf) and np.all(found.evaluations[2:] == 0)


def test_a_start_at_or_below_zero_is_a_root() -> None:
    found = first_root(lambda rows, t: np.array([0.0, -1.0])[rows] + t, lines([0.0, 0.0], [9.0, 9.0]))
    assert found.t.tolist() == [0.0, 0.0] and found.evaluations.tolist() == [1, 1]


def test_a_touching_ray_ends_and_says_what_it_left() -> None:
    """min f = 0 without a change of sign, and 1e-14 above it: either answer will do, but for how much was skipped."""
    height = np.array([0.0, 1e-14])
    found = first_root(lambda rows, t: height[rows] + (t - 2.0) ** 2 / 8, lines([0.0, 0.0], [4.0, 4.0]))
    assert np.all(found.evaluations > PATIENCE) and np.all(found.evaluations < 2 * PATIENCE)
    assert np.all((found.gap > 0.0) & (found.gap < 0.02))


def test_a_near_miss_is_proved_and_so_is_what_comes_after() -> None:
    """Down to 1e-6 of 0, up again, and a root behind."""

    def f(_rows: Any, t: Any) -> Any:
        return np.where(t < 3.0, 1e-6 + (t - 2.0) ** 2 / 8, np.minimum(1e-6 + 0.125, 4.0 - t))

    found = first_root(f, lines([0.0], [9.0]))
    assert abs(found.t[0] - 4.0) < 1e-13
    assert found.gap[0] < GAP * 4.0 * 1.001


def test_an_estimate_is_walked_by_halves() -> None:
    """Nothing is certain, and nothing is claimed; a value up to twice too large still does no harm."""
    found = first_root_of_estimate(lambda _rows, t: 1.9 * (3.0 - t), lines([0.0, 0.0], [9.0, 2.0]))
    assert abs(found.t[0] - 3.0) < 1e-13 and found.t[1] == np.inf
    assert np.all(found.gap == np.inf)


@pytest.mark.parametrize("search", [first_root, first_root_of_estimate])
def test_a_root_does_not_depend_on_other_rays(search: Any) -> None:
    """A picture in bands, or by several processes, has the bits of the whole."""
    random = np.random.default_rng(9)
    slopes, lengths = random.uniform(-0.3, 0.2, (400, 40)), random.exponential(0.3, (400, 40))
    f = Polygons(slopes, lengths, random.uniform(0.1, 2.0, 400))
    whole = search(f, lines(0.0, f.x[:, -1]))
    some = slice(7, 19)
    part = search(lambda rows, t: f(rows + 7, t), lines(0.0, f.x[some, -1]))
    assert np.isfinite(part.t).any() and part.evaluations.max() > 60
    for name in ("t", "evaluations", "gap"):
        assert np.array_equal(getattr(part, name), getattr(whole, name)[some]), name


def test_a_function_that_touches_zero_is_passed() -> None:
    """|t - 2| touches 0; with a dip of 1e-9 it crosses."""
    dip = np.array([0.0, 1e-9])
    found = first_crossing(
        first_root, lambda i, t: np.minimum(np.abs(t - 2.0) - dip[i], 5.0 - t), lines([0, 0], [9, 9])
    )
    assert found.t == pytest.approx([5.0, 2.0], abs=1e-8)
