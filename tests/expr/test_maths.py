"""The functions of the package (`rm.sin`): for expressions, numbers and arrays; NumPy's functions of expressions."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.expr import maths, peers
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import Expr, expr, var
from raymarch.expr.types import FLOAT, VEC3

X = var("x", FLOAT)
V = var("v", VEC3)
POINTS = np.array([-2.5, -1.0, -0.3, 0.0, 0.4, 1.0, 2.75])

ONE = "sin cos tan asin acos atan sinh cosh tanh exp exp2 log log2 sqrt abs sign floor ceil fract".split()


def values(made: Expr, at: np.ndarray = POINTS, symbol: Expr = X) -> np.ndarray:
    return np.broadcast_to(evaluator([made], [symbol])(at)[0], np.shape(at) if symbol is X else (len(at),))


@pytest.mark.parametrize("name", ONE)
def test_numbers_arrays_and_expressions_have_the_same_values(name: str) -> None:
    function = getattr(rm, name)
    expected = values(function(X))
    assert isinstance(function(X), Expr)
    np.testing.assert_array_equal(function(POINTS), expected)
    assert [function(float(x)) for x in POINTS] == expected.tolist()
    assert type(function(0.5)) is float and function(np.ones((2, 3))).shape == (2, 3)


def test_functions_of_several_numbers() -> None:
    assert rm.mix(0, 10, 0.25) == 2.5 and rm.clamp(7, 0, 1) == 1.0 and rm.step(0.5, 0.7) == 1.0
    assert rm.min(3, 1, 2) == 1.0 and rm.max(3, 1, 2) == 3.0 and rm.mod(-1, 3) == 2.0
    np.testing.assert_array_equal(rm.mix(np.zeros((2, 1)), [1.0, 2.0, 4.0], 0.5), [[0.5, 1, 2]] * 2)
    np.testing.assert_array_equal(rm.smoothstep(0, 1, np.array([0.0, 0.5, 2.0])), [0, 0.5, 1])
    np.testing.assert_array_equal(rm.where(POINTS > 0, POINTS, 0), np.maximum(POINTS, 0))
    assert rm.where(True, 1, 2) == 1.0 and rm.where(False, X, 2 * X) is 2 * X
    assert rm.pi == math.pi and rm.tau == math.tau


def test_functions_of_vectors() -> None:
    several = np.arange(12.0).reshape(4, 3)
    assert rm.length((3, 4)) == 5.0 and rm.dot((1, 2, 3), (4, 5, 6)) == 32.0 and rm.length(-2.0) == 2.0
    np.testing.assert_allclose(rm.length(several), np.linalg.norm(several, axis=1))
    np.testing.assert_array_equal(rm.dot(several, (1, 0, 0)), several[:, 0])
    np.testing.assert_array_equal(rm.cross_product((1, 0, 0), (0, 1, 0)), (0, 0, 1))
    np.testing.assert_allclose(rm.normalize(several[1:]) * rm.length(several[1:])[:, None], several[1:])
    np.testing.assert_allclose(values(rm.length(V), several, V), rm.length(several))
    assert isinstance(rm.vec3(1, rm.time, 0), Expr) and rm.vec3(2).type is VEC3


WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "a string": (lambda: rm.sin("x"), r"sin: argument = 'x' \(numbers, arrays of them, or expressions\)"),
    "edges": (lambda: rm.smoothstep(1, 0, POINTS), "smoothstep with the edges"),
    "shapes": (lambda: rm.max(np.ones(2), np.ones(3)), r"max of shapes \(2,\) and \(3,\)"),
    "a long vector": (lambda: rm.length(np.ones((2, 5))), "length of shapes"),
    "vectors of two sizes": (lambda: rm.dot((1, 2), (1, 2, 3)), r"dot\(vec2, vec3\)"),
    "a condition": (lambda: rm.where(1, 2, 3), "where needs a condition, not 1"),
    "math": (lambda: math.sin(rm.time), "no numeric value.*rm.sin in place of math.sin"),
    "if": (lambda: 1 if rm.time > 0 else 2, r"rm.where\(condition, a, b\) in place of if"),
    "max": (lambda: max(rm.time, 0), "rm.min and rm.max in place of min and max"),
    "max of a vector": (lambda: max(expr((rm.time, 1)), 0), "cannot order .*rm.min and rm.max, which take vectors"),
    "a function that is not there": (lambda: np.frexp(rm.time), "numpy.frexp of an expression"),
    "a reduction": (lambda: np.add.reduce(rm.time), "numpy.add.reduce of an expression"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_argument_is_named(name: str) -> None:
    call, words = WRONG[name]
    with pytest.raises(rm.SceneError, match=words) as fault:
        call()
    assert fault.value.where is not None and fault.value.where.file == __file__


SAME = {
    **{name: name for name in "sin cos tan sinh cosh tanh exp exp2 floor ceil sign negative square trunc".split()},
    **{name: name for name in "cbrt radians degrees absolute fabs positive".split()},
}


@pytest.mark.parametrize("name", SAME)
def test_functions_of_numpy_take_expressions(name: str) -> None:
    function = getattr(np, name)
    np.testing.assert_allclose(values(function(X)), function(POINTS), rtol=1e-14)


@pytest.mark.parametrize("name", "add subtract multiply divide minimum maximum remainder floor_divide hypot".split())
def test_functions_of_numpy_of_two_numbers(name: str) -> None:
    function = getattr(np, name)
    np.testing.assert_allclose(values(function(X, 1.5)), function(POINTS, 1.5), rtol=1e-14)
    np.testing.assert_allclose(values(function(1.5, X), POINTS + 0.0137), function(1.5, POINTS + 0.0137), rtol=1e-14)


def test_numpy_scalars_and_arrays_beside_an_expression() -> None:
    assert np.float64(2) * X is 2 * X and np.float64(1) - X is 1 - X and (np.float64(1) < X) is (X > 1)
    assert np.array([1.0, 2.0, 3.0]) * X is expr((1, 2, 3)) * X
    assert (np.float64(1) == X) is False and X in (np.float64(1), X)


@pytest.mark.parametrize("power", [0, 1, 2, 3, 5, -1, -2, 66, 67, 2.0])
def test_whole_powers_take_any_sign(power: float) -> None:
    points = POINTS[POINTS != 0]
    np.testing.assert_allclose(values(X**power, points), points**power, rtol=1e-12)


def test_other_powers_are_of_positive_numbers() -> None:
    points = np.array([0.1, 1.0, 2.5])
    np.testing.assert_allclose(values(X**2.5, points), points**2.5)
    np.testing.assert_allclose(values(X**0.5, points), points**0.5)
    np.testing.assert_allclose(values(2**X, points), 2**points)
    np.testing.assert_allclose(values(np.power(X, 1.5), points), points**1.5)
    np.testing.assert_allclose(values(2.53 % X, points), 2.53 % points)
    np.testing.assert_allclose(values(X // 0.3, points), points // 0.3)
    assert round(X) is maths.v.round(X) and math.floor(X) is maths.v.floor(X)


def test_a_constant_converts_to_a_number() -> None:
    assert float(rm.vec3(1, 2, 3).y) == 2.0


def test_every_function_has_a_help_text() -> None:
    for name in maths.__all__:
        function = getattr(rm, name)
        if callable(function):
            assert function.__doc__ and function.__doc__.strip(), name
    assert "Euclidean norm" in str(rm.length.__doc__) and "Sine of an angle in radians" in str(rm.sin.__doc__)


# Names of other tools

NAMES: dict[str, tuple[Callable[[], Any], str]] = {
    "an index": (lambda: rm.vec3(1, 2, 3)[5], r"component 5 of a vec3 \(an index from 0 to 2\)"),
    "what a scene does": (lambda: rm.Scene(rm.sphere()).render, r"a Scene has no 'render' \(use rm.render\(scene\)\)"),
    "a parameter": (lambda: rm.value_noise(rm.vec3(1, 2, 3), octaves=1), r"value_noise has no parameter 'octaves'"),
    "a function": (lambda: rm.smooth_union, r"raymarch has no 'smooth_union' \(did you mean rm.union\(a, b, k=0.2\)\?"),
    "a typing error": (lambda: rm.spher, r"did you mean rm.sphere\?"),
    "capitals": (lambda: rm.Sphere, r"did you mean rm.sphere\?"),
    "a method": (lambda: rm.translate, r"did you mean node.translate\(...\)\?"),
    "a light": (lambda: rm.DirectionalLight, r"did you mean rm.Sun\(direction\)\?"),
    "nothing like it": (lambda: rm.qqqq, r"raymarch has no 'qqqq' \(help\(raymarch\) and docs/names.md list"),
    "an axis first": (lambda: rm.sphere().rotate("y", 1), r"rotate: angle = .y. \(an angle in radians, then an axis"),
    "of a node": (lambda: rm.sphere().move((1, 0, 0)), r"a node \(sphere\) has no 'move' \(did you mean .translate\("),
    "of a node, with its axis": (lambda: rm.sphere().rotate_x(1), r"did you mean .rotate\(angle, \"x\"\)\?"),
    "of a node, a colour": (lambda: rm.sphere().color, r"did you mean .material\(rm.Material\(color=...\)\)\?"),
    "of a scene": (lambda: rm.Scene(rm.sphere()).background, r"a Scene has no 'background' \(did you mean .sky\?"),
    "plus": (lambda: rm.sphere() + rm.box(1), r"sphere \+ box \(use a \| b for the union, node.translate"),
    "a sum": (lambda: sum([rm.sphere(), rm.box(1)]), r"0 \+ sphere \(use a \| b for the union"),
    "times": (lambda: rm.sphere() * 2, r"sphere \* 2 \(use node.scale\(factor\)"),
    "a material": (lambda: rm.sphere().material("red"), r"material = 'red' \(str\) \(rm.Material\(color=...\)\)"),
    "an axis to leave alone": (lambda: rm.box(0.5).repeat((0, 0, 2.4)), "None leaves an axis alone: repeat"),
    "a list in a union": (lambda: rm.union([rm.sphere(), rm.box(1)]), r"of a list, union\(\*nodes\)\)"),  # type: ignore[arg-type]
    "a pattern as a value": (
        lambda: rm.vec3("gold") * rm.noise(0, 1),
        r"the value of the function, such as pattern\(p\)",
    ),
    "the size of text": (lambda: rm.text("a", size=1), r"text has no parameter 'size' \(did you mean 'height'\?"),  # type: ignore[call-arg]
    "three numbers for a flat shape": (lambda: rm.circle().translate((1, 2, 3)), r"two coordinates: extrude it first"),
    "numbers beside colours": (lambda: rm.mix("red", "blue", np.ones(5)), r"beside colours or vectors, t\[:, None\]"),
    "a part of a name": (lambda: rm.cyl, r"did you mean rm.cylinder\?"),
    "a name with a suffix": (lambda: rm.render_png, r"did you mean rm.render\?"),
    "no name of Python's": (lambda: rm.loader, r"raymarch has no 'loader' \(help\(raymarch\)"),
    "a measure": (lambda: rm.box(1).volume, r"did you mean rm.triangulate\(node\).volume\?"),
    "not near": (lambda: rm.wheel, r"raymarch has no 'wheel' \(help\(raymarch\)"),
    "no attribute of nodes": (lambda: rm.bars, r"raymarch has no 'bars' \(did you mean rm.union\("),
    "a list of nodes": (lambda: rm.Scene([rm.sphere(), rm.box(1)]), r"\(rm.union\(\*nodes\)\)"),
}


@pytest.mark.parametrize("name", NAMES)
def test_a_name_of_other_tools_leads_to_the_name_here(name: str) -> None:
    call, words = NAMES[name]
    with pytest.raises(rm.SceneError, match=words) as fault:
        call()
    assert fault.value.where is not None
    assert (fault.value.where.file, fault.value.where.line) == (__file__, call.__code__.co_firstlineno)


def test_an_unknown_name_is_an_attribute_error() -> None:
    assert not hasattr(rm, "spher") and not hasattr(rm.sphere(), "move") and not hasattr(rm.Sun(), "colour")
    assert getattr(rm.sphere(), "_repr_svg_", None) is None and not hasattr(rm, "__wrapped__")


def test_what_the_tables_recommend_exists() -> None:
    known = {**peers.FUNCTIONS, **peers.WITHOUT, **peers.OPERATORS}
    for text in known.values():
        for name in re.findall(r"\brm\.(\w+)", text):
            assert hasattr(rm, name), text
        for name in re.findall(r"\bnode\.(\w+)", text):
            assert hasattr(rm.Node, name), text
    for text in peers.METHODS.values():
        name = text.split("(")[0]
        assert hasattr(rm.Node, name) or name.startswith("rm."), text
    assert not {name for name in rm.__all__ if name in peers.FUNCTIONS}
    assert not {name for name in vars(rm.Node) if name in peers.METHODS}


def test_degrees_are_suspected_but_not_refused() -> None:
    with pytest.warns(UserWarning, match=r"rotate: angle = 90 radians is 14.3 turns \(for degrees, math.radians"):
        turned = rm.sphere().rotate(90, "x")
    assert turned.params["angle"].data == 90.0
    rm.sphere().rotate(7.5)
    rm.sphere().rotate(4 * math.pi)
    rm.sphere().rotate(5)
    with pytest.warns(UserWarning) as caught:
        for angle in range(400):
            rm.sphere().rotate(angle)
    assert len(caught) == 1, "a line of a loop warns once"
