"""The answers of surfaces to light, as single functions, at the ends of their ranges, against float64."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from raymarch.expr.function import Function
from raymarch.expr.glsl import print_functions
from raymarch.expr.node import const, expr, var
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import clamp, vec2
from raymarch.gpu.context import Context
from raymarch.scene.bsdf import Microfacets, Phong
from raymarch.scene.reflectance import (
    albedo_f90,
    fresnel_schlick,
    mean_missing_albedo,
    mean_missing_albedo_separable,
    missing_albedo,
    missing_albedo_separable,
)
from raymarch.scene.sky import MEAN
from raymarch.truth.bsdf import values_of
from tests.functions.directions import slanted
from tests.support.bsdf import VIEW, evaluated, material
from tests.support.glsl_harness import evaluate, run

ULP = 2.0**-24
ABOVE_ONE = 1 + 2.0**-22
"""A cosine of two unit vectors in float32, by rounding."""

Z = np.array([0.0, 0.0, 1.0])


def test_no_more_is_mirrored_than_comes(egl: Context) -> None:
    """Also for a normal that faces away from the eye, and a cosine that rounding has made more than 1."""
    cosine = np.array([-1.0, -0.5, 0.0, 0.25, 0.5, 1.0, ABOVE_ONE])
    base = np.array([0.04, 0.5, 1.0])
    found = evaluate(egl, fresnel_schlick, [np.tile(base, (len(cosine), 1)), cosine])
    known = base + (1 - base) * (np.clip(1 - cosine, 0, 1) ** 5)[:, None]
    np.testing.assert_allclose(found, known, rtol=16 * ULP)


def test_grazing_light_is_a_share_up_to_a_cosine_above_one(egl: Context) -> None:
    for rough in (0.0, 0.5, 1.0):
        cosine = np.array([0.0, 1e-4, 0.1, 0.5, 1.0, ABOVE_ONE])
        found = evaluate(egl, albedo_f90, [cosine, np.full(6, rough)])
        known = np.maximum(1 - cosine, 0) ** (5 + rough * (6.06 * rough - 7.04)) / (
            1 + rough**2 * (6.6 + 17.43 * rough)
        )
        np.testing.assert_allclose(found, known, rtol=1e-5, atol=1e-12)  # pow is the driver's


def test_facets_give_back_a_share_of_even_light(egl: Context) -> None:
    """Not less than nothing, and not more than all."""
    v, r = (a.ravel() for a in np.meshgrid([0.0, 1e-4, 0.01, 0.1, 0.5, 1.0, ABOVE_ONE], np.linspace(0, 1, 65)))
    symbols = var("v", FLOAT), var("r", FLOAT)
    made = Function("both", symbols, vec2(*Microfacets().directional_albedo(*symbols)))
    found = evaluate(egl, made, [v, r])
    assert np.all(np.isfinite(found)) and found.min() >= 0.0
    assert found.sum(axis=1).max() <= 1 + 4 * ULP


def values(color: ArrayLike, metalness: float, roughness: float, f0: float = 0.04) -> dict[str, Any]:
    color = tuple(np.broadcast_to(color, 3).tolist())
    return material(color=color, metalness=metalness, roughness=roughness, f0=(f0, f0, f0))


@pytest.mark.parametrize("roughness", [0.0, 0.03, 0.3, 1.0])
@pytest.mark.parametrize("metalness", [0.0, 1.0])
def test_microfacets_are_those_of_float64(egl: Context, roughness: float, metalness: float) -> None:
    """A mirror too has a highlight: that of an alpha of 0.001."""
    lights = np.concatenate([slanted([1.0, 0.6, 0.28, 1e-3]), slanted([1.0, 0.6, 0.28], np.pi)])
    views = np.concatenate([slanted([1.0, 0.28, 0.6, 0.8], np.pi), slanted([1.0, 0.28, 0.96], 2.0)])
    given = values((0.8, 0.5, 0.2), metalness, roughness)
    found = evaluated(egl, Microfacets(), given, lights, views)
    known = evaluated(None, Microfacets(), given, lights, views)
    # Near a mirror the highlight's density follows the square of the facet's sine over alpha, known to some ulps.
    alpha = max(roughness**2, 1e-3)
    np.testing.assert_allclose(found, known, rtol=1e-5 + 16 * ULP / alpha, atol=1e-6)


@pytest.mark.parametrize("roughness", [0.0, 0.03, 0.3, 1.0])
def test_what_several_facets_mirror_is_that_of_float64(egl: Context, roughness: float) -> None:
    """Up to light and eyes at the horizon, and of what is a metal in part."""
    lights = slanted([1.0, 0.6, 0.28, 1e-3, 0.0, -0.5])
    views = np.concatenate([slanted([1.0, 0.28, 0.6, 0.8], np.pi), slanted([0.5, 0.5])])
    given = values((1.0, 0.5, 0.2), 0.7, roughness)
    every, once = (evaluated(egl, Microfacets(compensated=several), given, lights, views) for several in (True, False))
    known, alone = (
        evaluated(None, Microfacets(compensated=several), given, lights, views) for several in (True, False)
    )
    found = every - once
    np.testing.assert_allclose(found, known - alone, rtol=1e-3, atol=2e-6 + 1e-6 * once.max())
    assert not found[4:].any()


@pytest.mark.parametrize(("masking", "below", "above"), [("correlated", 0.008, 0.005), ("separable", 0.01, 0.005)])
def test_what_facets_keep_is_the_integral_but_for_the_fit(
    egl: Context, masking: str, below: float, above: float
) -> None:
    """The directional albedo of white facets, by midpoints over those that are seen; and its mean."""
    roughness = np.array([0.07, 0.12, 0.2, 0.33, 0.5, 0.66, 0.8, 0.93, 1.0])
    cosine = np.array([1e-3, 0.004, 0.01, 0.03, 0.07, 0.15, 0.3, 0.5, 0.75, 1.0])
    c, r = (a.ravel() for a in np.meshgrid(cosine, roughness))
    missing, mean_of = FITS[masking]
    found = values_of(missing, c, r)
    off = found.ravel() - [1.0 - given_back(*pair, masking) for pair in zip(c, r**2, strict=True)]
    assert -below <= off.min() and off.max() <= above, (off.min(), off.max())
    at = (np.arange(4000) + 0.5) / 4000
    c, r = (a.ravel() for a in np.meshgrid(at, roughness))
    fit = values_of(missing, c, r)
    mean = evaluate(egl, mean_of, [roughness])
    known = 2 * np.mean(fit.reshape(len(roughness), -1) * at, axis=1)
    np.testing.assert_allclose(mean.ravel(), known, rtol=0.02)


FITS = {
    "correlated": (missing_albedo, mean_missing_albedo),
    "separable": (missing_albedo_separable, mean_missing_albedo_separable),
}


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
    lights = np.concatenate([slanted([-1.0, -0.5, -1e-4, 0.0]), slanted([-0.5])])
    views = np.broadcast_to(slanted([0.6], 1.0), (5, 3))
    assert not evaluated(egl, Microfacets(), values(0.8, 0.0, 0.5), lights, views).any()


@pytest.mark.parametrize("roughness", [0.0, 0.5])
def test_a_surface_that_faces_away_from_the_eye_is_lit_as_edge_on(egl: Context, roughness: float) -> None:
    """A bent or numeric normal may; nothing then is less than 0."""
    given = values(0.8, 0.0, roughness, 0.0)
    views = slanted([1e-4, -1e-3, -0.1, -0.3, -0.6], np.pi / 2)
    lights = np.broadcast_to(slanted([0.8]), (5, 3))
    found = evaluated(egl, Microfacets(), given, lights, views)
    assert np.all(np.isfinite(found)) and found.min() >= 0.0
    np.testing.assert_allclose(found, evaluated(None, Microfacets(), given, lights, views), rtol=1e-3)


def phong(egl: Context, lights: ArrayLike, views: ArrayLike) -> NDArray[np.float32]:
    """White light on a surface whose normal is z: ambient 0.125, colour 0.5, highlight 1 of exponent 4."""
    given = {name: expr(v) for name, v in {"color": (0.5, 0.5, 0.5), "shininess": 4.0, "specular": 1.0}.items()}
    given["ambient"] = expr(0.125)
    ambient = Phong().ambient(given)
    assert ambient is not None
    return evaluated(egl, Phong(), given, lights, views)[:, 0] + float(ambient.data[0])


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
    views = slanted([-1.0, -0.5, -1e-3, 0.0, 0.3, 1.0])
    one = const((1.0, 1.0, 1.0))
    for rough in (0.0, 0.5, 1.0):
        n_dot_v = clamp(VIEW.z, 0.0, 1.0)
        made = Microfacets().reflect_sky(values(1.0, 0.0, rough), n_dot_v, one, one, one, [0.0])
        found = evaluate(egl, Function("reflected", (VIEW,), made), [views])
        assert found.min() >= 0.0 and found.max() <= 1 + 16 * ULP


def test_nine_harmonics_give_no_negative_light(egl: Context) -> None:
    """A small sun leaves them below 0 on the far side."""
    ways = np.concatenate([np.eye(3), -np.eye(3)])
    light = np.zeros((9, 3))
    light[0], light[1] = 1.0, 1.0
    text = "uniform vec3 u_sky_light[9];\n" + "\n".join(line.text for line in print_functions([MEAN]).lines())
    found = run(egl, text, "sky_mean({0})", [(VEC3, ways)], 3, {"u_sky_light": light})
    known = np.maximum(1 + np.sqrt(3) * ways[:, :1], 0)
    np.testing.assert_allclose(found, np.broadcast_to(known, (6, 3)), rtol=8 * ULP)
