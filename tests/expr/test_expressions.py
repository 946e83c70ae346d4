"""Expressions are typed, equal ones are one object, and a wrong one names the user's line."""

from __future__ import annotations

import gc
import math
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import raymarch.expr.vocabulary as v
from raymarch.errors import SceneError
from raymarch.expr import Expr, Function, const, construct, expr, function, loop, trace, var
from raymarch.expr.arrays import evaluator, value_of
from raymarch.expr.function import FloatExpr, Vec3Expr, sum_of
from raymarch.expr.node import _interned, make, swizzle
from raymarch.expr.samples import Samples
from raymarch.expr.samples import sample as interpolated
from raymarch.expr.types import BOOL, FLOAT, MAT3, VEC2, VEC3, VEC4, Type
from raymarch.expr.walk import REMEMBERED, topological

A, B, P, Q = var("a", FLOAT), var("b", FLOAT), var("p", VEC3), var("q", VEC2)
M = v.columns(P, P, P)


# Hash-consing


@pytest.mark.parametrize(
    "build",
    [
        lambda: v.sin(A) + 1.0,
        lambda: P.zx * 2,
        lambda: v.where(A < B, P, 0.0),
        lambda: v.columns(Q, Q) @ Q,
        lambda: const([1.0, 2.0, 3.0]),
        lambda: expr((A, 1, B)),
        lambda: loop(3, (A,), lambda i, x: (x + i,))[0],
        lambda: loop(3, (A, P), lambda i, x, q: (x + B, q * x), until=lambda i, x, q: x > 4.0)[1],
        lambda: interpolated(Samples([[0.0, 1.0], [2.0, 3.0]]), Q),
    ],
)
def test_equal_expressions_are_one_object(build: Callable[[], Expr]) -> None:
    assert build() is build()


def test_what_differs_anywhere_is_another_object() -> None:
    made = [
        A + B,
        A - B,
        B + A,
        P + A,
        P + B,
        P.x,
        P.y,
        P.xy,
        Q.xy,
        var("a", VEC3),
        const(1.0),
        const(True),
        const([1.0, 1.0]),
        const([1.0, 1.0, 1.0]),
        const(np.nextafter(1.0, 2.0)),
        A < B,
        A <= B,
    ]
    assert len({id(e) for e in made}) == len(made)


def test_the_sign_of_zero_is_kept() -> None:
    assert const(0.0) is not const(-0.0)


def test_expressions_are_held_weakly() -> None:
    """What nobody holds is gone, and the table of known expressions with it."""
    gc.collect()
    before = len(_interned)
    for k in range(50):
        e = v.sin(A * k) + P.x
        e = loop(3, (e,), lambda i, x, e=e: (x * e + i,))[0]
        watched = weakref.ref(e)
    del e
    gc.collect()
    assert watched() is None
    assert len(_interned) <= before + 2


def test_an_expression_remembers_its_order_and_is_freed_at_once() -> None:
    """What it remembers has no circle, which would live until a collection; deep expressions remember nothing."""
    terms = [A * (k + 0.25) for k in range(40)]
    total = sum_of([v.sin(term) + P.x for term in terms])
    first = topological([total])
    assert total.below == tuple(first[:-1]) and topological([total]) == first
    assert topological([total], lambda node: node.args) == first
    assert topological([terms[3], total])[-1] is total and len(topological([terms[3], total])) == len(first)
    deep = sum_of([v.cos(A * (k + 0.5)) for k in range(REMEMBERED)])
    assert topological([deep])[-1] is deep and deep.below is None
    watched = weakref.ref(total)
    gc.disable()
    try:
        del first, total
        assert watched() is None
    finally:
        gc.enable()


def test_constants_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        const([1.0, 2.0]).data[0] = 5


def test_a_constant_keeps_its_value_when_its_source_changes() -> None:
    source = np.array([1.0, 2.0])
    kept = const(source)
    source[0] = 7.0
    assert kept.data.tolist() == [1.0, 2.0]


# Types


@pytest.mark.parametrize(
    ("value", "type"),
    [
        (1, FLOAT),
        (1.5, FLOAT),
        (True, BOOL),
        (np.float32(2), FLOAT),
        (np.int64(2), FLOAT),
        ((1, 2), VEC2),
        ([1, 2.0, 3], VEC3),
        (np.arange(4), VEC4),
        (np.eye(3), MAT3),
        (((1, 0, 0), (0, 1, 0), (0, 0, 1)), MAT3),
        ((A, Q), VEC3),
        (A < B, BOOL),
        (P + 1, VEC3),
        (1 + P, VEC3),
        (P * M, VEC3),
        (np.eye(3) @ P, VEC3),
        (np.array([1.0, 2.0, 3.0]) * P, VEC3),
        (M * 2, MAT3),
        (v.length(P), FLOAT),
        (P.zx, VEC2),
    ],
)
def test_types(value: Any, type: Type) -> None:
    assert expr(value).type is type


