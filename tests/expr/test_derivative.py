"""What the derivative reading adds to the suite of all readings: companions, weights, kinks, second derivatives."""

from __future__ import annotations

import numpy as np
import pytest

import raymarch.expr.vocabulary as v
from raymarch.errors import SceneError
from raymarch.expr import Expr, Function, const, loop, trace, var
from raymarch.expr.arrays import evaluator
from raymarch.expr.derivative import (
    companion,
    directional_derivatives,
    gradient,
    partial_derivatives,
    value_and_gradient,
)
from raymarch.expr.glsl import print_functions
from raymarch.expr.node import make
from raymarch.expr.partials import zero
from raymarch.expr.types import FLOAT, MAT2, VEC2, VEC3
from raymarch.expr.walk import find, topological
from raymarch.gpu.context import Context
from tests.support.glsl_harness import evaluate, text_of

A, B, P, Q = var("a", FLOAT), var("b", FLOAT), var("p", VEC3), var("q", VEC2)

BALL = trace("ball", lambda p, r: v.length(p) - r, [("p", VEC3), ("r", FLOAT)])
FLAT = trace("flat", lambda q: v.max(abs(q.x), abs(q.y)) - 1.0, [("q", VEC2)])


def at(e: Expr, **values: object) -> np.ndarray:
    """The value of an expression of A, B, P, Q."""
    symbols = {"a": A, "b": B, "p": P, "q": Q}
    return evaluator([e], [symbols[n] for n in values])(*values.values())[0]


@pytest.mark.parametrize(
    ("e", "slope"),
    [
        (abs(A), 0.0),
        (v.sqrt(A), 0.0),
        (v.sign(A), 0.0),
        (v.max(A, 0.0 * A), 1.0),
        (v.max(2.0 * A, 3.0 * A), 2.0),
        (v.min(2.0 * A, 3.0 * A), 2.0),
        (v.clamp(A, 0.0, 1.0), 1.0),
        (v.fract(A), 1.0),
        (v.floor(A), 0.0),
        (v.where(A < 0, 5.0 * A, 7.0 * A), 7.0),
        (v.pow(A, 0.5), 0.0),
        (v.log(A), 0.0),
        (v.asin(A + 1.0), 0.0),
        (v.acos(A + 1.0), 0.0),
        (v.atan2(A, 0.0 * A), 0.0),
    ],
)
def test_a_kink_has_a_finite_slope_of_one_side(e: Expr, slope: float) -> None:
    assert at(gradient(e, A), a=0.0) == slope


X, Y = Q.x, Q.y
HILL = 0.25 * v.square(v.max(1.0 - abs(X - Y), 0.0))
TIES = {
    "quadratic": (v.min(X, Y) - HILL, (0.5, 0.5)),
    "swapped": (v.min(Y, X) - HILL, (0.5, 0.5)),
    "a smooth maximum": (v.max(X, Y) + HILL, (0.5, 0.5)),
    "of negatives": (-v.min(-X, -Y) + HILL, (0.5, 0.5)),
    "by a comparison": (v.where(X < Y, X, Y) - HILL, (0.5, 0.5)),
    "by another": (v.where(X <= Y, X, Y) - HILL, (0.5, 0.5)),
    "by its positive part": (X - v.max(X - Y, 0.0) - HILL, (0.5, 0.5)),
    "both ends": (v.min(X, Y) + v.max(X, Y), (1.0, 1.0)),
    "the mean": (v.max(Y, X) - 0.5 * abs(X - Y), (0.5, 0.5)),
    "vectors": (
        v.dot(v.min(v.vec2(X, 2.0), v.vec2(Y, 3.0)) + v.max(v.vec2(Y, 3.0), v.vec2(X, 2.0)), v.vec2(1.0, 1.0)),
        (1.0, 1.0),
    ),
    "carried by a loop": (loop(2, (X,), lambda i, x: (v.min(x, Y) + v.max(x, Y) - Y,))[0], (1.0, 0.0)),
    "a crease": (v.min(X, Y), (1.0, 0.0)),
    "an edge": (v.max(X, Y), (1.0, 0.0)),
}


@pytest.mark.parametrize("name", TIES)
def test_kinks_of_one_difference_take_one_side(name: str) -> None:
    """A sum of kinks that is smooth has its derivative; min and max alone have that of the first."""
    e, slopes = TIES[name]
    assert np.broadcast_to(at(gradient(e, Q), q=np.array([[2.0, 2.0]])), (1, 2)).tolist() == [list(slopes)]


