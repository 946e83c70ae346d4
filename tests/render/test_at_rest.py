"""Histories of pictures in which something moves: what rests converges, and what moved leaves nothing behind.

The truth is a picture of many times the size, drawn without a history, whose pixels NumPy averages in blocks. It shares
neither the places of samples nor their random numbers with the pictures in question.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest

import raymarch as rm
from raymarch.gpu.context import Context
from raymarch.gpu.renderer import Renderer

SIZE, BLOCK = (48, 32), 16
X = rm.Param("x", 0.0, -9, 9)
RED, GREY = rm.Material((0.9, 0.1, 0.05)), rm.Material((0.5, 0.5, 0.5))
MIRROR = rm.Material((0.9, 0.9, 0.9), metalness=1.0, roughness=0.0)
CAMERA = rm.Camera((0, 4, 7), (0, 0.3, 0), fov=40)


@pytest.fixture(scope="module")
def renderer(egl: Context) -> Iterator[Renderer]:
    with Renderer(SIZE, context=egl) as made:
        yield made


@pytest.fixture(scope="module")
def large(egl: Context) -> Iterator[Renderer]:
    with Renderer((SIZE[0] * BLOCK, SIZE[1] * BLOCK), context=egl) as made:
        yield made


@cache
def noisy(**quality: Any) -> rm.Scene:
    """A ball that moves behind, and a box that rests on the ground, in a penumbra of one random point a sample."""
    ball = rm.sphere(0.5).translate((X, 0.5, -1.5)).material(RED)
    box = rm.box((0.6, 0.6, 0.6)).translate((-1.2, 0.6, 1.0)).material(GREY)
    sun = rm.Sun((0.5, 1, 0.3), shadow=True, softness=0.6, penumbra="sampled")
    return rm.Scene(ball | box | rm.plane().material(GREY), CAMERA, [sun], quality=rm.Quality(**quality))


@cache
def mirrored(**quality: Any) -> rm.Scene:
    """A ball above a floor that is a mirror, under a light without noise."""
    ball = rm.sphere(0.5).translate((X, 0.7, 0.0)).material(RED)
    quality = {"integrator": "whitted", **quality}
    sky = rm.Sky((0.3, 0.4, 0.6))
    floor = rm.plane().material(MIRROR)
    return rm.Scene(ball | floor, CAMERA, [rm.Sun((0.5, 1, 0.3))], sky, bounces=2, quality=rm.Quality(**quality))


@cache
def shadowed(**quality: Any) -> rm.Scene:
    """The shadow of a ball that is above the picture."""
    ball = rm.sphere(0.6).translate((X, 5.0, 0.0)).material(RED)
    sun = rm.Sun((0, 1, 0.0001), shadow=True)
    return rm.Scene(ball | rm.plane().material(GREY), CAMERA, [sun], quality=rm.Quality(**quality))


def truth_of(large: Renderer, scene: rm.Scene, x: float) -> np.ndarray:
    """The mean over each pixel, and what covers it, (H, W, 3)."""
    many = large.render(scene, params={"x": x}).color.astype(float)
    return many.reshape(SIZE[1], BLOCK, SIZE[0], BLOCK, 3).mean(axis=(1, 3))


def noise_of(large: Renderer, scene: rm.Scene, x: float, where: np.ndarray) -> float:
    """The root mean square error of one sample of a pixel, from the variance of many."""
    many = large.render(scene, params={"x": x}).color.astype(float)
    return float(np.sqrt(many.reshape(SIZE[1], BLOCK, SIZE[0], BLOCK, 3).var(axis=(1, 3))[where].mean()))


def covered(large: Renderer, scene: rm.Scene, x: float) -> np.ndarray:
    """The fraction of each pixel that shows the ball, which moves."""
    (red,) = (i for i, material in enumerate(scene.materials) if material is RED)
    shown = large.render(scene, params={"x": x}).array("material") == red
    return shown.reshape(SIZE[1], BLOCK, SIZE[0], BLOCK).mean(axis=(1, 3))


def drawn(renderer: Renderer, scene: rm.Scene, places: Any) -> list[np.ndarray]:
    renderer.forget()
    return [renderer.render(scene, params={"x": x}).color.astype(float) for x in places]


def rms(a: np.ndarray) -> float:
    return float(np.sqrt(np.mean(a**2)))


def wide(mask: np.ndarray, by: int) -> np.ndarray:
    """The pixels up to so many from one of a mask."""
    h, w = mask.shape
    grown = np.pad(mask, by)
    return np.any([grown[y : y + h, x : x + w] for y in range(2 * by + 1) for x in range(2 * by + 1)], axis=0)


def test_still_surfaces_converge_while_something_moves(renderer: Renderer, large: Renderer) -> None:
    """As the root of the number of frames, and as if nothing moved: ground, a box and its edges, in noise."""
    places = [3.4 + 0.02 * n for n in range(32)]
    truth = truth_of(large, noisy(), places[0])
    region = np.zeros(SIZE[::-1], bool)
    region[14:, :28] = True
    frames = drawn(renderer, noisy(temporal="reproject"), places)
    still = drawn(renderer, noisy(temporal="reproject"), [places[0]] * 32)
    alone = noise_of(large, noisy(), places[0], region)
    for count in (4, 8, 16, 32):
        found, known = (rms((drawn[count - 1] - truth)[region]) for drawn in (frames, still))
        assert found <= 1.15 * alone / np.sqrt(count), count
        assert found <= 1.15 * known, count


WAYS = {
    "slow": [-1.0 + 0.05 * n for n in range(24)],
    "fast": [-1.0 + 0.2 * n for n in range(24)],
    "leaps after a rest": [-1.0] * 12 + [1.0, 1.1, 1.2, 1.3],
}


@pytest.mark.parametrize("way", WAYS)
def test_where_a_solid_was_nothing_is_left_of_it(renderer: Renderer, large: Renderer, way: str) -> None:
    """In noise, which hides the solid's colour from the clipping of histories. The colour of the ball stands out by its
    red, of which the ground has as much as of green."""
    places = WAYS[way]
    (*_, last) = drawn(renderer, noisy(temporal="reproject"), places)
    now = covered(large, noisy(), places[-1])
    was = np.max([covered(large, noisy(), x) for x in places[:-1:2]], axis=0)
    trail = (was > 0.2) & ~wide(now > 0, 1)
    assert trail.sum() >= 12
    truth, red = truth_of(large, noisy(), places[-1]), last[..., 0] - last[..., 1]
    full = (truth[..., 0] - truth[..., 1]).max()
    assert red[trail].mean() <= 0.005 * full and red[trail].max() <= 0.03 * full


@pytest.mark.parametrize("scene", [mirrored, shadowed])
@pytest.mark.parametrize("speed", [0.03, 0.2])
def test_mirrors_and_shadows_of_what_moves_are_fresh(
    renderer: Renderer, large: Renderer, scene: Any, speed: float
) -> None:
    """Where the image of the ball was, and where it is: no worse than a single sample, over several frames, as where
    edges lie in their pixels makes much of the error of one."""
    places = [-0.8 + speed * n for n in range(14)]
    frames = drawn(renderer, scene(temporal="reproject"), places)
    joined, single = [], []
    for n in range(8, 14):
        truth, before = (truth_of(large, scene(), places[k]) for k in (n, n - 4))
        alone = renderer.render(scene(), params={"x": places[n]}).color
        own = [wide(covered(large, scene(), places[k]) > 0, 1) for k in (n, n - 4)]
        where = (np.abs(truth - before).max(axis=2) > 0.01) & ~own[0] & ~own[1]
        assert where.sum() >= 8
        joined.append(rms((frames[n] - truth)[where]))
        single.append(rms((alone - truth)[where]))
    assert rms(np.array(joined)) <= 0.95 * rms(np.array(single))
