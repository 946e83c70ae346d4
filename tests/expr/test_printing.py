"""GLSL text: legal names, literals that every version reads, the same text in every process."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import raymarch
import raymarch.expr.vocabulary as v
from raymarch.errors import SceneError
from raymarch.expr import Expr, Function, const, function, loop, trace, var
from raymarch.expr.arrays import bound, evaluator
from raymarch.expr.glsl import FunctionPrinter, Text, print_functions
from raymarch.expr.intervals import interval_of
from raymarch.expr.pieces import Piece, constant, identifier, literal
from raymarch.expr.types import FLOAT, VEC2, VEC3
from raymarch.expr.walk import topological
from raymarch.gpu.context import Context
from raymarch.scene.parameter import Param, time
from tests.expr.expression_samples import SAMPLES
from tests.support.glsl_harness import assert_es, evaluate, run, text_of

A, P = var("a", FLOAT), var("p", VEC3)
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d*)?(?:[eE][-+]?\d+)?(?![\w.])")


def text(*functions: Function) -> str:
    return text_of(print_functions(functions))


def print_expression(node: Expr) -> str:
    """One expression without temporaries."""
    printer = FunctionPrinter(Function("value", (), node), Text({}, [], {}, {}, False), set())
    printer.names = {leaf: str(leaf.data) for leaf in topological([node]) if leaf.op == "var"}
    pieces: dict[Expr, Piece] = {}
    for each in topological([node]):
        pieces[each] = printer._piece(each, pieces)
    return pieces[node].text


# Literals


@given(st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_a_literal_has_a_point_and_loses_nothing(number: float) -> None:
    written = literal(number)
    assert re.fullmatch(r"-?\d+\.\d+(e[-+]?\d+)?", written), written
    assert np.float32(written) == np.float32(number)
    assert np.signbit(np.float32(written)) == np.signbit(np.float32(number))


@pytest.mark.parametrize(
    ("number", "written"),
    [(1, "1.0"), (0.1, "0.1"), (-2.5, "-2.5"), (1e-7, "1.0e-7"), (1e20, "1.0e20"), (1 / 3, "0.33333334")],
)
def test_literals_are_as_short_as_they_can_be(number: float, written: str) -> None:
    assert literal(number) == written


@pytest.mark.parametrize("number", [np.inf, -np.inf, np.nan, 1e39, -3.5e38])
def test_what_float32_cannot_hold_is_refused(number: float) -> None:
    with pytest.raises(SceneError, match=re.escape(f"{number} cannot be written in GLSL")):
        literal(number)
    with pytest.raises(SceneError, match="cannot be written in GLSL"):
        text(Function("f", (A,), A + const(number)))


def test_literals_arrive_on_the_device_bit_by_bit(egl: Context) -> None:
    random = np.random.default_rng(5)
    numbers = (random.uniform(1, 10, 60) * 10.0 ** random.integers(-30, 30, 60)).astype(np.float32)
    picked = const(0.0)
    for i, number in enumerate(numbers):
        picked = v.where(const(i - 0.5) < A, const(float(number)), picked)
    values = evaluate(egl, Function("pick", (A,), picked), [np.arange(60.0)])
    np.testing.assert_array_equal(values, numbers)


def test_every_number_in_a_text_is_a_float_except_in_the_head_of_a_loop() -> None:
    counted = ("sampled", "pictured", "lattice")  # texels and hashes are counted in integers
    printed = print_functions([s.function for s in SAMPLES if not s.name.startswith(counted)])
    for line in printed.lines():
        if not line.text.strip().startswith("for (int "):
            for number in NUMBER.findall(line.text):
                assert "." in number, line.text


def test_constants_of_each_type() -> None:
    assert constant(const(True)) == "true"
    assert constant(const([1.0, 2.0])) == "vec2(1.0, 2.0)"
    assert constant(const([3.0, 3.0, 3.0])) == "vec3(3.0)"
    assert constant(const([[1.0, 2.0], [3.0, 4.0]])) == "mat2(1.0, 3.0, 2.0, 4.0)", "by columns"


# Form


@pytest.mark.parametrize(
    ("e", "written"),
    [
        (lambda a, p: a - (a - 1.0), "a - (a - 1.0)"),
        (lambda a, p: a - 1.0 + a, "a - 1.0 + a"),
        (lambda a, p: a * (a + 1.0) / 3.0, "a * (a + 1.0) / 3.0"),
        (lambda a, p: a / (a / 3.0), "a / (a / 3.0)"),
        (lambda a, p: -(a + 1.0), "-(a + 1.0)"),
        (lambda a, p: -a * 2.0, "-a * 2.0"),
        (lambda a, p: (a + p).x, "(a + p).x"),
        (lambda a, p: -p.x, "-p.x"),
        (lambda a, p: v.max(1.0, p), "max(p, 1.0)"),
        (lambda a, p: v.step(p, a), "step(p, vec3(a))"),
        (lambda a, p: v.step(a, p), "step(a, p)"),
        (lambda a, p: v.pow(abs(p) + 1.0, 2.0), "pow(max(abs(p) + 1.0, 1.1754944e-38), vec3(2.0))"),
        (lambda a, p: v.sqrt(a), "sqrt(max(a, 0.0))"),
        (lambda a, p: v.sqrt(a * a + p.x * p.x + 1.0), "sqrt(a * a + p.x * p.x + 1.0)"),
        (lambda a, p: v.where(const(1.0) < a, a, p.x), "a > 1.0 ? a : p.x"),
        (lambda a, p: v.where((a < 1.0) | (a > 2.0) & (p.x < a), a, 1.0), "a < 1.0 || a > 2.0 && p.x < a ? a : 1.0"),
        (lambda a, p: v.where(~(a < 1.0), a, 1.0) * 2.0, "(a < 1.0 ? 1.0 : a) * 2.0"),
        (lambda a, p: v.mod(a, p), "mod(vec3(a), p)"),
        (lambda a, p: v.round(a - 1.0), "floor(a - 1.0 + 0.5)"),
    ],
)
def test_expressions_read_as_a_person_would_write_them(e: Callable[[Expr, Expr], Expr], written: str) -> None:
    assert print_expression(e(A, P)) == written


def test_a_function_reads_as_a_person_would_write_it() -> None:
    def rounded_box(p: Expr, size: Expr) -> Expr:
        q = abs(p) - 0.5 * size
        return v.length(v.max(q, 0.0)) + v.min(v.max(q.x, v.max(q.y, q.z)), 0.0)

    assert text(trace("rounded_box", rounded_box, [("p", VEC3), ("size", VEC3)])) == (
        "float rounded_box(vec3 p, vec3 size) {\n"
        "    vec3 q = abs(p) - 0.5 * size;\n"
        "    return length(max(q, 0.0)) + min(max(q.x, max(q.y, q.z)), 0.0);\n"
        "}\n"
    )


def test_a_loop_reads_as_a_person_would_write_it() -> None:
    def folded(p: Expr) -> Expr:
        def step(i: Expr, q: Expr, scale: Expr) -> tuple[Expr, Expr]:
            return abs(q) * 2.0 - 1.0, scale * 2.0

        q, scale = loop(8, (p, 1.0), step, until=lambda i, q, scale: v.length(q) > 4.0)
        return v.length(q) / scale

    assert text(trace("folded", folded, [("p", VEC3)])) == (
        "float folded(vec3 p) {\n"
        "    vec3 q = p;\n"
        "    float d = 1.0;\n"
        "    for (int i = 0; i < 8; i++) {\n"
        "        if (length(q) > 4.0) break;\n"
        "        q = abs(q) * 2.0 - 1.0;\n"
        "        d = d * 2.0;\n"
        "    }\n"
        "    return length(q) / d;\n"
        "}\n"
    )


def test_what_is_used_once_has_no_temporary_and_what_is_used_twice_is_computed_once() -> None:
    shared = v.sin(A * 2.0)
    written = text(Function("f", (A,), shared * shared + v.cos(A)))
    assert written.count("sin(") == 1
    assert written.count(" = ") == 1


def test_what_a_loop_does_not_change_is_computed_before_it() -> None:
    e = loop(5, (A,), lambda i, x: (x * v.sin(P.x),))[0]
    written = text(Function("f", (A, P), e))
    assert written.index("sin(") < written.index("for (")


# Names

HOSTILE = [
    "sample",
    "input",
    "output",
    "length",
    "main",
    "float",
    "vec3",
    "mat2x3",
    "half",
    "texture",
    "texture2D",
    "sampler2D",
    "isampler3D",
    "packed",
    "row_major",
    "sizeof",
    "asinh",
    "roundEven",
    "outerProduct",
    "lessThanEqual",
    "gl_Position",
    "webgl_x",
    "__double__",
    "a__b",
    "2fast",
    "größe",
    "with space",
    "unit",
    "atan2",
    "field",
    "hvec3",
    "mat",
    "vec",
    "noise",
    "dFdx",
    "atomic_uint",
    "u_time",
    "i",
    "p",
    "",
]


@pytest.mark.parametrize("name", HOSTILE)
def test_an_identifier_is_legal_and_free(name: str) -> None:
    first = identifier(name, ())
    second = identifier(name, {first})
    third = identifier(name, {first, second})
    assert len({first, second, third}) == 3
    for made in (first, second, third):
        assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", made)
        assert "__" not in made
        assert not made.startswith(("gl_", "webgl_"))
        assert made not in ("mat2", "mat3", "vec2", "vec3", "noise2", "noise3")


def hostile_function(name: str) -> Function:
    """A function of this name, with a parameter and a local variable of this name, called by another."""
    own = trace(name, lambda p, x: v.length(p) * x, [("p", VEC3), (name or "empty", FLOAT)])
    inner = own.body + v.sin(own.params[1])
    called = Function(name, own.params, inner * inner, {inner: name})
    return Function("caller", (P, A), called(P, A) + called(v.normalize(P), v.atan2(A, P.x)))


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_compile_and_keep_their_values(egl: Context, name: str) -> None:
    caller = hostile_function(name)
    points = [np.array([[1.0, 2.0, 2.0], [0.5, -1.0, 0.25]]), np.array([0.5, -2.0])]
    expected = evaluator([caller.body], caller.params)(*points)[0]
    np.testing.assert_allclose(evaluate(egl, caller, points), expected, rtol=1e-4)


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_compile_in_es(name: str) -> None:
    """ES forbids functions of a built-in's name outright, where desktop GLSL only hides the built-in."""
    printed = print_functions([hostile_function(name)])
    assert_es(text_of(printed), "caller({0}, {1})", [VEC3, FLOAT])