@pytest.mark.parametrize(
    ("e", "slope"),
    [
        (v.max(3.0, A), 1.0),
        (v.min(3.0, A), 1.0),
        (v.max(A - 3.0, 0.0) + v.min(A - 3.0, 0.0), 1.0),
        (v.max(A - 3.0, 0.0) - v.max(3.0 - A, 0.0), 1.0),
        (A - v.clamp(A, B, B), 1.0),
        (v.clamp(A, B, B), 0.0),
        (v.max(3.0, v.min(A, 4.0)) - v.length(v.max(v.vec2(3.0 - A, -1.0), 0.0)), 1.0),
    ],
)
def test_a_tie_with_what_stands_still(e: Expr, slope: float) -> None:
    assert at(gradient(e, A), a=3.0, b=3.0) == slope


INFINITE = 1.0 / v.max(A - 2.0, 0.0)


@pytest.mark.parametrize(
    "e",
    [
        v.where(A > 2.0, INFINITE, A),
        v.where(A < 2.0, A, INFINITE * A),
        v.where(A > 2.0, v.where(A > 3.0, INFINITE, INFINITE * A), A),
        v.where(A < 3.0, v.where(A < 2.0, A, INFINITE), v.where(A < 4.0, INFINITE, 1.0)),
        v.where(A < 2.0, A, v.length(v.vec3(INFINITE, A * INFINITE, INFINITE * INFINITE))),
        v.where(A < 2.0, A, loop(3, (A,), lambda i, x: (x * INFINITE,))[0]),
    ],
)
def test_an_infinite_slope_on_the_side_not_taken_does_not_count(e: Expr) -> None:
    assert at(gradient(e, A), a=1.0) == 1.0


def test_the_gradient_of_a_length_is_a_unit_vector_or_zero() -> None:
    points = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 4.0], [1e-30, 0, 0], [0, 1e12, 0], [1e-12, 1e-12, 0.0]])
    sizes = np.linalg.norm(at(gradient(v.length(P), P), p=points), axis=1)
    assert np.all((sizes < 1 + 1e-12) & ((sizes > 1 - 1e-12) | (sizes < 1e-6)))


@pytest.mark.parametrize("scale", [1e-38, 1e-30, 1e-23, 1e-20, 1e-19, 1e-12, 1.0, 1e12, 1e18])
def test_normalize_is_never_longer_than_one_in_float32(egl: Context, scale: float) -> None:
    """Squares of short vectors underflow in float32, so their length reads 0."""
    directions = np.random.default_rng(2).normal(size=(200, 3))
    points = (scale * directions / np.linalg.norm(directions, axis=1)[:, None]).astype(np.float32)
    function = Function("f", (P,), v.normalize(P))
    twin = evaluator([function.body], [P], np.float32)(points)[0]
    for values in (twin, evaluate(egl, function, [points])):
        sizes = np.linalg.norm(values.astype(np.float64), axis=1)
        assert np.all(sizes < 1 + 1e-6)
        if scale >= 1e-18:
            assert np.all(sizes > 1 - 1e-6)


def test_a_companion_gives_gradient_and_value() -> None:
    whole = companion(BALL)
    assert whole.name == "ball_gradient"
    assert [p.data for p in whole.params] == ["p", "r"]
    np.testing.assert_allclose(at(whole(P, A), p=[3.0, 0.0, 4.0], a=1.0), [0.6, 0.0, 0.8, 4.0])


def test_a_flat_companion_has_three_components() -> None:
    np.testing.assert_allclose(at(companion(FLAT)(Q), q=[0.5, -3.0]), [0.0, -1.0, 2.0])


def test_a_call_whose_other_arguments_only_jump_keeps_its_companion() -> None:
    form = trace("form", lambda p, q: v.length(p) - 0.1 * v.dot(q, q), [("p", VEC3), ("q", VEC3)])
    cell = v.floor(P + 0.5)
    slope = gradient(form(P - cell, cell + v.where(P.x < 0.0, -1.0, 1.0)), P)
    assert {node.data for node in find([slope], "call")} == {companion(form)}
    np.testing.assert_allclose(at(slope, p=[2.0, 0.3, -0.4]), [0.0, 0.6, -0.8])


def test_a_companion_is_made_once() -> None:
    assert companion(BALL) is companion(BALL)


def test_no_field_is_evaluated_twice_for_its_gradient() -> None:
    scene = trace("scene", lambda p: v.min(BALL(p, 1.0), BALL(p - (1.0, 0.0, 0.0), 0.5)), [("p", VEC3)])
    text = text_of(print_functions([companion(scene)]))
    assert text.count("= ball_gradient(") == 2
    assert "ball(" not in text.replace("ball_gradient(", "")


def test_what_the_variable_does_not_reach_has_gradient_zero() -> None:
    assert gradient(v.sin(B), A) is const(0.0)
    assert gradient(v.sin(B), P) is zero(VEC3)


