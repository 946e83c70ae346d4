"""Rays of one's own, and fields at a time and with values of parameters."""

from __future__ import annotations

import warnings
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import raymarch as rm

BALL = rm.sphere(1).translate((3, 0, 0))


def test_rays_meet_a_ball_where_its_formula_says() -> None:
    rng = np.random.default_rng(1)
    origins = rng.uniform(-4, 4, (500, 3))
    directions = rng.normal(size=(500, 3)) * rng.uniform(0.1, 9, (500, 1))
    found = rm.raycast(BALL, origins, directions)
    d = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    away = origins - (3, 0, 0)
    b, c = np.einsum("ij,ij->i", away, d), np.einsum("ij,ij->i", away, away) - 1
    with np.errstate(invalid="ignore"):
        near, far = -b - np.sqrt(b * b - c), -b + np.sqrt(b * b - c)
    true = np.where(c < 0, far, np.where(near >= 0, near, np.inf))
    true = np.where(np.isnan(true), np.inf, true)
    assert np.array_equal(found.hit, np.isfinite(true)) and 0 < found.hit.sum() < 500
    assert np.allclose(found.distance[found.hit], true[found.hit], rtol=0, atol=1e-9)
    on = found.position[found.hit] - (3, 0, 0)
    assert np.allclose(found.normal[found.hit], on, atol=1e-7)
    assert np.isnan(found.position[~found.hit]).all() and not found.normal[~found.hit].any()
    assert set(found.material) == {-1, 0}


def test_one_origin_or_one_direction_serves_all_rays() -> None:
    both = rm.raycast(rm.plane(), [(0, 2, 0), (5, 3, 1)], (0, -1, 0))
    assert both.distance.tolist() == [2.0, 3.0]
    assert rm.raycast(rm.plane(), (0, 2, 0), [(0, -1, 0), (0, 1, 0)], far=100).distance.tolist() == [2.0, np.inf]
    assert rm.raycast(rm.plane(), (0, 2, 0), (0, -1, 0), far=1.5).hit.tolist() == [False]
    assert len(rm.raycast(rm.plane(), np.zeros((0, 3)), (0, -1, 0)).distance) == 0


def test_materials_are_those_of_the_scene() -> None:
    red, blue = rm.Material(color="red"), rm.Material(color="blue")
    scene = rm.Scene(rm.box(1).material(red) | rm.box(1).translate((3, 0, 0)).material(blue))
    found = rm.raycast(scene, [(0, 0, 5), (3, 0, 5), (6, 0, 5)], (0, 0, -1))
    assert [None if i < 0 else scene.materials[i] for i in found.material] == [red, blue, None]


def test_time_and_parameters_move_the_solid() -> None:
    moving = rm.sphere(rm.Param("radius", 1, 0.5, 2)).translate((rm.time, 0, 0))
    assert rm.raycast(moving, (2, 0, 9), (0, 0, -1), time=2, params={"radius": 2}).distance[0] == pytest.approx(7)
    assert moving.distance((3, 0, 0), time=2, params={"radius": 0.5}) == pytest.approx(0.5)
    assert moving.distance((3, 0, 0)) == pytest.approx(2)
    assert moving.gradient((3, 0, 0), time=5).tolist() == [-1, 0, 0]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: rm.raycast(BALL, (0, 0, 0), (0, 0, 0)), "any length but 0"),
        (lambda: rm.raycast(BALL, (0, 0), (0, 0, 1)), "(N, 3) or (3,)"),
        (lambda: rm.raycast(BALL, np.zeros((2, 3)), np.ones((3, 3))), "2 origins, 3 directions"),
        (lambda: rm.raycast(BALL, (np.nan, 0, 0), (0, 0, 1)), "not finite"),
        (lambda: rm.raycast(BALL, (0, 0, 0), (0, 0, 1), far=-1), "far = -1"),
        (lambda: rm.raycast("ball", (0, 0, 0), (0, 0, 1)), "a Scene or a solid"),  # type: ignore[arg-type]
        (lambda: BALL.distance((0, 0, 0), params={"radius": 1}), "unknown parameter 'radius' = 1"),
        (lambda: BALL.distance((0, 0, 0), time=np.inf), "time = inf"),
    ],
)
def test_what_cannot_be_is_refused(call: object, words: str) -> None:
    with pytest.raises(rm.SceneError) as refused:
        call()  # type: ignore[operator]
    assert words in str(refused.value)


@pytest.mark.parametrize(
    "ask",
    [
        lambda node: node.distance((0, 0, 3), time=-1),
        lambda node: node.gradient((0, 0, 3), time=-1),
        lambda node: rm.raycast(node, (0, 0, 5), (0, 0, -1), time=-1),
        lambda node: rm.truth(node, (4, 4), time=-1),
        lambda node: rm.prove(node, SimpleNamespace(depth=np.ones((4, 4))), time=-1),
    ],
    ids=["distance", "gradient", "raycast", "truth", "prove"],
)
def test_values_out_of_range_are_warned_of_as_in_a_picture(ask: Any) -> None:
    node = rm.sphere(rm.time)
    with pytest.warns(rm.RenderWarning, match="sphere: radius = -1.0 at time = -1 .a number > 0.") as caught:
        ask(node)
    assert str(__file__) in str(caught[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert node.distance((0, 0, 3), time=1) == 2.0
