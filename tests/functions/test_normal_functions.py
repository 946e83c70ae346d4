"""Normals at the origin, far from it, on negative axes, and where a field has no gradient, against float64."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from raymarch.expr.types import VEC3, VEC4
from raymarch.gpu.context import Context
from tests.support.glsl_harness import modules, run

ULP = 2.0**-24
STEPS = {"central": 4.9215666e-3, "forward": 3.4526698e-4, "tetrahedron": 3.4526698e-4}
"""The steps of differences, in sizes of the largest coordinate: where rounding and truncation are equal."""
WAY = np.array([0.36, -0.48, 0.8])
WAYS = np.array([WAY, -WAY[[1, 2, 0]], WAY[[2, 0, 1]]])
"""Directions of length 1, each with another largest part."""


def _normals(egl: Context, method: str, field: str, p: NDArray[np.float64], also: ArrayLike) -> NDArray[np.float32]:
    text = modules(f"normal/{method}", before=f"vec4 given;\nfloat field(vec3 p) {{ return {field}; }}\n")
    text += "vec3 of(vec3 p, vec4 also, vec3 direction) { given = also; return surface_normal(p, direction); }\n"
    ways = np.broadcast_to(WAY, p.shape)
    return run(egl, text, "of({0}, {1}, {2})", [(VEC3, p), (VEC4, also), (VEC3, ways)], 3)


@pytest.mark.parametrize("method", STEPS)
def test_differences_are_as_exact_on_every_axis_and_far_away(egl: Context, method: str) -> None:
    """On a plane only rounding counts, an ulp of the coordinate over the step; each coordinate is the largest once."""
    sizes = (1e-9, 1e-3, 1.0, 37.0, 1e6)
    places = np.array([sign * size * np.eye(3)[i] for sign in (1, -1) for size in sizes for i in range(3)])
    p, n = np.repeat(places, len(WAYS), axis=0).astype(np.float32), np.tile(WAYS, (len(places), 1))
    on_plane = np.column_stack([n, np.einsum("ij,ij->i", p, n)])
    found = _normals(egl, method, "dot(p - given.xyz * given.w, given.xyz)", p, on_plane)
    assert np.linalg.norm(found - n, axis=1).max() < 16 * ULP / STEPS[method]


@pytest.mark.parametrize("method", STEPS)
def test_differences_follow_a_ball(egl: Context, method: str) -> None:
    """The step bends away from the sphere by half of its share of the radius, along each of three axes."""
    places = np.array([sign * size * way for sign in (1, -1) for size in (1e-3, 2.0, 1e6) for way in WAYS])
    radius = np.linalg.norm(places, axis=1)[:, None]
    found = _normals(egl, method, "length(p) - given.w", places, np.repeat(radius, 4, axis=1))
    known = places / radius
    assert np.linalg.norm(found - known, axis=1).max() < 2 * STEPS[method] + 16 * ULP / STEPS[method]


@pytest.mark.parametrize("method", STEPS)
def test_differences_at_the_origin(egl: Context, method: str) -> None:
    """No coordinate has a size there; a step of 0 would give NaN."""
    p = np.zeros((len(WAYS), 3))
    found = _normals(egl, method, "dot(p, given.xyz)", p, np.column_stack([WAYS, np.zeros(len(WAYS))]))
    np.testing.assert_allclose(found, WAYS, atol=32 * ULP)


@pytest.mark.parametrize("method", [*STEPS, "analytic"])
def test_where_there_is_no_gradient_the_normal_faces_the_ray(egl: Context, method: str) -> None:
    p = np.array([[0.0, 0, 0], [1, -2, 3], [-1e6, 0, 0]])
    if method == "analytic":
        text = modules(
            "normal/facing",
            "normal/analytic",
            before="vec4 field_gradient(vec3 p) { return vec4(0.0, 0.0, 0.0, 1.0); }",
        )
        found = run(egl, text, "surface_normal({0}, {1})", [(VEC3, p), (VEC3, np.tile(WAY, (3, 1)))], 3)
    else:
        found = _normals(egl, method, "1.0 + 0.0 * p.x", p, np.zeros((3, 4)))
    np.testing.assert_array_equal(found, np.tile(-WAY.astype(np.float32), (3, 1)))


def test_a_gradient_of_any_length_gives_a_normal_of_length_1(egl: Context) -> None:
    """Below 1e-12 it is rounding, and faces the ray."""
    lengths = np.array([1e-30, 1e-13, 1e-11, 1e-6, 1.0, 1e3, 1e12])
    text = modules("normal/facing", "normal/analytic", before="vec4 field_gradient(vec3 p) { return vec4(p, 0.0); }")
    found = run(
        egl,
        text,
        "surface_normal({0}, {1})",
        [(VEC3, lengths[:, None] * WAYS[1]), (VEC3, np.tile(WAY, (len(lengths), 1)))],
        3,
    )
    np.testing.assert_allclose(found, np.where(lengths[:, None] < 1e-12, -WAY, WAYS[1]), atol=8 * ULP)


def test_a_normal_on_the_far_side_is_turned(egl: Context) -> None:
    """Not one of a silhouette, which faces away by less than a quarter."""
    along = np.array([-1.0, -0.1, 0.0, 0.2, 0.24, 0.26, 1.0])
    normals = np.stack([np.sqrt(1 - along**2), 0 * along, along], axis=1)
    found = run(egl, modules("light/visible_side"), "visible_side({0}, vec3(0.0, 0.0, 1.0))", [(VEC3, normals)], 3)
    np.testing.assert_array_equal(found, np.where(along[:, None] > 0.25, -normals, normals).astype(np.float32))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_normal_without_relief_is_that_of_the_visible_side(egl: Context, side: float) -> None:
    """Relief that is exactly flat leaves it as it is; any other asks the function that bends it."""
    before = f"const float u_side = {side};\nvec3 shading_normal(vec3 n, vec3 v, vec3 g) {{ return v + 10.0 * g; }}\n"
    text = modules("light/visible_side", "light/bent_normal", before=before)
    along = np.array([-1.0, -0.2, 0.2, 0.3, 1.0])
    normals = np.stack([np.sqrt(1 - along**2), 0 * along, along], axis=1)
    flat, tilted = np.zeros_like(normals), np.broadcast_to((0.0, 1e-20, 0.0), normals.shape)
    call = "bent_normal({0}, vec3(0.0, 0.0, 1.0), {1})"
    seen = np.where(side * along[:, None] > 0.25, -normals, normals).astype(np.float32)
    np.testing.assert_array_equal(run(egl, text, call, [(VEC3, normals), (VEC3, flat)], 3), seen)
    bent = run(egl, text, call, [(VEC3, normals), (VEC3, tilted)], 3)
    np.testing.assert_array_equal(bent[:, 2], -1.0)