def test_second_derivatives() -> None:
    """A gradient is an expression, so it has a gradient: through calls, companions and loops too."""
    field = BALL(P * 2.0, 1.0) * BALL(P, 0.5)
    (spun,) = loop(3, (field,), lambda i, x: (x + v.sin(x * P.y),))
    slope = gradient(spun, P).x
    again = gradient(slope, P)
    point, h = np.array([0.4, -0.3, 0.8]), 1e-5
    for axis in range(3):
        step = h * np.eye(3)[axis]
        expected = (at(slope, p=point + step) - at(slope, p=point - step)) / (2 * h)
        np.testing.assert_allclose(at(again, p=point)[axis], expected, rtol=1e-5)


def test_the_side_not_taken_does_not_spoil_a_gradient() -> None:
    """where() computes both sides; an infinite one must not turn into NaN by a factor of zero."""
    safe = v.where(A > 0.0, v.sqrt(A) + v.log(A) + v.pow(A, 0.25), A)
    assert at(gradient(safe, A), a=np.array([-1.0, 0.0])).tolist() == [1.0, 1.0]


def test_a_function_of_a_matrix() -> None:
    """A matrix counts as little as a vec2 though its sides are as long."""
    stretched = Function("stretched", (var("m", MAT2),), v.length(var("m", MAT2) @ const([1.0, 2.0])))
    e = stretched(v.columns(Q, Q.yx))
    slope, h = at(gradient(e, Q), q=[0.3, 0.7]), 1e-6
    for axis in range(2):
        step = h * np.eye(2)[axis]
        expected = (at(e, q=np.array([0.3, 0.7]) + step) - at(e, q=np.array([0.3, 0.7]) - step)) / (2 * h)
        np.testing.assert_allclose(slope[axis], expected, rtol=1e-6)


def test_edges_of_smoothstep_may_not_move() -> None:
    with pytest.raises(SceneError, match="edges depend on the position"):
        gradient(v.smoothstep(A, A + 1.0, 0.5), A)


def test_a_loop_gives_value_and_gradient_in_one_go() -> None:
    (e,) = loop(6, (A,), lambda i, x: (v.sin(x) * B + i,), until=lambda i, x: x > 3.0)
    value, slope = value_and_gradient(e, A)
    assert len([n for n in topological([value, slope]) if n.op == "loop"]) == 1
    np.testing.assert_allclose(at(value, a=0.3, b=0.7), at(e, a=0.3, b=0.7))


def test_a_loop_carries_no_tangent_of_what_does_not_move() -> None:
    """The counter and the scale of a fractal do not depend on the point."""
    last, _ = loop(4, (P, 1.0), lambda i, q, s: (abs(q) * 2.0 - B, s * 2.0))
    (whole,) = [n for n in topological([gradient(v.length(last), P)]) if n.op == "loop"]
    assert len(whole.data.state) == 2 + 3


# Weights


def test_weights_of_a_minimum() -> None:
    one, two = A * 1.0 + B, A * 2.0
    weights = partial_derivatives(v.min(one, two), [one, two])
    values = evaluator(weights, [A, B])(np.array([1.0, 1.0]), np.array([0.0, 5.0]))
    assert [np.broadcast_to(w, 2).tolist() for w in values] == [[1.0, 0.0], [0.0, 1.0]]


def test_weights_of_a_blend_sum_to_one() -> None:
    parts = [BALL(P - (float(i), 0.0, 0.0), 0.5) for i in range(3)]

    def smooth(a: Expr, b: Expr) -> Expr:
        h = v.max(0.4 - abs(a - b), 0.0) / 0.4
        return v.min(a, b) - h * h * 0.1

    blended = smooth(smooth(parts[0], parts[1]), parts[2])
    weights = partial_derivatives(blended, parts)
    points = np.random.default_rng(3).uniform(-1, 3, (500, 3))
    values = np.array([np.broadcast_to(w, 500) for w in evaluator(weights, [P])(points)])
    np.testing.assert_allclose(values.sum(axis=0), 1.0, atol=1e-12)
    assert np.all(values >= -1e-12)
    assert np.all((values > 0.01).sum(axis=0).max() >= 2), "blended somewhere"


def test_weights_of_marked_parts_can_be_evaluated() -> None:
    """What the weights read are the parts themselves, without the marks, which have no value."""
    parts = [make("mark", FLOAT, (A + float(i),), f"material {i}") for i in range(2)]
    weights = partial_derivatives(v.min(*parts), parts)
    assert not find(weights, "mark")
    assert [w.tolist() for w in evaluator(weights, [A])(0.0)] == [1.0, 0.0]


def test_a_stopped_value_is_a_constant_for_derivatives() -> None:
    """Its own value is exact, also where it is tiny or large, and its derivative is 0 in both modes."""
    x = var("x", FLOAT)
    value = x * v.stop_gradient(x * x)
    assert gradient(value, x) is v.stop_gradient(x * x)
    assert directional_derivatives(value, x, [const(1.0)]) == [v.stop_gradient(x * x)]
    given = np.array([1e-30, -3.7, 1e9])
    np.testing.assert_array_equal(evaluator([v.stop_gradient(x)], [x])(given)[0], given)
