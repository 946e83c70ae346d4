"""What the pictures of `--view` show, value by value."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.frame import Frame
from raymarch.gpu.scale import colored
from raymarch.gpu.views import VIEWS, picture, scale_of
from raymarch.plan import OUTPUTS
from raymarch.plan.passes import TALLIES

SCENE = rm.Scene(rm.sphere())
WHOLE = ("iterations", "evaluations", "fallbacks", "material")


def frame_of(view: str, values: Any) -> Frame:
    array = np.asarray(values, np.int32 if view in WHOLE else np.float32)

    def never(name: str) -> Any:
        raise AssertionError(f"{name} was rendered for the view {view}")

    return Frame((array.shape[1], array.shape[0]), 0.0, [], {VIEWS[view][0]: array}, never)


def shown(view: str, values: Any) -> Any:
    frame = frame_of(view, values)
    image = picture(frame, view, SCENE)
    assert image.size == frame.size
    return np.asarray(image)


def colors(shares: Any, name: str = "inferno") -> list[Any]:
    return np.rint(255 * colored(np.asarray(shares), name)).astype(int).tolist()


def test_every_array_has_a_view() -> None:
    assert {name for needed in VIEWS.values() for name in needed} == {*OUTPUTS, *TALLIES} - {"done", "reach"}


def test_the_picture_itself() -> None:
    assert shown("final", [[(0, 1, 0.2)]]).tolist() == [[[0, 255, 124]]]
    assert scale_of(frame_of("final", [[(0, 1, 0.2)]]), "final") is None


def test_near_is_bright_and_nothing_is_black() -> None:
    found = shown("depth", [[2.0, 4.0, 8.0, np.inf]])
    assert found.tolist() == [[*colors([1, 0.5, 0.25], "viridis"), [0, 0, 0]]]
    assert found.sum(axis=-1).tolist()[0] == sorted(found.sum(axis=-1).tolist()[0], reverse=True)
    assert shown("depth", [[np.inf, np.inf]]).tolist() == [[[0, 0, 0]] * 2]
    scale = scale_of(frame_of("depth", [[2.0, 4.0, np.inf]]), "depth")
    assert scale is not None and (scale.low, scale.high, scale.kind) == (2.0, np.inf, "reciprocal")


def test_positions_are_colours_between_those_of_the_picture() -> None:
    found = shown("position", [[(1, 5, -2), (3, 5, 2), (2, 5, 1), (np.nan, np.nan, np.nan)]])
    assert found.tolist() == [[[0, 0, 0], [255, 0, 255], [128, 0, 191], [0, 0, 0]]]
    assert not shown("position", [[(np.nan, np.nan, np.nan)]]).any()


@pytest.mark.parametrize("view", ["normal", "shading_normal"])
def test_normals_are_colours_from_minus_one_to_one(view: str) -> None:
    normals = [[(1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, 0)]]
    assert shown(view, normals).tolist() == [[[255, 128, 128], [128, 0, 128], [128, 128, 255], [0, 0, 0]]]


@pytest.mark.parametrize("view", ["iterations", "evaluations", "fallbacks"])
def test_counts_go_from_zero_to_the_99th_percentile(view: str) -> None:
    values = np.repeat([[0, 5, 10]], 400, axis=0)
    values[0, 0] = 90
    found = shown(view, values)
    assert found[1:].tolist() == [colors([0, 0.5, 1])] * 399 and found[0].tolist() == colors([1, 0.5, 1])
    scale = scale_of(frame_of(view, values), view)
    assert scale is not None and (scale.low, scale.high) == (0.0, 10.0) and scale.quantity.endswith(", at most 90")
    assert shown(view, [[0, 0]]).tolist() == [colors([0, 0])]


def test_rare_counts_are_scaled_to_the_largest() -> None:
    values = np.zeros((20, 20))
    values[3, 4] = 7
    scale = scale_of(frame_of("fallbacks", values), "fallbacks")
    assert scale is not None and scale.high == 7.0 and scale.quantity == "undone steps per ray"


def test_residuals_are_logarithmic() -> None:
    # From 1e-9 to the largest, 1e-3: a factor of ten is a sixth of the way.
    found = shown("residual", [[0.0, 1e-9, 1e-6, 1e-4, -1e-3]]).astype(int)
    assert np.abs(found - [colors([0, 0, 0.5, 5 / 6, 1])]).max() <= 1


def test_one_interrupted_pixel_does_not_darken_the_cycles() -> None:
    values = np.full((20, 20), 100.0)
    values[:10], values[3, 4] = 50.0, 1e9
    found = shown("cycles", values)
    assert found[15, 0].tolist() == found[3, 4].tolist() == colors(1.0)
    assert np.abs(found[0, 0].astype(int) - colors(0.5)).max() <= 1


def test_materials_have_colours_of_their_own() -> None:
    values = shown("material", [[-1, 0, 1, 2, 3, 4, 5, 6, 7]])[0]
    assert values[0].tolist() == [0, 0, 0]
    assert len({tuple(v) for v in values.tolist()}) == 9
    for a, b in zip(values[1:].astype(int), values[2:].astype(int), strict=False):
        assert np.abs(a - b).max() > 60, "neighbouring numbers are hard to tell apart"
