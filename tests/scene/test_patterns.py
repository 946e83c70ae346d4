"""Colours by name, and patterns: their values, their filters over the pixel footprint, and the range of noise."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch.expr.arrays import evaluator
from raymarch.expr.node import Expr
from raymarch.gpu.context import Context
from raymarch.sdf.interaction import DPDX, DPDY, POSITION

# Colours


def linear(value: float) -> float:
    """The linear value of an sRGB-encoded one, after IEC 61966-2-1."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


ORANGE = (1.0, linear(0x88 / 255), 0.0)

TAKES: dict[str, Callable[[Any], Any]] = {
    "material": lambda color: rm.Material(color=color).color,
    "albedo": lambda color: rm.Material(albedo=color).albedo,
    "emission": lambda color: rm.Material(emission=color).emission,
    "f0": lambda color: rm.Material(f0=color).f0,
    "sun": lambda color: rm.Sun(color=color).color,
    "point light": lambda color: rm.PointLight((0, 1, 0), color=color).color,
    "sky": lambda color: rm.Sky(color).color,
    "sky of a scene": lambda color: rm.Scene(rm.sphere(), sky=color).sky.color,
    "gradient": lambda color: rm.GradientSky(color, color, color).radiance_along(np.array([[0, 1.0, 0]]), NO)[0],
    "ground": lambda color: rm.SunSky(ground=color).ground,
    "fog": lambda color: rm.Fog(color).color,
}
NO = rm.scene.parameter.Values({})


@pytest.mark.parametrize("name", TAKES)
def test_a_colour_may_be_a_string_everywhere(name: str) -> None:
    for color in ("#ff8800", "#F80", " rgb(255, 136, 0)"):
        made = TAKES[name](color)
        np.testing.assert_allclose(getattr(made, "data", made), ORANGE, atol=1e-12)
    assert np.all(np.asarray(getattr(TAKES[name]("white"), "data", 1.0)) == 1.0)
    with pytest.raises(rm.SceneError, match=r"= 'ornage' \(did you mean 'orange'\? linear RGB such as .*#ff8800"):
        TAKES[name]("ornage")


ORANGE_AND_BLACK: dict[str, Callable[[Any, Any], Any]] = {
    "mix of numbers": lambda a, b: rm.mix(a, b, 0.0),
    "mix of an array": lambda a, b: rm.mix(b, a, np.ones((4, 1)))[2],
    "mix of an expression": lambda a, b: rm.mix(a, b, 0 * rm.time),
    "where": lambda a, b: rm.where(rm.time > -1, a, b),
    "where of a condition that is known": lambda a, b: rm.where(False, b, a),
    "where of an array": lambda a, b: rm.where(np.ones((4, 1), bool), a, b)[3],
    "vec3": lambda a, b: rm.vec3(a) + b,
    "a function of the point": lambda a, b: rm.Material(color=lambda p: a).color,
    "a pattern": lambda a, b: rm.Material(color=lambda p: rm.where(p.x < 1e9, a, b)).color,
    "a sky": lambda a, b: rm.Sky(lambda d: a).color,
}


@pytest.mark.parametrize("name", ORANGE_AND_BLACK)
def test_a_string_in_an_expression_is_the_colour_in_linear_rgb(name: str) -> None:
    made = ORANGE_AND_BLACK[name]("#ff8800", "black")
    if isinstance(made, Expr):
        made = evaluator([made], [POSITION, rm.time])(np.zeros((1, 3)), 0.0)[0]
    np.testing.assert_allclose(np.ravel(made), ORANGE, atol=1e-12)
    with pytest.raises(rm.SceneError, match="did you mean 'orange'"):
        ORANGE_AND_BLACK[name]("ornage", "black")


def test_a_string_is_no_vector_and_no_number() -> None:
    for make in (
        lambda: rm.Material(absorption="red"),
        lambda: rm.sphere("red"),
        lambda: rm.sphere().translate("red"),
        lambda: rm.Camera(position="red"),  # type: ignore[arg-type]
        lambda: rm.Material(roughness=lambda p: "red"),
        lambda: rm.sphere().displace_by(lambda p: "red"),
    ):
        with pytest.raises(rm.SceneError, match="= 'red' "):
            make()


