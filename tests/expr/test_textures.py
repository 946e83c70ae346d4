"""Pictures: their pyramids, and their means over footprints."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from raymarch.errors import SceneError
from raymarch.expr.arrays import evaluator
from raymarch.expr.intervals import interval_of
from raymarch.expr.node import const, var
from raymarch.expr.texels import Texels, Wrap
from raymarch.expr.textures import LEAST, texture
from raymarch.expr.types import FLOAT, VEC2

AT, ACROSS, ALONG, WEIGHT = (*(var(name, VEC2) for name in ("at", "across", "along")), var("weight", FLOAT))
HALF = 2.0**-11
"""Rounding of a half float, relative."""


def read(data: Texels, at: Any, across: Any = (0, 0), along: Any = (0, 0), weight: Any = 1.0) -> np.ndarray:
    at = np.asarray(at, np.float64).reshape(-1, 2)
    spread = [np.broadcast_to(np.asarray(v, np.float64), at.shape) for v in (across, along)]
    node = texture(data, AT, ACROSS, ALONG, WEIGHT)
    return evaluator([node], [AT, ACROSS, ALONG, WEIGHT])(at, *spread, np.broadcast_to(weight, len(at)))[0]


def noise(h: int, w: int, channels: int = 1) -> np.ndarray:
    return np.random.default_rng(h * w).uniform(0.2, 1.0, (h, w, channels))


@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (16, 4), (5, 7), (1, 9), (33, 64)])
def test_every_level_has_the_mean_of_the_whole(shape: tuple[int, int]) -> None:
    values = noise(*shape, 3)
    data = Texels(values)
    sizes = [level.shape[:2] for level in data.levels]
    assert sizes[0] == shape and sizes[-1] == (1, 1)
    assert all(b == tuple(max(n // 2, 1) for n in a) for a, b in pairwise(sizes))
    for level in data.levels:
        np.testing.assert_allclose(level.astype(float).mean((0, 1)), values.mean((0, 1)), rtol=HALF)


def test_a_texel_of_a_level_is_the_mean_of_what_it_covers() -> None:
    values = noise(6, 10)
    three = Texels(values).levels[1]
    np.testing.assert_allclose(three[..., 0], values.reshape(3, 2, 5, 2).mean((1, 3)), rtol=HALF)
    odd = np.arange(5.0).reshape(1, 5)  # two stretches of two and a half
    np.testing.assert_allclose(
        Texels(odd).levels[1][0, :, 0], [(0 + 1 + 0.5 * 2) / 2.5, (0.5 * 2 + 3 + 4) / 2.5], rtol=HALF
    )


@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp"])
def test_a_point_is_interpolated_between_four_texels(wrap: Wrap) -> None:
    values = noise(4, 8)
    data = Texels(values, wrap)
    stored = data.levels[0][..., 0].astype(float)
    middles = np.stack(np.meshgrid((np.arange(8) + 0.5) / 8, (np.arange(4) + 0.5) / 4), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(read(data, middles), stored.ravel(), rtol=1e-12)
    np.testing.assert_allclose(read(data, [2 / 8, 1 / 4]), stored[:2, 1:3].mean(), rtol=1e-12)
    beside = {"repeat": stored[1, -1], "mirror": stored[1, 0], "clamp": stored[1, 0]}[wrap]
    np.testing.assert_allclose(read(data, [0.0, 1.5 / 4]), (stored[1, 0] + beside) / 2, rtol=1e-12)
    far = {"repeat": stored[1, 2], "mirror": stored[1, 5], "clamp": stored[1, 7]}[wrap]
    np.testing.assert_allclose(read(data, [1 + 2.5 / 8, 1.5 / 4]), far, rtol=1e-12)


def test_the_mean_over_an_ellipse_is_that_of_points_in_it() -> None:
    """A smooth picture, long ellipses that lie across it: only the ends of the ellipse are told apart otherwise."""
    y, x = (np.mgrid[0:256, 0:256] + 0.5) / 256
    data = Texels(0.5 + 0.25 * np.sin(2 * np.pi * 3 * x) + 0.2 * np.cos(2 * np.pi * 2 * y))
    rng = np.random.default_rng(2)
    at, turn = rng.uniform(0, 1, (50, 2)), rng.uniform(0, 6, 50)
    direction = np.stack([np.cos(turn), np.sin(turn)], 1)
    along, across = 0.15 * direction, 0.02 * np.stack([-np.sin(turn), np.cos(turn)], 1)
    step = (np.arange(400) + 0.5) / 400 - 0.5
    line = (at[:, None] + step[None, :, None] * along[:, None]).reshape(-1, 2)
    wanted = read(data, line).reshape(50, 400).mean(1)
    # Second derivatives times the second moments of a sample's own footprint, two texels of twice its width across
    # each way: (2 pi 3)^2 0.25 + (2 pi 2)^2 0.2 = 120 times (2 x 0.02)^2 / 6, halved.
    np.testing.assert_allclose(read(data, at, across, along), wanted, atol=0.5 * 120 * (2 * 0.02) ** 2 / 6)
    crooked = read(data, at, across + 3 * along, along - across)  # other conjugate axes of a larger ellipse
    assert np.abs(crooked - read(data, at, across, along)).max() > 0.01
    c, s = np.cos(0.7), np.sin(0.7)
    same = read(data, at, c * across + s * along, c * along - s * across)  # other conjugate axes of the same one
    np.testing.assert_allclose(same, read(data, at, across, along), atol=1e-9)


def test_what_is_wider_than_the_picture_is_its_mean() -> None:
    values = noise(32, 32, 3)
    for across, along in (((1.0, 0), (0, 1.0)), ((1.5, 1.0), (-40.0, 90.0)), ((0.05, 0.0), (0.0, 20.0))):
        found = read(Texels(values), np.random.default_rng(1).uniform(-9, 9, (20, 2)), across, along)
        np.testing.assert_allclose(found, np.broadcast_to(values.mean((0, 1)), (20, 3)), rtol=2 * HALF)


def test_a_weight_scales_and_a_tiny_one_reads_nothing() -> None:
    data = Texels(np.full((4, 4), 0.5))
    weights = np.array([1.0, 0.25, 1.01 * LEAST, 0.99 * LEAST, 0.0])
    np.testing.assert_allclose(read(data, np.zeros((5, 2)), weight=weights), [0.5, 0.125, 0.505 * LEAST, 0, 0])


def test_equal_pictures_are_one() -> None:
    values = noise(8, 8)
    assert Texels(values) == Texels(values.copy(), label="other") and len({Texels(values), Texels(values)}) == 1
    assert Texels(values) != Texels(values, "clamp") and Texels(values) != Texels(values[::-1])
    at = const((0.5, 0.5))
    assert texture(Texels(values), AT, at, at) is texture(Texels(values.copy()), AT, at, at)
    assert interval_of(texture(Texels(values), at, at, at))[1] <= 1.0


@pytest.mark.parametrize(
    "values", [np.zeros((4, 4, 4)), np.zeros(3), np.zeros((0, 3)), np.full((2, 2), np.nan), [[7e4]]]
)
def test_what_is_no_picture_is_refused(values: Any) -> None:
    with pytest.raises(SceneError):
        Texels(values)
