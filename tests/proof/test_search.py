"""What is left of a stretch beside the part around its centre that is free."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import cast

import numpy as np
import pytest

import raymarch as rm
from raymarch.proof import search
from raymarch.proof.parts import Operands
from raymarch.proof.rays import Rays, Stretch
from raymarch.proof.rounding import Array, Interval
from raymarch.proof.search import CONTRADICTED, PROVED, Given, Verdict, judge
from raymarch.scene.file import load
from raymarch.scene.parameter import Values


def test_nothing_that_may_be_0_is_left_out() -> None:
    """Places in no part are above 0 by exact arithmetic; parts do not overlap, and are at most half as long."""
    random, count = np.random.default_rng(5), 400
    start = random.uniform(0.0, 9.0, count)
    end = start + np.exp2(random.uniform(-30.0, 2.0, count))
    centre = np.where(np.arange(count) % 3, 0.5 * (start + end), end)
    value = (end - start) * random.choice([-1.0, 0.0, 1e-3, 0.3, 1.0], count)
    slope = np.sort(random.choice([-2.0, -0.7, -1e-9, 0.0, 1e-9, 0.4, 3.0], (2, count)), axis=0)
    slope = np.where(random.random((2, count)) < 0.1, [[-np.inf], [np.inf]], slope)
    every = np.arange(count)
    rest = Stretch(every, every, start, end).rest(centre, value, (slope[0], slope[1]))
    assert np.all(rest.start < rest.end) and len(rest) < 2 * count
    for i in every:
        parts = sorted(zip(rest.start[rest.rays == i], rest.end[rest.rays == i], strict=True))
        assert all(b - a <= 0.5 * (end[i] - start[i]) + 4.0 * np.spacing(end[i]) for a, b in parts)
        assert all(before[1] <= after[0] for before, after in pairwise(parts))
        beside = [np.nextafter(t, s) for a, b in parts for t, s in ((a, 0), (b, 99))]
        for t in (*np.linspace(start[i], end[i], 9), *beside):
            if not start[i] <= t <= end[i] or any(a <= t <= b for a, b in parts):
                continue
            way = Fraction(t) - Fraction(centre[i])
            steepest = slope[0][i] if way > 0 else slope[1][i]
            known = way == 0 or (np.isfinite(steepest) and Fraction(value[i]) + Fraction(steepest) * way > 0)
            assert value[i] > 0.0 and known


@pytest.mark.parametrize(
    "solid", [rm.box((0.9, 0.5, 0.7)).repeat(2.0, (3, 1, 1)), rm.sphere(0.4).repeat(1.0, (2, 2, 2))]
)
def test_values_over_a_jump_lie_within_the_hull_of_the_slopes(solid: rm.Node) -> None:
    random, count = np.random.default_rng(6), 500
    origins, way = random.uniform(-2.0, 2.0, (count, 3)), random.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    length = np.exp2(random.uniform(-8.0, 1.0, count))
    every, zero = np.arange(count), np.zeros(count, np.int64)
    made = Operands(solid, Values({}, 0.0), "camera", whole=False)
    _, at, slope = made.enclose(Rays(origins, way), Stretch(every, zero, np.zeros(count), length), 0.5 * length)
    assert np.isfinite(slope[0]).mean() > 0.5
    for share in np.linspace(-0.5, 0.5, 10):
        value = solid.distance(origins + ((0.5 + share) * length)[:, None] * way)
        ends = [share * length * each for each in slope]
        assert np.all(value >= at[0] + np.minimum(*ends) - 1e-12) and np.all(value <= at[1] + np.maximum(*ends) + 1e-12)


@pytest.mark.parametrize("solid", [rm.sphere(0.4), rm.box((9.0, 0.8, 0.8)).rotate(-0.02, "z"), rm.torus(0.35, 0.05)])
def test_what_is_less_deep_than_the_tolerance_takes_few_enclosures(solid: rm.Node) -> None:
    """Along all of it there is a point outside beside the ray, at one offset. What is deeper is found."""
    count, within = 60, 0.01
    origins = np.stack([np.full(count, -1.0), np.linspace(0.43, 0.37, count), np.zeros(count)], axis=1)
    way, zero, end = np.tile([1.0, 0.0, 0.0], (count, 1)), np.zeros(count), np.full(count, 2.0)
    along = origins[:, None] + np.linspace(0.0, 2.0, 999)[:, None] * way[:, None]
    deepest = -solid.distance(along.reshape(-1, 3)).reshape(count, -1).min(axis=1) / within
    made = Operands(solid, Values({}, 0.0), "camera", whole=False)
    tolerance = np.full(count, within)
    verdict = judge(Given(made, Rays(origins, way), zero, end, np.inf * end, tolerance, tolerance / 64.0))
    assert np.all(verdict.state[deepest < 0.8] == PROVED) and np.all(verdict.state[deepest > 1.0] == CONTRADICTED)
    assert (deepest < 0.8).sum() > 6 and verdict.evaluations[deepest < 0.8].max() < 100


class Blind:
    """An operand of which nothing is known, and that has no box."""

    def met(self, _rays: Rays, start: Array, end: Array) -> Stretch:
        every = np.arange(len(start))
        return Stretch(every, 0 * every, start, end)

    def enclose(self, _rays: Rays, at: Stretch, _centre: Array) -> tuple[Interval, Interval, Interval]:
        one = np.ones(len(at))
        return (-one, one), (-one, one), (np.inf * -one, np.inf * one)


def test_all_rays_together_have_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once they took enough, each is given a tenth of the evaluations that a ray has otherwise."""
    count, taken = 40, []
    every, zero, end = np.arange(count), np.zeros(count), np.ones(count)
    rays = Rays(np.zeros((count, 3)), np.tile([0.0, 0.0, 1.0], (count, 1)))
    given = Given(cast(Operands, Blind()), rays, zero, end, np.inf * end, 1e-9 * end, 1e-12 * end)
    monkeypatch.setattr(search, "LOST", np.inf)
    for enough in (search.ENOUGH, 1000):
        monkeypatch.setattr(search, "ENOUGH", enough)
        verdict = Verdict.unknown(end)
        search.free(given, Stretch(every, 0 * every, zero, end), end, given.shortest, verdict, slivers=False)
        assert (verdict.low < end).all()
        taken.append(verdict.evaluations.max())
    assert taken[0] > search.MOST and search.FEW < taken[1] < 3 * search.FEW


