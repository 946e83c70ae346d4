"""Data with missing values, and figures with a colour bar, ticks and a scale bar."""

from __future__ import annotations

import pickle
from io import BytesIO
from typing import Any

import matplotlib
import numpy as np
import pytest
from PIL import Image

import raymarch as rm

AXIS = np.linspace(-1, 1, 9)
X, Y, Z = np.meshgrid(AXIS, AXIS, AXIS, indexing="ij")
BALL = rm.Scene(rm.sphere(0.5), rm.Camera((0, 0, 4), projection="orthographic"))


def test_a_colormap_shows_what_is_missing() -> None:
    found = rm.colormap(np.array([np.nan, 0.5, np.inf]), missing="red")
    assert np.array_equal(found[0], [1, 0, 0]) and np.array_equal(found[1:], rm.colormap(np.array([0.5, 1.0])))
    assert np.array_equal(rm.colormap(np.ma.masked_array([0.1, 0.2], [True, False]))[0], [0.5, 0.5, 0.5])


@pytest.mark.parametrize("name", ["magma", "RdBu_r"])
def test_maps_of_matplotlib_by_name(name: str) -> None:
    share = np.linspace(0, 1, 30)
    linear = rm.colormap(share, name)
    shown = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.abs(shown - matplotlib.colormaps[name](share)[:, :3]).max() < 3 / 255
    with pytest.raises(rm.SceneError, match=r"colors = 'magna' .*a map of matplotlib"):
        rm.colormap(0.5, "magna")


def test_sampled_tells_where_a_value_is_missing() -> None:
    values = np.where(X > 0.3, np.nan, 2.0 + Y)
    some = rm.sampled(values)
    at = np.array([(-0.5, 0.25, 0), (0.2, -0.5, 0.1), (0.9, 0, 0)])
    assert np.allclose(some(at)[:2], 2 + at[:2, 1]) and some(at)[2] == 3e38, "next to the border by known values alone"
    masked = rm.sampled(np.ma.masked_array(2.0 + Y, X > 0.3))
    assert np.array_equal(masked(at), some(at))
    ball = rm.sphere(0.9).material(rm.Material.unlit(lambda p: rm.colormap(some(p), low=1, high=3, missing="red")))
    scene = rm.Scene(ball, rm.Camera((0, 0, 3)), sky="blue")
    truth = rm.truth(scene, (24, 16)).color
    with rm.Renderer((24, 16)) as renderer:
        color = renderer.render(scene).color
    red = np.all(np.isclose(color, [1, 0, 0], atol=1e-5), axis=-1)
    assert 10 < red.sum() < 80 and np.allclose(color, truth, atol=1e-3)


def test_nothing_is_solid_where_a_value_is_missing() -> None:
    density = 1.0 - np.sqrt(X**2 + Y**2 + Z**2)
    part = rm.isosurface(np.where(X > 0.1, np.nan, density), 0.5)
    whole = rm.isosurface(density, 0.5)
    points = np.array([(-0.3, 0, 0), (0.3, 0, 0)])
    assert np.all(whole.distance(points) < 0) and list(part.distance(points) < 0) == [True, False]
    for broken in (np.full((4, 4, 4), np.nan), np.where(X > 0, np.inf, X)):
        with pytest.raises(rm.SceneError, match="not finite"):
            rm.isosurface(broken, 0.5)


def test_an_unlit_material_has_its_own_colours() -> None:
    scene = BALL.replace(node=BALL.node.material(rm.Material.unlit((0.25, 0.5, 0.75))), lights=[rm.Sun()], sky="white")
    with rm.Renderer((16, 12)) as renderer:
        color = renderer.render(scene).color
    assert np.allclose(color[6, 8], (0.25, 0.5, 0.75), atol=1e-6)


def test_a_figure_has_ticks_and_bars_of_the_right_length() -> None:
    scene = rm.Scene(rm.sphere(0.5), rm.Camera((3, 2, 4), (0, 0, 0), projection="orthographic", height=2))
    figure = rm.figure(
        scene, (80, 60), colors="magma", low=300, high=260, label="K", box=True, unit="mm", scale_bar=0.5, samples=1
    )
    shown, bar = figure.axes
    texts = {text.get_text() for text in shown.texts}
    assert {"x (mm)", "y (mm)", "z (mm)", "0.5 mm", "0"} <= texts and bar.get_ylabel() == "K"
    (length,) = [np.ptp(line.get_xdata()) for line in shown.lines if line.get_linewidth() == 2.5]
    assert length == pytest.approx(0.5 / (2 / 60))
    hidden = sum(np.isnan(line.get_xdata()).sum() for line in shown.lines)
    assert hidden > 10, "the ball hides parts of the edges behind it"
    figure.canvas.draw()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"box": 3}, "box = 3"),
        ({"box": ((1, 1, 1), (0, 0, 0))}, "first below the second"),
        ({"scale_bar": 1e6}, "the picture shows"),
        ({"scale_bar": "x"}, "scale_bar"),
        ({"colors": "viridis", "low": 1, "high": 1}, "two different numbers"),
    ],
)
def test_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(rm.SceneError, match=message):
        rm.figure(BALL, (16, 12), samples=1, **given)
    with pytest.raises(rm.SceneError, match="without end"):
        rm.figure(rm.plane(), (16, 12), box=True)


def test_a_figure_is_a_picture_in_a_notebook() -> None:
    figure = rm.figure(BALL, size=(64, 48), samples=1)
    shown = pickle.loads(pickle.dumps(figure))._repr_png_()
    assert Image.open(BytesIO(shown)).size == (64, 48) and np.asarray(Image.open(BytesIO(shown))).std() > 10
