"""No expression is too deep: nothing that walks over one uses Python's own stack."""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
import pytest

import raymarch.expr.vocabulary as v
from raymarch.expr import Expr, Function, const, var
from raymarch.expr.arrays import evaluator
from raymarch.expr.derivative import companion, gradient, partial_derivatives
from raymarch.expr.evaluate import Program
from raymarch.expr.glsl import print_functions
from raymarch.expr.intervals import INTERVALS, interval_of
from raymarch.expr.templates import is_nonnegative
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.walk import depends_on, find, free_variables, substitute, topological
from tests.support.cpu_limit import cpu_limit
from tests.support.recursion import few_calls

DEEP = 3_500
"""More than the recursion limit may be."""
A, P = var("a", FLOAT), var("p", VEC3)


def chain(step: Callable[[Expr, float], Expr], count: int = DEEP) -> Expr:
    e = A
    for i in range(count):
        e = step(e, float(i % 7))
    return e


@pytest.fixture(autouse=True)
def _usual_limit() -> None:
    assert sys.getrecursionlimit() <= 3000, "deep expressions must not need a higher limit than Python's own"


@pytest.fixture(scope="module")
def deep_sum() -> Expr:
    return chain(lambda e, k: e + A * (k + 1.0))


def test_evaluating_a_deep_sum(deep_sum: Expr) -> None:
    total = 1.0 + sum(i % 7 + 1.0 for i in range(DEEP))
    np.testing.assert_allclose(evaluator([deep_sum], [A])(np.array([0.5, 2.0]))[0], [0.5 * total, 2 * total])


def test_gradient_of_a_deep_sum(deep_sum: Expr) -> None:
    total = 1.0 + sum(i % 7 + 1.0 for i in range(DEEP))
    assert evaluator([gradient(deep_sum, A)], [A])(0.5)[0] == total


def test_intervals_of_a_deep_sum(deep_sum: Expr) -> None:
    total = 1.0 + sum(i % 7 + 1.0 for i in range(DEEP))
    low, high = Program([deep_sum], [A], INTERVALS)((np.asarray(-1.0), np.asarray(2.0)))[0]
    assert (low, high) == (-total, 2 * total)


def test_printing_a_deep_sum(deep_sum: Expr) -> None:
    lines = [line.text for line in print_functions([Function("f", (A,), deep_sum)]).lines()]
    assert max(map(len, lines)) < 2000
    assert len(lines) > DEEP / 100


def test_walking_a_deep_sum(deep_sum: Expr) -> None:
    assert len(topological([deep_sum])) > DEEP
    assert free_variables([deep_sum]) == [A]
    assert find([deep_sum], "param") == []
    assert deep_sum in depends_on([deep_sum], [A])
    (fixed,) = substitute([deep_sum], {A: const(1.0)})
    assert fixed.is_constant
    assert interval_of(fixed)[0] == 1.0 + sum(i % 7 + 1.0 for i in range(DEEP))
    repr(deep_sum)


def test_a_deep_product_under_a_root() -> None:
    """Whether its sign is known is asked of a few levels only."""
    e = chain(lambda e, k: e * v.abs(A + k))
    root = v.sqrt(v.abs(A) * e)
    assert not is_nonnegative(e)
    assert print_functions([Function("f", (A,), root)]).lines()


def test_asking_for_a_sign_takes_no_exponential_time() -> None:
    e = v.abs(A)
    for i in range(200):
        e = v.max(e * (e * v.abs(A + float(i))), e * 0.5)
    with cpu_limit(5.0):
        is_nonnegative(e)


@pytest.mark.parametrize(
    "step",
    [
        lambda e, k: v.min(e, A - k),
        lambda e, k: v.where(e < k, e + A, e - A * 0.5),
        lambda e, k: v.length(v.vec3(e, A, k)) * 0.9,
        lambda e, k: -v.max(-e, v.sin(e) - k),
    ],
    ids=["min", "where", "length", "max"],
)
def test_chains_of_other_operations(step: Callable[[Expr, float], Expr]) -> None:
    with few_calls():
        e = chain(step, 140)
        value, slope = evaluator([e, gradient(e, A)], [A])(0.75)
        assert np.isfinite(value)
        assert np.isfinite(slope)
        assert print_functions([Function("f", (A,), e), Function("g", (A,), gradient(e, A))]).lines()


def test_dropping_a_deep_expression_is_quiet() -> None:
    """Nothing warns (which would fail here) or overflows while thousands of expressions free each other."""
    chain(lambda e, k: v.sin(e + k))


def test_many_calls_of_one_function() -> None:
    ball = Function("ball", (P, A), v.length(P) - A)
    total = ball(P, A)
    with few_calls():
        for i in range(140):
            total = v.min(total, ball(P - (float(i), 0.0, 0.0), const(0.25)))
        field = Function("field", (P, A), total)
        assert len(print_functions([field, companion(field)]).functions) == 4
        value = evaluator([companion(field).body], field.params)(np.array([[7.0, 1.0, 0.0]]), 0.5)[0]
    np.testing.assert_allclose(value, [[0.0, 1.0, 0.0, 0.75]])


def test_weights_of_many_parts() -> None:
    """The share of each of many operands in a minimum: one of them has it all."""
    shifts = [var(f"part {i}", FLOAT) for i in range(140)]
    parts = [A * 0.0 + shift + A for shift in shifts]
    with few_calls():
        smallest = parts[0]
        for part in parts[1:]:
            smallest = v.min(smallest, part)
        weights = partial_derivatives(smallest, parts)
        values = evaluator(weights, [A, *shifts])(0.0, *[abs(i - 123.0) for i in range(140)])
    assert [i for i, w in enumerate(values) if w != 0.0] == [123]
    assert values[123] == 1.0
