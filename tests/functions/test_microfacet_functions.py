"""The answers of surfaces to light, as single functions, at the ends of their ranges, against float64."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from raymarch.expr.types import FLOAT, VEC3
from raymarch.gpu.context import Context
from raymarch.truth.light import albedo_f90, microfacets
from tests.functions.directions import slanted
from tests.support.glsl_harness import modules, run

ULP = 2.0**-24
ABOVE_ONE = 1 + 2.0**-22
"""A cosine of two unit vectors in float32, by rounding."""

SEEN = "struct Surface { vec3 p; vec3 normal; vec3 view; float t; Material material; };\n"
LIGHT = "struct Light { vec3 direction; float distance; vec3 radiance; };\n"
PHYSICAL = (
    "light/fresnel",
    "light/d_ggx",
    "light/correlated",
    "light/albedo_f90",
    "light/interface_transmittance",
    "light/physical",
)
Z = np.array([0.0, 0.0, 1.0])


def test_no_more_is_mirrored_than_comes(egl: Context) -> None:
    """Also for a normal that faces away from the eye, and a cosine that rounding has made more than 1."""
    cosine = np.array([-1.0, -0.5, 0.0, 0.25, 0.5, 1.0, ABOVE_ONE])
    found = run(egl, modules("light/fresnel"), "fresnel_schlick(vec3(0.04, 0.5, 1.0), {0})", [(FLOAT, cosine)], 3)
    base = np.array([0.04, 0.5, 1.0])
    known = base + (1 - base) * (np.clip(1 - cosine, 0, 1) ** 5)[:, None]
    np.testing.assert_allclose(found, known, rtol=16 * ULP)


def test_grazing_light_is_a_share_up_to_a_cosine_above_one(egl: Context) -> None:
    for rough in (0.0, 0.5, 1.0):
        cosine = np.array([0.0, 1e-4, 0.1, 0.5, 1.0, ABOVE_ONE])
        found = run(egl, modules("light/albedo_f90"), f"albedo_f90({{0}}, {rough})", [(FLOAT, cosine)])
        np.testing.assert_allclose(
            found, albedo_f90(cosine, np.full(6, rough)), rtol=1e-5, atol=1e-12
        )  # pow is the driver's


def test_facets_give_back_a_share_of_even_light(egl: Context) -> None:
    """Not less than nothing, and not more than all."""
    v, r = (a.ravel() for a in np.meshgrid([0.0, 1e-4, 0.01, 0.1, 0.5, 1.0, ABOVE_ONE], np.linspace(0, 1, 65)))
    found = run(
        egl,
        modules("light/albedo_f90", "light/missing_correlated", "light/directional_albedo"),
        "directional_albedo({0}, {1})",
        [(FLOAT, v), (FLOAT, r)],
        2,
    )
    assert np.all(np.isfinite(found)) and found.min() >= 0.0
    assert found.sum(axis=1).max() <= 1 + 4 * ULP


def answer(
    egl: Context, material: str, lights: ArrayLike, views: ArrayLike, visibility: float = 1.0
) -> NDArray[np.float32]:
    """What a surface whose normal is z sends to the eye of white light, by microfacets."""
    text = modules("material/physical", before="") + modules(*PHYSICAL, before=SEEN + LIGHT)
    surface = f"Surface(vec3(0), vec3(0, 0, 1), {{1}}, 1.0, {material})"
    call = f"eval_microfacet({surface}, Light({{0}}, 1.0, vec3(1)), {visibility})"
    return run(egl, text, call, [(VEC3, lights), (VEC3, views)], 3)


def truth(
    lights: NDArray[np.float64],
    views: NDArray[np.float64],
    color: ArrayLike,
    metal: float,
    rough: float,
    f0: float,
    several: bool = False,
) -> NDArray[np.float64]:
    """The same in float64."""
    one, three = np.ones((len(lights), 1)), np.ones((len(lights), 3))
    return microfacets(
        three * Z, views, lights, three * color, metal * one, rough * one, three * f0, "correlated", several
    )


@pytest.mark.parametrize("roughness", [0.0, 0.03, 0.3, 1.0])
@pytest.mark.parametrize("metalness", [0.0, 1.0])
def test_microfacets_are_those_of_float64(egl: Context, roughness: float, metalness: float) -> None:
    """A mirror too has a highlight: that of an alpha of 0.001."""
    lights = np.concatenate([slanted([1.0, 0.6, 0.28, 1e-3]), slanted([1.0, 0.6, 0.28], np.pi)])
    views = np.concatenate([slanted([1.0, 0.28, 0.6, 0.8], np.pi), slanted([1.0, 0.28, 0.96], 2.0)])
    found = answer(egl, f"Material(vec3(0.8, 0.5, 0.2), {metalness}, {roughness}, vec3(0.04))", lights, views)
    known = truth(lights, views, (0.8, 0.5, 0.2), metalness, roughness, 0.04)
    # Near a mirror the highlight's density follows the square of the facet's sine over alpha, known to some ulps.
    alpha = max(roughness**2, 1e-3)
    np.testing.assert_allclose(found, known, rtol=1e-5 + 16 * ULP / alpha, atol=1e-6)


METAL = ("light/missing_correlated", "light/missing_mean_correlated", "light/multiscatter_albedo", "light/multiscatter")


@pytest.mark.parametrize("roughness", [0.0, 0.03, 0.3, 1.0])
def test_what_several_facets_mirror_is_that_of_float64(egl: Context, roughness: float) -> None:
    """Up to light and eyes at the horizon, and of what is a metal in part."""
    lights = slanted([1.0, 0.6, 0.28, 1e-3, 0.0, -0.5])
    views = np.concatenate([slanted([1.0, 0.28, 0.6, 0.8], np.pi), slanted([0.5, 0.5])])
    text = modules("material/physical") + modules(*METAL, before=SEEN + LIGHT)
    made = f"Surface(vec3(0), vec3(0, 0, 1), {{1}}, 1.0, Material(vec3(1.0, 0.5, 0.2), 0.7, {roughness}, vec3(0.04)))"
    call = f"multiscatter(multiscatter_albedo({made}), {made}, Light({{0}}, 1.0, vec3(1)), 1.0)"
    found = run(egl, text, call, [(VEC3, lights), (VEC3, views)], 3)
    every, once = (truth(lights, views, (1.0, 0.5, 0.2), 0.7, roughness, 0.04, several) for several in (True, False))
    np.testing.assert_allclose(found, every - once, rtol=1e-3, atol=2e-6)
    assert not found[4:].any()


@pytest.mark.parametrize(("masking", "below", "above"), [("correlated", 0.008, 0.005), ("separable", 0.01, 0.005)])
def test_what_facets_keep_is_the_integral_but_for_the_fit(
    egl: Context, masking: str, below: float, above: float
) -> None:
    """The directional albedo of white facets, by midpoints over those that are seen; and its mean."""
    roughness = np.array([0.07, 0.12, 0.2, 0.33, 0.5, 0.66, 0.8, 0.93, 1.0])
    cosine = np.array([1e-3, 0.004, 0.01, 0.03, 0.07, 0.15, 0.3, 0.5, 0.75, 1.0])
    c, r = (a.ravel() for a in np.meshgrid(cosine, roughness))
    found = run(egl, modules(f"light/missing_{masking}"), "missing_albedo({0}, {1})", [(FLOAT, c), (FLOAT, r)])
    off = found.ravel() - [1.0 - given_back(*pair, masking) for pair in zip(c, r**2, strict=True)]
    assert -below <= off.min() and off.max() <= above, (off.min(), off.max())
    at = (np.arange(4000) + 0.5) / 4000
    c, r = (a.ravel() for a in np.meshgrid(at, roughness))
    fit = run(egl, modules(f"light/missing_{masking}"), "missing_albedo({0}, {1})", [(FLOAT, c), (FLOAT, r)])
    mean = run(egl, modules(f"light/missing_mean_{masking}"), "mean_missing_albedo({0})", [(FLOAT, roughness)])
    known = 2 * np.mean(fit.reshape(len(roughness), -1) * at, axis=1)
    np.testing.assert_allclose(mean.ravel(), known, rtol=0.02)


def given_back(cosine: float, alpha: float, masking: str) -> float:
    """The share of even light that white facets of GGX mirror once to an eye under a cosine: the mean of G2 / G1 over
    those that are seen."""
    u, turn = (a.ravel() for a in np.meshgrid((np.arange(256) + 0.5) / 256, np.pi * (np.arange(128) + 0.5) / 128))
    sine = np.sqrt(1 - cosine**2)
    flat = np.array([alpha * sine, 0.0, cosine]) / np.hypot(alpha * sine, cosine)
    z = (1 - u) * (1 + flat[2]) - flat[2]
    s = np.sqrt(np.maximum(1 - z * z, 0))
    h = np.stack([alpha * (s * np.cos(turn) + flat[0]), alpha * s * np.sin(turn), z + flat[2]])
    h /= np.linalg.norm(h, axis=0)
    to = 2 * (h[0] * sine + h[2] * cosine) * h[2] - cosine
    lit = np.where(to > 0, to, 1.0)
    eye, light = (0.5 * (np.sqrt(1 + alpha**2 * (1 / x**2 - 1)) - 1) for x in (cosine, lit))  # Smith's Lambda
    kept = (1 + eye) / (1 + eye + light) if masking == "correlated" else 1 / (1 + light)
    return float(np.where(to > 0, kept, 0.0).mean())


def test_a_surface_that_faces_away_from_light_is_dark(egl: Context) -> None:
    material = "Material(vec3(0.8), 0.0, 0.5, vec3(0.04))"
    lights = np.concatenate([slanted([-1.0, -0.5, -1e-4, 0.0]), slanted([-0.5])])
    assert not answer(egl, material, lights, np.broadcast_to(slanted([0.6], 1.0), (5, 3))).any()
    assert not answer(egl, material, [Z], [Z], visibility=0.0).any()


@pytest.mark.parametrize("roughness", [0.0, 0.5])
def test_a_surface_that_faces_away_from_the_eye_is_lit_as_edge_on(egl: Context, roughness: float) -> None:
    """A bent or numeric normal may; nothing then is less than 0."""
    material = f"Material(vec3(0.8), 0.0, {roughness}, vec3(0.0))"
    views = slanted([1e-4, -1e-3, -0.1, -0.3, -0.6], np.pi / 2)
    lights = np.broadcast_to(slanted([0.8]), (5, 3))
    found = answer(egl, material, lights, views)
    assert np.all(np.isfinite(found)) and found.min() >= 0.0
    np.testing.assert_allclose(found, truth(lights, views, 0.8, 0.0, roughness, 0.0), rtol=1e-3)


def phong(egl: Context, lights: ArrayLike, views: ArrayLike) -> NDArray[np.float32]:
    """White light on a surface whose normal is z: ambient 0.125, colour 0.5, highlight 1 of exponent 4."""
    text = modules("material/phong") + modules("light/phong", before=SEEN + LIGHT)
    surface = "Surface(vec3(0), vec3(0, 0, 1), {1}, 1.0, Material(vec3(0.5), 4.0, 1.0, 0.125))"
    call = f"eval_phong({surface}, Light({{0}}, 1.0, vec3(1)), 1.0)"
    return run(egl, text, call, [(VEC3, lights), (VEC3, views)], 3)[:, 0]


def test_phong_has_highlights_where_light_is_only(egl: Context) -> None:
    """Mirrored at the eye, at an angle, away from it, and from below, where the mirrored way would meet the eye."""
    lights = np.concatenate([slanted([1.0, 0.6, 0.8, 0.28, -0.28, -1.0])])
    views = np.concatenate([slanted([1.0, 0.6], np.pi), slanted([0.28, 0.28]), slanted([0.28], np.pi), slanted([1.0])])
    mirrored = lights * (-1, -1, 1)
    diffuse = np.maximum(lights[:, 2], 0)
    gloss = np.where(diffuse > 0, np.maximum(np.sum(mirrored * views, axis=1), 0) ** 4, 0)
    np.testing.assert_allclose(phong(egl, lights, views), 0.0625 + 0.5 * diffuse + gloss, rtol=1e-5, atol=1e-7)


def test_a_white_sky_gives_no_more_than_it_has(egl: Context) -> None:
    """Also to what faces away from the eye."""
    sky = "vec3 sky(vec3 d) { return vec3(1.0); }\nvec3 sky_mean(vec3 d) { return vec3(1.0); }\n"
    text = modules("material/physical") + modules(
        "light/albedo_f90", "light/missing_correlated", "light/directional_albedo", "sky/specular", before=SEEN + sky
    )
    views = slanted([-1.0, -0.5, -1e-3, 0.0, 0.3, 1.0])
    for rough in (0.0, 0.5, 1.0):
        material = f"Material(vec3(1), 0.0, {rough}, vec3(0.04))"
        call = f"specular_sky(Surface(vec3(0), vec3(0, 0, 1), {{0}}, 1.0, {material}), 0.0)"
        found = run(egl, text, call, [(VEC3, views)], 3)
        assert found.min() >= 0.0 and found.max() <= 1 + 16 * ULP


def test_nine_harmonics_give_no_negative_light(egl: Context) -> None:
    """A small sun leaves them below 0 on the far side."""
    ways = np.concatenate([np.eye(3), -np.eye(3)])
    light = np.zeros((9, 3))
    light[0], light[1] = 1.0, 1.0
    found = run(egl, modules("sky/mean"), "sky_mean({0})", [(VEC3, ways)], 3, {"u_sky_light": light})
    known = np.maximum(1 + np.sqrt(3) * ways[:, :1], 0)
    np.testing.assert_allclose(found, np.broadcast_to(known, (6, 3)), rtol=8 * ULP)
