"""Choices by the number of the least value: the same values, also where two are equal."""

from __future__ import annotations

import numpy as np
import pytest

from raymarch.expr.alike import groups_of
from raymarch.expr.argmin import numbered
from raymarch.expr.arrays import evaluator
from raymarch.expr.derivative import companion
from raymarch.expr.function import Function
from raymarch.expr.node import const, var
from raymarch.expr.types import VEC2
from raymarch.expr.vocabulary import dot, length, max, min, sqrt, vec2, where
from raymarch.expr.walk import find
from raymarch.sdf.booleans import balanced
from raymarch.sdf.flat import enclosed
from tests.expr.test_rolled import STAR, lobe

P = var("p", VEC2)
# Halves are exact, so that distances to points beside the axes are equal.
POINTS = np.random.default_rng(7).integers(-8, 8, (500, 2)).astype(np.float32) / 2
LINE = var("line", VEC2)
heavy = Function("heavy", (LINE,), lobe(LINE) + lobe(2.0 * LINE) * lobe(LINE + 1.0) + lobe(vec2(LINE.y, LINE.x)))
PLACES = [(k - 3.5, 0.5 * (k % 3)) for k in range(8)]


def values(roots):
    return evaluator(list(roots), [P], np.float32)(POINTS)


def choice(sizes, chosen):
    """The least of some sizes, and what is chosen with it, as gradients choose: the first of equal ones."""

    def lesser(a, b):
        return min(a[0], b[0]), where(a[0] <= b[0], a[1], b[1])

    return balanced(list(zip(sizes, chosen, strict=True)), lesser)


def petals(turned=False):
    """Distances to alike petals at places, and what tells them apart."""
    at = [P - place for place in PLACES]
    if turned:
        at = [vec2(q.y, q.x) if k % 3 == 1 else q for k, q in enumerate(at)]
    return [heavy(q) for q in at], [2.0 * q + dot(q, P) for q in at]


@pytest.mark.parametrize("turned", [False, True], ids=["alike", "arguments that differ"])
def test_choices_are_by_the_number_of_the_least(turned):
    roots = choice(*petals(turned))
    made = numbered(roots)
    assert len(find(made, "loop")) == (2 if turned else 1)
    assert [call.data for call in find(made, "call")].count(heavy) == (2 if turned else 1)
    for new, old in zip(values(made), values(roots), strict=True):
        assert np.array_equal(new, old)


def test_of_equal_values_the_first_is_chosen_where_loops_are_out_of_order():
    sizes, _ = petals()
    other = [sqrt(dot(q, q)) + heavy(q) for q in (P - place for place in PLACES)]
    mixed = [size for pair in zip(sizes, other, strict=True) for size in pair]
    sizes = [max(size, 4.0) for size in mixed]  # many are equal
    numbers = [const(float(k)) for k in range(len(sizes))]
    roots = choice(sizes, numbers)
    made = numbered(roots)
    assert len(find(made, "loop")) == 2
    found, expected = values(made)[1], values(roots)[1]
    assert np.array_equal(found, expected) and len(np.unique(expected)) > 5


def test_a_fold_whose_comparisons_count_elsewhere_stays():
    sizes, chosen = petals()
    left, right = choice(sizes[:4], chosen[:4]), choice(sizes[4:], chosen[4:])
    (least, found) = choice((left[0], right[0]), (left[1], right[1]))
    inner = where(sizes[0] <= sizes[1], 1.0, 2.0)
    assert find(numbered([least, found]), "loop")
    assert not find(numbered([least, found, inner]), "loop")
    assert not find(numbered([least, found, left[0]]), "loop")


def test_the_nearest_edge_of_a_polygon_is_read_from_rows():
    slope = companion(Function("star", (P,), enclosed(P, STAR)))
    (body,) = made = numbered([slope.body])
    assert len(find(made, "loop")) == 1
    assert [call.data.name for call in find(made, "call")].count("edge_gradient") == 1
    new, old = (evaluator([each], slope.params, np.float32)(POINTS)[0] for each in (body, slope.body))
    assert np.array_equal(new, old)


def test_values_with_a_form_in_common_are_a_group():
    turned = [P - (1.0, 2.0), vec2(P.y, -P.x), const([[0.6, -0.8], [0.8, 0.6]]) @ P]
    (group,) = groups_of([heavy(q) * length(q) for q in turned])
    made = [group.at(const(float(k))) for k in range(3)]
    for new, old in zip(values(made), values(group.values), strict=True):
        assert np.array_equal(new, old)


def test_matrices_are_rows():
    turned = [const([[c, -s], [s, c]]) @ (P - (s, 1.0)) for c, s in ((0.6, 0.8), (0.8, 0.6), (0.28, 0.96))]
    (group,) = groups_of([heavy(q) * length(q) for q in turned])
    index = var("index", const(0.0).type)
    assert len({node.data for node in find([group.at(index)], "fetch")}) == 2
    for k, old in enumerate(group.values):
        new = evaluator([group.at(const(float(k)))], [P], np.float32)(POINTS)[0]
        assert np.allclose(new, values([old])[0], rtol=1e-6, atol=1e-6)


def test_cheap_or_different_values_are_in_no_group():
    assert groups_of([length(P - place) for place in PLACES[:3]]) == []
    assert groups_of([lobe(P) * length(P), sqrt(lobe(P) + 9.0), dot(P, P)]) == []