def test_vectors_can_be_taken_apart_as_in_python() -> None:
    x, y, z = P
    assert (x, y, z) == (P.x, P.y, P.z)
    assert P[-1] is P.z
    assert len(P) == 3
    with pytest.raises(SceneError, match="component 3 of a vec3"):
        P[3]


def test_whole_arrays_stay_with_the_expression() -> None:
    """NumPy must not spread an expression over its elements."""
    assert isinstance(np.array([1.0, 2.0, 3.0]) - P, Expr)
    assert isinstance(np.float64(2) * A, Expr)


# Errors

WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "if": (lambda: 1 if A < B else 2, "no truth value"),
    "and": (lambda: (A < B) and (B < A), "no truth value"),
    "float": (lambda: float(A), "no numeric value"),
    "math": (lambda: math.sin(A), "no numeric value"),
    "sizes": (lambda: P + Q, "mixes sizes"),
    "bool arithmetic": (lambda: (A < B) + 1, "bool"),
    "order of vectors": (lambda: P < P, "cannot order vec3 and vec3"),
    "number as condition": (lambda: A & B, "conditions"),
    "where without condition": (lambda: v.where(A, 1, 2), "needs a condition"),
    "where of two types": (lambda: v.where(A < B, P, Q), "vec3, vec2"),
    "missing component": (lambda: Q.z, "no component 'z'"),
    "component of a scalar": (lambda: A.x, "no component 'x'"),
    "length of a scalar": (lambda: len(A), "no components"),
    "dot of a scalar": (lambda: v.dot(A, P), "float, vec3"),
    "dot of two sizes": (lambda: v.dot(Q, P), "vec2, vec3"),
    "cross of vec2": (lambda: v.cross(Q, Q), "cross"),
    "too many parts": (lambda: v.vec3(P, A), "4 numbers"),
    "too few parts": (lambda: v.vec3(A, A), "2 numbers"),
    "vec5": (lambda: construct(P, Q), "vec3, vec2"),
    "matrix in a vector": (lambda: construct(M, A), "mat3"),
    "bool in a vector": (lambda: construct(A < B, A), "bool"),
    "matrix and short vector": (lambda: M @ Q, "sizes differ"),
    "sine of a matrix": (lambda: v.sin(M), "sin does not take a mat3"),
    "smallest of matrices": (lambda: v.min(M, M), "min does not take a mat3"),
    "columns not square": (lambda: v.columns(P, P), "matrix of 2 columns of vec3"),
    "transpose of a vector": (lambda: v.transpose(P), "vec3"),
    "equal edges": (lambda: v.smoothstep(A, A, B), "smoothstep"),
    "equal constant edges": (lambda: v.smoothstep(1, 1.0, B), "1"),
    "falling edges": (lambda: v.smoothstep(2.0, 0.5, B), "2.0 and 0.5"),
    "equal edges in one component": (lambda: v.smoothstep((0.0, 1.0), 1.0, A), "smoothstep"),
    "text": (lambda: expr("radius"), "'radius'"),
    "text of digits": (lambda: expr(("1", "2")), "('1', '2')"),
    "array of texts": (lambda: A + np.array("1"), "ndarray"),
    "none": (lambda: A + None, "None"),
    "ragged": (lambda: expr(((1, 2), (3,))), "((1, 2), (3,))"),
    "five numbers": (lambda: expr(np.zeros(5)), "(5,)"),
    "oblong matrix": (lambda: expr(np.zeros((2, 3))), "(2, 3)"),
    "count not whole": (lambda: loop(2.5, (A,), lambda i, x: (x,)), "2.5"),
    "count 0": (lambda: loop(0, (A,), lambda i, x: (x,)), "loop count 0"),
    "count too large": (lambda: loop(65536, (A,), lambda i, x: (x,)), "65536"),
    "state grows": (lambda: loop(2, (A,), lambda i, x: (x, x)), "as many values"),
    "state changes type": (lambda: loop(2, (A,), lambda i, x: (P,)), "vec3"),
    "until is no condition": (lambda: loop(2, (A,), lambda i, x: (x,), until=lambda i, x: x), "float"),
    "function of another type": (lambda: _half(P), "_half(float x) was given (vec3)"),
    "function of too many": (lambda: _half(A, B), "(float, float)"),
    "flat data at a point in space": (lambda: interpolated(Samples(np.zeros((2, 2))), P), "2D samples at a vec3"),
    "a row of data": (lambda: Samples([1.0, 2.0]), "(2,)"),
    "NaN in data": (lambda: Samples([[1.0, math.nan], [0.0, 0.0]]), "not finite"),
}


