"""The functions of lamps, at the ends of their ranges, against float64."""

from __future__ import annotations

import numpy as np
import pytest

from raymarch.expr.types import FLOAT, VEC3
from raymarch.gpu.context import Context
from tests.support.glsl_harness import modules, run

ULP = 2.0**-24
LIGHT = "struct Light { vec3 direction; float distance; vec3 radiance; };"


@pytest.mark.parametrize(("terms", "at"), [((0.0, 0.0, 1.0), 3.0), ((1.0, 0.5, 0.25), 0.0), ((0.0, 0.0, 0.0), 2.0)])
def test_a_lamp_of_its_own_attenuation_is_finite_everywhere(egl: Context, terms: tuple[float, ...], at: float) -> None:
    """At the lamp itself there is no direction, and terms of 0 divide by nothing; neither may give NaN."""
    text = modules("light/attenuated", before=LIGHT)
    ways = np.array([[at, 0, 0], [0, at, 0], [0, 0, -at]])
    lit = run(egl, text, f"attenuated_light({{0}}, vec3(0.0), vec3(1.0), vec3{terms}).radiance", [(VEC3, ways)], 3)
    facing = run(egl, text, f"attenuated_light({{0}}, vec3(0.0), vec3(1.0), vec3{terms}).direction", [(VEC3, ways)], 3)
    assert np.all(np.isfinite(lit)) and np.all(np.isfinite(facing))
    divisor = max(terms[0] + at * terms[1] + at * at * terms[2], 2.0**-126)
    np.testing.assert_allclose(lit, 1 / divisor, rtol=8 * ULP)
    np.testing.assert_allclose(facing, -ways / max(at, 2.0**-63), rtol=8 * ULP)


def test_a_fading_lamp_is_dark_beyond_its_radius(egl: Context) -> None:
    far = np.array([0.0, 0.5, 1.0, 1.5, 4.0])
    functions = {"fade": ("linear_falloff", 1 - far / 1.0), "window": ("range_window", np.maximum(1 - far**4, 0) ** 2)}
    for name, (function, known) in functions.items():
        found = run(egl, modules(f"light/{name}"), f"{function}({{0}}, 1.0)", [(FLOAT, far)])
        np.testing.assert_allclose(found, np.maximum(known, 0), rtol=8 * ULP, atol=ULP)


def test_a_lamp_at_the_surface_itself_is_finite(egl: Context) -> None:
    ways = np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 4.0], [-1e-3, 0.0, 0.0]])
    far = np.linalg.norm(ways, axis=1)
    call = "point_light({0}, vec3(0.0), vec3(1.0))"
    lit = run(egl, modules("light/point", before=LIGHT), f"{call}.radiance", [(VEC3, ways)], 3)
    facing = run(
        egl, modules("light/point", before=LIGHT), f"vec4({call}.direction, {call}.distance)", [(VEC3, ways)], 4
    )
    assert np.all(np.isfinite(lit)) and np.all(np.isfinite(facing))
    np.testing.assert_allclose(lit[1:], np.broadcast_to(1 / far[1:, None] ** 2, (2, 3)), rtol=8 * ULP)
    np.testing.assert_allclose(facing[1:, 3], far[1:], rtol=8 * ULP)
    np.testing.assert_allclose(facing[1:, :3], -ways[1:] / far[1:, None], rtol=8 * ULP)
    assert not facing[0, :3].any()


def test_a_spot_without_a_soft_edge_rises_within_a_millionth_of_the_cosine(egl: Context) -> None:
    """Dark up to the edge, half of the way squared in the middle, and never more than the whole light."""
    cosine = np.array([-1.0, 0.0, 0.5, 0.5 + 2.0**-21, 0.5 + 2.0**-19, 0.75, 1.0])
    for inner, width in ((0.5, 1e-6), (0.75, 0.25)):
        found = run(
            egl,
            modules("light/spot"),
            f"spot_falloff(vec3(0, 0, -{{0}}), vec3(0, 0, 1), 0.5, {inner})",
            [(FLOAT, cosine)],
        )
        np.testing.assert_allclose(found, np.clip((cosine - 0.5) / width, 0.0, 1.0) ** 2, rtol=8 * ULP)


def test_a_part_of_a_lamp_lies_on_its_disc(egl: Context) -> None:
    """About each axis, where one of the two bases has no digits left, and for a ball that holds the surface."""
    ways = np.concatenate([np.eye(3), -np.eye(3), [[0.6, 0.0, 0.8], [0.48, 0.64, -0.6]]])
    before = LIGHT + "float random_of_pixel(int dimension) { return dimension == 0 ? 0.9999 : 0.3; }"
    text = modules("light/sample_disc", before=before)
    for width in (0.0, 0.25, 5.0):
        part = f"sample_disc(Light({{0}}, 1.0, vec3(1.0)), {width}, 0)"
        found = run(egl, text, f"{part}.direction", [(VEC3, ways)], 3)
        lit = run(egl, text, f"{part}.radiance", [(VEC3, ways)], 3)
        sine = min(width, 0.999) * np.sqrt(0.9999)
        cosine = np.sqrt(1 - sine**2)
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=8 * ULP)
        # the cosine of a disc as wide as this is known to the ulps of its sine, times their ratio
        np.testing.assert_allclose(np.sum(found * ways, axis=1), cosine, rtol=8 * ULP / cosine**2)
        np.testing.assert_allclose(lit, 1 / cosine, rtol=8 * ULP / cosine**2)
