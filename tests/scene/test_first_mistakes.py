"""What a first scene often gets wrong, and the one line that it is told."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.errors import SceneError, UnknownNameError
from raymarch.gpu import vouch
from raymarch.plan.unused import unused

BALL, FLOOR = rm.sphere(), rm.plane(offset=-1)
COUNT = rm.Param("mistaken count", 3, 1, 5)
MASKED = np.ma.array(np.zeros((2, 3)), mask=[[0, 0, 0], [1, 1, 1]])
GLASS = rm.Material(transmission=1)


class Tensor:
    """An array of another library."""

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray[Any, Any]:
        return np.array([1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    "wrong, words",
    [
        (lambda: range(COUNT), "counts nothing"),
        (lambda: f"{COUNT:.2f}", "no digits to format"),
        (lambda: BALL.distance(MASKED), "3 masked values"),
        (lambda: rm.box(MASKED[1]), "box: size"),
        (lambda: BALL.hull, "hull\\(points\\)"),
    ],
)
def test_it_is_refused_with_the_cure(wrong: Callable[[], Any], words: str) -> None:
    with pytest.raises((SceneError, UnknownNameError), match=words):
        wrong()


def test_noise_of_numbers_and_arrays() -> None:
    points = np.random.default_rng(0).uniform(-9, 9, (5, 2))
    found = rm.value_noise(points)
    one = [float(rm.value_noise(tuple(point))) for point in points]
    assert np.shape(found) == (5,) and np.ptp(one) > 0.1 and np.array_equal(found, one)


def test_an_array_of_another_library_is_an_array() -> None:
    given: Any = Tensor()
    assert rm.box(given) == rm.box((1, 2, 3)) and BALL.translate(given) == BALL.translate((1, 2, 3))
    assert BALL.distance(given) == BALL.distance((1, 2, 3))


@pytest.mark.parametrize(
    "scene, words",
    [
        (rm.Scene(BALL.material(GLASS)), "a sky of one colour"),
        (rm.Scene(BALL | FLOOR, lights=[rm.Sun((0.2, -1, 0))]), "from below the floor"),
    ],
)
def test_what_looks_flat_is_said(scene: rm.Scene, words: str) -> None:
    assert any(words in doubt for doubt in unused(scene))
    cured = scene.replace(lights=[rm.Sun()], sky=rm.GradientSky())
    assert not any(words in doubt for doubt in unused(cured))


def test_a_black_picture_is_said() -> None:
    black = np.zeros((4, 4, 3))
    assert "no light (lights=[Sun()]" in str(vouch.dark(black, rm.Scene(BALL, lights=[])))
    assert "too weak" in str(vouch.dark(black, rm.Scene(BALL)))
    black[:2] = 0.5
    assert vouch.dark(black, rm.Scene(BALL, sky=(0, 0, 0))) is None


def test_an_emission_of_255_is_said() -> None:
    with pytest.warns(rm.SceneWarning, match="divide it by 255"):
        rm.Material(emission=(255, 0, 0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rm.Material(emission=(60, 40, 0))
