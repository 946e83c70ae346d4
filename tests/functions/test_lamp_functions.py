"""The functions of lamps, at the ends of their ranges, against float64."""

from __future__ import annotations

import numpy as np
import pytest
from glsl_harness import modules, run

from raymarch.expr.types import FLOAT, VEC3
from raymarch.gpu.context import Context

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
    for name, known in (("fade", 1 - far / 1.0), ("window", np.maximum(1 - far**4, 0) ** 2)):
        found = run(egl, modules(f"light/{name}"), f"{name}({{0}}, 1.0)", [(FLOAT, far)])
        np.testing.assert_allclose(found, np.maximum(known, 0), rtol=8 * ULP, atol=ULP)