@function()
def lengthened(p: Vec3Expr, by: FloatExpr) -> Expr:
    return v.length(p) * by


def test_annotations_state_the_types_of_a_function() -> None:
    assert [p.type for p in lengthened.params] == [VEC3, FLOAT]
    assert value_of(lengthened((3.0, 4.0, 0.0), 2.0)) == 10.0


@function(x=FLOAT)
def _half(x: Expr) -> Expr:
    return 0.5 * x


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_meant_is_refused_at_the_users_line(name: str) -> None:
    wrong, words = WRONG[name]
    with pytest.raises(SceneError) as caught:
        wrong()
    error = caught.value
    assert words in str(error)
    assert error.where is not None
    assert (error.where.file, error.where.line) == (__file__, wrong.__code__.co_firstlineno)
    assert str(error).startswith(f"{__file__}:{error.where.line}: ")


def test_a_refusal_says_what_is_legal() -> None:
    for name in ("if", "math", "sizes", "count 0", "falling edges", "five numbers", "missing component"):
        with pytest.raises(SceneError) as caught:
            WRONG[name][0]()
        assert caught.value.legal, name


def test_an_expression_knows_the_line_that_wrote_it() -> None:
    here = (lambda: v.cos(A * 3.25) + 7.5).__code__.co_firstlineno + 1
    e = v.cos(A * 3.25) + 7.5
    assert e.where is not None
    assert (e.where.file, e.where.line) == (__file__, here)


# Functions


def test_a_function_must_return_an_expression() -> None:
    def nothing(x: Expr) -> None:
        v.sin(x)

    with pytest.raises(SceneError, match="nothing must return an expression, not None") as caught:
        trace("nothing", nothing, [("x", FLOAT)])
    assert caught.value.where is not None
    assert caught.value.where.line == nothing.__code__.co_firstlineno


def test_a_number_is_an_expression_to_return() -> None:
    assert value_of(trace("five", lambda x: 5, [("x", FLOAT)]).body) == 5.0


def test_a_function_may_not_use_variables_from_around_it() -> None:
    with pytest.raises(SceneError, match=r"leaky uses \['b'\]"):
        trace("leaky", lambda x: x + B, [("x", FLOAT)])


def test_the_turn_of_a_loop_may_not_leave_it() -> None:
    kept: list[Expr] = []

    def step(i: Expr, x: Expr) -> tuple[Expr]:
        kept.append(i)
        return (x + i,)

    def leaking(x: Expr) -> Expr:
        return loop(2, (x,), step)[0] + kept[0]

    with pytest.raises(SceneError, match="from outside its own parameters"):
        trace("leaking", leaking, [("x", FLOAT)])


def test_inlining_gives_the_same_values() -> None:
    f = trace("f", lambda p, s: v.length(p - s) * s, [("p", VEC3), ("s", FLOAT)])
    points = np.random.default_rng(0).normal(size=(10, 3))
    called, inlined = evaluator([f(P, A), f.inline(P, A)], [P, A])(points, np.arange(10.0))
    assert f.inline(P, A).op != "call"
    np.testing.assert_array_equal(called, inlined)


def test_functions_of_one_name_stay_apart() -> None:
    one, two = (Function("f", (A,), body) for body in (A + 1, A + 2))
    assert one(A) is not two(A)
    np.testing.assert_array_equal(evaluator([one(A) * two(A)], [A])(3.0)[0], 20.0)


# What operations without simplification must leave alone


def test_child_lookups_at_constant_points_are_not_folded() -> None:
    """`apply` and `mark` have no value before a child is put in, whatever their arguments are."""
    from raymarch.expr.walk import substitute

    for op in ("apply", "mark"):
        asked = make(op, FLOAT, (A,), 0)
        (moved,) = substitute([asked + 1.0], {A: const(2.0)})
        assert moved.args[0].op == op


def test_swizzles_repeat_and_reorder() -> None:
    e = swizzle(var("r", VEC4), "wyyx")
    assert evaluator([e], [var("r", VEC4)])(np.arange(4.0))[0].tolist() == [3, 1, 1, 0]
    assert swizzle(e, "zx") is swizzle(var("r", VEC4), "yw")


def test_components_have_the_names_of_glsl() -> None:
    four = var("c", VEC4)
    for name in ("yzx", "xxy", "zz", "xyzx"):
        assert getattr(P, name) is swizzle(P, name)
    assert four.rgb is four.xyz
    assert four.a is four.w
    (slope,) = evaluator([v.dot(P.xxy, P.zyx)], (P,))(np.array([[2.0, 3.0, 5.0]]))
    assert slope == 2 * 5 + 2 * 3 + 3 * 2
    with pytest.raises(SceneError, match="no component 'w'"):
        _ = P.w
    for name in ("rgx", "xyzxy", "lenght"):
        assert not hasattr(P, name)
