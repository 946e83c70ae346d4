"""The first value in an expression that goes wrong, found in NumPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import raymarch.expr.vocabulary as v
from raymarch.expr import Expr, Function, loop, var
from raymarch.expr.arrays import evaluator
from raymarch.expr.faults import KINDS, Passage, decoded, faults_of, first_fault, plain
from raymarch.expr.node import make
from raymarch.expr.raw import RawFunction, raw
from raymarch.expr.types import VEC3

P = var("p", VEC3)


def found(value: Expr, at: Any) -> tuple[str, int, float]:
    """Kind, site and value of the fault of an expression at a point (x, y, z); "" for none."""
    fault = first_fault([value])
    if fault is None:
        return "", 0, 0.0
    code, culprit = evaluator([fault], [P], np.float32)([at])[0].reshape(2)
    kind, site = decoded(float(code))
    return KINDS[kind], site, float(culprit)


def passed(value: Expr, site: int, role: str = "value") -> Expr:
    return make("probe", value.type, (value, P), Passage(role, site, 0))  # type: ignore[arg-type]


WRONG: dict[str, tuple[Callable[[], Expr], tuple[float, float, float], str, float]] = {
    "division": (lambda: P.y / P.x, (0, 1, 0), "a division by 0", 0),
    "division of vectors": (lambda: v.dot(P / v.vec3(1, P.x, 1), P), (0, 1, 0), "a division by 0", 0),
    "mod": (lambda: v.mod(P.y, P.x), (0, 1, 0), "mod by 0", 0),
    "root": (lambda: v.sqrt(P.x), (-2, 0, 0), "the root of a negative number", -2),
    "root of a difference": (lambda: v.sqrt(1.0 - P.x), (3, 0, 0), "the root of a negative number", -2),
    "logarithm": (lambda: v.log(P.x), (0, 0, 0), "the logarithm of 0 or less", 0),
    "a hidden logarithm": (lambda: v.max(v.log(P.x), 1.0), (0, 0, 0), "the logarithm of 0 or less", 0),
    "power": (lambda: v.pow(P.x, 0.5), (-1, 0, 0), "a power of a negative number", -1),
    "arc sine": (lambda: v.asin(P.x), (1.5, 0, 0), "the arc sine of more than 1", 1.5),
    "arc cosine": (lambda: v.acos(P.x), (-1.5, 0, 0), "the arc cosine of more than 1", -1.5),
    "smoothstep": (lambda: v.smoothstep(P.x, P.y, P.z), (1, 1, 0), "a smoothstep without width", 0),
    "overflow": (lambda: v.exp(P.x), (200, 0, 0), "a value that is not finite", np.inf),
    "a hidden overflow": (lambda: v.min(v.exp(P.x), 1.0), (200, 0, 0), "a value that is not finite", np.inf),
    "overflow of a vector": (lambda: v.max(P * 3e38, 0.0).y, (0, 9, 0), "a value that is not finite", np.inf),
    "an infinite divisor": (lambda: 1.0 / v.exp(P.x), (200, 0, 0), "a value that is not finite", np.inf),
    "the taken side": (lambda: v.where(P.x > 0.0, 1.0, v.sqrt(P.x)), (-4, 0, 0), "the root of a negative number", -4),
    "the condition": (lambda: v.where(v.log(P.x) > 0.0, 1.0, 2.0), (0, 0, 0), "the logarithm of 0 or less", 0),
    "in a loop": (
        lambda: loop(4, (P.x, 0.0), lambda i, x, s: (x - 1.0, s + v.sqrt(x)))[1],
        (2.5, 0, 0),
        "the root of a negative number",
        -0.5,
    ),
    "a loop that overflows": (
        lambda: v.min(loop(9, (P.x,), lambda i, x: (x * x,))[0], 1.0),
        (10, 0, 0),
        "a value that is not finite",
        np.inf,
    ),
    "in a loop of a loop": (
        lambda: loop(2, (P.x,), lambda i, x: (loop(2, (x,), lambda j, y: (v.log(y),))[0],))[0],
        (0, 0, 0),
        "the logarithm of 0 or less",
        0,
    ),
    "in GLSL": (
        lambda: v.max(raw(RawFunction("nan_there", "", lambda p: p[:, 0] + np.nan, 1.0), P), 0.0),
        (1, 0, 0),
        "a value that is not finite",
        np.nan,
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_goes_wrong_is_named(name: str) -> None:
    make_it, at, what, value = WRONG[name]
    kind, _, culprit = found(make_it(), at)
    assert kind == what and np.array_equal(culprit, np.float32(value), equal_nan=True)
    away = {"smoothstep": (0, 1, 2)}.get(name, (0.9, 0.8, 0.7))
    if name not in ("in GLSL", "in a loop", "the condition", "in a loop of a loop", "a loop that overflows"):
        assert found(make_it(), away)[0] == ""


def test_a_loop_that_stays_well_has_no_fault() -> None:
    well = loop(3, (P.x, 0.0), lambda i, x, s: (x - 1.0, s + v.sqrt(x)))[1]
    assert found(well, (2.5, 0, 0))[0] == "" and found(well, (1.5, 0, 0))[2] == -0.5
    left = loop(9, (P.x, 0.0), lambda i, x, s: (x - 1.0, s + v.sqrt(x)), lambda i, x, s: x < 0.0)[1]
    assert found(left, (2.5, 0, 0))[0] == ""


HARMLESS: dict[str, tuple[Callable[[], Expr], tuple[float, float, float]]] = {
    "the side that is not taken": (lambda: v.where(P.x > 0.0, v.log(P.x), 0.0), (-1, 0, 0)),
    "what is meant": (lambda: v.sqrt(v.max(P.x, 0.0)), (-1, 0, 0)),
    "what is meant of a logarithm": (lambda: v.log(v.max(P.x, 1e-6)), (-1, 0, 0)),
    "directions on an axis": (lambda: v.atan2(P.x, P.y) + v.normalize(P).x, (0, 0, 0)),
    "rounding under a root": (lambda: v.sqrt(1.0 - P.x), (1 + 1e-6, 0, 0)),
    "rounding of an arc cosine": (lambda: v.acos(P.x), (1 + 1e-6, 0, 0)),
    "a power of 0": (lambda: v.pow(P.x, 2.0), (0, 0, 0)),
    "a divisor that cannot be 0": (lambda: P.y / v.max(v.abs(P.x), 1e-6) + P.x / (P.y * P.y + 1.0), (0, 0, 0)),
}


@pytest.mark.parametrize("name", HARMLESS)
def test_what_is_harmless_is_passed_over(name: str) -> None:
    value, at = HARMLESS[name]
    assert found(value(), at)[0] == ""


def test_a_fault_counts_where_it_arises() -> None:
    inner = passed(v.log(P.x), 7)
    assert found(passed(v.max(v.sqrt(inner), 0.0), 3), (0, 0, 0))[:2] == ("the logarithm of 0 or less", 7)
    assert found(passed(v.max(v.sqrt(inner), 0.0), 3), (0.5, 0, 0))[:2] == ("the root of a negative number", 3)
    assert found(passed(v.exp(inner * 500.0), 3), (9, 0, 0))[:2] == ("a value that is not finite", 3)
    assert found(passed(inner + passed(P.x / P.y, 5), 3), (1, 0, 0))[1] == 5


def test_what_goes_wrong_in_a_function_belongs_to_its_caller() -> None:
    helper = Function("helper", (P,), v.log(P.x))
    assert found(helper(P), (0, 0, 0))[:2] == ("the logarithm of 0 or less", 0)
    assert found(passed(passed(helper(P), 4) + 1.0, 2), (0, 0, 0))[:2] == ("the logarithm of 0 or less", 4)
    assert found(passed(helper(P * v.exp(P.y)), 2), (1, 200, 1))[:2] == ("a value that is not finite", 2)
    harmless = Function("harmless", (P,), v.clamp(P.x, 0.0, 1.0))
    assert faults_of(harmless) is None and faults_of(helper) is faults_of(helper)


def test_without_probes_all_is_as_it_was() -> None:
    helper = Function("helper", (P,), passed(v.log(P.x), 2))
    value = loop(2, (passed(helper(P), 1),), lambda i, x: (x * P.y,))[0]
    bare = plain(Function("bare", (P,), passed(value, 3))).body
    clean = Function("helper", (P,), v.log(P.x))
    at = np.array([[0.7, 0.3, 0.2]])
    expected = evaluator([loop(2, (clean(P),), lambda i, x: (x * P.y,))[0]], [P])(at)[0]
    assert evaluator([bare], [P])(at)[0] == expected
    assert plain(clean) is clean and plain(helper) is not helper and plain(helper).body is clean.body