def test_names_are_those_of_css() -> None:
    np.testing.assert_allclose(rm.Material(color="rebeccapurple").color.data, [linear(v / 255) for v in (102, 51, 153)])
    with pytest.raises(rm.SceneError, match=r"#ff880080. has an opacity"):
        rm.Material(color="#ff880080")
    with pytest.raises(rm.SceneError, match=r"wood\.png. has no projection"):
        rm.Material(color="wood.png")


# Patterns


def values(pattern: Any, p: np.ndarray, dpdx: Any = (0, 0, 0), dpdy: Any = (0, 0, 0)) -> np.ndarray:
    """A pattern of numbers at points (N, 3) under one footprint."""
    made = pattern(POSITION)
    full = [np.broadcast_to(np.asarray(v, float), p.shape) for v in (dpdx, dpdy)]
    return np.broadcast_to(evaluator([made], [POSITION, DPDX, DPDY])(p, *full)[0], len(p))


def supersampled(pattern: Any, p: np.ndarray, dpdx: Any, dpdy: Any, n: int = 60) -> np.ndarray:
    """The mean over a footprint of n x n evaluations without one."""
    steps = (np.arange(n) + 0.5) / n - 0.5
    u, v = np.meshgrid(steps, steps)
    moved = (u.ravel()[:, None] * np.asarray(dpdx, float)) + (v.ravel()[:, None] * np.asarray(dpdy, float))
    return values(pattern, (p[:, None] + moved).reshape(-1, 3)).reshape(len(p), -1).mean(axis=1)


def points(n: int = 300) -> np.ndarray:
    return np.random.default_rng(3).uniform(-7, 7, (n, 3)) * (1, 0, 1)


BOARDS = {
    "checker": rm.checker(0.0, 1.0, 0.8, axis="y"),
    "thin lines": rm.grid_lines(0.0, 1.0, 0.9, 0.07),
    "wide lines": rm.grid_lines(0.0, 1.0, 0.9, 0.7),
}


