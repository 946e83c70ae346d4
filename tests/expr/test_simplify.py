"""Simplification changes no value: random expressions, with and without it, on numbers where float32 is exact.

All inputs are small integers or halves and all operations keep them so, hence every reading must agree to the bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeAlias

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import raymarch.expr.vocabulary as v
from raymarch.expr import Expr, Function, const, expr, node, trace, var
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import swizzle
from raymarch.expr.types import BOOL, FLOAT, VEC2, VEC3, VECTORS
from raymarch.expr.walk import topological
from raymarch.gpu.context import Context
from raymarch.sdf.placing import rotation_matrix
from tests.support.glsl_harness import evaluate

Recipe: TypeAlias = Any
A, P, Q = var("a", FLOAT), var("p", VEC3), var("q", VEC2)

_random = np.random.default_rng(3)
POINTS = [_random.choice([-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0], shape) for shape in ((40,), (40, 3), (40, 2))]

BINARY = {
    "add": lambda x, y: x + y,
    "sub": lambda x, y: x - y,
    "mul": lambda x, y: x * y,
    "min": v.min,
    "max": v.max,
    "step": v.step,
}
UNARY = {
    "neg": lambda x: -x,
    "abs": abs,
    "sign": v.sign,
    "floor": v.floor,
    "ceil": v.ceil,
    "round": v.round,
    "halved": lambda x: x / 2.0,
    "over_one": lambda x: x / 1.0,
    "modulo": lambda x: v.mod(x, 2.0),
    "clamp": lambda x: v.clamp(x, -3.0, 4.0),
}
NUMBERS = (0.0, 1.0, -1.0, 2.0, 0.5, -3.0)
TYPES = {1: FLOAT, **VECTORS}


def leaves(size: int) -> st.SearchStrategy[Recipe]:
    own = {1: "a", 2: "q", 3: "p"}.get(size)
    numbers = st.sampled_from(NUMBERS)
    constant = numbers if size == 1 else st.tuples(*[numbers] * size)
    leaf = constant.map(lambda x: ("const", x))
    return st.one_of(st.just((own,)), st.just((own,)), leaf) if own else leaf


@cache
def recipes(size: int, depth: int) -> st.SearchStrategy[Recipe]:
    """Recipes of expressions of so many components."""
    if depth == 0:
        return leaves(size)
    same = st.deferred(lambda: recipes(size, depth - 1))
    scalar = st.deferred(lambda: recipes(1, depth - 1))
    condition = st.deferred(lambda: conditions(depth - 1))
    choices = [
        *([leaves(size)] if depth < 3 else []),
        st.tuples(st.sampled_from(sorted(BINARY)), same, same),
        st.tuples(st.sampled_from(sorted(UNARY)), same),
        st.tuples(st.just("where"), condition, same, same),
    ]
    if size == 1:
        pair = st.sampled_from([2, 3]).flatmap(lambda n: st.tuples(recipes(n, depth - 1), recipes(n, depth - 1)))
        choices.append(pair.map(lambda two: ("dot", *two)))
        part = st.sampled_from([2, 3, 4]).flatmap(lambda n: st.tuples(recipes(n, depth - 1), st.integers(0, n - 1)))
        choices.append(part.map(lambda x: ("swizzle", x[0], "xyzw"[x[1]])))
    else:
        choices.append(st.tuples(st.sampled_from(sorted(BINARY)), same, scalar))
        choices.append(st.tuples(st.sampled_from(sorted(BINARY)), scalar, same))
        choices.append(st.tuples(*[scalar] * size).map(lambda parts: ("construct", *parts)))
        names = st.sampled_from([2, 3, 4]).flatmap(
            lambda n: st.tuples(
                recipes(n, depth - 1), st.lists(st.sampled_from("xyzw"[:n]), min_size=size, max_size=size).map("".join)
            )
        )
        choices.append(names.map(lambda x: ("swizzle", *x)))
    if size in (2, 3):
        choices.append(st.tuples(st.just("matmul"), *[same] * (size + 1)))
    if size == 3:
        choices.append(st.tuples(st.just("cross"), same, same))
        choices.append(st.tuples(st.just("construct"), st.deferred(lambda: recipes(2, depth - 1)), scalar))
    return st.one_of(choices)


@cache
def conditions(depth: int) -> st.SearchStrategy[Recipe]:
    scalar = st.deferred(lambda: recipes(1, max(depth - 1, 0)))
    compared = st.tuples(st.sampled_from(["lt", "le", "gt", "ge"]), scalar, scalar)
    if depth <= 0:
        return compared | st.booleans().map(lambda b: ("const", b))
    other = st.deferred(lambda: conditions(depth - 1))
    return st.one_of(
        compared, st.tuples(st.just("not"), other), st.tuples(st.sampled_from(["and", "or"]), other, other)
    )


def build(recipe: Recipe) -> Expr:
    op, *rest = recipe
    if op == "const":
        return const(rest[0])
    if op in ("a", "p", "q"):
        return {"a": A, "p": P, "q": Q}[op]
    if op == "swizzle":
        return swizzle(build(rest[0]), rest[1])
    args = [build(r) for r in rest]
    if op in BINARY:
        return BINARY[op](*args)
    if op in UNARY:
        return UNARY[op](*args)
    if op == "matmul":
        return v.columns(*args[:-1]) @ args[-1]
    if op == "construct":
        return expr(tuple(args)) if len(args) > 1 else args[0]
    rules = {
        "where": v.where,
        "dot": v.dot,
        "cross": v.cross,
        "lt": lambda x, y: x < y,
        "le": lambda x, y: x <= y,
        "gt": lambda x, y: x > y,
        "ge": lambda x, y: x >= y,
        "and": lambda x, y: x & y,
        "or": lambda x, y: x | y,
        "not": lambda x: ~x,
    }
    return rules[op](*args)


@contextmanager
def unsimplified() -> Iterator[None]:
    """Expressions made here stay as they were written."""
    kept = dict(node._simplifiers)
    node._simplifiers.clear()
    try:
        yield
    finally:
        node._simplifiers.update(kept)


def exact_values(root: Expr) -> Any:
    """Values at POINTS; an example in which some value does not fit float32 exactly is passed over."""
    parts = [e for e in topological([root]) if e.type is not BOOL and not e.type.is_matrix]
    values = evaluator([*parts, root], [A, P, Q])(*POINTS)
    for value in values[:-1]:
        assume(np.all(np.abs(value) < 2.0**12) and np.array_equal(value, np.asarray(value, np.float32)))
    return np.broadcast_to(values[-1], (40, *root.type.shape))


any_size = st.sampled_from([1, 2, 3, 4]).flatmap(lambda n: recipes(n, 4))


@given(any_size)
@settings(max_examples=250)
def test_simplified_values_are_the_values(recipe: Recipe) -> None:
    with unsimplified():
        plain = build(recipe)
    expected = exact_values(plain)
    simple = build(recipe)
    assert simple.type is plain.type
    values = np.broadcast_to(evaluator([simple], [A, P, Q])(*POINTS)[0], expected.shape)
    np.testing.assert_array_equal(values, expected)


@given(any_size)
@settings(max_examples=100)
def test_simplifying_again_changes_nothing(recipe: Recipe) -> None:
    """What was simplified is made of parts that are simple: building it anew from them gives the same object."""
    from raymarch.expr.walk import rewrite

    simple = build(recipe)
    again = rewrite([simple], lambda e, args: node.simplify(e.op, e.type, args, e.data) if args else e)[simple]
    assert again is simple


@given(any_size)
@settings(max_examples=100)
def test_printed_text_means_the_expression(egl: Context, recipe: Recipe) -> None:
    """Parentheses, broadcasting and the order of operands, to the bit."""
    with unsimplified():
        plain = build(recipe)
    expected = exact_values(plain)
    function = Function("tree", (A, P, Q), build(recipe))
    np.testing.assert_array_equal(evaluate(egl, function, POINTS), expected)


@given(any_size)
@settings(max_examples=60)
def test_unsimplified_text_means_the_same(egl: Context, recipe: Recipe) -> None:
    with unsimplified():
        plain = build(recipe)
    expected = exact_values(plain)
    np.testing.assert_array_equal(evaluate(egl, Function("tree", (A, P, Q), plain), POINTS), expected)


# Single rules


@pytest.mark.parametrize(
    ("written", "simple"),
    [
        (lambda: A + 0, lambda: A),
        (lambda: 0 + P, lambda: P),
        (lambda: P * 1, lambda: P),
        (lambda: A * 0, lambda: const(0.0)),
        (lambda: P * 0, lambda: const([0.0] * 3)),
        (lambda: A / 1, lambda: A),
        (lambda: 0 - A, lambda: -A),
        (lambda: A - A, lambda: const(0.0)),
        (lambda: -(0 - A), lambda: A),
        (lambda: A * -1, lambda: -A),
        (lambda: A + (-P.x), lambda: A - P.x),
        (lambda: abs(-A), lambda: abs(A)),
        (lambda: v.min(A, A), lambda: A),
        (lambda: ~~(A < 1), lambda: A < 1),
        (lambda: v.where(const(True), A, P.x), lambda: A),
        (lambda: v.where(A < 1, P, P), lambda: P),
        (lambda: (A < 1) & const(False), lambda: const(False)),
        (lambda: expr((P.x, P.y, P.z)), lambda: P),
        (lambda: expr((P.z, P.x)), lambda: P.zx),
        (lambda: v.vec3(A, Q).yz, lambda: Q),
        (lambda: P.zx.x, lambda: P.z),
        (lambda: expr(np.eye(3)) @ P, lambda: P),
        (lambda: rotation_matrix(expr((1.0, 0.0, 0.0)), expr(np.pi / 2)) @ P, lambda: v.vec3(P.x, -P.z, P.y)),
        (lambda: rotation_matrix(expr((0.0, 1.0, 0.0)), expr(np.pi)) @ P, lambda: v.vec3(-P.x, P.y, -P.z)),
        (lambda: expr([[2.0, 1e-17], [0.0, 1.0]]) @ Q, lambda: expr([[2.0, 0.0], [0.0, 1.0]]) @ Q),
        (lambda: v.transpose(v.transpose(v.columns(Q, Q))), lambda: v.columns(Q, Q)),
        (lambda: const(2.0) * 3 + 1, lambda: const(7.0)),
        (lambda: v.dot((0.0, 0.0, 0.0), P), lambda: const(0.0)),
        (lambda: v.sqrt(-4.0), lambda: const(0.0)),
        (lambda: v.atan2(0.0, -0.0), lambda: const(0.0)),
        (lambda: v.vec2(0.0, 0.0), lambda: const([0.0, 0.0])),
    ],
)
def test_identities(written: Any, simple: Any) -> None:
    assert written() is simple()


def test_a_traced_definition_may_be_constant() -> None:
    assert trace("zero", lambda p: v.length(p * 0.0), [("p", VEC3)]).body is const(0.0)
