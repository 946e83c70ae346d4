"""Samples of lights, at the ends of their ranges, against float64."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

import raymarch as rm
from raymarch.expr.function import Function
from raymarch.expr.node import var
from raymarch.expr.types import VEC3
from raymarch.expr.vocabulary import get, record, vec2, vec3
from raymarch.gpu.context import Context
from raymarch.scene.light import FAR, LIGHT, POINT, SAMPLE, Light, sample_disc, sample_of
from tests.support.glsl_harness import evaluate

ULP = 2.0**-24


def sampled(egl: Context, light: Light, points: ArrayLike) -> tuple[NDArray[np.float32], ...]:
    """Direction (N, 3), distance (N,) and radiance (N, 3) of a light at some points, for far = 7 and u = (.25, .25)."""
    points = np.asarray(points, np.float32)
    far = np.full(len(points), 7.0)
    u = np.full((len(points), 2), 0.25)
    made = (Function("sampled", (POINT, SAMPLE, FAR), part) for part in sample_of(light))
    direction, distance, radiance = (evaluate(egl, function, [points, u, far]) for function in made)
    return direction, distance, radiance


@pytest.mark.parametrize(("terms", "at"), [((0.0, 0.0, 1.0), 3.0), ((1.0, 0.5, 0.25), 0.0), ((0.0, 0.0, 1e-38), 1e-3)])
def test_a_light_with_an_attenuation_is_finite_everywhere(egl: Context, terms: tuple[float, ...], at: float) -> None:
    """At the light itself there is no direction, and terms near 0 divide by nearly nothing; neither may give NaN."""
    points = np.array([[at, 0, 0], [0, at, 0], [0, 0, -at]])
    direction, _, radiance = sampled(egl, rm.PointLight((0, 0, 0), attenuation=terms), points)
    assert np.all(np.isfinite(radiance)) and np.all(np.isfinite(direction))
    divisor = max(terms[0] + at * terms[1] + at * at * terms[2], 2.0**-126)
    np.testing.assert_allclose(radiance, 1 / divisor, rtol=8 * ULP)
    np.testing.assert_allclose(direction, -points / max(at, 2.0**-63), rtol=8 * ULP)


@pytest.mark.parametrize("attenuation", [None, (1.0, 0.0, 0.0)])
def test_a_light_is_dark_beyond_its_range(egl: Context, attenuation: Any) -> None:
    far = np.array([0.25, 0.5, 1.0, 1.5, 4.0])
    points = np.stack([far, 0 * far, 0 * far], axis=1)
    _, _, radiance = sampled(egl, rm.PointLight((0, 0, 0), range=1.0, attenuation=attenuation), points)
    known = np.maximum(1 - far**4, 0) ** 2 / far**2 if attenuation is None else np.maximum(1 - far, 0)
    np.testing.assert_allclose(radiance, np.tile(known[:, None], 3), rtol=16 * ULP, atol=ULP)
    assert not radiance[far >= 1.0].any()


def test_a_light_at_the_surface_itself_is_finite(egl: Context) -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 4.0], [-1e-3, 0.0, 0.0]])
    far = np.linalg.norm(points, axis=1)
    direction, distance, radiance = sampled(egl, rm.PointLight((0, 0, 0)), points)
    assert np.all(np.isfinite(radiance)) and np.all(np.isfinite(direction))
    np.testing.assert_allclose(radiance[1:], np.broadcast_to(1 / far[1:, None] ** 2, (2, 3)), rtol=8 * ULP)
    np.testing.assert_allclose(distance[1:], far[1:], rtol=8 * ULP)
    np.testing.assert_allclose(direction[1:], -points[1:] / far[1:, None], rtol=8 * ULP)
    assert not direction[0].any()


def test_a_sun_is_as_far_as_the_scene_reaches(egl: Context) -> None:
    direction, distance, radiance = sampled(egl, rm.Sun((0, 3, 4), (0.5, 1, 0.25), 2.0), np.zeros((2, 3)))
    np.testing.assert_allclose(direction, [(0, 0.6, 0.8)] * 2, rtol=4 * ULP)
    assert np.all(distance == 7.0) and np.all(radiance == (1.0, 2.0, 0.5))


def test_a_spot_without_a_soft_edge_rises_within_a_millionth_of_the_cosine(egl: Context) -> None:
    """Dark up to the edge, half of the way squared in the middle, and never more than the whole light."""
    cosine = np.array([-1.0, 0.0, 0.5, 0.5 + 2.0**-21, 0.5 + 2.0**-19, 0.75, 1.0])
    points = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, -cosine], axis=1)
    for blend, width in ((0.0, 1e-6), (1 - np.arccos(0.75) / (np.pi / 3), 0.25)):
        spot = rm.SpotLight((0, 0, 0), (0, 0, -1), half_angle=np.pi / 3, blend=blend)
        direction, _, radiance = sampled(egl, spot, points)
        rise = np.clip((direction[:, 2].astype(float) - 0.5) / width, 0.0, 1.0) ** 2
        far2 = np.sum(points.astype(np.float32).astype(float) ** 2, axis=1)
        # the direction is that of the shader, so its cosine is exact; that of `blend` is rounded
        np.testing.assert_allclose(radiance[:, 0], rise / far2, rtol=16 * ULP / (1.0 if blend == 0 else 0.25), atol=ULP)


def test_a_part_of_a_lamp_lies_on_its_disc(egl: Context) -> None:
    """About each axis, where one of the two bases has no digits left, and for a ball that holds the surface."""
    ways = np.concatenate([np.eye(3), -np.eye(3), [[0.6, 0.0, 0.8], [0.48, 0.64, -0.6]]])
    direction = var("direction", VEC3)
    for width in (0.0, 0.25, 5.0):
        part = sample_disc(record(LIGHT, direction, 1.0, vec3(1.0)), width, vec2(0.9999, 0.3))
        found, lit = (
            evaluate(egl, Function("part", (direction,), get(part, name)), [ways]) for name in ("direction", "radiance")
        )
        sine = min(width, 0.999) * np.sqrt(0.9999)
        cosine = np.sqrt(1 - sine**2)
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=8 * ULP)
        # the cosine of a disc as wide as this is known to the ulps of its sine, times their ratio
        np.testing.assert_allclose(np.sum(found * ways, axis=1), cosine, rtol=8 * ULP / cosine**2)
        np.testing.assert_allclose(lit, 1 / cosine, rtol=8 * ULP / cosine**2)
