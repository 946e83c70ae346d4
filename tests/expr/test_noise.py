"""Noise: ranges, slopes, periods, the formulas written anew, and the GLSL."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr.arrays import evaluator, value_of
from raymarch.expr.hashing import pcg
from raymarch.expr.lattice import WORLEY, gradient_lattice, gradient_lattice_in_time, lattice_noise
from raymarch.expr.node import var
from raymarch.expr.types import VEC3, VECTORS
from tests.support.refusals import refused

P, Q = var("p", VEC3), var("q", VECTORS[4])
POINTS = np.random.default_rng(2).uniform(-40.0, 40.0, (12_000, 3))


def at(expression: Any, points: Any = POINTS) -> Any:
    return evaluator([expression], [P if points.shape[1] == 3 else Q])(points)[0]


def hashed(cells: Any) -> Any:
    """The bits of integer cells, (N, 3)."""
    n = cells.astype(np.int64).astype(np.uint32)
    return pcg(n[:, 0] + pcg(n[:, 1] + pcg(n[:, 2]))) >> np.uint32(8)


def thirds(bits: Any) -> Any:
    """Three numbers in [0, 1) of 24 bits: those from the first, the ninth and the seventeenth bit on."""
    return np.stack([bits, (bits << 8) & 0xFFFFFF, (bits << 16) & 0xFFFFFF], axis=1) / 2.0**24


def test_gradient_noise_is_that_of_perlin() -> None:
    """Written anew from the formula: random unit slopes, weights of 2002."""
    cells = np.floor(POINTS)
    t = POINTS - cells
    weights = 6 * t**5 - 15 * t**4 + 10 * t**3
    total = np.zeros(len(POINTS))
    for corner in itertools.product((0, 1), repeat=3):
        slope = 2.0 * thirds(hashed(cells + corner)) - 1.0
        slope /= np.linalg.norm(slope, axis=1, keepdims=True)
        share = np.prod(np.where(corner, weights, 1.0 - weights), axis=1)
        total += share * np.sum(slope * (t - corner), axis=1)
    np.testing.assert_allclose(at(rm.gradient_noise(P)), total * 2 / 3**0.5, atol=1e-12)


def test_worley_is_the_distance_to_the_nearest_points() -> None:
    """By brute force over 125 cells; points at 1 or more do not count."""
    some = POINTS[:2000]
    ways = []
    for offset in itertools.product(range(-2, 3), repeat=3):
        cells = np.floor(some) + offset
        ways.append(np.linalg.norm(cells + thirds(hashed(cells)) - some, axis=1))
    first, second = np.minimum(np.sort(ways, axis=0)[:2], 1.0)
    for feature, wanted in (("F1", first), ("F2", second), ("F2-F1", second - first)):
        np.testing.assert_allclose(at(rm.worley(P, feature), some), wanted, atol=1e-12)


@pytest.mark.parametrize("name", ["lattice", "gradient", "gradient in time", *WORLEY])
def test_limits_hold_and_are_sharp(name: Any) -> None:
    definition = {
        "lattice": lattice_noise,
        "gradient": gradient_lattice,
        "gradient in time": gradient_lattice_in_time,
        **WORLEY,
    }[name]
    limits = definition.stated.limits
    value = definition(P, *[rm.expr.node.const(x) for x in (0.0, 2.0)][: len(definition.params) - 1])
    random = np.random.default_rng(5)
    directions = random.normal(size=POINTS.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    h = 1e-4
    before, here, after = (at(value, POINTS + k * h * directions) for k in (-1, 0, 1))
    assert limits.low - 1e-12 <= here.min() and here.max() <= limits.high + 1e-12
    assert here.max() - here.min() > 0.6 * (limits.high - limits.low)
    steepest = np.abs(after - here).max() / h
    assert 0.5 * limits.steepest < steepest <= limits.steepest * (1.0 + 1e-6)
    if np.isfinite(limits.bend):
        bend = np.abs(after - 2.0 * here + before).max() / h**2
        assert 0.4 * limits.bend < bend <= limits.bend * (1.0 + 1e-2)


@pytest.mark.parametrize("make", [rm.fbm, rm.turbulence, rm.ridged])
def test_octaves_are_the_mean_of_layers(make: Any) -> None:
    shape = {rm.fbm: lambda n: n, rm.turbulence: abs, rm.ridged: lambda n: (1 - abs(n)) ** 2}[make]
    one = make(P, 1)
    np.testing.assert_allclose(at(one), shape(at(rm.gradient_noise(P))), atol=1e-12)
    whole = at(make(P, 4, gain=0.6, lacunarity=1.9))
    low = -1.0 if make is rm.fbm else 0.0
    assert low <= whole.min() < 0.5 * low + 0.3 and 0.4 < whole.max() <= 1.0
    assert np.std(whole - at(make(P, 4, gain=0.6, lacunarity=1.9, seed=3))) > 0.05
    assert not np.array_equal(at(make(P, 4)), at(make(P, 4, noise="value")))


@pytest.mark.parametrize(
    ("make", "period"),
    [
        (lambda q: rm.value_noise(q, period=3), 3),
        (lambda q: rm.gradient_noise(q, seed=2, period=3), 3),
        (lambda q: rm.fbm(q, 3, period=2), 2),
        (lambda q: rm.fbm(q, 3, lacunarity=1.7, period=5), 5),
        (lambda q: rm.worley(q, period=4), 4),
    ],
)
def test_a_period_closes_a_loop_in_time(make: Any, period: int) -> None:
    points = np.random.default_rng(3).uniform(-9.0, 9.0, (2000, 4))
    here = at(make(Q), points)
    np.testing.assert_allclose(at(make(Q), points + np.array([0, 0, 0, period])), here, atol=1e-9)
    assert np.abs(at(make(Q), points + np.array([0, 0, 0, 0.5 * period])) - here).mean() > 0.05


def test_time_changes_smoothly_and_flat_points_are_the_plane() -> None:
    points = np.random.default_rng(3).uniform(-9.0, 9.0, (2000, 4))
    for make in (rm.value_noise, rm.gradient_noise, rm.worley):
        moved = at(make(Q), points + np.array([0, 0, 0, 1e-5])) - at(make(Q), points)
        assert 0.0 < np.abs(moved).max() < 1e-4
    assert float(value_of(rm.fbm((0.3, 0.7)))) == float(value_of(rm.fbm((0.3, 0.7, 0.0))))


def test_noise_displaces_solids_and_its_range_is_known() -> None:
    hills = rm.plane().displace_by(lambda p: 0.3 * rm.fbm(p.xz, 6, noise="value"))
    assert float(hills.params["amplitude"].data) == pytest.approx(0.3)
    cells = rm.sphere().displace(lambda p: 0.1 * rm.worley(3.0 * p, "F2-F1"))
    assert float(cells.params["amplitude"].data) == pytest.approx(0.1)
    assert float(cells.params["slope"].data) <= 0.6 * 3**0.5 + 1e-9
    within = rm.sphere(rm.Param("r", 1.0, 0.5, 1.5) + 0.1 * rm.gradient_noise(rm.vec3(rm.time)))
    assert within.bounds[1][0] == pytest.approx(1.6)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: rm.fbm(1.0), "a vec3 or a vec2"),
        (lambda: rm.fbm(P, 0), "from 1 to 16"),
        (lambda: rm.fbm(P, gain=2.0), "from 0 to 1"),
        (lambda: rm.fbm(P, lacunarity=0.5), "from 1 to 8"),
        (lambda: rm.fbm(P, noise="simplex"), "'value' or 'gradient'"),
        (lambda: rm.worley(P, "F3"), "'F1', 'F2' or 'F2-F1'"),
        (lambda: rm.gradient_noise(P, seed=0.5), "an integer"),
        (lambda: rm.gradient_noise(P, period=-1), "from 0 to"),
    ],
)
def test_refused(make: Any, says: str) -> None:
    refused(make, says)
