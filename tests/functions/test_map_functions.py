"""Surfaces with maps, as single functions: seen from above, from the side, and bent away from the eye."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from raymarch.expr.glsl import print_functions
from raymarch.expr.types import VEC3
from raymarch.gpu.context import Context
from raymarch.scene.relief import footprint_axis, shading_normal
from tests.support.glsl_harness import modules, run

ULP = 2.0**-24
BEFORE = """
struct Relief { vec3 bump_gradient; float ambient_visibility; };
struct Ray { vec3 origin; vec3 direction; };
struct Hit { float t; };
struct Material { vec3 color; };
const float u_side = 1.0;
const float footprint_pixels = 2.0;
vec3 solid, bump_gradient;
float pixel_at(float t) { return 0.125 * t; }
vec3 inner_point(vec3 p, vec3 normal, Hit hit, float travelled) { return p; }
vec3 surface_normal(vec3 p, vec3 direction) { return solid; }
Material material_at(vec3 p, vec3 n, vec3 dpdx, vec3 dpdy) { return Material(vec3(1.0)); }
Relief relief_at(vec3 p, vec3 n, vec3 dpdx, vec3 dpdy) { return Relief(bump_gradient, 1.0); }
"""
AFTER = """
Surface seen(vec3 n, vec3 view, vec3 off) {
    solid = n;
    bump_gradient = off;
    return surface_interaction(Ray(vec3(0.0), -view), Hit(0.0), 2.0);
}
"""
WIDTH = 0.125 * 2.0 * 2.0
AXES = np.concatenate([np.eye(3), -np.eye(3)])
SLANTED = np.array([[0.36, 0.48, 0.8], [0.6, 0.0, -0.8], [0.0, 0.96, 0.28], [0.0, -0.96, 0.28]])


def seen(egl: Context, part: str, normals: object, views: object, gradients: object) -> NDArray[np.float32]:
    """A vector of the surface, for each normal, direction to the eye and bump gradient of the map."""
    made = "\n".join(line.text for line in print_functions([footprint_axis, shading_normal]).lines())
    names = ("light/visible_side", "light/bent_normal", "light/surface", "light/interaction")
    text = modules(*names, before=f"{BEFORE}{made}", variants=frozenset({"MAPPED", "RELIEF"}))
    return run(
        egl, text + AFTER, f"seen({{0}}, {{1}}, {{2}}).{part}", [(VEC3, v) for v in (normals, views, gradients)], 3
    )


@pytest.mark.parametrize("facing", [1.0, 0.5, 1e-6, 0.0, -0.5, -1.0])
def test_a_footprint_lies_in_the_surface(egl: Context, facing: float) -> None:
    """It is as wide as a pixel, and longer by one over the cosine; seen edge on as long as one of 1e-4 at most."""
    normals = np.concatenate([AXES, SLANTED])
    helper = np.roll(normals, 1, axis=1) + np.array([0.25, 0.5, 0.0])
    beside = np.cross(normals, helper)
    beside /= np.linalg.norm(beside, axis=1, keepdims=True)
    views = facing * normals + np.sqrt(1 - facing**2) * beside
    across, along = (seen(egl, part, normals, views, 0 * views) for part in ("dpdx", "dpdy"))
    np.testing.assert_allclose(np.linalg.norm(across, axis=1), WIDTH, rtol=8 * ULP)
    np.testing.assert_allclose(np.sum(across * normals, axis=1), 0.0, atol=WIDTH * 8 * ULP)
    long = WIDTH / max(abs(facing), 1e-4)
    # the cosine is a sum of products of which each is rounded
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), long, rtol=8 * ULP / max(abs(facing), 1e-1))
    for axis in (normals, across / WIDTH):
        np.testing.assert_allclose(np.sum(along * axis, axis=1), 0.0, atol=long * 8 * ULP)


def test_a_flat_map_bends_nothing(egl: Context) -> None:
    """Normals seen from behind are those of the near side, as without a map."""
    normals = np.concatenate([AXES, -AXES])
    views = np.concatenate([AXES, AXES]) * 0.8 + 0.6 * np.roll(np.concatenate([AXES, AXES]), 1, axis=1)
    found = seen(egl, "normal", normals, views, 0 * views)
    np.testing.assert_allclose(found, np.concatenate([AXES, AXES]), atol=8 * ULP)


def test_a_normal_is_bent_no_farther_than_it_is_seen(egl: Context) -> None:
    """On the side of the eye on which the solid's is: lifted to a cosine of some 0.01, of unit length."""
    normals = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    views = np.array([[0.6, 0.0, 0.8]] * 2)
    gradients = np.array([[4.0, 0.0, 0.0], [-4.0, 0.0, 0.0]])
    found = seen(egl, "normal", normals, views, gradients)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=8 * ULP)
    cosine = np.sum(found * views, axis=1) * [1.0, -1.0]
    assert np.all((cosine > 0.005) & (cosine < 0.02))


def test_the_normal_of_the_solid_is_on_the_side_of_the_bent_one(egl: Context) -> None:
    before = "struct Surface { vec3 normal; vec3 geometric_normal; };"
    bent = np.array([[0.6, 0.0, 0.8], [0.6, 0.0, -0.8]])
    call = "geometric_normal(Surface({0}, vec3(0.0, 0.0, 1.0)))"
    found = run(
        egl, modules("light/geometric_normal", before=before, variants=frozenset({"RELIEF"})), call, [(VEC3, bent)], 3
    )
    np.testing.assert_array_equal(found, [[0, 0, 1], [0, 0, -1]])
