"""Texels of a table, by their index: in NumPy, on the GPU, and as intervals."""

from __future__ import annotations

import numpy as np
import pytest

from raymarch.errors import SceneError
from raymarch.expr.arrays import evaluator
from raymarch.expr.function import Function
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import const, make, var
from raymarch.expr.tables import MOST, WIDTH, Table, fetch
from raymarch.expr.types import FLOAT, VEC3
from raymarch.gpu.context import Context
from tests.support.glsl_harness import evaluate

INDEX = var("i", FLOAT)
COUNT = WIDTH + 904  # the second line of the texture is not full


def table(channels: int) -> Table:
    return Table(np.random.default_rng(channels).normal(size=(COUNT, channels)), f"{channels} channels")


@pytest.mark.parametrize("channels", [1, 2, 4])
def test_a_texel_is_that_of_its_index(egl: Context, channels: int) -> None:
    data = table(channels)
    index = np.array([0.0, 1.0, 7.9, WIDTH - 1, WIDTH, COUNT - 1])
    wanted = data.values[index.astype(int)]
    wanted = wanted[:, 0] if channels == 1 else wanted
    function = Function("read", (INDEX,), fetch(data, INDEX))
    np.testing.assert_array_equal(evaluator([function.body], [INDEX])(index)[0], wanted)
    np.testing.assert_array_equal(evaluate(egl, function, [index]), wanted)


def test_its_interval_holds_the_texels_of_the_index() -> None:
    data = table(4)
    for index, rows in ((const(3.0), data.values[3:4]), (make("time", FLOAT), data.values)):
        low, high = interval_of(fetch(data, index))
        np.testing.assert_array_equal(low, rows.min(axis=0))
        np.testing.assert_array_equal(high, rows.max(axis=0))


def test_equal_content_is_an_equal_table() -> None:
    assert table(2) == table(2) and hash(table(2)) == hash(table(2)) and table(2).name == table(2).name
    assert table(2) != table(4) and len(table(2).texture()[2]) == table(2).nbytes == 8 * 2 * WIDTH


@pytest.mark.parametrize("values", [np.zeros((0, 4)), np.zeros((5, 3)), np.zeros(5)])
def test_other_shapes_are_refused(values: object) -> None:
    with pytest.raises(SceneError, match=f"1 to {MOST:,}, 1, 2 or 4"):
        Table(values, "wrong")  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="fetch at a vec3"):
        fetch(table(1), var("p", VEC3))
