"""What the pictures of `--view` show, value by value."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.frame import Frame
from raymarch.gpu.views import VIEWS, picture
from raymarch.plan import OUTPUTS

SCENE = rm.Scene(rm.sphere())


def shown(view: str, values: Any) -> Any:
    array = np.asarray(values, np.float32 if view in ("final", "depth", "normal", "residual") else np.int32)

    def never(name: str) -> Any:
        raise AssertionError(f"{name} was rendered for the view {view}")

    frame = Frame((array.shape[1], array.shape[0]), 0.0, [], {VIEWS[view][0]: array}, never)
    image = picture(frame, view, SCENE)
    assert image.size == frame.size
    return np.asarray(image)


def test_every_array_has_a_view() -> None:
    assert {name for needed in VIEWS.values() for name in needed} == set(OUTPUTS)


def test_the_picture_itself() -> None:
    assert shown("final", [[(0, 1, 0.2)]]).tolist() == [[[0, 255, 124]]]


def test_near_is_bright_and_nothing_is_black() -> None:
    assert shown("depth", [[2.0, 4.0, 8.0, np.inf]]).tolist() == [[255, 128, 64, 0]]
    assert shown("depth", [[np.inf, np.inf]]).tolist() == [[0, 0]]
    assert shown("depth", [[0.0, 1.0]]).tolist() == [[255, 0]]


def test_normals_are_colours_from_minus_one_to_one() -> None:
    normals = [[(1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, 0)]]
    assert shown("normal", normals).tolist() == [[[255, 128, 128], [128, 0, 128], [128, 128, 255], [0, 0, 0]]]


@pytest.mark.parametrize("view", ["iterations", "evaluations"])
def test_counts_reach_white_at_the_largest(view: str) -> None:
    assert shown(view, [[0, 5, 10]]).tolist() == [[0, 128, 255]]
    assert shown(view, [[0, 0]]).tolist() == [[0, 0]]


def test_residuals_are_logarithmic() -> None:
    # From 1e-9, black, to the largest, 1e-3, white: a factor of ten is a sixth of the way.
    found = shown("residual", [[0.0, 1e-9, 1e-6, 1e-4, -1e-3]]).astype(int)
    assert np.abs(found - [[0, 0, 127.5, 212.5, 255]]).max() <= 0.5


def test_materials_have_colours_of_their_own() -> None:
    values = shown("material", [[-1, 0, 1, 2, 3, 4, 5, 6, 7]])[0]
    assert values[0].tolist() == [0, 0, 0]
    assert len({tuple(v) for v in values.tolist()}) == 9
    for a, b in zip(values[1:].astype(int), values[2:].astype(int), strict=False):
        assert np.abs(a - b).max() > 60, "neighbouring numbers are hard to tell apart"
