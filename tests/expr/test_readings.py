"""One suite that every reading must pass: the same expressions, the same points, the same values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.expr import Expr, Function, const
from raymarch.expr import intervals as interval_reading
from raymarch.expr.arrays import RULES, evaluator, value_of
from raymarch.expr.derivative import BACKWARD, FORWARD, gradient
from raymarch.expr.evaluate import Program
from raymarch.expr.glsl import print_functions
from raymarch.expr.intervals import INTERVALS
from raymarch.expr.partials import PARTIALS
from raymarch.expr.templates import TEMPLATES
from raymarch.expr.types import FLOAT
from raymarch.expr.vocabulary import dot
from raymarch.expr.walk import find
from raymarch.gpu.context import Context
from tests.expr.expression_samples import PER_SAMPLE, SAMPLES, Sample
from tests.support.glsl_harness import assert_es, evaluate, text_of

ULP = float(np.finfo(np.float32).eps)

each_sample = pytest.mark.parametrize("sample", SAMPLES, ids=lambda s: s.name)


def allowed(sample: Sample, expected: NDArray[np.float64], factor: float = 1.0) -> NDArray[np.float64]:
    """The error that a float32 reading may make, for each value."""
    return factor * ULP * (sample.ulps * np.abs(expected) + sample.absolute) + np.finfo(np.float32).tiny


def assert_close(
    sample: Sample,
    values: NDArray[np.floating],
    expected: NDArray[np.float64],
    error: NDArray[np.float64],
    points: Sequence[NDArray[np.float64]],
) -> None:
    difference = np.abs(np.asarray(values, np.float64) - expected)
    if sample.period:
        difference = np.minimum(difference, np.abs(difference - sample.period * np.round(difference / sample.period)))
    bad = ~(difference <= error)
    if bad.any():
        at = tuple(np.argwhere(bad)[0])
        inputs = ", ".join(f"{n} = {p[at[0]]}" for n, p in zip(sample.pools, points, strict=True))
        worst = np.max((difference - error)[bad])
        pytest.fail(
            f"{sample.name}({inputs}) gives {values[at]!r}, not {expected[at]!r}: off by {difference[at]:.3g}, "
            f"allowed {error[at]:.3g}; {bad.sum()} of {bad.size} values are wrong, by up to {worst:.3g}"
        )


@each_sample
def test_float64_arrays_equal_plain_python(sample: Sample) -> None:
    points = sample.points()
    expected = sample.expected(points)
    function = sample.function
    values = np.broadcast_to(evaluator([function.body], function.params)(*points)[0], expected.shape)
    error = 64 * np.finfo(np.float64).eps * (np.abs(expected) + 1 + sample.absolute)
    assert_close(sample, values, expected, error, points)


@each_sample
def test_float32_arrays_are_within_ulps(sample: Sample) -> None:
    points = sample.points()
    expected = sample.expected(points)
    function = sample.function
    values = evaluator([function.body], function.params, np.float32)(*points)[0]
    assert values.dtype == np.float32
    assert_close(sample, np.broadcast_to(values, expected.shape), expected, allowed(sample, expected), points)


@each_sample
def test_a_single_point_gives_the_same_as_many(sample: Sample) -> None:
    """Evaluation at one point has no leading axis."""
    points = sample.points()
    function = sample.function
    run = evaluator([function.body], function.params)
    many = np.broadcast_to(run(*points)[0], (PER_SAMPLE, *function.type.shape))
    for i in range(0, PER_SAMPLE, 31):
        one = run(*[p[i] for p in points])[0]
        assert np.shape(one) == function.type.shape
        np.testing.assert_allclose(one, many[i], rtol=1e-14, atol=1e-14)


@each_sample
def test_constants_follow_the_same_rules(sample: Sample) -> None:
    """pow(-1, 2) written with literals is what it is with variables: folding uses the float64 reading."""
    points = sample.points()
    function = sample.function
    values = np.broadcast_to(
        evaluator([function.body], function.params)(*points)[0], (PER_SAMPLE, *function.type.shape)
    )
    for i in range(0, PER_SAMPLE, 12):
        folded = function.inline(*[const(p[i]) for p in points])
        np.testing.assert_allclose(value_of(folded), values[i], rtol=1e-14, atol=1e-14)


@each_sample
def test_glsl_on_the_driver_is_within_ulps(sample: Sample, egl: Context) -> None:
    points = sample.points()
    expected = sample.expected(points)
    values = evaluate(egl, sample.function, points)
    assert_close(sample, values, expected, allowed(sample, expected, sample.gpu), points)


def test_one_glsl_text_serves_es_too() -> None:
    """All samples in one shader, so that helpers and names must agree as well."""
    functions = [sample.function for sample in SAMPLES]
    printed = print_functions(functions)
    inputs = [[f"{{{p.type.size - 1}}}" for p in f.params] for f in functions]
    calls = [
        f"{printed.names[f]}({', '.join(given)}){'.x' if f.type.is_vector else ''}"
        for f, given in zip(functions, inputs, strict=True)
    ]
    types = [
        p.type for size in (1, 2, 3, 4) for p in [next(q for f in functions for q in f.params if q.type.size == size)]
    ]
    assert_es(text_of(printed), " + ".join(calls), types)


@each_sample
def test_intervals_contain_every_value(sample: Sample) -> None:
    """The range over a box holds the values at points of the box."""
    points = sample.points()
    function = sample.function
    random = np.random.default_rng(7)
    run = evaluator([function.body], function.params)
    program = Program([function.body], list(function.params), INTERVALS)
    for turn in range(24):
        i, j = random.integers(0, PER_SAMPLE, 2)
        boxes = [(np.minimum(p[i], p[j]), np.maximum(p[i], p[j])) for p in points]
        if turn < 4:  # boxes without volume
            boxes = [(p[i], p[i]) for p in points]
        with np.errstate(all="ignore"):
            low, high = program(*boxes)[0]
        inside = [a + (b - a) * random.uniform(size=(32, *np.shape(a))) for a, b in boxes]
        corners = [np.where(random.random((8, *np.shape(a))) < 0.5, a, b) for a, b in boxes]
        values = np.broadcast_to(
            run(*[np.concatenate(parts) for parts in zip(inside, corners, strict=True)])[0], (40, *function.type.shape)
        )
        slack = 1e-12 * (1 + np.abs(values))
        inf = ~np.isfinite(values)
        low, high = (np.where(np.isnan(edge), worst, edge) for edge, worst in ((low, -np.inf), (high, np.inf)))
        assert np.all((values >= low - slack) | inf), (boxes, low, values.min(0))
        assert np.all((values <= high + slack) | inf), (boxes, high, values.max(0))


def scalar_of(sample: Sample, function: Function) -> Expr:
    """The sample's value, a vector weighed into one number."""
    if function.type is FLOAT:
        return function.body
    return dot(function.body, const([0.9, -0.4, 1.3, 0.7][: function.type.size]))