@pytest.mark.parametrize("width", [1e-3, 0.05, 0.3, 0.79, 1.3, 7.7])
@pytest.mark.parametrize("name", BOARDS)
def test_the_filter_is_the_mean_over_the_footprint(name: str, width: float) -> None:
    dpdx, dpdy = (width, 0, 0), (0, 0, 0.6 * width)
    n = 60 if width < 2 else 300
    expected = supersampled(BOARDS[name], points(3600 // n), dpdx, dpdy, n)
    found = values(BOARDS[name], points(3600 // n), dpdx, dpdy)
    # One column of n samples of each axis, at either of the two edges, may be on the other side.
    assert np.abs(found - expected).max() < 4 / 60
    assert np.abs(found - expected).mean() < 0.012


@pytest.mark.parametrize("name", BOARDS)
def test_a_footprint_at_an_angle_has_the_right_mean_and_no_more_contrast(name: str) -> None:
    dpdx, dpdy = (0.9, 0, 0.5), (-0.2, 0, 0.3)
    expected = supersampled(BOARDS[name], points(600), dpdx, dpdy, 30)
    found = values(BOARDS[name], points(600), dpdx, dpdy)
    assert abs(found.mean() - expected.mean()) < 0.01
    assert np.abs(found - expected).mean() < 0.03
    assert found.std() < 1.15 * expected.std() + 0.01


def test_without_a_footprint_the_board_is_that_of_cubes() -> None:
    p = points(3000)
    np.testing.assert_array_equal(values(rm.checker(0.0, 1.0, 0.8, axis="y"), p), values(rm.checker(0.0, 1.0, 0.8), p))
    wall = p[:, [1, 0, 2]]
    np.testing.assert_array_equal(values(rm.checker(0.0, 1.0, 0.8, "x"), wall), values(rm.checker(0.0, 1.0, 0.8), wall))
    lines = values(rm.grid_lines(0.0, 1.0, 0.9, 0.1), p)
    near = np.abs(p[:, [0, 2]] / 0.9 - np.round(p[:, [0, 2]] / 0.9)) * 0.9 < 0.05
    np.testing.assert_array_equal(lines > 0.5, near.any(axis=1))


def test_a_pattern_that_is_moved_keeps_its_footprint() -> None:
    board, dpdx, dpdy = BOARDS["checker"], (0.3, 0, 0), (0, 0, 0.2)
    found = values(lambda p: board(2.0 * p), points(), dpdx, dpdy)
    np.testing.assert_allclose(found, values(board, 2 * points(), 2 * np.array(dpdx), 2 * np.array(dpdy)), atol=1e-12)


def floor_of(pattern: Any) -> rm.Scene:
    solid = rm.plane().material(rm.Material(pattern, specular=0, ambient=0))
    camera = rm.Camera(position=(0.3, 1, 4), target=(0.6, 0.75, 0), fov=50)
    return rm.Scene(solid, camera=camera, lights=[rm.Sun((0, 1, 0))], sky=(0, 0, 0))


def test_a_floor_shows_its_mean_towards_the_horizon(egl: Context) -> None:
    board = rm.checker("white", "black", 0.5, axis="y")
    with rm.Renderer((320, 200), context=egl) as renderer:
        sharp = renderer.render(floor_of(rm.checker((1, 1, 1), (0, 0, 0), 0.5))).color[..., 0]
    truth = sharp.reshape(25, 8, 40, 8).mean(axis=(1, 3))
    with rm.Renderer((40, 25), context=egl) as renderer:
        filtered = renderer.render(floor_of(board)).color[..., 0]
        aliased = renderer.render(floor_of(rm.checker((1, 1, 1), (0, 0, 0), 0.5))).color[..., 0]
    ground = slice(int(np.flatnonzero((truth > 0.1).all(axis=1))[0]) + 1, 25)
    error, before = (np.abs(picture - truth)[ground].mean() for picture in (filtered, aliased))
    assert error < 0.05 and error < 0.3 * before
    reference = rm.truth(floor_of(board), (40, 25)).color[..., 0]
    assert np.quantile(np.abs(reference - filtered)[ground], 0.99) < 2e-3


@pytest.mark.parametrize("octaves", [1, 3, 6])
def test_noise_uses_its_range(octaves: int) -> None:
    p = np.random.default_rng(4).uniform(-50, 50, (20_000, 3))
    found = values(rm.noise(0.0, 1.0, 1.0, octaves), p)
    assert found.min() == 0.0 and found.max() == 1.0
    assert abs(found.mean() - 0.5) < 0.02 and 0.22 < found.std() < 0.26
    assert 0.005 < np.mean((found == 0) | (found == 1)) < 0.07


def test_marble_uses_its_range() -> None:
    p = np.random.default_rng(4).uniform(-50, 50, (20_000, 3))
    found = values(rm.marble(0.0, 1.0, 0.7), p)
    assert found.min() < 0.01 and found.max() > 0.99 and abs(found.mean() - 0.5) < 0.02
    straight = values(rm.marble(0.0, 1.0, 0.7, turbulence=0), p)
    np.testing.assert_allclose(straight, 0.5 + 0.5 * np.sin(2 * np.pi * p[:, 0] / 0.7), atol=1e-9)


def test_a_texture_times_a_tint(tmp_path: Any) -> None:
    Image.new("RGB", (4, 4), (255, 128, 0)).save(tmp_path / "c.png")
    picture = rm.planar(str(tmp_path / "c.png"), 1.0, "y")
    tinted = rm.Material(albedo=picture * (1, 0.5, 0.25))
    with_name = rm.Material(albedo="gray" * picture)
    at = np.zeros((1, 3))
    for made, tint in ((tinted, (1, 0.5, 0.25)), (with_name, (linear(128 / 255),) * 3)):
        found = evaluator([made.color], [POSITION, DPDX, DPDY])(at, at, at)[0]
        np.testing.assert_allclose(found[0], np.array([1, linear(128 / 255), 0]) * tint, rtol=1e-3)
    assert pickle.loads(pickle.dumps(tinted)) == tinted
    with pytest.raises(rm.SceneError, match="texture: arithmetic = 'nothing'"):
        picture * "nothing"


WRONG = [
    (lambda: rm.checker(0, 1, axis="w"), "checker: axis = 'w'"),
    (lambda: rm.checker("rde", 1), r"checker = 'rde' \(did you mean 'red'"),
    (lambda: rm.grid_lines(0, 1, 0.5, 0.6), "grid_lines: width = 0.6 with size = 0.5"),
    (lambda: rm.marble(0, 1, octaves=9), "marble: octaves = 9"),
]


@pytest.mark.parametrize(("make", "words"), WRONG)
def test_a_wrong_argument_of_a_pattern(make: Callable[[], Any], words: str) -> None:
    with pytest.raises(rm.SceneError, match=words):
        make()