def test_functions_of_one_name_get_two() -> None:
    one, two = (Function("lump", (A,), body) for body in (A + 1.0, A * 3.0))
    printed = print_functions([Function("field", (A,), one(A) + two(A))])
    assert len(set(printed.names.values())) == 3


def test_names_that_are_taken_are_left_alone() -> None:
    lump = Function("shade", (A,), A + 1.0)
    printed = print_functions([Function("field", (A,), lump(A))], taken={"shade", "shade2"})
    assert printed.names[lump] not in {"shade", "shade2"}


def test_letters_that_glsl_lacks_make_different_uniforms() -> None:
    printed = text(Function("f", (A,), A + Param("é", 1.0) * Param("è", 1.0) * Param("e", 1.0)))
    assert printed.isascii() and all(name in printed for name in ("u_xe9", "u_xe8", "u_e"))


def test_a_local_variable_does_not_hide_a_function(egl: Context) -> None:
    @function(x=FLOAT)
    def doubled(x: Expr) -> Expr:
        return 2.0 * x

    def user(a: Expr) -> Expr:
        doubled_ = doubled(a)
        kept = doubled_ * doubled_
        return kept + doubled(kept)

    traced = trace("user", user, [("a", FLOAT)])
    names = {e: n.rstrip("_") for e, n in traced.names.items()}
    traced = Function("user", traced.params, traced.body, names)
    np.testing.assert_allclose(evaluate(egl, traced, [np.array([1.0, 3.0])]), [12.0, 108.0])