derivatives = pytest.mark.parametrize(
    ("sample", "by"), [(s, by) for s in SAMPLES for by in s.differentiable], ids=lambda x: getattr(x, "name", x)
)


@derivatives
def test_derivative_equals_central_differences(sample: Sample, by: str) -> None:
    points = sample.points()
    function = sample.function
    root = scalar_of(sample, function)
    index = list(sample.pools).index(by)
    variable = function.params[index]
    slope = np.broadcast_to(evaluator([gradient(root, variable)], function.params)(*points)[0], points[index].shape)
    assert np.all(np.isfinite(slope)), "no slope is infinite, on kinks either"

    value = evaluator([root], function.params)
    size = variable.type.size
    h = 1e-6
    compared = 0
    for axis in range(size):
        offset = h * np.eye(size)[axis] if size > 1 else np.asarray(h)
        far, before, at, after, beyond = (
            np.broadcast_to(value(*[q + k * offset if i == index else q for i, q in enumerate(points)])[0], PER_SAMPLE)
            for k in (-2, -1, 0, 1, 2)
        )
        central, wide = (after - before) / (2 * h), (beyond - far) / (4 * h)
        uneven = np.abs(after - 2 * at + before) / h + np.abs(central - wide)
        smooth = uneven <= 1e-3 * (1 + np.abs(central))  # leaves out kinks, jumps and singular points
        compared += smooth.sum()
        exact = slope[:, axis] if size > 1 else slope
        np.testing.assert_allclose(exact[smooth], central[smooth], rtol=5e-6, atol=5e-6)
    assert compared >= PER_SAMPLE * size / 8, "too few points are smooth to tell anything"


@derivatives
def test_derivative_in_float32_is_finite(sample: Sample, by: str) -> None:
    points = sample.points()
    function = sample.function
    variable = function.params[list(sample.pools).index(by)]
    slope = evaluator([gradient(scalar_of(sample, function), variable)], function.params, np.float32)(*points)[0]
    assert np.all(np.isfinite(slope))


# Completeness

CONDITIONS = {"lt", "le", "and", "or", "not", "finite"}
"""They give a bool, which has no derivative; `where` differentiates what it chooses from."""


STRUCTS = {"record", "field"}
"""Structs are made after all facts are derived, so they have no intervals; tests/expr/test_choices.py samples them."""


def test_every_operation_has_every_reading() -> None:
    operations = set(RULES)
    assert operations - set(TEMPLATES) == set(), "no GLSL"
    assert operations - set(interval_reading.RULES) == STRUCTS, "no intervals"
    assert operations - set(PARTIALS) - set(BACKWARD) == CONDITIONS | STRUCTS, "no derivative"
    assert set(BACKWARD) == set(FORWARD), "a loop needs the forward rule of what a body needs backwards"
    assert not set(PARTIALS) & set(BACKWARD), "two rules for one operation"
    assert set(TEMPLATES) <= operations, "GLSL of something that NumPy does not know"


def test_every_operation_has_a_sample() -> None:
    used = {e.op for s in SAMPLES for e in find([s.function.body], *RULES)}
    assert set(RULES) - used == STRUCTS | {"fetch"}, "tests/expr/test_tables.py samples the last"


def test_names_of_samples_differ() -> None:
    assert len({s.name for s in SAMPLES}) == len(SAMPLES)
