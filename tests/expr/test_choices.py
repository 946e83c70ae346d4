"""Choices: gradients of hard minima, merged calls, and structs."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch.expr.vocabulary as v
from raymarch.errors import SceneError
from raymarch.expr.adjoints import add_choices, map_choices
from raymarch.expr.arrays import evaluator
from raymarch.expr.choices import merge_calls
from raymarch.expr.derivative import companion, gradient
from raymarch.expr.function import Function, function
from raymarch.expr.glsl import print_functions
from raymarch.expr.node import Expr, const, var
from raymarch.expr.types import FLOAT, VEC3, struct
from raymarch.expr.walk import find

P = var("p", VEC3)
POINTS = np.random.default_rng(3).normal(size=(200, 3))


@function(p=VEC3, size=VEC3)
def block(p: Expr, size: Expr) -> Expr:
    q = abs(p) - 0.5 * size
    return v.length(v.max(q, 0.0)) + v.min(v.max(q.x, v.max(q.y, q.z)), 0.0)


def apart(count: int) -> Expr:
    """The minimum of several blocks."""
    total = block(P, const((1.0, 1.0, 1.0)))
    for i in range(1, count):
        total = v.min(total, block(P - const((float(i), 0.0, 0.3 * i)), const((1.0, 0.5 + 0.1 * i, 1.0))))
    return total


def test_the_gradient_of_a_minimum_is_that_of_the_smallest() -> None:
    slope = gradient(apart(3), P)
    value, step = evaluator([apart(3)], [P]), 1e-6
    axes = np.eye(3) * step
    differences = np.stack([(value(POINTS + a)[0] - value(POINTS - a)[0]) / (2 * step) for a in axes], axis=-1)
    found = np.broadcast_to(evaluator([slope], [P])(POINTS)[0], (200, 3))
    assert np.median(np.abs(found - differences)) < 1e-8


def test_calls_on_exclusive_sides_are_one() -> None:
    slope = gradient(apart(5), P)
    gradients = [call for call in find([slope], "call") if call.data is companion(block)]
    assert len(gradients) == 1


def test_a_call_used_on_both_sides_stays() -> None:
    f = Function("f", (P,), v.length(P))
    a, b = f(P), f(P + const((1.0, 0.0, 0.0)))
    (same,) = merge_calls([v.where(P.x < 0.0, a, a)], lambda _: 100)
    assert same is a
    (one,) = merge_calls([v.where(P.x < 0.0, a, b)], lambda _: 100)
    assert one.op == "call" and one.args[0].op == "where"
    (two,) = merge_calls([v.where(P.x < 0.0, a, b)], lambda _: 0)
    assert two.op == "where"


def test_a_path_through_nested_choices_takes_only_its_own_arguments() -> None:
    """A leaf that chooses again by a condition of its path needs no choice, and a leaf without a call any arguments."""
    f = Function("f", (P,), v.length(P))
    near, low = P.x < 0.0, P.y < 0.0
    a, b = f(2.0 * P), f(3.0 * P)
    shared = 2.0 * v.where(near, v.where(low, P.z, a), b)
    tree = v.where(near, v.where(low, shared, f(P)), shared)
    (merged,) = merge_calls([tree], lambda _: 100)
    (call,) = find([merged], "call")
    assert call.args[0] is v.where(near, P, 3.0 * P)
    old, new = (evaluator([e], [P])(POINTS)[0] for e in (tree, merged))
    np.testing.assert_array_equal(old, new)


def test_the_tie_of_a_minimum_is_decided_by_the_first() -> None:
    tie = v.min(P.x, P.y)
    np.testing.assert_array_equal(evaluator([gradient(tie, P)], [P])(np.ones((1, 3)))[0][0], [1.0, 0.0, 0.0])


def test_choices_are_added_side_by_side() -> None:
    c = P.x < 0.0
    a, b = v.where(c, P, const((0.0, 0.0, 0.0))), v.where(c, const((0.0, 0.0, 0.0)), 2.0 * P)
    total = add_choices(a, b)
    assert total is v.where(c, P, 2.0 * P)
    assert map_choices(lambda e: -e, total) is v.where(c, -P, -(2.0 * P))


def test_structs_are_chosen_and_read() -> None:
    kind = struct("Pair", (("near", FLOAT), ("at", VEC3)))
    assert struct("Pair", (("near", FLOAT), ("at", VEC3))) is kind
    one, other = v.record(kind, P.x, P), v.record(kind, 2.0, const((1.0, 2.0, 3.0)))
    chosen = v.where(P.x < 0.0, one, other)
    assert v.get(one, "at") is P and v.parts_of(chosen) == [v.get(chosen, "near"), v.get(chosen, "at")]
    near, at = evaluator([chosen], [P])(POINTS)[0]
    np.testing.assert_array_equal(near, np.where(POINTS[:, 0] < 0, POINTS[:, 0], 2.0))
    np.testing.assert_array_equal(at, np.where(POINTS[:, :1] < 0, POINTS, [1.0, 2.0, 3.0]))
    with pytest.raises(SceneError, match="Pair"):
        v.record(kind, P, P.x)
    text = "\n".join(line.text for line in print_functions([Function("pair", (P,), chosen)]).lines())
    assert "Pair pair(vec3 p) {" in text and "p.x < 0.0 ? Pair(p.x, p) : Pair(2.0, vec3(1.0, 2.0, 3.0))" in text


def test_no_line_is_longer_than_120() -> None:
    made = Function("field", (P,), apart(12))
    lines = [line.text for line in print_functions([made, companion(made)]).lines()]
    assert max(map(len, lines)) <= 120