# Parameters and time


def test_parameters_are_uniforms(egl: Context) -> None:
    radius, offset = Param("Ball radius", 0.5, 0.25, 2.0), Param("offset", (1.0, 0.0, 0.0))
    f = Function("f", (P,), v.length(P - offset) - radius + time)
    printed = print_functions([f])
    assert set(printed.uniforms) == {"u_Ball_radius", "u_offset"}
    assert printed.uses_time
    points = np.random.default_rng(1).normal(size=(20, 3))
    given = {"u_Ball_radius": 1.5, "u_offset": (0.0, 2.0, 0.5), "u_time": 0.25}
    values = run(egl, text_of(printed), "f({0})", [(VEC3, points)], uniforms=given)
    with bound({"Ball radius": 1.5, "offset": (0.0, 2.0, 0.5)}, 0.25):
        expected = evaluator([f.body], [P])(points)[0]
    np.testing.assert_allclose(values, expected, atol=1e-5)


def test_unbound_parameters_have_their_defaults() -> None:
    e = Param("size", 3.0) * 2.0 + time
    assert evaluator([e], [])()[0] == 6.0
    with bound({"size": 5.0}, 1.0):
        assert evaluator([e], [])()[0] == 11.0
    assert evaluator([e], [])()[0] == 6.0


