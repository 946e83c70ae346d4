"""What is shown of folds of two values, against the folds themselves."""

from __future__ import annotations

import numpy as np
import pytest

from raymarch.expr.arrays import FLOAT64
from raymarch.expr.evaluate import Program
from raymarch.expr.node import Expr, const
from raymarch.expr.vocabulary import abs, max, min
from raymarch.expr.walk import substitute
from raymarch.proof.folds import SLACK, A, B, Fold
from raymarch.proof.rounding import Array
from raymarch.sdf.blends import FAMILIES, REACH

K = 0.2
SHOWN = ["quadratic", "cubic", "quartic", "circular", "exponential"]


def body(family: str) -> Expr:
    call = FAMILIES[family](4).fold(A, B, const(K))
    return substitute([call.data.body], dict(zip(call.data.params, call.args, strict=True)))[0]


def values(fold: Expr, a: Array, b: Array) -> Array:
    return np.asarray(Program([fold], [A, B], FLOAT64)(a, b)[0])


@pytest.mark.parametrize("family", SHOWN)
def test_reach_and_sag(family: str) -> None:
    """The reach is the documented one, within which values matter; none is called without effect that has one."""
    fold = body(family)
    found = Fold(fold)
    if family in REACH:
        assert found.reach == pytest.approx(REACH[family] * K, rel=1e-5)
    assert found.sag == pytest.approx(0.25 * K, rel=1e-6) and found.excess < 1e-15 and found.rise < 1e-14
    difference = np.linspace(0.0, 2.0 * found.reach, 4001)
    zero = np.zeros_like(difference)
    for pair in ((zero, difference), (difference, zero)):
        lowered = -values(fold, *pair)
        dropped = found.drops(np.stack([zero, zero]), np.stack([difference, difference]))
        assert np.all(lowered[dropped] <= found.trace + 1e-17) and 0.4 < dropped.mean() < 0.6
        assert np.all(lowered <= found.sag * (1.0 + 1e-9))


@pytest.mark.parametrize("family", [*SHOWN, "stairs"])
def test_all_values_of_a_fold_are_enclosed(family: str) -> None:
    """Of two values along a stretch, and from its centre on."""
    fold, random, n = body(family), np.random.default_rng(3), 3000
    first, second = (random.uniform(-0.3, 0.3, n) for _ in range(2))
    slopes = random.uniform(-1.0, 1.0, (2, n))
    length = np.exp2(random.uniform(-12.0, 0.0, n))
    ends = []
    for at, slope in ((first, slopes[0]), (second, slopes[1])):
        reach = np.abs(slope) * length
        ends.append(np.stack([at - reach, at + reach, at, at, slope, slope]))
    found = Fold(fold)(ends[0], ends[1], length, length)
    for share in np.linspace(-1.0, 1.0, 21):
        there = share * length
        value = values(fold, first + slopes[0] * there, second + slopes[1] * there)
        assert np.all((found[0] <= value + 1e-14) & (value - 1e-14 <= found[1]))
        steep = np.clip(found[4:], -1e9, 1e9) * there
        assert np.all(found[2] + steep.min(axis=0) <= value + 1e-14)
        assert np.all(value - 1e-14 <= found[3] + steep.max(axis=0))
    if family in SHOWN:
        assert np.all(found[1] - found[0] <= 2.0 * length * np.abs(slopes).max(axis=0) * (1.0 + 1e-6))
        assert np.all(found[4:] >= slopes.min(axis=0) - 1e-12) and np.all(found[4:] <= slopes.max(axis=0) + 1e-12)


def tree(fold: Expr, row: list[float]) -> float:
    """The fold of many; inf is left out."""
    while len(row) > 1:
        pairs = [[v for v in row[i : i + 2] if v < np.inf] for i in range(0, len(row), 2)]
        row = [float(values(fold, *np.array(p))) if len(p) == 2 else min_of(p) for p in pairs]
    return row[0]


def min_of(some: list[float]) -> float:
    return some[0] if some else np.inf


@pytest.mark.parametrize("family", SHOWN)
def test_the_bound_of_many_and_their_weights(family: str) -> None:
    """Folds in random order are above `joint`; without some values they rise by less than the weights say."""
    fold, random = body(family), np.random.default_rng(5)
    found = Fold(fold)
    closest, ratios = [], []
    for _ in range(60):
        many = random.permutation(np.exp(random.uniform(-8.0, 0.5, random.integers(2, 40))))
        far = many > random.uniform(0.02, 0.4)
        whole, few = tree(fold, list(many)), tree(fold, list(np.where(far, np.inf, many)))
        bound = float(found.joint(np.zeros(len(many), int), many, np.ones(len(many)), 1)[0])
        assert bound <= whole
        closest.append(whole - bound)
        if far.any() and not far.all():
            slack = SLACK ** np.ceil(np.log2(len(many)))
            weights = found.weights(many[far], np.full(int(far.sum()), few))
            most = float(np.sum(weights) * found.width * slack)
            assert few - whole <= most
            ratios.append((few - whole) / most)
    assert np.min(closest) < 0.1 * K and np.max(ratios) > 0.02


@pytest.mark.parametrize(
    "fold",
    [max(A, B), min(A, 2.0 * B), min(A, B) - 0.1 * abs(A), min(A, B) - 0.3 * max(0.2 - abs(A - B), 0.0) * 4.0],
    ids=["maximum", "scaled", "depends on one", "falls with a value"],
)
def test_nothing_is_shown_of_other_folds(fold: Expr) -> None:
    found = Fold(fold)
    assert np.isinf(found.excess) and np.isinf(found.width)
