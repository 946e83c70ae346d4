"""Arrays as values of materials: numbers in space, and the colours of numbers."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.context import Context

AXES = [np.linspace(c - 0.5 * s, c + 0.5 * s, n) for c, s, n in zip((1, 0, -2), (2, 3, 4), (5, 7, 9), strict=True)]
X, Y, Z = np.meshgrid(*AXES, indexing="ij")
BOX = {"size": (2, 3, 4), "center": (1, 0, -2)}


def test_a_trilinear_function_is_itself_between_its_samples() -> None:
    field = rm.sampled(2 * X - Y + 3 * Z + X * Y * Z, **BOX)
    low, high = (np.array([axis[end] for axis in AXES]) for end in (0, -1))
    points = np.random.default_rng(1).uniform(low, high, (200, 3))
    x, y, z = points.T
    np.testing.assert_allclose(field(points), 2 * x - y + 3 * z + x * y * z, atol=1e-5)  # the samples are float32
    beyond = points + np.array([5, 0, 0])
    np.testing.assert_allclose(field(beyond), field(np.clip(beyond, low, high)), atol=1e-9)
    assert isinstance(field((1, 0, -2)), float)


def test_a_surface_is_coloured_by_data_in_its_own_space(egl: Context) -> None:
    ramp = rm.sampled(X[:, :, :], **BOX)
    wall = rm.box((2, 3, 0.5)).translate((1, 0, -2))
    plain = rm.Material(color=lambda p: rm.colormap(ramp(p), ["black", "white"], 0, 2), ambient=1, specular=0)
    camera = rm.Camera((0, 0, 5), target=(0, 0, 0), projection="orthographic", height=2)
    scene = rm.Scene(wall.material(plain).translate((-1, 0, 2)), camera, lights=[rm.Sun((1, 0, 0))], sky="black")
    with rm.Renderer((16, 16), context=egl) as renderer:
        color = renderer.render(scene).color
    row = (np.arange(16) + 0.5) / 16  # from x = -1 to 1, where the wall had 0 to 2
    np.testing.assert_allclose(color[8], np.repeat(row[:, None], 3, 1), atol=2e-6)
    np.testing.assert_allclose(color, rm.truth(scene, (16, 16)).color, atol=2e-6)


@pytest.mark.parametrize("name", ["viridis", "inferno", "coolwarm"])
def test_maps_are_those_of_matplotlib_in_linear_light(name: str) -> None:
    t = np.linspace(-3, 5, 64)
    encoded = matplotlib.colormaps[name]((t + 3) / 8)[:, :3]
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    assert np.abs(rm.colormap(t, name, -3, 5) - linear).max() < 0.012
    assert np.array_equal(rm.colormap([-9, 9], name, -3, 5), rm.colormap([-3, 5], name, -3, 5))
    assert np.all(np.isfinite(rm.colormap(np.nan, name)))


def test_a_list_of_colours_and_all_shapes() -> None:
    assert rm.colormap(0.25, ["black", (1, 0, 0), "#fff"]).tolist() == [0.5, 0, 0]
    assert rm.colormap(np.zeros((2, 4)), np.eye(3)).shape == (2, 4, 3)
    falling = rm.colormap([0.0, 1.0], ["black", "white"], 1, 0)
    assert falling[:, 0].tolist() == [1, 0]
    moving = rm.colormap(rm.time, ["black", "white"], 0, rm.Param("end", 2.0, 1.0, 3.0))
    scene = rm.Scene(rm.sphere().material(rm.Material(emission=moving)), lights=[])
    assert scene.parameters
    dots = rm.instances(rm.sphere(0.1), np.eye(3), rm.colormap([0.0, 0.5, 1.0]))
    assert dots.facts.bounded


WRONG: dict[str, tuple[Any, str]] = {
    "two axes": (lambda: rm.sampled(np.ones((3, 3))), r"sampled: values of shape \(3, 3\) \(\(nx, ny, nz\)\)"),
    "not finite": (lambda: rm.sampled(np.full((2, 2, 2), np.nan)), "8 of 8 values are not finite"),
    "no size": (lambda: rm.sampled(X, size=0), "sampled: size = 0 "),
    "at a flat point": (lambda: rm.sampled(X)((1, 2)), r"sampled at a vec2 \(points"),
    "no map": (
        lambda: rm.colormap(0.5, "rainbows"),
        r"colors = 'rainbows' \('viridis', 'inferno', 'coolwarm', a map of matplotlib",
    ),
    "one colour": (lambda: rm.colormap(0.5, ["red"]), "two or more colours"),
    "no range": (lambda: rm.colormap(0.5, low=1), "low = high = 1 "),
    "text": (lambda: rm.colormap("a"), "colormap: value = 'a'"),
}


@pytest.mark.parametrize("name", WRONG)
def test_refused(name: str) -> None:
    call, message = WRONG[name]
    with pytest.raises(rm.SceneError, match=message) as caught:
        call()
    assert caught.value.where is not None and caught.value.where.file == __file__