def test_most_hits_of_a_fractal_are_proved_in_few_enclosures() -> None:
    """Its field has no bounds along stretches that are many tolerances long, but along shorter ones."""
    scene = load(Path(__file__).parents[2] / "examples" / "mandelbulb.py")
    found = rm.prove(scene, rm.truth(scene, (16, 9), outputs=("depth",)))
    assert found.share > 0.4 and found.evaluations.mean() < 500


class Hidden(Blind):
    """An operand whose values are known up to a plane, and to be within bounds from there on."""

    def enclose(self, rays: Rays, at: Stretch, centre: Array) -> tuple[Interval, Interval, Interval]:
        height, way = rays.origins[at.rays, 2], rays.directions[at.rays, 2]
        one, before = np.ones(len(at)), 0.5 - (height + centre * way)
        known = before > 0.0
        fall = np.where(known, 1.0 - 9.0 / before, -np.inf)
        least = np.where(height + at.end * way < 0.5, 1.0, -1.0)
        return (least, one), (np.where(known, 1.0, -1.0), one), (fall, np.inf * one)


def test_a_ray_ends_early_where_its_field_is_not_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a few evaluations, and open from the place from which it is not known."""
    one, zero, end = np.zeros(1, np.int64), np.zeros(1), np.ones(1)
    given = Given(
        cast(Operands, Hidden()), Rays(np.zeros((1, 3)), np.eye(3)[2:]), zero, end, end, 1e-4 * end, 1e-9 * end
    )
    taken = []
    for lost in (search.LOST, np.inf):
        monkeypatch.setattr(search, "LOST", lost)
        verdict = Verdict.unknown(end)
        search.free(given, Stretch(one, one, zero, end), end, given.shortest, verdict, slivers=False)
        assert 0.49 < verdict.low[0] <= 0.5 and verdict.high[0] == np.inf
        taken.append(verdict.evaluations[0])
    assert taken[0] < 100 and taken[1] > 10 * taken[0]