def test_a_parameter_ranges_over_its_interval() -> None:
    low, high = interval_of(Param("k", 1.0, 0.5, 2.0) * -2.0)
    assert (low, high) == (-4.0, -1.0)
    low, high = interval_of(Param("open", 1.0, min=0.5) + time)
    assert (low, high) == (-np.inf, np.inf)
    low, high = interval_of(Param("v", (1.0, 2.0), 0.0, (3.0, 4.0)))
    assert (low.tolist(), high.tolist()) == ([0.0, 0.0], [3.0, 4.0])


def test_a_parameter_named_time_is_not_the_time(egl: Context) -> None:
    f = Function("f", (A,), Param("time", 1.0) * 100.0 + time + A)
    printed = print_functions([f])
    (name,) = printed.uniforms
    assert name != "u_time"
    values = run(egl, text_of(printed), "f({0})", [(FLOAT, np.zeros(1))], uniforms={name: 3.0, "u_time": 7.0})
    assert values[0] == 307.0


@pytest.mark.parametrize(
    ("one", "two"),
    [
        (("my size", 1.0), ("my_size", 1.0)),
        (("a-b", 1.0), ("a_b", 1.0)),
        (("time", 1.0), ("time2", 1.0)),
        (("same", 1.0), ("same", 2.0)),
        (("same", 1.0, 0.0), ("same", 1.0)),
    ],
)
def test_two_parameters_never_share_a_uniform(one: Any, two: Any) -> None:
    with pytest.raises(SceneError, match="would both be u_"):
        text(Function("f", (A,), A + Param(*one) * Param(*two)))


def test_a_local_variable_does_not_hide_a_uniform(egl: Context) -> None:
    def shadowing(a: Expr) -> Expr:
        u_size = v.sin(a)
        return u_size * u_size + Param("size", 2.0)

    f = trace("shadowing", shadowing, [("a", FLOAT)])
    printed = print_functions([f])
    values = run(egl, text_of(printed), "shadowing({0})", [(FLOAT, np.zeros(1))], uniforms={"u_size": 2.0})
    assert values[0] == 2.0


def test_a_function_does_not_hide_a_uniform() -> None:
    lump = Function("u_size", (A,), A * Param("size", 2.0))
    printed = print_functions([Function("field", (A,), lump(A) + 1.0)])
    assert printed.names[lump] not in printed.uniforms


# Determinism


def test_the_text_does_not_depend_on_the_process() -> None:
    """Two processes with different hash seeds, one of which has made other expressions before."""
    root = Path(raymarch.__file__).parents[1]
    code = (
        "from tests.expr.expression_samples import SAMPLES\n"
        "from raymarch.expr.derivative import companion\n"
        "from raymarch.expr.glsl import print_functions\n"
        "from raymarch.expr.types import FLOAT, VEC2, VEC3\n"
        "if EARLIER: [print_functions([s.function]) for s in reversed(SAMPLES)]\n"
        "functions = [s.function for s in SAMPLES]\n"
        "along = [f for f in functions if f.type is FLOAT and f.params[0].type in (VEC2, VEC3)]\n"
        "functions += [companion(f) for f in along]\n"
        "print(*[line.text for line in print_functions(functions).lines()], sep='\\n')\n"
    )
    texts = []
    for seed, earlier in (("1", "False"), ("4242", "True")):
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", f"EARLIER = {earlier}\n{code}"],
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(root)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        texts.append(done.stdout)
    assert texts[0] == texts[1]
    assert len(texts[0]) > 10_000


def test_printing_twice_gives_the_same_text() -> None:
    functions = [s.function for s in SAMPLES]
    assert text(*functions) == text(*functions)


def test_each_definition_is_written_once() -> None:
    ball = Function("ball", (P,), v.length(P) - 1.0)
    pair = Function("pair", (P,), v.min(ball(P), ball(P * 2.0)))
    written = text(Function("field", (P,), v.max(pair(P), -ball(P + 1.0))))
    assert written.count("float ball(") == 1
    assert written.index("float ball(") < written.index("float pair(") < written.index("float field(")


def test_helpers_come_once_for_each_type() -> None:
    q = var("q", VEC2)
    written = text(Function("f", (P, q), v.normalize(P).x + v.normalize(P + 1.0).y + v.normalize(q).x))
    assert written.count("vec3 unit(vec3 v)") == 1
    assert written.count("vec2 unit(vec2 v)") == 1
