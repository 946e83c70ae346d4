"""Colours for numbers, and the bar that says what they stand for."""

from __future__ import annotations

import matplotlib
import numpy as np
import pytest
from PIL import Image

from raymarch.expr.color_maps import MAPS
from raymarch.gpu.scale import INK, MARGIN, PAPER, Scale, colored, nice, with_bar


@pytest.mark.parametrize("name", MAPS)
def test_colours_are_those_of_matplotlib(name: str) -> None:
    theirs = matplotlib.colormaps[name](np.arange(256))[:, :3]
    assert np.abs(colored(np.arange(256) / 255, name) - theirs).max() <= 2 / 255
    assert colored(np.array([[-1.0, 2.0]]), name).tolist() == [colored(np.array([0.0, 1.0]), name).tolist()]


def test_shares() -> None:
    assert Scale("", 1.0, 5.0).normalized([0, 1, 2, 5, 9]).tolist() == [0, 0, 0.25, 1, 1]
    assert np.allclose(Scale("", 1e-4, 1.0, "log").normalized([0, 1e-4, 1e-3, 1, np.inf]), [0, 0, 0.25, 1, 1])
    assert Scale("", 2.0, np.inf, "reciprocal").normalized([1, 2, 4, 8, np.inf]).tolist() == [0, 0, 0.5, 0.75, 1]
    assert Scale("", 2.0, 8.0, "reciprocal").normalized([2, 8 / 2.5, 8]).tolist() == pytest.approx([0, 0.5, 1])


def test_nearest_is_brightest_on_a_reciprocal_scale() -> None:
    near, far = Scale("", 1.0, np.inf, "reciprocal", "viridis").colored([1.0, 100.0])
    assert near.sum() > 1.5 and far.sum() < 1.0


@pytest.mark.parametrize(("least", "expected"), [(1, 1), (1.1, 2), (3, 5), (6, 10), (0.021, 0.05), (7e-5, 1e-4)])
def test_nice_numbers(least: float, expected: float) -> None:
    assert nice(least) == pytest.approx(expected, rel=1e-12)


def test_ticks() -> None:
    assert Scale("", 0.0, 83.0).ticks == [0, 20, 40, 60, 80]
    assert Scale("", -1.0, 1.0).ticks == [-1, -0.5, 0, 0.5, 1]
    assert Scale("", 1e-3, 5.0, "log").ticks == pytest.approx([1e-3, 1e-2, 0.1, 1])
    assert Scale("", 3.0, np.inf, "reciprocal").ticks == [3, 6, 12, np.inf]


@pytest.mark.parametrize("width", [8, 60, 320])
@pytest.mark.parametrize("scale", [Scale("evaluations a pixel", 0.0, 83.0), Scale("d", 3.0, np.inf, "reciprocal")])
def test_a_bar_stands_below_the_picture(width: int, scale: Scale) -> None:
    picture = Image.fromarray(np.random.default_rng(0).integers(0, 255, (20, width, 3), np.uint8))
    made = with_bar(picture, scale)
    assert made.width == width and 20 + 30 <= made.height <= 20 + 120
    assert np.array_equal(np.asarray(made)[:20], np.asarray(picture))
    bar = np.asarray(made)[20:]
    assert np.all(bar[0] == PAPER) and np.all(bar[-1] == PAPER)


def test_a_bar_runs_from_its_low_end_to_its_high_end() -> None:
    scale = Scale("a", 0.0, 10.0)
    bar = np.asarray(with_bar(Image.new("RGB", (212, 4)), scale))[4:]
    rows = np.flatnonzero(np.all(bar[:, 211 - MARGIN] == np.rint(255 * scale.colored(10.0)), axis=-1))
    strip = bar[rows[0], MARGIN : 212 - MARGIN]
    wanted = 255 * scale.colored(np.linspace(0, 10, 200))
    assert len(rows) == 10 and np.abs(strip - wanted).max() <= 1
    marks = np.flatnonzero(np.all(bar[rows[-1] + 1] == INK, axis=-1))
    assert np.abs(marks - (MARGIN + 199 * np.arange(0, 11, 2) / 10)).max() <= 1
